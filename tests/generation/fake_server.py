"""A server that speaks the wire formats of OpenAI-compatible servers and of Ollama.

In a test::

    with FakeServer(["<Plan/>"], faults=["429:0", "cut"]) as server:
        ... ask server.url + "/v1" or server.url ...
        assert server.received[0].body["model"] == "tiny"

As a process of its own, which prints its address and serves until it is stopped::

    python -m tests.generation.fake_server --answers answers.jsonl --fault 429:0

Answers are texts in order (the last is repeated), a function of what is asked, or a file of
recorded answers: the next for the recorded task that is in the prompt, else the next of all. Faults
are for one request each, in order; ``""`` is no fault.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import threading
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, ClassVar

from tests.generation.fake_faults import FAULTS

__all__ = ["GRAMMAR_FIELDS", "FakeServer", "Received", "recorded_answers"]

GRAMMAR_FIELDS = (
    "structured_outputs",
    "guided_grammar",
    "ebnf",
    "grammar",
    "response_format",
    "format",
    "tools",
)
_FIELDS = {
    "/v1/chat/completions": {
        *("model", "messages", "stream", "temperature", "max_tokens", "max_completion_tokens"),
        *("seed", "chat_template_kwargs", "tool_choice", "parallel_tool_calls", *GRAMMAR_FIELDS),
    },
    "/api/chat": {"model", "messages", "stream", "think", "options", "format"},
}
_PROBES = ('root ::= "ok"\n', 'start: "ok"\n')


@dataclass(frozen=True)
class Received:
    """A request that came."""

    path: str
    body: Mapping[str, Any]
    headers: Mapping[str, str] = field(repr=False)

    @property
    def prompt(self) -> str:
        return "\n".join(turn["content"] for turn in self.body["messages"])

    @property
    def grammar_field(self) -> str:
        """The field in which there is a grammar, "" if there is none."""
        return next((name for name in GRAMMAR_FIELDS if name in self.body), "")

    @property
    def probes(self) -> bool:
        """Whether the grammar allows nothing but "ok"."""
        grammar = json.dumps(self.body.get(self.grammar_field))
        return any(json.dumps(probe)[1:-1] in grammar for probe in _PROBES) or '["ok"]' in grammar


Answers = Callable[[Received], str]


def recorded_answers(file: Path, **wanted: Any) -> Answers:
    """Answers from JSON lines: for the task that is asked, the next; else the next of all.

    ``wanted`` chooses lines by their fields.
    """
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    lines = [line for line in lines if all(line.get(key) == wanted[key] for key in wanted)]
    tasks = sorted({name for line in lines for name in _tasks(line) if len(name) > 1})
    counts: dict[str, int] = {}
    lock = threading.Lock()

    def answer(received: Received) -> str:
        prompt = " ".join(received.prompt.split())
        # the longest: one task may be the beginning of another
        task = max((name for name in tasks if name in prompt), key=len, default="")
        fitting = [line for line in lines if not task or task in _tasks(line)]
        with lock:
            number = counts.get(task, 0)
            counts[task] = number + 1
        line = fitting[number % len(fitting)]
        return str(line["answer"] if "answer" in line else line["response"])

    return answer


def _tasks(line: Mapping[str, Any]) -> list[str]:
    """What the task of a recorded answer is called, or what stands between quotes in its prompt."""
    if isinstance(line.get("task"), str):
        return [" ".join(line["task"].split())]
    turns = [turn["content"] for turn in line.get("messages", ())]
    prompt = line.get("prompt_text", "\n".join(turns))
    return [" ".join(each.split()) for each in re.findall(r'"([^"<\n]+)"', prompt)]


class FakeServer(ThreadingHTTPServer):
    """``heeds`` are the fields whose grammars are heeded; ``key`` is demanded if it is given."""

    daemon_threads = True
    block_on_close = False

    def __init__(
        self,
        answers: Sequence[str] | Answers = ("<Plan/>",),
        *,
        faults: Iterable[str] = (),
        heeds: Iterable[str] = (),
        refuses: Iterable[str] = (),
        models: Sequence[str] = ("tiny",),
        key: str = "",
        usage: bool = True,
        port: int = 0,
    ) -> None:
        super().__init__(("127.0.0.1", port), Handler)
        self.received: list[Received] = []
        self.stopped = threading.Event()
        self.models, self.key, self.usage = tuple(models), key, usage
        self.heeds, self.refuses = frozenset(heeds), frozenset(refuses)
        self._faults = list(faults)
        self._answers = answers if callable(answers) else _in_order(answers)
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"

    @property
    def plan_requests(self) -> list[Received]:
        """Without the probes."""
        return [request for request in self.received if not request.probes]

    def __enter__(self) -> FakeServer:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stopped.set()
        self.shutdown()
        self.server_close()
        self._thread.join()

    def handle_error(self, *_: object) -> None:
        """Clients may go away whenever they like."""

    def fail_with(self, fault: str) -> None:
        """One more fault for a later request."""
        with self._lock:
            self._faults.append(fault)

    def next_fault(self) -> str:
        with self._lock:
            return self._faults.pop(0) if self._faults else ""

    def text_for(self, received: Received) -> str:
        if received.probes and received.grammar_field in self.heeds:
            return '{"answer": "ok"}' if received.grammar_field in _JSON_FIELDS else "ok"
        if received.probes:
            return "Monday, Tuesday, Wednesday, Thursday, Friday, Saturday, Sunday"
        return self._answers(received)

    def reply(self, received: Received, text: str) -> dict[str, Any]:
        """The reply in the wire format of the path."""
        counts = (len(received.prompt.split()), len(text.split()))
        if received.path == "/api/chat":
            document = {
                "model": received.body["model"],
                "created_at": "2026-01-01T00:00:00Z",
                "message": {"role": "assistant", "content": text},
                "done_reason": "stop",
                "done": True,
                "total_duration": 1_000_000,
            }
            counted = {"prompt_eval_count": counts[0], "eval_count": counts[1]}
            return document | (counted if self.usage else {})
        message: dict[str, Any] = {"role": "assistant", "content": text, "refusal": None}
        finish = "stop"
        if "tools" in received.body and "tools" in self.heeds:
            custom = {"name": received.body["tools"][0]["custom"]["name"], "input": text}
            call = {"id": "call_1", "type": "custom", "custom": custom}
            message |= {"content": None, "tool_calls": [call]}
            finish = "tool_calls"
        document = {
            "id": "chatcmpl-1",
            "object": "chat.completion",
            "created": 1_767_225_600,
            "model": received.body["model"],
            "choices": [
                {"index": 0, "message": message, "logprobs": None, "finish_reason": finish}
            ],
        }
        if self.usage:
            names = ("prompt_tokens", "completion_tokens", "total_tokens")
            document["usage"] = dict(zip(names, (*counts, sum(counts)), strict=True))
        return document


_JSON_FIELDS = ("response_format", "format")


def _in_order(texts: Sequence[str]) -> Answers:
    left = list(texts)
    lock = threading.Lock()

    def answer(_: Received) -> str:
        with lock:
            return left.pop(0) if len(left) > 1 else left[0]

    return answer


class Handler(BaseHTTPRequestHandler):
    """Answers one connection."""

    protocol_version: ClassVar[str] = "HTTP/1.1"
    server: FakeServer
    received: Received

    def log_message(self, *_: object) -> None:
        pass

    def do_GET(self) -> None:
        names = self.server.models
        if not self._admitted():
            return
        if self.path == "/v1/models":
            data = [{"id": name, "object": "model", "owned_by": "us"} for name in names]
            self.send_json(200, {"object": "list", "data": data})
        elif self.path == "/api/tags":
            self.send_json(200, {"models": [{"name": name, "model": name} for name in names]})
        else:
            self.send(404, b"404 page not found", {"Content-Type": "text/plain"})

    def do_POST(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        content = self.rfile.read(length)
        if self.path not in _FIELDS:
            self.send(404, b"404 page not found", {"Content-Type": "text/plain"})
            return
        body = json.loads(content)
        self.received = Received(self.path, body, dict(self.headers))
        self.server.received.append(self.received)
        if (wrong := self._wrong()) is not None:
            self._refuse(400, wrong)
            return
        name, _, argument = self.server.next_fault().partition(":")
        if name:
            FAULTS[name](self, argument)
        elif self._admitted():
            self.answer_rightly()

    def answer_rightly(self) -> None:
        model = self.received.body["model"]
        if model not in self.server.models and model != "default":
            self._refuse(404, f"The model `{model}` does not exist.")
        elif self.received.grammar_field in self.server.refuses:
            self._refuse(400, f"Unrecognized request argument: {self.received.grammar_field}")
        else:
            text = self.server.text_for(self.received)
            self.send_json(200, self.server.reply(self.received, text))

    def start(self, status: int, headers: Mapping[str, str]) -> None:
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()

    def send(self, status: int, content: bytes, headers: Mapping[str, str]) -> None:
        self.start(status, {"Content-Length": str(len(content)), **headers})
        self.wfile.write(content)

    def send_json(self, status: int, data: Any, headers: Mapping[str, str] | None = None) -> None:
        content = json.dumps(data).encode()
        self.send(status, content, {"Content-Type": "application/json", **(headers or {})})

    def _refuse(self, status: int, message: str) -> None:
        ollama = self.received.path == "/api/chat"
        self.send_json(status, {"error": message if ollama else {"message": message}})

    def _admitted(self) -> bool:
        authorization = self.headers.get("Authorization")
        if not self.server.key or authorization == f"Bearer {self.server.key}":
            return True
        self.send_json(401, {"error": {"message": "Incorrect API key provided: sk-a***b."}})
        return False

    def _wrong(self) -> str | None:
        """What is wrong with the shape of the request."""
        body = self.received.body
        if unknown := set(body) - _FIELDS[self.path]:
            return f"Unrecognized request argument supplied: {', '.join(sorted(unknown))}"
        if not isinstance(body.get("model"), str) or body.get("stream") is not False:
            return "model and stream are required"
        turns = body.get("messages")
        if not isinstance(turns, list) or not turns:
            return "messages are required"
        for turn in turns:
            if set(turn) != {"role", "content"} or not isinstance(turn["content"], str):
                return "a message has a role and a content"
            if turn["role"] not in ("system", "user", "assistant"):
                return f"Invalid role: {turn['role']}"
        if self.headers.get("Content-Type") != "application/json":
            return "the content type is wrong"
        if sum(name in body for name in GRAMMAR_FIELDS) > 1:
            return "only one kind of constraint may be given"
        return None


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=0)
    parser.add_argument("--answers", type=Path, help="a file of recorded answers")
    parser.add_argument("--choose", action="append", default=[], metavar="FIELD=VALUE")
    parser.add_argument("--fault", action="append", default=[])
    parser.add_argument("--heeds", action="append", default=[])
    parser.add_argument("--model", action="append", default=[])
    parser.add_argument("--key", default="")
    options = parser.parse_args(arguments)
    wanted = dict(each.split("=", 1) for each in options.choose)
    answers = recorded_answers(options.answers, **wanted) if options.answers else ("<Plan/>",)
    with FakeServer(
        answers,
        faults=options.fault,
        heeds=options.heeds,
        models=options.model or ["tiny"],
        key=options.key,
        port=options.port,
    ) as server:
        print(server.url, flush=True)
        sys.stdin.read()  # until whoever started this closes it, or ends
    return 0


if __name__ == "__main__":
    sys.exit(main())
