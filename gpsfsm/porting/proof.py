"""Whether a text does on an engine what a plan means: each answer is decided, none believed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import rule
from gpsfsm.compile import compile_plan
from gpsfsm.compile.same_runs import same_runs
from gpsfsm.engine_checking import check_on_engine
from gpsfsm.engines import EngineReading, read_for_engine
from gpsfsm.model.engine import Crashed, Rejected
from gpsfsm.model.finding import Severity
from gpsfsm.syntax import parse
from gpsfsm.tasks.engine_difference import Compared, difference_on_engine
from gpsfsm.tasks.equivalence import UndecidedError, compare

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Plan
    from gpsfsm.reading import EngineText
    from gpsfsm.syntax import Limits

__all__ = ["Proof", "prove"]

_TYPES = "GP708"
_FAMILY = "GP7"
_MOST_SEARCHED = 1_000
"""Runners; what the porter itself writes is compared without a search."""


@dataclass(frozen=True, slots=True)
class Proof:
    """What is known of a text.

    ``reading`` is what the engine makes of it, None if it refuses; ``refusal`` says why then, and
    ``refused_at`` is line and column of what it is about.
    ``readable``: it holds no error
    for gpsfsm either. ``same``: by the paper, what the engine reads does the same as the plan.
    ``faithful``: the engine does with it what the paper says. ``findings`` are those of GP7xx.
    ``undecided`` names what a limit kept open; what it is about is then taken for false.
    """

    reading: EngineReading | None
    readable: bool
    same: bool
    faithful: bool
    findings: tuple[Finding, ...] = ()
    undecided: tuple[str, ...] = ()
    refusal: str = ""
    refused_at: tuple[int, int] = (1, 1)

    @property
    def errors(self) -> tuple[Finding, ...]:
        """The findings that forbid to run the text."""
        return tuple(found for found in self.findings if found.severity is Severity.ERROR)

    @property
    def runs(self) -> bool:
        """Whether the engine does with the text what the paper says of the text."""
        return self.runs_but_for_types and not self.errors

    @property
    def runs_but_for_types(self) -> bool:
        """The same, where attributes may still be spelt wrong."""
        told = all(found.rule == _TYPES for found in self.errors)
        return self.readable and self.faithful and told and not self.undecided


def prove(
    text: str | bytes,
    plan: Plan,
    engine: str,
    capabilities: Capabilities,
    *,
    file: str,
    limits: Limits,
) -> Proof:
    """Compare what the engine does with ``text`` with what ``plan`` means; outcomes are free.

    The findings are looked for only where the engine does what the paper says.
    """
    parsed = parse(text, file=file, limits=limits)
    readable = parsed.plan is not None and not any(
        rule(problem.rule).severity is Severity.ERROR for problem in parsed.problems
    )
    reading = read_for_engine(text, engine, file, capabilities.library, limits)
    if not isinstance(reading, EngineReading):
        return _refused(reading, readable)
    undecided: list[str] = []
    try:
        others = [reading.plan, *([parsed.plan] if parsed.plan else [])]
        same = all(compare(plan, other) is None for other in others)
    except UndecidedError:
        same = False
        undecided.append("whether the plan still does the same")
    compared = _compared(reading)
    if not compared.decided:
        undecided.append(f"whether the plan differs on {engine}")
    if not compared.decided or compared.difference is not None:
        return Proof(reading, readable, same, faithful=False, undecided=tuple(undecided))
    on_engine = check_on_engine(
        text,
        engine,
        AnalysisOptions(max_scenarios=0),
        capabilities,
        file=file,
        limits=limits,
        paper=None,
    )
    findings = tuple(found for found in on_engine.findings if found.rule.startswith(_FAMILY))
    undecided += on_engine.undecided
    if on_engine.seen is None:
        undecided.append("anything: what is declared of the runners admits no scenario")
    told = tuple(dict.fromkeys(undecided))
    return Proof(reading, readable, same, faithful=True, findings=findings, undecided=told)


def _compared(reading: EngineReading) -> Compared:
    """Linear where one thing happens after the other; else state by state."""
    paper, engine = compile_plan(reading.plan), reading.compiled
    if same_runs(paper.automaton, engine.automaton):
        return Compared(None)
    if len(reading.plan.runners) > _MOST_SEARCHED:  # the search keeps a history for each state
        return Compared(None, decided=False)
    return difference_on_engine(paper, engine)


def _refused(found: EngineText, readable: bool) -> Proof:
    """The engine does not take the text."""
    what = "dies on" if isinstance(found.result, Crashed) else "rejects"
    assert isinstance(found.result, Crashed | Rejected)
    refusal = f"{found.engine} {what} the plan however it is written: {found.result.reason}"
    return Proof(
        None,
        readable,
        same=False,
        faithful=False,
        refusal=refusal,
        refused_at=(found.line, found.column),
    )
