"""The states that the page shows, on real runs: compared with the kernel and a brute force."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.checking import CheckOptions
from gpsfsm.execution.journal_rows import RowMaker, line
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Input, Kind, Load, Status, Stop
from gpsfsm.model.automaton import NodeKind
from gpsfsm.viewing.picture import automaton_data
from gpsfsm.viewing.plans import see
from tests.conftest import REPO
from tests.viewing.browser.reports import document_of
from tests.viewing.browser.states import shown_after

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.compile import Compiled
    from tests.viewing.browser.states import Shown

WEB = REPO / "gpsfsm" / "viewing" / "web"
HERE = Path(__file__).parent
CORPUS = REPO / "corpus"
PLANS = sorted((CORPUS / "plans").glob("*.xml"))
RULE_PLANS = sorted((CORPUS / "rules").glob("GP[345]*/*.xml"))
TREES = sorted((CORPUS / "trees").glob("*.xml"))
ENGINE_PLANS = sorted((CORPUS / "rules").glob("GP70[3-7]/*.xml"))

Record = dict[str, Any]


@pytest.fixture(scope="session")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The modules of the page, where node takes them for modules."""
    if shutil.which("node") is None:
        pytest.skip("node is not installed")
    folder = tmp_path_factory.mktemp("modules")
    for module in WEB.glob("*.js"):
        shutil.copy(module, folder)
    (folder / "package.json").write_text('{"type": "module"}')
    return folder


