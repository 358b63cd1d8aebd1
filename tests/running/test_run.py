"""Runs from Python: ``gpsfsm.run`` and ``gpsfsm.run_async``."""

from __future__ import annotations

import asyncio
import json
import threading
from typing import TYPE_CHECKING, ClassVar

import pytest

import gpsfsm
from gpsfsm.errors import GpsfsmError, InputError, UsageError
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.generation.language_model import Answer
from gpsfsm.running.interruption import Interruption
from tests.cli.support import run as cli
from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import RunContext
    from gpsfsm.generation.language_model import Request

HOME = REPO / "corpus" / "worlds" / "home.yaml"
ASK = "prompt_capabilities/PromptTextRunner"
DRIVE, WAIT = "nav2_capabilities/WaypointRunner", "generic_capabilities/WaitRunner"


def step(name: str, **attributes: object) -> str:
    written = " ".join(f'{key}="{value}"' for key, value in attributes.items())
    return f'<Runner interface="{name}" provider="{name}" {written}/>'


def plan(*steps: str) -> str:
    return f"<Plan>\n{''.join(steps)}\n</Plan>\n"


GO = plan(step(DRIVE, x=2.0, y=-0.5), step(WAIT, seconds=1))


class Drives(Runner):
    """Drives nowhere; where x is negative it fails."""

    been: ClassVar[list[RunValue]] = []

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        self.been.append(parameters["x"])
        await context.sleep(0.001)
        x = parameters["x"]
        assert isinstance(x, float)
        if x < 0:
            raise RunnerError("there is a wall")
        return None


class Scripted:
    """A model that has one answer."""

    name = "test:scripted"
    context_tokens = None

    def __init__(self, text: str) -> None:
        self.text = text
        self.requests: list[Request] = []

    async def answer(self, request: Request) -> Answer:
        self.requests.append(request)
        return Answer(self.text, self.name)

    async def close(self) -> None:
        """Nothing is open."""


def test_in_a_world(tmp_path: Path) -> None:
    journal = tmp_path / "run.db"
    result = gpsfsm.run(GO, world=HOME, journal=journal, seed=3)
    assert result
    assert result.status is Status.COMPLETED
    (ending,) = result.plans
    assert (ending.number, ending.run, result.journal) == (1, 1, str(journal))
    assert ending.summary.startswith("COMPLETED after")
    with JournalReader(str(journal)) as reader:
        stored = [(row.seq, row.at_us, row.kind, row.data) for row in reader.events(1)]
        assert reader.run(1).mode == "world"
    assert stored == [(row.seq, row.at_us, row.kind, row.data) for row in ending.events]


def test_several_plans_from_files_share_a_queue(tmp_path: Path) -> None:
    for name in ("a", "b"):
        (tmp_path / f"{name}.xml").write_text(GO, encoding="utf-8")
    result = gpsfsm.run([tmp_path / "a.xml", tmp_path / "b.xml"], failure=0.0)
    assert [each.status for each in result.plans] == [Status.COMPLETED] * 2
    assert [each.name for each in result.plans] == [str(tmp_path / f"{n}.xml") for n in "ab"]
    with pytest.raises(UsageError, match="more plans than max_plans"):
        gpsfsm.run([tmp_path / "a.xml", tmp_path / "b.xml"], max_plans=1)
    with pytest.raises(InputError, match=r"none\.xml: "):
        gpsfsm.run(tmp_path / "none.xml")


def test_own_runners_act() -> None:
    Drives.been.clear()
    result = gpsfsm.run(GO.replace('1"', '0.01"'), runners={DRIVE: Drives})
    assert result.status is Status.COMPLETED
    assert Drives.been == [2.0]
    failing = plan(step(DRIVE, x=-1.0, y=0.0), step(WAIT, seconds=0.01))
    result = gpsfsm.run(failing, runners={DRIVE: Drives})
    assert not result
    assert result.status is Status.GAVE_UP
    assert any(row.message == "there is a wall" for row in result.plans[0].events)


def test_a_plan_that_the_gate_refuses_is_not_run(tmp_path: Path) -> None:
    journal = tmp_path / "run.db"
    refused = gpsfsm.run("<Plan><Runner/></Plan>", journal=journal)
    assert not refused
    assert refused.status is Status.REFUSED
    assert refused.plans[0].findings[0].startswith("GP1")
    assert refused.plans[0].events == ()
    assert not journal.exists()
    undescribed = gpsfsm.run(plan(step("a/Go")), real=True)
    assert undescribed.status is Status.REFUSED
    assert "no capability file describes a/Go" in undescribed.plans[0].findings[0]


