"""The check of one plan for an original engine; it begins where ``compile/engine_text.py`` ends.

1. Read: the text becomes the engine's automaton; or a refusal, which is all there is to say then.
2. On paper: the same elements by the paper's semantics. The front end's own context serves, if it
   read the same elements; else they are compiled and decided here.
3. On the engine: decided by z3; taken over from the paper where both run alike step by step.
4. Compare: the rules of GP7xx see both contexts; where the automata differ, a scenario is searched.

Every step calls what is below it (``analysis``, ``compile``, ``equivalence``) and nothing above:
``checking/check.py`` puts the result into the report.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decide import decide
from gpsfsm.analysis.on_engine import OnEngine, decided_like
from gpsfsm.analysis.rules import rule, rules_of_engines
from gpsfsm.analysis.solver import InconclusiveError
from gpsfsm.compile import compile_plan
from gpsfsm.compile.engine import same_runs
from gpsfsm.compile.engine_text import EngineReading, EngineText, read_for_engine
from gpsfsm.equivalence.engine_difference import differs_on_engine, hangs_without_start
from gpsfsm.errors import UsageError
from gpsfsm.model.engine import Crashed, Rejected
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip, printable

if TYPE_CHECKING:
    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.decide import Decided
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import Facts, Proof
    from gpsfsm.syntax import Limits

_MAX_MESSAGE = 400  # code points; an engine prints whole elements


@dataclass(slots=True)
class EngineFindings:
    """``facts`` are those of the plan on the engine; None if it does not get as far as that.

    ``undecided`` names what a limit kept open; ``contexts`` are those that the rules saw.
    ``contradictory``: the constraints admit no scenario, so nothing was decided.
    """

    findings: list[Finding] = field(default_factory=list)
    facts: Facts | None = None
    proof: Proof | None = None
    undecided: list[str] = field(default_factory=list)
    contexts: OnEngine | None = None
    contradictory: bool = False


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
    result = EngineFindings()
    if isinstance(reading, EngineText):
        result.findings.append(_refusal(reading))
        return result
    on_paper = paper if paper is not None and _same_elements(paper.plan, reading.plan) else None
    if on_paper is None:
        compiled = compile_plan(
            reading.plan,
            start_chain="no-start" in options.faults,
            bindings=reading.compiled.bindings,
        )
        decided = decide(compiled, constraints_under(options, compiled), options)
        on_paper = _context(decided, capabilities, result)
    if on_paper is not None:
        # What arrives may be otherwise on the engine, and with it the scenarios.
        constraints = constraints_under(options, reading.compiled)
        _compare(engine, reading, on_paper, constraints, result)
    return result


def _compare(
    engine: str,
    reading: EngineReading,
    paper: Context,
    constraints: Constraints,
    result: EngineFindings,
) -> None:
    """Decide what the plan does on the engine, and where that is not what the paper says."""
    alike = same_runs(paper.compiled.automaton, reading.compiled.automaton)
    decided = decided_like(paper, reading.compiled) if alike else None
    if decided is None:
        options = replace(paper.options, solver="z3")
        decided = decide(reading.compiled, constraints, options)
    context = _context(decided, paper.capabilities, result)
    if context is None:
        return
    result.facts, result.proof = decided.facts(), decided.proof
    # Alike is where runners succeed or fail. One that does not start fails on paper, and the engine
    # hears nothing of it.
    same = alike and not constraints.no_start
    result.contexts = OnEngine(engine, paper, context, reading.parameters, same=same)
    _apply_rules(result.contexts, result)
    if not alike:
        findings, undecided = differs_on_engine(paper, context, engine)
        result.findings += findings
        result.undecided += undecided
    if constraints.no_start:
        findings, undecided = hangs_without_start(context, engine)
        result.findings += findings
        result.undecided += undecided


def _context(
    decided: Decided, capabilities: Capabilities, result: EngineFindings
) -> Context | None:
    """The context of rules; None where the constraints admit no scenario."""
    if decided.contradictory:
        result.contradictory = True
        return None
    result.undecided += decided.inconclusive
    return Context(decided, capabilities)


def _same_elements(one: Plan, other: Plan) -> bool:
    """True if both are the same elements of one text."""
    if len(one.elements) != len(other.elements):
        return False
    return all(
        (first.kind, first.control_type, first.start, first.parent, first.attributes)
        == (second.kind, second.control_type, second.start, second.parent, second.attributes)
        for first, second in zip(one.elements, other.elements, strict=True)
    )


def _apply_rules(contexts: OnEngine, result: EngineFindings) -> None:
    for each in rules_of_engines():
        assert each.find_on_engine is not None
        try:
            result.findings += each.find_on_engine(contexts)
        except InconclusiveError:
            result.undecided.append(each.name)


def _refusal(reading: EngineText) -> Finding:
    """The finding for a plan that the engine does not take."""
    engine, result, place = reading.engine, reading.result, Location(reading.line, reading.column)
    if isinstance(result, Rejected):
        quoted = clip(result.message, _MAX_MESSAGE)
        message = (
            f"{engine} rejects this plan: {printable(result.reason)}; engine message: {quoted}"
        )
        return rule("GP701").finding(message, place, hint=printable(result.hint))
    assert isinstance(result, Crashed)
    message = f"{engine} crashes on this plan ({result.signal}): {printable(result.reason)}"
    return rule("GP702").finding(message, place)
