"""``gpsfsm run --scenario``: counterexamples can be watched."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.cli import main
from tests.cli.support import REJECTED, runner, write

if TYPE_CHECKING:
    from pathlib import Path

PLAN = f"""<Plan>
<Control type="parallel_any">
{runner(x="1")}
{runner(x="2")}
</Control>
{runner(x="3")}
</Plan>
"""


def checked(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[dict[str, Any]]:
    """The findings of a.xml; the report is in report.json."""
    main(["check", "a.xml", "--format", "json", "--output-file", "report.json", *arguments])
    capsys.readouterr()
    with open("report.json", encoding="utf-8") as file:  # noqa: PTH123
        report = json.load(file)
    findings: list[dict[str, Any]] = report["plans"][0]["findings"]
    return findings


def test_every_scenario_of_a_report_ends_as_it_says(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    findings = checked(capsys, "--faults", "no-start,hang")
    ends = set()
    for number, finding in enumerate(findings, start=1):
        if finding["scenario"] is None:
            continue
        ends.add(finding["scenario"]["ends"])
        journal = f"{number}.db"
        arguments = ["run", "a.xml", "--scenario", "report.json", "--journal", journal]
        code = main([*arguments, "--finding", str(number)])
        out, _ = capsys.readouterr()
        assert out.splitlines()[-1].startswith(f"{finding['scenario']['ends']} after "), out
        assert code == int(finding["scenario"]["ends"] != "COMPLETED")
        assert main(["replay", journal]) == 0
        capsys.readouterr()
    assert ends == {"COMPLETED", "GAVE_UP", "STUCK"}


def test_events_come_in_the_order_of_the_trace(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A runner that is active when the plan completes is stopped then, as GP311 tells."""
    write(tmp_path, a=PLAN)
    findings = checked(capsys)
    [number] = [index for index, each in enumerate(findings, 1) if each["rule"] == "GP311"]
    main(["run", "a.xml", "--scenario", "report.json", "--finding", str(number)])
    out, _ = capsys.readouterr()
    element = findings[number - 1]["location"]["line"]
    assert f"line {element}  " in out
    assert out.splitlines()[-2].endswith(" stopped")


def test_a_plan_that_hangs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f"<Plan>{runner()}</Plan>")
    scenario = {"outcomes": [{"element": "/Plan/Runner[1]", "outcome": "HANG"}]}
    (tmp_path / "s.json").write_text(json.dumps(scenario), encoding="utf-8")
    assert main(["run", "a.xml", "--scenario", "s.json"]) == 1
    assert "STUCK after 0.000 s: 1 started" in capsys.readouterr().out


def test_a_scenario_that_claims_something_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=f"<Plan>{runner()}</Plan>")
    scenario = {"outcomes": [], "ends": "GAVE_UP"}
    (tmp_path / "s.json").write_text(json.dumps(scenario), encoding="utf-8")
    assert main(["run", "a.xml", "--scenario", "s.json"]) == 0
    out = capsys.readouterr().out
    assert out.endswith("The scenario says GAVE_UP, which this run did not do.\n")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "s.json:1:2: is not JSON: a key in double quotes is expected"),
        ('{"outcomes":\n oops}', "s.json:2:2: is not JSON: a value is expected"),
        ("{\xff", "s.json: is not UTF-8 text (byte 2)"),
        ("[]", "is neither a report"),
        ("{}", "is neither a report"),
        ('{"outcomes": [{"element": 5, "outcome": "FAILED"}]}', "is neither a report"),
        ('{"outcomes": [{"element": "/Plan", "outcome": "EXPLODED"}]}', "is neither a report"),
        ('{"outcomes": [{"element": "/Plan/Runner[9]", "outcome": "FAILED"}]}', "was the plan"),
        ('{"plans": []}', "says nothing about a.xml"),
        ('{"plans": [{"path": "b.xml", "findings": []}]}', "no finding has a scenario"),
        ('{"rule": "GP1", "scenario": null}', "has no scenario"),
        ("[" * 100_000, "is not JSON that can be read: it is nested too deeply"),
    ],
)
def test_files_that_are_no_scenarios(
    content: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=f"<Plan>{runner()}</Plan>")
    (tmp_path / "s.json").write_text(content, encoding="latin-1")
    assert main(["run", "a.xml", "--scenario", "s.json"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err


def test_a_finding_that_is_not_there(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=PLAN)
    count = len(checked(capsys))
    arguments = ["run", "a.xml", "--scenario", "report.json", "--finding", str(count + 1)]
    assert main(arguments) == 2
    assert f"there are only {count} findings" in capsys.readouterr().err


def test_a_plan_with_errors_is_not_said_to_be_forced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=REJECTED)
    scenario = {"outcomes": []}
    (tmp_path / "s.json").write_text(json.dumps(scenario), encoding="utf-8")
    main(["run", "a.xml", "--scenario", "s.json"])
    assert "note: run for a scenario, in spite of GP" in capsys.readouterr().out
    main(["run", "a.xml", "--scenario", "s.json", "--force"])
    assert "note: run for a scenario, in spite of GP" in capsys.readouterr().out
    main(["run", "a.xml", "--force"])
    assert "note: forced in spite of GP" in capsys.readouterr().out
