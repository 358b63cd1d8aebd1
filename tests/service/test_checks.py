"""Check, gate, grade, fix and rules over HTTP say what the functions of gpsfsm say."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import jsonschema
import pytest

import gpsfsm
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import check_options
from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.capabilities.table import dump
from gpsfsm.fixing import fix_text
from gpsfsm.gating import GateOptions, gate_text
from gpsfsm.gating.gate_call import DEFAULT_TOTAL_RLIMIT
from gpsfsm.grading.grader import Grader
from gpsfsm.report import render
from gpsfsm.report.json import schema
from gpsfsm.service.settings import plan_limits
from gpsfsm.tasks.load import read_task
from tests.cli.support import runner
from tests.conftest import REPO
from tests.service.support import BAD, GOOD, Service

if TYPE_CHECKING:
    from pathlib import Path

    import httpx

TASK = "steps:\n  - do: {interface: a/Go}\n"
BROKEN = '<Plan><Runner interface="a/Go" provider="a/Go"></Plan>'


@pytest.mark.parametrize("plan", [GOOD, BAD, "<Plan/>", "no plan", ""])
def test_a_check_is_the_report_of_the_command(client: httpx.Client, plan: str) -> None:
    response = client.post("/v1/check", json={"plan": plan, "name": "<text>"})
    assert response.status_code == 200
    report = gpsfsm.check(plan.encode())
    assert response.json()["report"] == json.loads(render(report, "json"))
    assert response.json()["ok"] is report.ok
    jsonschema.validate(response.json()["report"], schema())


def test_a_check_renders_in_any_format(client: httpx.Client) -> None:
    response = client.post("/v1/check", json={"plan": BAD, "name": "<text>", "format": "llm"})
    assert response.json()["rendered"] == render(gpsfsm.check(BAD), "llm")
    wrong = client.post("/v1/check", json={"plan": BAD, "format": "nix"})
    assert wrong.status_code == 422
    assert "there is no format 'nix'" in wrong.json()["detail"]


def test_options_reach_the_check(client: httpx.Client) -> None:
    for options in (
        {"assume": ["never fails: Go"], "select": ["GP302"]},
        {"engine": "fabric-v1", "total_rlimit": 1_000_000},
    ):
        body = {"plan": GOOD, "name": "<text>", "options": options}
        response = client.post("/v1/check", json=body)
        wanted = gpsfsm.check(GOOD, **options)  # type: ignore[arg-type]
        assert response.json()["report"] == json.loads(render(wanted, "json"))


def test_a_tree_includes_no_file_of_the_server(client: httpx.Client, tmp_path: Path) -> None:
    tree = '<root BTCPP_format="4"><BehaviorTree ID="A"><Go/></BehaviorTree></root>'
    (tmp_path / "a.xml").write_text(tree, encoding="utf-8")
    for path in ("a.xml", str(tmp_path / "a.xml")):
        plan = tree.replace("<Beh", f'<include path="{path}"/><Beh').replace('"A"', '"M"')
        body = {"plan": plan, "name": str(tmp_path / "main.xml")}
        (entry,) = client.post("/v1/check", json=body).json()["report"]["plans"]
        assert (entry["verdict"], entry["findings"][0]["rule"]) == ("undecided", "GP813")
        assert client.post("/v1/gate", json=body | {"trees": True}).json()["verdict"] != "accepted"


def test_the_plan_may_be_the_body(client: httpx.Client) -> None:
    xml = {"content-type": "application/xml; charset=utf-8"}
    for path in ("/v1/check", "/v1/gate", "/v1/fix"):
        whole = client.post(path, content=GOOD, headers=xml)
        assert whole.json() == client.post(path, json={"plan": GOOD}).json()


def test_the_gate_accepts_and_says_for_what(client: httpx.Client) -> None:
    document = client.post("/v1/gate", json={"plan": GOOD}).json()
    assert (document["verdict"], document["reason"], document["findings"]) == (
        "accepted",
        "passed",
        [],
    )
    library = dump(builtin_capabilities().library).encode()
    assert document["digests"]["plan"] == hashlib.sha256(GOOD.encode()).hexdigest()
    assert document["digests"]["capabilities"] == hashlib.sha256(library).hexdigest()


@pytest.mark.parametrize(
    "more", [{}, {"engine": "fabric-v1"}, {"engine": "fabric-v2"}, {"total_rlimit": 1_000}]
)
def test_the_gate_asks_for_what_the_call_asks_for(
    client: httpx.Client, more: dict[str, Any]
) -> None:
    """Equal digests: the same options, with the defaults of the call and of ``gpsfsm gate``."""
    wanted = gpsfsm.gate(GOOD, budget_ms=None, limits=plan_limits(), **more)
    body = {"plan": GOOD, "name": "<text>", "options": more}
    document = client.post("/v1/gate", json=body).json()
    assert document["digests"] == asdict(wanted.digests)
    assert (document["verdict"] == "accepted") is wanted.accepted
    assert document["message"] == wanted.message


def test_the_gate_asks_for_a_task(client: httpx.Client) -> None:
    analysis = AnalysisOptions(total_rlimit=DEFAULT_TOTAL_RLIMIT)
    check = check_options(analysis, limits=plan_limits())
    check = replace(check, task=read_task(TASK.encode()), trees=False)
    wanted = gate_text(GOOD, "<text>", GateOptions(check=check))
    document = client.post("/v1/gate", json={"plan": GOOD, "name": "<text>", "task": TASK}).json()
    assert document["digests"] == asdict(wanted.digests)
    assert (document["verdict"] == "accepted") is wanted.accepted
    other = client.post("/v1/gate", json={"plan": GOOD.replace("Go", "Stop"), "task": TASK}).json()
    assert (other["verdict"], other["reason"]) == ("rejected", "findings")
    task = hashlib.sha256(TASK.encode()).hexdigest()
    basis = {"scope": "structure and task", "task": task, "engine": None}
    assert other["basis"] == {**basis, "allow_approximated": False}
    files = client.post("/v1/gate", json={"plan": GOOD, "task": "not_answers: [/etc/passwd]\n"})
    assert (files.status_code, files.json()["verdict"]) == (422, "undecided")


@pytest.mark.parametrize("wrong", [{"engine": "fabric-v9"}, {"total_rlimit": 0}])
def test_options_that_make_no_sense_accept_nothing(
    client: httpx.Client, wrong: dict[str, object]
) -> None:
    for path in ("/v1/check", "/v1/gate"):
        response = client.post(path, json={"plan": GOOD, "options": wrong})
        assert response.status_code == 422
        assert response.json().get("verdict", "undecided") == "undecided"
    (name,) = wrong
    assert name.replace("_", " ").split()[0] in response.json()["detail"]


@pytest.mark.parametrize(
    ("plan", "reason"),
    [(BAD, "findings"), ("<Plan/>", "empty"), ("", "findings"), ("<Plan>" * 300, "inconclusive")],
)
def test_the_gate_refuses(client: httpx.Client, plan: str, reason: str) -> None:
    response = client.post("/v1/gate", json={"plan": plan})
    assert response.status_code == 200
    verdict = "undecided" if reason == "inconclusive" else "rejected"
    assert (response.json()["verdict"], response.json()["reason"]) == (verdict, reason)


def test_a_grade_is_that_of_the_command(client: httpx.Client) -> None:
    grader = Grader(read_task(TASK.encode()))
    for answer in (GOOD, BROKEN, "nothing", GOOD.replace("Go", "Other")):
        document = client.post("/v1/grade", json={"plan": answer, "task": TASK}).json()
        wanted = grader.grade(answer, "answer.xml")
        assert (document["grade"], document["reason"]) == (wanted.grade.value, wanted.reason)


def test_a_task_that_is_sent_reads_no_files_of_the_service(client: httpx.Client) -> None:
    task = f"{TASK}not_answers: [/etc/passwd]\n"
    response = client.post("/v1/grade", json={"plan": GOOD, "task": task})
    assert response.status_code == 422
    assert "must not name files" in response.json()["detail"]
    broken = client.post("/v1/grade", json={"plan": GOOD, "task": "steps: 3"})
    assert broken.status_code == 422


def test_a_fix_is_that_of_the_command(client: httpx.Client) -> None:
    document = client.post("/v1/fix", json={"plan": BROKEN, "unsafe": True}).json()
    wanted = fix_text(BROKEN, unsafe=True)
    assert wanted.text != BROKEN
    assert (document["plan"], document["changed"]) == (wanted.text, True)
    assert [each["rule"] for each in document["repairs"]] == [each.rule for each in wanted.applied]
    same = client.post("/v1/fix", json={"plan": GOOD}).json()
    assert (same["plan"], same["changed"], same["repairs"]) == (GOOD, False, [])


def test_the_rules_are_all_there(client: httpx.Client) -> None:
    rules = client.get("/v1/rules").json()["rules"]
    assert [each["code"] for each in rules] == [each.code for each in gpsfsm.all_rules()]
    first = client.get(f"/v1/rules/{rules[0]['name']}").json()
    assert first["code"] == rules[0]["code"]
    assert first["bad"]
    assert client.get("/v1/rules/GP000").status_code == 404


def test_what_was_counted(client: httpx.Client) -> None:
    client.post("/v1/gate", json={"plan": GOOD})
    lines = client.get("/metrics").text.splitlines()
    values = dict(line.rsplit(" ", 1) for line in lines if not line.startswith("#"))
    gates = int(values['gpsfsm_requests_total{endpoint="gate",status="200"}'])
    assert gates >= 1
    assert int(values['gpsfsm_request_seconds_bucket{endpoint="gate",le="+Inf"}']) >= gates
    assert values["gpsfsm_workers"] == "1"
    accepted = 'gpsfsm_gate_verdicts_total{verdict="accepted",reason="passed"}'
    undecided = 'gpsfsm_gate_verdicts_total{verdict="undecided",reason="inconclusive"}'
    before = {name: int(values.get(name, 0)) for name in (accepted, undecided)}
    assert before[accepted] >= 1
    client.post("/v1/gate", json={"plan": GOOD})
    client.post("/v1/gate", json={"colour": "a verdict"})  # an error is a refusal, too
    counted = client.get("/metrics").text
    assert f"{accepted} {before[accepted] + 1}\n" in counted
    assert f"{undecided} {before[undecided] + 1}\n" in counted
    assert values["gpsfsm_queue_up"] == "1"
    named = [line.split()[2] for line in lines if line.startswith("# TYPE")]
    assert len(named) == len(set(named))
    page = (REPO / "docs/service.md").read_text("utf-8")
    assert [name for name in named if f"`{name}`" not in page] == []


def test_the_service_is_well(client: httpx.Client) -> None:
    response = client.get("/health")
    assert response.status_code == 200
    assert response.json() == {
        "status": "ok",
        "version": gpsfsm.__version__,
        "workers": 1,
        "gate_workers": 1,
        "queue": "up",
        "stopper": "off",
    }


@pytest.mark.parametrize("named", [False, True])
def test_a_file_around_the_service_decides_nothing(named: bool, tmp_path: Path) -> None:
    """Capabilities without resources let a robot drive to two places at once."""
    file = tmp_path / "gpsfsm.toml"
    file.write_text("builtin-capabilities = false\n", encoding="utf-8")
    plan = f'<Plan><Control type="parallel_all">{runner()}{runner(x="9")}</Control></Plan>'
    service = Service(*(("--config", file) if named else ()), folder=tmp_path)
    service.command = [word for word in service.command if word != "--isolated"]
    with service, service.client() as client:
        document = client.post("/v1/gate", json={"plan": plan}).json()
    assert document["verdict"] == ("accepted" if named else "rejected")


def test_options_without_any_effect_are_refused(client: httpx.Client) -> None:
    for name, value in {"deadline_s": 5.0, "max_scenarios": 1, "select": ["GP3"]}.items():
        request = {"plan": GOOD, "task": TASK, "options": {name: value}}
        response = client.post("/v1/grade", json=request)
        assert response.status_code == 422
        assert f"{name} has no effect on grade: " in response.json()["detail"]
    request = {"plan": GOOD, "options": {"ignore": ["GP111"]}}
    response = client.post("/v1/gate", json=request)
    assert (response.status_code, response.json()["verdict"]) == (422, "undecided")
    assert "ignore has no effect on a gate" in response.json()["detail"]
    assert client.post("/v1/gate", json={**request, "fail_on": "warning"}).status_code == 200
