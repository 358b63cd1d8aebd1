"""What a page shows of a plan, over HTTP."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import jsonschema
import pytest

from gpsfsm.api import check_options
from gpsfsm.checking import check_text
from gpsfsm.viewing.document import document
from gpsfsm.viewing.plans import Viewed
from tests.service.support import BAD, GOOD
from tests.service.test_openapi import shape

if TYPE_CHECKING:
    import httpx

TASK = "steps:\n  - do: {interface: b/Other}\n"
HOSTILE = '<Plan><Runner interface="&lt;/script&gt;" provider="a/Go"/></Plan>'


@pytest.mark.parametrize("plan", [GOOD, BAD, HOSTILE, "<Plan><Control", "no plan", ""])
def test_a_view_is_the_document_of_the_command(client: httpx.Client, plan: str) -> None:
    response = client.post("/v1/view", json={"plan": plan, "name": "a.xml"})
    assert response.status_code == 200, response.text
    options, text = check_options(), plan.encode()
    wanted = document([Viewed(text, check_text(text, "a.xml", options))], options)
    assert response.json() == json.loads(json.dumps(wanted))
    described = client.get("/openapi.json").json()
    jsonschema.validate(
        response.json(), shape(described, "/v1/view", "post", 200, "application/json")
    )


def test_options_and_a_task_reach_the_view(client: httpx.Client) -> None:
    body = {"plan": GOOD, "task": TASK, "options": {"engine": "fabric-v2"}}
    (plan,) = client.post("/v1/view", json=body).json()["plans"]
    assert plan["engine"] == "fabric-v2"
    assert plan["task"]["grade"] == "partial"


def test_a_task_that_names_files_is_refused(client: httpx.Client) -> None:
    body = {"plan": GOOD, "task": f"{TASK}not_answers: /etc/passwd\n"}
    assert client.post("/v1/view", json=body).status_code == 422


def test_another_plan_is_compared_with_it(client: httpx.Client) -> None:
    other = GOOD.replace("a/Go", "a/Come")
    body = {"plan": GOOD, "name": "before", "other": other, "other_name": "now"}
    actual = client.post("/v1/view", json=body).json()
    assert [plan["name"] for plan in actual["plans"]] == ["before", "now"]
    assert actual["diff"]["verdict"] == "different"
    assert actual["diff"]["words"]
    same = client.post("/v1/view", json={"plan": GOOD, "other": GOOD}).json()
    assert same["diff"]["verdict"] == "equal"
