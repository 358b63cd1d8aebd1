"""What the process that holds the plan queue says of its journal."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal import Journal
from gpsfsm.execution.journal_errors import JournalBusyError
from gpsfsm.running import queue_answers

if TYPE_CHECKING:
    from pathlib import Path


def test_that_it_waits_for_a_journal_is_told_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(queue_answers, "_BUSY_S", 0.4)
    monkeypatch.setattr(queue_answers, "_SILENT_S", 0.1)
    path = str(tmp_path / "q.db")
    with Journal(path), pytest.raises(JournalBusyError), ExitStack() as stack:
        queue_answers.open_journal({"journal": path}, stack)
    assert capsys.readouterr().err == (
        f"gpsfsm: {path}: another process writes to this journal; "
        "waiting up to 0.4 s for it to end\n"
    )
