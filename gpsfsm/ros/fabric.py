"""The client of a Fabric server, the original one that runs plans, in two published releases.

The releases differ in the names of their services. Definitions of the two have names in
common and do not fit each other (``GetPlanStatus``), and the graph of ROS 2 lists a service that
cannot be called just like any other: so a service that is listed and does not get ready is one
whose definition differs, and this is said.
"""

from __future__ import annotations

import re
import threading
import time
from dataclasses import dataclass
from enum import IntEnum
from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.model.printable import clip
from gpsfsm.model.story import FABRIC_V2, FABRIC_V3
from gpsfsm.ros.messages import definition
from gpsfsm.ros.node import RosError

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.ros.node import RosNode

PUBLIC = "/fabric"
"""The namespace of the names that a Fabric server offers."""

EVENTS = "/capabilities/events"
"""The topic on which the Capabilities2 server tells what becomes of runners."""

SUBMIT, CANCEL, STATUS, COMPLETE, PARSE = "submit", "cancel", "status", "complete", "parse"
"""What can be requested, in any release."""

WAIT_S = 5.0
"""For a server to appear."""
ANSWER_S = 5.0
"""For an answer."""
_LOOK_S = 0.05
_NAME = re.compile(r"(?:/[A-Za-z_][A-Za-z0-9_]*)+")
_LONGEST_ID = 200


class Code(IntEnum):
    """The status of a plan, as fabric_msgs/msg/FabricStatus numbers it."""

    UNKNOWN = 0
    QUEUED = 1
    PARSING = 2
    PARSE_FAILED = 3
    VALIDATING = 4
    VALIDATION_FAILED = 5
    BONDING = 6
    BOND_FAILED = 7
    CAPABILITY_STARTING = 8
    CAPABILITY_START_FAILED = 9
    CAPABILITY_CONNECTING = 10
    CAPABILITY_CONNECT_FAILED = 11
    RUNNING = 12
    COMPLETED = 13
    CANCELLED = 14
    GENERATION_REQUESTED = 15
    GENERATION_COMPLETE = 16

    @property
    def failed(self) -> bool:
        """True if the server gave the plan up before it ran."""
        return self.name.endswith("_FAILED")


@dataclass(frozen=True, slots=True)
class Release:
    """A release: its services by what is requested, each a name and a definition.

    ``engine`` is the profile that says how it runs plans. ``generates`` is the name of its action
    that generates plans, "" for none. ``cancels``: a plan that is cancelled really ends.
    ``loses_sight``: the status of the plan that runs may be UNKNOWN.
    """

    name: str
    engine: str
    services: tuple[tuple[str, str, str], ...]
    generates: str = ""
    cancels: bool = True
    loses_sight: bool = False

    def __str__(self) -> str:
        return f"Fabric {self.name}"

    @property
    def first(self) -> str:
        """The service that identifies it: the one that takes plans."""
        return self.services[0][1]


_STATUS = "fabric_msgs/srv/GetPlanStatus"
_CANCEL = "fabric_msgs/srv/CancelFabricPlan"
_COMPLETE = "fabric_msgs/srv/CompleteFabric"
GENERATE = "fabric_msgs/action/GeneratePlan"

V2 = Release(
    "V2",
    FABRIC_V2,
    (
        (SUBMIT, "set_plan", "fabric_msgs/srv/SetFabricPlan"),
        (CANCEL, "cancel_plan", _CANCEL),
        (STATUS, "get_plan_status", _STATUS),
        (COMPLETE, "set_completion", _COMPLETE),
    ),
    cancels=False,
)
V3 = Release(
    "V3",
    FABRIC_V3,
    (
        (SUBMIT, "plan/submit", "fabric_msgs/srv/SubmitFabricPlan"),
        (CANCEL, "plan/cancel", _CANCEL),
        (STATUS, "plan/get_status", _STATUS),
        (COMPLETE, "plan/set_completion", _COMPLETE),
        (PARSE, "plan/parse", "fabric_msgs/srv/ParsePlan"),
    ),
    generates="plan/generate",
    loses_sight=True,
)
RELEASES = (V3, V2)


@dataclass(frozen=True, slots=True)
class PlanStatus:
    """The status of a plan as its server has it, with the elements that it has rejected."""

    code: Code
    rejected: tuple[str, ...] = ()


