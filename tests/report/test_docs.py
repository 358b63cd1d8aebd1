"""The documents describe the formats that there are."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from gpsfsm.report import format_names
from gpsfsm.report.json import schema

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", format_names())
def test_every_format_is_described(name: str) -> None:
    text = (DOCS / "formats.md").read_text(encoding="utf-8")
    assert f"| `{name}` |" in text


def test_the_example_obeys_the_contract() -> None:
    text = (DOCS / "json.md").read_text(encoding="utf-8")
    example = re.search(r"```json\n(.*?)```", text, re.DOTALL)
    assert example is not None
    jsonschema.Draft202012Validator(schema()).validate(json.loads(example[1]))


def test_every_field_is_described() -> None:
    text = (DOCS / "json.md").read_text(encoding="utf-8")
    fields = set(_properties(schema()))
    assert "fewest_failures_to_give_up" in fields
    assert [field for field in sorted(fields) if f"`{field}`" not in text] == ["version"]


def _properties(part: Any) -> list[str]:
    if isinstance(part, list):
        return [name for item in part for name in _properties(item)]
    if not isinstance(part, dict):
        return []
    inner = [name for value in part.values() for name in _properties(value)]
    return [*inner, *part.get("properties", {})]
