"""The entrance: numbers of requests, the access log, and the prefix of a reverse proxy."""

from __future__ import annotations

import asyncio
import json
import re
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from gpsfsm import logs
from gpsfsm.errors import UsageError
from gpsfsm.generation.providers.address import Secret
from gpsfsm.service import Settings, app
from gpsfsm.service.settings import is_prefix
from tests.service.support import BAD, GOOD, Service
from tests.service.test_token import TOKEN

if TYPE_CHECKING:
    from pathlib import Path

PROXY = "10.0.0.7"


def answer_to(
    path: str, *, peer: str = "127.0.0.1", settings: Settings | None = None, **headers: str
) -> httpx.Response:
    """An answer of the application itself, without processes."""
    transport = httpx.ASGITransport(app(settings or Settings()), client=(peer, 1))
    sent = {name.replace("_", "-"): value for name, value in headers.items()}

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.get(path, headers=sent)

    return asyncio.run(ask())


@pytest.mark.parametrize("sane", ["abc-7", "a" * 128, "01H:x/y+z=@~._"])
def test_a_sane_number_of_a_request_is_kept(sane: str) -> None:
    assert answer_to("/livez", x_request_id=sane).headers["x-request-id"] == sane


@pytest.mark.parametrize("odd", ["", "a b", "a" * 129, "<script>", 'a"b', "ä"])
def test_any_other_one_is_replaced(odd: str) -> None:
    sent = {"x_request_id": odd} if odd.isascii() else {}
    assert re.fullmatch(r"[0-9a-f]{16}", answer_to("/livez", **sent).headers["x-request-id"])


def test_refusals_have_a_number_too() -> None:
    answer = answer_to("/v1/rules", host="other.example", x_request_id="r-1")
    assert (answer.status_code, answer.headers["x-request-id"]) == (421, "r-1")


def access(written: str) -> list[dict[str, Any]]:
    return [row for row in map(json.loads, written.splitlines()) if row["event"] == "request"]


def test_a_row_of_the_access_log(capsys: pytest.CaptureFixture[str]) -> None:
    with logs.writing("info", "json"):
        answer_to("/v1/nothing?token=secret", x_request_id="r-1", authorization="Bearer secret")
    written = capsys.readouterr().err
    (row,) = access(written)
    assert row.pop("duration_ms") >= 0
    assert row.pop("bytes") > 50
    del row["time"]
    assert row.pop("message").startswith("GET /v1/nothing 404 ")
    assert row == {
        **{"level": "info", "event": "request", "method": "GET", "path": "/v1/nothing"},
        **{"status": 404, "client": "this machine", "address": "127.0.0.1", "request_id": "r-1"},
    }
    assert "secret" not in written


def test_the_access_log_has_the_verdicts_of_the_gate(tmp_path: Path) -> None:
    words = ("--log-format", "json", "--workers", "1", "--journal", tmp_path / "q.db")
    with Service(*words) as service:
        with service.client() as client:
            for plan in (GOOD, BAD):
                client.post("/v1/gate", json={"plan": plan})
            client.post("/v1/gate", content=b"<Plan/>", headers={"content-type": "text/plain"})
            client.post("/v1/check", json={"plan": GOOD})
        assert service.stop() == 0
    rows = [row for row in map(json.loads, service.said) if row["event"] == "request"]
    gates = [row for row in rows if row["path"] == "/v1/gate"]
    assert [row["verdict"] for row in gates] == ["accepted", "rejected", "undecided"]
    assert " B, rejected, this machine, request " in gates[1]["message"]
    assert all("verdict" not in row for row in rows if row["path"] != "/v1/gate")


def test_probes_are_logged_for_developers_alone(capsys: pytest.CaptureFixture[str]) -> None:
    for level, count in (("info", 0), ("debug", 1)):
        with logs.writing(level, "json"):  # type: ignore[arg-type]
            answer_to("/livez")
        assert len(access(capsys.readouterr().err)) == count


def test_nobody_forges_a_line_of_the_log(capsys: pytest.CaptureFixture[str]) -> None:
    path = "/a%0agpsfsm:%20forged%1b[2J"
    for output_format in logs.FORMATS:
        with logs.writing("info", output_format):
            answer_to(path)
    text, row = capsys.readouterr().err.splitlines()
    assert "forged" in text
    assert text.startswith("gpsfsm: 2")
    assert json.loads(row)["path"] == "/a\\x0agpsfsm: forged\\x1b[2J"


def test_a_whole_service_writes_nothing_but_objects(tmp_path: Path) -> None:
    (tmp_path / "token").write_text(TOKEN)
    words = ("--log-format", "json", "--log-level", "debug", "--token-file", tmp_path / "token")
    with Service(*words, "--journal", tmp_path / "q.db", "--workers", "1") as service:
        with service.client(headers={"authorization": f"Bearer {TOKEN}"}) as client:
            assert client.post("/v1/check?after=5", json={"plan": BAD}).status_code == 200
            assert client.post("/v1/plans", json={"plan": GOOD}).status_code == 200
        with service.connect() as connection:
            connection.sendall(b"nonsense\r\n\r\n")
            assert connection.recv(100).startswith(b"HTTP/1.1 400")
        assert service.stop() == 0
    said = [json.loads(line) for line in service.said]
    events = [row["event"] for row in said]
    assert {"serving", "request", "uvicorn"} <= set(events)
    assert any("Invalid HTTP request" in row["message"] for row in said)
    whole = "".join(service.said)
    assert not any(each in whole for each in (TOKEN, "a/Go", "after="))


