"""The questions whose answers are known, and the models that ask them.

``python -m benchmarks.other_tools.cases CASE N FORMAT STYLE FILE`` writes a model. That is a
process of its own, so that the process that measures the tools stays small.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

import gpsfsm
from benchmarks.other_tools.petri import net_of
from benchmarks.other_tools.promela import promela_of
from benchmarks.other_tools.questions import (
    CanMiss,
    Question,
    Style,
    completes,
    cone_of,
    gives_up,
    join_waits,
)
from benchmarks.other_tools.smv import smv_of
from corpus import generate
from gpsfsm.syntax import Limits

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.model.automaton import Automaton

Format: TypeAlias = Literal["promela", "smv", "petri"]
ASSUMPTION = "never fails: SpeechRunner"


@dataclass(frozen=True, slots=True)
class Case:
    """A question about a family of plans. ``possible`` is the right answer to "can it be?".

    ``reliable``: recoveries never fail. ``in_facts`` reads the answer from the facts of gpsfsm.
    ``unsound`` is the right answer to "is the workflow net unsound?", None if that is beside the
    question.
    """

    key: str
    title: str
    plan: Callable[[int], str]
    question: Callable[[Automaton], Question]
    reliable: bool
    possible: bool
    in_facts: Callable[[dict[str, Any]], bool]
    unsound: bool | None = None


def _waits(facts: dict[str, Any]) -> bool:
    return bool(facts["join_deadlocks"])


CASES = (
    Case(
        "safe",
        "fan-out, every unit has a recovery that cannot fail: can the join wait for ever? No.",
        lambda n: generate.fanout(n, "safe"),
        join_waits,
        reliable=True,
        possible=False,
        in_facts=_waits,
        unsound=False,
    ),
    Case(
        "needle",
        "fan-out, every unit but one has such a recovery: can the join wait for ever? Yes.",
        lambda n: generate.fanout(n, "needle"),
        join_waits,
        reliable=True,
        possible=True,
        in_facts=_waits,
        unsound=True,
    ),
    Case(
        "unsafe",
        "fan-out without recoveries: can the join wait for ever? Yes.",
        generate.fanout,
        join_waits,
        reliable=False,
        possible=True,
        in_facts=_waits,
        unsound=True,
    ),
    Case(
        "completes",
        "fan-out without recoveries: can the plan complete? Yes.",
        generate.fanout,
        completes,
        reliable=False,
        possible=True,
        in_facts=lambda facts: facts["completes"] != "never",
    ),
    Case(
        "chain",
        "chain of n waypoints, no recovery can fail: can it end without completing? No.",
        generate.chain,
        lambda automaton: CanMiss(automaton.complete),
        reliable=True,
        possible=False,
        in_facts=lambda facts: facts["completes"] != "always",
    ),
    Case(
        "chain-free",
        "chain of n waypoints, recoveries can fail: can the plan give up? Yes.",
        generate.chain,
        gives_up,
        reliable=False,
        possible=True,
        in_facts=lambda facts: facts["gives_up"] != "never",
    ),
)


def model_of(case: Case, n: int, form: Format, style: Style) -> tuple[str, dict[str, Any]]:
    """The model, and what the tool has to be told about it."""
    plan = gpsfsm.parse(case.plan(n), limits=Limits()).plan
    assert plan is not None
    automaton = gpsfsm.compile_plan(plan).automaton
    spared = frozenset(
        node.index
        for node in automaton.runners
        if case.reliable and plan.elements[node.origin].interface.endswith("/SpeechRunner")
    )
    question = case.question(automaton)
    about = {
        "misses": isinstance(question, CanMiss),
        "size": len(cone_of(automaton, question, spared).nodes),
    }
    if form == "petri":
        return net_of(automaton, never_fails=spared), about
    write = promela_of if form == "promela" else smv_of
    return write(automaton, question, style=style, never_fails=spared), about


def main(key: str, n: int, form: Format, style: Style, file: Path) -> None:
    (case,) = (case for case in CASES if case.key == key)
    text, about = model_of(case, n, form, style)
    file.write_text(text, encoding="utf-8")
    print(json.dumps(about))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4], Path(sys.argv[5]))  # type: ignore[arg-type]
