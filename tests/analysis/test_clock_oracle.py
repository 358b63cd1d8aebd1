"""The brute force of resources, time and energy against answers computed by hand."""

from __future__ import annotations

from math import isinf
from typing import TYPE_CHECKING, Any

from hypothesis import given, settings
from hypothesis import strategies as st

from tests.cases import many
from tests.oracle import (
    Both,
    C,
    R,
    Says,
    par_all,
    par_any,
    plan,
    rec,
    seq,
)
from tests.oracle.capabilities import (
    Described,
    Parameter,
    World,
)
from tests.oracle.clocks import end_of, energy, makespan, orphans, overlaps, spans
from tests.oracle.orders import free_overlaps, loaded
from tests.oracle.support import C1, C2, R1
from tests.strategies import faults
from tests.strategies_capabilities import libraries, plans_over

if TYPE_CHECKING:
    from tests.oracle import Run
    from tests.oracle.capabilities import Bounds, Instance

HANG, NO_START = frozenset({"hang"}), frozenset({"no-start"})
few = settings(max_examples=many(60))


def holds(name: str, *resources: str, duration: Bounds | None = None) -> Described:
    return Described(name, resources=resources or ("base",), duration=duration)


def pair(one: str, other: str, resource: str = "base") -> set[tuple[str, str, str]]:
    return {(one, other, resource)}


BASE = (
    holds("Go"),
    holds("Say", "speaker"),
    holds("Both", "base", "speaker"),
    Described("Mute"),
)


def free(*children: C | R | str, **options: Any) -> set[tuple[str, str, str]]:
    world = World(plan(*children), BASE, **options)
    assert overlaps(world) == free_overlaps(world)
    return overlaps(world)


def test_overlaps() -> None:
    one, two = f"{C1}/Runner[1]", f"{C1}/Runner[2]"
    assert free("Go", "Go") == set()
    assert free(par_all("Go", "Go")) == pair(one, two)
    assert free(par_all("Go", "Say")) == set()
    assert free(par_all("Go", "Unknown")) == set()
    assert free(par_any("Both", "Both")) == pair(one, two) | pair(one, two, "speaker")
    assert free(par_all("Go", "Mute"), "Go") == set()
    assert free(par_any("Go", "Mute"), "Go") == pair(one, R1)  # an orphan
    assert free(par_any("Go", "Go"), constraint=Says(one, "fails")) == pair(one, two)
    # A failed parallel_all runs on while the recovery acts.
    assert free(par_all("Go", "Mute"), rec("Go")) == pair(one, f"{C2}/Runner[1]")
    assert free(par_all("Go", rec("Go"), "Mute")) == set()
    first_fails = Says(f"{C1}/Runner[2]", "succeeds")
    assert free(par_all("Go", "Mute"), rec("Go"), constraint=first_fails) == set()


def test_overlaps_not_later_than_the_end() -> None:
    first, second, third = (f"{C1}/Control[2]/Runner[{n}]" for n in (1, 2, 3))
    # The plan of 5.5 completes when it begins: only the first step of each branch is in time.
    instant = par_any(seq(), seq("Go", "Go", "Go"), seq("Go"))
    assert free(instant) == pair(first, f"{C1}/Control[3]/Runner[1]")
    assert (first, second) not in {each[:2] for each in free(instant)}
    # At the instant of the end counts: Mute completes and triggers Go.
    go, other = f"{C1}/Control[1]/Control[1]/Control[2]/Runner[1]", f"{C1}/Control[2]/Runner[1]"
    ends = seq("Mute", par_any(seq(), seq("Go")))
    assert free(par_any(ends, seq("Go", "Mute"))) == pair(go, other)
    # After it does not.
    assert free(par_any(seq("Mute", par_any(seq(), seq("Say", "Go"))), "Go")) == set()
    assert third not in {path for each in free(instant) for path in each}


def test_two_outcomes_at_the_instant_of_the_end() -> None:
    # Each Mute completes the plan and triggers a Go; both are active if both come at once.
    ends = seq("Mute", par_any(seq(), seq("Go")))
    go = f"{C1}/Control[%d]/Control[1]/Control[2]/Runner[1]"
    assert free(par_any(ends, ends)) == pair(go % 1, go % 2)


