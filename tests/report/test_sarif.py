from __future__ import annotations

import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import jsonschema
import pytest

from gpsfsm import Limits, check
from gpsfsm.analysis.rules import all_rules
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Severity, TraceStep
from gpsfsm.model.plan import Location
from gpsfsm.model.report import Report, Verdict
from gpsfsm.report import RenderOptions, render
from gpsfsm.version import REPOSITORY, VERSION
from tests.report.samples import CLEAN, DANGLING, GIVES_UP, MISSING, SAMPLES

# The official schema is not ours to copy. The npm package @microsoft/jest-sarif ships it.
SCHEMA = Path(
    os.environ.get("GPSFSM_SARIF_SCHEMA")
    or Path(__file__).parents[2]
    / "node_modules/@microsoft/jest-sarif/lib/schemas/sarif-2.1.0-rtm.5.json"
)
needs_schema = pytest.mark.skipif(
    not SCHEMA.is_file(),
    reason="no SARIF schema: npm install --no-save --ignore-scripts @microsoft/jest-sarif",
)


def run_of(report: Report, **options: str) -> dict[str, Any]:
    log = json.loads(render(report, "sarif", options=RenderOptions(**options)))  # type: ignore[arg-type]
    assert log["version"] == "2.1.0"
    (run,) = log["runs"]
    results: dict[str, Any] = run
    return results


def first_result(report: Report) -> dict[str, Any]:
    results: dict[str, Any] = run_of(report)["results"][0]
    return results


@needs_schema
@pytest.mark.parametrize("sample", SAMPLES)
def test_output_obeys_the_official_schema(sample: str) -> None:
    schema = json.loads(SCHEMA.read_text(encoding="utf-8"))
    validator = jsonschema.validators.validator_for(schema)(schema)
    log = json.loads(render(SAMPLES[sample], "sarif", options=RenderOptions(version="1.2.3")))
    assert [error.message for error in validator.iter_errors(log)] == []
    log["runs"][0]["results"] = [{"text": "no message"}]
    assert not validator.is_valid(log)


def test_all_rules_are_described() -> None:
    driver = run_of(SAMPLES["empty"], version="1.2.3")["tool"]["driver"]
    assert [rule["id"] for rule in driver["rules"]] == [rule.code for rule in all_rules()]
    assert all(rule["shortDescription"]["text"] for rule in driver["rules"])
    for described, rule in zip(driver["rules"], all_rules(), strict=True):
        assert described["help"]["markdown"].startswith(f"# {rule.code} {rule.name}")
        assert described["help"]["text"]
        page = described["helpUri"].removeprefix(f"{REPOSITORY}/blob/v{VERSION}/")
        assert (
            (Path(__file__).parents[2] / page)
            .read_text("utf-8")
            .startswith(f"# {rule.code} {rule.name}")
        )
    assert driver["informationUri"] == REPOSITORY
    assert driver["version"] == "1.2.3"
    assert "version" not in run_of(SAMPLES["empty"])["tool"]["driver"]


def test_each_result_refers_to_its_rule() -> None:
    run = run_of(SAMPLES["mixed"])
    rules = run["tool"]["driver"]["rules"]
    for result in run["results"]:
        if result["ruleId"] in {rule["id"] for rule in rules}:
            assert rules[result["ruleIndex"]]["id"] == result["ruleId"]
    assert run["results"][0]["ruleIndex"] > 0


def test_a_rule_that_is_not_in_the_catalogue_has_no_index() -> None:
    plan = replace(GIVES_UP, findings=(replace(DANGLING, rule="XX999"),))
    assert "ruleIndex" not in first_result(Report((plan,)))


def test_a_result() -> None:
    result = first_result(SAMPLES["mixed"])
    assert result["level"] == "warning"
    assert result["locations"] == [
        {
            "physicalLocation": {
                "artifactLocation": {"uri": "plans/patrol.xml"},
                "region": {"startLine": 3, "startColumn": 5, "endColumn": 12},
            },
            "logicalLocations": [
                {"fullyQualifiedName": "/Plan/Control[1]/Runner[1]", "kind": "element"}
            ],
        }
    ]
    assert run_of(SAMPLES["mixed"])["columnKind"] == "unicodeCodePoints"


def test_info_is_note() -> None:
    finding = replace(DANGLING, severity=Severity.INFO)
    assert first_result(Report((replace(GIVES_UP, findings=(finding,)),)))["level"] == "note"


