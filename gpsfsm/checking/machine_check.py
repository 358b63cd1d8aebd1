"""The check of a machine, where it differs from that of a plan (semantics, section 9)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.findings import Findings, facts_of
from gpsfsm.analysis.machines.search import MAX_CONFIGURATIONS, Exploration
from gpsfsm.analysis.options import Inconclusive

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.capabilities.library import Capabilities
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


def overlap_findings(
    compiled: Compiled, constraints: Constraints, options: AnalysisOptions
) -> Iterable[Finding]:
    """The findings about runners that hold one resource at once.

    Raises Inconclusive if the runs reach too many configurations for that.
    """
    from gpsfsm.analysis.machines.overlaps import held_twice, overlaps_in

    if not held_twice(compiled.bindings):
        return ()
    exploration = Exploration(compiled.automaton, constraints.allowed)
    overlaps = overlaps_in(exploration, compiled.bindings)
    return Findings(None, compiled.automaton, options.max_scenarios).of_overlaps(overlaps)


def findings_of_runners(
    compiled: Compiled,
    capabilities: Capabilities,
    options: AnalysisOptions,
    decided: DecidedMachine,
) -> Iterable[Finding]:
    """The findings of the rules that look at one runner alone."""
    from gpsfsm.analysis.machines.runners import RunnersContext, runner_findings

    reached = None
    if decided.facts is not None:
        plan, unreachable = compiled.automaton.plan, set(decided.facts.unreachable)
        reached = frozenset(
            number
            for number, runner in enumerate(plan.runners)
            if plan.path(runner) not in unreachable
        )
    return runner_findings(RunnersContext(compiled, capabilities, options, reached))
