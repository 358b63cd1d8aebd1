"""The protocol's life cycle: what may be asked when, and what becomes of messages that do not fit.

Every request gets an answer, also one that cannot be read: an editor waits for it.
"""

from __future__ import annotations

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
    from gpsfsm.lsp.server import PlanServer

__all__ = ["Protocol"]


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
        """Whether an editor has said that it is one."""
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
        """Why a message of this kind comes at the wrong time."""
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
