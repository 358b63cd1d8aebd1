"""GP501: resources that two runners need for themselves at the same time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.model.capability import Outcomes, Parameter, Span, ValueType
from gpsfsm.model.finding import Severity
from tests.analysis.rules.support import (
    control,
    findings,
    library,
    places,
    provider,
    runner,
    story,
)

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

SECONDS = (Parameter("seconds", ValueType.DOUBLE),)
SURE = Outcomes(never_fails=True)
LIBRARY = library(
    provider("base/Go", resources=("base",), configuration=(Parameter("to"),)),
    provider("base/Circle", resources=("base",), outcomes=Outcomes(may_hang=True)),
    provider("arm/Dance", resources=("base", "arm")),
    provider("voice/Say", resources=("speaker",)),
    provider("voice/Beep", resources=("speaker",), outcomes=SURE),
    provider("eye/Look"),
)
TIMED = library(
    *LIBRARY.providers,
    provider("base/Step", resources=("base",), duration=Span(1, 2)),
    provider("eye/Blink", duration=Span(0.5, 0.5)),
    provider(
        "time/Wait", duration=Span("seconds", "seconds"), configuration=SECONDS, outcomes=SURE
    ),
)
EMPTY = control("sequential")
HOME, DANCE = runner("base/Go"), runner("arm/Dance")
SAY, BEEP, LOOK, STEP = (
    runner("voice/Say"),
    runner("voice/Beep"),
    runner("eye/Look"),
    runner("base/Step"),
)


def go(to: str) -> str:
    return runner("base/Go", f'to="{to}"')


def wait(seconds: float) -> str:
    return runner("time/Wait", f'seconds="{seconds}"')


def overlaps(*steps: str, **options: Any) -> list[Finding]:
    return findings("GP501", *steps, **{"library": LIBRARY, **options})


def only(*steps: str, **options: Any) -> Finding:
    (finding,) = overlaps(*steps, **options)
    return finding


def pairs(*steps: str, **options: Any) -> list[tuple[int, str, list[int]]]:
    """Per finding: the line of the control, the resource, the lines of the two runners."""
    return [
        (
            finding.location.line,
            places(finding)[0][1].removeprefix("uses the "),
            [line for line, _ in places(finding)],
        )
        for finding in overlaps(*steps, **options)
    ]


@pytest.mark.parametrize("kind", ["parallel_all", "parallel_any"])
def test_side_by_side(kind: str) -> None:
    finding = only(control(kind, go("a"), go("b")))
    assert finding.message == (
        "Go (to=a) at line 3 and Go (to=b) at line 4 can be active at the same "
        "time, but both need exclusive use of the base"
    )
    assert (finding.severity, finding.hint) == (Severity.ERROR, "run the two one after the other")
    assert (finding.location.line, finding.location.element) == (2, "/Plan/Control[1]")
    assert places(finding) == [(3, "uses the base"), (4, "uses the base")]
    assert story(finding) == [
        "COMPLETED",
        "Go (to=a) at line 3 is running",
        "Go (to=b) at line 4 is running",
        "both use the base at the same time",
    ]


def test_left_behind_by_a_parallel_any() -> None:
    finding = only(control("parallel_any", go("a"), LOOK), HOME)
    assert finding.message == (
        "Go (to=a) at line 3 can still be active when Go at line 6 starts, but "
        "both need exclusive use of the base"
    )
    assert finding.location.line == 2
    assert finding.hint.endswith("nothing stops the units that a parallel control leaves behind")
    assert places(finding) == [(3, "uses the base"), (6, "uses the base")]
    assert story(finding) == [
        "COMPLETED",
        "Go (to=a) at line 3 is running",
        "Look at line 4 succeeds",
        "Go at line 6 is running",
        "both use the base at the same time",
    ]


def test_left_behind_by_a_guarded_parallel_all() -> None:
    finding = only(control("parallel_all", go("a"), LOOK), control("recovery", HOME))
    assert "Go (to=a) at line 3 can still be active when Go at line 7 starts" in finding.message
    assert story(finding)[1:] == [
        "Go (to=a) at line 3 is running",
        "Look at line 4 fails",
        "Go at line 7 is running",
        "both use the base at the same time",
    ]


def test_two_recoveries_meet_if_both_are_needed() -> None:
    guarded = control("parallel_all", *2 * (LOOK, control("recovery", SAY)))
    assert story(only(guarded)) == [
        "COMPLETED",
        "Look at line 3 fails",
        "Look at line 7 fails",
        "Say at line 5 is running",
        "Say at line 9 is running",
        "both use the speaker at the same time",
    ]
    assert overlaps(guarded, assumptions=("never fails: line 3",)) == []
    assert overlaps(guarded, assumptions=("line 3 fails implies line 7 succeeds",)) == []
    assert len(overlaps(guarded, consistent=True)) == 1


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ([control("parallel_all", go("a"), go("b"), go("c"))], [(2, "base", [3, 4])]),
        (
            [control("parallel_all", DANCE, DANCE)],
            [(2, "arm", [3, 4]), (2, "base", [3, 4])],
        ),
        (
            [control("parallel_all", DANCE, SAY, go("a"), SAY)],
            [(2, "base", [3, 5]), (2, "speaker", [4, 6])],
        ),
        (
            [control("parallel_all", control("parallel_all", go("a"), go("b")), go("c"))],
            [(2, "base", [4, 7]), (3, "base", [4, 5])],
        ),
        (
            [control("parallel_all", go("a"), go("b")), control("parallel_any", go("a"), go("b"))],
            [(2, "base", [3, 4]), (6, "base", [7, 8])],
        ),
        (
            [control("parallel_any", control("sequential", LOOK, go("a")), LOOK), go("b"), go("c")],
            [(2, "base", [5, 9])],
        ),
        (
            [control("parallel_any", control("parallel_all", go("a"), LOOK), LOOK), go("b")],
            [(2, "base", [4, 9])],
        ),
        (
            [control("parallel_all", go("a"), control("recovery", go("b")), go("c"))],
            [(2, "base", [3, 7])],
        ),
    ],
)
def test_one_pair_per_control_and_resource(
    steps: list[str], expected: list[tuple[int, str, list[int]]]
) -> None:
    assert pairs(*steps) == expected


@pytest.mark.parametrize(
    "steps",
    [
        [go("a"), go("b")],
        [go("a"), control("recovery", go("b"))],
        [control("parallel_all", go("a"), SAY), DANCE],
        [control("parallel_all", go("a"), LOOK), go("b")],
        [control("parallel_any", go("a"), LOOK)],
        [control("parallel_any", SAY, LOOK), go("a")],
        [control("parallel_all", go("a"), control("sequential", LOOK, SAY))],
        [control("parallel_all", *2 * (LOOK, control("recovery", LOOK))), go("a")],
        [control("parallel_all", go("a"), control("recovery", LOOK), LOOK), go("b")],
        [control("parallel_all", runner("lift/Go"), runner("lift/Go"))],
        [control("parallel_all", go("a"), BEEP, control("recovery", go("b")))],
        [control("recovery", control("parallel_all", go("a"), go("b")))],
        [control("parallel_any", go("a")), go("b")],
        # one of the two comes after the plan has completed
        [control("parallel_any", EMPTY, go("a"), control("sequential", LOOK, go("b")))],
        [control("parallel_any", EMPTY, control("sequential", LOOK, go("a")), go("b"))],
        # the recovery comes only if nothing is left behind
        [
            control("sequential", control("parallel_any", go("a"), LOOK), BEEP),
            control("recovery", go("b")),
        ],
    ],
)
@pytest.mark.parametrize("solver", ["auto", "z3", "structural"])
def test_no_overlap(steps: list[str], solver: str) -> None:
    assert pairs(*steps, solver=solver) == []


def test_overlaps_at_and_after_the_instant_of_completion() -> None:
    assert pairs(control("parallel_any", EMPTY, go("a"), go("b"))) == [(2, "base", [5, 6])]
    late = control("parallel_any", EMPTY, go("a"), control("sequential", LOOK, go("b")))
    assert pairs(late, LOOK) == [(2, "base", [5, 8])]


def test_a_long_name_of_a_resource_is_cut() -> None:
    hold = runner("base/Hold")
    small = library(provider("base/Hold", resources=("r" * 200,)))
    for steps in (
        [control("parallel_all", hold, hold)],
        [control("parallel_any", hold, runner("eye/Look")), hold],
    ):
        finding = only(*steps, library=small)
        shown = [finding.message, *story(finding), *(text for _, text in places(finding))]
        assert sum("r" * 59 + "…" in text for text in shown) == 4
        assert not any("r" * 60 in text for text in shown)


@pytest.mark.parametrize("faults", [("hang",), ("no-start",), ("hang", "no-start")])
def test_faults(faults: tuple[str, ...]) -> None:
    assert pairs(control("parallel_all", go("a"), go("b")), faults=faults) == [(2, "base", [3, 4])]
    left = control("parallel_any", go("a"), LOOK), HOME
    assert pairs(*left, faults=faults) == [(2, "base", [3, 6])]
    assert pairs(go("a"), go("b"), faults=faults) == []


def test_without_a_start_nothing_is_held() -> None:
    # The chain of starts: the second unit starts when the first one has started.
    steps = control("parallel_all", go("a"), go("b"))
    assert pairs(steps, faults=("no-start",), assumptions=("always fails: line 3",)) == [
        (2, "base", [3, 4])
    ]


def test_a_runner_that_may_hang_holds_its_resource() -> None:
    circle = runner("base/Circle")
    assert pairs(control("parallel_any", circle, LOOK), HOME) == [(2, "base", [3, 6])]
    assert pairs(circle, HOME) == []


@pytest.mark.parametrize(
    ("steps", "expected"),
    [
        ([control("parallel_all", STEP, control("sequential", wait(5), STEP))], []),
        ([control("parallel_all", STEP, control("sequential", wait(2), STEP))], []),
        (
            [control("parallel_all", STEP, control("sequential", wait(1.5), STEP))],
            [(2, "base", [3, 6])],
        ),
        (
            [control("parallel_all", HOME, control("sequential", wait(5), STEP))],
            [(2, "base", [3, 6])],
        ),
        ([control("parallel_any", STEP, wait(5)), HOME], []),
        ([control("parallel_any", STEP, wait(1)), HOME], [(2, "base", [3, 6])]),
        (
            [control("parallel_any", control("sequential", LOOK, STEP), wait(5)), HOME],
            [(2, "base", [5, 9])],
        ),
        (
            [control("parallel_any", wait(3), HOME, control("sequential", wait(2), STEP))],
            [(2, "base", [4, 7])],
        ),
        # the second comes after the plan has ended, or the first does
        ([control("parallel_any", wait(1), HOME, control("sequential", wait(2), STEP))], []),
        ([control("parallel_any", wait(1), control("sequential", wait(2), STEP), HOME)], []),
        (
            [control("parallel_all", STEP, control("sequential", wait(1), LOOK, STEP))],
            [(2, "base", [3, 7])],
        ),
        (
            [control("parallel_all", STEP, control("sequential", wait(2), LOOK, STEP))],
            [],
        ),
    ],
)
def test_durations_can_exclude_an_overlap(
    steps: list[str], expected: list[tuple[int, str, list[int]]]
) -> None:
    assert pairs(*steps, library=TIMED) == expected


@pytest.mark.parametrize("solver", ["z3", "structural"])
@pytest.mark.parametrize(
    "steps",
    [
        [control("parallel_all", go("a"), control("recovery", LOOK), DANCE), HOME],
        [control("parallel_any", control("sequential", LOOK, go("a")), LOOK), go("b")],
    ],
)
def test_whoever_decides(solver: str, steps: list[str]) -> None:
    overlapping = overlaps(*steps, solver=solver)
    assert overlapping == overlaps(*steps)
    assert overlapping


def test_every_decider_knows_scenarios_with_clocks() -> None:
    steps = control("parallel_all", STEP, control("sequential", wait(1.5), STEP))
    assert story(only(steps, library=TIMED)) == [
        "COMPLETED",
        "Step at line 3 is running",
        "Wait (seconds=1.5) at line 5 succeeds",
        "Step at line 6 is running",
        "both use the base at the same time",
    ]
    assert only(steps, library=TIMED, solver="z3") == only(steps, library=TIMED)
    assert only(steps, library=TIMED, solver="structural") == only(steps, library=TIMED)


def test_a_scenario_with_clocks_names_all_that_time_depends_on() -> None:
    """The two steps meet only if the blink, which would end the plan before, has failed."""
    late = control("sequential", wait(1), STEP)
    steps = control("parallel_any", late, late, runner("eye/Blink"))
    finding = only(steps, library=TIMED)
    assert finding.scenario is not None
    outcomes = {element: str(outcome) for element, outcome in finding.scenario.outcomes}
    assert outcomes["/Plan/Control[1]/Runner[1]"] == "FAILED"
    assert len(outcomes) == 5
    assert not overlaps(steps, library=TIMED, assumptions=("never fails: Blink",))
