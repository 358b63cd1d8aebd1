"""Random machines of FlexBE and SMACH: as Python, and as an interpreter of their own plays them.

The interpreter knows nothing of gpsfsm: it follows the dictionaries of transitions, conditions and
outcome maps, as the two libraries do.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from random import Random

GOOD = ("succeeded", "done", "ok", "left", "right")
BAD = ("failed", "aborted", "timeout")


@dataclass
class Part:
    """A state, or a container: ``seq``, ``smach`` (waits for all) or ``flexbe`` (ends early)."""

    name: str
    kind: str
    outcomes: list[str]
    transitions: dict[str, str] = field(default_factory=dict)
    parts: list[Part] = field(default_factory=list)
    rules: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    default: str = ""

    def part(self, name: str) -> Part:
        return next(each for each in self.parts if each.name == name)


def random_part(random: Random, name: str, tool: str, depth: int) -> Part:
    """A container with two or three parts; down to a depth, some of them are containers."""
    outcomes = [random.choice(GOOD), random.choice(BAD)]
    kind = "seq" if depth == 2 or random.random() < 0.5 else tool
    made = Part(name, kind, outcomes)
    for number in range(random.choice((2, 2, 3)) if kind == "seq" else 2):
        inner = f"{name}{'ABC'[number]}"
        if depth and random.random() < 0.4:
            made.parts.append(random_part(random, inner, tool, depth - 1))
        else:
            names = random.sample(GOOD, random.choice((1, 1, 2))) + random.sample(
                BAD, random.choice((0, 1, 1, 2))
            )
            made.parts.append(Part(inner, "leaf", names))
    for each in made.parts:
        targets = [other.name for other in made.parts] + outcomes if kind == "seq" else outcomes
        each.transitions = {outcome: random.choice(targets) for outcome in each.outcomes}
    if kind != "seq":
        made.default = outcomes[-1]
        one = random.choice(made.parts)
        ends = random.sample(one.outcomes, len(one.outcomes))
        for result in outcomes if tool == "smach" else [*outcomes, outcomes[0]]:
            chosen = random.sample(made.parts, random.choice((1, 2)))
            rule = {each.name: random.choice(each.outcomes) for each in chosen}
            if tool == "smach" and ends:  # versions differ where two rules can hold
                rule[one.name] = ends.pop()
            elif tool == "smach":
                continue
            made.rules.append((result, rule))
    return made


# -- as Python -----------------------------------------------------------------------------------


def source(top: Part, tool: str) -> str:
    """The Python that builds a machine."""
    base = "smach.State" if tool == "smach" else "EventState"
    lines = ["import smach" if tool == "smach" else "from flexbe_core import *"]
    lines.append(f"class Act({base}):\n    def __init__(self, outcomes):")
    lines.append(f"        {base}.__init__(self, outcomes=outcomes)")
    _build(top, tool, lines)
    lines.append(f"{top.name}.execute()")
    return "\n".join(lines) + "\n"


def _build(made: Part, tool: str, lines: list[str]) -> None:
    for each in made.parts:
        if each.kind != "leaf":
            _build(each, tool, lines)
    sequential = "smach.StateMachine" if tool == "smach" else "OperatableStateMachine"
    if made.kind == "seq":
        lines.append(f"{made.name} = {sequential}(outcomes={made.outcomes})")
    elif made.kind == "smach":
        lines.append(
            f"{made.name} = smach.Concurrence(outcomes={made.outcomes}, "
            f"default_outcome={made.default!r}, outcome_map={dict(made.rules)})"
        )
    else:
        conditions = [(outcome, list(rule.items())) for outcome, rule in made.rules]
        lines.append(
            f"{made.name} = ConcurrencyContainer(outcomes={made.outcomes}, conditions={conditions})"
        )
    adder = "smach.Concurrence" if made.kind == "smach" else sequential
    lines.append(f"with {made.name}:")
    for each in made.parts:
        state = each.name if each.kind != "leaf" else f"Act(outcomes={each.outcomes})"
        rest = "" if made.kind == "smach" else f", transitions={each.transitions}"
        lines.append(f"    {adder}.add({each.name!r}, {state}{rest})")


# -- played --------------------------------------------------------------------------------------

Config = Any
"""Of a leaf (), of a sequence (part, its own), of a concurrence one for each part or an outcome."""


def enter(made: Part) -> Config:
    if made.kind == "leaf":
        return ()
    if made.kind == "seq":
        return (made.parts[0].name, enter(made.parts[0]))
    return tuple(enter(each) for each in made.parts)


def active(made: Part, config: Config) -> list[Part]:
    """The leaves that act."""
    if made.kind == "leaf":
        return [made]
    if made.kind == "seq":
        return active(made.part(config[0]), config[1])
    return [
        leaf
        for each, own in zip(made.parts, config, strict=True)
        if not isinstance(own, str)
        for leaf in active(each, own)
    ]


def play(made: Part, config: Config, leaf: str, outcome: str) -> Config:
    """The configuration after a leaf has ended; a text is the outcome of the whole."""
    if made.kind == "leaf":
        return outcome
    if made.kind == "seq":
        here = made.part(config[0])
        inner = play(here, config[1], leaf, outcome)
        if not isinstance(inner, str):
            return (here.name, inner)
        target = here.transitions[inner]
        return target if target in made.outcomes else (target, enter(made.part(target)))
    rows = tuple(
        play(each, own, leaf, outcome)
        if not isinstance(own, str) and leaf in {every.name for every in active(each, own)}
        else own
        for each, own in zip(made.parts, config, strict=True)
    )
    ended = {each.name: row for each, row in zip(made.parts, rows, strict=True)}
    holding = [
        result
        for result, rule in made.rules
        if all(ended[name] == wanted for name, wanted in rule.items())
    ]
    if made.kind == "flexbe":
        return holding[0] if holding else rows
    if not all(isinstance(row, str) for row in rows):
        return rows
    last = [result for result in dict(made.rules) if result in set(holding)]
    # rules of one outcome are one key of the dictionary: the later one replaces the earlier one
    final = [
        each
        for each in last
        if all(ended[name] == wanted for name, wanted in dict(made.rules)[each].items())
    ]
    return final[-1] if final else made.default
