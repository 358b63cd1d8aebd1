"""Plans that are slow or hostile, a process that dies, an editor that goes away."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.lsp.checking import Apart, Job, Setting
from gpsfsm.workers import Lost
from tests.lsp.client import WAIT_S, Editor
from tests.lsp.test_answers import GO
from tests.lsp.test_edits import children
from tests.service.support import slow_plan

if TYPE_CHECKING:
    from collections.abc import Iterator

FINE = f"<Plan>{GO}</Plan>"
pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")


@pytest.fixture
def own(tmp_path: Path) -> Iterator[Editor]:
    with Editor(tmp_path) as editor:
        yield editor


def rules(text: str) -> list[str]:
    return [finding.rule for finding in gpsfsm.check(text).plans[0].findings]


def test_a_slow_plan_keeps_nobody_waiting(own: Editor) -> None:
    (own.root / "slow").mkdir()
    (own.root / "slow" / "gpsfsm.toml").write_text("consistent = true\n")
    uri = own.open("slow/plan.xml", slow_plan())
    other = own.open("plan.xml", FINE)
    hover = own.at(other, "textDocument/hover", FINE.index("x="))
    assert "along the x axis" in hover["contents"]["value"]
    time.sleep(0.5)
    assert uri not in own.published  # it is being checked, and ended once it has taken 2 s
    own.edit(uri, 0, len(own.texts[uri]), FINE)
    began = time.monotonic()
    assert [each["code"] for each in own.diagnostics(uri)] == rules(FINE)
    assert [each["code"] for each in own.diagnostics(other)] == rules(FINE)
    assert time.monotonic() - began < WAIT_S / 2
    own.tell("exit", None)  # without a word before
    assert own.process.wait(WAIT_S) == 1


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes in /proc")
def test_a_process_that_dies_is_replaced(editor: Editor) -> None:
    own = editor
    uri = own.open("dies.xml", FINE)
    own.diagnostics(uri)
    started = children(own.process.pid)
    for each in started:
        os.kill(each, signal.SIGKILL)
    while alive(started):
        time.sleep(0.01)
    own.edit(uri, 6, 6, "<!-- -->")
    codes = [each["code"] for each in own.diagnostics(uri)]
    assert codes == rules(own.texts[uri])  # and nothing of a check that has ended


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes in /proc")
@pytest.mark.parametrize("killed", [False, True], ids=["gone", "killed"])
def test_nothing_is_left_when_the_editor_goes_away(own: Editor, killed: bool) -> None:
    (own.root / "gpsfsm.toml").write_text("consistent = true\n")
    uri = own.open("plan.xml", FINE)
    own.diagnostics(uri)
    own.open("slow.xml", slow_plan())
    time.sleep(0.5)
    started = children(own.process.pid)
    assert started
    assert own.process.stdin is not None
    if killed:
        own.process.kill()
    else:
        own.process.stdin.close()
    own.process.wait(WAIT_S)
    until = time.monotonic() + WAIT_S
    while alive(started) and time.monotonic() < until:
        time.sleep(0.1)
    assert alive(started) == []


def alive(processes: list[int]) -> list[int]:
    """Those that run; one that has ended may wait for its parent to ask how."""
    results = []
    for each in processes:
        with suppress(OSError):
            if Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()[0] != "Z":
                results.append(each)
    return results


def test_a_check_that_takes_too_long_is_ended() -> None:
    slow = CheckOptions(AnalysisOptions(consistent=True))
    setting = Setting(1, slow, Path("/"))
    apart = Apart(timeout_s=30.0)
    try:
        apart.do(Job("warm"))
        apart._kept.timeout_s = 0.2
        response = apart.do(Job("check", slow_plan(), "slow.xml"), setting)
        assert response == Lost("was ended: it took more than 0.2 s", late=True)
        apart._kept.timeout_s = 30.0
        report = apart.do(Job("check", FINE, "plan.xml"), setting)
        assert report == check_text(FINE, "plan.xml", slow)
    finally:
        apart.close()


def test_a_defect_of_a_feature_is_no_traceback(editor: Editor) -> None:
    own = editor
    assert own.ask("codeAction/resolve", {"title": "?", "data": {"uri": 7}}) == {
        "title": "?",
        "data": {"uri": 7},
    }
    uri = own.uri("never-opened.xml")
    position = {"line": 0, "character": 0}
    for method in ("hover", "completion", "definition"):
        params = {"textDocument": {"uri": uri}, "position": position}
        assert own.ask(f"textDocument/{method}", params) is None


def test_without_pygls_the_command_says_what_to_install() -> None:
    code = "import sys; sys.modules['pygls'] = None; from gpsfsm.cli import main; sys.exit(main())"
    done = subprocess.run(
        [sys.executable, "-c", code, "lsp"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "pip install 'gpsfsm[lsp]'" in done.stderr
    assert "Traceback" not in done.stderr