def in_node(script: str, modules: Path, value: Any) -> Any:
    """What a script says that uses the page's own modules."""
    done = subprocess.run(
        ["node", HERE / script, modules],
        input=json.dumps(value),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def play_in_node(modules: Path, runs: list[Record]) -> list[Record]:
    """What the page's own player shows of runs."""
    records: list[Record] = in_node("play_records.mjs", modules, runs)
    return records


_MESSAGES = ("so be it", "its runner could not be loaded")  # the second is that of the kernel, too


class Chance:
    """Drives a kernel with whatever may happen next: outcomes, failures to load, pauses, ends."""

    def __init__(self, compiled: Compiled, seed: int) -> None:
        self.kernel = Kernel(compiled, apart=seed % 3 == 0)
        self.records: list[Record] = []
        self.expected: dict[int, Shown] = {}  # by number of records, what the kernel knows
        self._rows = RowMaker(self.kernel)
        self._random = random.Random(seed)  # noqa: S311  (it is a test)
        self._in_time = 0.92 if seed % 4 else 0.5  # some runs are late nearly always
        self._loads: list[int] = []
        self._stops: list[int] = []
        self._at_us = 0
        self._run()

    def _run(self) -> None:
        self._deliver(Input(Kind.BEGIN))
        while not self.kernel.status.ended:
            self._at_us += self._random.choice((0, 0, 250_000))
            self._deliver(self._random.choice(list(self._possible())))

    def _possible(self) -> Iterator[Input]:
        kernel, chance = self.kernel, self._random.random()
        for runner in self._loads:
            yield Input(Kind.LOADED if chance < 0.9 else Kind.NOT_LOADED, runner=runner)
        for number in kernel.active:
            if number in self._stops:
                yield Input(Kind.STOPPED if chance < 0.7 else Kind.SUCCEEDED, number)
            else:
                kind = Kind.SUCCEEDED if chance < 0.6 else Kind.FAILED
                kind = Kind.TIMEOUT if chance > self._in_time else kind
                yield Input(kind, number, message=self._random.choice(_MESSAGES))
        if kernel.paused:
            yield Input(Kind.RESUME)
        elif kernel.status is Status.RUNNING:
            if chance < 0.1:
                yield Input(Kind.PAUSE)
            if chance > (0.7 if kernel.overdue else 0.97):
                yield Input(Kind.CANCEL)
            if not self._loads and chance > 0.95:
                yield Input(Kind.SILENCE)

    def _deliver(self, happened: Input) -> None:
        if happened.runner >= 0:
            self._loads.remove(happened.runner)
        if self._random.random() < 0.1:
            self._write(Input(Kind.LOG, happened.number, message="a line"), [])
        records, commands = self.kernel.step(happened)
        self._loads += [each.runner for each in commands if isinstance(each, Load)]
        self._stops += [each.number for each in commands if isinstance(each, Stop)]
        self._write(happened, records)
        if self.kernel.status is Status.RUNNING:
            self.expected[len(self.records)] = self._known()

    def _write(self, happened: Input, records: list[Any]) -> None:
        rows = self._rows.make(self._at_us, happened, records)
        self.records += [json.loads(line(row)) for row in rows]

    def _known(self) -> Shown:
        """What the kernel itself knows of joins and of what acts; only while the run goes on."""
        kernel = self.kernel
        states: list[Any] = []
        for node in kernel.automaton.nodes:
            number = kernel.automaton.runner_number(node.index)
            arrived = kernel._arrived[node.index]
            if node.kind is NodeKind.JOIN and arrived:
                fired = kernel._fired[node.index]
                states.append([node.index, "fired" if fired else "waiting", arrived])
            elif node.kind is NodeKind.RUNNER and number in kernel.active:
                state = "timeout" if number in kernel.overdue else "running"
                states.append([node.index, state, 0])
            elif node.kind is NodeKind.RUNNER and (
                number in kernel._waiting or number in kernel._held
            ):
                states.append([node.index, "triggered", 0])
        return {"states": states, "taken": []}


def compiled_of(path: Path, engine: str = "paper") -> Compiled | None:
    """As the page sees it."""
    return see(path.read_bytes(), path.name, CheckOptions(engine=engine)).compiled


def runs_by_chance() -> list[tuple[str, Compiled, Chance]]:
    """Runs of plans of all kinds, on all engines."""
    wanted = [(path, "paper") for path in (*PLANS, *TREES)]
    wanted += [(path, engine) for path in ENGINE_PLANS for engine in ("fabric-v1", "fabric-v2")]
    runs = []
    for place, (path, engine) in enumerate(wanted):
        compiled = compiled_of(path, engine)
        if compiled is None:
            continue
        for seed in (2 * place, 2 * place + 1):
            runs.append((f"{path.name} on {engine}", compiled, Chance(compiled, seed)))
    return runs


def as_play(compiled: Compiled, chance: Chance) -> Record:
    seeks = random.Random(len(chance.records))  # noqa: S311  (it is a test)
    return {
        "automaton": automaton_data(compiled.automaton),
        "records": chance.records,
        "story_at": [],
        "seeks": [seeks.randint(0, len(chance.records)) for _ in range(12)],
    }


@pytest.fixture(scope="module")
def by_chance(modules: Path) -> list[tuple[str, Chance, Record, Record]]:
    """Runs, what is given to the page, and what it shows."""
    runs = runs_by_chance()
    plays = [as_play(compiled, chance) for _, compiled, chance in runs]
    shown = play_in_node(modules, plays)
    return [
        (name, chance, play, answer)
        for (name, _, chance), play, answer in zip(runs, plays, shown, strict=True)
    ]


def test_chance_meets_everything(by_chance: list[tuple[str, Chance, Record, Record]]) -> None:
    """Else the tests below prove less than they seem to."""
    kinds = {record["kind"] for _, chance, _, _ in by_chance for record in chance.records}
    ends = {chance.kernel.status.value for _, chance, _, _ in by_chance}
    states = {
        state
        for _, _, _, answer in by_chance
        for shown in answer["forwards"]
        for _, state, _ in shown["states"]
    }
    assert kinds >= {"TIMEOUT", "HELD", "NOT_LOADED", "LOG", "STOPPED", "JOINED"}
    assert ends >= {"COMPLETED", "GAVE_UP", "CANCELLED", "HANG", "ABORT", "STUCK"}
    assert states >= {"triggered", "running", "succeeded", "failed", "stopped", "timeout"}
    assert states >= {"waiting", "fired", "never", "reached"}


def test_states_by_brute_force(by_chance: list[tuple[str, Chance, Record, Record]]) -> None:
    for name, chance, play, answer in by_chance:
        for place, shown in enumerate(answer["forwards"]):
            expected = shown_after(play["automaton"], chance.records, place)
            assert shown == expected, (name, place, chance.records[:place])
        assert answer["ended"] == chance.kernel.status.value


def test_backwards_and_anywhere(by_chance: list[tuple[str, Chance, Record, Record]]) -> None:
    for name, _, play, answer in by_chance:
        assert answer["backwards"] == answer["forwards"], name
        assert answer["followed"] == answer["forwards"][1:], name
        assert answer["sought"] == [answer["forwards"][place] for place in play["seeks"]], name


def test_states_are_those_of_the_kernel(
    by_chance: list[tuple[str, Chance, Record, Record]],
) -> None:
    compared = 0
    for name, chance, play, answer in by_chance:
        nodes = play["automaton"]["nodes"]
        for place, expected in chance.expected.items():
            going_on = [
                [node, state, count]
                for node, state, count in answer["forwards"][place]["states"]
                if nodes[node]["kind"] == "join" or state in ("running", "triggered", "timeout")
            ]
            over = _over_by_time(chance.records[:place])
            going_on = [each for each in going_on if each[:2] not in over]
            assert going_on == expected["states"], (name, place)
            compared += len(expected["states"])
    assert compared > 300


def _over_by_time(records: list[Record]) -> list[list[Any]]:
    """Nodes that have failed because their time was over: they act no more."""
    late = [record["node"] for record in records if record["kind"] == "TIMEOUT"]
    return [
        [record["node"], "timeout"]
        for record in records
        if record["kind"] == "FAILED" and record["node"] in late
    ]


def test_steps_lead_from_end_to_end(by_chance: list[tuple[str, Chance, Record, Record]]) -> None:
    for name, _, play, answer in by_chance:
        last = len(play["records"])
        steps, back = answer["steps"], answer["stepsBack"]
        assert steps == sorted(set(steps)), name
        assert steps[-1] == last
        assert back == sorted(set(back), reverse=True)
        assert back[-1] == 0
        assert sorted(back)[1:] == [step for step in steps if step != last], name
        # every step shows something: the states or edges are others than at the last one
        shown = [answer["forwards"][place] for place in (0, *steps)]
        kinds = [play["records"][step - 1]["kind"] for step in steps]
        same = [
            kind
            for before, after, kind in zip(shown, shown[1:], kinds, strict=False)
            if before == after
        ]
        assert set(same) <= {"ENDED", "SILENCE", "CANCEL", "UNLOADED"}, name


def test_every_play_of_the_corpus_tells_its_story(modules: Path) -> None:
    """Each scenario of each finding, from nothing to how it is said to end."""
    documents = [document_of(path.read_bytes()) for path in (*PLANS, *RULE_PLANS)]
    plays = [
        {"automaton": plan["automaton"], **play, "seeks": []}
        for document in documents
        for plan in document["plans"]
        for play in plan["plays"]
    ]
    assert len(plays) > 50
    for play, answer in zip(plays, play_in_node(modules, plays), strict=True):
        records = play["records"]
        for place, shown in enumerate(answer["forwards"]):
            assert shown == shown_after(play["automaton"], records, place)
        assert answer["backwards"] == answer["forwards"]
        assert answer["ended"] == play["ends"]
        # at each step the marked sentences are those whose records are among the step's own
        spans = list(zip(play["story_from"], play["story_at"], strict=True))
        before = 0
        for step in answer["steps"]:
            own = range(before, step)
            expected = [
                "current"
                if any(first <= record <= last for record in own)
                else "past"
                if last < before
                else ""
                for first, last in spans
            ]
            assert answer["story"][step] == expected, play["title"]
            before = step
        assert set(answer["story"][0]) <= {""}
        assert set(answer["story"][-1]) <= {"current", "past"}


def _timed(*happened: tuple[int, str, int]) -> list[Record]:
    return [{"at_us": at_us, "kind": kind, "node": node} for at_us, kind, node in happened]


_NODES = [
    {"kind": kind, "need": 0} for kind in ("start", "runner", "runner", "complete", "give_up")
]
_TWO = {
    "nodes": _NODES,
    "edges": [
        {"source": 0, "event": "SUCCEEDED", "target": 1},
        {"source": 1, "event": "SUCCEEDED", "target": 2},
        {"source": 2, "event": "SUCCEEDED", "target": 3},
    ],
}
_RUN = [
    *((0, "TRIGGERED", 1), (0, "STARTED", 1), (2_000_000, "SUCCEEDED", 1)),
    *((2_000_000, "TRIGGERED", 2), (2_500_000, "STARTED", 2), (60_000_000, "SUCCEEDED", 2)),
]


def test_a_run_is_played_as_fast_as_it_was_but_nobody_waits_long(modules: Path) -> None:
    play = {"automaton": _TWO, "records": _timed(*_RUN), "pace": "time", "speed": 2}
    clock = in_node("play_clock.mjs", modules, play)
    # triggered and started in one instant is one step; half the time, and never more than 3 s
    assert clock["positions"] == [2, 3, 4, 5, 6]
    assert clock["waits"] == [16, 1000, 16, 250, 3000]
    assert clock["atEnd"]
    assert clock["playing"] is False


def test_a_scenario_is_played_evenly(modules: Path) -> None:
    play = {"automaton": _TWO, "records": _timed(*_RUN), "pace": "even", "speed": 0.5}
    clock = in_node("play_clock.mjs", modules, play)
    assert clock["waits"] == [1400] * 5


def test_two_runs_go_on_at_the_same_times(modules: Path) -> None:
    other = _timed((0, "TRIGGERED", 1), (0, "STARTED", 1), (1_000_000, "FAILED", 1))
    play = {"automaton": _TWO, "records": _timed(*_RUN), "other": other, "speed": 1}
    clock = in_node("play_clock.mjs", modules, play)
    assert clock["positions"] == [[2, 2], [2, 3], [4, 3], [5, 3], [6, 3]]
    assert clock["atEnd"]
