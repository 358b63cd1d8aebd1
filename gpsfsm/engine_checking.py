"""Check one plan for an engine: what it makes of the text, and what then happens on it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.on_engine import OnEngine, decided_like
from gpsfsm.analysis.rules import all_rules, rule
from gpsfsm.analysis.solver import Inconclusive
from gpsfsm.compile import compile_plan, same_runs
from gpsfsm.engines import EngineReading, read_for_engine
from gpsfsm.errors import UsageError
from gpsfsm.model.engine import Crashed, Rejected
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip, printable
from gpsfsm.reading import EngineText
from gpsfsm.tasks.engine_difference import differs_on_engine

if TYPE_CHECKING:
    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.decide import Decided
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.compile import Compiled
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import Facts
    from gpsfsm.syntax import Limits

__all__ = ["EngineFindings", "check_on_engine"]

_MAX_MESSAGE = 400  # code points; an engine prints whole elements


@dataclass(slots=True)
class EngineFindings:
    """``facts`` are those of the plan on the engine; None if it does not get as far as that.

    ``undecided`` names what a limit kept open; ``seen`` is what the rules saw. ``contradictory``:
    the constraints admit no scenario, so nothing was decided.
    """

    findings: list[Finding] = field(default_factory=list)
    facts: Facts | None = None
    undecided: list[str] = field(default_factory=list)
    seen: OnEngine | None = None
    contradictory: bool = False

    @property
    def context(self) -> Context | None:
        """The context of the plan on the engine."""
        return None if self.seen is None else self.seen.context


def check_on_engine(
    text: str | bytes,
    engine: str,
    options: AnalysisOptions,
    capabilities: Capabilities,
    *,
    file: str,
    limits: Limits,
    paper: Context | None,
) -> EngineFindings:
    """Read ``text`` as the engine does, and compare what it then does with the paper.

    ``paper`` is the context of the plan as gpsfsm itself read it; None if it could not be read.
    Raises UsageError if the structural pass alone is to decide, which knows no engines, and
    InputError if the text is too large for ``limits``.
    """
    if options.solver == "structural":
        raise UsageError("the structural pass does not decide engines; use --solver auto or z3")
    reading = read_for_engine(text, engine, file, capabilities.library, limits)
    found = EngineFindings()
    if isinstance(reading, EngineText):
        found.findings.append(_refusal(reading))
        return found
    on_paper = paper if paper and _same(paper.plan, reading.plan) else None
    if on_paper is None:
        compiled = compile_plan(
            reading.plan,
            start_chain="no-start" in options.faults,
            bindings=reading.compiled.bindings,
        )
        decided = decide(compiled, _constraints(compiled, options), options)
        on_paper = _context(decided, capabilities, found)
    if on_paper is not None:
        _compare(engine, reading, on_paper, _constraints(reading.compiled, options), found)
    return found


def _constraints(compiled: Compiled, options: AnalysisOptions) -> Constraints:
    """The scenarios of what was compiled: what arrives may be otherwise on the engine."""
    return constraints_of(
        compiled.automaton.plan,
        faults=options.faults,
        consistent=options.consistent,
        assumptions=options.assumptions,
        bindings=compiled.bindings,
    )


def _compare(
    engine: str,
    reading: EngineReading,
    paper: Context,
    constrained: Constraints,
    found: EngineFindings,
) -> None:
    """Decide what the plan does on the engine, and where that is not what the paper says."""
    same = same_runs(paper.compiled.automaton, reading.compiled.automaton)
    decided = decided_like(paper, reading.compiled) if same else None
    if decided is None:
        options = replace(paper.options, solver="z3")
        decided = decide(reading.compiled, constrained, options)
    context = _context(decided, paper.capabilities, found)
    if context is None:
        return
    found.facts = decided.facts()
    found.seen = OnEngine(engine, paper, context, reading.parameters, same=same)
    _apply_rules(found.seen, found)
    if not same:
        findings, undecided = differs_on_engine(paper, context, engine)
        found.findings += findings
        found.undecided += undecided


def _context(decided: Decided, capabilities: Capabilities, found: EngineFindings) -> Context | None:
    """The context of rules; None where the constraints admit no scenario."""
    if decided.contradictory:
        found.contradictory = True
        return None
    found.undecided += decided.inconclusive
    return Context(decided, capabilities)


def _same(one: Plan, other: Plan) -> bool:
    """Whether both are the same elements of one text."""
    if len(one.elements) != len(other.elements):
        return False
    return all(
        (first.kind, first.control_type, first.start, first.parent, first.attributes)
        == (second.kind, second.control_type, second.start, second.parent, second.attributes)
        for first, second in zip(one.elements, other.elements, strict=True)
    )


def _apply_rules(engine: OnEngine, found: EngineFindings) -> None:
    for known in all_rules():
        if known.find_on_engine is None:
            continue
        try:
            found.findings += known.find_on_engine(engine)
        except Inconclusive:
            found.undecided.append(known.name)


def _refusal(reading: EngineText) -> Finding:
    """The finding for a plan that the engine does not take."""
    engine, result, place = reading.engine, reading.result, Location(reading.line, reading.column)
    if isinstance(result, Rejected):
        said = f"; it says: {clip(result.message, _MAX_MESSAGE)}"
        message = f"{engine} rejects this plan: {printable(result.reason)}{said}"
        return rule("GP701").finding(message, place)
    assert isinstance(result, Crashed)
    message = f"{engine} dies on this plan ({result.signal}): {printable(result.reason)}"
    return rule("GP702").finding(message, place)
