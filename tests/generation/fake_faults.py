"""What can go wrong with a server: each fault is a function that answers a request badly.

A fault is named as ``name`` or ``name:argument``, such as ``429:0.01`` or ``slow:0.2``.
"""

from __future__ import annotations

import gzip
import json
import socket
import struct
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.generation.fake_server import Handler

__all__ = ["FAULTS", "reply_of", "set_right"]

MEGABYTE = b"x" * (1 << 20)


def _status(status: int, message: str, **more: Any) -> Callable[[Handler, str], None]:
    def fault(handler: Handler, argument: str) -> None:
        headers = {"Retry-After": argument} if argument else {}
        error = {"message": message, "type": "error", "param": None, "code": None} | more
        handler.send_json(status, {"error": error}, headers)

    return fault


def _body(content: bytes, kind: str = "application/json", **headers: str) -> Any:
    def fault(handler: Handler, _: str) -> None:
        handler.send(200, content, {"Content-Type": kind, **headers})

    return fault


def _changed(**message: Any) -> Callable[[Handler, str], None]:
    """The usual reply with other fields in the choice or its message."""

    def fault(handler: Handler, argument: str) -> None:
        reply = reply_of(handler, "<Plan/>")
        choice = reply["choices"][0]
        for key, value in message.items():
            (choice if key == "finish_reason" else choice["message"])[key] = value
        if argument:
            choice["message"]["content"] = argument
        handler.send_json(200, reply)

    return fault


def reply_of(handler: Handler, text: str) -> dict[str, Any]:
    document: dict[str, Any] = handler.server.reply(handler.received, text)
    return document


def slow(handler: Handler, argument: str) -> None:
    """Pause, then answer rightly."""
    handler.server.stopped.wait(float(argument or 0.2))
    set_right(handler)


def set_right(handler: Handler) -> None:
    handler.answer_rightly()


def hang(handler: Handler, _: str) -> None:
    """Say nothing until the server is stopped."""
    handler.server.stopped.wait()
    handler.close_connection = True


def hang_inside(handler: Handler, _: str) -> None:
    """Begin an answer, then say nothing more."""
    handler.start(200, {"Content-Type": "application/json", "Content-Length": "1000"})
    handler.wfile.write(b'{"choices": [')
    handler.wfile.flush()
    handler.server.stopped.wait()
    handler.close_connection = True


