"""From plan texts to plans of the oracle, and from option words to its options.

Shares no code with the front end, so that the oracle's facts of a corpus plan judge the whole way
from the text to the verdict.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, get_args
from xml.etree import ElementTree as ET  # our own files, so no defence is needed

from tests import oracle
from tests.corpus.described import AMOUNTS, described, parameter_name
from tests.oracle.capabilities import World
from tests.oracle.clocks import Range, energy, makespan
from tests.oracle.goals import missed_goals
from tests.oracle.model import Type, place
from tests.oracle.orders import loaded

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from tests.oracle.model import Node

__all__ = ["Instance", "OracleOptions", "instances", "oracle_facts", "oracle_plan"]

MAX_RUNNERS = 14
"""The oracle plays all 2^n scenarios; beyond this it takes longer than a test should."""

_LABELS = ("name", "id")
_ENDINGS = ("/FabricCompletionRunner", "/CompletionRunner")


@dataclass(frozen=True, slots=True)
class Instance:
    """A runner instance as an assumption sees it."""

    path: str
    line: int
    interface: str
    parameters: Mapping[str, str]


def oracle_plan(text: str) -> oracle.P:
    """The plan of a text that is free of errors; raises ET.ParseError or ValueError otherwise."""
    root = ET.fromstring(text)  # noqa: S314  (our own text)
    if root.tag != "Plan":
        raise ValueError(f"the root is {root.tag}")
    return oracle.P(tuple(_node(child) for child in root))


def _node(element: ET.Element) -> Node:
    if element.tag == "Control":
        response = element.get("type", "")
        for each in get_args(Type):
            if response == each:
                return oracle.C(each, tuple(_node(child) for child in element))
        raise ValueError(f"a control of type '{response}'")
    if element.tag != "Runner" or len(element):
        raise ValueError(f"a <{element.tag}> with {len(element)} children")
    interface = element.get("interface", "")
    if not interface:
        raise ValueError("a <Runner> without interface")
    if interface.endswith(_ENDINGS):
        interface = oracle.COMPLETION  # the oracle knows one spelling
    provider = element.get("provider", "")
    attributes = [
        (k, v) for k, v in element.items() if k not in ("interface", "provider", *_LABELS)
    ]
    words = [_word(parameter_name(interface, provider, name), value) for name, value in attributes]
    return oracle.R(
        " ".join([interface, *words]),
        label=element.get("name", ""),
        ident=element.get("id", ""),
        provider=provider,
    )


def _word(name: str, value: str) -> str:
    """An attribute as the oracle writes it: with a character of our own for blanks."""
    if name in AMOUNTS and value.startswith("-"):
        value = f"negative {value}"  # no time: to the oracle a text, so the time is not known
    return f"{name}={value.replace(' ', '␣')}"


def instances(text: str) -> tuple[Instance, ...]:
    """The runner instances of a text that has each ``<Runner`` at the start of a line."""
    root = ET.fromstring(text)  # noqa: S314  (our own text)
    whole = oracle_plan(text)
    paths = oracle.runner_paths(whole)
    bare = re.sub(r"<!--.*?-->", lambda actual: "\n" * actual[0].count("\n"), text, flags=re.DOTALL)
    lines = [n for n, line in enumerate(bare.splitlines(), 1) if line.lstrip().startswith("<Runn")]
    elements = list(root.iter("Runner"))
    if len(lines) != len(elements):
        raise ValueError("a <Runner that is not at the start of a line")
    return tuple(
        Instance(path, line, element.attrib["interface"], dict(element.items()))
        for path, line, element in zip(paths, lines, elements, strict=False)  # one may be dropped
    )


@dataclass(slots=True)
class OracleOptions:
    """What the oracle must know of a command line."""

    faults: frozenset[str] = frozenset()
    consistent: bool = False
    assumptions: list[str] = field(default_factory=list)

    @classmethod
    def of(cls, words: Sequence[str]) -> OracleOptions:
        """From command line words; those that do not concern the oracle are passed over."""
        facts = cls()
        pending = list(words)
        while pending:
            word = pending.pop(0)
            if word == "--assume":
                facts.assumptions.append(pending.pop(0))
            elif word == "--faults":
                facts.faults = frozenset(pending.pop(0).split(","))
            elif word == "--consistent":
                facts.consistent = True
        return facts


def oracle_facts(text: str, options: OracleOptions) -> dict[str, Any] | None:
    """The facts by brute force; None if the assumptions admit no scenario."""
    whole = oracle_plan(text)
    placed = instances(text)
    parts = [_constraint(words, placed) for words in options.assumptions]
    runners = [at.node for at in place(whole).walk() if isinstance(at.node, oracle.R)]
    entries = [described(runner.interface, runner.provider) for runner in runners]
    world = World(
        whole,
        [one for one in entries if one is not None],
        faults=options.faults,
        consistent=options.consistent,
        constraint=lambda scenario: all(part(scenario) for part in parts),
    )
    answer = oracle.facts(
        whole, faults=world.faults, consistent=options.consistent, constraint=world.allows
    )
    load = loaded(world)
    if answer is None or load is None:
        return None
    achieving = {one.path for one in world.instances if one.described and one.described.achieves}
    missed = {goal for run in world.runs for goal in missed_goals(whole, achieving, run)}
    elements = [at.path for at in place(whole).walk()]
    swallowed = [path for path in elements if path in missed]
    return {
        **answer,
        **({"swallowed": swallowed} if swallowed else {}),
        "makespan": _interval(makespan(world)),
        "energy": _interval(energy(world)),
        "loaded": {"peak": load[0], "all": load[1]},
    }


def _interval(actual: Range | None) -> dict[str, float | None] | None:
    return None if actual is None else {"min": actual[0], "max": actual[1]}


_EVERY = re.compile(r"(never|always) (fails|succeeds|hangs): (.+)")
_IMPLIES = re.compile(r"line (\d+) (fails|succeeds) (implies|and) line (\d+) (fails|succeeds)")
_SELECTOR = re.compile(r"(\w+)(?:\((\w+)=([^)]*)\))?|line (\d+)")
_MEANING = {"fails": ("FAILED", "NO_START"), "succeeds": ("SUCCEEDED",), "hangs": ("HANG",)}


def _constraint(words: str, placed: Sequence[Instance]) -> Callable[[Mapping[str, str]], bool]:
    """The two forms of assumption that the corpus uses, read a second time."""
    if every := _EVERY.fullmatch(words):
        how, verb, selector = every.groups()
        chosen = [instance.path for instance in placed if _selects(selector, instance)]
        return lambda scenario: all(
            (scenario[path] in _MEANING[verb]) == (how == "always") for path in chosen
        )
    if two := _IMPLIES.fullmatch(words):
        first, verb, link, second, other = two.groups()
        at = {instance.line: instance.path for instance in placed}

        def holds(scenario: Mapping[str, str]) -> bool:
            left = scenario[at[int(first)]] in _MEANING[verb]
            right = scenario[at[int(second)]] in _MEANING[other]
            return (not left or right) if link == "implies" else (left and right)

        return holds
    raise ValueError(f"the corpus test does not know how to read '{words}'")


def _selects(selector: str, instance: Instance) -> bool:
    """Whether ``SpeechRunner``, ``WaypointRunner(x=9.0)`` or ``line 7`` is this instance."""
    match = _SELECTOR.fullmatch(selector)
    if not match:
        raise ValueError(f"the corpus test does not know how to read '{selector}'")
    interface, parameter, value, line = match.groups()
    if line:
        return int(line) == instance.line
    if instance.interface.rsplit("/", 1)[-1] != interface:
        return False
    return parameter is None or instance.parameters.get(parameter) == value
