"""Port a plan: the smallest change of its text for which gpsfsm finds a proof.

The proof shows that the engine runs the text as the paper specifies for the plan.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import rule
from gpsfsm.capabilities.dialects import in_dialect
from gpsfsm.capabilities.library import Capabilities, builtin_capabilities
from gpsfsm.checking.engine_check import check_on_engine
from gpsfsm.compile import compile_plan
from gpsfsm.compile.engine import same_runs
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.equivalence import UndecidedError, compare
from gpsfsm.equivalence.engine_difference import Compared, difference_on_engine
from gpsfsm.errors import GpsfsmError, InternalError, UsageError
from gpsfsm.model.engine import Crashed, Rejected
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import ControlType
from gpsfsm.model.story import ENGINES, PAPER_ENGINE
from gpsfsm.porting.forms import Form, form_of
from gpsfsm.porting.reading import Source, read
from gpsfsm.porting.respelling import altered, respell
from gpsfsm.porting.result import Change, Loss, Note, Ported, losses_of
from gpsfsm.porting.writing import Draft, write
from gpsfsm.syntax import DEFAULT_LIMITS, parse

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.compile.engine_text import EngineText
    from gpsfsm.compile.units import Units
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Plan
    from gpsfsm.syntax import Limits

TARGETS = tuple(name for name in ENGINES if name != PAPER_ENGINE)
"""The engines that plans can be ported to."""
_TYPES = "GP708"
_FAMILY = "GP7"
_MOST_SEARCHED = 1_000
"""Runners; what the porter itself writes is compared without a search."""


def port(
    text: bytes | str,
    engine: str,
    *,
    file: str = "<text>",
    capabilities: Capabilities | None = None,
    limits: Limits = DEFAULT_LIMITS,
    unsafe: bool = False,
) -> Ported:
    """Rewrite a plan so that the engine runs it as the paper specifies.

    The result is proved for all outcomes: the new text has the same behaviour in the paper's
    semantics, and the engine runs it as the paper specifies. A text that needs no change is
    returned as it is. If no such text exists, ``unsafe`` returns the closest one, with what it
    changes.

    Raises UsageError for an unknown engine; UnclearError (a GpsfsmError) for a text with errors
    that gpsfsm cannot fix safely; GpsfsmError if gpsfsm cannot decide within the limits.

    >>> plan = '<Plan><Control type="sequential"/><Runner interface="Go" provider="Go"/></Plan>'
    >>> port(plan, "fabric-v2").text
    '<Plan><Runner interface="Go" provider="Go"/></Plan>'
    """
    if engine not in TARGETS:
        raise UsageError(
            f"plans cannot be ported to '{engine}'; the targets are {', '.join(TARGETS)}"
        )
    described = in_dialect(capabilities or builtin_capabilities(), engine)
    source = read(text, file, limits, described)
    return _Porting(text, source, engine, described, file, limits, unsafe).run()


@dataclass(slots=True)
class _Porting:
    text: bytes | str
    source: Source
    engine: str
    capabilities: Capabilities
    file: str
    limits: Limits
    unsafe: bool
    notes: list[Note] = field(default_factory=list)
    losses: list[Loss] = field(default_factory=list)

    def run(self) -> Ported:
        source = self.source
        self.notes += source.notes
        form, units = form_of(source.plan)
        unchanged = self._as_it_is() if not form.lost else None
        draft, proof = unchanged or self._rewritten(form, units)
        right = proof.runs and draft.text == source.original and unchanged is not None
        respelled = respell(draft, proof, source, self.engine, self.limits)
        self.notes += respelled.notes
        self.losses += respelled.losses
        self.losses.sort(key=lambda loss: (loss.line, loss.column))
        if self.losses and not (self.unsafe and all(loss.instead for loss in self.losses)):
            return self._result(draft, None)
        if respelled.text != draft.text:
            draft = Draft(respelled.text, draft.runners)
            proof = self._prove(draft.text)
        if not proof.runs or not (proof.same or self.losses):
            raise InternalError(f"the ported plan has no proof: {_unproved(proof)}")
        self.notes += altered(draft, proof, source, self.engine)
        return self._result(draft, proof, changed=not right)

    def _prove(self, text: str | bytes) -> Proof:
        return prove(
            text,
            self.source.plan,
            self.engine,
            self.capabilities,
            file=self.file,
            limits=self.limits,
        )

    def _as_it_is(self) -> tuple[Draft, Proof] | None:
        """The text without errors, if nothing but values is wrong with it."""
        source = self.source
        whole = source.text == source.original
        proof = self._prove(self.text if whole else source.text)
        if not (proof.same and proof.runs_but_for_types):
            return None
        return Draft(source.text, tuple(runner.index for runner in source.plan.runners)), proof

    def _rewritten(self, form: Form, units: Units) -> tuple[Draft, Proof]:
        """The plan with another structure, which is not yet what it should be in its values."""
        source = self.source
        plan = source.plan
        draft = write(source.text, source.tokens, plan, units, form.steps)
        proof = self._prove(draft.text)
        if proof.undecided:
            raise GpsfsmError(
                f"{self.file}: a step limit was reached before gpsfsm could decide "
                f"{', '.join(proof.undecided)}"
            )
        if proof.refusal:
            self.losses.append(self._refused(draft, proof))
            return draft, proof
        if not proof.runs_but_for_types or not (proof.same or form.lost):
            raise InternalError(f"the ported plan has no proof: {_unproved(proof)}")
        self._note_structure(form, draft)
        if not proof.same:
            self.losses += losses_of(plan, form.lost, source.place, self.engine)
        return draft, proof

    def _refused(self, draft: Draft, proof: Proof) -> Loss:
        """The loss of everything: the engine does not take what is in the plan."""
        plan = parse(draft.text, limits=self.limits).plan
        place = self.source.place(self.source.plan.elements[0])
        for number, runner in enumerate(plan.runners if plan else ()):
            if (runner.line, runner.column) == proof.refused_at:
                place = self.source.place(self.source.plan.elements[draft.runners[number]])
        return Loss(*place, proof.refusal)

    def _note_structure(self, form: Form, draft: Draft) -> None:
        """Say what became of controls, and of a completion runner."""
        plan = self.source.plan
        messages = [
            (plan.elements[dropped.element], f"is removed: {dropped.why}")
            for dropped in form.dropped
        ]
        lost = {each.element for each in form.lost}
        for index in draft.dissolved:
            element = plan.elements[index]
            if element.control_type is ControlType.RECOVERY:
                messages.append((element, "is merged with the recovery before it"))
            elif index not in lost:
                messages.append((element, "is removed; its content stays"))
        self.notes += (
            Note(*self.source.place(element), f"this {element.words} {what}")
            for element, what in messages
        )
        completion = plan.dropped_completion
        if completion is not None:
            what = f"the completion runner is removed: {self.engine} appends its own"
            self.notes.append(Note(*self.source.place(completion), what))

    def _change(self, proof: Proof) -> Change:
        assert proof.reading is not None
        plan, ported = self.source.plan, proof.reading.plan
        try:
            return Change(plan, ported, compare(plan, ported))
        except UndecidedError:
            return Change(plan, ported, None, decided=False)

    def _result(self, draft: Draft, proof: Proof | None, *, changed: bool = False) -> Ported:
        """The text with its proof, or that there is none."""
        return Ported(
            original=self.source.original,
            text=draft.text if proof else None,
            notes=tuple(sorted(self.notes, key=lambda note: (note.line, note.column, note.text))),
            losses=tuple(self.losses),
            change=self._change(proof) if proof and self.losses else None,
            changed=changed,
        )


def _unproved(proof: Proof) -> str:
    """The gap in a proof."""
    if proof.errors:
        return proof.errors[0].message
    if not proof.readable:
        return "its text has errors"
    return "its behaviour differs" if proof.faithful else "it behaves differently on the engine"


@dataclass(frozen=True, slots=True)
class Proof:
    """The proof about a text, or what it lacks.

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
        return tuple(finding for finding in self.findings if finding.severity is Severity.ERROR)

    @property
    def runs(self) -> bool:
        """True if the engine does with the text what the paper says of the text."""
        return self.runs_but_for_types and not self.errors

    @property
    def runs_but_for_types(self) -> bool:
        """The same, where attributes may still be spelt wrong."""
        types_only = all(finding.rule == _TYPES for finding in self.errors)
        return self.readable and self.faithful and types_only and not self.undecided


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
    findings = tuple(finding for finding in on_engine.findings if finding.rule.startswith(_FAMILY))
    undecided += on_engine.undecided
    if on_engine.contexts is None:
        undecided.append("anything, because the declared effects of the runners admit no scenario")
    names = tuple(dict.fromkeys(undecided))
    return Proof(reading, readable, same, faithful=True, findings=findings, undecided=names)


def _compared(reading: EngineReading) -> Compared:
    """Linear where one thing happens after the other; else state by state."""
    paper, engine = compile_plan(reading.plan), reading.compiled
    if same_runs(paper.automaton, engine.automaton):
        return Compared(None)
    if len(reading.plan.runners) > _MOST_SEARCHED:  # the search keeps a history for each state
        return Compared(None, decided=False)
    return difference_on_engine(paper, engine)


def _refused(reading: EngineText, readable: bool) -> Proof:
    """The engine does not take the text."""
    what = "crashes on" if isinstance(reading.result, Crashed) else "rejects"
    assert isinstance(reading.result, Crashed | Rejected)
    refusal = f"{reading.engine} {what} the plan in any form: {reading.result.reason}"
    return Proof(
        None,
        readable,
        same=False,
        faithful=False,
        refusal=refusal,
        refused_at=(reading.line, reading.column),
    )
