"""Machines of other tools: what is read, what is refused and where, and what runs do."""

from __future__ import annotations

import random
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.compile.formats import formats
from gpsfsm.compile.formats.outcomes import is_failure, machine_from
from gpsfsm.compile.formats.states import State
from gpsfsm.compile.instants import COMPLETED, FAILED, GAVE_UP, SUCCEEDED, Instants
from gpsfsm.compile.machines import Place
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.model.capability import OWN
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import batches, many

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.compile.instants import Configuration
    from gpsfsm.compile.units import MachinePlan

CORPUS = Path(__file__).parents[3] / "corpus" / "machines"
EXAMPLES = {
    "agent.langgraph.json": ("GP117", 14, "an edge names 'planner', which is not a node"),
    "delivery.yasmin.xml": (
        "GP313",
        9,
        "once entered, this loop is never left, whatever the outcomes: Wait at line 9",
    ),
    "door.scxml": ("GP301", 24, "no run of the machine triggers apologise at line 24"),
    "inspection_flexbe.py": ("GP301", 42, "no run of the machine triggers ReportState at line 42"),
    "patrol_smach.py": ("GP117", 28, "no transition takes the outcome 'aborted' of 'CHARGE'"),
}


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_a_planted_defect_has_its_line(name: str) -> None:
    (report,) = gpsfsm.check(CORPUS / name).plans
    errors = [
        (finding.rule, finding.location.line, finding.message)
        for finding in report.findings
        if finding.severity.value == "error"
    ]
    assert errors == [EXAMPLES[name]]


def test_every_example_has_a_defect() -> None:
    assert sorted(
        path.name
        for path in CORPUS.iterdir()
        if path.is_file() and not path.name.endswith(".expected.json")
    ) == sorted(EXAMPLES)


@pytest.mark.parametrize(("folder", "least"), [("flexbe", 0.8), ("smach", 0.6), ("yasmin", 0.8)])
def test_machines_of_public_repositories_are_read(
    shared_corpus: Path, folder: str, least: float
) -> None:
    paths = sorted((shared_corpus / "machines" / folder).iterdir())
    plans = []
    for path in paths:
        parsed = read_plan_or_machine(path.read_bytes(), file=str(path))
        assert parsed.machine, path
        assert parsed.plan is not None or parsed.problems, path
        plans.append(parsed.plan is not None)
    assert sum(plans) >= least * len(plans)


@pytest.mark.parametrize("name", sorted(EXAMPLES))
def test_a_damaged_file_is_refused_and_nothing_is_raised(name: str) -> None:
    text = (CORPUS / name).read_text()
    for seed in range(many(150)):
        chance = random.Random(seed)  # noqa: S311
        damaged = text
        for _ in range(chance.randint(1, 4)):
            start = chance.randrange(len(damaged) + 1)
            end = min(len(damaged), start + chance.choice((0, 1, 5, 60)))
            piece = chance.choice(("", "<", '"', "(", "\n", "\x00", "é", "}" * 300, "(" * 3000))
            damaged = damaged[:start] + piece + damaged[end:]
        for each in formats().values():
            if each.read is not None:
                machine, problems = each.read(damaged, name, DEFAULT_LIMITS)
                assert machine is not None or problems
        read_plan_or_machine(damaged, file=name)


def test_python_is_never_executed(tmp_path: Path) -> None:
    trace = tmp_path / "trace"
    text = (
        f"open({str(trace)!r}, 'w')\n"
        f"import smach, os; os.system('touch {trace}')\n"
        "sm = smach.StateMachine(outcomes=['done'])\n"
        "with sm:\n"
        f"    smach.StateMachine.add('A' * (10 ** 9), eval('1'), transitions={{'ok': 'done'}})\n"
    )
    parsed = read_plan_or_machine(text, file="machine.py")
    assert parsed.machine
    assert parsed.plan is None
    assert not trace.exists()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<state id="a"><history id="h"/></state>', "<history> does not have exactly one"),
        ('<state id="a"><script>x()</script></state>', "cannot contain a <script>"),
        ('<state id="a"><onentry><raise/></onentry></state>', "this <raise> has no event"),
        ('<state id="a"><transition event="e" target="b"/></state>', "there is no state 'b'"),
        ('<state id="a"/><state id="a"/>', "there are two states 'a'"),
        ("", "there is no state here"),
        ('<!DOCTYPE x [<!ENTITY e "e">]>', ""),
    ],
)
def test_what_scxml_cannot_be_read_is_refused(body: str, words: str) -> None:
    text = f'<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0">{body}</scxml>'
    parsed = read_plan_or_machine(text, file="chart.scxml")
    assert parsed.plan is None
    assert words in parsed.problems[0].message
    assert parsed.problems[0].location.line == 1


# -- outcomes: against an interpreter of them ------------------------------------------------------


