"""The protocol of editors: where messages begin and end, and what may be asked when.

Every request gets an answer, also one that cannot be read: an editor waits for it. pygls believes
whatever length it reads: it would claim the memory of a terabyte at once, and wait for all of it.
Here a message that is too long is passed over piece by piece, and the next one that begins is read.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from lsprotocol import types
from pygls.exceptions import (
    JsonRpcException,
    JsonRpcInvalidRequest,
    JsonRpcServerNotInitialized,
)
from pygls.protocol import LanguageServerProtocol, lsp_method

if TYPE_CHECKING:
    from collections.abc import Callable
    from io import BufferedReader

    from gpsfsm.lsp.server import PlanServer


@dataclass(frozen=True, slots=True)
class _Misfit:
    """A message that could not be read. ``id`` is None where nobody waits for an answer."""

    id: str | int | None
    error: JsonRpcException


class Protocol(LanguageServerProtocol):
    """The protocol with documents of our own (``texts``), and none besides."""

    _server: PlanServer
    code = 0
    """The exit code: not 0 if the editor ends the server without a word before."""
    _ready = False

    @property
    def begun(self) -> bool:
        """True if an editor has said that it is one."""
        return self._ready

    def structure_message(self, data: dict[str, Any]) -> Any:
        """A message as an object."""
        try:
            return super().structure_message(data)
        except JsonRpcException as error:
            number = data.get("id") if "method" in data else None
            return _Misfit(number if isinstance(number, str | int) else None, error)

    def handle_message(self, message: Any) -> None:
        """Answer a message, or say why it cannot be answered."""
        if isinstance(message, _Misfit):
            self._refuse(message.id, message.error)
            return
        method = getattr(message, "method", None)
        if method is None and not hasattr(message, "id"):
            return  # JSON, but no message
        refusal = None if method is None else self._refusal(method)
        if refusal is not None:
            self._refuse(getattr(message, "id", None), refusal)
            return
        if method == types.INITIALIZE:
            self._ready = True
        elif method == types.EXIT:
            self.code = 0 if self._shutdown else 1
        super().handle_message(message)

    def _refusal(self, method: str) -> JsonRpcException | None:
        """The refusal of a message that comes at the wrong time; None if it does not."""
        if method == types.EXIT:
            return None
        if self._shutdown:
            return JsonRpcInvalidRequest("the server is shut down")
        if method == types.INITIALIZE:
            return JsonRpcInvalidRequest("initialize was sent before") if self._ready else None
        if not self._ready:
            return JsonRpcServerNotInitialized("initialize has to be sent first")
        return None

    def _refuse(self, number: str | int | None, why: JsonRpcException) -> None:
        if number is not None:
            self._send_response(number, error=why.to_response_error())

    @lsp_method(types.TEXT_DOCUMENT_DID_OPEN)
    def lsp_text_document__did_open(self, params: types.DidOpenTextDocumentParams) -> None:
        """A document has been opened."""
        self._server.opened(params.text_document)

    @lsp_method(types.TEXT_DOCUMENT_DID_CHANGE)
    def lsp_text_document__did_change(self, params: types.DidChangeTextDocumentParams) -> None:
        """A document has been edited."""
        self._server.changed(params)

    @lsp_method(types.TEXT_DOCUMENT_DID_CLOSE)
    def lsp_text_document__did_close(self, params: types.DidCloseTextDocumentParams) -> None:
        """A document has been closed."""
        self._server.closed(params.text_document.uri)


MOST_BYTES = 64 << 20
"""Of a message; a plan is far smaller, and more than memory allows is worth nothing."""

_HEADER = re.compile(
    rb"Content-Length[ \t]*:[ \t]*(\d{1,18})[ \t]*\r?\n"
    rb"(?:[A-Za-z-]{1,64}[ \t]*:[^\r\n]{0,1000}\r?\n){0,16}\r?\n",
    re.IGNORECASE,
)
_LONGEST_HEADER = 20_000
_CHUNK = 1 << 16


class Framed:
    """A stream of messages as pygls reads it: a line, an empty line and so many bytes.

    ``note`` is told what was passed over.
    """

    def __init__(self, source: BufferedReader, note: Callable[[str], object]) -> None:
        self._source = source
        self._note = note
        self._buffer = bytearray()
        self._lines: list[bytes] = []
        self._body = b""

    def readline(self) -> bytes:
        """The next line of a header; nothing at the end."""
        if not self._lines:
            body = self._next()
            if body is None:
                return b""
            self._body = body
            self._lines = [b"\r\n", b"Content-Length: %d\r\n" % len(body)]
        return self._lines.pop()

    def read(self, _: int) -> bytes:
        """The message to which the header belongs."""
        body, self._body = self._body, b""
        return body

    def _next(self) -> bytes | None:
        """The next message; None at the end."""
        while True:
            header = _HEADER.search(self._buffer)
            if header is None:
                del self._buffer[:-_LONGEST_HEADER]  # what is no header is no message
                if not self._fill():
                    return None
                continue
            length = int(header[1])
            del self._buffer[: header.end()]
            if length > MOST_BYTES:
                self._note(f"a message of {length:,} bytes is passed over: it is too long")
                self._pass_over(length)
            elif length:
                while len(self._buffer) < length:
                    if not self._fill():
                        return None
                body = bytes(self._buffer[:length])
                del self._buffer[:length]
                return body

    def _pass_over(self, length: int) -> None:
        """Read ``length`` bytes, or up to a header: in the text of a message there is none."""
        while length > 0:
            header = _HEADER.search(self._buffer)
            if header is not None and header.start() < length:
                del self._buffer[: header.start()]
                return
            kept = 0 if len(self._buffer) >= length else _LONGEST_HEADER  # one may have begun
            passed = min(length, max(0, len(self._buffer) - kept))
            del self._buffer[:passed]
            length -= passed
            if length > 0 and not self._fill():
                return

    def _fill(self) -> bool:
        """Read what has come; False at the end."""
        piece = self._source.read1(_CHUNK)
        self._buffer += piece
        return bool(piece)
