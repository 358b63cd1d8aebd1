"""Grading answers of language models against a task, by the paper's rubric (docs/tasks.md)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import partial
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.constraints import constraints_under
from gpsfsm.analysis.decide import Deciders
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import rule, select_rules
from gpsfsm.capabilities.defects import quoted
from gpsfsm.capabilities.library import Match, bind
from gpsfsm.checking import CheckOptions
from gpsfsm.checking.check import contradiction
from gpsfsm.checking.option_table import refuse_idle
from gpsfsm.checking.parallel import texts_of
from gpsfsm.checking.selection import Selection
from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.equivalence.comparison import Echo, echo_of
from gpsfsm.errors import AssumptionError, misused
from gpsfsm.fixing.engine import fix_text
from gpsfsm.grading.plan_gist import drive_of, gist_of
from gpsfsm.grading.tree_answer import holds_tree_answer, read_tree_answer
from gpsfsm.model.finding import Severity
from gpsfsm.model.story import PAPER_ENGINE
from gpsfsm.syntax.source import read_source
from gpsfsm.tasks.deciding import Decision, Effort, decide_task
from gpsfsm.tasks.task import Task
from gpsfsm.workers import engine_of, map_items

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from gpsfsm.checking.inputs import Input
    from gpsfsm.checking.parallel import Text
    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding
    from gpsfsm.model.finding import Problem
    from gpsfsm.model.plan import Plan
    from gpsfsm.syntax import Parsed
    from gpsfsm.tasks.deciding import DecidedBy


class Grade(StrEnum):
    """The grade of an answer.

    ``success``: syntax and theory are right; ``partial``: one of them is; ``failed``: neither is.
    ``undecided``: the theory could not be decided, so there is no grade.
    """

    SUCCESS = "success"
    PARTIAL = "partial"
    FAILED = "failed"
    UNDECIDED = "undecided"


@dataclass(frozen=True, slots=True)
class Graded:
    """The grade of one answer.

    - ``syntax``: the answer is a plan as it stands.
    - ``theory``: the plan, fixed if necessary, fulfils the task; None: undecided.
    - ``reason``: an explanation in one line.
    - ``decided_by``: ``replay``, ``z3`` or ``search``, if the plan was judged by the task.
    """

    path: str
    grade: Grade
    syntax: bool
    theory: bool | None
    reason: str
    decided_by: DecidedBy | None = None

    def to_dict(self) -> dict[str, Any]:
        """The entry of the answer in ``gpsfsm grade --table json``."""
        return {
            "path": self.path,
            "grade": self.grade.value,
            "syntax": self.syntax,
            "theory": self.theory,
            "reason": self.reason,
        }


_SYNTAX = "GP1"
_NO_TEXT = ("GP103",)
_MAX_MENDED = 1_000_000
"""Code points up to which a text is mended."""
_RANKS = {True: 0, None: 1, False: 2}


def graded_options(options: CheckOptions) -> CheckOptions:
    """The part of the options of a check on which a grade depends."""
    plain = AnalysisOptions()
    analysis = replace(
        options.analysis,
        deadline_s=None,
        energy_limit_j=None,
        tolerate=plain.tolerate,
        max_scenarios=plain.max_scenarios,
        total_rlimit=plain.total_rlimit,
        require_proof=False,
    )
    return replace(
        options,
        analysis=analysis,
        selection=Selection(),
        from_response=False,
        engine=PAPER_ENGINE,
    )


def refuse_idle_options(options: CheckOptions) -> None:
    """Raise UsageError for options on which no grade depends."""
    analysis, selection = options.analysis, options.selection
    refuse_idle(
        "grade",
        {
            "deadline_s": analysis.deadline_s,
            "energy_limit_j": analysis.energy_limit_j,
            "tolerate": analysis.tolerate,
            "max_scenarios": analysis.max_scenarios,
            "total_rlimit": analysis.total_rlimit,
            "require_proof": analysis.require_proof,
            "from_response": options.from_response,
            "select": sorted(selection.select or ()),
            "ignore": sorted(selection.ignore),
            "engine": options.engine,
        },
    )


@dataclass(slots=True)
class Grader:
    """Grades answers against one task.

    Raises UsageError for options that do not affect any grade.
    """

    task: Task
    options: CheckOptions = field(default_factory=CheckOptions)

    def __post_init__(self) -> None:
        if not isinstance(self.task, Task):
            raise misused("Grader", "a task", self.task, "gpsfsm.tasks.load.load_task reads one")
        refuse_idle_options(self.options)

    def grade(self, text: str | bytes, path: str) -> Graded:
        """Grade one answer. No answer raises."""
        decoded = read_source(text, self.options.limits).text
        if decoded is not None and holds_tree_answer(decoded):
            return self._tree(decoded, path)
        parsed = self._parse(text, path)
        errors = [one for one in parsed.problems if _is_error(one)]
        if any(one.rule in _NO_TEXT for one in errors):
            return Graded(path, Grade.UNDECIDED, False, None, errors[0].message)
        plans = self._meant(decoded, path) if errors else [parsed.plan]
        reason = partial(_with, errors[:1], "mended")
        return self._judged(path, not errors, [plan for plan in plans if plan is not None], reason)

    def _tree(self, text: str, path: str) -> Graded:
        answer = read_tree_answer(text, path, self.task, self.options.limits)
        if answer.over:
            return Graded(path, Grade.UNDECIDED, False, None, answer.why)
        faults = answer.faults or ()
        reason = partial(_with, faults[:1], "meant" if answer.gist else "")
        syntax = answer.faults == ()
        if answer.plan is None:
            return self._graded(path, syntax, False, reason(answer.why))
        return self._judged(path, syntax, [answer.plan], reason, tree=True)

    def _judged(
        self,
        path: str,
        syntax: bool,
        plans: Sequence[Plan],
        reason_for: Callable[[str], str],
        *,
        tree: bool = False,
    ) -> Graded:
        """The grade of an answer that can be read as these plans: the best of them counts."""
        acting = [plan for plan in plans if plan.runners]
        if not acting:
            why = "the plan does nothing" if plans else "there is no plan in it"
            return Graded(path, Grade.FAILED, syntax, False, reason_for(why))
        decisions: list[Decision] = []
        for plan in acting:
            compiled = compile_plan(plan, bindings=None if tree else self._bindings(plan))
            name = self._echoed(compiled)
            if name:
                reason = f"example returned: it is {name}"
                return Graded(path, Grade.FAILED, syntax, False, reason)
            mixed = "" if tree else self._mixed(plan)
            if mixed:
                return self._graded(path, syntax, False, reason_for(mixed))
            decisions.append(self._decide(plan, compiled))
            if decisions[-1].fulfilled:
                break
        best = min(decisions, key=lambda each: _RANKS[each.fulfilled])
        graded = self._graded(path, syntax, best.fulfilled, reason_for(_why(best)))
        return replace(graded, decided_by=best.decided_by)

    def _parse(self, text: str | bytes, path: str) -> Parsed:
        return read_plan(text, file=path, limits=self.options.limits, from_response=True)

    def _meant(self, text: str | None, path: str) -> Iterator[Plan | None]:
        """The plans that may have been meant: the mended one, and the gist of the text."""
        if text is None or "<" not in text:
            return
        if len(text) <= _MAX_MENDED:
            selection = Selection(select=select_rules((_SYNTAX,)))
            options = replace(
                self.options,
                selection=selection,
                from_response=True,
                task=None,
                engine=PAPER_ENGINE,
                decides=False,
            )
            fixed = fix_text(text, options, path=path, unsafe=True)
            parsed = self._parse(fixed.text, path)
            if not any(map(_is_error, parsed.problems)):
                yield parsed.plan
        gist = gist_of(text, drive_of(self.task))
        if gist:
            yield self._parse(gist, path).plan

    def _bindings(self, plan: Plan) -> tuple[Binding | None, ...]:
        return bind(plan, self.options.described.library)

    def _mixed(self, plan: Plan) -> str:
        """The reason to refuse a plan: it says something else than would be started; else ""."""
        library = self.options.described.library
        for runner in plan.runners:
            resolution = library.resolve(runner.interface, runner.provider)
            if resolution.match is Match.MISMATCH:
                return (
                    f"it is refused: {quoted(runner.interface)} at line {runner.line} has the "
                    f"provider {quoted(runner.provider)}, which implements "
                    f"{quoted(resolution.implements)}"
                )
        return ""

    def _echoed(self, compiled: Compiled) -> str:
        """The name of the example that the plan is; "" if it is none."""
        for example in self.task.not_answers:
            if echo_of(compiled, compile_plan(example.plan)) is Echo.SAME:
                return example.name
        return ""

    def _decide(self, plan: Plan, compiled: Compiled) -> Decision:
        analysis = self.options.analysis
        if "no-start" in analysis.faults:
            compiled = compile_plan(plan, start_chain=True, bindings=compiled.bindings)
        try:
            constraints = constraints_under(analysis, compiled)
        except AssumptionError as error:  # of a line, for one, that this answer does not have
            return Decision((), undecided=(error.summary,))
        effort = Effort(
            analysis.solver, rlimit=analysis.rlimit, second_opinion=analysis.second_opinion
        )
        contradictory = Deciders(compiled, constraints, analysis).contradictory
        if contradictory:  # every demand would be met, by nothing
            return Decision((), undecided=(contradiction(compiled.bindings),))
        decision = decide_task(compiled, constraints, self.task, effort=effort)
        if contradictory is None and decision.fulfilled:
            return Decision((), undecided=("whether the assumptions admit a scenario",))
        return decision

    def _graded(self, path: str, syntax: bool, theory: bool | None, reason: str) -> Graded:
        if theory is None:
            return Graded(path, Grade.UNDECIDED, syntax, theory, reason)
        grades = (Grade.FAILED, Grade.PARTIAL, Grade.SUCCESS)
        return Graded(path, grades[syntax + theory], syntax, theory, reason)


def _is_error(problem: Problem) -> bool:
    return rule(problem.rule).severity is Severity.ERROR


def _why(decision: Decision) -> str:
    if decision.departures:
        first = decision.departures[0]
        story = "; ".join(first.scenario.story)
        return f"{first.rule} {first.message}: {story}"
    if decision.undecided:
        return f"undecided: {', '.join(decision.undecided)}"
    return "the task is fulfilled"


def _with(errors: Sequence[Problem], how: str, reason: str) -> str:
    """The first syntax error, if there is any, and the reason; ``how`` the plan was found."""
    text = f"{how}: {reason}" if how and (errors or how == "meant") else reason
    if not errors:
        return text
    first = errors[0]
    return f"{first.rule} in line {first.location.line}: {first.message}; {text}"


@dataclass(frozen=True, slots=True)
class GradeWork:
    """The work on an answer that is to be graded."""

    task: Task
    options: CheckOptions

    def __call__(self, item: Text) -> Graded:
        """Grade it."""
        path, text = item
        return Grader(self.task, self.options).grade(text, path)


def grade_inputs(
    inputs: Sequence[Input], task: Task, options: CheckOptions, *, jobs: int | str = 1
) -> Iterator[Graded]:
    """Grade every input, in order, where ``jobs`` says; the grades do not depend on that.

    Raises UsageError for options that make no sense, and for an engine that is not to be had.
    """
    engine = engine_of(jobs, len(inputs))
    texts = texts_of(inputs, options.limits.max_bytes, _not_read)
    return map_items(engine, GradeWork(task, options), texts, lost=_lost)


def _not_read(path: str, why: str) -> Graded:
    return Graded(path, Grade.UNDECIDED, False, None, f"not read: {why}")


def _lost(item: Text, how: str) -> Graded:
    reason = f"the process that graded this answer {how}"
    return Graded(item[0], Grade.UNDECIDED, False, None, reason)
