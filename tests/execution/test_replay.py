"""A journaled run replays byte by byte, and whatever was changed shows."""

from __future__ import annotations

from random import Random
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal_errors import DamagedJournalError, ReplayDivergence
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.journal_rows import line
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Left, Status
from gpsfsm.execution.replay import replay
from tests.execution.journaling import compiled, run_journaled

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.execution.journal_rows import Row


@pytest.fixture(name="rows", scope="module")
def rows_(tmp_path_factory: pytest.TempPathFactory) -> list[Row]:
    path = tmp_path_factory.mktemp("replay") / "j.db"
    run_journaled(path, seed=10)
    with JournalReader(str(path)) as reader:
        return list(reader.events(1))


def replayed(rows: list[Row]) -> tuple[Kernel, Left]:
    kernel = Kernel(compiled())
    return kernel, replay(kernel, rows)


def test_a_run_replays(rows: list[Row]) -> None:
    kernel, left = replayed(rows)
    assert kernel.status is Status.COMPLETED
    assert left == Left(rows[-1].at_us, (), (), ())


def test_every_beginning_replays_to_what_was_left(tmp_path: Path) -> None:
    path = tmp_path / "j.db"
    seen_loading = 0
    for seed in range(6):
        run_journaled(path, seed=seed)
        with JournalReader(str(path)) as reader:
            rows = list(reader.events(reader.run().number))
        for last in [row.seq - 1 for row in rows if row.input]:
            kernel, left = replayed(rows[:last])
            active, loaded, loading = by_hand(rows[:last])
            assert [start.number + 1 for start in left.active] == active
            assert list(left.loaded) == loaded
            assert list(left.loading) == loading
            assert left.at_us == (rows[last - 1].at_us if last else 0)
            assert not kernel.status.ended
            seen_loading += bool(loading)
    assert seen_loading > 6


def by_hand(rows: list[Row]) -> tuple[list[int], list[int], list[int]]:
    """Instances that act, runners that are loaded and those being loaded, from the events."""
    active, loaded, loading = [], [], []
    for row in rows:
        if row.kind == "STARTED":
            active.append(row.node)
        elif row.record and row.kind in ("SUCCEEDED", "FAILED", "STOPPED"):
            active.remove(row.node)
        elif row.kind == "LOADING":
            loading.append(row.runner)
        elif row.kind == "LOADED":
            loading.remove(row.runner)
            loaded.append(row.runner)
        elif row.kind == "UNLOADED":
            loaded.remove(row.runner)
    return active, loaded, loading


def test_starts_have_their_parameters(rows: list[Row]) -> None:
    actual = {}
    for last in [row.seq - 1 for row in rows if row.input]:
        actual.update({start.number: start for start in replayed(rows[:last])[1].active})
    assert actual[1].parameters == {
        "x": 1.5,
        "text": "grüß 日本",
        "list": ["é", True, 3],
        "value": actual[1].parameters["value"],
    }


@pytest.mark.parametrize("seed", range(30))
def test_a_change_shows_where_it_is(rows: list[Row], seed: int) -> None:
    # A changed input may replay: it is another run then. That shows in the chain of hashes.
    rng = Random(seed)  # noqa: S311
    place = rng.choice([place for place, row in enumerate(rows) if not row.input])
    row = rows[place]
    changes = {
        "at_us": row.at_us + 1,
        "kind": "JOINED",
        "message": "so to speak",
        "data": '{"status":"GAVE_UP"}',
        "cause": row.cause + 1,
        "node": 2 if row.node != 2 else 3,
    }
    name = rng.choice([*changes])
    changed = row._replace(**{name: changes[name]})
    with pytest.raises(ReplayDivergence) as caught:
        replayed([*rows[:place], changed, *rows[place + 1 :]])
    assert caught.value.seq == row.seq
    assert caught.value.expected == line(changed)
    assert caught.value.got == line(row)
    assert f"at event {row.seq}:" in str(caught.value)


def test_an_event_too_few_or_too_many(rows: list[Row]) -> None:
    follows = next(place for place, row in enumerate(rows) if not row.input)
    with pytest.raises(ReplayDivergence) as caught:
        replayed(rows[: follows + 1])
    assert (caught.value.expected, caught.value.seq) == ("", rows[follows].seq + 1)
    assert "journal: nothing more" in str(caught.value)
    more = rows[-1]._replace(seq=rows[-1].seq + 1)
    with pytest.raises(ReplayDivergence, match="replay:  nothing more"):
        replayed([*rows, more])


def test_another_plan_does_not_replay(rows: list[Row]) -> None:
    kernel = Kernel(compiled('<Plan><Runner interface="a" provider="other"/></Plan>'))
    with pytest.raises(ReplayDivergence):
        replay(kernel, rows)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"kind": "DANCED"}, "unknown kind DANCED"),
        ({"node": 99}, "a runner that the plan does not have"),
        ({"node": 0}, "a runner that the plan does not have"),
        ({"runner": 99}, "a runner that the plan does not have"),
        ({"kind": "STARTED"}, "cannot have happened"),
        ({"kind": "LOADED", "runner": 2}, "cannot have happened"),
        ({"data": "{"}, "damaged"),
        ({"data": "[]"}, "damaged"),
    ],
)
def test_impossible_inputs_are_damage(
    rows: list[Row], change: dict[str, object], words: str
) -> None:
    place = next(place for place, row in enumerate(rows) if row.input and row.node > 0)
    changed = rows[place]._replace(record=False, **change)  # type: ignore[arg-type]
    with pytest.raises(DamagedJournalError, match=words):
        replayed([*rows[:place], changed])