def cut(handler: Handler, _: str) -> None:
    """End the connection in the middle of the answer."""
    content = json.dumps(reply_of(handler, "<Plan/>")).encode()
    headers = {"Content-Type": "application/json", "Content-Length": str(len(content))}
    handler.start(200, headers)
    handler.wfile.write(content[: len(content) // 2])
    handler.close_connection = True


def cut_json(handler: Handler, _: str) -> None:
    """A complete answer of half the JSON."""
    content = json.dumps(reply_of(handler, "<Plan/>")).encode()
    handler.send(200, content[: len(content) // 2], {"Content-Type": "application/json"})


def reset(handler: Handler, _: str) -> None:
    """Reset the connection."""
    linger = struct.pack("ii", 1, 0)
    handler.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
    handler.connection.close()
    handler.close_connection = True


def huge(handler: Handler, argument: str) -> None:
    """An answer of so many megabytes."""
    handler.start(200, {"Content-Type": "application/json"})
    for _ in range(int(argument or 50)):
        handler.wfile.write(MEGABYTE)
    handler.close_connection = True


def huge_error(handler: Handler, _: str) -> None:
    """An error message of 50 megabytes."""
    handler.start(400, {"Content-Type": "text/plain"})
    for _ in range(50):
        handler.wfile.write(MEGABYTE)
    handler.close_connection = True


def endless(handler: Handler, _: str) -> None:
    """Chunks without end, a byte each."""
    handler.start(200, {"Content-Type": "application/json", "Transfer-Encoding": "chunked"})
    while not handler.server.stopped.wait(0.005):
        handler.wfile.write(b"1\r\n \r\n")
        handler.wfile.flush()
    handler.close_connection = True


def redirect(handler: Handler, argument: str) -> None:
    handler.send(307, b"", {"Location": argument or f"{handler.server.url}/elsewhere"})


def echo_headers(handler: Handler, _: str) -> None:
    """An answer that holds all headers of the request, the key among them."""
    handler.send_json(200, reply_of(handler, f"<Plan/> {dict(handler.headers)}"))


def echo_refusal(handler: Handler, _: str) -> None:
    """A refusal that holds the key."""
    said = f"bad key {handler.headers.get('Authorization')}"
    handler.send_json(401, {"error": {"message": said}})


def garbled_status(handler: Handler, _: str) -> None:
    handler.wfile.write(b"SMTP nonsense\r\n\r\n")
    handler.close_connection = True


def raw(handler: Handler, argument: str) -> None:
    """These bytes in hexadecimal digits, whatever they are."""
    handler.wfile.write(bytes.fromhex(argument))
    handler.close_connection = True


_CHOICE = {"index": 0, "message": {"role": "assistant", "content": ""}, "finish_reason": "stop"}

FAULTS: dict[str, Callable[[Handler, str], None]] = {
    "slow": slow,
    "hang": hang,
    "hang-inside": hang_inside,
    "cut": cut,
    "cut-json": cut_json,
    "reset": reset,
    "huge": huge,
    "huge-error": huge_error,
    "endless": endless,
    "redirect": redirect,
    "echo-headers": echo_headers,
    "echo-refusal": echo_refusal,
    "garbled": garbled_status,
    "raw": raw,
    "408": _status(408, "request timed out"),
    "409": _status(409, "conflict"),
    "429": _status(429, "Rate limit reached for requests"),
    "quota": _status(
        429, "You exceeded your current quota, please check your plan", code="insufficient_quota"
    ),
    "500": _status(500, "The server had an error while processing your request"),
    "503": _status(503, "Loading model", type="unavailable_error"),
    "403": _status(403, "Project does not have access to model"),
    "bad-grammar": _status(400, "Failed to parse grammar", type="invalid_request_error"),
    "too-long": _status(
        400, "This model's maximum context length is 4096 tokens. However, you requested 5000."
    ),
    "chat-template": _status(400, "chat_template is not supported for Mistral tokenizers."),
    "garbage": _body(b"\x00\x01garbage{{{"),
    "not-utf8": _body(b'{"choices": [{"message": {"content": "\xff\xfe"}}]}'),
    "half-character": _body(b'{"choices": [{"message": {"content": "<Plan/>\\ud83d"}}]}'),
    "deep": _body(b"[" * 200_000),
    "number": _body(b'{"choices": ' + b"9" * 100_000 + b"}"),
    "null": _body(b"null"),
    "list": _body(b"[1, 2]"),
    "empty": _body(b""),
    "no-choices": _body(b'{"id": "1", "object": "chat.completion", "choices": []}'),
    "odd-choices": _body(
        b'{"choices": [{"message": {"content": 7, "tool_calls": "x"}}], "usage": 1}'
    ),
    "error-in-200": _body(b'{"error": {"message": "upstream is overloaded", "code": 502}}'),
    "html": _body(b"<html><body>Welcome to nginx</body></html>", "text/html"),
    "stream": _body(b'data: {"choices": []}\n\ndata: [DONE]\n\n', "text/event-stream"),
    "gzip-bomb": _body(gzip.compress(b"\0" * (64 << 20)), **{"Content-Encoding": "gzip"}),
    "empty-answer": _body(json.dumps({"choices": [_CHOICE]}).encode()),
    "length": _changed(finish_reason="length"),
    "all-thought": _changed(finish_reason="length", content="<think>hm, hm"),
    "refusal": _changed(refusal="I cannot help with that.", content=None),
    "filter": _changed(finish_reason="content_filter", content=""),
    "thinking": _changed(content="<think>Where to?</think>\n<Plan/>"),
    "reasoning": _changed(content="<Plan/>", reasoning_content="Where to?"),
    "parts": _changed(content=[{"type": "text", "text": "<Plan"}, {"type": "text", "text": "/>"}]),
}
