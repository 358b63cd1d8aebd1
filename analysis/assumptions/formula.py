"""The formula that an assumption becomes for one plan: over the outcomes of runner instances.

Formulas may be very wide; all functions over them are loops, so that no depth can exhaust the
stack (but for what ``by_deviations`` makes, which calls as deeply as texts may be nested).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from gpsfsm.model.event import Outcome

if TYPE_CHECKING:
    from collections.abc import Callable, Container, Iterable, Mapping, Sequence

T = TypeVar("T")

_EVERY = frozenset(Outcome)


@dataclass(frozen=True, slots=True)
class Constant:
    """True or false in every scenario."""

    value: bool


@dataclass(frozen=True, slots=True)
class Atom:
    """The outcome of the runner instance with this number is one of ``outcomes``."""

    runner: int
    outcomes: frozenset[Outcome]


@dataclass(frozen=True, slots=True)
class Agree:
    """The outcomes of these instances are equal."""

    runners: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Not:
    """The part does not hold; ``parts`` is that one part."""

    parts: tuple[Formula]


@dataclass(frozen=True, slots=True)
class And:
    """All parts hold."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Or:
    """At least one part holds."""

    parts: tuple[Formula, ...]


@dataclass(frozen=True, slots=True)
class Iff:
    """Both parts hold, or neither."""

    parts: tuple[Formula, Formula]


@dataclass(frozen=True, slots=True)
class Count:
    """At least ``least`` and at most ``most`` of the parts hold."""

    least: int
    most: int
    parts: tuple[Formula, ...]


Leaf = Constant | Atom | Agree
Branch = Not | And | Or | Iff | Count
Formula = Leaf | Branch

Deviations: TypeAlias = "Sequence[tuple[int, Outcome]]"
"""The instances that do not succeed, each with its outcome."""
_Test: TypeAlias = "Callable[[Deviations], bool]"


def negation(formula: Formula) -> Formula:
    """Return the formula that holds where ``formula`` does not."""
    if isinstance(formula, Constant):
        return Constant(not formula.value)
    if isinstance(formula, Atom):
        return Atom(formula.runner, _EVERY - formula.outcomes)
    if isinstance(formula, Not):
        return formula.parts[0]
    return Not((formula,))


def conjunction(parts: Iterable[Formula]) -> Formula:
    """Return all of ``parts`` as one formula, constants folded."""
    kept = [part for part in parts if part != Constant(True)]
    if Constant(False) in kept:
        return Constant(False)
    if len(kept) == 1:
        return kept[0]
    return And(tuple(kept)) if kept else Constant(True)


def disjunction(parts: Iterable[Formula]) -> Formula:
    """Any of ``parts``, constants folded."""
    kept = [part for part in parts if part != Constant(False)]
    if Constant(True) in kept:
        return Constant(True)
    if len(kept) == 1:
        return kept[0]
    return Or(tuple(kept)) if kept else Constant(False)


def count(least: int, most: int, parts: Iterable[Formula]) -> Formula:
    """Between ``least`` and ``most`` of ``parts``, constants and plain cases folded."""
    every = tuple(parts)
    kept = tuple(part for part in every if not isinstance(part, Constant))
    certain = sum(part == Constant(True) for part in every)
    least, most = max(least - certain, 0), min(most - certain, len(kept))
    if least > most:
        return Constant(False)
    if least == 0 and most == len(kept):
        return Constant(True)
    if most == 0:
        return conjunction(map(negation, kept))
    if least == len(kept):
        return conjunction(kept)
    if least == 1 and most == len(kept):
        return disjunction(kept)
    return Count(least, most, kept)


