"""GP312: recoveries that wait in vain for a prompt to fail."""

from __future__ import annotations

import pytest

from gpsfsm.model.capability import Outcomes
from gpsfsm.model.finding import Confidence
from tests.analysis.rules.prompting import DRIVE, FILL, FLUSH, LIBRARY, lines, only
from tests.analysis.rules.support import (
    control,
    findings,
    library,
    places,
    provider,
    runner,
    told,
)

SURE = provider("robot/Wait", outcomes=Outcomes(never_fails=True))
WAIT, STRANGER = runner("robot/Wait"), runner("lift/Go")
PLAN = runner("model/Plan", 'uuid="a"')  # it fills, and may fail
SENT = runner("model/Note", 'uuid="a" flush="true"')
RECOVERY = control("recovery", DRIVE)


def test_a_condition_as_recovery() -> None:
    steps = control("sequential", DRIVE, FILL), RECOVERY
    assert told("GP312", *steps, library=LIBRARY) == [
        (
            6,
            "warning",
            "this recovery does not depend on what Note (uuid=a) at line 4 says: this prompt never "
            "fails, so the recovery runs only if Drive at line 3 fails",
            "let the model decide: flush the prompt with a runner that asks for a plan, and set "
            "that plan; or guard the step whose failure is meant",
        )
    ]
    finding = only("GP312", *steps)
    assert finding.location.element == "/Plan/Control[2]"
    assert places(finding) == [(4, "never fails, whatever it says")]
    assert (finding.confidence, finding.scenario) == (Confidence.HEURISTIC, None)


@pytest.mark.parametrize(
    ("steps", "causes"),
    [
        ([DRIVE, DRIVE, FILL], "Drive at line 3 or Drive at line 4"),
        ([DRIVE, control("sequential", PLAN, FILL)], "Drive at line 3 or Plan (uuid=a) at line 5"),
        ([FILL, STRANGER, FILL], "Go at line 4"),
        ([control("parallel_all", DRIVE, FILL), FILL], "Drive at line 4"),
    ],
)
def test_the_recovery_runs_for_other_reasons(steps: list[str], causes: str) -> None:
    finding = only("GP312", control("sequential", *steps), RECOVERY)
    assert finding.message.endswith(f", so the recovery runs only if {causes} fails")


def test_recoveries_are_told_from_the_outside_in_and_in_order() -> None:
    inner = control("sequential", control("sequential", DRIVE, FILL), RECOVERY, FILL)
    assert lines("GP312", inner, RECOVERY) == [7, 12]
    later = control("sequential", DRIVE, FILL)
    assert lines("GP312", later, RECOVERY, later, RECOVERY) == [6, 13]


@pytest.mark.parametrize(
    "guarded",
    [
        FILL,  # GP308
        control("sequential", FILL),  # GP308
        control("sequential", DRIVE, PLAN),
        control("sequential", DRIVE, SENT),
        control("sequential", DRIVE, FLUSH),
        control("sequential", FILL, DRIVE),
        control("sequential", DRIVE, WAIT),
        control("sequential", DRIVE, STRANGER),
        control("parallel_all", DRIVE, FILL),
        control("sequential", DRIVE, control("parallel_all", DRIVE, FILL)),
        control("sequential", FILL, FILL),  # GP308
    ],
)
def test_a_recovery_that_may_be_meant(guarded: str) -> None:
    known = library(*LIBRARY.providers, SURE)
    assert findings("GP312", guarded, RECOVERY, library=known) == []


def test_a_recovery_that_never_runs_is_left_to_others() -> None:
    dead = control("recovery", control("sequential", DRIVE, FILL), RECOVERY)
    assert lines("GP312", dead) == []
    steps = control("sequential", DRIVE, FILL), RECOVERY
    assert lines("GP312", *steps, assumptions=("never fails: line 3",)) == []


def test_what_cannot_fail_depends_on_the_assumptions() -> None:
    steps = control("sequential", DRIVE, PLAN), RECOVERY
    assert lines("GP312", *steps) == []
    assert lines("GP312", *steps, assumptions=("never fails: Plan",)) == [6]
    # A prompt that is declared never to fail does start.
    kept = control("sequential", DRIVE, FILL), RECOVERY
    assert lines("GP312", *kept, faults=("no-start",)) == [6]


@pytest.mark.parametrize("solver", ["z3", "structural"])
def test_whoever_decides(solver: str) -> None:
    steps = control("sequential", DRIVE, FILL), RECOVERY
    assert lines("GP312", *steps, solver=solver) == [6]