def test_a_model_goes_on_where_a_plan_gives_up() -> None:
    far = plan(step(DRIVE, x=1000.0, y=1000.0))
    model = Scripted(plan(step(WAIT, seconds=2)))
    result = gpsfsm.run(far, world=HOME, model=model, task="wait a little")
    assert result
    assert [each.status for each in result.plans] == [Status.GAVE_UP, Status.COMPLETED]
    assert result.plans[1].continues == 1
    assert "wait a little" in model.requests[0].messages[-1].text
    with pytest.raises(UsageError, match="a model needs a world"):
        gpsfsm.run(far, model=model)


@pytest.mark.parametrize("real", [False, True])
def test_what_an_interruption_left_goes_on(tmp_path: Path, real: bool) -> None:
    """The first plan is cancelled, as by Ctrl-C: nothing is left of it, and nothing runs twice."""
    interruption = Interruption()
    interruption.requested = True
    journal = tmp_path / "run.db"
    how = {"runners": {DRIVE: Drives}} if real else {"world": HOME}
    stopped = gpsfsm.run(GO, journal=journal, interruption=interruption, **how)  # type: ignore[arg-type]
    assert not stopped
    again = gpsfsm.run(GO, journal=journal, **how)  # type: ignore[arg-type]
    assert again
    if not real:
        with pytest.raises(UsageError, match="world needs a plan: without one, the journal's run"):
            gpsfsm.run(journal=journal, world=HOME)
        how = {}
    ended = gpsfsm.run(journal=journal, **how)  # type: ignore[arg-type]
    assert [each.status for each in ended.plans] == [Status.COMPLETED]


def test_what_a_crash_left_goes_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from gpsfsm.execution.journal import RunWriter

    journal, write = tmp_path / "run.db", RunWriter.write

    def dies(self: RunWriter, at_us: int, happened: object, records: object) -> None:
        if at_us > 500_000:
            raise KeyboardInterrupt
        write(self, at_us, happened, records)  # type: ignore[arg-type]

    with monkeypatch.context() as patched:
        patched.setattr(RunWriter, "write", dies)
        with pytest.raises(KeyboardInterrupt):
            gpsfsm.run(GO, world=HOME, journal=journal)
    with pytest.raises(UsageError, match="is simulated"):
        gpsfsm.run(journal=journal, real=True)
    result = gpsfsm.run(journal=journal)
    assert result.status is Status.COMPLETED
    whole = gpsfsm.run(GO, world=HOME)
    of_both = [[(row.at_us, row.kind) for row in each.plans[0].events] for each in (result, whole)]
    assert of_both[0] == of_both[1]
    with pytest.raises(InputError):
        gpsfsm.run(journal=tmp_path / "other.db")


@pytest.mark.parametrize("real", [False, True])
def test_an_event_loop_goes_on_meanwhile(real: bool) -> None:
    async def both() -> tuple[gpsfsm.running.run.RunResult, int]:  # type: ignore[name-defined]
        ticks = 0

        async def tick() -> None:
            nonlocal ticks
            while True:
                await asyncio.sleep(0.01)
                ticks += 1

        ticking = asyncio.create_task(tick())
        text = plan(step(WAIT, seconds=0.2))
        result = await (
            gpsfsm.run_async(text, real=True) if real else gpsfsm.run_async(text, world=HOME)
        )
        ticking.cancel()
        return result, ticks

    result, ticks = asyncio.run(both())
    assert result
    assert ticks > 0


def test_another_thread_interrupts() -> None:
    interruption = Interruption()
    timer = threading.Timer(0.5, interruption.request)
    timer.start()
    result = gpsfsm.run(plan(step(WAIT, seconds=600)), real=True, interruption=interruption)
    assert result.status is Status.CANCELLED