def test_what_keeps_it_from_beginning_is_an_object_as_well(tmp_path: Path) -> None:
    words = ("--log-format", "json", "--journal", "/nowhere/q.db", "--workers", "1")
    service = Service(*words)
    with pytest.raises(AssertionError):
        service.start()
    assert service.process.wait(60) == 2
    service.finish()
    (failed,) = (row for row in map(json.loads, service.said) if row["event"] == "failed")
    assert "cannot be opened" in failed["message"]


# ---- the prefix of a proxy -----------------------------------------------------------------------

BELOW = Settings(root_path="/plant/gpsfsm", proxies=(PROXY,), tokens=(Secret(TOKEN),))


@pytest.mark.parametrize(
    ("text", "good"),
    [
        *(("/gpsfsm", True), ("/robots/a-1/x_2", True), ("/~me", True), ("", False)),
        *(("/", False), ("/a/", False), ("a", False), ("//evil.example", False)),
        *(("/v1", False), ("/ui/x", False), ("/a/../b", False), ("/a b", False)),
        *(("/" + "a" * 200, False), ("/ä", False), ("/a?b", False), ("/a\n", False)),
    ],
)
def test_prefixes(text: str, good: bool) -> None:
    assert is_prefix(text) is good
    if not good and text:
        with pytest.raises(UsageError, match="not a root path"):
            Settings(root_path=text)


@pytest.mark.parametrize("path", ["/plant/gpsfsm/livez", "/livez"])
def test_it_answers_with_the_prefix_and_without(path: str) -> None:
    assert answer_to(path, settings=BELOW).json() == {"status": "alive"}


@pytest.mark.parametrize("path", ["/plant/livez", "/plant/gpsfsmx/livez", "/plant/gpsfsm//livez"])
def test_it_answers_to_no_other_prefix(path: str) -> None:
    shown = {"authorization": f"Bearer {TOKEN}"}
    assert answer_to(path, settings=BELOW, **shown).status_code == 404


def test_the_guard_sees_the_path_behind_the_prefix() -> None:
    assert answer_to("/plant/gpsfsm/v1/rules", settings=BELOW).status_code == 401
    answer = answer_to("/plant/gpsfsm/v1/gate", settings=BELOW)
    assert (answer.status_code, answer.json()["verdict"]) == (401, "undecided")


def test_the_prefix_alone_leads_to_the_page() -> None:
    answer = answer_to("/plant/gpsfsm?a=1", settings=BELOW)
    assert (answer.status_code, answer.headers["location"]) == (308, "/plant/gpsfsm/?a=1")


@pytest.mark.parametrize(
    ("peer", "forwarded", "server"),
    [
        (PROXY, {}, "/plant/gpsfsm"),
        (PROXY, {"x_forwarded_prefix": "/edge"}, "/edge"),
        (PROXY, {"x_forwarded_prefix": "/edge/"}, "/edge"),
        (PROXY, {"x_forwarded_prefix": "//evil.example"}, "/plant/gpsfsm"),
        ("10.0.0.8", {"x_forwarded_prefix": "/edge"}, "/plant/gpsfsm"),
    ],
)
def test_the_document_names_the_place(peer: str, forwarded: dict[str, str], server: str) -> None:
    headers = {"authorization": f"Bearer {TOKEN}", **forwarded}
    answer = answer_to("/openapi.json", peer=peer, settings=BELOW, **headers)
    assert answer.json()["servers"] == [{"url": server}]


def test_the_log_names_the_client_before_a_proxy(capsys: pytest.CaptureFixture[str]) -> None:
    with logs.writing("info", "json"):
        answer_to("/v1/rules", peer=PROXY, settings=BELOW, x_forwarded_for="198.51.100.7")
        answer_to("/v1/rules", peer="10.0.0.8", settings=BELOW, x_forwarded_for="198.51.100.7")
    rows = access(capsys.readouterr().err)
    assert [row["address"] for row in rows] == ["198.51.100.7", "10.0.0.8"]


def test_an_application_that_mounts_it_gives_it_a_prefix() -> None:
    from starlette.applications import Starlette
    from starlette.routing import Mount

    outer = Starlette(routes=[Mount("/deep", app(Settings()))])

    async def ask() -> list[httpx.Response]:
        transport = httpx.ASGITransport(outer, client=("127.0.0.1", 1))
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return [await client.get(f"/deep{path}") for path in ("/livez", "/openapi.json", "/")]

    live, document, page = asyncio.run(ask())
    assert live.json() == {"status": "alive"}
    assert document.json()["servers"] == [{"url": "/deep"}]
    assert "gpsfsm-live" in page.text