def test_overlaps_of_what_does_not_start_or_hangs() -> None:
    one, two = f"{C1}/Runner[1]", f"{C1}/Runner[2]"
    go = plan(par_any("Go", "Go"))
    for models, says in ((NO_START, Says(one, "does not start")), (HANG, Says(one, "hangs"))):
        world = World(go, BASE, faults=models, constraint=says)
        # Without a start the second unit is never triggered; it is if the first one hangs.
        assert free_overlaps(world) == (set() if models == NO_START else pair(one, two))
    last = World(go, BASE, faults=NO_START, constraint=Says(two, "does not start"))
    assert free_overlaps(last) == pair(one, two)  # active until it reports that


def test_overlaps_with_a_clock() -> None:
    def race(a: Bounds, b: Bounds) -> bool:
        """Whether B, begun with A, may still go on while C, which follows A, is active."""
        library = [
            Described("A", duration=a),
            holds("B", duration=b),
            holds("C", duration=(1, 1)),
        ]
        return bool(overlaps(World(plan(par_any("A", "B"), "C"), library)))

    assert race((1, 2), (3, 4))
    assert race((1, 2), (0, 2))  # A takes 1, B more
    assert not race((2, 2), (1, 2))  # an outcome at the instant is not active then
    assert race((2, 2), (1, 2.5))
    assert not race((3, 4), (1, 2))
    assert race((3, None), (1, None))
    assert race((0, 1), (1, 1))
    assert not race((1, None), (0, 1))
    assert race((0, 1), (0, 0.5))


def test_a_clock_sums_and_waits() -> None:
    # Only the branches' last steps hold the same: after 1 + 1 and 2.
    library = [
        Described("One", duration=(1, 1)),
        Described("Two", duration=(2, 2)),
        holds("Go", duration=(1, 1)),
    ]
    whole = plan(par_all(seq("One", "Go"), seq("Two", "Go")))
    assert overlaps(World(whole, library)) == set()
    longer = [*library[:2], holds("Go", duration=(1, 1.5))]
    assert overlaps(World(whole, longer)) != set()
    # A parallel_all waits for the longer one, a parallel_any for the shorter one.
    steps = [*library[:2], holds("Hold", duration=(2, 2)), holds("Go")]
    for before, late in ((par_all("One", "Two"), True), (par_any("One", "Two"), False)):
        world = World(plan(par_all(seq(before, "Go"), "Hold")), steps)
        assert (overlaps(world) == set()) is late
        assert free_overlaps(world) != set()


def test_the_end_bounds_the_clock() -> None:
    # Quick ends the plan by 1, Late begins at 2, while Go still holds the base.
    library = [
        Described("Quick", duration=(1, 1)),
        Described("Wait", duration=(2, 2)),
        holds("Go", duration=(5, 5)),
    ]
    whole = plan(par_any("Quick", seq("Wait", "Go"), "Go"))
    quick = f"{C1}/Runner[1]"
    sure = World(whole, library, constraint=Says(quick, "succeeds"))
    assert free_overlaps(sure) != set()
    assert overlaps(sure) == set()
    assert overlaps(World(whole, library, constraint=Says(quick, "fails"))) != set()


def test_a_duration_may_be_a_parameter_and_a_hanging_runner_has_none() -> None:
    timed = Described(
        "Wait", parameters=(Parameter("s", default=1, type="double"),), duration=("s", "s")
    )
    library = [timed, holds("Go", duration=(2, 2))]

    def late(wait: str, **options: Any) -> bool:
        whole = plan(par_any("Go", wait), "Go")
        return bool(overlaps(World(whole, library, **options)))

    assert late("Wait")
    assert late("Wait s=1.5")
    assert not late("Wait s=2")
    assert not late("Wait s=3")
    hangs = Says(f"{C1}/Runner[1]", "hangs")
    assert late("Wait s=3", faults=HANG, constraint=hangs)
    assert not late("Wait s=3", faults=HANG, constraint=Says(f"{C1}/Runner[1]", "succeeds"))