@pytest.mark.parametrize(
    "wrong",
    [
        {"world": HOME, "real": True},
        {"failure": 0.1, "real": True},
        {"task": "go"},
        {"plan": None},
        {"plan": []},
    ],
)
def test_contradictions_are_misuse(wrong: dict[str, object]) -> None:
    with pytest.raises(UsageError):
        gpsfsm.run(**{"plan": GO, **wrong})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "wrong",
    [
        {"plan": 5},
        {"plan": [5]},
        {"plan": bytearray(b"<Plan/>")},
        {"world": 5},
        {"world": b"a: 1"},
        {"world": ""},
        {"journal": 5},
        {"journal": ""},
        {"durability": "paper"},
        {"seed": "7"},
        {"seed": True},
        {"failure": 2.0},
        {"failure": "0.1"},
        {"timeout_s": -1},
        {"timeout_s": float("nan")},
        {"max_plans": 0},
        {"max_plans": "3"},
        {"capabilities": "folder"},
        {"capabilities": [5]},
        {"runners": [Drives]},
        {"runners": {DRIVE: object}},
        {"runners": {DRIVE: Drives()}},
        {"runners": {5: Drives}},
        {"runners": {"nav2_capabilities/Typo": Drives}},
        {"model": 5, "real": True},
        {"model": "", "real": True},
        {"task": 5, "model": "replay:none", "real": True},
        {"real": "no"},
        {"interruption": 3},
    ],
)
def test_wrong_values_are_misuse_and_make_no_journal(
    wrong: dict[str, object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(UsageError):
        gpsfsm.run(**{"plan": GO, "journal": "run.db", **wrong})  # type: ignore[arg-type]
    assert not [*tmp_path.iterdir()]


@pytest.mark.parametrize("acting", [{"real": True}, {"world": HOME, "model": Scripted("")}])
def test_an_event_loop_of_the_caller_is_not_held_up(
    acting: dict[str, object], tmp_path: Path
) -> None:
    """Outcomes that are drawn need no loop: they also run in a notebook, say."""

    async def inside(**how: object) -> gpsfsm.RunResult:
        return gpsfsm.run(GO, **how)  # type: ignore[arg-type]

    with pytest.raises(UsageError, match=r"await gpsfsm\.run_async"):
        asyncio.run(inside(journal=tmp_path / "run.db", **acting))
    assert not [*tmp_path.iterdir()]
    assert asyncio.run(inside(failure=0.0))


def test_texts_and_paths_in_one_list(tmp_path: Path) -> None:
    file = tmp_path / "a.xml"
    file.write_text(GO, encoding="utf-8")
    result = gpsfsm.run([GO, file, GO.encode()], failure=0.0)
    assert [each.name for each in result.plans] == ["<text>", str(file), "<text>"]
    assert result


def test_an_interruption_outlives_its_run() -> None:
    """Whoever holds it may request it, or let it pause, when nothing runs any more."""
    interruption, text = Interruption(), plan(step(WAIT, seconds=0.01))
    assert gpsfsm.run(text, real=True, interruption=interruption)
    interruption.toggle()
    interruption.request()
    assert gpsfsm.run(text, real=True, interruption=interruption).status is Status.CANCELLED


@pytest.mark.parametrize("how", [{"real": True}, {"failure": 0.0}])
def test_runs_in_other_threads(how: dict[str, object]) -> None:
    """They set no handlers of signals, which only the main thread may."""
    results = []

    def work() -> None:
        results.append(gpsfsm.run(plan(step(WAIT, seconds=0.01)), **how))  # type: ignore[arg-type]

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert [bool(each) for each in results] == [True]


@pytest.mark.parametrize("real", [False, True])
def test_a_task_that_is_cancelled_cancels_its_run(tmp_path: Path, real: bool) -> None:
    journal = tmp_path / "run.db"
    text = plan(*[step(WAIT, seconds=600)] * (1 if real else 1500))

    async def cancel() -> None:
        running = asyncio.create_task(gpsfsm.run_async(text, journal=journal, real=real))
        while not _has_begun(journal) and not running.done():
            await asyncio.sleep(0.05)
        running.cancel()
        with pytest.raises(asyncio.CancelledError):
            await running

    asyncio.run(cancel())
    with JournalReader(str(journal)) as reader:
        assert reader.run(1).status is Status.CANCELLED
    assert not gpsfsm.run(journal=journal, real=real)  # nobody holds the journal any more


def _has_begun(journal: Path) -> bool:
    try:
        with JournalReader(str(journal)) as reader:
            return reader.has_runs()
    except GpsfsmError:  # there is none yet
        return False


def test_messages_name_arguments_of_python() -> None:
    """Nobody who calls a function can add an option to a command line."""
    refused = gpsfsm.run("<Plan><Runner/></Plan>")
    assert "force=True runs it" in refused.plans[0].summary
    undescribed = gpsfsm.run(plan(step("a/Go")), real=True)
    asking = gpsfsm.run(plan(step(ASK, text="a")), real=True)
    assert "name one with model=" in asking.plans[0].summary
    for result in (refused, undescribed, asking):
        assert result.status is Status.REFUSED
        ending = result.plans[0]
        assert "--" not in "\n".join((ending.summary, *ending.findings, *result.notices))


def test_results_are_data_with_the_events_that_the_command_prints(tmp_path: Path) -> None:
    file = tmp_path / "plan.xml"
    file.write_text(GO)
    result = gpsfsm.run(file, failure=0.0, seed=3)
    data = json.loads(json.dumps(result.to_dict()))
    assert (data["completed"], data["status"], data["journal"]) == (True, "COMPLETED", "")
    printed = cli("run", str(file), "--failure", "0", "--seed", "3", "--format", "json").stdout
    events = [json.loads(line) for line in printed.splitlines()]
    assert data["plans"][0]["events"] == [each for each in events if "seq" in each]
    refused = gpsfsm.run("<Plan><Runner/></Plan>").to_dict()
    assert refused["completed"] is False
    assert [each["status"] for each in refused["plans"]] == ["REFUSED"]
    assert refused["plans"][0]["findings"]
