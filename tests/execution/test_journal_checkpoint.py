"""A process that ends between two pages of a checkpoint: the journal with its log is complete."""

from __future__ import annotations

import resource
import shutil
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.journal_file import check_place
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import Kernel
from tests.execution.crashing import ROOT
from tests.execution.journaling import (
    LONG,
    LONG_SEED,
    compiled,
    driver,
    exported,
    resume_journaled,
    run_journaled,
)

if TYPE_CHECKING:
    from pathlib import Path

PAGE = 4096
TWICE = LONG.replace("</Plan>", LONG.removeprefix("<Plan>"))


def expected(folder: Path, text: str = LONG) -> str:
    run_journaled(folder / "whole.db", text, seed=LONG_SEED)
    return exported(folder / "whole.db")


def open_and_moved(folder: Path) -> tuple[bytes, bytes]:
    """The file of a journal before and after its checkpoint; ``open.db-wal`` is its log."""
    path, kernel = folder / "open.db", Kernel(compiled(LONG))
    with Journal(str(path), "power") as journal:
        sink = journal.begin(kernel, Heading(plan=LONG.encode(), seed=LONG_SEED, mode="test"))
        driver(kernel, sink, LONG_SEED).run()
        journal._committed(journal._mark_closed)  # what closing moves with the rest
        before = path.read_bytes()
        for part in ("-wal", "-seen"):
            shutil.copy(f"{path}{part}", folder / f"kept{part}")
    return before, path.read_bytes()


def test_a_kill_between_any_two_pages_of_a_checkpoint_loses_nothing(tmp_path: Path) -> None:
    whole = expected(tmp_path)
    before, after = open_and_moved(tmp_path)
    pages = len(after) // PAGE
    assert len(before) // PAGE < pages - 3
    refusals = 0
    for written in range(pages + 1):  # they are written in the order of their numbers
        folder = tmp_path / f"{written}"
        folder.mkdir()
        path = folder / "j.db"
        path.write_bytes(after[: written * PAGE] + before[written * PAGE :])
        for part in ("-wal", "-seen"):
            shutil.copy(tmp_path / f"kept{part}", folder / f"j.db{part}")
        with JournalReader(str(path)) as reader:
            assert reader.check_end() == ""
            reader.check_file()
        assert exported(path) == whole
        assert resume_journaled(path).status.ended
        assert exported(path) == whole
        # without the log the same file is damaged, and that is told
        path.write_bytes(after[: written * PAGE] + before[written * PAGE :])
        if 0 < written < pages:
            with pytest.raises(DamagedJournalError), JournalReader(str(path)) as reader:
                reader.check_file()
            refusals += 1
    assert refusals == pages - 1


@pytest.mark.parametrize("room", [1, 2, 3, 8])
@pytest.mark.parametrize("often", [True, False])
def test_a_disk_that_is_full_in_the_middle_of_a_checkpoint(
    tmp_path: Path, room: int, *, often: bool
) -> None:
    """``often``: there were others before, so there are older frames behind those of the log."""
    code = (
        "import resource, sys; from tests.execution.journaling import *\n"
        "path, pages, often, seed = sys.argv[1], *map(int, sys.argv[2:])\n"
        "text = sys.stdin.read(); kernel = Kernel(compiled(text))\n"
        "with Journal(path, 'power') as journal:\n"
        "    sink = journal.begin(kernel, Heading(plan=text.encode(), seed=seed, mode='test'))\n"
        "    if often:\n"
        "        journal._connection.execute('PRAGMA wal_autocheckpoint = 60')\n"
        "    driver(kernel, sink, seed).run()\n"
        "    resource.setrlimit(resource.RLIMIT_FSIZE, (pages * 4096, -1))\n"
    )
    path, whole = tmp_path / "j.db", expected(tmp_path, TWICE)
    done = subprocess.run(
        [sys.executable, "-c", code, str(path), str(room), str(int(often)), str(LONG_SEED)],
        cwd=ROOT,
        input=TWICE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] == resource.RLIM_INFINITY
    assert path.with_name("j.db-wal").stat().st_size > 32
    check_place(str(path))
    with JournalReader(str(path)) as reader:
        assert reader.check_end() == ""
        events = reader.verify(1)
    assert events > 100
    assert resume_journaled(path).status.ended
    assert exported(path) == whole
