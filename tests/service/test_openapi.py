"""The OpenAPI document: about every endpoint, and answers obey it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import jsonschema
import pytest

from gpsfsm.service.registry import all_endpoints
from gpsfsm.service.registry import document as written
from tests.service.support import BAD, GOOD, ended

if TYPE_CHECKING:
    import httpx


def shape(document: dict[str, Any], path: str, method: str, status: int, media: str) -> Any:
    operation = document["paths"][path][method]
    schema = operation["responses"][str(status)]["content"][media]["schema"]
    return {**schema, "components": document["components"]}


def test_it_is_about_every_endpoint(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    operations = {
        (path, method.upper()) for path, each in document["paths"].items() for method in each
    }
    assert operations == {(each.path, each.method) for each in all_endpoints()}
    names = [one["operationId"] for each in document["paths"].values() for one in each.values()]
    assert len(names) == len(set(names))


def test_it_is_made_once_for_each_place_of_the_service() -> None:
    assert written("/gpsfsm") is written("/gpsfsm") != written()


def test_every_reference_leads_somewhere(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    waiting: list[Any] = [document["paths"], document["components"]]
    seen = set()
    while waiting:
        each = waiting.pop()
        if isinstance(each, dict):
            if isinstance(each.get("$ref"), str):
                seen.add(each["$ref"])
            waiting += each.values()
        elif isinstance(each, list):
            waiting += each
    names = {f"#/components/schemas/{name}" for name in document["components"]["schemas"]}
    assert seen
    assert seen <= names


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/v1/check", {"plan": BAD}, 200),
        ("/v1/gate", {"plan": BAD}, 200),
        ("/v1/gate", {"plan": 3}, 422),
        ("/v1/fix", {"plan": BAD}, 200),
        ("/v1/grade", {"plan": GOOD, "task": "steps: [{do: {interface: a/Go}}]"}, 200),
        ("/v1/plans", {"plan": GOOD}, 200),
        ("/v1/plans", {"plan": BAD}, 422),
    ],
)
def test_answers_obey_it(
    client: httpx.Client, path: str, body: dict[str, Any], status: int
) -> None:
    document = client.get("/openapi.json").json()
    response = client.post(path, json=body)
    assert response.status_code == status, response.text
    media = "application/json" if status == 200 else "application/problem+json"
    assert response.headers["content-type"] == media
    jsonschema.validate(response.json(), shape(document, path, "post", status, media))


def test_answers_about_plans_obey_it(client: httpx.Client) -> None:
    document = client.get("/openapi.json").json()
    plan = client.post("/v1/plans", json={"plan": GOOD}).json()["plan_id"]
    ended(client, plan)
    for path in ("/v1/plans", "/v1/plans/{plan}", "/v1/rules", "/v1/rules/{rule}", "/health"):
        response = client.get(path.format(plan=plan, rule="GP302"))
        wanted = shape(document, path, "get", 200, "application/json")
        jsonschema.validate(response.json(), wanted)
    for name in ("cancel", "completion"):
        response = client.post(f"/v1/plans/{plan}/{name}")
        wanted = shape(document, f"/v1/plans/{{plan}}/{name}", "post", 200, "application/json")
        jsonschema.validate(response.json(), wanted)
