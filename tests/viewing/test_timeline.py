"""The timeline of a run: who was active when, which joins waited, and how each came to its end."""

from __future__ import annotations

import shutil
from typing import Any

import pytest

from tests.conftest import REPO
from tests.viewing.support import in_node, only

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")

_RUNNER = '<Runner interface="a/{0}" provider="a/{0}"/>'
_BOTH = (
    f'<Plan><Control type="parallel_all">{_RUNNER.format("A")}{_RUNNER.format("B")}</Control>'
    f"{_RUNNER.format('C')}</Plan>"
)
_STARTS = {"TRIGGERED", "STARTED"}
_ENDS = {"SUCCEEDED": "succeeded", "FAILED": "failed", "STOPPED": "stopped"}


def rows_of(*cases: dict[str, Any]) -> list[list[dict[str, Any]]]:
    rows: list[list[dict[str, Any]]] = in_node("timeline.mjs", cases)
    return rows


def plays_of_the_corpus() -> list[tuple[dict[str, Any], list[dict[str, Any]]]]:
    plans = [
        only(file.read_text(encoding="utf-8"))
        for file in sorted((REPO / "corpus" / "plans").glob("*.xml"))
    ]
    return [
        (plan["automaton"], play["records"])
        for plan in plans
        if plan["automaton"]
        for play in plan["plays"]
    ]


def test_bars_begin_and_end_where_the_records_say() -> None:
    plays = plays_of_the_corpus()
    assert len(plays) > 10
    cases = [{"automaton": data, "records": records, "folded": []} for data, records in plays]
    for (automaton, records), rows in zip(plays, rows_of(*cases), strict=True):
        runners = {
            row["node"]: row["bars"]
            for row in rows
            if automaton["nodes"][row["node"]]["kind"] == "runner"
        }
        acting: dict[int, list[tuple[int, int, str]]] = {}
        since: dict[int, int] = {}
        for place, record in enumerate(records):
            if record["kind"] == "STARTED":
                since[record["node"]] = place
            elif record["kind"] in _ENDS and record["node"] in since:
                bar = (since.pop(record["node"]), place, _ENDS[record["kind"]])
                acting.setdefault(record["node"], []).append(bar)
        for node, begun in since.items():
            acting.setdefault(node, []).append((begun, -1, ""))
        drawn = {
            node: [(b["from"], b["to"], b["end"]) for b in bars if b["state"] == "running"]
            for node, bars in runners.items()
        }
        assert {node: bars for node, bars in drawn.items() if bars} == acting


def _run(*events: tuple[str, int]) -> list[dict[str, Any]]:
    return [
        {"kind": kind, "node": node, "at_us": place} for place, (kind, node) in enumerate(events)
    ]


def test_a_join_waits_from_its_first_input_until_it_fires_or_for_ever() -> None:
    automaton = only(_BOTH)["automaton"]
    nodes = automaton["nodes"]
    joins = {
        (number in automaton["failing"]): number
        for number, node in enumerate(nodes)
        if node["kind"] == "join" and node["element"] == 1
    }
    both = _run(
        ("STARTED", 1), ("STARTED", 2), ("SUCCEEDED", 1), ("SUCCEEDED", 2), ("JOINED", joins[False])
    )
    one = _run(
        ("STARTED", 1), ("STARTED", 2), ("SUCCEEDED", 1), ("FAILED", 2), ("JOINED", joins[True])
    )
    one.append({"kind": "ENDED", "node": -1, "at_us": 9, "data": {"status": "GAVE_UP"}})
    fired, stuck = rows_of(
        {"automaton": automaton, "records": both, "folded": []},
        {"automaton": automaton, "records": one, "folded": []},
    )
    (waits,) = [row["bars"] for row in fired if row["node"] == joins[False]]
    assert waits == [{"from": 2, "to": 4, "state": "waiting", "end": "fired"}]
    (waits,) = [row["bars"] for row in stuck if row["node"] == joins[False]]
    assert waits == [{"from": 2, "to": -1, "state": "waiting", "end": ""}]


def test_a_join_that_waits_when_a_run_is_stuck_has_its_own_end() -> None:
    automaton = only(_BOTH)["automaton"]
    records = _run(("STARTED", 1), ("STARTED", 2), ("SUCCEEDED", 1))
    ended = [
        {"kind": "ENDED", "node": -1, "at_us": 9, "data": {"status": status}}
        for status in ("STUCK", "HANG", "COMPLETED")
    ]
    made = rows_of(
        *({"automaton": automaton, "records": [*records, end], "folded": []} for end in ended)
    )
    ends = [
        [bar["end"] for row in rows for bar in row["bars"] if bar["state"] == "waiting"]
        for rows in made
    ]
    assert ends == [["stuck"], ["stuck"], [""]]


def test_what_is_folded_is_one_row() -> None:
    automaton = only(_BOTH)["automaton"]
    records = _run(("STARTED", 1), ("STARTED", 2), ("SUCCEEDED", 1), ("FAILED", 2))
    (rows,) = rows_of({"automaton": automaton, "records": records, "folded": [0]})
    (row,) = [row for row in rows if row["group"] == 0]
    assert (row["bars"][0]["from"], row["count"]) == (
        0,
        len(rows_of({"automaton": automaton, "records": records, "folded": []})[0]),
    )
