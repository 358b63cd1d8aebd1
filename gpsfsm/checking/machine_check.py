"""The check of a machine, where it differs from that of a plan (semantics, section 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.findings import Findings, facts_of
from gpsfsm.analysis.machines.search import MAX_CONFIGURATIONS, Exploration
from gpsfsm.analysis.options import Inconclusive

if TYPE_CHECKING:
    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.compile import Compiled
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import Facts


class DecidedMachine(NamedTuple):
    """The facts and findings; or, without them, the reason why nothing was decided."""

    facts: Facts | None
    findings: tuple[Finding, ...] = ()
    reason: str = ""
    hint: str = ""


def decide_machine(
    compiled: Compiled, constraints: Constraints, options: AnalysisOptions
) -> DecidedMachine:
    """Decide everything about a machine."""
    automaton = compiled.automaton
    for refused, name in (
        (constraints.no_start, "--faults no-start"),
        (constraints.groups, "--consistent"),
        (constraints.formulas, "assumptions that tie runners together"),
        (options.deadline_s is not None, "--deadline"),
        (options.energy_limit_j is not None, "--energy-limit"),
    ):
        if refused:
            reason = f"a machine is not decided under {name}"
            return DecidedMachine(None, reason=reason, hint="check it without that")
    try:
        answers = Judge(Exploration(automaton, constraints.allowed)).facts()
    except Inconclusive:
        reason = f"the runs of the machine reach more than {MAX_CONFIGURATIONS:,} configurations"
        return DecidedMachine(None, reason=reason, hint="check its parts as machines of their own")
    findings = Findings(answers, automaton, options.max_scenarios).all()
    return DecidedMachine(facts_of(answers, automaton), tuple(findings))
