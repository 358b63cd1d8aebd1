"""Runs that a client meddles with: paused, stepped, slowed down, an instance made to fail."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.capabilities.table import dump
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.journal_rows import Row, RowMaker, line
from gpsfsm.execution.records import Status
from gpsfsm.execution.replay import Comparing, replay, simulate_again
from gpsfsm.running import pace
from gpsfsm.running.drivers import MAPPED, simulated_driver
from gpsfsm.running.history import Begun, simulated_world
from gpsfsm.running.pace import FAIL, PAUSE, RESUME, SPEED, STEP, ClientPace, Clock, note
from gpsfsm.running.prepare import DRAWN, WORLD, prepare
from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Input, Record
    from gpsfsm.running.prepare import Prepared

LIBRARY = choose_capabilities(()).library
SEED = 5
HOME = (REPO / "corpus" / "worlds" / "home.yaml").read_bytes()
WAIT = '<Runner interface="a/Wait" provider="a/Wait" n="{}"/>'
THREE = "<Plan>" + "".join(WAIT.format(n) for n in range(3)) + "</Plan>"
WAYPOINT = "nav2_capabilities/WaypointRunner"
SPEECH = "perception_capabilities/SpeechRunner"
TOUR = f"""<Plan>
<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="2.0" y="-0.5"/>
<Control type="parallel_all">
<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="0.0" y="0.0"/>
<Runner interface="{SPEECH}" provider="{SPEECH}" text="Hello, who are you?"/>
</Control>
<Control type="recovery">
<Runner interface="{SPEECH}" provider="{SPEECH}" text="I could not do it."/>
</Control>
</Plan>"""


class Wall:
    """The time on the wall, which passes only while somebody sleeps."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def monotonic(self) -> float:
        return self.now_s

    def sleep(self, seconds: float) -> None:
        self.now_s += seconds


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Wall:
    wall = Wall()
    monkeypatch.setattr(pace, "time", wall)
    return wall


class Killed(KeyboardInterrupt):
    """The process ends."""


@dataclass
class Rows:
    """A journal in memory; after ``most`` events the process ends."""

    kernel: Kernel
    rows: list[Row] = field(default_factory=list)
    most: float = float("inf")

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        if len(self.rows) >= self.most:
            raise Killed
        self.rows += RowMaker(self.kernel, len(self.rows)).make(at_us, happened, records)


def prepared(text: str = THREE, mode: str = DRAWN, seed: int = 3) -> Prepared:
    options: dict[str, Any] = {MAPPED: True} if mode == WORLD else {"failure": 0.0}
    heading = Heading(
        plan=text.encode(),
        capabilities=dump(LIBRARY),
        world=HOME if mode == WORLD else b"",
        seed=seed,
        mode=mode,
        options=options,
    )
    return prepare(heading, LIBRARY)


@dataclass
class Run:
    """A run, new or taken up again; ``act`` is called whenever somebody could do something."""

    prepared: Prepared
    past: list[Row] = field(default_factory=list)
    most: float = float("inf")
    speed: float = 0.0
    paused: bool = False

    def __post_init__(self) -> None:
        self.kernel = self.prepared.kernel()
        self.journal = Rows(self.kernel, list(self.past), self.most)
        self.sink = Comparing(self.kernel, self.past, self.journal)  # type: ignore[arg-type]
        self.pace = ClientPace(speed=self.speed, paused=self.paused)
        self.pace.past = self.sink
        self.driver = simulated_driver(
            *(self.prepared, self.kernel, self.sink, self.pace), rows=self.past
        )

    def go(self, act: Callable[[ClientPace], object] = lambda _: None) -> list[Row]:
        self.pace.tick = lambda _: act(self.pace)
        simulate_again(self.driver, self.sink)
        return self.journal.rows


def agrees(of: Prepared, rows: list[Row]) -> None:
    """What the journal says can be replayed and simulated again."""
    replay(of.kernel(), rows)
    run: StoredRun = None  # type: ignore[assignment]  # nobody asks for it
    simulated_world([Begun(run, of, rows, [])], print)


