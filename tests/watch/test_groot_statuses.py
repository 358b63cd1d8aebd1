"""The statuses that Groot2 sees, held against those of BehaviorTree.CPP, and the texts of trees."""

from __future__ import annotations

import random
import struct
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.compile.units import MachinePlan
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.machine_kernel import MachineKernel
from gpsfsm.execution.records import Input, Kind, Load, Status, Stop
from gpsfsm.model.automaton import Signal
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.watch.groot_tree import FAILURE, IDLE, RUNNING, SUCCESS, WAS, Statuses, text_of
from tests.cases import many
from tests.oracle.btcpp import Answer, engine, play
from tests.oracle.random_trees import RandomTree
from tests.oracle.ticks import random_tree
from tests.watch.groot_client import LEAVES, asking, free_port, header, parsed, tree_of, whole

if TYPE_CHECKING:
    from collections.abc import Callable

EXACT = {
    "Sequence": "<Sequence><A0/><C0/><A1/></Sequence>",
    "Fallback": "<Fallback><A0/><Inverter><A1/></Inverter><A2/></Fallback>",
    "Parallel": '<Parallel success_count="2" failure_count="2"><A0/><A1/><A2/></Parallel>',
    "ParallelAll": '<ParallelAll max_failures="2"><A0/><A1/><A2/></ParallelAll>',
    "halting": '<Fallback><Parallel failure_count="1" success_count="1"><Sequence><A0/><A1/>'
    "</Sequence><A2/></Parallel><A3/></Fallback>",
    "ReactiveSequence": "<ReactiveSequence><C0/><C1/><A0/></ReactiveSequence>",
    "watching": "<ReactiveSequence><Inverter><C0/></Inverter><C1/><Sequence><A0/><A1/></Sequence>"
    "</ReactiveSequence>",
    "ReactiveFallback": "<ReactiveFallback><C0/><Sequence><A0/><A1/></Sequence></ReactiveFallback>",
    "WhileDoElse": "<WhileDoElse><C0/><A0/><A1/></WhileDoElse>",
    "IfThenElse": "<Sequence><IfThenElse><C0/><A0/><A1/></IfThenElse><A2/></Sequence>",
    "SubTree": '<Sequence><SubTree ID="Sub"/><SubTree ID="Deep" name="again"/></Sequence>',
    "constants": "<Fallback><Sequence><A0/><AlwaysFailure/></Sequence><ForceFailure>"
    "<AlwaysSuccess/></ForceFailure><ForceSuccess><A1/></ForceSuccess></Fallback>",
}
"""Trees whose nodes have the status of BehaviorTree.CPP after each tick."""

LOOPS = {
    "Retry": '<RetryUntilSuccessful num_attempts="3"><Sequence><A0/><A1/></Sequence>'
    "</RetryUntilSuccessful>",
    "Retry for ever": '<RetryUntilSuccessful num_attempts="-1"><Fallback><A0/><A1/></Fallback>'
    "</RetryUntilSuccessful>",
    "Repeat": '<Sequence><Repeat num_cycles="2"><Fallback><A0/><A1/></Fallback></Repeat>'
    "<ForceFailure><A2/></ForceFailure></Sequence>",
    "KeepRunning": "<KeepRunningUntilFailure><Sequence><A0/><A1/></Sequence>"
    "</KeepRunningUntilFailure>",
}
"""Trees that BehaviorTree.CPP lets rest for a tick between two rounds; at the end they agree."""


