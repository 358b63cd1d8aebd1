"""FlexBE and SMACH: real files, constructs, hostile texts, and an interpreter as judge."""

from __future__ import annotations

import json
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from gpsfsm.compile.formats import format_of, langgraph
from gpsfsm.compile.formats.python_source import FLEXBE, SMACH
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import many
from tests.compile.formats.python_machines import Part, active, enter, play, random_part, source
from tests.oracle.machines import ACTIVE, Configuration, Machine

if TYPE_CHECKING:
    from collections.abc import Hashable

    from gpsfsm.compile.units import MachinePlan

SHARED = Path(__file__).parents[4] / "shared" / "corpus" / "machines"


def read(text: str, tool: Any = SMACH) -> MachinePlan:
    plan, problems = tool.read(text, "m.py", DEFAULT_LIMITS)
    assert plan is not None, problems
    return plan  # type: ignore[no-any-return]


def refused(text: str, tool: Any = SMACH) -> list[tuple[int, str]]:
    plan, problems = tool.read(text, "m.py", DEFAULT_LIMITS)
    assert plan is None
    assert problems
    return [(each.location.line, each.message) for each in problems]


def names(plan: MachinePlan) -> list[str]:
    automaton = plan.automaton
    return [plan.path(each.origin).removeprefix("/machine/") for each in automaton.runners]


# -- an interpreter as judge ---------------------------------------------------------------------


def _events(leaf: Part) -> dict[str, list[str]]:
    """The outcomes by event: failures are FAILED; of one kind only, all but the first."""
    bad = [each for each in leaf.outcomes if each in ("failed", "aborted", "timeout")]
    good = [each for each in leaf.outcomes if each not in bad]
    if not bad or not good:
        good, bad = leaf.outcomes[:1], leaf.outcomes[1:] or leaf.outcomes
    return {"SUCCEEDED": good, "FAILED": bad}


class _Judged:
    """The automaton of a machine, of which only the leaves are seen."""

    def __init__(self, plan: MachinePlan) -> None:
        automaton = plan.automaton
        runners = {each.index: plan.elements[each.origin].interface for each in automaton.runners}
        ticks: dict[Hashable, list[str]] = {
            name: ["SUCCEEDED"] for name, each in runners.items() if each == TICK
        }
        self.machine = Machine(automaton.graph, ticks)
        self.hidden: set[int] = set()
        self.leaf: dict[str, int] = {}
        for name, interface in runners.items():
            number = self.machine.number[name]
            if interface in (CHOICE, TICK):
                self.hidden.add(number)
            else:
                self.leaf[plan.path(automaton.nodes[name].origin).rpartition("/")[2]] = number

    def settled(self, begin: list[Configuration]) -> set[Configuration]:
        """What is left when all choices are made and all moments have passed."""
        result, seen, todo = set(), set(begin), list(begin)
        while todo:
            here = todo.pop()
            waits = [n for n in self.hidden if here.states[n] == ACTIVE and here.end is None]
            if not waits:
                result.add(here)
            for step in self.machine.steps(here) if waits else []:
                if step.runner in waits and step.after not in seen:
                    seen.add(step.after)
                    todo.append(step.after)
        return result

    def seen(self, here: Configuration) -> Any:
        if here.end is not None:
            return here.end
        return frozenset(name for name, n in self.leaf.items() if here.states[n] == ACTIVE)


def _shown(top: Part, config: Any) -> Any:
    if isinstance(config, str):
        bad = config in ("failed", "aborted", "timeout")
        return "GAVE_UP" if bad else "COMPLETED"
    return frozenset(each.name for each in active(top, config))


