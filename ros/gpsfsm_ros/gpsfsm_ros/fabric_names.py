"""The public names of Fabric, and the rules that move a Fabric behind the gate.

The gate offers the public names, so the Fabric behind it must have others: the same below a
namespace that clients do not use. A rule is a pair of names, as launch_ros takes them.
"""

PRIVATE = "/gpsfsm_private"

V2 = (
    "/fabric/set_plan",
    "/fabric/cancel_plan",
    "/fabric/set_completion",
    "/fabric/get_plan_status",
)
V3 = (
    "/fabric/plan/submit",
    "/fabric/plan/cancel",
    "/fabric/plan/set_completion",
    "/fabric/plan/get_status",
    "/fabric/plan/parse",
)
GENERATE = "/fabric/plan/generate"
"""An action of V3: what it generates goes into the queue inside Fabric, so it is hidden, too."""
_PARTS = ("send_goal", "get_result", "cancel_goal", "feedback", "status")


def hidden_names():
    """All names that a Fabric behind the gate must not have, of V2 and V3.

    Rules for names that a Fabric lacks do nothing. Where ROS 2 does not remap an action as such, it
    remaps its parts, so both are here.
    """
    parts = (f"{GENERATE}/_action/{part}" for part in _PARTS)
    return (*V2, *V3, GENERATE, *parts)


def remappings(namespace=PRIVATE):
    """The rules for the node of Fabric. Raises ValueError for a namespace that hides nothing.

    >>> remappings("/hidden")[0]
    ('/fabric/set_plan', '/hidden/fabric/set_plan')
    """
    namespace = namespace.rstrip("/")
    if not namespace.startswith("/"):
        raise ValueError(
            f"the namespace of the Fabric behind the gate is '{namespace}'; it has to begin with / "
            f"and to be more than that, such as {PRIVATE}"
        )
    return [(name, namespace + name) for name in hidden_names()]


def ros_arguments(namespace=PRIVATE):
    """The same as words for a command line of ``ros2 run``."""
    words = ["--ros-args"]
    for public, private in remappings(namespace):
        words += ["-r", f"{public}:={private}"]
    return words