def test_no_region_without_a_line() -> None:
    finding = replace(DANGLING, location=Location(0, 0))
    result = first_result(Report((replace(GIVES_UP, findings=(finding,)),)))
    assert "region" not in result["locations"][0]["physicalLocation"]


def test_related_locations_have_ids_and_messages() -> None:
    related = run_of(SAMPLES["mixed"])["results"][1]["relatedLocations"]
    assert [location["id"] for location in related] == [1, 2]
    assert related[0]["message"]["text"] == "its FAILED is not handled"
    assert related[1]["message"]["text"] == "/Plan/Control[1]/Control[1]/Runner[2]"


def test_a_scenario_is_a_code_flow() -> None:
    (flow,) = run_of(SAMPLES["mixed"])["results"][1]["codeFlows"]
    steps = flow["threadFlows"][0]["locations"]
    assert [step["location"]["message"]["text"] for step in steps] == [
        "STARTED of /Plan/Control[1]/Runner[1]",
        "SUCCEEDED of /Plan/Control[1]/Runner[1]",
        "STARTED of /Plan/Control[1]/Control[1]/Runner[1]",
        "FAILED of /Plan/Control[1]/Control[1]/Runner[1]",
    ]
    lines = [step["location"]["physicalLocation"]["region"]["startLine"] for step in steps]
    assert lines == [3, 3, 5, 5]
    assert flow["message"]["text"] == "a run in which the plan gives up"


def test_a_truncated_code_flow_says_which_events_it_holds() -> None:
    (flow,) = first_result(SAMPLES["truncated"])["codeFlows"]
    assert flow["message"]["text"] == ("a run in which the plan gets stuck (only the last events)")


def test_the_steps_of_a_real_plan_have_the_lines_of_their_elements() -> None:
    text = """<!-- <Plan><Runner> -->
<Plan>
  <Control type="sequential" name="<Runner/>">
    <Runner interface="a/B"
            provider="a/B"/>
  </Control>
  <Runner interface="a/C" provider="a/C"/>
</Plan>
""".replace('"<Runner/>"', '"&lt;Runner/>"')
    report = check(text, assume=["B never fails"])
    flows = [result["codeFlows"] for result in run_of(report)["results"] if "codeFlows" in result]
    steps = [step for (flow,) in flows for step in flow["threadFlows"][0]["locations"]]
    lines = {
        step["location"]["logicalLocations"][0]["fullyQualifiedName"]: step["location"][
            "physicalLocation"
        ]["region"]["startLine"]
        for step in steps
    }
    assert lines == {"/Plan/Control[1]/Runner[1]": 4, "/Plan/Runner[1]": 7}


def test_a_step_without_a_line_has_no_region() -> None:
    assert DANGLING.scenario is not None
    scenario = replace(DANGLING.scenario, trace=(TraceStep(Event.FAILED, "/Plan/Runner[1]", 0),))
    finding = replace(DANGLING, scenario=scenario)
    (flow,) = first_result(Report((replace(GIVES_UP, findings=(finding,)),)))["codeFlows"]
    (step,) = flow["threadFlows"][0]["locations"]
    assert "region" not in step["location"]["physicalLocation"]


def test_suppressed_findings_are_suppressed_results() -> None:
    results = run_of(SAMPLES["suppressed"])["results"]
    assert [(result["ruleId"], result["suppressions"]) for result in results] == [
        ("GP111", [{"kind": "inSource", "justification": "the goal {1, 2} is fixed"}]),
        ("GP310", [{"kind": "external"}]),
        ("GP303", [{"kind": "external"}]),
    ]


def test_comments_and_options_of_a_real_check_are_told_apart() -> None:
    empty = '<Control type="sequential"/>'
    comment = "<!-- gpsfsm: ignore GP109 because the operator takes over -->"
    report = check(f"<Plan>{comment}{empty}{empty}</Plan>", ignore=["GP109"])
    suppressions = [
        result["suppressions"]
        for result in run_of(report)["results"]
        if result["ruleId"] == "GP109"
    ]
    assert suppressions == [
        [
            {"kind": "inSource", "justification": "the operator takes over"},
            {"kind": "external"},
        ],
        [{"kind": "external"}],
    ]


