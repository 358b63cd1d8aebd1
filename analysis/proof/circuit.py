"""Boolean circuits as literals, and their text for z3.

A literal is a number, its negative is the negation, and 1 is "true". Gates with the same inputs are
one gate, and constants are folded as the circuit grows: what cannot fail leads to nothing.

    and(4, or(2, -2))        or(2, -2) is 1, so that and(4, 1) is 4: no gate at all
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

TRUE = 1
FALSE = -TRUE


class Circuit:
    """A circuit that grows; ``text`` is what has come since the last one was taken."""

    def __init__(self, prefix: str = "v") -> None:
        self._prefix = prefix
        self.size = TRUE  # the greatest literal in use
        self._gates: dict[tuple[int, ...], int] = {}
        self._lines: list[str] = []
        self._names = {TRUE: "true", FALSE: "false"}

    def fresh(self) -> int:
        """A literal that is free."""
        self.size += 1
        number = self.size
        name = f"{self._prefix}{number}"
        self._names[number] = name
        self._names[-number] = f"(not {name})"
        self._lines.append(f"(declare-const {name} Bool)")
        return number

    def all(self, literals: Iterable[int]) -> int:
        """True if all of these are."""
        inputs = dict.fromkeys(literals)
        inputs.pop(TRUE, None)
        if FALSE in inputs or any(-each in inputs for each in inputs):
            return FALSE
        if len(inputs) <= 1:
            return next(iter(inputs), TRUE)
        return self._gate(tuple(sorted(inputs)), "and")

    def any(self, literals: Iterable[int]) -> int:
        """True if one of these is."""
        return -self.all([-each for each in literals])

    def at_least(self, need: int, literals: Sequence[int]) -> int:
        """True if so many of these are; one that stands there twice counts twice."""
        sure = literals.count(TRUE)
        literals, need = [each for each in literals if abs(each) != TRUE], need - sure
        if need <= 0:
            return TRUE
        if need > len(literals):
            return FALSE
        if need == 1:
            return self.any(literals)
        if need == len(literals):
            return self.all(literals)
        return self._gate((need, *sorted(literals)), f"(_ at-least {need})", counts=True)

    def _gate(self, key: tuple[int, ...], operator: str, *, counts: bool = False) -> int:
        identity = (0, *key) if counts else key  # no literal is 0
        number = self._gates.get(identity)
        if number is None:
            number = self._gates[identity] = self.fresh()
            inputs = " ".join([self._names[each] for each in (key[1:] if counts else key)])
            self._lines.append(f"(assert (= {self._names[number]} ({operator} {inputs})))")
        return number

    def require(self, *literals: int) -> None:
        """Assert that one of these is true."""
        if TRUE not in literals:
            inputs = " ".join([self._names[each] for each in literals if each != FALSE])
            self._lines.append(f"(assert (or false {inputs}))")

    def names(self, literals: Iterable[int]) -> list[str]:
        """The literals as they stand in the text."""
        return [self._names[each] for each in literals]

    def text(self) -> str:
        """Declarations and assertions in SMT-LIB."""
        return "\n".join(self._lines)
