"""GP302: failures after which the plan gives up, and how many of them it takes.

All are one finding: the paper's machine means give-up by a failure that nothing handles, so each of
them alone is no defect. What one may ask is that a number of failures must not end the plan
(``--tolerate``, semantics 5.1).

    A, recovery(B), C         3 of 3 failures, or here 2: that of B, and that of C
    --tolerate 1              C alone ends the plan: one failure is not tolerated
"""

from __future__ import annotations

from enum import Enum
from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.completion import give_up_claim
from gpsfsm.analysis.on_engine import ending
from gpsfsm.analysis.rules.base import Rule, control, go, plan, say
from gpsfsm.analysis.words import WITHOUT, fewest_words, listed
from gpsfsm.compile import UnitKind
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.finding import Finding, Related, Severity
from gpsfsm.model.plan import line_words
from gpsfsm.model.report import Frequency
from gpsfsm.model.story import Statement, Terms, Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.dangling import DanglingEvent

_MOST_LINES = 8
_FAILING = (Outcome.FAILED, Outcome.NO_START)


class _Cause(Enum):
    """The reason why nothing handles an event; the order is that of the message."""

    LAST_ATTEMPT = "last_attempt"
    UNGUARDED = "unguarded"
    ALL_UNITS = "all_units"
    INVERTED = "inverted"

    def text(self, terms: Terms) -> str:
        """The reason in the words of a vocabulary."""
        text: str = getattr(terms, self.value)
        return text


def find(context: Context) -> Iterator[Finding]:
    """At most one finding; none if no run gives up."""
    decisive = [each for each in context.answers["dangling"] or () if each.effect == "give_up"]
    _, gives_up = context.answers["completion"] or (None, None)
    if not decisive and gives_up in (None, Frequency.NEVER, Frequency.UNKNOWN):
        return
    causes = {each: _cause(context, each) for each in decisive}
    fewest: int | None = context.answers["fewest"]
    tolerated = context.options.tolerate
    broken = bool(tolerated) and fewest is not None and fewest <= tolerated
    statement = Statement.UNHANDLED_FAILURE
    if decisive and decisive[0].event is Event.SUCCEEDED:
        statement = Statement.UNHANDLED_SUCCESS
    claim = give_up_claim()
    end = ending(context, context.scenario(RULE.code, claim, statement))
    severity = end.severity
    if broken and severity is Severity.INFO:
        severity = Severity.WARNING
    terms = context.terms
    if context.engine is not None and end.hangs:
        terms = Vocabulary.ENGINE.terms
    message = _counts(context, causes, terms, fewest=fewest)
    if broken:
        message += f", but --tolerate {tolerated} requires more"
    if severity is Severity.ERROR:
        hint = "rewrite the plan with gpsfsm port: this engine waits for ever after such a failure"
    else:
        hint = terms.tolerate_more if broken else terms.tolerate_hint
    elements = [context.runner(each.runner) for each in decisive]
    yield RULE.finding(
        message + end.note,
        context.plan.location(elements[0] if elements else 0),
        severity=severity,
        hint=hint,
        related=tuple(
            Related(context.plan.location(element), causes[each].text(terms))
            for each, element in list(zip(decisive, elements, strict=True))[1:]
        ),
        scenario=end.scenario,
    )


def _cause(context: Context, event: DanglingEvent) -> _Cause:
    units = context.units
    unit = context.unit_of_runner[event.runner]
    if event.event is Event.SUCCEEDED:
        return _Cause.INVERTED
    if any(
        units.kinds[around] is UnitKind.ANY and len(units.children[around]) > 1
        for around in context.around(unit)
    ):
        return _Cause.ALL_UNITS
    in_recovery = units.kinds[units.parents[unit]] is UnitKind.GUARD and units.positions[unit] > 0
    return _Cause.LAST_ATTEMPT if in_recovery else _Cause.UNGUARDED


def _counts(
    context: Context, causes: Mapping[DanglingEvent, _Cause], terms: Terms, *, fewest: int | None
) -> str:
    """``2 of 8 failures end the plan (line 5: last step of a recovery); 1 failure is enough``."""
    if not causes:  # no event of a runner ends it, or which ones do is unknown
        least = f" {WITHOUT}" if fewest == 0 else f"; {fewest_words(fewest, terms)}"
        return f"the {terms.whole} can {terms.give_up}{least}"
    number, total = len(causes), _able_to_fail(context)
    what = "failure" if total == 1 else "failures"
    failures = _Cause.INVERTED not in causes.values()
    if not failures:
        what, total = "outcomes", total + list(causes.values()).count(_Cause.INVERTED)
    lines: dict[_Cause, set[tuple[str, int]]] = {}
    for event, cause in causes.items():
        runner = context.runner(event.runner)
        lines.setdefault(cause, set()).add((runner.file, runner.line))
    groups = [
        f"{_lines(sorted(lines[cause]))}: {cause.text(terms)}" for cause in _Cause if cause in lines
    ]
    verb = terms.ends_it[0 if number == 1 else 1]
    reasons, least = "; ".join(groups), fewest_words(fewest, terms, failures=failures)
    return f"{number} of {total} {what} {verb} ({reasons}); {least}"


def _able_to_fail(context: Context) -> int:
    """The number of runners that some run triggers and that can fail."""
    unreachable = set(context.answers["reachability"] or ())
    structure, constraints = context.deciders.structure, context.deciders.constraints
    return sum(
        structure.can_fail[structure.unit_of[number]]
        if structure is not None
        else any(outcome in _FAILING for outcome in constraints.allowed[number])
        for number in range(len(context.plan.runners))
        if number not in unreachable
    )


def _lines(lines: Sequence[tuple[str, int]]) -> str:
    words = [line_words(str(line), file) for file, line in lines]
    return f"line{'s' * (len(lines) > 1)} {listed(words, most=_MOST_LINES)}"


RULE = Rule(
    code="GP302",
    name="dangling-failure",
    severity=Severity.INFO,
    summary="Failures that nothing handles end the plan.",
    why=(
        "The machine is only partially specified: if nothing handles a failure, the plan "
        "gives up, and a new one is generated. The paper intends this, so it is not a defect. "
        "The finding shows which failures these are and how many are enough. To require "
        "more, use `--tolerate N`: then no N failures may end the plan, which is decided "
        "exactly. A plan that violates this gets a warning, and the gate rejects it."
    ),
    fix=(
        "nothing, or add a recovery that reaches the goal in another way after the runner that "
        "fails in the scenario"
    ),
    bad=plan(go(2.0, 0.5), say("I am here.")),
    good=plan(go(2.0, 0.5), control("recovery", say("I cannot get there."))),
    options=("--assume", "SpeechRunner never fails"),
    severities=(
        "info; warning if as many failures as `--tolerate` allows, or fewer, end the plan. With "
        "--engine the plan hangs instead; error if the engine also runs it differently from "
        "the paper"
    ),
    spread=True,
    find=find,
)
