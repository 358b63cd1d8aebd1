"""Servers that remember who has shown them which key, and commands that are run to be fooled."""

from __future__ import annotations

import atexit
import json
import os
import threading
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO, TextIOWrapper
from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from gpsfsm.cli import main

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

__all__ = ["KEYS", "Done", "Server", "done", "servers"]

KEYS = {
    "GPSFSM_API_KEY": "key-of-gpsfsm-0123456789",
    "OPENAI_API_KEY": "sk-openai-0123456789",
    "OLLAMA_API_KEY": "ollama-0123456789",
    "GPU_API_KEY": "gpu-0123456789",
    "AWS_API_KEY": "aws-0123456789",
    "AWS_SECRET_ACCESS_KEY": "aws-secret-0123456789",
}
_ANSWER = (
    '<Plan><Runner interface="generic_capabilities/WaitRunner" provider="x" seconds="1"/></Plan>'
)


class Server(ThreadingHTTPServer):
    """Answers every request as a model server would, and keeps what it was shown."""

    daemon_threads = True
    block_on_close = False

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), _Handler)
        self.shown: list[str] = []
        threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True).start()

    @property
    def host(self) -> str:
        return f"127.0.0.1:{self.server_address[1]}"

    def handle_error(self, *_: object) -> None:
        """Clients may go away whenever they like."""


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Server

    def log_message(self, *_: object) -> None:
        pass

    def do_GET(self) -> None:
        self._answer({"data": [], "models": []})

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers.get("Content-Length") or 0))
        message = {"role": "assistant", "content": _ANSWER}
        choice = {"index": 0, "message": message, "finish_reason": "stop"}
        self._answer({"choices": [choice], "message": message, "done": True})

    def _answer(self, data: Mapping[str, Any]) -> None:
        self.server.shown.append(f"{self.path} {self.headers}")
        content = json.dumps(data).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)


@cache
def servers() -> tuple[Server, Server]:
    """That of the user, and that of whoever has written the project."""
    return Server(), Server()


@dataclass(frozen=True)
class Done:
    """How a command ended, and what it has written."""

    code: int
    out: str
    errors: str


def done(words: Sequence[str], folder: Path, around: Mapping[str, str]) -> Done:
    """A command in this process, which spares the time of starting one."""
    kept = {name: os.environ[name] for name in ("PATH", "PYTHONPATH") if name in os.environ}
    out, errors = (TextIOWrapper(BytesIO(), "utf-8") for _ in range(2))
    with (
        patch.dict(os.environ, {**kept, **around}, clear=True),
        chdir(folder),
        redirect_stdout(out),
        redirect_stderr(errors),
    ):
        code = main(list(words))
    written = []
    for each in (out, errors):
        each.flush()
        written.append(each.buffer.getvalue().decode())
    assert "Traceback" not in written[1], written[1]
    return Done(code, *written)


@atexit.register
def _close() -> None:
    if servers.cache_info().currsize:
        for each in servers():
            each.server_close()
