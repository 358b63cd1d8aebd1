"""The server: the protocol's life cycle, documents that come, change and go, and the features."""

from __future__ import annotations

import logging
import os
import re
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from lsprotocol import types
from pygls.exceptions import (
    FeatureRequestError,
    JsonRpcException,
    JsonRpcInvalidRequest,
    JsonRpcServerNotInitialized,
)
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol, lsp_method
from pygls.uris import to_fs_path

from gpsfsm.errors import DEBUG_VARIABLE
from gpsfsm.lsp.checking import Checked, Checking, Settings
from gpsfsm.lsp.diagnostics import diagnostics
from gpsfsm.lsp.features import Feature, all_features
from gpsfsm.lsp.session import Session
from gpsfsm.lsp.texts import Text, Texts
from gpsfsm.streams import to_stderr
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from io import BufferedReader

    from gpsfsm.checking import CheckOptions

# ---- The protocol of editors: where messages begin and end, and what may be asked when -----------
# Every request gets an answer, also one that cannot be read: an editor waits for it. pygls believes
# whatever length it reads: it would claim the memory of a terabyte at once, and wait for all of it.
# Here a message that is too long is passed over piece by piece, and the next that begins is read.


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


_MOST_PATTERNS = 100
_WATCHED = ("**/gpsfsm.toml", "**/pyproject.toml", "**/*.yaml", "**/*.yml")


class PlanServer(LanguageServer):
    """A language server for plans. ``options_of`` makes options of a configuration's values."""

    def __init__(self, options_of: Callable[[Mapping[str, Any]], CheckOptions]) -> None:
        super().__init__("gpsfsm", VERSION, protocol_cls=Protocol, max_workers=2)
        self.session = Session(Texts(), Settings(options_of))
        self._published: set[str] = set()  # what shows diagnostics
        self._errors: set[str] = set()
        for method, handle in (
            (types.INITIALIZE, self._initialize),
            (types.INITIALIZED, self._initialized),
            (types.SHUTDOWN, self._end),
            (types.TEXT_DOCUMENT_DID_SAVE, self._recheck),
            (types.WORKSPACE_DID_CHANGE_WATCHED_FILES, self._recheck),
        ):
            self.feature(method)(_function(handle))
        for feature in all_features():
            self.feature(feature.method, feature.options)(self._guarded(feature))

    def _initialize(self, params: types.InitializeParams) -> None:
        session = self.session
        session.client = params.capabilities
        session.root = session.settings.root = _root(params)
        session.texts.encoding = _encoding(params.capabilities)
        options = params.initialization_options
        plans = options.get("plans") if isinstance(options, dict) else None
        if isinstance(plans, list):
            session.patterns = tuple(each for each in plans if isinstance(each, str))
            session.patterns = session.patterns[:_MOST_PATTERNS]
        # Some editors open documents before they say that they are ready.
        session.checking = Checking(session.texts, session.settings, self._tell)

    def _initialized(self, _: types.InitializedParams) -> None:
        session = self.session
        session.checking.start()
        workspace = session.client.workspace
        watching = workspace.did_change_watched_files if workspace else None
        if watching is not None and watching.dynamic_registration:
            watchers = [types.FileSystemWatcher(pattern) for pattern in _WATCHED]
            self.client_register_capability(
                types.RegistrationParams(
                    [
                        types.Registration(
                            "gpsfsm-files",
                            types.WORKSPACE_DID_CHANGE_WATCHED_FILES,
                            types.DidChangeWatchedFilesRegistrationOptions(watchers),
                        )
                    ]
                )
            )

    def _end(self, _: object) -> None:
        self.session.close()

    def report_server_error(self, error: Exception, source: Any) -> None:
        """A defect belongs into the log: who writes a plan cannot do anything about it."""
        if source is not FeatureRequestError:  # that is answered already
            defect = f"{type(error).__name__}: {error}"
            self.window_log_message(types.LogMessageParams(types.MessageType.Error, defect))

    def opened(self, item: types.TextDocumentItem) -> None:
        """A document has been opened."""
        self._look(
            self.session.texts.open(item.uri, item.version, item.text, str(item.language_id)), 0.0
        )

    def changed(self, params: types.DidChangeTextDocumentParams) -> None:
        """A document has been edited."""
        document = params.text_document
        changes = params.content_changes
        text = self.session.texts.change(document.uri, document.version, changes)
        if text is not None:
            self._look(text)

    def closed(self, uri: str) -> None:
        """A document has been closed."""
        self.session.texts.close(uri)
        self.session.plans.discard(uri)
        self.session.checking.forget(uri)
        if uri in self._published:
            self._published.discard(uri)
            self.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, []))

    def _look(self, text: Text, delay_s: float | None = None) -> None:
        if self.session.concerns(text):
            delay = {} if delay_s is None else {"delay_s": delay_s}
            self.session.checking.want(text.uri, **delay)

    def _recheck(self, _: object) -> None:
        """A file was saved or has changed: it may be one that checks depend on."""
        for text in self.session.texts:
            self._look(text)

    def _tell(self, checked: Checked) -> None:
        about = self.session.client.text_document
        can = about.publish_diagnostics if about else None
        text = checked.text
        pages = self.session.pages if can and can.code_description_support else None
        related = bool(can and can.related_information)
        shown = diagnostics(checked, pages, related=related)
        self._published.add(text.uri)
        self.text_document_publish_diagnostics(
            types.PublishDiagnosticsParams(text.uri, shown, text.version)
        )
        error = checked.setting.error
        if error and error not in self._errors:
            self._errors.add(error)
            self.window_show_message(types.ShowMessageParams(types.MessageType.Error, error))

    def _guarded(self, feature: Feature) -> Callable[[Any], Any]:
        """A feature whose defects are reported in the log, and not answered with a traceback."""

        async def handle(params: Any) -> Any:
            try:
                return await feature.answer(self.session, params)
            except Exception as error:
                if os.environ.get(DEBUG_VARIABLE):
                    raise
                defect = f"{feature.method} failed: {type(error).__name__}: {error}"
                self.window_log_message(types.LogMessageParams(types.MessageType.Error, defect))
                return params if feature.method == types.CODE_ACTION_RESOLVE else None

        return handle