def test_the_first_reason_that_comments_give_is_told() -> None:
    silent, first, second = (
        f"<!-- gpsfsm: ignore GP302{reason} -->" for reason in ("", ": one", ": two")
    )
    runner = '<Runner interface="a/B" provider="a/B"/>'
    control = f'<Control type="sequential">{first}{second}{runner}</Control>'
    report = check(f"<Plan>{silent}{control}</Plan>")
    (result,) = (each for each in run_of(report)["results"] if each["ruleId"] == "GP302")
    assert result["suppressions"] == [{"kind": "inSource", "justification": "one"}]


def test_a_plan_that_was_not_decided_is_told_in_the_invocation() -> None:
    (invocation,) = run_of(Report((MISSING, CLEAN)))["invocations"]
    assert invocation["executionSuccessful"] is False
    (notification,) = invocation["toolExecutionNotifications"]
    assert notification["descriptor"] == {"id": "GP901"}
    assert notification["message"] == {"text": "no such file"}


def test_a_limit_is_told_in_the_invocation() -> None:
    report = check("<Plan><Control type='sequential'/></Plan>", limits=Limits(max_depth=1))
    (invocation,) = run_of(report)["invocations"]
    (notification,) = invocation["toolExecutionNotifications"]
    assert notification["descriptor"] == {"id": "GP103"}
    assert "nested more than 1 deep" in notification["message"]["text"]
    assert notification["locations"][0]["physicalLocation"]["region"]["startLine"] == 1


def test_no_verdict_without_a_cause_is_told_in_the_invocation() -> None:
    plan = replace(GIVES_UP, verdict=Verdict.UNDECIDED, findings=(replace(DANGLING, rule="GP905"),))
    (invocation,) = run_of(Report((plan,)))["invocations"]
    (notification,) = invocation["toolExecutionNotifications"]
    assert notification["level"] == "error"
    assert "descriptor" not in notification


@pytest.mark.parametrize(("sample", "expected"), [("accepted", True), ("empty", False)])
def test_execution_is_successful_if_something_was_checked(sample: str, expected: bool) -> None:
    (invocation,) = run_of(SAMPLES[sample])["invocations"]
    assert invocation == {"executionSuccessful": expected}


@pytest.mark.parametrize(
    ("path", "uri"),
    [
        ("a/b.xml", "a/b.xml"),
        ("a b%#?.xml", "a%20b%25%23%3F.xml"),
        ("c:d.xml", "c%3Ad.xml"),
        ("世.xml", "%E4%B8%96.xml"),
        ("\udcff.xml", "%FF.xml"),
        ("\ud800.xml", "%3F.xml"),
        ("/srv/a b.xml", "file:///srv/a%20b.xml"),
        ("C:/plans/a b.xml", "file:///C:/plans/a%20b.xml"),
        ("<stdin>", "%3Cstdin%3E"),
    ],
)
def test_paths_are_uris(path: str, uri: str) -> None:
    result = first_result(Report((replace(GIVES_UP, path=path),)))
    location = result["locations"][0]["physicalLocation"]["artifactLocation"]
    assert location == {"uri": uri}
    if path.isprintable():
        assert unquote(uri).removeprefix("file://").removeprefix("/").endswith(path.lstrip("/"))


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ("a {0} b", "a {{0}} b"),
        ("click [here](http://x)", r"click \[here](http://x)"),
        ("see /Plan/Runner[1] (line 3)", "see /Plan/Runner[1] (line 3)"),
        ("", "-"),
        ("\x1b[0m", r"\x1b[0m"),
    ],
)
def test_messages_are_plain_text(message: str, expected: str) -> None:
    plan = replace(GIVES_UP, findings=(replace(DANGLING, message=message),))
    assert first_result(Report((plan,)))["message"] == {"text": expected}


def test_fingerprints_do_not_depend_on_lines() -> None:
    def fingerprint(**changes: object) -> object:
        finding = replace(DANGLING, **changes)  # type: ignore[arg-type]
        result = first_result(Report((replace(GIVES_UP, findings=(finding,)),)))
        return result["partialFingerprints"]

    here = fingerprint()
    assert here == fingerprint(location=replace(DANGLING.location, line=30, column=1))
    assert here != fingerprint(location=replace(DANGLING.location, element="/Plan"))
    assert here != fingerprint(message="other")
    assert here != fingerprint(rule="GP303")