@pytest.mark.parametrize("tool", ["smach", "flexbe"])
@pytest.mark.parametrize("seed", range(many(60)))
def test_a_machine_does_what_an_interpreter_of_its_tables_does(tool: str, seed: int) -> None:
    """After each sequence of ends of leaves the same leaves act, or it has ended the same."""
    random = Random(seed)  # noqa: S311  (no secrets here)
    top = random_part(random, "m", tool, 2)
    judged = _Judged(read(source(top, tool), SMACH if tool == "smach" else FLEXBE))
    first = judged.settled([judged.machine.begin()])
    todo: list[tuple[list[Any], set[Configuration], int]] = [([enter(top)], first, 0)]
    count = 0
    while todo and count < 150:
        count += 1
        left, right, depth = todo.pop(0)
        assert {_shown(top, each) for each in left} == {judged.seen(each) for each in right}
        running = [each for each in left if not isinstance(each, str)]
        leaves = {leaf.name: leaf for each in running for leaf in active(top, each)}
        for name, leaf in sorted(leaves.items()) if depth < 6 else []:
            for event, outcomes in _events(leaf).items():
                here = [each for each in running if leaf in active(top, each)]
                after = [play(top, each, name, outcome) for each in here for outcome in outcomes]
                steps = [
                    judged.machine.step(each, judged.leaf[name], event).after
                    for each in right
                    if each.end is None and each.states[judged.leaf[name]] == ACTIVE
                ]
                unique = list({repr(each): each for each in after}.values())
                todo.append((unique, judged.settled(steps), depth + 1))


# -- constructs ----------------------------------------------------------------------------------

HEAD = "import smach\nfrom smach import *\n"


def test_a_function_that_returns_from_its_with_block_builds_a_part() -> None:
    plan = read(
        HEAD + "def inner():\n"
        "    sm = StateMachine(outcomes=['done'])\n"
        "    with sm:\n"
        "        StateMachine.add('IN', Act(outcomes=['ok']), {'ok': 'done'})\n"
        "        return sm\n"
        "top = StateMachine(outcomes=['end'])\n"
        "with top:\n"
        "    StateMachine.add('A', inner(), {'done': 'B'})\n"
        "    StateMachine.add('B', Act(outcomes=['ok']), {'ok': 'end'})\n"
    )
    assert names(plan) == ["B", "A/IN"]


def test_loops_with_break_and_continue() -> None:
    plan = read(
        HEAD + "top = StateMachine(outcomes=['end'])\n"
        "with top:\n"
        "    for n in range(9):\n"
        "        if n == 1:\n"
        "            continue\n"
        "        if n == 3:\n"
        "            break\n"
        "        StateMachine.add('S%d' % n, Act(outcomes=['ok']), {'ok': 'end'})\n"
    )
    assert names(plan) == ["S0", "S2"]


ADD = "    StateMachine.add('A', Act(outcomes=['ok']), {'ok': 'end'})\n"
TOP = HEAD + "top = StateMachine(outcomes=['end'])\nwith top:\n"


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        (TOP + "  if unknown():\n" + ADD, 6, "whether 'A' is added is decided only when"),
        (TOP + "  for n in unknown():\n" + ADD, 6, "whether 'A' is added is decided only when"),
        (TOP + "    StateMachine.add(f(), Act())\n", 5, "the name of this state is not written"),
        (TOP + "    StateMachine.add('A', Act(), table())\n", 5, "the transitions of 'A' are not"),
        (TOP + "    StateMachine.add('A', top, {'end': 'end'})\n", 5, "'A' would contain itself"),
        (HEAD + "top = StateMachine(outcomes=f())\n", 3, "the outcomes of this container are not"),
        (HEAD + "it = Iterator(outcomes=['a'], it=[1])\n", 3, "how often an Iterator repeats"),
        (TOP + ADD + "top.set_initial_state([])\n", 6, "the first state is not written"),
        (TOP + "    StateMachine.add('A', Act(outcomes=['a', 'b']), {'a': 'end'})\n", 5, "'b'"),
        (TOP + "    StateMachine.add('A', Act(), {'a': 'nowhere'})\n", 5, "leads to 'nowhere'"),
        (HEAD + "sm = (\n", 3, "neither Python 3 nor Python 2"),
        (HEAD + "x = 1\n", 1, "no state machine can be read"),
    ],
)
def test_what_only_a_run_knows_is_refused_at_its_line(text: str, line: int, message: str) -> None:
    rows = refused(text)
    assert any(number == line and message in each for number, each in rows), rows


