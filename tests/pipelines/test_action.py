"""The GitHub action: its steps run as they stand, and only an acceptance passes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
import yaml

from tests.pipelines.support import BAD, GOOD, REPO, make_place
from tests.pipelines.workflow import run_action

if TYPE_CHECKING:
    from pathlib import Path

ACTION = REPO / "action.yml"
UPLOAD = "github/codeql-action/upload-sarif@v3"


def test_plans_that_are_accepted_pass(tmp_path: Path) -> None:
    place = make_place(tmp_path, plans=GOOD)
    ran = run_action(ACTION, place, {"paths": "plans"})
    assert (ran.failed, ran.outputs["accepted"]) == (False, "true"), ran.log
    assert ran.outputs["sarif-file"] == "gpsfsm.sarif"
    assert f"install --quiet --disable-pip-version-check {REPO}\n" in place.installed
    assert "| plans/a.xml | accepted | 0 | 0 |" in ran.summary
    assert [name for name, _ in ran.used] == ["actions/setup-python@v5", UPLOAD]
    assert ran.used[1][1]["sarif_file"] == "gpsfsm.sarif"
    sarif = json.loads((place.folder / "gpsfsm.sarif").read_text(encoding="utf-8"))
    assert sarif["version"] == "2.1.0"
    assert sarif["runs"][0]["invocations"][0]["executionSuccessful"] is True


def test_a_plan_that_is_refused_fails_and_is_reported(tmp_path: Path) -> None:
    ran = run_action(ACTION, make_place(tmp_path, plans=BAD), {"paths": "plans"})
    assert (ran.failed, ran.code, ran.outputs["accepted"]) == (True, 1, "false"), ran.log
    assert "| plans/b.xml | **rejected** | 1 |" in ran.summary
    assert UPLOAD in [name for name, _ in ran.used]
    assert "plans/b.xml: rejected: findings" in ran.log


@pytest.mark.parametrize(
    ("written", "code"),
    [
        ({"paths": "\n  \n"}, 2),
        ({"paths": "missing.xml"}, 2),
        ({"paths": "plans", "arguments": "--tolerate=1"}, 1),
        ({"paths": "plans", "budget-ms": "0"}, 2),
        ({"paths": "plans", "arguments": "--max-elements=1"}, 2),
        ({"paths": "plans", "arguments": "--no-such-option"}, 2),
        ({"paths": "--help"}, 2),
        ({"paths": "plans", "arguments": "--help"}, 2),
        ({"paths": "plans; true\n$(true)", "arguments": "`true`"}, 2),
    ],
)
def test_everything_else_fails(tmp_path: Path, written: dict[str, str], code: int) -> None:
    """Inputs are data: neither options among the paths nor a shell's words have an effect."""
    ran = run_action(ACTION, make_place(tmp_path, plans=GOOD), written)
    assert (ran.failed, ran.code, ran.outputs["accepted"]) == (True, code, "false"), ran.log
    assert "Traceback" not in ran.log


def test_an_old_report_is_not_taken_for_a_new_one(tmp_path: Path) -> None:
    place = make_place(tmp_path, plans=GOOD | {"gpsfsm.sarif": "{}"})
    ran = run_action(ACTION, place, {"paths": "plans", "fail-on": "never"})
    assert (ran.failed, ran.code) == (True, 2), ran.log
    assert ran.outputs == {"accepted": "false", "sarif-file": ""}
    assert UPLOAD not in [name for name, _ in ran.used]


def test_paths_and_arguments_are_lines(tmp_path: Path) -> None:
    plans = {"more plans/a b.xml": GOOD["plans/a.xml"], **GOOD}
    values = {
        "paths": "more plans\nplans/a.xml\n",
        "arguments": "--assume=never fails: WaypointRunner\n--fail-on=warning\n",
        "upload-sarif": False,
        "sarif-file": "out file.sarif",
    }
    ran = run_action(ACTION, make_place(tmp_path, plans=plans), values)
    assert (ran.failed, ran.outputs["accepted"]) == (False, "true"), ran.log
    assert "2 plans: 2 accepted" in ran.log
    assert ran.outputs["sarif-file"] == "out file.sarif"
    assert UPLOAD not in [name for name, _ in ran.used]


def test_the_action_has_what_github_asks_for() -> None:
    action = yaml.safe_load(ACTION.read_text(encoding="utf-8"))
    assert {"name", "description", "inputs", "outputs", "runs"} <= set(action)
    assert action["runs"]["using"] == "composite"
    for about in (*action["inputs"].values(), *action["outputs"].values()):
        assert about["description"]
    for about in action["inputs"].values():
        assert isinstance(about.get("default", ""), str)
