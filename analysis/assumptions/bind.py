"""From the written form of an assumption to its formula for one plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.assumptions.formula import (
    Agree,
    Atom,
    Constant,
    Formula,
    Iff,
    conjunction,
    count,
    disjunction,
    negation,
)
from gpsfsm.analysis.assumptions.messages import Mistake, listed, short
from gpsfsm.analysis.assumptions.written import Claim, Quantifier, Selector, Statement, Tally

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.analysis.assumptions.instances import Instances

__all__ = ["formula_of"]

_MAX_ATOMS = 1_000_000


def formula_of(statement: Statement, instances: Instances) -> tuple[Formula, tuple[str, ...]]:
    """The formula of ``statement`` for a plan, and the selectors that select nothing in it.

    Raises Mistake where a selector does not fit the plan.
    """
    binder = _Binder(instances)
    formula = binder.formula(statement)
    if not binder.applies:
        formula = Constant(True)
    return formula, tuple(binder.unmatched)


class _Binder:
    """Turns written statements into formulas over the instances of one plan."""

    def __init__(self, instances: Instances) -> None:
        self.applies = True
        self.unmatched: dict[str, None] = {}
        self._instances = instances
        self._atoms = 0

    def formula(self, statement: Statement) -> Formula:
        """Return the formula of a statement; recursion is bounded by the nesting limit."""
        if isinstance(statement, Claim):
            return self._claim(statement)
        parts = [self.formula(part) for part in statement.parts]
        if isinstance(statement, Tally):
            return _quantified(statement.quantifier, parts)
        return _CONNECTIVES[statement.operator](parts)

    def _claim(self, claim: Claim) -> Formula:
        chosen = self._chosen(claim.selectors)
        self._atoms += len(chosen)
        if self._atoms > _MAX_ATOMS:
            wrong = f"the assumption speaks of more than {_MAX_ATOMS} runner instances"
            hint = "select fewer, or say less in one assumption"
            raise Mistake(claim.selectors[0].at, wrong, hint=hint)
        if claim.verb.word == "agree":
            return Agree(tuple(chosen)) if len(chosen) > 1 else Constant(True)
        if claim.quantifier.word == "the":
            self.applies = self.applies and bool(chosen)
            if len(chosen) > 1:
                self._ambiguous(claim.selectors[0], chosen)
        outcomes = claim.verb.outcomes
        return _quantified(claim.quantifier, [Atom(number, outcomes) for number in chosen])

    def _chosen(self, selectors: tuple[Selector, ...]) -> list[int]:
        found: set[int] = set()
        for selector in selectors:
            numbers = self._instances.select(selector)
            if not numbers:
                self.unmatched[str(selector)] = None
            found.update(numbers)
        return sorted(found)

    def _ambiguous(self, selector: Selector, chosen: list[int]) -> None:
        runners = [self._instances.plan.runners[number] for number in chosen]
        name = short(selector)
        places = listed(f"'line {runner.line}:{runner.column}'" for runner in runners)
        raise Mistake(
            selector.at,
            f"'{name}' selects {len(chosen)} runner instances",
            hint=f"write 'any {name}' (at least one of them) or 'all {name}' (each of"
            f" them), or select one: {places}",
        )


def _quantified(quantifier: Quantifier, parts: list[Formula]) -> Formula:
    number, every = quantifier.number, len(parts)
    if quantifier.word == "all":
        return conjunction(parts)
    least, most = {
        "no": (0, 0),
        "at least": (number, every),
        "at most": (0, number),
        "exactly": (number, number),
    }.get(quantifier.word, (1, every))
    return count(least, most, parts)


_CONNECTIVES: dict[str, Callable[[list[Formula]], Formula]] = {
    "not": lambda parts: negation(parts[0]),
    "and": conjunction,
    "or": disjunction,
    "xor": lambda parts: negation(Iff((parts[0], parts[1]))),
    "implies": lambda parts: disjunction((negation(parts[0]), parts[1])),
    "iff": lambda parts: Iff((parts[0], parts[1])),
}