def _fold(formula: Formula, leaf: Callable[[Leaf], T], branch: Callable[[Branch, list[T]], T]) -> T:
    """Compute a value from the leaves upwards, without recursion."""
    values: list[T] = []
    stack: list[tuple[Formula, bool]] = [(formula, False)]
    while stack:
        current, ready = stack.pop()
        if isinstance(current, Constant | Atom | Agree):
            values.append(leaf(current))
        elif ready:
            first = len(values) - len(current.parts)
            parts = values[first:]
            del values[first:]
            values.append(branch(current, parts))
        else:
            stack.append((current, True))
            stack.extend((part, False) for part in reversed(current.parts))
    return values[0]


def evaluate(formula: Formula, outcome_of: Callable[[int], Outcome]) -> bool:
    """True if ``formula`` holds where ``outcome_of`` tells the outcome of each instance."""

    def leaf(part: Leaf) -> bool:
        if isinstance(part, Constant):
            return part.value
        if isinstance(part, Atom):
            return outcome_of(part.runner) in part.outcomes
        return len(set(map(outcome_of, part.runners))) <= 1

    def branch(part: Branch, parts: list[bool]) -> bool:
        if isinstance(part, Not):
            return not parts[0]
        if isinstance(part, And):
            return all(parts)
        if isinstance(part, Or):
            return any(parts)
        if isinstance(part, Iff):
            return parts[0] == parts[1]
        return part.least <= sum(parts) <= part.most

    return _fold(formula, leaf, branch)


def holds(formula: Formula, outcomes: Sequence[Outcome]) -> bool:
    """True if ``formula`` holds in the scenario ``outcomes`` (one per instance).

    >>> holds(Atom(0, frozenset({Outcome.FAILED})), [Outcome.FAILED, Outcome.SUCCEEDED])
    True
    """
    return evaluate(formula, outcomes.__getitem__)


def by_deviations(formula: Formula) -> Callable[[Deviations], bool]:
    """``holds`` as a function of the instances that do not succeed, with their outcomes.

    It takes as long as there are such instances, and not as the formula is wide.

    >>> by_deviations(Atom(0, frozenset({Outcome.FAILED})))([(0, Outcome.FAILED)])
    True
    """
    return _fold(formula, _leaf_test, _branch_test)


def _leaf_test(leaf: Leaf) -> _Test:
    if isinstance(leaf, Constant):
        value = leaf.value
        return lambda _: value
    if isinstance(leaf, Atom):
        return _counting([leaf], (), {1})
    spoken = frozenset(leaf.runners)

    def agree(deviations: Deviations) -> bool:
        deviating = [outcome for number, outcome in deviations if number in spoken]
        return not deviating or (len(deviating) == len(spoken) and len(set(deviating)) == 1)

    return agree


def _branch_test(branch: Branch, parts: list[_Test]) -> _Test:
    """Every branch is about how many of its parts hold."""
    size = len(parts)
    wanted: Container[int]
    if isinstance(branch, Not):
        wanted = {0}
    elif isinstance(branch, And):
        wanted = {size}
    elif isinstance(branch, Or):
        wanted = range(1, size + 1)
    elif isinstance(branch, Iff):
        wanted = {0, 2}
    else:
        wanted = range(branch.least, branch.most + 1)
    atoms = [part for part in branch.parts if isinstance(part, Atom)]
    others = [
        test for part, test in zip(branch.parts, parts, strict=True) if not isinstance(part, Atom)
    ]
    return _counting(atoms, others, wanted)


def _counting(atoms: Sequence[Atom], others: Sequence[_Test], wanted: Container[int]) -> _Test:
    """True if so many of the parts hold: of the atoms, what deviations change is counted."""
    usual = sum(Outcome.SUCCEEDED in atom.outcomes for atom in atoms)
    changes: dict[tuple[int, Outcome], int] = {}
    for atom in atoms:
        before = Outcome.SUCCEEDED in atom.outcomes
        for outcome in Outcome:
            key = (atom.runner, outcome)
            changes[key] = changes.get(key, 0) + (outcome in atom.outcomes) - before

    def test(deviations: Deviations) -> bool:
        count = usual + sum([changes.get(each, 0) for each in deviations])
        return count + sum([other(deviations) for other in others]) in wanted

    return test


