"""The life cycle: every request is answered, whatever comes and when."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import gpsfsm
from tests.lsp.client import WAIT_S, Editor
from tests.lsp.test_answers import BAD

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")

HOVER = "textDocument/hover"


def test_from_the_first_message_to_the_last(tmp_path: Path) -> None:
    with Editor(tmp_path, greet=False) as editor:
        place = {
            "textDocument": {"uri": editor.uri("plan.xml")},
            "position": {"line": 0, "character": 1},
        }
        assert editor.answer(HOVER, place)["error"]["code"] == -32002  # not initialized
        editor.open("plan.xml", BAD)  # nobody listens yet
        editor.ask("initialize", editor.greeting())
        assert editor.answer("initialize", editor.greeting())["error"]["code"] == -32600
        uri = editor.open("plan.xml", BAD)  # before "initialized": some editors do that
        editor.tell("initialized", {})
        codes = [each["code"] for each in editor.diagnostics(uri)]
        assert codes == [each.rule for each in gpsfsm.check(BAD).plans[0].findings]
        editor.ask("shutdown", None)
        assert editor.answer(HOVER, place)["error"]["code"] == -32600
        editor.tell("exit", None)
        assert editor.process.wait(WAIT_S) == 0
        assert editor.process.stderr is not None
        assert editor.process.stderr.read() == b""


def test_what_cannot_be_read_is_answered_and_disturbs_nobody(editor: Editor) -> None:
    uri = editor.open("protocol.xml", BAD)
    editor.notices.clear()
    bad = {"textDocument": {"uri": uri}, "position": {"line": -1, "character": 0}}
    for params in (None, {"textDocument": 7}, bad):
        assert editor.answer(HOVER, params)["error"]["code"] == -32602
    assert editor.answer("textDocument/nothing", {})["error"]["code"] == -32601
    for body in (b"{", b"7", b"[]", b"null", b"\xff\xfe", b'{"jsonrpc": "2.0"}'):
        editor.write(body)
    editor.tell("textDocument/didChange", {"textDocument": 7})
    editor.tell("$/nothing", {})
    assert "GP307" in [each["code"] for each in editor.diagnostics(uri)]
    assert {each["method"] for each in editor.notices} <= {"window/logMessage"}  # no box
    editor.notices.clear()
