"""The gate and machines: accepted, refused, and never accepted undecided."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given, settings

import gpsfsm
from gpsfsm import GateOptions, gate_text
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions
from gpsfsm.gating.deciding import Reason
from gpsfsm.model.report import Frequency
from tests.analysis.machines.random_machines import machine, machines
from tests.cases import many


def text_of(graph: Any) -> str:
    """A machine as one line of JSON."""
    nodes = [{"id": str(name), **data} for name, data in graph.nodes(data=True)]
    edges = [{"source": a, "target": b, **data} for a, b, data in graph.edges(data=True)]
    return json.dumps({"nodes": nodes, "edges": edges})


LOOP = text_of(machine("start SUCCEEDED a", "a FAILED a", "a SUCCEEDED end"))
TRAP = text_of(
    machine("start SUCCEEDED a", "a SUCCEEDED end", "a FAILED b", "b FAILED b", "b SUCCEEDED b")
)


def test_a_machine_is_accepted_as_a_text_in_this_process_and_apart() -> None:
    for budget_ms in (None, 20_000):
        verdict = gpsfsm.gate(LOOP, budget_ms=budget_ms)
        assert verdict
        assert verdict.message == "the machine may run; structure only: no task was given"
        assert verdict.to_dict()["kind"] == "machine"
        assert verdict.digests.plan == hashlib.sha256(LOOP.encode()).hexdigest()


def test_a_loop_that_cannot_be_left_is_refused() -> None:
    verdict = gate_text(TRAP, "m.json")
    assert verdict.reason is Reason.FINDINGS
    assert "GP313" in {finding.rule for finding in verdict.findings}


def test_what_may_go_on_for_ever_passes_as_an_info() -> None:
    verdict = gate_text(LOOP, "m.json")
    assert verdict.report is not None
    assert "GP314" in {finding.rule for finding in verdict.report.findings}
    assert gate_text(LOOP, "m.json", GateOptions(fail_on=gpsfsm.Severity.WARNING))


@pytest.mark.parametrize(
    "analysis",
    [
        AnalysisOptions(deadline_s=10.0),
        AnalysisOptions(energy_limit_j=10.0),
        AnalysisOptions(faults=("no-start",)),
        AnalysisOptions(assumptions=("a fails or b fails",)),
    ],
)
def test_undecided_is_refused(analysis: AnalysisOptions) -> None:
    options = GateOptions(CheckOptions(trees=False, analysis=analysis))
    verdict = gate_text(TRAP, "m.json", options)
    assert verdict.reason is Reason.INCONCLUSIVE
    assert not verdict


def test_too_many_configurations_are_refused() -> None:
    wide = text_of(machine(*(f"start SUCCEEDED r{n}" for n in range(16)), "r0 SUCCEEDED r0"))
    verdict = gate_text(wide, "m.json")
    assert verdict.reason is Reason.INCONCLUSIVE
    assert verdict.message == "the runs of the machine reach more than 50,000 configurations"


def test_a_machine_in_which_nothing_is_done() -> None:
    nothing = text_of(machine("start SUCCEEDED end"))
    assert gate_text(nothing, "m.json").reason is Reason.EMPTY
    assert gate_text(nothing, "m.json", GateOptions(allow_empty=True))


def test_an_unknown_fact_is_no_acceptance(monkeypatch: pytest.MonkeyPatch) -> None:
    from gpsfsm.gating import deciding

    real = deciding.check_text

    def undecided(*arguments: Any) -> Any:
        report = real(*arguments)
        unknown = replace(report.facts.machine, endless=Frequency.UNKNOWN)
        return replace(report, facts=replace(report.facts, machine=unknown))

    monkeypatch.setattr(deciding, "check_text", undecided)
    assert gate_text(LOOP, "m.json").reason is Reason.INCONCLUSIVE


def test_a_model_answers_no_machine() -> None:
    assert not gpsfsm.gate(LOOP, from_response=True, budget_ms=None)


@settings(max_examples=many(80))
@given(machines())
def test_what_the_gate_accepts_the_check_accepts(graph: Any) -> None:
    text = text_of(graph)
    verdict = gate_text(text, "m.json")
    (report,) = gpsfsm.check(text).plans
    empty = report.facts is not None and report.facts.runners == 0
    assert bool(verdict) == (report.verdict == "accepted" and not empty)