class Followed:
    """A run whose leaves end as they are told; ``statuses`` are those that Groot2 would see."""

    def __init__(self, text: str) -> None:
        plan = read_plan(text).plan
        assert plan is not None
        compiled = compile_plan(plan)
        is_machine = isinstance(plan, MachinePlan)
        self.kernel = MachineKernel(compiled) if is_machine else Kernel(compiled)
        self.names = [runner.interface for runner in plan.runners]
        self.statuses = Statuses(tree_of(text))
        self._step(Input(Kind.BEGIN))

    def _step(self, happened: Input) -> None:
        pending = [happened]
        while pending:
            records, commands = self.kernel.step(pending.pop(0))
            self.statuses.add(records)
            for each in commands:
                if isinstance(each, Load):
                    pending.append(Input(Kind.LOADED, runner=each.runner))
                elif isinstance(each, Stop):
                    pending.append(Input(Kind.STOPPED, number=each.number))

    def end(self, name: str, answer: Answer) -> None:
        """The leaf (or the first choice) with this name ends, and all ticks that follow."""
        self._end(name, Kind.SUCCEEDED if answer == "SUCCESS" else Kind.FAILED)
        while TICK in self.acting:
            self._end(TICK, Kind.SUCCEEDED)

    @property
    def acting(self) -> dict[str, int]:
        """What acts, by its name."""
        numbers = [each for each in self.kernel.active if not self.kernel.is_stopping(each)]
        return {self.names[each]: each for each in reversed(numbers)}

    def _end(self, name: str, kind: Kind) -> None:
        self._step(Input(kind, number=self.acting[name]))

    @property
    def shown(self) -> dict[int, int]:
        return {use + 1: status for use, status in enumerate(self.statuses.shown)}


def statuses_in(buffer: bytes) -> dict[int, int]:
    return dict(struct.iter_unpack("<HB", buffer))


# --- statuses ------------------------------------------------------------------------------------


def ticked(text: str, seed: int) -> list[tuple[list[tuple[str, Answer]], dict[int, int], bool]]:
    """Per tick of the real engine: what ends, the statuses after it, and whether it is the last."""
    chance = random.Random(seed)  # noqa: S311
    share = chance.choice((0.2, 0.5, 0.8))
    seen: list[dict[int, int]] = []
    port = free_port()

    def answer(_name: str, _visit: int) -> tuple[int, Answer]:
        return chance.choice((0, 1, 1, 2, 3)), "SUCCESS" if chance.random() < share else "FAILURE"

    def watch(tree: Any) -> Callable[[], None]:
        publisher = engine().Groot2Publisher(tree, port)

        def look() -> None:
            assert publisher is not None  # it lives as long as this function does
            with asking(port) as ask:
                seen.append(statuses_in(ask(header("S"))[1]))

        return look

    run = play(text, LEAVES, answer, most_ticks=12, watch=watch)
    over = [False] * (len(run.ticks) - 1) + [run.status != "RUNNING"]
    return [(tick.ended, each, end) for tick, each, end in zip(run.ticks, seen, over, strict=True)]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", EXACT)
def test_statuses_are_those_of_the_real_engine_after_each_tick(name: str, seed: int) -> None:
    text = whole(EXACT[name])
    followed = Followed(text)
    for ended, statuses, _ in ticked(text, seed):
        for leaf, answer in ended:
            followed.end(leaf, answer)
        assert followed.shown == statuses


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("name", LOOPS)
def test_statuses_are_those_of_the_real_engine_at_the_end_of_loops(name: str, seed: int) -> None:
    text = whole(LOOPS[name])
    followed = Followed(text)
    for ended, statuses, over in ticked(text, seed):
        for leaf, answer in ended:
            followed.end(leaf, answer)
        assert over is followed.kernel.status.ended
        if over:
            assert followed.shown == statuses


def test_a_run_from_its_beginning_to_its_end() -> None:
    followed = Followed(whole("<Sequence><A0/><A1/></Sequence>"))
    assert followed.shown == {1: RUNNING, 2: RUNNING, 3: IDLE}
    followed.end("A0", "SUCCESS")
    assert followed.shown == {1: RUNNING, 2: SUCCESS, 3: RUNNING}
    followed.end("A1", "FAILURE")
    assert followed.shown == {1: WAS + FAILURE, 2: WAS + SUCCESS, 3: WAS + FAILURE}


def test_a_node_that_is_skipped_is_idle() -> None:
    text = whole('<Sequence><A0 _skipIf="1 == 1"/><A1/></Sequence>')
    followed = Followed(text)
    assert followed.shown == {1: RUNNING, 2: IDLE, 3: IDLE}  # a choice: nobody knows the value
    followed.end(CHOICE, "SUCCESS")
    assert followed.shown == {1: RUNNING, 2: IDLE, 3: RUNNING}
    followed = Followed(text)
    followed.end(CHOICE, "FAILURE")
    assert followed.shown == {1: RUNNING, 2: RUNNING, 3: IDLE}
    followed = Followed(whole('<Fallback><A0 _failureIf="1 == 1"/><A1/></Fallback>'))
    followed.end(CHOICE, "SUCCESS")
    assert followed.shown == {1: RUNNING, 2: FAILURE, 3: RUNNING}


