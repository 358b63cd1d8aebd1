"""GP411 and GP412: prompts that are never sent, and flushes of nothing."""

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
    STRANGER,
    findings_of,
    lines,
    only,
)
from tests.analysis.rules.support import control, messages, places, runner, story

# -- GP411 ----------------------------------------------------------------------------------


def test_a_buffer_that_nothing_flushes() -> None:
    assert messages("GP411", FILL, DRIVE, FILL, library=LIBRARY) == [
        (
            2,
            "warning",
            "the model never receives the prompt of Note (uuid=a) at line 2 and Note (uuid=a) at "
            "line 4: nothing flushes the buffer 'a'",
            'set flush="true" uuid="a" on the last prompt that belongs to it',
        )
    ]
    finding = only("GP411", FILL, DRIVE, FILL)
    assert places(finding) == [(4, "also waits in 'a'")]
    assert (finding.scenario, finding.confidence) == (None, Confidence.PROVED)


def test_each_buffer_is_told() -> None:
    messages = [finding.message for finding in findings_of("GP411", FILL, FILL_B, FILL)]
    assert [message[-len("the buffer 'a'") :] for message in messages] == [
        "the buffer 'a'",
        "the buffer 'b'",
    ]


def test_a_prompt_without_uuid_has_a_buffer_to_itself() -> None:
    message = (
        "the model never receives the prompt of Note{} at line {}: without a "
        "uuid and without flush, it stays in a buffer that nothing can flush"
    )
    hint = 'set flush="true" to send it, or give it the uuid of a prompt that is flushed later'
    silent = runner("model/Note", 'flush="false"')
    assert messages("GP411", runner("model/Note"), LONE, silent, library=LIBRARY) == [
        (2, "warning", message.format("", 2), hint),
        (4, "warning", message.format(" (flush=false)", 4), hint),
    ]
    # An empty uuid is none.
    assert lines("GP411", runner("model/Note", 'uuid=""'), runner("model/Plan", 'uuid=""')) == [
        2,
        3,
    ]


NOT_SENT = "the plan completes, possibly without flushing 'a' after this prompt"


@pytest.mark.parametrize(
    ("steps", "line", "events"),
    [
        ([FILL, DRIVE, control("recovery", FLUSH)], 2, ["Drive at line 3 succeeds"]),
        ([FLUSH, FILL], 3, []),
        ([control("parallel_all", FILL, FLUSH)], 3, []),
        ([control("parallel_any", FLUSH, FILL)], 4, []),
        ([control("parallel_all", FLUSH, control("sequential", DRIVE, FILL))], 6, []),
        (
            [FLUSH, control("recovery", FILL), DRIVE],
            4,
            ["Plan (uuid=a, flush=true) at line 2 fails"],
        ),
    ],
)
def test_a_prompt_that_is_not_sent_in_some_run(
    steps: list[str], line: int, events: list[str]
) -> None:
    finding = only("GP411", *steps)
    assert finding.message == (
        "the plan can complete without sending the prompt of Note (uuid=a) at "
        f"line {line}: not every run flushes the buffer 'a' after it"
    )
    assert finding.hint == (
        'put a prompt with flush="true" uuid="a" where every run reaches it after this one'
    )
    ends, *sentences = story(finding)
    assert (ends, sentences[-1]) == ("COMPLETED", NOT_SENT)
    assert f"Note (uuid=a) at line {line} succeeds" in sentences
    assert set(events) <= set(sentences)


def test_the_story_of_a_flush_that_comes_too_early() -> None:
    assert story(only("GP411", FLUSH, FILL)) == [
        "COMPLETED",
        "Plan (uuid=a, flush=true) at line 2 succeeds",
        "Note (uuid=a) at line 3 succeeds",
        NOT_SENT,
    ]


@pytest.mark.parametrize(
    "steps",
    [
        [FILL, FLUSH, FOLLOW],
        [FILL, DRIVE, FILL, DRIVE, FLUSH],
        [FILL, runner("model/Note", 'uuid="a" flush="true"')],
        [FLUSH, FILL, FLUSH],
        [FILL, FLUSH, control("recovery", DRIVE)],  # the flush is tried at least
        [control("parallel_all", FILL, DRIVE), FLUSH],
        [control("parallel_all", FILL, control("sequential", DRIVE, FILL)), FLUSH],
        [FILL, DRIVE, control("recovery", control("sequential", FLUSH, DRIVE)), FLUSH],
        [control("recovery", FILL)],
        [  # a guard fails only after each of its steps was tried
            FILL,
            control("sequential", DRIVE, FLUSH),
            control("recovery", FLUSH),
            control("recovery", DRIVE),
        ],
        [LONE, DRIVE],
        [ASK, FOLLOW],  # GP414
        [runner("model/Plan", 'uuid="a"'), FOLLOW],  # GP414
        [FILL, FLUSH_B],  # GP413
    ],
)
def test_a_prompt_that_is_sent(steps: list[str]) -> None:
    assert lines("GP411", *steps) == []


@pytest.mark.parametrize(
    "steps",
    [
        [FILL, NAME, FLUSH_B],
        [FILL, KEY, runner("model/Plan", 'uuid="a"')],
        [FILL, STRANGER, runner("model/Plan", 'uuid="b"')],
        [NAME, FILL],
        [KEY, FILL],
        [STRANGER, FILL],
    ],
)
def test_a_buffer_that_is_not_known(steps: list[str]) -> None:
    assert lines("GP411", *steps) == []


