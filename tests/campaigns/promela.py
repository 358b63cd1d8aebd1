"""Promela models of plans, written from the tree of elements and docs/semantics.md alone.

There is no automaton in them: every unit has three bits, whether its trigger, its success and its
failure have come, and the rules of section 3.3 say in one pass over the tree which bits follow from
which. A runner instance is a process that waits for its trigger and then chooses an outcome. What
follows from an outcome comes with it in one step, since only runners take time (section 4.4). When
nothing is left to happen, a last process asks all questions, each as an assertion that is violated
in a run that is an example.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tests.oracle.model import C, P, Placed, R, place

if TYPE_CHECKING:
    from collections.abc import Iterator

__all__ = ["Model", "model_of"]

_NEVER = "false"


@dataclass(frozen=True, slots=True)
class Model:
    """The text, and what each numbered assertion asks: kind of question and element path."""

    text: str
    questions: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class _Unit:
    """The names of what has come: a trigger's success and failure are expressions in Promela."""

    success: str
    failure: str


@dataclass(slots=True)
class _Writer:
    """Writes the rules, in an order in which one pass finds all that follows."""

    bits: list[str] = field(default_factory=list)
    rules: list[str] = field(default_factory=list)
    runners: list[tuple[str, str, str]] = field(default_factory=list)  # path, name, trigger
    blocks: list[tuple[str, str, str]] = field(default_factory=list)  # path, trigger, success

    def bit(self, kind: str, condition: str) -> str:
        """A bit that is set once the condition holds; all conditions, once true, stay so."""
        name = f"{kind}{len(self.bits)}"
        self.bits.append(name)
        self.rules.append(f"{name} = {condition}")
        return name

    def runner(self, placed: Placed, trigger: str) -> _Unit:
        name = f"r{len(self.runners)}"
        triggered = self.bit("t", trigger)
        self.runners.append((placed.path, name, triggered))
        return _Unit(f"{name}_ok", f"{name}_ko")

    def unit(self, placed: Placed, guards: list[Placed], trigger: str) -> _Unit:
        outcomes = self.element(placed, trigger)
        for guard in guards:
            outcomes = self.guard(outcomes, guard)
        return outcomes

    def guard(self, guarded: _Unit, recovery: Placed) -> _Unit:
        """``guard(u; d1 … dm)``: each d is triggered by the failure of the one before it."""
        failure, successes = guarded.failure, [guarded.success]
        for child, guards in _grouped(self, recovery.children):
            outcomes = self.unit(child, guards, failure)
            successes.append(outcomes.success)
            failure = outcomes.failure
        return _Unit(self.bit("g", " || ".join(successes)), failure)

    def element(self, placed: Placed, trigger: str) -> _Unit:
        node = placed.node
        if isinstance(node, R):
            return self.runner(placed, trigger)
        units = _grouped(self, placed.children)
        if not units:
            return _Unit(trigger, _NEVER)
        assert isinstance(node, C)
        if node.type == "sequential":
            return self.sequential(units, trigger)
        outcomeses = [self.unit(child, guards, trigger) for child, guards in units]
        all_of, one_of = " && ", " || "
        if node.type == "parallel_any":
            all_of, one_of = one_of, all_of
        success = self.bit("s", all_of.join(each.success for each in outcomeses))
        failure = self.bit("f", one_of.join(each.failure for each in outcomeses))
        if node.type == "parallel_all" and len(outcomeses) > 1:
            self.blocks.append((placed.path, trigger, success))
        return _Unit(success, failure)

    def sequential(self, units: list[tuple[Placed, list[Placed]]], trigger: str) -> _Unit:
        failures = []
        for child, guards in units:
            outcomes = self.unit(child, guards, trigger)
            failures.append(outcomes.failure)
            trigger = outcomes.success
        return _Unit(trigger, self.bit("f", " || ".join(failures) or _NEVER))


def _grouped(writer: _Writer, children: tuple[Placed, ...]) -> list[tuple[Placed, list[Placed]]]:
    """Section 3.1: units with their guards. What is in a dead recovery is never triggered."""
    units: list[tuple[Placed, list[Placed]]] = []
    for child in children:
        recovery = isinstance(child.node, C) and child.node.type == "recovery"
        if not recovery:
            units.append((child, []))
        elif units:
            units[-1][1].append(child)
        else:
            writer.guard(_Unit(_NEVER, _NEVER), child)
    return units


def model_of(whole: P, *, hang: bool = False) -> Model:
    """The model of a plan in which instances succeed or fail, or hang as well."""
    writer = _Writer()
    units = _grouped(writer, place(whole).children)
    end = writer.sequential(units, "begun")
    questions, asserted = _questions(writer, end)
    names = [name for _, name, _ in writer.runners]
    outcomes = [f"{name}_{how}" for name in names for how in ("ok", "ko")]
    late = [f"late_{name}" for name in names]
    lines = [f"bool {name};" for name in ("begun", "ended", *writer.bits, *outcomes, *late)]
    lines += ["inline follow() {", *(f"  {rule};" for rule in writer.rules)]
    lines += ["  if", f"  :: ({end.success}) && !ended -> ended = true"]
    for _, name, trigger in writer.runners:
        lines.append(f"    ; late_{name} = {trigger} && !{name}_ok && !{name}_ko")
    lines += ["  :: else", "  fi", "}"]
    lines += ["active proctype plan() { d_step { begun = true; follow() } }"]
    for _, name, trigger in writer.runners:
        lines += _process(name, trigger, hang=hang)
    lines += ["active proctype ask() {", "  timeout;", "  if", *asserted, "  fi", "}", ""]
    return Model("\n".join(lines), questions)


def _process(name: str, trigger: str, *, hang: bool) -> Iterator[str]:
    yield f"active proctype p_{name}() {{"
    yield f"  {trigger};"
    yield "  if"
    yield f"  :: d_step {{ {name}_ok = true; follow() }}"
    yield f"  :: d_step {{ {name}_ko = true; follow() }}"
    if hang:
        yield "  :: skip"
    yield "  fi"
    yield "}"


def _questions(writer: _Writer, end: _Unit) -> tuple[tuple[tuple[str, str], ...], list[str]]:
    completed, gave_up = f"({end.success})", f"({end.failure})"
    queries = [
        ("completes", "", completed),
        ("gives_up", "", gave_up),
        ("stuck", "", f"!{completed} && !{gave_up}"),
        ("both", "", f"{completed} && {gave_up}"),
        ("not completes", "", f"!{completed}"),
        ("not gives_up", "", f"!{gave_up}"),
        ("not stuck", "", f"{completed} || {gave_up}"),
    ]
    for path, name, trigger in writer.runners:
        queries += [("reached", path, trigger), ("orphan", path, f"late_{name}")]
    for path, trigger, success in writer.blocks:
        queries.append(("waits", path, f"({trigger}) && !{success}"))
    # The number makes each assertion known in what the verifier prints.
    asserted = [
        f"  :: assert(!(({what}) && {1000 + number} == {1000 + number}))"
        for number, (_, _, what) in enumerate(queries)
    ]
    return tuple((kind, path) for kind, path, _ in queries), asserted
