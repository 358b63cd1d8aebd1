"""The ledger among all interleavings of two goals, one stop and two faults.

The world here is a server of one action as its clients can meet it: messages wait for as long as
they like and arrive in any order, answers also twice; it may take its time, die, be started again,
freeze, and forget what has ended. The client acts by what the ledger says and by nothing else, as
``gpsfsm.ros.actions`` does: the second goal is sent once the first has ended, as its recovery.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import pytest

from gpsfsm.ros.ledger import LOST, NEVER, Entry, GoalState, Ledger, Said, after
from tests.cases import ALL as ALL_CASES

if TYPE_CHECKING:
    from collections.abc import Iterator

BASE = frozenset({"base"})
MOST_FAULTS = 2
ACTING = ("acting", "canceling")
FIRST, SECOND = 0, 1


@dataclass(frozen=True)
class Message:
    """A message on its way; ``epoch`` is the server that it is from or for.

    Of a question: whether the goal had been accepted when it was asked, whether another server
    had appeared by then, and for which attempt it is.
    """

    kind: str  # send, ask, cancel; accepted, rejected, unknown, ended
    goal: int
    epoch: int
    accepted: bool = False
    in_new: bool = False
    attempt: int = 0
    how: str = ""


@dataclass(frozen=True)
class World:
    entries: tuple[Entry, ...]
    there: tuple[str, ...] = ("", "")  # at the server: "", acting, canceling, ended, forgotten
    begun: tuple[int, ...] = (0, 0)  # how often each goal has begun to act
    sent_to: tuple[int, ...] = (-1, -1)
    attempts: tuple[int, ...] = (0, 0)
    answered: tuple[int, ...] = (0, 0)  # the attempt that a server has accepted
    refused: tuple[bool, ...] = (False, False)
    how: tuple[str, ...] = ("", "")
    epoch: int = 0
    is_alive: bool = True
    is_frozen: bool = False
    faults: int = 0
    stopped: bool = False
    confirmed: bool = False
    under_way: frozenset[Message] = frozenset()


def put(values: tuple, place: int, value: object) -> tuple:  # type: ignore[type-arg]
    return (*values[:place], value, *values[place + 1 :])


def told(world: World, goal: int, said: Said, how: str = "") -> World:
    entry = world.entries[goal]
    if entry.state is GoalState.UNKNOWN and said is not Said.SILENT:
        entry = after(entry, Said.ALIVE)
    return replace(world, entries=put(world.entries, goal, after(entry, said, how)))


# -- the client ------------------------------------------------------------------------------------


def client(world: World) -> Iterator[World]:
    for goal, entry in enumerate(world.entries):
        if entry.state is GoalState.NOT_SENT and may_be_sent(world, goal):
            yield sent(world, goal)
        if entry.may_act:
            for kind in ("ask", "cancel")[: 1 + entry.unwanted]:
                asked = question(world, goal, kind)
                tells = asked.accepted or asked.in_new or world.refused[goal] or entry.unwanted
                tells |= entry.state is GoalState.UNKNOWN
                if tells and not is_asked(world, goal):
                    yield replace(world, under_way=world.under_way | {asked})
            if goal == FIRST and not entry.unwanted:  # its time is over
                wanted = replace(entry, unwanted=True)
                yield replace(world, entries=put(world.entries, goal, wanted))
            if not world.is_alive or world.is_frozen:
                silent = told(world, goal, Said.SILENT)
                if silent != world:
                    yield silent
    if not world.stopped:
        unwanted = tuple(
            replace(each, unwanted=True) if each.may_act else each for each in world.entries
        )
        yield replace(world, stopped=True, entries=unwanted)
    elif not world.confirmed and not any(each.may_act for each in world.entries):
        yield replace(world, confirmed=True)


def is_asked(world: World, goal: int) -> bool:
    """Whether a question about a goal, or its answer, is on its way: one at a time is enough."""
    kinds = ("ask", "cancel", "unknown", "not cancelable")
    return any(each.goal == goal and each.kind in kinds for each in world.under_way)


def may_be_sent(world: World, goal: int) -> bool:
    """As ``Ledger.blocking`` has it; the recovery waits for the end of the first step."""
    first = world.entries[FIRST]
    if world.stopped or (goal == SECOND and first.state is not GoalState.ENDED):
        return False
    others = (each for place, each in enumerate(world.entries) if place != goal)
    return not any(each.is_in_doubt and each.resources & BASE for each in others)


def sent(world: World, goal: int) -> World:
    epoch = world.epoch  # of a dead one too, which the graph still shows
    world = told(world, goal, Said.SENT)
    attempts = put(world.attempts, goal, world.attempts[goal] + 1)
    arrives = {Message("send", goal, epoch, attempt=attempts[goal])} if world.is_alive else set()
    return replace(
        world,
        attempts=attempts,
        sent_to=put(world.sent_to, goal, epoch),
        refused=put(world.refused, goal, False),
        under_way=world.under_way | arrives,
    )


def question(world: World, goal: int, kind: str) -> Message:
    in_new = world.epoch > world.sent_to[goal]
    accepted = world.entries[goal].accepted
    if world.attempts[goal] > 1:  # the server of the first attempt may be heard late
        accepted = world.answered[goal] == world.attempts[goal]
    return Message(kind, goal, world.epoch, accepted, in_new, world.attempts[goal])


def heard(world: World, message: Message) -> World:
    """An answer has arrived; as ``Goal`` takes it in."""
    goal = message.goal
    if message.kind == "accepted":
        world = replace(world, answered=put(world.answered, goal, message.attempt))
        return told(world, goal, Said.ACCEPTED)
    if message.kind == "ended":
        if world.attempts[goal] > 1 and message.attempt != world.attempts[goal]:
            return told(world, goal, Said.ALIVE)  # maybe of the first server
        return told(world, goal, Said.ENDED, message.how)
    if message.kind == "not cancelable":  # it may be because it is being cancelled
        return told(world, goal, Said.ALIVE)
    if message.kind == "rejected":
        if message.attempt != world.attempts[goal]:
            return told(world, goal, Said.ALIVE)
        return told(replace(world, refused=put(world.refused, goal, True)), goal, Said.ALIVE)
    if message.attempt == world.attempts[goal]:
        if message.in_new:
            return told(world, goal, Said.ABSENT_IN_NEW)
        if message.accepted:
            return told(world, goal, Said.ABSENT)
        if world.refused[goal] and message.how == "after":
            return told(world, goal, Said.REJECTED, "rejected")
    return told(world, goal, Said.ALIVE)


# -- the server and the network --------------------------------------------------------------------


def server(world: World) -> Iterator[World]:
    if not world.is_alive or world.is_frozen:
        return
    for message in world.under_way:
        if message.kind in ("send", "ask", "cancel") and message.epoch == world.epoch:
            yield from served(replace(world, under_way=world.under_way - {message}), message)
    for goal, state in enumerate(world.there):
        if state in ACTING:
            yield ended(world, goal, "succeeded" if state == "acting" else "canceled")
        elif state == "ended" and world.faults < MOST_FAULTS:
            gone = put(world.there, goal, "forgotten")
            yield replace(world, there=gone, faults=world.faults + 1)


def ended(world: World, goal: int, how: str) -> World:
    status = Message("ended", goal, world.epoch, how=how)
    return replace(
        world,
        there=put(world.there, goal, "ended"),
        how=put(world.how, goal, how),
        under_way=world.under_way | {status},
    )


def served(world: World, message: Message) -> Iterator[World]:
    goal, state = message.goal, world.there[message.goal]

    def answer(kind: str, how: str = "") -> Message:
        return replace(message, kind=kind, how=how)

    if message.kind == "send":
        if state:  # it has this id
            yield replace(world, under_way=world.under_way | {answer("rejected")})
            return
        if goal == FIRST:
            yield replace(world, under_way=world.under_way | {answer("rejected")})
        yield replace(
            world,
            there=put(world.there, goal, "acting"),
            begun=put(world.begun, goal, world.begun[goal] + 1),
            under_way=world.under_way | {answer("accepted")},
        )
    elif state in ("", "forgotten"):
        how = "after" if world.refused[goal] else ""
        yield replace(world, under_way=world.under_way | {answer("unknown", how)})
    elif message.kind == "cancel" and state != "acting":
        yield replace(world, under_way=world.under_way | {answer("not cancelable")})
    elif state == "ended":
        yield replace(world, under_way=world.under_way | {answer("ended", world.how[goal])})
    elif message.kind == "cancel":
        yield replace(world, there=put(world.there, goal, "canceling"))
    else:
        yield world  # the result is asked for, and comes with its end


def network(world: World) -> Iterator[World]:
    for message in world.under_way:
        if message.kind in ("send", "ask", "cancel"):
            continue
        once = heard(world, message)
        yield replace(once, under_way=once.under_way - {message})
        if world.faults < MOST_FAULTS:
            if once != world:  # it will arrive a second time
                yield replace(once, faults=world.faults + 1)
            yield replace(
                world, under_way=world.under_way - {message}, faults=world.faults + 1
            )  # it is lost


def faults(world: World) -> Iterator[World]:
    if world.is_frozen:
        yield replace(world, is_frozen=False)
    if not world.is_alive:  # what the dead one did has ended with it
        yield replace(world, epoch=world.epoch + 1, is_alive=True)
    if world.faults == MOST_FAULTS:
        return
    if world.is_alive:
        requests = {each for each in world.under_way if each.kind in ("send", "ask", "cancel")}
        yield replace(
            world,
            is_alive=False,
            is_frozen=False,
            there=("", ""),
            faults=world.faults + 1,
            under_way=world.under_way - requests,
        )
        if not world.is_frozen:
            yield replace(world, is_frozen=True, faults=world.faults + 1)


def after_all(world: World) -> Iterator[World]:
    for part in (client, server, network, faults):
        yield from map(settled, part(world))


def settled(world: World) -> World:
    """Without messages that change nothing: of a goal that has ended all but a request to begin."""
    over = {goal for goal, each in enumerate(world.entries) if each.state is GoalState.ENDED}
    left = {each for each in world.under_way if each.goal not in over or each.kind == "send"}
    return world if len(left) == len(world.under_way) else replace(world, under_way=frozenset(left))


# -- what must hold --------------------------------------------------------------------------------


def wrong(world: World, *, may_repeat: bool) -> str:
    acting = [goal for goal, state in enumerate(world.there) if state in ACTING]
    if world.confirmed and acting:
        return "something moves after a stop that was confirmed"
    if len(acting) > 1:
        return "two goals use one resource"
    if not may_repeat and max(world.begun) > 1:
        return "a goal has begun twice"
    for goal, entry in enumerate(world.entries):
        if goal in acting and not entry.may_act:
            return f"a goal acts that the ledger says is {entry.state}"
        if entry.state is GoalState.ENDED:
            if entry.how in ("succeeded", "canceled") and world.how[goal] != entry.how:
                return f"the server does not say {entry.how}"
            once = world.attempts[goal] <= 1  # else a server that has died may have begun it
            if entry.how in (NEVER, "rejected") and once and world.begun[goal]:
                return f"it has begun, and the ledger says {entry.how}"
    return ""


def explored(*, may_repeat: bool) -> tuple[int, set[str]]:
    """How many worlds there are, and how goals ended in them."""
    entries = tuple(
        Entry(str(goal), "the action drive", BASE, may_repeat=may_repeat) for goal in (0, 1)
    )
    begin = World(entries)
    seen, left, ends = {begin}, [begin], set()
    while left:
        world = left.pop()
        problem = wrong(world, may_repeat=may_repeat)
        assert not problem, f"{problem}: {world}"
        ends |= {each.how for each in world.entries}
        for following in after_all(world):
            if following not in seen:
                seen.add(following)
                left.append(following)
    return len(seen), ends


@pytest.mark.parametrize("may_repeat", [False, True])
@pytest.mark.parametrize("most", [1, 2])
def test_what_the_ledger_says_holds_in_every_interleaving(
    monkeypatch: pytest.MonkeyPatch, most: int, *, may_repeat: bool
) -> None:
    if most == 2 and not ALL_CASES:
        pytest.skip("all interleavings of two faults are taken with CASES=all")
    monkeypatch.setattr(f"{__name__}.MOST_FAULTS", most)
    worlds, ends = explored(may_repeat=may_repeat)
    assert worlds > 10_000
    assert ends == {"", "succeeded", "canceled", "rejected", LOST}


def test_a_goal_that_cannot_be_cancelled_and_counts_as_ended_is_found_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    truly = heard

    def believes(world: World, message: Message) -> World:
        if message.kind == "not cancelable":
            return told(world, message.goal, Said.ENDED, "over")
        return truly(world, message)

    monkeypatch.setattr(f"{__name__}.heard", believes)
    with pytest.raises(AssertionError, match="a goal acts that the ledger says is ENDED"):
        explored(may_repeat=False)


def test_no_answer_that_counts_as_nothing_there_is_found_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def believes(entry: Entry, said: Said, how: str = "") -> Entry:
        if said is Said.ABSENT and entry.may_act:
            return replace(entry, state=GoalState.ENDED, how=LOST)
        return after(entry, said, how)

    truly = heard

    def heard_early(world: World, message: Message) -> World:
        if message.kind == "unknown":
            entry = believes(world.entries[message.goal], Said.ABSENT)
            return replace(world, entries=put(world.entries, message.goal, entry))
        return truly(world, message)

    monkeypatch.setattr(f"{__name__}.heard", heard_early)
    with pytest.raises(AssertionError, match=r"a goal acts that the ledger says is ENDED|moves"):
        explored(may_repeat=False)


def test_after_a_stop_nothing_is_sent_before_the_release() -> None:
    ledger = Ledger()
    ledger.begin(Entry("a", "the action drive", BASE))
    ledger.stop()
    assert ledger.take("a", Said.SENT).how == NEVER
    assert not ledger.open()
    ledger.release()
    ledger.begin(Entry("b", "the action drive", BASE))
    assert ledger.take("b", Said.SENT).state is GoalState.IN_FLIGHT


def test_what_is_in_doubt_is_blocking_of_its_resources_only() -> None:
    ledger = Ledger()
    ledger.begin(Entry("a", "the action drive", BASE))
    ledger.take("a", Said.SENT)
    assert not ledger.blocking(BASE, "b")
    ledger.take("a", Said.SILENT)
    assert [each.goal for each in ledger.blocking(BASE, "b")] == ["a"]
    assert not ledger.blocking({"arm"}, "b")
    ledger.take("a", Said.ALIVE)
    ledger.cancel("a")
    assert "may still begin" in ledger.blocking(BASE, "b")[0].words
    ledger.take("a", Said.ENDED, "canceled")
    assert not ledger.blocking(BASE, "b")
    assert ledger.take("a", Said.ACCEPTED).how == "canceled", "an end is final"