def test_what_is_known_of_a_prompt_behind_what_is_not() -> None:
    # A flush of another buffer, whatever arrives at it, is none of this one.
    assert lines("GP411", FILL, KEY, runner("model/Plan", 'uuid="b"')) == [2]
    assert lines("GP411", FILL, STRANGER, DRIVE, FILL_B) == [2, 5]


def test_only_runs_that_complete_count() -> None:
    steps = FILL, DRIVE
    assert lines("GP411", *steps) == [2]
    assert lines("GP411", *steps, assumptions=("always fails: line 3",)) == []
    assert lines("GP411", *steps, faults=("hang",)) == [2]
    guarded = FILL, DRIVE, control("recovery", FLUSH)
    assert lines("GP411", *guarded, assumptions=("always fails: line 3",)) == []


def test_a_flush_that_is_not_tried_is_not_tried_in_any_run_that_is_shown() -> None:
    # The plan completes with the first unit, but if Drive at line 6 failed, the flush would come.
    guarded = control("sequential", DRIVE, control("recovery", FLUSH))
    finding = only("GP411", FILL, control("parallel_any", runner("robot/Read"), guarded))
    assert finding.scenario is not None
    assert ("/Plan/Control[1]/Control[1]/Runner[1]", "SUCCEEDED") in finding.scenario.outcomes
    assert "Drive at line 6 succeeds" in story(finding)


@pytest.mark.parametrize(
    ("code", "steps"),
    [
        ("GP411", ["note"]),
        ("GP411", ["note", DRIVE, control("recovery", "send")]),
        ("GP412", ["send"]),
        ("GP412", [DRIVE, control("recovery", "note"), "send"]),
        ("GP413", ["note", FLUSH_B]),
        ("GP413", [FILL, "send"]),
    ],
)
def test_a_long_uuid_is_cut(code: str, steps: list[str]) -> None:
    uuid = "u" * 200
    named = {
        "note": runner("model/Note", f'uuid="{uuid}"'),
        "send": runner("model/Plan", f'uuid="{uuid}" flush="true"'),
    }
    finding = only(
        code,
        *(step.replace("note", named["note"]).replace("send", named["send"]) for step in steps),
    )
    shown = [finding.message, finding.hint, *(text for _, text in places(finding))]
    if finding.scenario is not None:
        shown += finding.scenario.story
    assert any("u" * 59 + "…" in text for text in shown)
    assert not any("u" * 60 in text for text in shown)


# -- GP412 ----------------------------------------------------------------------------------

SEND = (
    "give the prompts that belong together the same uuid and put this one last; "
    "remove the uuid if no other prompt belongs to it"
)


def test_a_buffer_that_nothing_fills() -> None:
    assert messages("GP412", FLUSH, DRIVE, FLUSH, library=LIBRARY) == [
        (
            line,
            "warning",
            f"Plan (uuid=a, flush=true) at line {line} sends the buffer 'a', "
            "which this plan never fills: the model receives only this prompt",
            SEND,
        )
        for line in (2, 4)
    ]


@pytest.mark.parametrize(
    ("steps", "line", "events"),
    [
        ([DRIVE, control("recovery", FILL), FLUSH], 6, ["Drive at line 2 succeeds"]),
        ([FLUSH, FILL, FLUSH], 2, []),
        ([control("parallel_all", FILL, FLUSH)], 4, []),
        ([control("parallel_any", FILL, DRIVE), FLUSH], 6, []),
        ([control("recovery", FILL), FLUSH], 5, []),
        (
            [runner("model/Plan", 'uuid="a"'), control("recovery", DRIVE), FLUSH],
            6,
            ["Plan (uuid=a) at line 2 fails", "Drive at line 4 succeeds"],
        ),
    ],
)
def test_a_buffer_that_is_empty_in_some_run(steps: list[str], line: int, events: list[str]) -> None:
    finding = only("GP412", *steps)
    assert finding.message == (
        f"Plan (uuid=a, flush=true) at line {line} can send the buffer 'a' while "
        "it is empty: the model then receives only this prompt"
    )
    ends, *sentences = story(finding)
    assert (ends, sentences[-1]) == (
        "COMPLETED",
        "the buffer 'a' may be empty when it is sent",
    )
    assert set(events) <= set(sentences)


@pytest.mark.parametrize(
    "steps",
    [
        [FILL, FLUSH],
        [FILL, FLUSH, FLUSH],
        [LONE],
        [control("parallel_all", FILL, DRIVE), FLUSH],
        [control("parallel_any", FILL, FILL), FLUSH],
        [NAME, FLUSH],
        [KEY, FLUSH],
        [NAME, runner("model/Note"), FLUSH],
        [KEY, FILL, FLUSH],
        [STRANGER, FILL_B, FLUSH],
        [control("recovery", FLUSH)],
        [FILL_B, FLUSH],  # GP413
    ],
)
def test_a_buffer_that_is_not_empty_or_not_known(steps: list[str]) -> None:
    assert lines("GP412", *steps) == []


def test_only_flushes_that_succeed_count() -> None:
    steps = DRIVE, control("recovery", FILL), FLUSH
    assert lines("GP412", *steps, assumptions=("always fails: line 2",)) == []
    assert lines("GP412", *steps, assumptions=("never succeeds: line 6",)) == []
    assert lines("GP412", *steps, faults=("hang", "no-start")) == [6]


@pytest.mark.parametrize("code", ["GP411", "GP412"])
def test_a_scenario_names_what_else_triggers_the_flush(code: str) -> None:
    finding = only(code, control("parallel_any", FILL, DRIVE), FLUSH)
    assert finding.scenario is not None
    assert ("/Plan/Control[1]/Runner[2]", "SUCCEEDED") in finding.scenario.outcomes
    assert story(finding)[1] == "Drive at line 4 succeeds"
