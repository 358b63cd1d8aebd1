"""Who may ask: settings that would leave the service open are refused, and so are strangers."""

from __future__ import annotations

import asyncio
import socket
import subprocess
import sys
from ipaddress import ip_address
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import httpx
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.cli import main
from gpsfsm.errors import UsageError
from gpsfsm.generation.providers.address import Secret, is_loopback
from gpsfsm.service import Settings, app
from gpsfsm.service.settings import host_of
from tests.service.support import GOOD, Service

if TYPE_CHECKING:
    from pathlib import Path

TOKEN = "t0k3n-of-sixteen-letters"  # noqa: S105
OTHER = "another-of-sixteen-letters"
BEGUN = ("/nowhere/q.db: the journal cannot be opened", "cannot serve at 192.0.2.1")
"""Told when the service has begun, so by a process of its own."""


def response_to(settings: Settings, path: str = "/v1/rules", **headers: str) -> httpx.Response:
    """An answer of the application itself, without processes: only the guard is of interest."""
    transport = httpx.ASGITransport(app(settings))

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.get(path, headers=headers)

    return asyncio.run(ask())


def status_of(
    headers: list[tuple[str, str]], target: str = "/v1/rules", settings: Settings | None = None
) -> int:
    """What the application answers to exactly these headers."""
    sent: list[Any] = []

    async def send(message: Any) -> None:
        sent.append(message)

    async def receive() -> Any:
        return {"type": "http.request", "body": b"", "more_body": False}

    lines = [(name.encode(), value.encode("latin-1")) for name, value in headers]
    scope = {"type": "http", "method": "GET", "path": target, "headers": lines, "query_string": b""}
    whole = {**scope, "client": ("127.0.0.1", 1), "http_version": "1.1", "scheme": "http"}
    asyncio.run(app(settings or Settings())({**whole, "root_path": ""}, receive, send))
    status: int = sent[0]["status"]
    return status


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        *(("127.0.0.1", True), ("127.9.9.9", True), ("::1", True), ("localhost", True)),
        *(("::ffff:127.0.0.1", True), ("::ffff:7f00:1", True), ("::ffff:192.168.1.2", False)),
        *(("0.0.0.0", False), ("::", False), ("192.168.1.2", False), ("", False)),  # noqa: S104
        *(("localhost.example", False), ("127.0.0.1.example", False), ("robot", False)),
    ],
)
def test_only_loopback_needs_no_token(host: str, loopback: bool) -> None:
    assert is_loopback(host) is loopback
    if loopback:
        assert not Settings(host=host).tokens
    else:
        with pytest.raises(UsageError, match="token is needed"):
            Settings(host=host)
    assert Settings(host=host, tokens=(Secret(TOKEN),)).tokens


@pytest.mark.parametrize(
    "wrong",
    [
        {"tokens": (Secret("short"),)},
        {"port": 70_000},
        {"workers": 0},
        {"memory_mb": 100},
        {"request_s": 0.0},
        {"request_s": float("nan")},
        {"max_body": -1},
    ],
)
def test_settings_that_make_no_sense(wrong: dict[str, Any]) -> None:
    with pytest.raises(UsageError):
        Settings(**wrong)


@pytest.mark.parametrize(
    "shown",
    [None, "", "Bearer", f"Bearer {TOKEN}x", f"Bearer {TOKEN[:-1]}", f"Basic {TOKEN}", TOKEN],
)
def test_a_token_has_to_be_shown(shown: str | None) -> None:
    headers = {} if shown is None else {"authorization": shown}
    actual = response_to(Settings(tokens=(Secret(TOKEN),)), **headers)
    assert actual.status_code == 401
    assert actual.headers["www-authenticate"].startswith("Bearer")
    assert actual.headers["content-type"] == "application/problem+json"
    assert TOKEN not in actual.text


def test_who_shows_the_token_may_ask_under_any_name() -> None:
    settings = Settings(tokens=(Secret(TOKEN),))
    for kind in ("Bearer", "bearer"):
        headers = {"authorization": f"{kind} {TOKEN}", "host": "robots.example"}
        assert response_to(settings, **headers).status_code == 200
    assert response_to(settings, "/metrics").status_code == 401
    assert response_to(settings, "/health").status_code == 503  # no token: but no worker either


def test_names_of_the_service_can_be_added() -> None:
    assert response_to(Settings(), host="proxy.example").status_code == 421
    assert (
        response_to(Settings(hosts=("Proxy.example",)), host="proxy.example:80").status_code == 200
    )
    assert response_to(Settings(), host="[::1]:80").status_code == 200
    assert response_to(Settings(), origin="http://localhost:3000").status_code == 200


