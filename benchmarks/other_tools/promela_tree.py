"""Promela models of behaviour trees, with or without failures, with or without Parallel.

Without both it is a translation of the kind that mission planners with SPIN have used: one process
does the actions in their order, each succeeds, a condition holds or does not, and a Parallel is
left out together with what is in it. It is written from that description, and is nobody's tool.

With both it says what BehaviorTree.CPP does: any action may fail, the children of a Parallel are
processes of their own, and those that still run when the Parallel ends are halted.

``ev`` is the last event; formulas speak of it. Sequence(a, Fallback(c, b)), with failures::

    ev = s_a; if :: ok = true; ev = y_a :: ok = false; ev = n_a fi;
    if :: !ok -> goto e0 :: else -> skip fi;              the Sequence fails
    ev = s_c; ...; if :: ok -> goto e1 :: else -> skip fi; the Fallback succeeds
    ev = s_b; ...; e1: skip; e0: skip; ev = over
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from xml.etree.ElementTree import Element

_ATOM = re.compile(r"(start|succeeds|fails)\((\w+)\)")
_EVENTS = {"start": "s", "succeeds": "y", "fails": "n"}
_OPERATORS = {"F": "<>", "G": "[]", "&": "&&", "|": "||"}
_UNSUPPORTED = re.compile(r"\b(?:X|WX|R|M|completes|gives_up|stuck)\b|\*")


def ltl_of(formula: str) -> str:
    """A formula of a task file as SPIN writes it.

    A run of the model goes on for ever in its last state, in which no atom is true, and begins in
    such a state. So X has no counterpart.
    """
    if _UNSUPPORTED.search(formula):
        raise ValueError(f"not in formulas without X over actions: {formula}")
    atoms = _ATOM.sub(lambda atom: f"(ev == {_EVENTS[atom[1]]}_{atom[2]})", formula)
    return re.sub(r"\b[FG]\b|&|\|(?!\|)", lambda word: _OPERATORS[word[0]], atoms)


@dataclass(slots=True)
class _Writer:
    failures: bool
    parallel: bool
    leaves: list[str] = field(default_factory=list)
    declared: list[str] = field(default_factory=list)
    processes: list[str] = field(default_factory=list)
    labels: int = 0

    def number(self) -> int:
        self.labels += 1
        return self.labels - 1

    def node(self, node: Element, halted: str) -> Iterator[str]:
        """The lines of a node, which leave in ``ok`` how it ends."""
        if node.tag == "Sequence":
            yield from self.ordered(node, "!ok", halted)
        elif node.tag == "Fallback":
            yield from self.ordered(node, "ok", halted)
        elif node.tag == "Parallel":
            yield from self.beside(node, halted) if self.parallel else ("ok = true;",)
        elif len(node):
            raise ValueError(f"not translated: {node.tag}")
        else:
            yield from self.leaf(node, halted)

    def ordered(self, node: Element, ends: str, halted: str) -> Iterator[str]:
        label = f"e{self.number()}"
        for child in node:
            yield from self.node(child, halted)
            yield f"if :: {ends} -> goto {label} :: else -> skip fi;"
        yield f"{label}: skip;"

    def leaf(self, node: Element, halted: str) -> Iterator[str]:
        name = node.get("name") or f"condition_{self.number()}"
        if name in self.leaves:
            raise ValueError(f"two leaves are called {name}")
        self.leaves.append(name)
        # SPIN would make one selection of this one and those in its options: "true" parts them.
        first = "true -> " if halted else ""
        yield self.event("", f"s_{name}", halted)
        yield "if"
        yield f":: {first}{self.event('ok = true; ', f'y_{name}', halted)}"
        if self.failures or "action_name" not in node.attrib:
            yield f":: {first}{self.event('ok = false; ', f'n_{name}', halted)}"
        yield "fi;"

    @staticmethod
    def event(before: str, event: str, halted: str) -> str:
        """An event, unless a Parallel around has ended: then this process ends too."""
        if not halted:
            return f"atomic {{ {before}ev = {event} }};"
        return f"atomic {{ if :: {halted} -> goto stop :: else -> {before}ev = {event} fi }};"

    def beside(self, node: Element, halted: str) -> Iterator[str]:
        """The children, each a process; the first threshold that is reached decides."""
        at = self.number()
        need = int(node.get("success_count", "-1"))
        bear = int(node.get("failure_count", "1"))
        if need == -1:
            need = len(node)
        if not 0 < need <= len(node) or not 0 < bear <= len(node):
            raise ValueError("not translated: a Parallel with such thresholds")
        if need + bear > len(node) + 1:
            raise ValueError("not translated: a Parallel that can end without reaching either")
        self.declared += [f"byte yes{at}, no{at};", f"bool over{at};"]
        mine = f"over{at}" + (f" || {halted}" if halted else "")
        for child in node:
            name = f"p{self.number()}"
            lines = list(self.node(child, mine))
            self.processes += [
                f"proctype {name}() {{ bool ok;",
                *lines,
                f"atomic {{ if :: {mine} -> goto stop",
                f":: else -> yes{at} = yes{at} + ok; no{at} = no{at} + !ok;",
                f"over{at} = (yes{at} >= {need} || no{at} >= {bear}) fi }};",
                "stop: skip }",
            ]
            yield f"run {name}();"
        if halted:
            yield f"atomic {{ over{at} || {halted};"
            yield f"if :: {halted} -> goto stop :: else -> skip fi }};"
        else:
            yield f"over{at};"
        yield f"ok = (yes{at} >= {need});"


def model_of(root: Element, demands: Mapping[str, str], *, failures: bool, parallel: bool) -> str:
    """The model of the first node below ``root``, with each demand as a formula of its name."""
    writer = _Writer(failures=failures, parallel=parallel)
    lines = list(writer.node(root[0], ""))
    names = {word for text in demands.values() for _, word in _ATOM.findall(text)}
    # An action that is left out has no event: a formula may speak of it all the same.
    actions = [*writer.leaves, *sorted(names - set(writer.leaves))]
    numbers = (f"{kind}_{name}" for name in actions for kind in _EVENTS.values())
    return "\n".join(
        [
            *(f"#define {name} {number}" for number, name in enumerate(numbers, 2)),
            "#define over 1",
            "short ev;",
            *writer.declared,
            *writer.processes,
            "init { bool ok;",
            *lines,
            "ev = over }",
            *(f"ltl {name} {{ {ltl_of(text)} }}" for name, text in demands.items()),
            "",
        ]
    )
