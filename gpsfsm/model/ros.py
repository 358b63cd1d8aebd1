"""Calls of runners on ROS 2, as the section ``ros`` of its provider's file describes it.

Frozen data. ``gpsfsm.ros`` acts by it; a check only reads it. Names of actions, services and topics
without a leading slash are relative to the namespace of the robot, as in ROS itself.
"""

from __future__ import annotations

from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple

from gpsfsm.late import dataclass, pattern
from gpsfsm.model.plan import Value

if TYPE_CHECKING:
    from collections.abc import Mapping

Fill = Value | tuple["Fill", ...]
"""What a field of a request is filled with: a value, or a list of such."""
WHOLE = "."
"""In place of a path: all of a message, as text."""
BEST_BY = "best by "
"""What picks the item of a list in which some field is the greatest, before its path."""
PICKS = ("", "first", "last", "all")
"""What picks from a list, besides: its length, an item, or all items."""
Steps = list[tuple[str, str | None]]

_PART = pattern(r"([a-z][a-zA-Z0-9_]*)(?:\[(.*)\])?")
_DEEPEST = 200  # characters of a path
_AXES = ("qx", "qy", "qz", "qw")


def steps(path: str) -> Steps:
    """The fields of a path that is read, each with what picks from its list. Raises ValueError.

    >>> steps("a.b[best by c[first].d].e[]")
    [('a', None), ('b', 'best by c[first].d'), ('e', '')]
    """
    parts, depth = [""], 0
    for sign in path[:_DEEPEST]:
        depth += (sign == "[") - (sign == "]")
        if sign == "." and not depth:
            parts.append("")
        else:
            parts[-1] += sign
    fields: Steps = []
    for part in parts:
        match = _PART.fullmatch(part)
        if match is None or depth or len(path) > _DEEPEST or (fields and fields[-1][1] == ""):
            raise ValueError(path)
        name, pick = match[1], match[2]
        if pick is not None and pick not in PICKS:
            if not pick.startswith(BEST_BY):
                raise ValueError(path)
            steps(pick.removeprefix(BEST_BY))
        fields.append((name, pick))
    return fields


def parameter_in(value: str) -> tuple[str, str]:
    """The parameter that a value names, and which part of the quaternion of its yaw is meant.

    >>> parameter_in("$x"), parameter_in("$yaw.qz")
    (('x', ''), ('yaw', 'qz'))
    """
    name, _, axis = value.removeprefix("$").rpartition(".")
    return (name, axis) if name and axis in _AXES else (value.removeprefix("$"), "")


class Comparison(StrEnum):
    """The comparisons of a field with a value that decide whether a call has succeeded."""

    IS = "=="
    IS_NOT = "!="
    AT_LEAST = ">="
    AT_MOST = "<="
    ABOVE = ">"
    BELOW = "<"


class Condition(NamedTuple):
    """A demand on a field: ``field comparison value``; the value may be a parameter (``$x``)."""

    field: str
    comparison: Comparison
    value: Value


class RosKind(StrEnum):
    """The kinds of exchange with a robot."""

    ACTION = "action"
    SERVICE = "service"
    TOPIC = "topic"
    TRANSFORM = "transform"


class OnResume(StrEnum):
    """The fate of a goal that was active when the process ended that had sent it."""

    ASK = "ask"  # its result is awaited; if the server does not know it, a person is asked
    CANCEL = "cancel"  # it is cancelled, and its runner has failed
    CONTINUE = "continue"  # its result is awaited, or it is sent again if the server has lost it


class Reliability(StrEnum):
    """The promise of a publisher about messages that get lost."""

    RELIABLE = "reliable"
    BEST_EFFORT = "best_effort"


class Durability(StrEnum):
    """The fate of a message for those who subscribe after it: kept for them, or not."""

    VOLATILE = "volatile"
    TRANSIENT_LOCAL = "transient_local"


@dataclass(frozen=True, slots=True)
class Quality:
    """The quality of service that a subscription requests; None: whatever its publishers offer."""

    reliability: Reliability | None = None
    durability: Durability | None = None
    depth: int = 10


@dataclass(frozen=True, slots=True)
class RosCall:
    """One exchange with a robot: a goal, a request, a message, a transform.

    ``types`` are full names of definitions (``nav2_msgs/action/NavigateToPose``), of which the
    first that is installed and offered is used. ``request`` fills fields: by a value, a list of
    values, or a parameter (``$x``); ``optional`` names those that a definition may lack.
    ``outputs`` and ``feedback`` are names and the fields that they come from; ``pose`` is the field
    of the feedback with the pose of the robot. ``success`` are sets of conditions, one of which has
    to hold whole, and ``message`` is the field that says why none does. ``frames`` are pairs of a
    frame and the frame that is looked up in it, tried in order. A topic has the rest: ``until`` are
    sets of conditions, one of which the message has to fulfil that is waited for, ``qos`` is the
    quality of service. Seconds: ``deadline_s`` for all of it, ``silence_s`` without feedback or
    messages, ``wait_s`` for the server to appear, ``probe_s`` for a sign of life, ``max_age_s``
    that a message may be old; 0 means without limit, and for ``max_age_s`` what docs/ros.md says.
    ``late``: its server need not be there when a plan begins.
    """

    kind: RosKind
    name: str = ""
    types: tuple[str, ...] = ()
    request: tuple[tuple[str, Fill], ...] = ()
    optional: tuple[str, ...] = ()
    outputs: tuple[tuple[str, str], ...] = ()
    feedback: tuple[tuple[str, str], ...] = ()
    pose: str = ""
    success: tuple[tuple[Condition, ...], ...] = ()
    message: str = ""
    frames: tuple[tuple[str, str], ...] = ()
    until: tuple[tuple[Condition, ...], ...] = ()
    qos: Quality = Quality()
    max_age_s: float = 0.0
    late: bool = False
    deadline_s: float = 0.0
    silence_s: float = 0.0
    wait_s: float = 5.0
    probe_s: float = 2.0
    on_resume: OnResume = OnResume.ASK