@pytest.mark.parametrize(
    "host",
    [
        *("[::1].evil.example", "localhost.evil.example", "127.0.0.1.evil.example", "evil.example"),
        *("localhost:80@evil.example", "localhost@evil.example", "evil.example:80", "localhost."),
        *(
            "[::1",
            "::1",
            "[::1]]",
            "[[::1]]",
            "[localhost]",
            "[127.0.0.1]",
            "[::1]:80:80",
            "[::1]x",
        ),
        *("localhost:", "localhost:x", "localhost:99999", "localhost:-1", "localhost:80 ", ""),
        *("localhost/", "localhost#", "localhost?", "localhost\\", "local host", "localhost,evil"),
        *("0", "2130706433", "127.1", "0x7f.0.0.1", "[::]", "[::ffff:203.0.113.9]", "[::1%25lo]"),
        *("localhost\x00", "lo\xe7alhost", "\u2113ocalhost".encode().decode("latin-1")),
    ],
)
def test_hosts_that_are_not_this_service(host: str) -> None:
    assert status_of([("host", host)]) == 421


@pytest.mark.parametrize(
    "host",
    [
        *("localhost", "LOCALHOST", "localhost:8321", "LocalHost:1", "127.0.0.1", "127.0.0.1:80"),
        *("[::1]", "[::1]:80", "[0:0:0:0:0:0:0:1]", "127.9.9.9"),
    ],
)
def test_hosts_that_are_this_service(host: str) -> None:
    assert status_of([("host", host)]) == 200
    assert status_of([("host", host), ("origin", f"http://{host}")]) == 200


@given(st.text(st.sampled_from("[]:.@1localhostevil/#,- \t"), max_size=20))
@example("[::1].evil")
@example("localhost:80@evil")
@example("[::1]:80")
def test_another_parser_sees_the_same_host(host: str) -> None:
    """One that takes whatever a page could be reached by."""
    name = host_of(host)
    if name is None:
        return
    parts = urlsplit(f"http://{host}/")
    assert parts.username is None
    assert parts.hostname is not None
    assert name == parts.hostname or ip_address(name) == ip_address(parts.hostname)


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ([("host", "localhost"), ("host", "evil.example")], 400),
        ([("host", "evil.example"), ("host", "localhost")], 400),
        ([("host", "localhost"), ("host", "localhost")], 400),
        ([("host", "localhost"), ("origin", "http://evil.example"), ("origin", "null")], 400),
        ([("host", "localhost"), ("content-type", "a/b"), ("content-type", "c/d")], 400),
        ([("host", "localhost"), ("sec-fetch-site", "none"), ("sec-fetch-site", "x")], 400),
        ([("host", "localhost"), ("origin", "null")], 403),
        ([("host", "localhost"), ("origin", "http://[::1].evil.example")], 403),
        ([("host", "localhost"), ("origin", "http://localhost.evil.example")], 403),
        ([("host", "localhost"), ("origin", "http://localhost:80@evil.example")], 403),
        ([("host", "localhost"), ("origin", "file://localhost")], 403),
        ([("host", "localhost"), ("origin", "localhost")], 403),
        ([], 421),
    ],
)
def test_headers_that_contradict_themselves(headers: list[tuple[str, str]], status: int) -> None:
    assert status_of(headers) == status


@pytest.mark.parametrize("target", ["http://localhost/v1/rules", "*", "localhost:80", ""])
def test_targets_that_are_no_paths(target: str) -> None:
    assert status_of([("host", "localhost")], target) == 400


