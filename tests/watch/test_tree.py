"""The plan as a tree with states."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.records import Input, Kind, Record
from gpsfsm.watch.live import LiveTree, State, Tree
from tests.watch.support import Watched, runner, watch

if TYPE_CHECKING:
    from collections.abc import Sequence

PLAN = f"""<Plan>
{runner(takes="2")}
<Control type="parallel_any">
{runner("One", takes="1", message="no")}
{runner("Two", takes="3")}
</Control>
<Control type="recovery">{runner("Three")}</Control>
</Plan>"""


def test_states_follow_the_run() -> None:
    seen: list[list[State | None]] = []
    took: list[str] = []

    def follow(run: Watched):  # type: ignore[no-untyped-def]
        tree = Tree(run.kernel.automaton)

        def add(at_us: int, _: Input, records: Sequence[Record]) -> None:
            tree.add(at_us, records)
            states = [line.state for line in tree.lines(at_us)]
            if not seen or seen[-1] != states:
                seen.append(states)
            took[:] = [line.took for line in tree.lines(at_us)]

        return add

    watch(PLAN, follow)
    waiting, active, ok, bad = State.WAITING, State.ACTIVE, State.SUCCEEDED, State.FAILED
    loading = State.LOADING
    # plan, Go, parallel_any, One, Two, recovery, Three
    assert seen == [
        [None, loading, None, waiting, waiting, None, waiting],
        [active, active, None, waiting, waiting, None, waiting],
        [None, ok, None, loading, loading, None, waiting],
        [active, ok, active, active, loading, None, waiting],
        [active, ok, active, active, active, None, waiting],
        [active, ok, active, bad, active, None, waiting],
        [None, ok, None, bad, ok, None, waiting],
    ]
    assert took == ["", "2.000 s", "", "1.000 s", "3.000 s", "", ""]


def test_some_lines_only() -> None:
    tree = Tree(Watched(PLAN).kernel.automaton)
    everything = tree.lines(0)
    assert len(tree) == len(everything) == 7
    assert tree.lines(0, 2, 3) == everything[2:5]
    assert tree.lines(0, 5, 30) == everything[5:]
    assert everything[1].text == "2  ├── a/Go takes=2"


def test_what_acts_shows_for_how_long() -> None:
    tree = Tree(Watched(PLAN).kernel.automaton)
    tree.add(1_000_000, [Record(Kind.STARTED, 1)])
    assert tree.lines(3_500_000)[1].took == "2.500 s"


@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_the_picture_on_a_terminal(encoding: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    monkeypatch.setenv("LINES", "30")
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding=encoding, errors="replace")
    run = Watched(PLAN)
    with LiveTree(run.words, stream, color=False) as live:
        run.driver.watchers.append(live)
        run.driver.run()
    stream.flush()
    last = raw.getvalue().decode(encoding)
    good, bad = ("✓", "✗") if encoding == "utf-8" else ("+", "x")
    assert f"{good}    2.000 s  2" in last
    assert f"{bad}    1.000 s  4" in last
    assert "4.000 s  line 4" not in last  # One failed at 3 s
    assert "3.000 s  line 4  One (takes=1, message=no) failed: no" in last
    assert "5.000 s  3 started, 2 succeeded, 1 failed" in last


def test_a_high_tree_is_shown_where_something_happens(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv("LINES", "12")
    many = "\n".join(runner(f"R{number}") for number in range(300))
    raw = io.BytesIO()
    stream = io.TextIOWrapper(raw, encoding="utf-8")
    run = Watched(f"<Plan>\n{many}\n</Plan>")
    with LiveTree(run.words, stream, color=False) as live:
        run.driver.watchers.append(live)
        run.driver.run()
    stream.flush()
    last = raw.getvalue().decode()[-1000:]
    assert "a/R299" in last
    assert "a/R200" not in last
    assert " of 301 elements are shown" in last
