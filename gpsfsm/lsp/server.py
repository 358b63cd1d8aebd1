"""The server: the protocol's life cycle, documents that come, change and go, and the features."""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, cast

from lsprotocol import types
from pygls.exceptions import FeatureRequestError
from pygls.lsp.server import LanguageServer
from pygls.uris import to_fs_path

from gpsfsm.errors import DEBUG_VARIABLE
from gpsfsm.lsp.checking import Checked, Checking, Settings
from gpsfsm.lsp.diagnostics import diagnostics
from gpsfsm.lsp.features import Feature, all_features
from gpsfsm.lsp.protocol import Framed, Protocol
from gpsfsm.lsp.session import Session
from gpsfsm.lsp.texts import Text, Texts
from gpsfsm.streams import to_stderr
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from io import BufferedReader

    from gpsfsm.checking import CheckOptions

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
