"""What the tests of views share: documents of texts, and what must hold of every document."""

from __future__ import annotations

import json
import subprocess
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jsonschema

from gpsfsm.api import check_options
from gpsfsm.checking import check_text, unreadable
from gpsfsm.viewing.document import document
from gpsfsm.viewing.page import packed, unpacked
from gpsfsm.viewing.plans import Viewed

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.checking import CheckOptions

__all__ = ["document_of", "holds", "in_node", "kinds", "only", "viewed"]

_SCHEMA = json.loads(
    (resources.files("gpsfsm.viewing") / "gpsfsm-view-3.schema.json").read_text(encoding="utf-8")
)
_VALIDATOR = jsonschema.Draft202012Validator(_SCHEMA)


def in_node(script: str, value: object) -> Any:
    """The answer of a script beside this module, which imports modules of the pages."""
    folder = Path(__file__).parent
    done = subprocess.run(
        ["node", folder / script, str(folder.parents[1] / "gpsfsm" / "viewing" / "web")],
        input=json.dumps(value),
        capture_output=True,
        text=True,
        check=False,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def viewed(text: str | bytes | None, name: str, options: CheckOptions) -> Viewed:
    """A text with the report of its check; None: one that could not be read."""
    if text is None:
        return Viewed(None, unreadable(name, "cannot be read: it is gone"))
    return Viewed(text, check_text(text, name, options))


def document_of(
    *texts: str | bytes | None, options: CheckOptions | None = None, diff: bool = False
) -> dict[str, Any]:
    """The document of some texts, which are checked with the options. It holds what it must."""
    chosen = options or check_options()
    names = [f"plan{number}.xml" for number in range(len(texts))]
    each = [viewed(text, name, chosen) for text, name in zip(texts, names, strict=True)]
    shown = document(each, chosen, diff=diff)
    holds(shown)
    return shown


def only(text: str | bytes, options: CheckOptions | None = None) -> dict[str, Any]:
    """What is shown of one text."""
    (plan,) = document_of(text, options=options)["plans"]
    shown: dict[str, Any] = plan
    return shown


def holds(shown: dict[str, Any]) -> None:
    """It obeys the schema, and every number in it names something that is there."""
    _VALIDATOR.validate(shown)
    assert unpacked(packed(shown)) == shown
    assert unpacked(json.loads(json.dumps(packed(shown), allow_nan=False))) == shown
    for plan in shown["plans"]:
        _plan(plan)
        assert {finding["rule"] for finding in plan["findings"]} <= set(shown["rules"])
    diff = shown["diff"]
    if diff is not None:
        for side, play in zip((diff["left"], diff["right"]), diff["plays"], strict=True):
            if play is not None:
                _play(play, shown["plans"][side]["automaton"])


def _plan(plan: dict[str, Any]) -> None:
    elements, automaton = plan["elements"], plan["automaton"]
    for number, element in enumerate(elements):
        assert element["parent"] < number
        assert element["line"] <= element["endLine"] <= (plan["source"] or "").count("\n") + 1
    assert [element["parent"] for element in elements].count(-1) == min(1, len(elements))
    if automaton is not None:
        _automaton(automaton, len(elements))
    for finding in plan["findings"]:
        assert finding["element"] < len(elements)
        assert finding["play"] < len(plan["plays"])
        assert all(place["element"] < len(elements) for place in finding["related"])
        assert not (finding["story"] and finding["play"] >= 0)
    used = [finding["play"] for finding in plan["findings"] if finding["play"] >= 0]
    assert sorted(used) == list(range(len(plan["plays"])))
    for play in plan["plays"]:
        _play(play, automaton)
    if plan["task"] is not None:
        assert plan["task"]["play"] < len(plan["plays"])
        assert plan["task"]["element"] < len(elements)


def _automaton(automaton: dict[str, Any], elements: int) -> None:
    nodes, groups = automaton["nodes"], automaton["groups"]
    width, height = automaton["size"]
    assert len(automaton["group_of"]) == len(nodes)
    assert all(group < len(groups) for group in automaton["group_of"])
    assert all(node["element"] < elements for node in nodes)
    assert all(group["parent"] < place for place, group in enumerate(groups))
    for each in (*nodes, *groups):
        x, y, across, down = each["box"]
        assert (across > 0 and down > 0) or each.get("hidden")
        assert x >= 0
        assert y >= 0
        assert x + across <= width + 0.5
        assert y + down <= height + 0.5
    for edge in automaton["edges"]:
        assert edge["source"] < len(nodes)
        assert edge["target"] < len(nodes)


def _play(play: dict[str, Any], automaton: dict[str, Any]) -> None:
    records = play["records"]
    assert all(record["node"] < len(automaton["nodes"]) for record in records)
    times = [record["at_us"] for record in records]
    assert times == sorted(times)
    if play["ends"] == "ENDLESS":
        assert "ENDED" not in [record["kind"] for record in records]
    else:
        assert records[-1]["kind"] == "ENDED"
        assert records[-1]["data"] == {"status": play["ends"]}
    assert len(play["story_at"]) == len(play["story"])
    begins = play.get("story_from", play["story_at"])
    spans = list(zip(begins, play["story_at"], strict=True))
    assert all(first <= last < len(records) for first, last in spans)


def kinds(play: dict[str, Any]) -> Sequence[tuple[str, int]]:
    """The records of a play, without their times."""
    return [(record["kind"], record["node"]) for record in play["records"]]