def test_a_duration_of_zero_is_as_short_as_one_likes_and_never_none() -> None:
    library = [
        Described("Zero", duration=(0, 0)),
        Described("Soon", duration=(0, 1)),
        Described("One", duration=(1, 1)),
    ]
    a, b = f"{C1}/Runner[1]", f"{C1}/Runner[2]"

    def left(*children: C | R | str, **options: Any) -> set[str]:
        return orphans(World(plan(*children), library, **options))

    assert left("Zero", "Zero") == set()
    assert left(par_any("One", "One")) == set()  # at the same instant
    assert left(par_any("Zero", "Zero")) == {a, b}  # either may end first
    assert left(par_any("Zero", "One")) == {b}  # also if it fails, it is over then
    assert left(par_any("Zero", "Soon")) == {a, b}
    # Any number of them is shorter than what is longer than 0, but longer than nothing.
    several = plan(par_any(seq("Zero", "Zero", "Zero"), "Zero", "One"))
    assert orphans(World(several, library, constraint=Says(b, "fails"))) == {
        f"{C1}/Control[1]/Runner[1]",
        f"{C1}/Control[1]/Runner[2]",
        f"{C1}/Control[1]/Runner[3]",
        a,
        b,
    }
    late = plan(par_any(seq("Zero", "One"), "One"))
    of_one = f"{C1}/Control[1]/Runner[2]"
    assert orphans(World(late, library, constraint=Says(a, "succeeds"))) == {of_one}
    assert makespan(World(several, library)) == (0, 1)
    assert makespan(World(late, library, constraint=Says(a, "succeeds"))) == (1, 1)


def test_what_does_not_start_heeds_no_least_duration() -> None:
    library = [Described("One", duration=(1, 1)), Described("Two", duration=(2, 2))]
    two, one = f"{C1}/Runner[1]", f"{C1}/Runner[2]"
    whole = plan(par_all("Two", "One"), rec(seq()))
    for models, outcome, expected in (
        (NO_START, "does not start", set()),  # One is never triggered
        (frozenset(), "fails", set()),
    ):
        says = Both(Says(two, outcome), Says(one, "succeeds"))
        assert orphans(World(whole, library, faults=models, constraint=says)) == expected
    last = plan(par_all("One", "Two"), rec(seq()))
    absent = Both(Says(two, "succeeds"), Says(one, "does not start"))
    assert orphans(World(last, library, faults=NO_START, constraint=absent)) == {two}
    assert makespan(World(last, library, faults=NO_START, constraint=absent)) == (0, 2)


def test_loaded() -> None:
    def count(*children: C | R | str, **options: Any) -> tuple[int, int] | None:
        return loaded(World(plan(*children), (), **options))

    assert count() == (0, 0)
    assert count("A", "B", "C") == (1, 3)
    assert count("A x=1", "A x=2") == (1, 1)
    assert count(par_all("A", "A", "B")) == (2, 2)
    assert count(par_all("A", R("A", provider="other/One"))) == (2, 2)
    assert count(par_any("A", "B"), "C") == (2, 3)
    assert count(par_any("A", "B", "D"), "C") == (3, 4)
    assert count(par_all("A", "B"), rec("C")) == (2, 3)
    assert count(par_any(seq(), seq("A", "B")), "C") == (2, 3)
    assert count(par_any(seq(), seq("A", "B"))) == (1, 2)  # too late
    assert count(rec("A"), "B") == (1, 2)  # unreachable, but loaded
    assert count("A", constraint=lambda scenario: False) is None
    ends = par_any(seq(), seq("B"))
    assert count(par_any(seq("A", ends), seq("C", par_any(seq(), seq("D"))))) == (2, 4)
    assert count("A", "capabilities/FabricCompletionRunner", "A") == (1, 2)


TIMED = (
    Described("A", duration=(1, 2), energy=(1, 2)),
    Described("B", duration=(3, 5), energy=(10, 20)),
    Described("Open", duration=(2, None), energy=(5, None)),
    Described("Mute"),
)


