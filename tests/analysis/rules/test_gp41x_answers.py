"""GP413 and GP414: prompts in different buffers, and answers to nothing."""

from __future__ import annotations

import pytest

from gpsfsm.model.finding import Confidence
from tests.analysis.rules.prompting import (
    ASK,
    DRIVE,
    FILL,
    FILL_B,
    FLUSH,
    FLUSH_B,
    FOLLOW,
    KEY,
    LIBRARY,
    LONE,
    NAME,
    READ,
    STRANGER,
    findings_of,
    lines,
    only,
)
from tests.analysis.rules.support import control, messages, places, runner, story

# -- GP413 ----------------------------------------------------------------------------------


def test_a_flush_of_another_buffer() -> None:
    third = runner("model/Note", 'uuid="c"')
    assert messages("GP413", FILL, third, FILL, FLUSH_B, library=LIBRARY) == [
        (
            5,
            "warning",
            "Plan (uuid=b, flush=true) at line 5 sends only the buffer 'b', but the prompts before "
            "it wait in 'a' and 'c', which nothing sends",
            'write uuid="a" here if these prompts belong together',
        )
    ]
    finding = only("GP413", FILL, third, FILL, FLUSH_B)
    assert places(finding) == [(line, "waits in another buffer") for line in (2, 3, 4)]
    assert finding.confidence is Confidence.HEURISTIC
    assert lines("GP411", FILL, third, FILL, FLUSH_B) == []
    assert lines("GP412", FILL, third, FILL, FLUSH_B) == []


def test_a_flush_without_uuid() -> None:
    assert only("GP413", FILL, LONE).message == (
        "Plan (flush=true) at line 3 has no uuid and sends no buffer, but the prompts "
        "before it wait in 'a', which nothing sends"
    )


def test_each_buffer_is_told_at_one_flush_only() -> None:
    steps = FILL, FLUSH_B, FLUSH_B
    assert (lines("GP413", *steps), lines("GP412", *steps), lines("GP411", *steps)) == (
        [3],
        [4],
        [],
    )
    later = FLUSH_B, FILL
    assert (lines("GP413", *later), lines("GP412", *later), lines("GP411", *later)) == (
        [],
        [2],
        [3],
    )


@pytest.mark.parametrize(
    "steps",
    [
        [FILL, FLUSH],
        [FILL, FILL_B, FLUSH_B],  # the flush has its own fill: GP411
        [FILL, FLUSH_B, FLUSH],  # the first flush stands alone: GP412
        [runner("model/Note"), FLUSH],  # GP411
        [NAME, FILL, FLUSH_B],
        [FILL, control("recovery", FLUSH_B)],
    ],
)
def test_buffers_that_are_not_mixed(steps: list[str]) -> None:
    assert lines("GP413", *steps) == []


# -- GP414 ----------------------------------------------------------------------------------


def test_an_empty_plan_is_set() -> None:
    assert messages("GP414", ASK, FOLLOW, library=LIBRARY) == [
        (
            2,
            "error",
            "Plan at line 2 only buffers its prompt and does not ask the model, "
            "so Follow at line 3 sets an empty plan and nothing follows",
            'set flush="true" on the prompt, with the uuid of the prompts that belong to it',
        )
    ]
    finding = only("GP414", ASK, FOLLOW)
    assert places(finding) == [(3, "uses the empty answer")]
    assert finding.scenario is None


def test_an_empty_text_is_used() -> None:
    steps = runner("model/Plan", 'uuid="a" flush="false"'), READ
    assert only("GP414", *steps).message.endswith(", so Read at line 3 receives an empty 'plan'")


def test_an_empty_answer_behind_a_failure_has_a_scenario() -> None:
    steps = DRIVE, control("recovery", control("sequential", ASK, FOLLOW))
    finding = only("GP414", *steps)
    assert finding.location.line == 5
    assert story(finding) == [
        "COMPLETED",
        "Drive at line 2 fails",
        "Plan at line 5 succeeds",
        "Follow at line 6 is running",
    ]
    assert lines("GP414", *steps, assumptions=("never fails: Drive",)) == []


def test_each_reader_is_told() -> None:
    assert len(findings_of("GP414", ASK, control("parallel_all", READ, READ))) == 2


@pytest.mark.parametrize(
    "steps",
    [
        [FLUSH, FOLLOW],
        [LONE, READ],
        [ASK, DRIVE],
        [ASK, control("recovery", DRIVE), FOLLOW],  # GP401
        [ASK, control("recovery", FOLLOW)],
        [KEY, ASK, FOLLOW],
        [STRANGER, ASK, FOLLOW],
        [FILL, FOLLOW],  # it has no answer
        [control("recovery", control("sequential", ASK, FOLLOW))],
    ],
)
def test_no_empty_answer(steps: list[str]) -> None:
    assert lines("GP414", *steps) == []


# -- all of them ----------------------------------------------------------------------------


@pytest.mark.parametrize("solver", ["z3", "structural"])
@pytest.mark.parametrize(
    "steps",
    [
        [FILL, DRIVE, control("recovery", FLUSH), FLUSH_B, control("recovery", ASK, FOLLOW)],
        [control("parallel_any", control("sequential", FILL, DRIVE), FLUSH), FLUSH, ASK, READ],
    ],
)
def test_whoever_decides(solver: str, steps: list[str]) -> None:
    for code in ("GP411", "GP412", "GP413", "GP414"):
        assert findings_of(code, *steps, solver=solver) == findings_of(code, *steps)
    assert sum(len(findings_of(code, *steps)) for code in ("GP411", "GP412", "GP413", "GP414")) >= 2
