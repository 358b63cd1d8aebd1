"""A thousand edits: the server follows each, says what ``check`` says, and keeps nothing."""

from __future__ import annotations

import random
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from tests.lsp.client import Editor, line_begins, place

if TYPE_CHECKING:
    from gpsfsm.model.finding import Finding

EDITS, LOOKS = 1_000, 25
PIECES = [
    *('<Control type="recovery">', "</Control>", '<Control type="parallel_all">', "</Plan>"),
    '<Runner interface="nav2_capabilities/WaypointRunner" '
    'provider="nav2_capabilities/WaypointRunner" x="1.0" y="2.0"/>',
    '<Runner interface="perception_capabilities/SpeechRunner" '
    'provider="perception_capabilities/SpeechRunner" text="é 🤖 $x"/>',
    *("<!-- gpsfsm: ignore GP302 -->", '"', "<", "\n", "\r\n", "\u2028", "é", "🤖🤖", "x", " "),
]


def memory_kb(process: int) -> int:
    """The memory of a process and of those that it has started."""
    total = 0
    for each in (process, *children(process)):
        status = Path(f"/proc/{each}/status").read_text()
        total += next(int(line.split()[1]) for line in status.splitlines() if "VmRSS" in line)
    return total


def children(process: int) -> list[int]:
    results: list[int] = []
    for task in Path(f"/proc/{process}/task").iterdir():
        results += map(int, (task / "children").read_text().split())
    return results


def summaries(diagnostics: list[dict[str, Any]]) -> list[tuple[str, str, dict[str, int]]]:
    return [(each["code"], each["message"], each["range"]["start"]) for each in diagnostics]


def wanted(text: str, finding: Finding) -> tuple[str, str, dict[str, int]]:
    begin = line_begins(text)[finding.location.line - 1]
    start = place(text, begin + finding.location.column - 1)
    return finding.rule, f"{finding.message}\nhint: {finding.hint}", start


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the memory in /proc")
def test_a_thousand_edits(tmp_path: Path) -> None:
    pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")
    draw = random.Random(9)  # noqa: S311
    with Editor(tmp_path) as editor:
        uri = editor.open("plan.xml", "<Plan>\n" + PIECES[4] + "\n</Plan>\n")
        before, looked = 0, 0
        for number in range(EDITS):
            text = editor.texts[uri]
            start = draw.randrange(len(text) + 1)
            if text[start - 1 : start + 1] == "\r\n":
                start += 1
            end = start if len(text) < 2_000 else min(start + draw.randrange(300), len(text))
            if text[end - 1 : end + 1] == "\r\n":
                end += 1
            editor.edit(uri, start, end, draw.choice(PIECES))
            if number % (EDITS // LOOKS) == 0:
                text = editor.texts[uri]
                findings = gpsfsm.check(text.encode()).plans[0].findings
                assert summaries(editor.diagnostics(uri)) == [
                    wanted(text, each) for each in findings
                ]
                looked += len(findings)
                at = draw.randrange(len(text) + 1)
                if text[at - 1 : at + 1] != "\r\n":
                    for method in ("completion", "hover", "definition"):
                        editor.at(uri, f"textDocument/{method}", at)
                for method in ("documentSymbol", "foldingRange"):
                    editor.ask(f"textDocument/{method}", {"textDocument": {"uri": uri}})
            if number == EDITS // 4:
                before = memory_kb(editor.process.pid)
        assert looked > LOOKS
        assert editor.notices == []  # no feature has failed
        editor.diagnostics(uri)
        assert memory_kb(editor.process.pid) - before < 24 * 1024
        assert editor.end() == 0
