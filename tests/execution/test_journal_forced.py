"""Plans that were forced: what lacks an interface or a provider is in the journal all the same."""

from __future__ import annotations

import shutil
from contextlib import closing
from pathlib import Path

import pytest

from gpsfsm.cli import main
from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.journal_read import JournalReader
from tests.execution.journaling import opened_up

FIRST = Path(__file__).parent / "journals"


@pytest.mark.parametrize(
    "attributes",
    ['provider="p/Q"', 'interface="" provider="p/Q"', 'interface="i/I"', 'provider="ü/5"', ""],
)
def test_its_journal_is_whole_for_every_command(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    attributes: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.xml").write_text(f"<Plan><Runner {attributes}/></Plan>", encoding="utf-8")
    assert main(["run", "a.xml", "--force", "--failure", "0", "--journal", "j.db"]) == 0
    capsys.readouterr()
    for words in (["events"], ["events", "--verify"], ["events", "--list"], ["replay"], ["resume"]):
        assert main([*words, "j.db"]) == 0, words
    assert "all 9 events are the same" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("statement", "event"),
    [
        ("UPDATE event SET provider = 'p/R' WHERE kind = 'LOADING'", 4),
        ("UPDATE event SET provider = '' WHERE kind = 'LOADED'", 5),
        ("UPDATE event SET provider = 'p/Q' WHERE kind = 'BEGIN'", 2),
    ],
)
def test_its_providers_are_covered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, statement: str, event: int
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.xml").write_text('<Plan><Runner provider="p/Q"/></Plan>', encoding="utf-8")
    assert main(["run", "a.xml", "--force", "--failure", "0", "--journal", "j.db"]) == 0
    with closing(opened_up("j.db")) as connection:
        assert connection.execute(statement).rowcount == 1
    with (
        JournalReader("j.db") as reader,
        pytest.raises(DamagedJournalError, match=f"event {event} of run 1 is not as it was"),
    ):
        reader.verify_all()


def test_a_journal_of_the_first_form_is_read_and_gone_on_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It was written with ``run --force``; its runner has a provider and no interface."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(FIRST / "form_1_no_interface.db", "j.db")
    Path("a.xml").write_text('<Plan><Runner provider="p/Q"/></Plan>', encoding="utf-8")
    before = (FIRST / "form_1_no_interface.events.txt").read_text(encoding="utf-8")
    for _ in range(2):
        assert main(["events", "j.db", "--run", "1", "--verify"]) == 0
        assert capsys.readouterr().out == before
        assert main(["run", "a.xml", "--force", "--failure", "0", "--journal", "j.db"]) == 0
        capsys.readouterr()
    assert main(["replay", "j.db"]) == 0
