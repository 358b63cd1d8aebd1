"""nginx with TLS in front of a service, as docs/service.md has it."""

from __future__ import annotations

import re
import shutil
import socket
import subprocess
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING

import pytest

from tests.conftest import REPO

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from tests.service.support import Service

_PAGE = (REPO / "docs" / "service.md").read_text(encoding="utf-8")
_BLOCK = re.compile(r"^```nginx\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_COMMAND = re.compile(r"^gpsfsm serve (.*--root-path.*)$", re.MULTILINE)
_MAIN = """daemon off;
pid {folder}/nginx.pid;
error_log {folder}/error.log;
events {{}}
http {{
  access_log {folder}/access.log;
  client_body_temp_path {folder}/body;
  proxy_temp_path {folder}/proxy;
  fastcgi_temp_path {folder}/fastcgi;
  uwsgi_temp_path {folder}/uwsgi;
  scgi_temp_path {folder}/scgi;
{servers}
}}
"""


def options_on_page(**files: Path) -> list[str]:
    """The options of the service that the page shows, with these files for those that it names."""
    (line,) = _COMMAND.findall(_PAGE)
    words: list[str] = []
    for word in line.split():
        name = words[-1].removeprefix("--").replace("-", "_") if words else ""
        words.append(str(files.get(name, word)))
    return words


@contextmanager
def behind_nginx(service: Service, folder: Path, *, tls: bool = True) -> Iterator[str]:
    """The address of the proxy, ``https://localhost:PORT``; its certificate is ``tls.crt``.

    Without ``tls`` it speaks HTTP: a browser would not believe the certificate.
    """
    program = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
    openssl = shutil.which("openssl")
    if program is None or openssl is None:
        pytest.skip("nginx or openssl is not installed")
    subprocess.run(
        [
            *(openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1"),
            *("-subj", "/CN=plant.example", "-addext", "subjectAltName=DNS:localhost"),
            *("-keyout", str(folder / "tls.key"), "-out", str(folder / "tls.crt")),
        ],
        capture_output=True,
        check=True,
    )
    with socket.create_server(("127.0.0.1", 0)) as probe:
        port = probe.getsockname()[1]
    (block,) = _BLOCK.findall(_PAGE)
    for old, new in (
        ("listen 443 ssl", f"listen 127.0.0.1:{port} ssl"),
        ("/etc/nginx/tls/plant.crt", str(folder / "tls.crt")),
        ("/etc/nginx/tls/plant.key", str(folder / "tls.key")),
        ("http://127.0.0.1:8321", service.address),
        ("plant.example", "localhost"),
    ):
        assert old in block, old
        block = block.replace(old, new)
    if not tls:
        block = re.sub(r"^ *ssl_.*\n", "", block.replace(" ssl;", ";"), flags=re.MULTILINE)
    main = folder / "nginx.conf"
    main.write_text(_MAIN.format(folder=folder, servers=block), encoding="utf-8")
    words = [program, "-e", str(folder / "error.log"), "-p", str(folder), "-c", str(main)]
    nginx = subprocess.Popen(words, stderr=subprocess.PIPE)
    try:
        _wait(port, nginx)
        yield f"{'https' if tls else 'http'}://localhost:{port}"
    finally:
        nginx.terminate()
        nginx.wait(30)
        assert nginx.stderr is not None
        nginx.stderr.close()


def _wait(port: int, nginx: subprocess.Popen[bytes]) -> None:
    until_s = time.monotonic() + 30
    while True:
        assert nginx.poll() is None, nginx.stderr and nginx.stderr.read().decode()
        try:
            socket.create_connection(("127.0.0.1", port), 1).close()
        except OSError:
            assert time.monotonic() < until_s
            time.sleep(0.05)
        else:
            return
