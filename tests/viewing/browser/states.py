"""What the page must show after some records, worked out from the contract by brute force.

Nothing is kept between two places: every place is computed from the first record on. That is slow
and simple, and shares nothing with the page's own modules.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

__all__ = ["Shown", "shown_after"]

Shown = dict[str, list[Any]]
"""``states``: [node, state, count] of nodes that are not idle; ``taken``: numbers of edges."""

_ASIDE = ("LOG", "NOTE", "CONTINUED", "RESTARTED")
_STATES = {
    "TRIGGERED": "triggered",
    "HELD": "triggered",
    "STARTED": "running",
    "SUCCEEDED": "succeeded",
    "FAILED": "failed",
    "TIMEOUT": "timeout",
    "STOPPED": "stopped",
}


def shown_after(
    automaton: Mapping[str, Any], records: Sequence[Mapping[str, Any]], count: int
) -> Shown:
    """The states and the taken edges after the first ``count`` records."""
    happened = [
        record
        for record in records[:count]
        if record.get("record", True) and record["kind"] not in _ASIDE
    ]
    taken = _taken(automaton, happened)
    states = [
        [number, *state]
        for number, node in enumerate(automaton["nodes"])
        if (state := _state(automaton, number, node, happened, taken)) is not None
    ]
    return {"states": states, "taken": sorted(taken)}


def _taken(automaton: Mapping[str, Any], records: Sequence[Mapping[str, Any]]) -> set[int]:
    """Edges whose source has emitted their event before the run was over."""
    taken: set[int] = set()
    nodes = automaton["nodes"]
    emitted = [(0, "SUCCEEDED")] if _has_begun(records) else []
    ends = {number for number, node in enumerate(nodes) if node["kind"] in ("complete", "give_up")}
    last = -1
    for place, (source, event) in _events(automaton, records, emitted):
        over = any(automaton["edges"][edge]["target"] in ends for edge in taken)
        over = over or any(
            each["kind"] in ("CANCEL", "SILENCE", "ENDED") for each in records[:place]
        )
        if over:
            break
        assert place >= last
        last = place
        taken |= {
            number
            for number, edge in enumerate(automaton["edges"])
            if (edge["source"], edge["event"]) == (source, event)
        }
    return taken


def _has_begun(records: Sequence[Mapping[str, Any]]) -> bool:
    return any(record["kind"] not in ("CANCEL", "SILENCE") for record in records)


def _events(
    automaton: Mapping[str, Any],
    records: Sequence[Mapping[str, Any]],
    first: list[tuple[int, str]],
) -> list[tuple[int, tuple[int, str]]]:
    events = [(0, each) for each in first]
    for place, record in enumerate(records):
        node, kind = record.get("node", -1), record["kind"]
        if kind == "JOINED":
            events.append((place, (node, "SUCCEEDED")))
        elif kind in ("STARTED", "SUCCEEDED", "FAILED") and not _mute(
            automaton, records[:place], record
        ):
            events.append((place, (node, kind)))
    return events


def _mute(
    automaton: Mapping[str, Any],
    before: Sequence[Mapping[str, Any]],
    record: Mapping[str, Any],
) -> bool:
    node = record["node"]
    if record["kind"] == "STARTED":
        return node in automaton.get("silent", ())
    if record["kind"] != "FAILED" or not automaton.get("refusals_hang"):
        return False
    return not any(each["kind"] == "STARTED" and each.get("node") == node for each in before)


def _state(
    automaton: Mapping[str, Any],
    number: int,
    node: Mapping[str, Any],
    records: Sequence[Mapping[str, Any]],
    taken: set[int],
) -> tuple[str, int] | None:
    state = _untimely(number, node, records, automaton, taken)
    end = next((record for record in records if record["kind"] == "ENDED"), None)
    if end is None:
        return state
    if state is None:
        return "never", 0
    waits_for_ever = (end.get("data") or {}).get("status") in ("STUCK", "HANG")
    return ("stuck", state[1]) if state[0] == "waiting" and waits_for_ever else state


def _untimely(
    number: int,
    node: Mapping[str, Any],
    records: Sequence[Mapping[str, Any]],
    automaton: Mapping[str, Any],
    taken: set[int],
) -> tuple[str, int] | None:
    """The state if the run has not ended."""
    kind = node["kind"]
    if kind == "start":
        return ("succeeded", 0) if _has_begun(records) else None
    arrived = sum(automaton["edges"][edge]["target"] == number for edge in taken)
    own = [record["kind"] for record in records if record.get("node", -1) == number]
    if kind == "join":
        if "JOINED" in own:
            return "fired", arrived
        return ("waiting", arrived) if arrived else None
    if kind in ("complete", "give_up"):
        return ("reached", 0) if arrived else None
    own = [each for each in own if each in _STATES]
    if not own:
        return None
    return ("timeout" if "TIMEOUT" in own else _STATES[own[-1]]), 0
