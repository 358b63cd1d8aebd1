"""The judge of answers that models give: it finds the plan, checks it and mends what is safe.

``JudgeApart`` does so in a process of its own, for runs in real time: z3 is used by one thread of a
process only, and what it is asked can take long; a process can be ended.
"""

from __future__ import annotations

import threading
from dataclasses import replace

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.errors import UsageError
from gpsfsm.fixing.engine import fix_text
from gpsfsm.fixing.suggest import Suggestions
from gpsfsm.generation.loop import Judgement
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import PlanReport, Report, Verdict
from gpsfsm.report import RenderOptions, render
from gpsfsm.syntax.response import extract_plan
from gpsfsm.workers import Lost
from gpsfsm.workers.pool_worker import KeptWorker

_PATH = "<answer>"
_MOST_FINDINGS = 50
_TAKEN_OUT = "GP115"  # a plan among prose is no mistake
_EMPTY = "GP109"


class PlanJudge:
    """Accepts a plan that has no finding as bad as ``fail_on``, and that could be decided.

    Stricter than a check in two things. Comments that suppress findings are for people: who is
    judged excuses nothing. And a plan without a step is none, whatever the task.

    ``mend``: an answer that is rejected is repaired first, as far as that cannot change what it
    means. What could change it is told to the model as lines to write instead.
    """

    def __init__(
        self,
        options: CheckOptions | None = None,
        *,
        fail_on: Severity = Severity.ERROR,
        mend: bool = True,
    ) -> None:
        self._options = replace(options or CheckOptions(), from_response=True, trees=False)
        self._fail_on = fail_on
        self._mend = mend
        self._render = RenderOptions(correct=Suggestions(self._options))

    def __call__(self, answer: str, /) -> Judgement:
        """Judge an answer; never raises for anything that is in it.

        Lines of findings are those of the answer without white space around it, or, after repairs,
        those of the plan.
        """
        answer = answer.strip()
        report = self._checked(answer)
        plan = self._plan_in(answer)
        if self._passes(report) or not self._mend:
            return self._judgement(plan, report)
        fixed = fix_text(answer, self._options, path=_PATH)
        mended = [done for done in fixed.applied if done.rule != _TAKEN_OUT]
        better = self._plan_in(fixed.text or "")
        if not mended or not better:
            return self._judgement(plan, report)
        repairs = tuple(dict.fromkeys(f"{done.rule}: {done.title}" for done in mended))
        return self._judgement(better, self._checked(better), repairs)

    def _checked(self, text: str) -> PlanReport:
        return _stricter(check_text(text, _PATH, self._options))

    def _passes(self, report: PlanReport) -> bool:
        return Report((report,)).exit_code(self._fail_on) == 0

    def _plan_in(self, text: str) -> str:
        place = extract_plan(text, self._options.limits.max_markup)
        return "" if place is None else place.of(text).strip()

    def _shown(self, report: PlanReport) -> PlanReport:
        """Of a plan that is rejected only what it is rejected for: the rest would distract."""
        least = self._fail_on.rank
        worst = tuple(each for each in report.findings if each.severity.rank >= least)
        return replace(report, findings=worst) if worst else report

    def _judgement(self, plan: str, report: PlanReport, repairs: tuple[str, ...] = ()) -> Judgement:
        accepted = self._passes(report) and plan != ""
        options = replace(
            self._render,
            good_enough=accepted or self._fail_on is Severity.ERROR,
            mended=() if accepted else repairs,
        )
        report_text = render(Report((self._shown(report),)), "llm", options=options)
        worst = sorted(report.findings, key=lambda finding: -finding.severity.rank)
        counts = [finding.severity for finding in report.findings]
        return Judgement(
            accepted,
            plan,
            report_text,
            errors=counts.count(Severity.ERROR),
            warnings=counts.count(Severity.WARNING),
            decided=report.verdict is not Verdict.ERROR,
            repairs=repairs,
            findings=tuple((each.rule, each.message) for each in worst[:_MOST_FINDINGS]),
        )


def _stricter(report: PlanReport) -> PlanReport:
    """The report on what a model has written: nothing is excused, and doing nothing is an error."""
    findings = [*report.findings, *(replace(each, suppressed_by="") for each in report.excused)]
    if report.facts is not None and report.facts.runners == 0:
        findings = [
            replace(each, severity=Severity.ERROR) if each.rule == _EMPTY else each
            for each in findings
        ]
    if not any(each.severity is Severity.ERROR for each in findings):
        return replace(report, findings=tuple(findings))
    verdict = Verdict.REJECT if report.verdict is Verdict.ACCEPT else report.verdict
    return replace(report, findings=tuple(findings), verdict=verdict)


class JudgeApart:
    """A ``PlanJudge`` in another process; may be called from any thread, use it with ``with``.

    The process begins with the first answer. One that takes too long is ended, and its answer
    counts as not decided.
    """

    def __init__(self, judge: PlanJudge, timeout_s: float = 100.0) -> None:
        self._lock = threading.Lock()
        self._kept: KeptWorker[str, Judgement] = KeptWorker(judge, timeout_s)

    def __enter__(self) -> JudgeApart:
        return self

    def __exit__(self, *_: object) -> None:
        self._kept.end()  # whoever waits for it in another thread is told that it has ended

    def __call__(self, answer: str, /) -> Judgement:
        """Judge an answer; never raises for anything that is in it."""
        ended = Lost("the process that checked the plan has ended")
        with self._lock:
            try:
                judgement = self._kept.do(answer)
            except UsageError:  # nobody has misused it: a process says so that cannot be trusted
                self._kept.end()
                judgement = ended
        if not isinstance(judgement, Lost):
            return judgement
        return _undecided(f"the check {judgement.how}" if judgement.late else ended.how)


def _undecided(why: str) -> Judgement:
    return Judgement(False, "", why, decided=False, findings=(("GP904", why),))