def random_container(chance: random.Random, names: Iterator[int], depth: int) -> State:
    """A container of states; the outcomes of each state are o0, o1 and failed."""
    own = next(names)
    container = State(f"M{own}", Place(own, 1), container=True, outcomes=("won", "failed"))
    container.parallel = depth > 0 and chance.random() < 0.3
    for _ in range(chance.randint(1, 3)):
        if depth < 2 and chance.random() < 0.35:
            inner = random_container(chance, names, depth + 1)
            inner.transitions = {"won": "", "failed": ""}
            container.states.append(inner)
        else:
            number = next(names)
            outcomes = chance.choice((("o0", "failed"), ("o0", "o1", "failed"), ("o0",)))
            container.states.append(
                State(f"S{number}", Place(number, 1), f"S{number}", dict.fromkeys(outcomes, ""))
            )
    if container.parallel:
        for each in container.states:
            each.outcomes = tuple(each.transitions)
        rows = [(each.name, list(each.transitions)) for each in container.states]
        for outcome in ("won", "failed"):
            items = {name: chance.choice(ends) for name, ends in rows if chance.random() < 0.7}
            if items:
                container.rules.append((outcome, items))
        container.default = chance.choice(("won", "failed"))
        return container
    targets = [each.name for each in container.states] + ["won", "failed"]
    for each in container.states:
        each.transitions = {outcome: chance.choice(targets) for outcome in each.transitions}
    container.initial = container.states[0].name
    return container


class Interpreter:
    """The states that are active, by the definition of outcomes and outcome maps."""

    def __init__(self, top: State) -> None:
        self.top, self.active = top, dict[str, tuple[State, ...]]()
        self.ended: dict[int, dict[str, str]] = {}
        self.result = ""
        self._enter((top,), top)

    def _enter(self, around: tuple[State, ...], state: State) -> None:
        if not state.container:
            self.active[state.name] = around
            return
        self.ended[id(state)] = {}
        inside = (*around, state) if around[-1] is not state else around
        for each in state.states if state.parallel else state.states[:1]:
            self._enter(inside, each)

    def end(self, name: str, outcome: str) -> None:
        around = self.active.pop(name)
        state = next(each for each in around[-1].states if each.name == name)
        while True:
            container, around = around[-1], around[:-1]
            if container.parallel:
                ended = self.ended[id(container)]
                ended[state.name] = outcome
                if len(ended) < len(container.states):
                    return
                outcome = next(
                    (
                        result
                        for result, items in container.rules
                        if all(ended[key] == value for key, value in items.items())
                    ),
                    container.default,
                )
            else:
                target = state.transitions[outcome]
                inside = next((each for each in container.states if each.name == target), None)
                if inside is not None:
                    self._enter((*around, container), inside)
                    return
                outcome = target
            if not around:
                self.result = outcome
                return
            state = container


def closed(
    machine: MachinePlan, instants: Instants, here: set[Configuration]
) -> set[Configuration]:
    """With all that choices and ticks may lead to."""
    pending = list(here)
    while pending:
        at = pending.pop()
        for number, runner in enumerate(machine.runners):
            if runner.interface in OWN and at.active >> number & 1:
                for outcome in (SUCCEEDED, FAILED):
                    after = instants.after(at, number, outcome).configuration
                    if after not in here:
                        here.add(after)
                        pending.append(after)
    return here


@pytest.mark.parametrize("batch", batches(8))
def test_machines_of_outcomes_do_what_their_definition_says(batch: int) -> None:
    for seed in range(40 * batch, 40 * batch + 40):
        chance = random.Random(seed)  # noqa: S311
        top = random_container(chance, iter(range(1, 1_000)), 0)
        machine, problems = machine_from(top, "random")
        assert machine is not None, problems
        instants = Instants(machine.automaton)
        for _ in range(3):
            interpreter = Interpreter(top)
            here = closed(machine, instants, {instants.first().configuration})
            for _ in range(25):
                names = {
                    frozenset(
                        runner.interface
                        for number, runner in enumerate(machine.runners)
                        if at.active >> number & 1
                    )
                    for at in here
                }
                if interpreter.result:
                    end = GAVE_UP if is_failure(interpreter.result) else COMPLETED
                    assert end in {at.ended for at in here}, seed
                    break
                active = frozenset(interpreter.active)
                assert active in names, seed
                name = chance.choice(sorted(active))
                around = interpreter.active[name][-1]
                state = next(each for each in around.states if each.name == name)
                outcome = chance.choice(sorted(state.transitions))
                interpreter.end(name, outcome)
                number = [each.interface for each in machine.runners].index(name)
                events = (FAILED,) if is_failure(outcome) else (SUCCEEDED,)
                if all(map(is_failure, state.transitions)) or not any(
                    map(is_failure, state.transitions)
                ):
                    events = (SUCCEEDED, FAILED)
                here = closed(
                    machine,
                    instants,
                    {
                        instants.after(at, number, event).configuration
                        for at in here
                        for event in events
                        if at.active >> number & 1
                        and frozenset(
                            runner.interface
                            for index, runner in enumerate(machine.runners)
                            if at.active >> index & 1
                        )
                        == active
                    },
                )
                assert here, seed
