"""Foreign elements, attributes and keys, inserted at a random place of a valid machine or graph.

The file is refused, or more is said of it than before: nothing here needs no word.
"""

from __future__ import annotations

import json
import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.compile.machine_files import automaton_to_graphml
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.compile.units import MachinePlan

if TYPE_CHECKING:
    from random import Random

ROOT = Path(__file__).parents[3]
CASES = Path(__file__).parent / "cases"
_TAG = re.compile(r"<([\w:]+)((?:[^<>\"']|\"[^\"]*\"|'[^']*')*?)(/?)>")
_NAMES = (
    "paramters",
    "Parallel",
    "defer",
    "default_outcom",
    "priority",
    "Timeout",
    "state_",
    "n",
    "transitions",
    "onexit",
    "Region2",
    "labels",
    "weights",
    "if",
)


@cache
def machines() -> tuple[str, ...]:
    """Machines of YASMIN, graphs of LangGraph, and a machine as JSON and as GraphML."""
    door = (ROOT / "docs" / "examples" / "door.json").read_text()
    plan = read_plan_or_machine(door, file="x").plan
    assert plan is not None
    files = [
        ROOT / "corpus" / "machines" / "delivery.yasmin.xml",
        *(CASES / f"yasmin_{name}.xml" for name in ("orthogonal", "implicit_outcome")),
        *sorted(CASES.glob("langgraph_*.json")),
    ]
    return (*(file.read_text() for file in files), door, automaton_to_graphml(plan.automaton))


def changed(chance: Random) -> tuple[str, str]:
    """A machine, and the same with something that its format does not have."""
    text = chance.choice(machines())
    return text, inserted(text, chance)


@cache
def _said(text: str) -> int:
    plan = read_plan_or_machine(text, file="x").plan
    assert isinstance(plan, MachinePlan)
    return len(plan.approximations)


def judged(before: str, after: str) -> str:
    """What became of it: ``refused`` or ``told``."""
    parsed = read_plan_or_machine(after, file="x")
    assert (parsed.plan is None) == bool(parsed.problems)
    if parsed.plan is None:
        return "refused"
    assert isinstance(parsed.plan, MachinePlan)
    assert len(parsed.plan.approximations) > _said(before), after
    return "told"


def inserted(text: str, chance: Random) -> str:
    """A text with an element, attribute or key that its format does not have."""
    if text.lstrip()[:1] == "{":
        return _with_key(text, chance)
    return _with_element(text, chance)


def _with_key(text: str, chance: Random) -> str:
    whole = json.loads(text)
    places: list[dict[str, Any]] = [whole, *whole["nodes"], *whole["edges"]]
    places += (node["data"] for node in whole["nodes"] if isinstance(node.get("data"), dict))
    row = chance.choice(places)
    key = chance.choice([name for name in _NAMES if name not in row])
    rows = list(row.items())
    value = chance.choice((True, 0, "x", [], {"a": 1}, None, 1.5))
    rows.insert(chance.randrange(len(rows) + 1), (key, value))
    row.clear()
    row.update(rows)
    return json.dumps(whole, indent=chance.choice((None, 1, 2)))


def _with_element(text: str, chance: Random) -> str:
    tags = [tag for tag in _TAG.finditer(text) if not tag[1].startswith("?")]
    tag = chance.choice(tags)
    name = chance.choice(_NAMES)
    prefix, declared = chance.choice((("", ""), ("", ""), ("z:", ' xmlns:z="urn:other"')))
    if chance.random() < 0.5 and name not in tag[2].replace("=", " ").split():
        attribute = f'{declared} {prefix}{name}="{chance.choice(("1", "x", "true"))}"'
        at = tag.end(2)
        return f"{text[:at].rstrip()}{attribute}{text[at:]}"
    inside = chance.choice(("", "<State/>", '<Transition from="a" to="b"/>', "text", "<data/>"))
    element = f"<{prefix}{name}{declared}>{inside}</{prefix}{name}>"
    if tag[3]:
        return f"{text[: tag.start(3)]}>{element}</{tag[1]}>{text[tag.end() :]}"
    return text[: tag.end()] + element + text[tag.end() :]
