"""A small editor: talks to ``gpsfsm lsp`` in the protocol, and shares no code with the server."""

from __future__ import annotations

import json
import os
import queue
import re
import subprocess
import threading
import time
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from tests.cli import support

CAPABILITIES: dict[str, Any] = {
    "general": {"positionEncodings": ["utf-16"]},
    "textDocument": {
        "publishDiagnostics": {
            "relatedInformation": True,
            "codeDescriptionSupport": True,
            "dataSupport": True,
            "tagSupport": {"valueSet": [1, 2]},
        },
        "hover": {"contentFormat": ["markdown", "plaintext"]},
        "completion": {"completionItem": {"snippetSupport": True}},
        "codeAction": {"resolveSupport": {"properties": ["edit"]}},
        "documentSymbol": {"hierarchicalDocumentSymbolSupport": True},
    },
}
WAIT_S = 60.0


class Editor:
    """One server with its documents, by address: the text, and the diagnostics it was told."""

    def __init__(
        self,
        root: Path,
        *,
        options: dict[str, Any] | None = None,
        capabilities: dict[str, Any] | None = None,
        greet: bool = True,
    ) -> None:
        self.root = root
        self.process = support.start("lsp", cwd=root, stdin=subprocess.PIPE)
        self.texts: dict[str, str] = {}
        self.versions: dict[str, int] = {}
        self.published: dict[str, dict[str, Any]] = {}
        self.notices: list[dict[str, Any]] = []
        self._answers: dict[int, dict[str, Any]] = {}
        self._incoming: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
        self._number = 0
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.server: dict[str, Any] = {}
        if greet:
            self.server = self.ask("initialize", self.greeting(options, capabilities))
            self.tell("initialized", {})

    def greeting(
        self, options: dict[str, Any] | None = None, capabilities: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        """What an editor says first."""
        return {
            "processId": os.getpid(),
            "rootUri": self.root.as_uri(),
            "capabilities": capabilities or CAPABILITIES,
            "initializationOptions": options,
        }

    def __enter__(self) -> Editor:
        return self

    def __exit__(self, *_: object) -> None:
        assert self.process.stdin is not None
        with suppress(OSError):
            self.process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(10)
        self.process.kill()
        self.process.wait()
        self._reader.join()
        for stream in (self.process.stdin, self.process.stdout, self.process.stderr):
            assert stream is not None
            stream.close()

    def uri(self, name: str) -> str:
        return (self.root / name).as_uri()

    def open(self, name: str, text: str, *, language: str = "xml") -> str:
        uri = self.uri(name)
        self.texts[uri], self.versions[uri] = text, 1
        self.published.pop(uri, None)
        item = {"uri": uri, "languageId": language, "version": 1, "text": text}
        self.tell("textDocument/didOpen", {"textDocument": item})
        return uri

    def edit(self, uri: str, start: int, end: int, new: str) -> None:
        """Replace ``text[start:end]``, as an editor tells it: by lines and UTF-16 units."""
        old = self.texts[uri]
        change = {"range": {"start": place(old, start), "end": place(old, end)}, "text": new}
        self.texts[uri] = old[:start] + new + old[end:]
        self.versions[uri] += 1
        document = {"uri": uri, "version": self.versions[uri]}
        self.tell("textDocument/didChange", {"textDocument": document, "contentChanges": [change]})

    def diagnostics(self, uri: str) -> list[dict[str, Any]]:
        """Those of the document as it is now."""
        self.wait(lambda: self.published.get(uri, {}).get("version") == self.versions[uri])
        diagnostics: list[dict[str, Any]] = self.published[uri]["diagnostics"]
        return diagnostics

    def at(self, uri: str, method: str, offset: int, **more: Any) -> Any:
        """The answer to a request about a place."""
        position = place(self.texts[uri], offset)
        return self.ask(method, {"textDocument": {"uri": uri}, "position": position, **more})

    def actions(self, uri: str, start: int, end: int, only: list[str] | None = None) -> Any:
        text = self.texts[uri]
        context: dict[str, Any] = {"diagnostics": []}
        if only is not None:
            context["only"] = only
        wanted = {"start": place(text, start), "end": place(text, end)}
        return (
            self.ask(
                "textDocument/codeAction",
                {"textDocument": {"uri": uri}, "range": wanted, "context": context},
            )
            or []
        )

    def after(self, uri: str, edit: dict[str, Any]) -> str:
        """The text after an edit of the workspace."""
        (document,) = edit["documentChanges"]
        assert document["textDocument"] == {"uri": uri, "version": self.versions[uri]}
        text = self.texts[uri]
        spans = [
            (offset(text, each["range"]["start"]), offset(text, each["range"]["end"]), each)
            for each in document["edits"]
        ]
        for start, end, each in sorted(spans, key=lambda span: -span[0]):
            text = text[:start] + each["newText"] + text[end:]
        return text

    def ask(self, method: str, params: Any) -> Any:
        answer = self.answer(method, params)
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def answer(self, method: str, params: Any) -> dict[str, Any]:
        """The answer with what is around it."""
        self._number += 1
        number = self._number
        self._send({"id": number, "method": method, "params": params})
        self.wait(lambda: number in self._answers)
        return self._answers.pop(number)

    def tell(self, method: str, params: Any) -> None:
        self._send({"method": method, "params": params})

    def end(self) -> int:
        """Shut the server down as the protocol wants it; its exit code."""
        self.ask("shutdown", None)
        self.tell("exit", None)
        return self.process.wait(WAIT_S)

    def wait(self, done: Any) -> None:
        """Take messages until something is the case."""
        until = time.monotonic() + WAIT_S
        while not done():
            message = self._incoming.get(timeout=max(0.1, until - time.monotonic()))
            assert message is not None, "the server has ended"
            self._take(message)

    def _take(self, message: dict[str, Any]) -> None:
        if "method" not in message:
            self._answers[message["id"]] = message
        elif message["method"] == "textDocument/publishDiagnostics":
            self.published[message["params"]["uri"]] = message["params"]
        else:
            self.notices.append(message)
            if "id" in message:
                self._send({"id": message["id"], "result": None})

    def _send(self, message: dict[str, Any]) -> None:
        self.write(json.dumps({"jsonrpc": "2.0", **message}).encode())

    def write(self, body: bytes) -> None:
        """Send what may be no message."""
        assert self.process.stdin is not None
        self.process.stdin.write(b"Content-Length: %d\r\n\r\n" % len(body) + body)
        self.process.stdin.flush()

    def _read(self) -> None:
        stream = self.process.stdout
        assert stream is not None
        while True:
            length = 0
            while (line := stream.readline().strip()) != b"":
                name, _, value = line.partition(b":")
                if name.lower() == b"content-length":
                    length = int(value)
            if not length:
                self._incoming.put(None)
                return
            self._incoming.put(json.loads(stream.read(length)))


@lru_cache(maxsize=4)
def line_begins(text: str) -> list[int]:
    """Where the lines of a text begin."""
    return [0, *(each.end() for each in re.finditer("\r\n|\r|\n", text))]


def place(text: str, at: int) -> dict[str, int]:
    """An offset as line and UTF-16 units."""
    begins = [begin for begin in line_begins(text) if begin <= at]
    units = len(text[begins[-1] : at].encode("utf-16-le", "surrogatepass")) // 2
    return {"line": len(begins) - 1, "character": units}


def offset(text: str, position: dict[str, int]) -> int:
    """The opposite of ``place``."""
    at, left = line_begins(text)[position["line"]], position["character"]
    while left > 0:
        left -= 2 if ord(text[at]) > 0xFFFF else 1
        at += 1
    assert left == 0
    return at