def test_a_node_that_is_halted_was_running() -> None:
    followed = Followed(whole('<Fallback><Timeout msec="9"><A0/></Timeout><A1/></Fallback>'))
    assert followed.shown == {1: RUNNING, 2: RUNNING, 3: RUNNING, 4: IDLE}
    followed.end(CHOICE, "SUCCESS")  # time is up
    assert followed.shown == {1: RUNNING, 2: FAILURE, 3: WAS + RUNNING, 4: RUNNING}


def test_a_node_that_ends_at_once_does_so_in_each_round() -> None:
    body = "<NonblockingSequence><A0/><AlwaysSuccess/></NonblockingSequence>"
    loop = f"<KeepRunningUntilFailure><ForceSuccess>{body}</ForceSuccess></KeepRunningUntilFailure>"
    followed = Followed(whole(loop))
    for _ in range(3):
        assert followed.shown == {1: RUNNING, 2: RUNNING, 3: RUNNING, 4: RUNNING, 5: SUCCESS}
        followed.end("A0", "FAILURE")


def test_a_case_that_is_left_is_halted() -> None:
    followed = Followed(
        whole('<Switch2 variable="{a}" case_1="1" case_2="2"><A0/><A1/><A2/></Switch2>')
    )
    followed.end(CHOICE, "SUCCESS")
    assert followed.shown == {1: RUNNING, 2: RUNNING, 3: IDLE, 4: IDLE}
    followed.end(CHOICE, "FAILURE")  # the value does not stay
    followed.end(CHOICE, "FAILURE")
    followed.end(CHOICE, "FAILURE")
    assert followed.shown == {1: RUNNING, 2: WAS + RUNNING, 3: IDLE, 4: RUNNING}


def test_what_a_plan_lets_run_on_is_shown_as_halted() -> None:
    """BehaviorTree.CPP halts the second child; the automaton of a plan does not."""
    followed = Followed(whole("<Fallback><Parallel><A0/><A1/></Parallel><A2/></Fallback>"))
    followed.end("A0", "FAILURE")
    halted = {1: RUNNING, 2: FAILURE, 3: WAS + FAILURE, 4: WAS + RUNNING, 5: RUNNING}
    assert followed.shown == halted
    followed.end("A1", "SUCCESS")
    assert followed.shown == halted


def test_statuses_of_long_loops_and_cancelled_runs() -> None:
    body = "<Sequence><A0/><Inverter><A1/></Inverter></Sequence>"
    text = whole(f'<RetryUntilSuccessful num_attempts="500">{body}</RetryUntilSuccessful>')
    followed = Followed(text)
    for _ in range(400):
        followed.end("A0", "SUCCESS")
        assert followed.shown[3] == SUCCESS
        followed.end("A1", "SUCCESS")
        assert followed.shown[1] == followed.shown[2] == followed.shown[3] == RUNNING
        assert followed.shown[4] == WAS + FAILURE
    followed._step(Input(Kind.CANCEL))
    assert followed.shown == {1: 11, 2: 11, 3: 11, 4: 13, 5: 12}


@pytest.mark.parametrize("seed", range(many(30)))
@pytest.mark.parametrize("draw", [lambda chance: RandomTree(chance).text, random_tree])
def test_statuses_fit_what_acts(draw: Callable[[random.Random], str], seed: int) -> None:
    chance = random.Random(seed)  # noqa: S311
    text = draw(chance)
    if "PathLongerOnApproach" in text or read_plan(text).plan is None:
        return  # that one goes on without its child, which it does not halt
    followed = Followed(text)
    for _ in range(60):
        check_statuses(followed)
        if followed.kernel.status.ended:
            break
        leaf = chance.choice(sorted(followed.acting))
        followed.end(leaf, "SUCCESS" if chance.random() < 0.6 or leaf == TICK else "FAILURE")