def times(*children: C | R | str, **options: Any) -> tuple[float, float | None] | None:
    return makespan(World(plan(*children), TIMED, **options))


def joules(*children: C | R | str, **options: Any) -> tuple[float, float | None] | None:
    return energy(World(plan(*children), TIMED, **options))


def test_makespan() -> None:
    assert times("A") == (1, 2)
    assert times("A", "B") == (1, 7)  # A may fail and give up
    succeed = Says(R1, "succeeds")
    assert times("A", "B", constraint=succeed) == (4, 7)
    assert times("A", rec("B")) == (1, 7)
    assert times("Mute") is None
    assert times(rec("A"), "Mute") is None  # unreachable
    assert times("A", "Mute") == (1, None)
    assert times("Mute", "A") == (0, None)
    assert times("Open") == (2, None)
    assert times(par_any("A", "Open"), constraint=Says(f"{C1}/Runner[1]", "succeeds")) == (1, 2)
    assert times(par_any("A", "Open")) == (1, None)  # both may fail
    assert times(par_any(seq(), "A")) == (0, 0)
    assert times(par_all("A", "B")) == (1, 5)
    both = Says(f"{C1}/Runner[1]", "succeeds")
    assert times(par_all("A", "B"), constraint=both) == (3, 5)
    assert times(par_any("A", "B"), constraint=Says(f"{C1}/Runner[1]", "fails")) == (3, 5)


def test_makespan_of_runs_that_end() -> None:
    assert times("A", faults=HANG) == (1, 2)
    assert times("A", faults=HANG, constraint=Says(R1, "hangs")) is None
    # What does not start heeds no least duration.
    assert times("A", faults=NO_START, constraint=Says(R1, "does not start")) == (0, 2)
    assert times("A", faults=NO_START, constraint=Says(R1, "succeeds")) == (1, 2)
    # The second unit is triggered at once; without a start of the first one it never is.
    chain = {"faults": NO_START, "constraint": Says(f"{C1}/Runner[1]", "does not start")}
    assert times(par_all("A", "B"), **chain) == (0, 2)
    assert times(par_any("A", "B"), **chain) is None
    assert times("A", constraint=lambda scenario: False) is None


def test_energy() -> None:
    assert joules("A") == (1, 2)
    assert joules("A", "B") == (1, 22)
    assert joules("A", "B", constraint=Says(R1, "succeeds")) == (11, 22)
    assert joules(par_all("A", "B")) == (11, 22)
    assert joules(par_any("A", "A", "B"), "Mute") == (12, 24)  # orphans take it too
    assert joules("Mute") is None
    assert joules("Mute", "A") == (0, 2)
    assert joules("A", rec("Open")) == (1, None)
    assert joules("A", rec("Open"), constraint=Says(R1, "succeeds")) == (1, 2)
    assert joules(rec("A"), "Mute") is None
    assert joules("A", "B", faults=HANG, constraint=Says(R1, "hangs")) == (1, 2)
    # What is triggered after the end counts: the energy is that of the maximal run.
    assert joules(par_any(seq(), seq("A", "B"))) == (1, 22)
    assert joules("A", constraint=lambda scenario: False) is None


@few
@given(data=st.data(), models=faults())
def test_no_choice_of_durations_leaves_the_bounds(
    data: st.DataObject, models: frozenset[str]
) -> None:
    library = data.draw(libraries(clocks=True))
    world = World(data.draw(plans_over(library, max_runners=4)), library, faults=models)
    longest = makespan(world)
    shares = {path: data.draw(st.integers(0, 10)) for path in world.system.paths}

    def takes(one: Instance, run: Run) -> float:
        low, high = spans(one, run)
        top = low + 9 if isinf(high) else high
        return low + (top - low) * shares[one.path] / 10

    for run in world.runs if longest else ():
        if run.stuck:
            continue
        assert longest is not None
        least, greatest = longest
        end = end_of(world, run, takes)
        assert least <= end
        assert greatest is None or end <= greatest + 1e-9