class Fabric:
    """A Fabric server below ``root``. ``at`` makes one; its methods wait for answers.

    They may be called from any thread but that of a node with one thread.
    """

    def __init__(self, node: RosNode, release: Release, root: str) -> None:
        self.release, self.root = release, root
        self._node = node
        kinds = {what: definition(kind) for what, _, kind in release.services}
        self._names = {what: f"{root}/{name}" for what, name, _ in release.services}
        self._kinds = kinds
        self._clients: dict[str, Any] = {
            what: node.do(partial(_client, node, kinds[what], name))
            for what, name in self._names.items()
        }

    @classmethod
    def at(
        cls,
        node: RosNode,
        root: str = PUBLIC,
        wait_s: float = WAIT_S,
        over: Callable[[], bool] = lambda: False,
    ) -> Fabric:
        """The server that offers the names below ``root``.

        Raises RosError if there is none, or none whose definitions are those that are installed,
        and KeyboardInterrupt once the waiting is ``over``.
        """
        root = full_name(root)
        end = time.monotonic() + wait_s
        while (release := release_at(node, root)) is None:
            if time.monotonic() > end:
                offered = " or ".join(
                    f"{root}/{each.first} ({each.name})" for each in reversed(RELEASES)
                )
                raise RosError(f"no Fabric server offers {offered}: is it started, in this domain?")
            if over():
                raise KeyboardInterrupt
            time.sleep(_LOOK_S)
        try:
            fabric = cls(node, release, root)
        except RosError as error:
            raise RosError(f"the server at {root} is a {release}, but {error}") from None
        for what, _, _ in release.services:
            fabric.wait_for(what, max(end - time.monotonic(), 1.0))
        return fabric

    def message(self, what: str) -> Any:
        """An empty request."""
        return self._kinds[what].Request()

    def kind(self, what: str) -> Any:
        """The definition of a service."""
        return self._kinds[what]

    def name(self, what: str) -> str:
        """The name of a service, as ROS 2 resolves it."""
        return str(self._clients[what].service_name)

    def is_ready(self, what: str) -> bool:
        """True if somebody offers a service, as far as the graph tells."""
        return bool(self._clients[what].service_is_ready())

    def wait_for(self, what: str, within_s: float) -> None:
        """Wait until a service can be called. Raises RosError, which says why it cannot."""
        end = time.monotonic() + within_s
        while not self.is_ready(what):
            if time.monotonic() > end:
                raise RosError(self._unready(what))
            time.sleep(_LOOK_S)

    def _unready(self, what: str) -> str:
        name = self._names[what]
        if servers_of(self._node, name):
            kind = next(kind for each, _, kind in self.release.services if each == what)
            return (
                f"{name} is listed, but the types do not match: the definition of {kind} that is "
                f"installed here is not that of the server, a {self.release}; source the "
                "workspace that the server was built in"
            )
        return f"the {self.release} server does not offer {name}"

    def request(self, what: str, message: Any, within_s: float = ANSWER_S) -> Any:
        """The answer to a request. Raises RosError if none comes in time."""
        client, answered = self._clients[what], threading.Event()
        future = client.call_async(message)
        future.add_done_callback(lambda _: answered.set())
        if not answered.wait(within_s):
            client.remove_pending_request(future)
            raise RosError(f"{self._names[what]} does not answer within {within_s:g} s")
        try:
            return future.result()
        except Exception as error:  # what rclpy says of an answer that it cannot decode
            raise RosError(f"{self._names[what]}: {clip(str(error), 300)}") from None

    # -- what can be requested ------------------------------------------------------------------

    def submit(self, plan: str, within_s: float = ANSWER_S) -> tuple[str, str]:
        """Submit a plan: its id, "" if it is rejected; then the second text says why."""
        message = self.message(SUBMIT)
        message.plan = plan
        answer = self.request(SUBMIT, message, within_s)
        if len(answer.plan_id) > _LONGEST_ID:
            raise RosError(
                f"{self._names[SUBMIT]} answers an id of {len(answer.plan_id):,} letters"
            )
        return str(answer.plan_id), clip(answer.error, 2_000)

    def status(self, plan_id: str, within_s: float = ANSWER_S) -> PlanStatus:
        """The status of a plan. V2 forgets plans that have ended: they are UNKNOWN."""
        message = self.message(STATUS)
        message.plan_id = plan_id
        answer = self.request(STATUS, message, within_s)
        try:
            code = Code(answer.status.code)
        except ValueError:
            code = Code.UNKNOWN
        rejected = tuple(clip(each, 300) for each in list(answer.rejected_list)[:20])
        return PlanStatus(code, rejected)

    def cancel(self, plan_id: str, within_s: float = ANSWER_S) -> bool:
        """Cancel a plan; the server's word for it, which means nothing in V2."""
        message = self.message(CANCEL)
        message.plan_id = plan_id
        return bool(self.request(CANCEL, message, within_s).success)


