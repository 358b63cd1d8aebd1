"""From the text of an assumption to its formula for a plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.assumptions import messages
from gpsfsm.analysis.assumptions.bind import formula_of
from gpsfsm.analysis.assumptions.instances import Instances
from gpsfsm.analysis.assumptions.parser import statement_of

if TYPE_CHECKING:
    from gpsfsm.analysis.assumptions.formula import Formula
    from gpsfsm.analysis.assumptions.written import Statement
    from gpsfsm.model.plan import Plan

__all__ = ["Assumption", "Bound", "parse_assumption"]

_MAX_LENGTH = 10_000


@dataclass(frozen=True, slots=True)
class Bound:
    """An assumption about the instances of one plan.

    ``unmatched`` are its selectors that select nothing in this plan, in the order of the text.
    """

    text: str
    formula: Formula
    unmatched: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Assumption:
    """An assumption as written; ``str`` is its canonical form, which parses to the same."""

    text: str
    statement: Statement

    def __str__(self) -> str:
        return str(self.statement)

    def bind(self, plan: Plan, instances: Instances | None = None) -> Bound:
        """Return the formula that the assumption is for ``plan``, whose ``instances`` may be known.

        Raises AssumptionError for a line or path without runner, and where a selector without
        ``any`` or ``all`` selects several instances. An assumption about one instance (neither
        ``any`` nor ``all`` …) that the plan does not have does not apply to it: it is true.
        """
        try:
            formula, unmatched = formula_of(self.statement, instances or Instances(plan))
        except messages.Mistake as mistake:
            raise messages.error_at(self.text, mistake) from None
        return Bound(self.text, formula, unmatched)


def parse_assumption(text: str) -> Assumption:
    """Parse one assumption; raises AssumptionError with a caret under what is wrong.

    >>> str(parse_assumption("SpeechRunner NEVER fails"))
    'all SpeechRunner do not fail'
    """
    if len(text) > _MAX_LENGTH:
        raise messages.too_long(_MAX_LENGTH)
    if not text.strip():
        raise messages.empty()
    from lark.exceptions import UnexpectedInput  # noqa: PLC0415  (only needed with --assume)

    try:
        return Assumption(text, statement_of(text))
    except messages.Mistake as mistake:
        raise messages.error_at(text, mistake) from None
    except UnexpectedInput as error:
        raise messages.syntax_error(text, error) from None
