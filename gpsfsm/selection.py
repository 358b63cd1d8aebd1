"""Which findings are shown: suppression comments, --select, --ignore.

A comment is written by the author of the plan, who may be a language model. So it names single
rules and gives a reason, or it suppresses nothing; and what it suppresses is listed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import rule, select_rules
from gpsfsm.errors import UsageError

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.model.finding import Finding
    from gpsfsm.syntax import Suppression

__all__ = ["Selection", "apply_suppressions", "says_no_verdict", "told_once"]

_HOW = "write <!-- gpsfsm: ignore GP302 because ... --> with a reason, and the rule's code or name"
_NO_VERDICT = frozenset({"GP103", "GP901", "GP902", "GP903", "GP904", "GP907"})


def says_no_verdict(code: str) -> bool:
    """Whether findings of this rule say why gpsfsm could not decide a plan.

    They are always shown: hiding them would hide why the exit code is 2.
    """
    return code in _NO_VERDICT


@dataclass(frozen=True, slots=True)
class Selection:
    """``select`` and ``ignore`` hold rule codes; None selects all rules.

    What says that gpsfsm could not decide is always shown.
    """

    select: frozenset[str] | None = None
    ignore: frozenset[str] = frozenset()

    @classmethod
    def of(cls, select: Sequence[str] = (), ignore: Sequence[str] = ()) -> Selection:
        """From codes, names or prefixes as users write them; raises UsageError."""
        return cls(select_rules(tuple(select)) if select else None, select_rules(tuple(ignore)))

    def split(self, findings: Iterable[Finding]) -> tuple[list[Finding], list[Finding]]:
        """The findings that are shown, and the others (suppressed by an option)."""
        shown: list[Finding] = []
        hidden: list[Finding] = []
        for finding in findings:
            selected = self.select is None or finding.rule in self.select
            if says_no_verdict(finding.rule) or (selected and finding.rule not in self.ignore):
                shown.append(finding)
            else:
                hidden.append(replace(finding, suppressed_by="option"))
        return shown, hidden


def apply_suppressions(
    findings: Sequence[Finding], suppressions: Sequence[Suppression], *, analysed: bool = True
) -> tuple[list[Finding], list[Finding], list[Finding]]:
    """Split findings into kept and suppressed ones; third, a finding per useless suppression.

    ``analysed`` tells whether all findings are there, so that it is known which comments suppress
    nothing. Of several comments that suppress a finding the first one justifies it.
    """
    if not suppressions:
        return list(findings), [], []
    reasons: dict[int, str] = {}
    unused: list[Finding] = []
    for suppression in suppressions:
        codes, wrong = _meant(suppression)
        unused += [rule("GP905").finding(why, suppression.location, hint=_HOW) for why in wrong]
        for name, code in codes.items():
            covered = {
                index
                for index, finding in enumerate(findings)
                if finding.rule == code
                and not says_no_verdict(code)
                and _inside(finding.location.element, suppression.scope)
            }
            for index in covered:
                reasons.setdefault(index, suppression.reason)
            if not covered and analysed:
                message = f"'{name}' finds nothing here to suppress"
                unused.append(rule("GP905").finding(message, suppression.location))
    return (
        [finding for index, finding in enumerate(findings) if index not in reasons],
        [
            replace(finding, suppressed_by="comment", justification=reasons[index])
            for index, finding in enumerate(findings)
            if index in reasons
        ],
        unused,
    )


def told_once(findings: Iterable[Finding], *, by: Iterable[Finding]) -> list[Finding]:
    """The findings without those that findings among ``by`` tell as well (``Finding.unless``)."""
    told = {(finding.rule, element) for finding in by for element in finding.elements}
    return [
        finding for finding in findings if (finding.unless, finding.location.element) not in told
    ]


def _inside(element: str, scope: str) -> bool:
    element = element.partition("@")[0]  # further uses of a node of a tree are that node
    return bool(scope) and (element == scope or element.startswith(scope + "/"))


def _meant(suppression: Suppression) -> tuple[dict[str, str], list[str]]:
    """The codes of the rules that a comment names, and what is wrong with it."""
    if not suppression.rules:
        return {}, ["this gpsfsm comment names no rule, so it suppresses nothing"]
    if not any(map(str.isalnum, suppression.reason)):
        return {}, ["this gpsfsm comment gives no reason, so it suppresses nothing"]
    codes, wrong = {}, []
    for name in suppression.rules:
        try:
            codes[name] = rule(name).code
        except UsageError:
            wrong.append(f"there is no rule '{name}': a comment names each rule that it suppresses")
    return codes, wrong