def _function(method: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """The same as a function, on which pygls can leave its marks."""

    def now(params: Any = None) -> Any:
        return method(params)

    return now


def serve(
    options_of: Callable[[Mapping[str, Any]], CheckOptions], unheard: Callable[[], None]
) -> int:
    """Talk to an editor on standard input and output, until it ends; the exit code.

    ``unheard`` is called if the input ends before any editor has begun to talk.
    """
    if not os.environ.get(DEBUG_VARIABLE):
        logging.getLogger("pygls").setLevel(logging.CRITICAL)
    source, target = _streams()
    server = PlanServer(options_of)
    try:
        server.start_io(cast("BinaryIO", Framed(source, _note)), target)
    finally:  # the editor may have gone without a word
        server.session.close()
    protocol = cast("Protocol", server.protocol)
    if not protocol.begun and not protocol.code:
        unheard()
    return protocol.code


def _note(text: str) -> None:
    to_stderr(f"gpsfsm: {text}\n")


def _streams() -> tuple[BufferedReader, BinaryIO]:
    """The streams to the editor; whatever else is printed goes to standard error."""
    source, target = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    sys.stdout = sys.stderr
    return source, target


def _root(params: types.InitializeParams) -> Path | None:
    folders = params.workspace_folders or []
    uri = folders[0].uri if folders else params.root_uri
    path = to_fs_path(uri) if uri else None
    return Path(path) if path and "\0" not in path else None


def _encoding(client: types.ClientCapabilities) -> Any:
    """The encoding that pygls agrees upon with the editor: the first that both support."""
    offered = (client.general.position_encodings if client.general else None) or []
    supported = ("utf-8", "utf-16", "utf-32")
    names = (str(getattr(each, "value", each)) for each in offered)
    return next((name for name in names if name in supported), "utf-16")