def test_two_tokens_are_let_in_and_no_third_one() -> None:
    settings = Settings(tokens=(Secret(TOKEN), Secret(OTHER)))
    seen = []
    for shown in (TOKEN, OTHER, f"{TOKEN}x", ""):
        headers = [("host", "x"), ("authorization", f"Bearer {shown}")]
        seen.append(status_of(headers, settings=settings))
    assert seen == [200, 200, 401, 401]
    twice = [("host", "x"), ("authorization", "Bearer x"), ("authorization", f"Bearer {TOKEN}")]
    assert status_of(twice, settings=settings) == 400


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "there is no token"),
        ("\n \n", "there is no token"),
        (f"{TOKEN}\n{TOKEN}\n", "twice"),
        (f"{TOKEN} and more\n", "cannot be one"),
        (f"{TOKEN}\nshort\n", "at least 16 characters"),
    ],
)
def test_files_of_tokens_that_make_no_sense(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, message: str
) -> None:
    file = tmp_path / "tokens"
    file.write_text(text)
    assert main(["serve", "--isolated", "--port", "0", "--token-file", str(file)]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert TOKEN not in said


@pytest.mark.parametrize("name", ["evil.example:80", "a b", "[::1].evil.example", "", "a.", "a/b"])
def test_names_that_are_none(name: str) -> None:
    with pytest.raises(UsageError, match="not a host name"):
        Settings(hosts=(name,))


@pytest.mark.parametrize(
    ("headers", "status", "detail"),
    [
        ({"host": "robot.example:80"}, 421, "start the service with --allow-name robot.example"),
        ({"host": "[2001:db8::7]"}, 421, "start the service with --allow-name [2001:db8::7]"),
        ({"host": "a b"}, 421, "is not a host name"),
        ({"origin": "https://robot.example"}, 403, "start it with --allow-name robot.example"),
        ({"sec-fetch-site": "cross-site"}, 403, "pages of other sites"),
    ],
)
def test_a_refusal_names_the_option_that_helps(
    headers: dict[str, str], status: int, detail: str
) -> None:
    answer = response_to(Settings(), **headers)
    assert (answer.status_code, detail in answer.json()["detail"]) == (status, True), answer.text


@pytest.mark.parametrize("name", ["robot.example", "[2001:db8::7]"])
def test_the_option_that_is_named_helps(name: str) -> None:
    assert response_to(Settings(hosts=(name,)), "/livez", host=name).status_code == 200


def test_a_refused_token_is_told_from_a_missing_one() -> None:
    settings = Settings(tokens=(Secret(TOKEN),))
    missing, other = response_to(settings), response_to(settings, authorization="Bearer x")
    assert (missing.status_code, other.status_code) == (401, 401)
    for each in (missing, other):
        assert "--token-file" in each.json()["detail"]
        assert "GPSFSM_TOKEN" in each.json()["detail"]
    assert missing.json()["detail"].startswith("a token is needed: send the header")
    assert other.json()["detail"].startswith("the Authorization header has no token of this")


def test_with_a_token_it_serves_everybody_who_has_it(tmp_path: Any) -> None:
    file = tmp_path / "token"
    file.write_text(f"{TOKEN}\n")
    words = ("--host", "0.0.0.0", "--token-file", file, "--workers", "1")  # noqa: S104
    with Service(*words) as service:
        service.address = service.address.replace("0.0.0.0", "127.0.0.1")  # noqa: S104
        with service.client() as client:
            refused = client.post("/v1/gate", json={"plan": GOOD})
            assert (refused.status_code, refused.json()["verdict"]) == (401, "undecided")
            client.headers["authorization"] = f"Bearer {TOKEN}"
            assert client.post("/v1/gate", json={"plan": GOOD}).json()["verdict"] == "accepted"
        assert not any(TOKEN in each for each in service.said)


def test_without_the_extra_it_says_how_to_get_it() -> None:
    code = (
        "import sys\n"
        "sys.modules['starlette'] = sys.modules['uvicorn'] = None\n"
        "from gpsfsm.cli import main\n"
        "sys.exit(main(['serve', '--isolated', '--port', '0']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "pip install 'gpsfsm[serve]', or '.[serve]' in a clone" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--host", "0.0.0.0"), "a token is needed"),  # noqa: S104
        (("--world", "w.yaml"), "--world needs --journal"),
        (("--journal", ""), "needs the name of a file"),
        (("--journal", "q.db", "--model", "replay:x"), "--model needs --world"),
        (("--token-file", "/nowhere/token"), "/nowhere/token: cannot be read"),
        (("--journal", "/nowhere/q.db"), "/nowhere/q.db: the journal cannot be opened"),
        (("--host", "192.0.2.1", "--token-file", "TOKEN"), "cannot serve at 192.0.2.1"),
    ],
)
def test_what_keeps_it_from_beginning(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: tuple[str, ...],
    message: str,
) -> None:
    (tmp_path / "TOKEN").write_text(TOKEN)
    if message not in BEGUN:
        monkeypatch.chdir(tmp_path)
        assert main(["serve", "--isolated", "--port", "0", *words]) == 2
        assert message in capsys.readouterr().err
        return
    done = subprocess.run(
        [sys.executable, "-m", "gpsfsm", "serve", "--isolated", "--port", "0", *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_a_port_in_use_is_told_with_what_to_do() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        words = [sys.executable, "-m", "gpsfsm", "serve", "--isolated", "--port", str(port)]
        done = subprocess.run(words, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 2
    assert done.stderr == (
        f"gpsfsm: cannot serve at 127.0.0.1:{port}: Address already in use; "
        "--port takes another port\n"
    )
