"""Topics without ROS 2: what is asked for, what a step gets, why it gets nothing."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.model.ros import (
    Comparison,
    Condition,
    Durability,
    Quality,
    Reliability,
    RosCall,
    RosKind,
)
from gpsfsm.ros import topics
from gpsfsm.ros.fields import answer_misses
from gpsfsm.ros.node import RosError
from gpsfsm.ros.topics import (
    Cause,
    Inbox,
    Offer,
    Silence,
    check_conditions,
    matched,
    stamp_s,
)

BEST_EFFORT, RELIABLE = Reliability.BEST_EFFORT, Reliability.RELIABLE
VOLATILE, KEPT = Durability.VOLATILE, Durability.TRANSIENT_LOCAL
OFFERS = st.lists(
    st.builds(
        Offer, st.sampled_from("ab"), st.sampled_from(Reliability), st.sampled_from(Durability)
    )
)


@given(OFFERS)
def test_a_match_is_reached_by_all_publishers_and_is_the_strictest(offers: list[Offer]) -> None:
    wanted = matched(offers, ["a", "b"], Quality())
    own = [each for each in offers if each.kind == wanted.kind]
    assert wanted.kind == ("b" if offers and all(each.kind == "b" for each in offers) else "a")
    assert wanted.reliability is (
        RELIABLE if own and BEST_EFFORT not in {each.reliability for each in own} else BEST_EFFORT
    )
    assert wanted.durability is (
        KEPT if own and VOLATILE not in {each.durability for each in own} else VOLATILE
    )
    for each in own:
        assert Silence("/a", wanted, (each,)).cause is Cause.NO_MESSAGE


@given(OFFERS, st.sampled_from(Reliability), st.sampled_from(Durability))
def test_what_a_file_requests_overrides(
    offers: list[Offer], reliability: Reliability, durability: Durability
) -> None:
    wanted = matched(offers, ["a"], Quality(reliability, durability))
    assert wanted == Offer("a", reliability, durability)


@pytest.mark.parametrize(
    ("silence", "cause", "words"),
    [
        ({}, Cause.NO_PUBLISHER, "nothing publishes on /a"),
        ({"elsewhere": ("/r/a",)}, Cause.NO_PUBLISHER, "nothing publishes on /a; there is /r/a"),
        (
            {"offers": (Offer("p/msg/B", RELIABLE, KEPT),)},
            *(Cause.OTHER_TYPE, "/a is a p/msg/B on the robot, not a p/msg/A"),
        ),
        (
            {"offers": (Offer("p/msg/A", BEST_EFFORT, KEPT),) * 2},
            Cause.OTHER_QOS,
            "'qos' requests reliable, transient_local of /a, and its publishers offer "
            "best_effort, transient_local",
        ),
        (
            {"offers": (Offer("p/msg/B", RELIABLE, KEPT), Offer("p/msg/A", RELIABLE, KEPT))},
            *(Cause.NO_MESSAGE, "/a has a publisher, but no message has come"),
        ),
        ({"messages": 2, "age_s": 7.0}, Cause.TOO_OLD, "the last message of /a was 7 s old"),
        (
            {"messages": 2, "lacks": "x=1"},
            *(Cause.UNMET, "none of 2 messages of /a fits, the last has x=1"),
        ),
    ],
)
def test_the_reason_of_a_silence(silence: dict[str, Any], cause: Cause, words: str) -> None:
    made = Silence("/a", Offer("p/msg/A", RELIABLE, KEPT), **silence)
    assert (made.cause, made.words()) == (cause, words)


def numbers(inbox: Inbox, now_s: float, *, state: bool = False) -> list[int]:
    return [each.number for each in inbox.before(now_s, state=state)]


def filled(*at_s: float, within_s: float = 5, watch: bool = True) -> Inbox:
    inbox = Inbox(within_s, watch=watch)
    for each in at_s:
        inbox.put(None, b"m", each)
    return inbox


def test_a_step_gets_what_is_not_too_old_and_was_not_looked_at() -> None:
    inbox = filled(0, 4, 6, 7)
    assert numbers(inbox, 8) == [2, 3, 4]
    inbox.seen(inbox.before(8, state=False)[0])
    assert numbers(inbox, 8) == [3, 4]
    assert numbers(inbox, 12.5) == []
    assert numbers(inbox, 100, state=True) == [4], "a state holds until there is another one"


def test_who_does_not_watch_gets_the_newest() -> None:
    inbox = filled(0, 1, 2, watch=False)
    assert numbers(inbox, 3) == [3]
    inbox.seen(inbox.before(3, state=False)[0])
    assert numbers(inbox, 3) == []
    assert numbers(inbox, 3, state=True) == [3]


@given(
    st.lists(st.tuples(st.floats(0, 3), st.booleans()), max_size=30),
    st.floats(0.1, 9),
    st.booleans(),
)
def test_no_message_is_for_two_steps_and_none_is_skipped(
    happened: list[tuple[float, bool]], within_s: float, watch: bool
) -> None:
    """A step after some of the messages: against a list that forgets nothing."""
    inbox, everything, seen, now = Inbox(within_s, watch=watch), [], 0, 0.0
    for after_s, is_step in happened:
        now += after_s
        if not is_step:
            everything.append(inbox.put(None, b"m", now))
            continue
        due = [m.number for m in everything if m.number > seen and now - m.at_s <= within_s]
        assert numbers(inbox, now) == (due if watch else due[-1:])
        for message in inbox.before(now, state=False):
            inbox.seen(message)
            seen = message.number
    assert inbox.lost == 0


def test_what_is_too_much_to_be_kept_is_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topics, "_MOST", 3)
    inbox = filled(0, 1, 2, 3, 4)
    assert (numbers(inbox, 4), inbox.lost) == ([3, 4, 5], 2)
    monkeypatch.setattr(topics, "_MOST_BYTES", 10)
    inbox.put(None, b"x" * 9, 4)
    assert (numbers(inbox, 4), inbox.lost) == ([5, 6], 4)
    inbox.put(None, b"x" * 99, 4)
    assert numbers(inbox, 4) == [7], "the newest is kept however large it is"


def test_the_time_in_a_message() -> None:
    def message(**fields: Any) -> Any:
        return SimpleNamespace(**fields)

    stamp = message(sec=5, nanosec=500_000_000)
    assert stamp_s(message(header=message(stamp=stamp))) == 5.5
    assert stamp_s(message(stamp=stamp)) == 5.5
    assert stamp_s(message(stamp=message(sec=0, nanosec=0))) is None
    assert stamp_s(message(data=1)) is None


class Made:
    """A message with one field of each kind."""

    flag, count, level, text, items = True, 1, 0.5, "a", [1]

    def get_fields_and_field_types(self) -> dict[str, str]:
        kinds = ("boolean", "int32", "double", "string", "sequence<int32>")
        return dict(zip(("flag", "count", "level", "text", "items"), kinds, strict=True))


IS, ABOVE = Comparison.IS, Comparison.ABOVE


def test_conditions_that_can_hold() -> None:
    for condition in (
        *(Condition("flag", IS, False), Condition("count", IS, 2.0)),
        *(Condition("level", ABOVE, 1), Condition("text", IS, "b"), Condition("items[]", ABOVE, 0)),
    ):
        check_conditions(Made(), [[condition]], lambda value: None if value == "$absent" else value)
        assert answer_misses(Made(), RosCall(RosKind.TOPIC, until=((condition,),)), {}) == []


@pytest.mark.parametrize(
    "condition",
    [
        Condition("flag", IS, 1),
        Condition("flag", ABOVE, True),
        Condition("count", IS, True),
        Condition("level", IS, "high"),
        Condition("level", ABOVE, "$absent"),
        Condition("text", IS, 1),
        Condition("text", ABOVE, "a"),
        Condition("items", IS, 1),
        Condition("items[all]", IS, 1),
        Condition("text", Comparison.IS_NOT, 1),
        Condition("flags", IS, True),
    ],
)
def test_conditions_that_never_hold_are_refused(condition: Condition) -> None:
    with pytest.raises(RosError, match=r"'until' compares|has no field"):
        check_conditions(Made(), [[condition]], lambda value: None if value == "$absent" else value)
    call = RosCall(RosKind.TOPIC, until=((Condition("text", IS, "a"),), (condition,)))
    assert len(answer_misses(Made(), call, {})) == 1, "before the first goal, too"
    if condition.value == "$absent":
        assert answer_misses(Made(), call, {}, {"absent"}) == [], "the run may have a value"