def test_python_does_not_speak_of_escapes_in_what_is_read() -> None:
    """It would warn, on some versions on standard error, and where warnings are errors raise."""
    text = TOP + ADD.replace("'A'", "'\\d'")
    assert names(read(text)) == ["\\d"]


def test_conditions_of_flexbe_that_are_not_written_are_refused() -> None:
    text = "from flexbe_core import *\nc = ConcurrencyContainer(outcomes=['a'], conditions=[f()])\n"
    text += "with c: OperatableStateMachine.add('A', S(), {'x': 'a'})\n"
    assert refused(text, FLEXBE) == [
        (2, "the conditions of this container are not written in the source")
    ]


@pytest.mark.parametrize(
    "text",
    [
        "a = 'x' * 9\n" + "a = f'{a}{a}'\n" * 60,
        "a = [1]\n" + "a = [a, a]\n" * 60 + "b = f'{a}'\nc = '%s' % a\n",
        "b = '%*d' % (999999999, 1)\n",
        "m = StateMachine(outcomes=['a'])\nwith m:\n  StateMachine.add('A', S(), {'x': 'a'})\n"
        + "".join(
            f"n = StateMachine(outcomes=['a'])\nwith n:\n"
            f"  StateMachine.add('B{i}', m, {{'a': 'C{i}'}})\n"
            f"  StateMachine.add('C{i}', m, {{'a': 'a'}})\nm = n\n"
            for i in range(40)
        ),
        "for a in range(1000):\n for b in range(1000):\n  for c in range(1000):\n   d = a\n",
        "for a in range(1000):\n  x = [" + "1, " * 20_000 + "]\n",
        "x = " + "-" * 50_000 + "1\n",
        "x = " + "f(" * 90 + ")" * 90 + "\n",
        "x = a" + "()" * 5_000 + "\n",
        "x = a" + ".b" * 5_000 + "\n",
        "x = len()\ny = range()\nz = str()\nclass A(StateMachine):\n  def __init__(): pass\nA()\n",
        "break\n",
        "return\n",
        "def f(): f()\nf()\n",
        "\x00",
    ],
)
def test_hostile_python_is_refused_and_quickly(text: str) -> None:
    assert refused("import smach\n" + text)


@pytest.mark.parametrize("tool", ["smach", "flexbe"])
def test_mutated_sources_never_raise(tool: str) -> None:
    random = Random(7)  # noqa: S311  (no secrets here)
    module = SMACH if tool == "smach" else FLEXBE
    pieces = ["(", ")", "[]", "None", "'x'", "sm", ":", "\n", "{}", ",", "=", "0", "*", "self"]
    for seed in range(many(40)):
        text = source(random_part(random, "m", tool, 2), tool)
        for _ in range(6):
            lines = text.split("\n")
            if random.random() < 0.5:
                lines.insert(random.randrange(len(lines)), lines[random.randrange(len(lines))])
            else:
                del lines[random.randrange(len(lines))]
            mutated = "\n".join(lines)
            at = random.randrange(len(mutated) + 1)
            mutated = mutated[:at] + random.choice(pieces) + mutated[at + random.randrange(3) :]
            for each in (mutated, "\n".join(lines)):
                plan, problems = module.read(each, f"{seed}.py", DEFAULT_LIMITS)
                assert (plan is None) == bool(problems)


# -- real files ----------------------------------------------------------------------------------


@pytest.mark.skipif(not SHARED.is_dir(), reason="the collection of real files is not here")
@pytest.mark.parametrize(("tool", "least"), [("flexbe", 0.8), ("smach", 0.6)])
def test_most_real_files_are_read_and_the_others_refused_at_a_line(tool: str, least: float) -> None:
    rows = []
    for file in sorted((SHARED / tool).glob("*.py")):
        text = file.read_text("utf-8")
        chosen = format_of(text[:4096], file.name)
        assert chosen is not None
        assert chosen.name == tool
        assert chosen.read is not None
        plan, problems = chosen.read(text, file.name, DEFAULT_LIMITS)
        assert (plan is None) == bool(problems)
        assert plan is not None or problems[0].location.line > 1
        rows.append(plan is not None)
    assert sum(rows) >= least * len(rows)


