"""Options reach the worker as they are, and nothing but options does."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.checking import CheckOptions
from gpsfsm.checking.selection import Selection
from gpsfsm.gating import Gate, GateOptions, gate_text
from gpsfsm.gating.deciding import digests_of
from gpsfsm.model.finding import Severity
from gpsfsm.syntax import Limits
from gpsfsm.tasks.load import load_task
from gpsfsm.workers.codec import decode, encode

GO = '<Runner interface="a/Go" provider="a/Go"/>'
PLAN = f"<Plan>{GO}</Plan>"
TASK = """
actions:
  go: {interface: Go, x: 1, y: 2.0, who: "yes"}
  other: {interface: "*"}
steps:
  - {do: go, else: other}
rules:
  - precedence: [go, other]
not_answers: [example.xml]
"""


def options(tmp_path: Path) -> list[GateOptions]:
    (tmp_path / "task.yaml").write_text(TASK)
    (tmp_path / "example.xml").write_text(PLAN)
    task = load_task(tmp_path / "task.yaml")
    assert task.not_answers
    strict = AnalysisOptions(("hang",), True, ("any Go fails",), deadline_s=0.1, rlimit=10**9)
    usual = CheckOptions(trees=False)
    return [
        GateOptions(),
        GateOptions(usual, Severity.WARNING, allow_suppressions=True, allow_empty=True),
        GateOptions(replace(usual, analysis=strict, limits=Limits(max_depth=7), decides=False)),
        GateOptions(replace(usual, selection=Selection.of(("GP3",), ("GP302",)), task=task)),
        GateOptions(replace(usual, capabilities=choose_capabilities((), builtin=True))),
        GateOptions(replace(usual, capabilities=choose_capabilities((), builtin=False))),
        GateOptions(replace(usual, engine="fabric-v2", from_response=True)),
    ]


def test_options_arrive_as_they_were(tmp_path: Path) -> None:
    for each in options(tmp_path):
        decoded = decode(GateOptions, encode(each))
        assert encode(decoded) == encode(each)
        assert digests_of(PLAN, decoded) == digests_of(PLAN, each)
        if each.check.task is None:  # two tasks with plans in them are never equal
            assert decoded == each
        assert gate_text(PLAN, "plan.xml", decoded) == gate_text(PLAN, "plan.xml", each)


def test_a_task_is_asked_for_in_the_worker_too(tmp_path: Path) -> None:
    with_task = options(tmp_path)[3]
    with Gate(with_task, budget_ms=60_000) as gate:
        verdict = gate(PLAN)
    assert verdict == gate_text(PLAN, "<text>", with_task)
    assert not verdict.accepted


WHOLE = json.loads(encode(GateOptions()))["GateOptions"]


@pytest.mark.parametrize(
    "value",
    [
        None,
        7,
        {"a": 1},
        [],
        [1],
        {"Popen": ["true"]},
        {"subprocess.Popen": ["true"]},
        {"Gate": []},
        {"Digests": ["", "", "", "", ""]},
        {"GateOptions": {}},
        {"GateOptions": []},
        {"GateOptions": [*WHOLE, 1]},
        {"GateOptions": [None, *WHOLE[1:]]},
        {"GateOptions": [WHOLE[0], "mild", *WHOLE[2:]]},
        {"GateOptions": [*WHOLE[:-1], 0]},
        {"GateOptions": WHOLE, "more": 1},
        {"CheckOptions": WHOLE[0]["CheckOptions"]},
        "error",
    ],
)
def test_what_is_no_options_is_refused(value: object) -> None:
    with pytest.raises(ValueError):  # noqa: PT011  (each in its own words)
        decode(GateOptions, json.dumps(value).encode())


def test_what_has_no_form_is_refused() -> None:
    with pytest.raises(ValueError, match="no JSON form of a function"):
        encode(GateOptions(fail_on=lambda: None))  # type: ignore[arg-type]