GOALS = "goals"
"""The option of a run that goes on that holds what a person says of its goals, by their ids."""
_RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
NETWORK = "network"
"""The option of a run that holds ``RosSettings.network`` as it was when the run began."""
DISCOVERY = {"localhost": "LOCALHOST", "subnet": "SUBNET", "off": "OFF"}
"""Who finds a node, by the word of a robot profile, as ROS 2 calls it."""


CAPABILITIES2 = "capabilities2"
VIA = (CAPABILITIES2,)
"""The servers of a robot that can let its runners act in the place of those of gpsfsm."""

DEADLINE_S = 600.0
"""Seconds after which a runner that acts on such a server has failed, if nobody says otherwise."""
DOUBT_S = 30.0
"""Seconds for which a run waits for a sign of life of a goal, if nobody says otherwise."""


@dataclass(frozen=True, slots=True)
class RosSettings:
    """The place of a robot on the network: what a node needs to reach it.

    ``domain`` None and ``discovery`` "": as the environment says. ``remap`` are names and what they
    stand for on this robot, ``arguments`` what follows ``--ros-args`` on the command line. ``via``
    is one of VIA, or "" if gpsfsm calls the robot itself; ``deadline_s`` bounds what acts there.
    A run ends in doubt if nobody says for ``doubt_s`` whether a goal acts.
    """

    domain: int | None = None
    namespace: str = ""
    discovery: str = ""
    remap: tuple[tuple[str, str], ...] = ()
    arguments: tuple[str, ...] = ()
    via: str = ""
    deadline_s: float = DEADLINE_S
    doubt_s: float = DOUBT_S

    def data(self) -> dict[str, Any]:
        """The settings as a heading of a run holds them: what differs from the defaults."""
        values = {
            "domain": self.domain,
            "namespace": self.namespace,
            "discovery": self.discovery,
            "remap": [list(pair) for pair in self.remap],
            "arguments": list(self.arguments),
            "via": self.via,
            "deadline_s": None if self.deadline_s == DEADLINE_S else self.deadline_s,
            "doubt_s": None if self.doubt_s == DOUBT_S else self.doubt_s,
        }
        return {name: value for name, value in values.items() if value not in (None, "", [])}

    def network(self, environment: Mapping[str, str]) -> dict[str, str]:
        """The network on which a node has these settings in effect, in this environment.

        >>> RosSettings(discovery="localhost").network({"ROS_DOMAIN_ID": "7"})
        {'domain': '7', 'namespace': '/', 'discovery': 'LOCALHOST', 'rmw': 'rmw_fastrtps_cpp'}
        """
        space = self.namespace
        for argument in self.arguments:
            space = argument.removeprefix("__ns:=") if argument.startswith("__ns:=") else space
        discovery = DISCOVERY.get(self.discovery) or environment.get(_RANGE) or "SUBNET"
        if environment.get("ROS_LOCALHOST_ONLY") == "1":  # the older one comes first in rcl
            discovery = "LOCALHOST"
        domain = environment.get("ROS_DOMAIN_ID") or "0"
        values = {
            "domain": domain if self.domain is None else str(self.domain),
            "namespace": f"/{space.strip('/')}",
            "discovery": discovery.upper(),
            "rmw": environment.get("RMW_IMPLEMENTATION") or "rmw_fastrtps_cpp",
            "peers": environment.get("ROS_STATIC_PEERS", ""),
            "discovery server": environment.get("ROS_DISCOVERY_SERVER", ""),
        }
        return {name: value for name, value in values.items() if value}

    @classmethod
    def of(cls, data: object) -> RosSettings:
        """The settings that ``data`` gave; the defaults for anything else."""
        if not isinstance(data, dict):
            return cls()
        seconds = {
            name: float(value)
            for name in ("deadline_s", "doubt_s")
            if isinstance(value := data.get(name), int | float)
        }
        return cls(
            domain=data.get("domain"),
            namespace=data.get("namespace", ""),
            discovery=data.get("discovery", ""),
            remap=tuple((old, new) for old, new in data.get("remap", ())),
            arguments=tuple(data.get("arguments", ())),
            via=str(data.get("via", "")),
            **seconds,
        )