# -- LangGraph -----------------------------------------------------------------------------------

GRAPH = {
    "nodes": [{"id": name} for name in ("__start__", "agent", "tools", "__end__")],
    "edges": [
        {"source": "__start__", "target": "agent"},
        {"source": "agent", "target": "tools", "conditional": True},
        {"source": "agent", "target": "__end__", "conditional": True},
        {"source": "tools", "target": "agent"},
    ],
}


def test_mutated_graphs_never_raise() -> None:
    random = Random(3)  # noqa: S311  (no secrets here)
    whole = json.dumps(GRAPH)
    pieces = ["null", "1", "[]", '"x"', "{", "}", ",", "__end__", "true"]
    for _ in range(400):
        at = random.randrange(len(whole))
        text = whole[:at] + random.choice(pieces) + whole[at + random.randrange(12) :]
        plan, problems = langgraph.read(text, "g.json", DEFAULT_LIMITS)
        assert (plan is None) == bool(problems)


# -- findings ------------------------------------------------------------------------------------

PLANTED = Path(__file__).parents[3] / "corpus" / "machines"


@pytest.mark.parametrize(
    ("file", "findings"),
    [
        (
            "flexbe/delivery_sm.py",
            [
                ("GP119", 11),
                ("GP210", 41),
                ("GP301", 54),  # handing over: never reached
                ("GP302", 20),  # no condition speaks of a drive that fails
                ("GP302", 26),
                ("GP304", 1),  # because of the loop
                ("GP306", 1),
                ("GP313", 41),  # ringing and waiting: a loop that nothing leaves
            ],
        ),
        ("flexbe/forgotten_outcome_sm.py", [("GP117", 8)]),
    ],
)
def test_planted_mistakes_are_reported_at_their_lines(
    file: str, findings: list[tuple[str, int]]
) -> None:
    (plan,) = gpsfsm.check(PLANTED / file).plans
    assert sorted((each.rule, each.location.line) for each in plan.findings) == findings


def test_what_ends_a_concurrence_stops_its_choices_too() -> None:
    plan = read(
        "from flexbe_core import *\n"
        "c = ConcurrencyContainer(outcomes=['end'], conditions=[('end', [('A', 'done')])])\n"
        "with c:\n"
        "    OperatableStateMachine.add('A', Act(), transitions={'done': 'end'})\n"
        "    OperatableStateMachine.add('B', Act(outcomes=['x', 'y', 'z']),\n"
        "        transitions={'x': 'end', 'y': 'end', 'z': 'end'})\n"
        "top = OperatableStateMachine(outcomes=['finished'])\n"
        "with top:\n"
        "    OperatableStateMachine.add('C', c, transitions={'end': 'D'})\n"
        "    OperatableStateMachine.add('D', Act(), transitions={'done': 'finished'})\n",
        FLEXBE,
    )
    judged = _Judged(plan)
    last = judged.leaf["D"]
    here = judged.machine.reach([judged.machine.begin()])
    alone = [each for each in here if each.states[last] == ACTIVE]
    assert alone
    assert all(each.states.count(ACTIVE) == 1 for each in alone)


def test_a_function_that_ends_a_concurrence_ends_it_once() -> None:
    plan = read(
        HEAD + "c = Concurrence(outcomes=['end'], default_outcome='end',\n"
        "    child_termination_cb=lambda each: True)\n"
        "with c:\n"
        "    Concurrence.add('A', Act(outcomes=['ok', 'no']))\n"
        "    Concurrence.add('B', Act(outcomes=['ok', 'no']))\n"
        "top = StateMachine(outcomes=['done'])\n"
        "with top:\n"
        "    StateMachine.add('C', c, {'end': 'D'})\n"
        "    StateMachine.add('D', Act(outcomes=['ok']), {'ok': 'done'})\n"
    )
    judged = _Judged(plan)
    last = judged.leaf["D"]
    here = judged.machine.reach([judged.machine.begin()])
    alone = [each for each in here if each.states[last] == ACTIVE]
    assert alone
    assert all(each.states.count(ACTIVE) == 1 for each in alone)
