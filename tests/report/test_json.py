from __future__ import annotations

import json
from dataclasses import replace

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.model.report import Facts, Frequency, PlanReport, Report, Verdict
from gpsfsm.report import render
from gpsfsm.report.json import schema
from tests.report.samples import BROKEN, DANGLING, GIVES_UP, SAMPLES

VALIDATOR = jsonschema.Draft202012Validator(schema())


def read(report: Report) -> dict[str, object]:
    document: dict[str, object] = json.loads(render(report, "json"))
    return document


def test_the_schema_is_a_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(schema())


@pytest.mark.parametrize("sample", SAMPLES)
def test_output_obeys_the_schema(sample: str) -> None:
    VALIDATOR.validate(read(SAMPLES[sample]))


def test_keys_come_in_the_order_of_the_contract() -> None:
    plan = json.loads(render(Report((GIVES_UP,)), "json"))["plans"][0]
    assert list(plan) == [
        *("path", "verdict", "facts", "decided_by", "unproved", "approximations"),
        *("findings", "suppressed", "suppressed_findings", "notes"),
    ]
    assert list(plan["facts"]) == schema()["$defs"]["facts"]["required"]
    contract = schema()["$defs"]["finding"]["required"]
    assert list(plan["findings"][0]) == [*contract, "confidence"]
    scenario = plan["findings"][0]["scenario"]
    assert list(scenario) == ["outcomes", "ends", "trace", "trace_truncated", "story"]


def test_values() -> None:
    plan = json.loads(render(Report((GIVES_UP,)), "json"))["plans"][0]
    go = "/Plan/Control[1]/Runner[1]"
    assert plan["facts"]["dangling"][0] == {"runner": go, "event": "FAILED", "effect": "give_up"}
    assert plan["suppressed"] == 1
    assert plan["findings"][0]["location"] == {"line": 3, "column": 5, "element": go}
    assert plan["findings"][0]["scenario"]["outcomes"] == [{"element": go, "outcome": "FAILED"}]
    assert plan["findings"][0]["scenario"]["trace"] == [
        {"event": "STARTED", "element": go, "line": 3},
        {"event": "FAILED", "element": go, "line": 3},
    ]
    assert plan["findings"][1]["related"][0]["message"] == "its FAILED is not handled"
    assert plan["findings"][2]["confidence"] == "heuristic"
    assert plan["findings"][2]["scenario"] is None


def test_no_facts_are_null() -> None:
    assert json.loads(render(Report((BROKEN,)), "json"))["plans"][0]["facts"] is None


def test_one_line_per_finding_and_per_fact() -> None:
    lines = render(Report((GIVES_UP,)), "json").splitlines()
    assert sum('"rule": "GP' in line for line in lines) == 3 + 1
    assert '   "stuck": "never",' in lines


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("verdict", "maybe"),
        ("facts", {}),
        ("findings", [{"rule": "GP302"}]),
        ("suppressed", -1),
        ("suppressed_findings", [{"rule": "GP302"}]),
    ],
)
def test_the_schema_refuses_what_breaks_the_contract(key: str, value: object) -> None:
    report = json.loads(render(Report((GIVES_UP,)), "json"))
    report["plans"][0][key] = value
    assert not VALIDATOR.is_valid(report)


def test_the_schema_admits_unknown_fields_and_endings() -> None:
    report = json.loads(render(Report((GIVES_UP,)), "json"))
    report["plans"][0]["findings"][0]["new"] = 1
    report["plans"][0]["findings"][0]["scenario"]["ends"] = "TIMED_OUT"
    VALIDATOR.validate(report)


def test_half_a_surrogate_pair_is_replaced_and_a_backslash_is_not() -> None:
    path = "a\udcff/\\ud800/👍\ud83d"
    output = render(Report((replace(GIVES_UP, path=path),)), "json")
    assert json.loads(output)["plans"][0]["path"] == "a\ufffd/\\ud800/👍\ufffd"


@given(st.text(st.characters(codec=None, exclude_categories=()), max_size=40))
def test_any_text_is_written_in_ascii_and_read_back(text: str) -> None:
    finding = replace(DANGLING, message=text)
    output = render(Report((replace(GIVES_UP, findings=(finding,)),)), "json")
    assert output.isascii()
    json.loads(output.encode())
    message = json.loads(output)["plans"][0]["findings"][0]["message"]
    assert message.encode() == message.encode("utf-8", "strict")
    assert message == text.encode("utf-16", "surrogatepass").decode("utf-16", "replace")


def test_a_hundred_thousand_unreachable_runners_are_all_listed() -> None:
    paths = tuple(f"/Plan/Control[1]/Runner[{n}]" for n in range(1, 100_001))
    facts = Facts(100_000, Frequency.ALWAYS, Frequency.NEVER, Frequency.NEVER, unreachable=paths)
    report = Report((PlanReport("big.xml", Verdict.REJECTED, facts, ()),))
    output = render(report, "json")
    assert json.loads(output)["plans"][0]["facts"]["unreachable"] == list(paths)
