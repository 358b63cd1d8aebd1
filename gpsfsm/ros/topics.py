"""The topics of a run: subscriptions that live as long as it, and the messages that steps get.

A subscription asks for the quality that its publishers offer. They show only once it is there, and
others come later: so it looks at them again and again, and is replaced where it does not fit any
more. The old one stays until the next look, so that nothing falls between the two. Messages are
kept as they arrive and decoded for a step: an image costs nothing as long as nobody wants it.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import dataclass
from enum import StrEnum
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from gpsfsm.model.ros import Comparison, Durability, Reliability
from gpsfsm.ros.messages import NUMBERS, definition, first_definition, kind_at
from gpsfsm.ros.node import RosError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from gpsfsm.model.ros import Condition, Quality, RosCall
    from gpsfsm.ros.node import RosNode

_LOOK_S = 0.2
BEFORE_S = 1.0
"""How long before a step a message may have come that it gets, where nothing else is said."""
_MOST = 10_000
_MOST_BYTES = 16_000_000
"""Of messages that wait for a watch to look at them."""
_RECENT = 64
_Word = TypeVar("_Word", Reliability, Durability)


class Offer(NamedTuple):
    """The offer of a publisher: its definition and its quality of service."""

    kind: str
    reliability: Reliability
    durability: Durability


def matched(offers: Sequence[Offer], kinds: Sequence[str], requested: Quality) -> Offer:
    """The request of a subscription with which all publishers of its definition reach it.

    Of ``kinds`` it is the first that is offered. Where nobody publishes it is what any publisher
    satisfies, so that one who sends a message as soon as there is a subscription is heard.
    """
    kind = next((each for each in kinds if any(each == offer.kind for offer in offers)), kinds[0])
    own = [offer for offer in offers if offer.kind == kind]
    reliable = own and all(each.reliability is Reliability.RELIABLE for each in own)
    kept = own and all(each.durability is Durability.TRANSIENT_LOCAL for each in own)
    return Offer(
        kind,
        requested.reliability or (Reliability.RELIABLE if reliable else Reliability.BEST_EFFORT),
        requested.durability or (Durability.TRANSIENT_LOCAL if kept else Durability.VOLATILE),
    )


# --- why there is no message ----------------------------------------------------------------------


class Cause(StrEnum):
    """The reasons why a step has no message."""

    NO_PUBLISHER = "no_publisher"
    OTHER_TYPE = "other_type"
    OTHER_QOS = "other_qos"
    NO_MESSAGE = "no_message"
    TOO_OLD = "too_old"
    UNMET = "unmet"


@dataclass(frozen=True)
class Silence:
    """The reason why a step has no message: what is offered, what is asked for, what has come.

    ``lacks`` is what the last of ``messages`` lacked, ``age_s`` how old it was if it was too old;
    ``elsewhere`` are topics of the same last name.
    """

    topic: str
    wanted: Offer
    offers: tuple[Offer, ...] = ()
    messages: int = 0
    lacks: str = ""
    age_s: float | None = None
    elsewhere: tuple[str, ...] = ()

    @property
    def cause(self) -> Cause:
        """The first reason that there is."""
        if self.messages:
            return Cause.UNMET if self.age_s is None else Cause.TOO_OLD
        if not self.offers:
            return Cause.NO_PUBLISHER
        own = [each for each in self.offers if each.kind == self.wanted.kind]
        if not own:
            return Cause.OTHER_TYPE
        return Cause.NO_MESSAGE if any(map(self._reaches, own)) else Cause.OTHER_QOS

    def _reaches(self, offer: Offer) -> bool:
        lossy = self.wanted.reliability is Reliability.BEST_EFFORT
        fleeting = self.wanted.durability is Durability.VOLATILE
        return (lossy or offer.reliability is Reliability.RELIABLE) and (
            fleeting or offer.durability is Durability.TRANSIENT_LOCAL
        )

    def words(self) -> str:
        """The reason for people."""
        wanted, topic = self.wanted, self.topic
        match self.cause:
            case Cause.NO_PUBLISHER:
                there = f"; there is {', '.join(self.elsewhere)}" if self.elsewhere else ""
                return f"nothing publishes on {topic}{there}"
            case Cause.OTHER_TYPE:
                return f"{topic} is a {self.offers[0].kind} on the robot, not a {wanted.kind}"
            case Cause.OTHER_QOS:
                offered = {f"{o.reliability}, {o.durability}": None for o in self.offers}
                return (
                    f"'qos' requests {wanted.reliability}, {wanted.durability} of {topic}, and its "
                    f"publishers offer {' and '.join(offered)}"
                )
            case Cause.NO_MESSAGE:
                return f"{topic} has a publisher, but no message has come"
            case Cause.TOO_OLD:
                return f"the last message of {topic} was {self.age_s:.3g} s old"
        count = "none of 1 message" if self.messages == 1 else f"none of {self.messages} messages"
        return f"{count} of {topic} fits, the last has {self.lacks}"


# --- the messages that a step gets ----------------------------------------------------------------


class Message(NamedTuple):
    """A message as it came: the class of its definition, its bytes, and when it was received."""

    number: int
    kind: Any
    content: bytes
    at_s: float


class Inbox:
    """The messages of a run that a step which begins may still take.

    Those that came at most ``within_s`` before it and that no step has looked at; the newest of
    them, or for a watch all. The newest message of a publisher that keeps it is a state: it counts
    for each step, however long ago it came.
    """

    def __init__(self, within_s: float, *, watch: bool) -> None:
        self._within_s, self._watch = within_s, watch
        self._kept: deque[Message] = deque()
        self._bytes = self._number = self._seen = 0
        self.lost = 0
        """Messages that a watch might have taken, and that were too many to be kept."""

    def put(self, kind: Any, content: bytes, now_s: float) -> Message:
        """Keep a message, and let go of others."""
        self._number += 1
        message = Message(self._number, kind, content, now_s)
        self._kept.append(message)
        self._bytes += len(content)
        while len(self._kept) > 1 and self._too_much(now_s):
            self._bytes -= len(self._kept.popleft().content)
        return message

    def _too_much(self, now_s: float) -> bool:
        first = self._kept[0]
        if not self._watch or first.number <= self._seen or now_s - first.at_s > self._within_s:
            return True
        full = len(self._kept) > _MOST or self._bytes > _MOST_BYTES
        self.lost += full
        return full

    def seen(self, message: Message) -> None:
        """A step has looked at a message: it is not for a later one."""
        self._seen = max(self._seen, message.number)

    def before(self, now_s: float, *, state: bool) -> list[Message]:
        """The messages that a step which begins may take, in the order in which they came."""
        if state:
            return [*self._kept][-1:]
        fresh = [each for each in self._kept if each.number > self._seen]
        return [each for each in fresh if now_s - each.at_s <= self._within_s]


def stamp_s(message: Any) -> float | None:
    """The time in the header of a message, in seconds; None if it has none."""
    stamp = getattr(getattr(message, "header", message), "stamp", None)
    seconds, rest = getattr(stamp, "sec", 0), getattr(stamp, "nanosec", 0)
    return seconds + rest / 1e9 if seconds or rest else None


def check_conditions(
    message: Any,
    sets: Iterable[Iterable[Condition]],
    value: Callable[[Any], Any] = lambda operand: operand,
) -> None:
    """Refuse comparisons that hold of no message, for which a watch would wait for ever, or of all.

    Raises RosError. ``value`` gives what an operand stands for.
    """
    for field, comparison, operand in (each for conditions in sets for each in conditions):
        kind, wanted = kind_at(message, field), value(operand)
        is_number = isinstance(wanted, int | float) and not isinstance(wanted, bool)
        if kind.startswith(NUMBERS):
            fits = is_number
        elif kind == "boolean":
            fits = isinstance(wanted, bool)
        else:
            fits = isinstance(wanted, str)
        ordered = comparison not in (Comparison.IS, Comparison.IS_NOT)
        if not fits or "[all]" in field or (ordered and not is_number):
            raise RosError(f"'until' compares {field}, a {kind}, with {comparison} {wanted!r}")


class Step:
    """A step that waits for a message. ``lacks`` says what one lacks that it does not end at."""

    def __init__(self, lacks: Callable[[Any], str]) -> None:
        from rclpy.task import Future

        self.lacks = lacks
        self.message: Any = Future()
        self.heard_s = time.monotonic()
        self.messages, self.last = 0, ""
        self.age_s: float | None = None

    def refuse(self, last: str) -> bool:
        """Note what a message lacks: False, it does not take it."""
        self.last, self.age_s = last, None
        return False

    def offer(self, message: Any, age_s: float, max_age_s: float) -> bool:
        """True if it takes a message."""
        self.age_s = age_s if max_age_s and age_s > max_age_s else None
        if self.age_s is not None:
            return False
        if lacks := self.lacks(message):
            return self.refuse(lacks)
        self.message.set_result(message)
        return True


# --- subscriptions --------------------------------------------------------------------------------


class Subscription:
    """The subscription of a run for one runner. All happens in the thread of the node."""

    def __init__(self, node: RosNode, call: RosCall) -> None:
        self._node, self._call = node, call
        self.name = node.name(call.name)
        self._kinds: dict[str, Any] = {}
        self._inbox = Inbox(call.max_age_s or BEFORE_S, watch=bool(call.until))
        self._steps: list[Step] = []
        self._wanted: Offer | None = None
        self._handles: list[Any] = []  # the last one counts
        self._recent: deque[tuple[int, int]] = deque(maxlen=_RECENT)
        self._timer: Any = None

    def open(self) -> None:
        """Subscribe, and look at the publishers from now on. Raises RosError."""
        from rclpy.clock import Clock, ClockType

        first, _ = first_definition(self._call.types)
        installed = dict.fromkeys((first, *self._call.types))
        for each in installed:
            try:
                self._kinds[each] = definition(each)
            except RosError:
                continue
        self.look()
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timer = self._node.handle.create_timer(_LOOK_S, self.look, clock=steady)

    def close(self) -> None:
        """Let go of it."""
        handle = self._node.handle
        if self._timer is not None:
            handle.destroy_timer(self._timer)
        while self._handles:
            handle.destroy_subscription(self._handles.pop())

    @property
    def kind(self) -> Any:
        """The definition that the robot has."""
        assert self._wanted is not None
        return self._kinds[self._wanted.kind]

    def look(self) -> None:
        """Ask for what is offered now."""
        wanted = matched(self._offers(), [*self._kinds], self._call.qos)
        while len(self._handles) > 1:
            self._node.handle.destroy_subscription(self._handles.pop(0))
        if wanted != self._wanted:
            self._wanted = wanted
            self._handles.append(self._subscribed(wanted))

    def _subscribed(self, wanted: Offer) -> Any:
        from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

        kind = self._kinds[wanted.kind]
        profile = QoSProfile(
            depth=self._call.qos.depth,
            reliability=ReliabilityPolicy[wanted.reliability.name],
            durability=DurabilityPolicy[wanted.durability.name],
        )

        def take(content: Any, info: Any) -> None:
            self._take(kind, content, info["source_timestamp"])

        return self._node.handle.create_subscription(kind, self.name, take, profile, raw=True)

    def _offers(self) -> list[Offer]:
        return [
            Offer(
                each.topic_type,
                _member(Reliability, each.qos_profile.reliability, Reliability.BEST_EFFORT),
                _member(Durability, each.qos_profile.durability, Durability.VOLATILE),
            )
            for each in self._node.handle.get_publishers_info_by_topic(self.name)
        ]

    # -- messages -----------------------------------------------------------------------------

    def _take(self, kind: Any, content: bytes, sent: int) -> None:
        same = (sent, len(content))
        if sent and same in self._recent and len(self._handles) > 1:
            return  # it came over the other one
        self._recent.append(same)
        message = self._inbox.put(kind, content, self._now_s())
        if self._steps:
            self._inbox.seen(message)
            self._steps = [each for each in self._steps if not self._handed(each, message)]

    def _handed(self, step: Step, message: Message) -> bool:
        from rclpy.serialization import deserialize_message

        step.heard_s = time.monotonic()
        step.messages += 1
        try:
            read = deserialize_message(message.content, message.kind)
        except Exception:  # its definition is of another version
            return step.refuse(f"bytes that are no {message.kind.__name__}")
        age_s = self._now_s() - message.at_s
        if self._call.max_age_s and (stamp := stamp_s(read)) is not None:
            now = self._node.handle.get_clock().now().nanoseconds / 1e9
            age_s = max(age_s, now - stamp)  # a stamp of the future makes nothing younger
        return step.offer(read, age_s, self._call.max_age_s)

    def _now_s(self) -> float:
        clock = self._node.handle.get_clock()
        return clock.now().nanoseconds / 1e9 if clock.ros_time_is_active else time.monotonic()

    def listen(self, step: Step) -> Any:
        """Give a step what came before it, or what comes; the future is of rclpy."""
        self.look()
        assert self._wanted is not None
        state = self._wanted.durability is Durability.TRANSIENT_LOCAL
        for message in self._inbox.before(self._now_s(), state=state):
            self._inbox.seen(message)
            if self._handed(step, message):
                return step.message
        self._steps.append(step)
        return step.message

    def leave(self, step: Step) -> None:
        """A step does not wait any more."""
        self._steps = [each for each in self._steps if each is not step]

    def lost(self) -> int:
        """The number of messages before a watch that could not be kept, once."""
        lost, self._inbox.lost = self._inbox.lost, 0
        return lost

    def silence(self, step: Step) -> Silence:
        """The reason why a step has no message."""
        self.look()
        assert self._wanted is not None
        offers = tuple(self._offers())
        last = self.name.rpartition("/")[2]
        names = [] if offers else [n for n, _ in self._node.handle.get_topic_names_and_types()]
        elsewhere = [n for n in names if n != self.name and n.rpartition("/")[2] == last]
        return Silence(
            *(self.name, self._wanted, offers, step.messages, step.last, step.age_s),
            elsewhere=tuple(elsewhere[:3]),
        )


def _member(words: type[_Word], policy: Any, least: _Word) -> _Word:
    """A policy of rclpy in our words; the least, which all satisfy, for one without a word."""
    return words.__members__.get(policy.name, least)


class Topics:
    """The subscriptions of one run, by runner, from its beginning to its end."""

    def __init__(self) -> None:
        self._made: dict[tuple[str, str], tuple[RosNode, Subscription]] = {}
        self._lock = threading.Lock()
        self._over = False

    def of(self, node: RosNode, key: tuple[str, str], call: RosCall) -> Subscription:
        """The subscription of a runner. Raises RosError. Not for the thread of the node."""
        with self._lock:
            if key not in self._made and not self._over:
                made = Subscription(node, call)
                node.do(made.open)
                self._made[key] = node, made
            if self._over:
                raise RosError("the run is over")
            return self._made[key][1]

    def close(self) -> None:
        """Let go of them; nothing is waited for but the one that is being made."""
        with self._lock:
            self._over = True
            for node, made in self._made.values():
                node.call(made.close)
            self._made.clear()
