"""The example dispatcher as a process: only what the gate accepts is run."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from tests.cli.support import ACCEPTED, REJECTED, run
from tests.pipelines.support import REPO

if TYPE_CHECKING:
    from collections.abc import Iterator

PROGRAM = REPO / "examples" / "dispatcher" / "dispatcher.py"
SURE = ACCEPTED.replace("<Plan>", '<Plan><Control type="parallel_any">').replace(
    "</Plan>",
    '<Runner interface="generic_capabilities/WaitRunner" '
    'provider="generic_capabilities/WaitRunner" seconds="1"/></Control></Plan>',
)


@pytest.fixture
def dispatcher(tmp_path: Path) -> Iterator[subprocess.Popen[str]]:
    folder = str(Path(gpsfsm.__file__).parents[1])
    with subprocess.Popen(
        [sys.executable, str(PROGRAM), str(tmp_path)],
        env={**os.environ, "PYTHONPATH": folder},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as process:
        yield process
        process.kill()


def put(folder: Path, name: str, text: str) -> None:
    (folder / name).write_text(text, encoding="utf-8")
    (folder / name).rename(folder / "incoming" / name)


def wait_for(file: Path) -> None:
    until = time.monotonic() + 60
    while not file.exists():
        assert time.monotonic() < until, f"there is no {file}"
        time.sleep(0.02)


def test_only_what_is_accepted_is_run(dispatcher: subprocess.Popen[str], tmp_path: Path) -> None:
    assert dispatcher.stdout is not None
    assert dispatcher.stdout.readline() == "ready\n"
    put(tmp_path, "bad.xml", f"<!-- gpsfsm: ignore ALL because I say so -->{REJECTED}")
    put(tmp_path, "empty.xml", "<Plan/>")
    put(tmp_path, "good.xml", SURE)
    (tmp_path / "incoming" / "link.xml").symlink_to(tmp_path / "done" / "good.xml")
    for file in ("refused/bad.xml", "refused/empty.xml", "done/good.xml"):
        wait_for(tmp_path / file)
    dispatcher.send_signal(signal.SIGTERM)
    output, _ = dispatcher.communicate(timeout=60)
    assert dispatcher.returncode == 0
    assert "bad.xml: rejected: findings" in output
    assert "empty.xml: rejected: empty" in output
    accepted = "good.xml: accepted (structure only: no task was given)"
    assert f"{accepted}\ngood.xml: COMPLETED after" in output
    assert output.endswith("stopped\n")
    assert "Traceback" not in output
    for name, accepted in (("refused/bad", False), ("refused/empty", False), ("done/good", True)):
        receipt = json.loads((tmp_path / f"{name}.xml.json").read_text(encoding="utf-8"))
        assert receipt["accepted"] is accepted
    assert list((tmp_path / "working").iterdir()) == []


def test_what_was_being_run_is_not_run_again(tmp_path: Path) -> None:
    (tmp_path / "working").mkdir()
    (tmp_path / "working" / "lost.xml").write_text(SURE, encoding="utf-8")
    done = run(tmp_path, "--once", cwd=PROGRAM.parent, module=PROGRAM.stem)
    assert done.returncode == 0
    assert b"lost.xml: was being run when the dispatcher ended" in done.stdout
    assert (tmp_path / "working" / "lost.xml").exists()