def test_a_pause_stops_the_clock_and_changes_nothing(clock: Wall) -> None:
    plain = Run(prepared()).go()
    times: list[float] = []

    def act(pace: ClientPace) -> None:
        now_s = clock.now_s - 100.0
        if now_s >= 0.5 and not times:
            times.append(now_s)
            assert pace.wish(note(PAUSE)) == ""
        elif now_s >= 30 and len(times) == 1:
            times.append(now_s)
            assert pace.clock.paused
            assert pace.clock_us() == pytest.approx(1_000_000, abs=150_000)
            pace.wish(note(RESUME))

    run = Run(prepared(), speed=2.0)
    rows = run.go(act)
    assert len(times) == 2
    marks = [row for row in rows if row.kind == "NOTE"]
    assert [row.values["control"] for row in marks] == ["pause", "resume"]
    assert marks[0].at_us == marks[1].at_us  # however long it took
    others = [row for row in rows if row.kind != "NOTE"]
    assert [(r.kind, r.node, r.at_us) for r in others] == [(r.kind, r.node, r.at_us) for r in plain]
    took_s = clock.now_s - 100.0 - (times[1] - times[0])
    assert took_s == pytest.approx(plain[-1].at_us / 2e6, abs=0.3)
    agrees(run.prepared, rows)


def test_steps_let_single_events_happen(clock: Wall) -> None:
    seen: list[int] = []
    run = Run(prepared(THREE.replace("</Plan>", WAIT.format(3) + WAIT.format(4) + "</Plan>")))
    run.pace.clock.paused = True

    def act(pace: ClientPace) -> None:
        seen.append(run.driver.inputs)
        clock.now_s += 1
        pace.wish(note(STEP, events=2 if len(seen) == 3 else 1))

    rows = run.go(act)
    assert seen == [1, 2, 3, 5, 6]  # the beginning, a runner that is loaded, five outcomes
    assert run.kernel.status is Status.COMPLETED
    agrees(run.prepared, rows)


def test_the_speed_changes_on_the_way(clock: Wall) -> None:
    run = Run(prepared(), speed=0.001)
    rows = run.go(lambda pace: pace.wish(note(SPEED, speed=0.0)))
    assert clock.now_s < 101
    assert run.pace.clock.speed == 0.0
    agrees(run.prepared, rows)


@pytest.mark.usefixtures("clock")
def test_an_instance_fails_when_somebody_wants_it() -> None:
    of = prepared(TOUR, WORLD)
    run = Run(of, speed=1.0)

    def act(pace: ClientPace) -> None:
        if pace.clock_us() < 2_000_000 or run.sink.next is not None or pace.clock.paused:
            return
        assert pace.wish(note(FAIL, number=1, message="x")) == "this runner is not running"
        assert pace.wish(note(FAIL, number=0, message="somebody is in the way")) == ""
        pace.wish(note(SPEED, speed=0.0))

    rows = run.go(act)
    made = next(row for row in rows if row.kind == "NOTE")
    assert (made.node, made.values["control"]) == (1, "fail")
    where = rows[made.seq]  # the robot stays where it was then
    assert where.values["world"] == "pose"
    assert 0.1 < where.values["x"] < 1.9
    failed = rows[made.seq + 1]
    assert (failed.kind, failed.node, failed.message) == ("FAILED", 1, "somebody is in the way")
    assert failed.at_us == made.at_us
    assert run.kernel.status is Status.GAVE_UP
    agrees(of, rows)


