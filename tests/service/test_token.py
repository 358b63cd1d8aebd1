"""Who may ask: settings that would leave the service open are refused, and so are strangers."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import httpx
import pytest

from gpsfsm.cli import main
from gpsfsm.errors import UsageError
from gpsfsm.generation.providers.secret import Secret
from gpsfsm.service import Settings, app
from gpsfsm.service.settings import is_loopback
from tests.service.support import GOOD, Service

if TYPE_CHECKING:
    from pathlib import Path

TOKEN = "t0k3n-of-sixteen-letters"  # noqa: S105
BEGUN = ("/nowhere/q.db: the journal cannot be opened", "cannot serve at 192.0.2.1")
"""Told when the service has begun, so by a process of its own."""


def asked(settings: Settings, path: str = "/v1/rules", **headers: str) -> httpx.Response:
    """An answer of the application itself, without processes: only the guard is of interest."""
    transport = httpx.ASGITransport(app(settings))

    async def ask() -> httpx.Response:
        async with httpx.AsyncClient(transport=transport, base_url="http://localhost") as client:
            return await client.get(path, headers=headers)

    return asyncio.run(ask())


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        *(("127.0.0.1", True), ("127.9.9.9", True), ("::1", True), ("localhost", True)),
        *(("0.0.0.0", False), ("::", False), ("192.168.1.2", False), ("", False)),  # noqa: S104
        *(("localhost.example", False), ("127.0.0.1.example", False), ("robot", False)),
    ],
)
def test_only_loopback_needs_no_token(host: str, loopback: bool) -> None:
    assert is_loopback(host) is loopback
    if loopback:
        assert not Settings(host=host).token
    else:
        with pytest.raises(UsageError, match="token is needed"):
            Settings(host=host)
    assert Settings(host=host, token=Secret(TOKEN)).token


@pytest.mark.parametrize(
    "wrong",
    [
        {"token": Secret("short")},
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
    found = asked(Settings(token=Secret(TOKEN)), **headers)
    assert found.status_code == 401
    assert found.headers["www-authenticate"].startswith("Bearer")
    assert found.headers["content-type"] == "application/problem+json"
    assert TOKEN not in found.text


def test_who_shows_the_token_may_ask_under_any_name() -> None:
    settings = Settings(token=Secret(TOKEN))
    for kind in ("Bearer", "bearer"):
        headers = {"authorization": f"{kind} {TOKEN}", "host": "robots.example"}
        assert asked(settings, **headers).status_code == 200
    assert asked(settings, "/metrics").status_code == 401
    assert asked(settings, "/health").status_code == 503  # no token: but no worker either


def test_names_of_the_service_can_be_added() -> None:
    assert asked(Settings(), host="proxy.example").status_code == 421
    assert asked(Settings(hosts=("Proxy.example",)), host="proxy.example:80").status_code == 200
    assert asked(Settings(), host="[::1]:80").status_code == 200
    assert asked(Settings(), origin="http://localhost:3000").status_code == 200


def test_with_a_token_it_serves_everybody_who_has_it(tmp_path: Any) -> None:
    file = tmp_path / "token"
    file.write_text(f"{TOKEN}\n")
    words = ("--host", "0.0.0.0", "--token-file", file, "--workers", "1")  # noqa: S104
    with Service(*words) as service:
        service.address = service.address.replace("0.0.0.0", "127.0.0.1")  # noqa: S104
        with service.client() as client:
            refused = client.post("/v1/gate", json={"plan": GOOD})
            assert (refused.status_code, refused.json()["verdict"]) == (401, "refuse")
            client.headers["authorization"] = f"Bearer {TOKEN}"
            assert client.post("/v1/gate", json={"plan": GOOD}).json()["verdict"] == "accept"
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
    assert "pip install 'gpsfsm[serve]'" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("words", "told"),
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
    told: str,
) -> None:
    (tmp_path / "TOKEN").write_text(TOKEN)
    if told not in BEGUN:
        monkeypatch.chdir(tmp_path)
        assert main(["serve", "--isolated", "--port", "0", *words]) == 2
        assert told in capsys.readouterr().err
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
    assert told in done.stderr
    assert "Traceback" not in done.stderr