def full_name(name: str) -> str:
    """A name of ROS 2 with a leading slash. Raises UsageError for what is none.

    >>> full_name("fabric")
    '/fabric'
    """
    full = f"/{name.removeprefix('/').removesuffix('/')}"
    if not _NAME.fullmatch(full):
        raise UsageError(f"{clip(name, 100)!r} is not a valid ROS 2 name such as {PUBLIC}")
    return full


def _client(node: RosNode, kind: Any, name: str) -> Any:
    from rclpy.callback_groups import ReentrantCallbackGroup

    group = ReentrantCallbackGroup()
    return node.handle.create_client(kind, name, callback_group=group)


def release_at(node: RosNode, root: str) -> Release | None:
    """The release whose services somebody offers below ``root``; None if nobody does."""
    return next((each for each in RELEASES if servers_of(node, f"{root}/{each.first}")), None)


def servers_of(node: RosNode, name: str) -> int:
    """The number of servers that offer a service of any definition, with those of this node.

    What the graph lists by name alone has clients as well, which offer nothing.
    """
    handle = node.handle
    full = handle.resolve_service_name(name)
    if hasattr(handle, "count_services"):
        return int(handle.count_services(full))
    return sum(  # ROS 2 Humble; nodes of one name count once
        full in dict(handle.get_service_names_and_types_by_node(*each))
        for each in set(handle.get_node_names_and_namespaces())
    )


# --- events of the Capabilities2 server -----------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RunnerEvent:
    """An event of a runner instance: STARTED, STOPPED, FAILED, SUCCEEDED or TRIGGERED.

    ``instance`` is the number that the server gave it, -1 if it has none; ``target`` likewise for
    the runner that the event triggers, whose interface is ``triggers`` ("": none).
    """

    code: str
    interface: str
    provider: str
    instance: int
    triggers: str = ""
    target: int = -1
    plan_id: str = ""


_CODES = {1: "STARTED", 2: "STOPPED", 3: "FAILED", 4: "SUCCEEDED", 7: "TRIGGERED"}
_LATEST_EVENTS = 1_000


def subscribe(node: RosNode, topic: str, take: Callable[[RunnerEvent], object]) -> None:
    """Hand on the events of runners, in the thread of the node. Raises RosError.

    MissingPackageError is raised where capabilities2_msgs is not installed.
    """
    from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
    from rclpy.qos import QoSProfile

    full = full_name(topic)
    kind = definition("capabilities2_msgs/msg/CapabilityEventStamped")
    if "event" not in kind.get_fields_and_field_types():
        raise RosError("the definition of CapabilityEventStamped is of another version")

    def taken(message: Any) -> None:
        event = event_of(message)
        if event is not None:
            take(event)

    node.do(
        lambda: node.handle.create_subscription(
            kind,
            full,
            taken,
            QoSProfile(depth=_LATEST_EVENTS),
            callback_group=MutuallyExclusiveCallbackGroup(),
        )
    )


def event_of(message: Any) -> RunnerEvent | None:
    """The event of a runner that a message is about.

    None for events of the server itself, and for those of another client of it: Fabric numbers its
    instances, and others give them names.
    """
    event = message.event
    source, target = event.connection.source, event.connection.target
    code = _CODES.get(event.code.code)
    if code is None or not source.capability:
        return None
    name = source.instance_id or event.trigger_id
    if name and _number(name) < 0:
        return None
    texts = {each.key: each.value[0] for each in target.parameters[:100] if len(each.value)}
    return RunnerEvent(
        code,
        clip(source.capability, 200),
        clip(source.provider, 200),
        _number(name),
        clip(target.capability, 200),
        _number(target.instance_id),
        clip(str(texts.get("plan_id", "")), 200),
    )


def _number(text: str) -> int:
    return int(text) if text.isascii() and text.isdigit() and len(text) < 10 else -1