def test_a_run_that_somebody_meddled_with_goes_on_wherever_its_process_ends(clock: Wall) -> None:
    """Wherever it ends, also between what somebody does and what follows from that."""
    of = prepared(TOUR, WORLD)
    chance = random.Random()  # noqa: S311

    def act(pace: ClientPace) -> None:
        what = chance.choice((PAUSE, STEP, RESUME, RESUME, SPEED, FAIL, *[""] * 24))
        if what == FAIL:  # not the first one, or it would be over too soon
            pace.wish(note(FAIL, number=chance.choice((1, 2, 3)), message="no"))
        elif what:
            pace.wish(note(what, speed=3.0))

    chance.seed(SEED)
    whole = Run(of, speed=2.0).go(act)
    assert any(row.kind == "NOTE" and row.values["control"] == FAIL for row in whole)
    agrees(of, whole)
    last = max(row.seq for row in whole if row.input)
    for most in range(1, last, 1 + len(whole) // 12):
        first, clock.now_s = Run(of, speed=2.0, most=most), 100.0
        first.pace.clock.anchor(0)
        chance.seed(SEED)
        with pytest.raises(Killed):
            first.go(act)
        left = first.journal.rows
        assert [line(row) for row in left] == [line(row) for row in whole[: len(left)]]
        again = Run(of, past=left, speed=2.0)
        rows = again.go(lambda pace: pace.clock.paused and pace.wish(note(RESUME)))
        assert [line(row) for row in rows[: len(left)]] == [line(row) for row in left]
        assert again.kernel.status.ended
        done = [row.values["control"] for row in left if row.kind == "NOTE"]
        if done and done[-1] == PAUSE:  # it was paused, and still was when it went on
            assert rows[len(left)].values["control"] == RESUME
        agrees(of, rows)


def test_who_asks_is_told_when_it_is_in_the_journal() -> None:
    run = Run(prepared(), paused=True)
    answers: list[tuple[str, list[str]]] = []

    def act(pace: ClientPace) -> None:
        for what in (SPEED, RESUME):
            assert pace.wish(note(what), lambda why: answers.append((why, controls()))) == ""
        assert not answers  # if the process ended now, nobody would have been told anything

    def controls() -> list[str]:
        return [str(row.values["control"]) for row in run.journal.rows if row.kind == "NOTE"]

    run.go(act)
    assert answers == [("", [SPEED]), ("", [SPEED, RESUME])]


@pytest.mark.usefixtures("clock")
def test_nothing_is_done_behind_what_ends_the_run() -> None:
    of = prepared(TOUR, WORLD)
    run = Run(of, speed=1.0)
    events: list[str] = []

    def act(pace: ClientPace) -> None:
        if pace.clock_us() >= 1_000_000:
            pace.wish(note(FAIL, number=0, message="it is over"), events.append)
            pace.wish(note(FAIL, number=0, message="once more"), events.append)
            pace.wish(note(PAUSE), events.append)

    rows = run.go(act)
    assert events == ["", "the run is about to end", "the run is about to end"]
    assert run.kernel.status is Status.GAVE_UP
    assert [row.message for row in rows if row.kind == "NOTE"] == ["it is over"]
    agrees(of, rows)


def test_what_is_cancelled_does_not_wait(clock: Wall) -> None:
    run = Run(prepared(), paused=True)

    def act(pace: ClientPace) -> None:
        pace.release()
        pace.driver.at(pace.driver.now_us(), lambda: pace.driver.cancel("enough"))
        assert pace.wish(note(RESUME)) == "the run is about to end"

    rows = run.go(act)
    assert run.kernel.status is Status.CANCELLED
    assert clock.now_s < 101
    agrees(run.prepared, rows)


def test_a_run_that_is_late_does_not_hurry(clock: Wall) -> None:
    pace = Clock(speed=2.0)
    pace.anchor(0)
    clock.now_s += 10  # a model has thought
    assert pace.clock_us(1_000_000) == 20_000_000
    pace.happened(1_000_000)
    assert pace.clock_us(1_000_000) == 1_000_000
    clock.now_s += 0.2
    pace.happened(1_300_000)  # a little late: nothing is done about that
    assert pace.clock_us(1_300_000) == 1_400_000


@pytest.mark.usefixtures("clock")
def test_notes_that_make_no_sense_do_no_harm() -> None:
    run = Run(prepared())
    for data in ({"control": SPEED, "speed": "fast"}, {"control": STEP, "events": [1]}):
        run.driver.mark(note(PAUSE).__class__(note(PAUSE).kind, outputs=data))
    run.driver.mark(note(FAIL, number=2, message="it does not run"))
    assert run.pace.clock.speed == 0.0
