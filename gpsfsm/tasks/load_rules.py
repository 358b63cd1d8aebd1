"""Reading the rules of a task file."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

from gpsfsm.capabilities.defects import quoted
from gpsfsm.capabilities.reading import Items, Scalar, Table, kind_of
from gpsfsm.tasks.declare import AFTER, BINARY, COUNTED, UNARY, formula_text
from gpsfsm.tasks.ltlf import atoms_of
from gpsfsm.tasks.task import Rule
from gpsfsm.tasks.written import Mistake, parse_formula

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.capabilities.defects import Notes, Place
    from gpsfsm.capabilities.reading import Node
    from gpsfsm.tasks.declare import After
    from gpsfsm.tasks.task import Pattern

__all__ = ["rule_of"]

_TEMPLATES = (*COUNTED, *UNARY, *BINARY)
_MAX_TIMES = 20
_KEYS = ("name", "after", "times", "runs")

_Named = "Callable[[str, Place], Pattern]"


def rule_of(table: Table, notes: Notes, named: Callable[[str, Place], Pattern]) -> Rule | None:
    """The rule that an entry of ``rules`` stands for; None, with errors noted, if for none.

    ``named`` gives the pattern of a name and notes names that mean nothing.
    """
    before = len(notes.defects)
    kinds = [key for key in table if key == "ltlf" or key in _TEMPLATES]
    for key in table:
        if key not in (*_KEYS, "ltlf", *_TEMPLATES):
            hint = (
                notes.near(key, (*_KEYS, "ltlf", *_TEMPLATES))
                or "'gpsfsm' knows the templates of Declare"
            )
            notes.error(table.places[key], f"there is no rule {quoted(key)}", hint)
    if len(kinds) != 1:
        if len(notes.defects) == before:
            hint = "write one such as 'precedence: [A, B]' or 'ltlf: …'"
            notes.error(table.place, "an entry of 'rules' must hold exactly one rule", hint)
        return None
    kind = kinds[0]
    entry = _Entry(table, notes)
    completed = entry.choice("runs", ("all", "completed")) == "completed"
    name = entry.text("name")
    if kind == "ltlf":
        entry.unused("after", "times", kind=kind)
        text = entry.text("ltlf")
        told = text
        place = table["ltlf"].place
    else:
        text, told = _declare(kind, entry, named)
        place = table.places[kind]
    if len(notes.defects) > before:
        return None
    if completed:
        text = f"F completes -> ({text})"
    try:
        formula = parse_formula(text)
    except Mistake as mistake:
        at = f", at character {mistake.position + 1}" if kind == "ltlf" and not completed else ""
        notes.error(place, f"the formula does not parse{at}: {mistake.message}", mistake.hint)
        return None
    if kind == "ltlf":
        for atom in sorted(atoms_of(formula), key=lambda one: (one.name, one.happening)):
            if atom.name not in ("", "*"):
                named(atom.name, place)
    return Rule(name or told, told, formula, completed, place[0])


def _declare(kind: str, entry: _Entry, named: Callable[[str, Place], Pattern]) -> tuple[str, str]:
    """The formula of a template, and the rule as it reads."""
    after = cast("After", entry.choice("after", AFTER))
    times = entry.times() if kind in COUNTED else 1
    if kind not in COUNTED:
        entry.unused("times", kind=kind)
    names = entry.names(kind, 2 if kind in BINARY else 1)
    for name, place in names:
        named(name, place)
    words = [quoted(name) for name, _ in names]
    told = f"{kind.replace('_', ' ')} of {' and '.join(words)}"
    if times != 1:
        told += f", {times} times"
    if after != "start":
        told += f", after {after}"
    if not names:
        return "true", told
    return formula_text(kind, tuple(name for name, _ in names), after=after, times=times), told


class _Entry:
    """One entry; its methods note what is wrong and return something of the right kind."""

    def __init__(self, table: Table, notes: Notes) -> None:
        self._table, self._notes = table, notes

    def text(self, key: str) -> str:
        """A text; "" if there is none."""
        node = self._table.get(key)
        if node is None:
            return ""
        if isinstance(node, Scalar) and node.value is not None:
            return node.text
        self._wrong(key, "a text", node)
        return ""

    def choice(self, key: str, known: tuple[str, ...]) -> str:
        """One of a few words; the first is the default."""
        found = self.text(key)
        if found and found not in known:
            message = f"'{key}' must be {' or '.join(known)}, not {quoted(found)}"
            self._notes.error(self._table.places[key], message)
        return found if found in known else known[0]

    def times(self) -> int:
        """A small number."""
        node = self._table.get("times")
        if node is None:
            return 1
        value = node.value if isinstance(node, Scalar) else None
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= _MAX_TIMES:
            return value
        self._wrong("times", f"a whole number from 1 to {_MAX_TIMES}", node)
        return 1

    def names(self, key: str, number: int) -> list[tuple[str, Place]]:
        """So many names of actions."""
        node = self._table[key]
        items = node if isinstance(node, Items) else [node]
        texts = [one for one in items if isinstance(one, Scalar) and one.value is not None]
        if len(texts) != len(items) or len(items) != number:
            what = "the name of an action" if number == 1 else "the names of two actions: [A, B]"
            self._wrong(key, what, node)
            return []
        found = [(one.text, one.place) for one in texts]
        for name, place in found:
            if '"' in name:
                self._notes.error(
                    place, f"a name in a rule holds no quotation marks: {quoted(name)}"
                )
        return found

    def unused(self, *keys: str, kind: str) -> None:
        """Keys that say nothing about this kind of rule."""
        for key in keys:
            if key in self._table:
                self._notes.error(self._table.places[key], f"'{key}' says nothing with '{kind}'")

    def _wrong(self, key: str, expected: str, node: Node) -> None:
        message = f"'{key}' must be {expected}, not {kind_of(node)}"
        self._notes.error(self._table.places[key], message)
