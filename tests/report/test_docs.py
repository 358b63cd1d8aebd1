"""The documents describe the formats that there are."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from gpsfsm import check
from gpsfsm.analysis.rules import all_rules, says_no_verdict
from gpsfsm.report import format_names, render
from gpsfsm.report.json import schema

DOCS = Path(__file__).parents[2] / "docs"


@pytest.mark.parametrize("name", format_names())
def test_every_format_is_described(name: str) -> None:
    text = (DOCS / "formats.md").read_text(encoding="utf-8")
    assert f"| `{name}` |" in text


def test_the_example_is_what_gpsfsm_prints(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(DOCS.parent)
    text = (DOCS / "json.md").read_text(encoding="utf-8")
    path = "docs/examples/patrol.xml"
    assert f"`gpsfsm check {path} --format json`" in text
    assert _block(text, "xml") == Path(path).read_text(encoding="utf-8")
    printed = json.loads(render(check(Path(path)), "json"))
    assert json.loads(_block(text, "json")) == printed
    jsonschema.Draft202012Validator(schema()).validate(printed)


def test_every_cause_of_no_verdict_is_described() -> None:
    text = (DOCS / "json.md").read_text(encoding="utf-8")
    described = set(re.findall(r"^\| (GP\d+) \|", text, re.MULTILINE))
    assert described == {rule.code for rule in all_rules() if says_no_verdict(rule.code)}


def test_every_field_is_described() -> None:
    text = (DOCS / "json.md").read_text(encoding="utf-8")
    text, _, _ = text.partition("\n## Capabilities\n")  # another contract, with other fields
    fields = set(_properties(schema()))
    assert "fewest_failures_to_give_up" in fields
    assert [field for field in sorted(fields) if f"`{field}`" not in text] == ["version"]


def _block(text: str, language: str) -> str:
    (result,) = re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL)
    return str(result)


def _properties(part: Any) -> list[str]:
    if isinstance(part, list):
        return [name for item in part for name in _properties(item)]
    if not isinstance(part, dict):
        return []
    inner = [name for value in part.values() for name in _properties(value)]
    return [*inner, *part.get("properties", {})]
