"""The sentences that several formats share: counts, summaries, places."""

from __future__ import annotations

from collections import Counter

from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip, printable
from gpsfsm.model.report import (
    Effect,
    Facts,
    Frequency,
    Interval,
    PlanReport,
    Report,
    SettingUsed,
    Verdict,
)
from gpsfsm.selection import says_no_verdict

__all__ = [
    "MAX_MESSAGE",
    "VERDICTS",
    "count",
    "excused_words",
    "has_line",
    "headline",
    "place",
    "setting_line",
    "summary",
    "suppressed_line",
    "totals",
    "where",
]

MAX_MESSAGE = 2000
"""Messages, hints and element paths are clipped to this many code points where people read them."""

VERDICTS = {
    Verdict.ACCEPT: "accepted",
    Verdict.REJECT: "rejected",
    Verdict.ERROR: "not decided",
}

_COMPLETES = {
    Frequency.ALWAYS: "always completes",
    Frequency.SOMETIMES: "sometimes completes",
    Frequency.NEVER: "never completes",
    Frequency.UNKNOWN: "unknown whether it completes",
}
_GIVES_UP = {
    Frequency.ALWAYS: "always gives up",
    Frequency.SOMETIMES: "sometimes gives up",
    Frequency.NEVER: "never gives up",
    Frequency.UNKNOWN: "unknown whether it gives up",
}
_STUCK = {
    Frequency.ALWAYS: "always stuck",
    Frequency.SOMETIMES: "sometimes stuck",
    Frequency.NEVER: "never stuck",
    Frequency.UNKNOWN: "unknown whether it is stuck",
}
_HANGS = {
    Frequency.ALWAYS: "always hangs",
    Frequency.SOMETIMES: "sometimes hangs",
    Frequency.NEVER: "never hangs",
    Frequency.UNKNOWN: "unknown whether it hangs",
}
_ABORTS = {
    Frequency.ALWAYS: "always aborts the engine",
    Frequency.SOMETIMES: "sometimes aborts the engine",
    Frequency.NEVER: "never aborts the engine",
    Frequency.UNKNOWN: "unknown whether it aborts the engine",
}
_SEVERITIES = {
    Severity.ERROR: ("error", "errors"),
    Severity.WARNING: ("warning", "warnings"),
    Severity.INFO: ("info", "infos"),
}


def count(number: int, one: str, several: str = "") -> str:
    """``1 plan``, ``3 plans``."""
    return f"{number} {one if number == 1 else several or one + 's'}"


def place(path: str, location: Location) -> str:
    """``file:line:column``, or the file alone where there is no line."""
    shown = printable(path)
    return f"{shown}:{location.line}:{location.column}" if location.line > 0 else shown


def has_line(finding: Finding) -> bool:
    """Whether a finding has a line to show.

    What kept gpsfsm from reading the input at all is said of its first character, for want of a
    better one. It is about the whole input.
    """
    whole_input = says_no_verdict(finding.rule) and finding.location == Location(1, 1)
    return finding.location.line > 0 and not whole_input


def where(path: str, finding: Finding) -> str:
    """The place of a finding, or the file alone where it has none."""
    return place(path, finding.location) if has_line(finding) else printable(path)


_REFUSED = ("GP701", "GP702")
"""The rules that say that an engine does not take a plan."""


def headline(path: str, finding: Finding) -> str:
    """Tell a finding in one line."""
    message = clip(finding.message, MAX_MESSAGE)
    found = where(path, finding)
    return f"{found}: {finding.severity.value} {finding.rule} {finding.name}: {message}"


def suppressed_line(path: str, finding: Finding) -> str:
    """Tell in one line a finding that a comment in the plan suppresses, and why it does."""
    message = clip(finding.message, MAX_MESSAGE)
    reason = clip(finding.justification, MAX_MESSAGE)
    what = f"{finding.severity.value} {finding.rule} {finding.name}"
    return f"{where(path, finding)}: suppressed {what}: {message} (comment: {reason})"


def setting_line(used: SettingUsed) -> str:
    """Tell what a setting takes away, where it stands, and how much that is."""
    setting = clip(used.setting, MAX_MESSAGE)
    what = f"{setting} in {printable(used.file)}" if used.file else setting
    if used.effect is Effect.NARROWS:
        return f"decided with {what}"
    number = count(used.findings, "finding")
    if used.errors:
        number += f" ({count(used.errors, 'error')})"
    if used.effect is Effect.HIDES:
        return f"{number} hidden by {what}"
    return f"{number} let pass by {what}"


def summary(plan: PlanReport) -> str:
    """Tell what was decided about a plan, in one line without its path."""
    parts = [VERDICTS[plan.verdict]]
    if plan.facts is not None:
        parts += _told(plan.facts)
    elif plan.verdict is Verdict.REJECT:
        refused = any(finding.rule in _REFUSED for finding in plan.findings)
        what = "the engine does not run it" if refused else "the text could not be analysed"
        parts.append(what)
    if plan.suppressed:
        parts.append(count(len(plan.suppressed), "finding") + " suppressed")
    return "; ".join(parts)


def _told(facts: Facts) -> list[str]:
    ways = [_COMPLETES[facts.completes]]
    if facts.engine is None:
        ways += [_GIVES_UP[facts.gives_up], _STUCK[facts.stuck]]
    else:
        ways += [_HANGS[facts.engine.hangs], _ABORTS[facts.engine.aborts]]
    parts = [count(facts.runners, "runner instance"), ", ".join(ways)]
    if facts.engine is not None:
        parts[-1] += f" (on {facts.engine.name})"
    if facts.fewest_failures_to_give_up is not None:
        parts.append(f"fewest failures to give up: {facts.fewest_failures_to_give_up}")
    if facts.makespan is not None and (facts.makespan.min or facts.makespan.max is not None):
        parts.append(f"takes {_interval(facts.makespan, 's')}")
    if facts.energy is not None:
        parts.append(f"energy: {_interval(facts.energy, 'J')}")
    return parts


def _interval(found: Interval, unit: str) -> str:
    """``3 s to 20 s``, ``at least 3 s``, ``3 s``."""
    least = f"{found.min:.6g} {unit}"
    if found.max is None:
        return f"at least {least}"
    return least if found.min == found.max else f"{least} to {found.max:.6g} {unit}"


def totals(report: Report) -> str:
    """Count all plans and findings, in one line."""
    if not report.plans:
        return "no plan was checked"
    verdicts = Counter(plan.verdict for plan in report.plans)
    plans = ", ".join(
        f"{verdicts[verdict]} {word}" for verdict, word in VERDICTS.items() if verdicts[verdict]
    )
    severities = Counter(finding.severity for plan in report.plans for finding in plan.findings)
    findings = ", ".join(
        count(severities[severity], *words)
        for severity, words in _SEVERITIES.items()
        if severities[severity]
    )
    checked = count(len(report.plans), "plan")
    return f"{checked}: {plans}; {findings or 'no findings'}{excused_words(report)}"


def excused_words(report: Report) -> str:
    """Count what comments in the plans suppress; "" if that is nothing."""
    excused = len(report.excused)
    return f", {count(excused, 'finding')} suppressed by comments" if excused else ""
