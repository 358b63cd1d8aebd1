"""Plans that the original engines have compiled: what was recorded is what comes out here."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from tests.compile.fabric.support import listed

if TYPE_CHECKING:
    from pathlib import Path

RECORDED = "engine/parser_results.json"


@pytest.mark.parametrize("version", [1, 2])
def test_recorded_results(shared_corpus: Path, version: int) -> None:
    recorded = json.loads((shared_corpus / RECORDED).read_text(encoding="utf-8"))
    assert len(recorded) > 100
    for row in recorded:
        text = json.dumps(listed(version, row["xml"]))  # as text: the order of keys counts
        assert text == json.dumps(row[f"v{version}"]), row["tag"]


def test_plans_of_the_second_experiment_compile(shared_corpus: Path) -> None:
    """All of them were executed, whether or not they are XML."""
    plans = sorted((shared_corpus / "experiment2").glob("*fabric_parsed*.xml"))
    assert len(plans) == 14
    edges = 0
    for path in plans:
        rows = listed(2, path.read_text(encoding="utf-8"))
        assert rows[-1]["interface"] == "fabric_capabilities/FabricCompletionRunner", path.name
        assert rows[-2]["success"] == rows[-1]["inst"], path.name
        events = ("start", "success", "failure")
        edges += sum(row[event] is not None for row in rows for event in events)
    assert edges == 115  # as many as the server has logged
