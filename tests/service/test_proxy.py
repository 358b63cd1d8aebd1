"""The service behind nginx with TLS, both set up as docs/service.md says."""

from __future__ import annotations

import ssl
from typing import TYPE_CHECKING

import httpx
import pytest

from tests.service.proxy import behind_nginx, options_on_page
from tests.service.support import GOOD, Service, ended, events
from tests.service.test_token import TOKEN

if TYPE_CHECKING:
    from collections.abc import Iterator


@pytest.fixture(scope="module")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    folder = tmp_path_factory.mktemp("plant")
    (folder / "tokens").write_text(TOKEN)
    words = options_on_page(token_file=folder / "tokens", journal=folder / "queue.db")
    with Service(*words, "--failure", "0", "--workers", "1") as server:
        yield server


@pytest.fixture(scope="module")
def plant(
    service: Service, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[str, ssl.SSLContext]]:
    folder = tmp_path_factory.mktemp("nginx")
    with behind_nginx(service, folder) as address:
        yield address, ssl.create_default_context(cafile=str(folder / "tls.crt"))


@pytest.fixture
def client(plant: tuple[str, ssl.SSLContext]) -> Iterator[httpx.Client]:
    address, context = plant
    shown = {"authorization": f"Bearer {TOKEN}"}
    base = f"{address}/gpsfsm"
    with httpx.Client(base_url=base, headers=shown, verify=context, trust_env=False) as connection:
        yield connection


def test_it_is_there_below_the_prefix(client: httpx.Client) -> None:
    assert client.get("/livez").json() == {"status": "alive"}
    assert client.get("/readyz").status_code == 200
    assert client.post("/v1/gate", json={"plan": GOOD}).json()["verdict"] == "accepted"
    assert client.get("/openapi.json").json()["servers"] == [{"url": "/gpsfsm"}]


def test_the_prefix_alone_leads_to_the_page(client: httpx.Client) -> None:
    answer = client.get(str(client.base_url).rstrip("/"), follow_redirects=True)
    assert answer.url.path == "/gpsfsm/"
    assert "gpsfsm-live" in answer.text


def test_a_token_is_needed(plant: tuple[str, ssl.SSLContext]) -> None:
    address, context = plant
    answer = httpx.get(f"{address}/gpsfsm/v1/rules", verify=context, trust_env=False)
    assert answer.status_code == 401
    assert "Authorization: Bearer" in answer.json()["detail"]


def test_events_come_as_they_happen(client: httpx.Client) -> None:
    plan = client.post("/v1/plans", json={"plan": GOOD}).json()["plan_id"]
    ended(client, plan)
    assert events(client, plan)[-1][0] == "end"


def test_the_log_has_the_number_that_the_proxy_gives(
    service: Service, client: httpx.Client
) -> None:
    number = client.get("/v1/rules").headers["x-request-id"]
    assert len(number) == 32, "that of nginx"
    assert service.stop() == 0
    (line,) = (line for line in service.said if f"request {number}" in line)
    assert "GET /gpsfsm/v1/rules 200 " in line
    assert ", token 0, " in line