def runners(formula: Formula) -> frozenset[int]:
    """Return the numbers of the instances that ``formula`` speaks of."""
    numbers: set[int] = set()
    stack: list[Formula] = [formula]
    while stack:
        current = stack.pop()
        if isinstance(current, Atom):
            numbers.add(current.runner)
        elif isinstance(current, Agree):
            numbers.update(current.runners)
        elif not isinstance(current, Constant):
            stack.extend(current.parts)
    return frozenset(numbers)


def unary(formula: Formula) -> Mapping[int, frozenset[Outcome]] | None:
    """Return the outcomes that each instance may have, if each is constrained by itself.

    None if it does not split so; instances that are not in the answer are free.
    """
    allowed: dict[int, frozenset[Outcome]] = {}
    stack: list[tuple[Formula, bool]] = [(formula, True)]
    while stack:
        current, wanted = stack.pop()
        if isinstance(current, Not):
            stack.append((current.parts[0], not wanted))
        elif isinstance(current, And if wanted else Or):
            stack.extend((part, wanted) for part in current.parts)
        elif current != Constant(wanted):
            single = _single(current, wanted)
            if single is None:
                return None
            runner, outcomes = single
            allowed[runner] = allowed.get(runner, _EVERY) & outcomes
    return dict(sorted(allowed.items()))


def _single(formula: Formula, wanted: bool) -> tuple[int, frozenset[Outcome]] | None:
    """Return the only instance that is spoken of, with the outcomes that give ``wanted``."""
    if isinstance(formula, Atom):
        return formula.runner, formula.outcomes if wanted else _EVERY - formula.outcomes
    spoken = runners(formula)
    if len(spoken) != 1:
        return None
    (runner,) = spoken
    allowed = (o for o in Outcome if evaluate(formula, {runner: o}.__getitem__) is wanted)
    return runner, frozenset(allowed)


def to_smt(formula: Formula, atom: Callable[[int, frozenset[Outcome]], str]) -> str:
    """Return the formula as an SMT-LIB term; ``atom`` gives the terms of the atoms."""

    def leaf(part: Leaf) -> str:
        if isinstance(part, Constant):
            return "true" if part.value else "false"
        if isinstance(part, Atom):
            return atom(part.runner, part.outcomes)
        return _smt_agree(part, atom)

    def branch(part: Branch, parts: list[str]) -> str:
        if isinstance(part, Count):
            return _smt_count(part, parts)
        if not parts:
            return "true" if isinstance(part, And) else "false"
        operator = {Not: "not", And: "and", Or: "or", Iff: "="}[type(part)]
        return f"({operator} {' '.join(parts)})"

    return _fold(formula, leaf, branch)


def _smt_agree(agree: Agree, atom: Callable[[int, frozenset[Outcome]], str]) -> str:
    terms: list[str] = []
    for outcome in Outcome:
        if outcome is Outcome.FAILED:
            continue  # where the three others are equal, so is this one
        sides = [atom(runner, frozenset({outcome})) for runner in agree.runners]
        terms += [f"(= {one} {two})" for one, two in pairwise(sides) if one != two]
    if len(terms) <= 1:
        return terms[0] if terms else "true"
    return f"(and {' '.join(terms)})"


def _smt_count(count: Count, parts: list[str]) -> str:
    if count.most < 0 or count.least > len(parts):
        return "false"
    names = " ".join(f"part_{number}" for number in range(len(parts)))
    bounds = [f"((_ at-least {count.least}) {names})"] if count.least > 0 else []
    bounds += [f"((_ at-most {count.most}) {names})"] if count.most < len(parts) else []
    if not bounds:
        return "true"
    # Named parts are written once, however deep counts are nested.
    bindings = " ".join(f"(part_{number} {part})" for number, part in enumerate(parts))
    body = bounds[0] if len(bounds) == 1 else f"(and {' '.join(bounds)})"
    return f"(let ({bindings}) {body})"