def check_statuses(followed: Followed) -> None:
    """A node runs in one that runs, and a leaf runs if it acts, unless it is only asked again."""
    tree, shown, kernel = followed.statuses.tree, followed.statuses.shown, followed.kernel
    running = {use for use, status in enumerate(shown) if status == RUNNING}
    assert all(shown[tree.uses[use].parent] == RUNNING for use in running if use > 0)
    acting: set[str] = set()
    if isinstance(kernel.automaton.plan, MachinePlan):  # others let run on what a tree halts
        for number in kernel.active:
            name = followed.names[number]
            signal = Signal(kernel.automaton.runner_node(number), Event.SUCCEEDED)
            if name not in (CHOICE, TICK) and not tree.steps[signal][0].watches:
                acting.add(name)
        names = {tree.uses[use].node.identity for use in running if tree.ends[use] == use + 1}
        assert names >= acting
        assert names <= set(followed.acting)
    if kernel.status is Status.COMPLETED:
        assert shown[0] in (IDLE, WAS + SUCCESS)


# --- texts ---------------------------------------------------------------------------------------


def test_texts_of_all_kinds_of_nodes() -> None:
    text = (
        '<root BTCPP_format="3" main_tree_to_execute="Main"><BehaviorTree ID="Main"><Sequence>'
        '<Action ID="Look around" at="a&lt;&quot;b&apos;&#10;c"/><Compact/><Condition ID="Free"/>'
        '<RateController hz="1"><Deco><Own><Go/><Go/></Own></Deco></RateController></Sequence>'
        '</BehaviorTree><BehaviorTree ID="Compact"><SubTreePlus ID="Deep"/></BehaviorTree>'
        '<BehaviorTree ID="Deep"><IsStuck/></BehaviorTree><TreeNodesModel><Action ID="Go">'
        '<input_port name="to"/><output_port name="at"/></Action></TreeNodesModel></root>'
    )
    root = parsed(text_of(tree_of(text)))
    trees = {each.get("_fullpath"): each for each in root.findall("BehaviorTree")}
    assert list(trees) == ["", "Compact::3", "Compact::3/Deep::4"]
    look = trees[""].find(".//Action")
    assert look is not None
    assert look.attrib == {
        "ID": "Look around",
        "name": "Look around",
        "_uid": "2",
        "at": "a<\"b'\nc",
    }
    uids = [each.get("_uid") for each in root.iter() if "_uid" in each.attrib]
    assert uids == ["1", "2", "3", "6", "7", "8", "9", "10", "11", "4", "5"]
    kinds = {each.get("ID"): each.tag for each in root.iterfind("TreeNodesModel/*")}
    assert kinds == {
        "Deco": "Decorator",
        "Free": "Condition",
        "Go": "Action",
        "IsStuck": "Condition",
        "Look around": "Action",
        "Own": "Control",
        "RateController": "Decorator",
        "Sequence": "Control",
    }
    assert [port.tag for port in root.iterfind(".//Action[@ID='Go']/*")] == [
        "input_port",
        "output_port",
    ]


@pytest.mark.parametrize(
    "text", ["]]>&amp;", "&#1;", "\ufffe", "&#xD800;", "'&#9;&#13;", "a:b", "--", "\U0001f600"]
)
def test_texts_are_well_formed_whatever_is_in_them(text: str) -> None:
    nodes = f'<Action ID="{text}" a:b="1"/><a:b c="{text}"/><Go name="{text}" xmlns="x"/>'
    tree = tree_of(whole(f"<Sequence>{nodes}</Sequence>"))
    uids = [each.get("_uid") for each in parsed(text_of(tree)).iter() if "_uid" in each.attrib]
    assert uids == ["1", "2", "3", "4"]


def test_trees_may_be_nested_deeply() -> None:
    inside = "<Inverter>" * 90 + "<A0/>" + "</Inverter>" * 90
    for body in (inside, f"<KeepRunningUntilFailure>{inside}</KeepRunningUntilFailure>"):
        followed = Followed(whole(body))
        assert set(followed.shown.values()) == {RUNNING}
        assert text_of(followed.statuses.tree).count("<Inverter ") == 90
