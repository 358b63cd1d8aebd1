from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from tests.cli.support import ACCEPTED, BROKEN, environment, run

if TYPE_CHECKING:
    from pathlib import Path

WORLD = b"world: yard\nrobot: {x: 1, y: 2}\nplaces:\n  - {name: gate, x: 3, y: 4}\n"


def test_a_prompt_is_shown(tmp_path: Path) -> None:
    (tmp_path / "yard.yaml").write_bytes(WORLD)
    (tmp_path / "example.xml").write_text(ACCEPTED)
    done = run(
        *("prompt", "go to the gate", "--interface", "WaypointRunner", "--world", "yard.yaml"),
        *("--example", "example.xml"),
        cwd=tmp_path,
    )
    assert done.returncode == 0
    text = done.stdout.decode()
    assert text.endswith("\nTask: go to the gate\n")
    assert "- gate is at x=3, y=4." in text
    assert ACCEPTED.strip() in text
    assert text.count("\n## ") == 1
    assert done.stderr.decode().startswith("about ")


def test_a_prompt_as_data_says_what_was_left_out() -> None:
    done = run(
        *("prompt", "go to (1, 2)", "--format", "json"),
        *("--context", "2000", "--max-tokens", "500"),
    )
    data = json.loads(done.stdout)
    assert data["version"] == 1
    assert [message["role"] for message in data["messages"]] == ["system", "user"]
    assert data["tokens"] <= 1500
    assert any(note.startswith("left out ") for note in data["notes"])
    assert data["notes"] == [
        line.removeprefix("note: ")
        for line in done.stderr.decode().splitlines()
        if line.startswith("note: ")
    ]


def test_the_task_can_come_from_a_file(tmp_path: Path) -> None:
    (tmp_path / "task.txt").write_bytes(b"\xef\xbb\xbfgo to\n(1, 2)\n")
    done = run("prompt", "--task-file", "task.txt", cwd=tmp_path)
    assert done.stdout.endswith(b"\nTask: go to\n(1, 2)\n")
    assert run("prompt", "--task-file", "-", stdin=b"wave").stdout.endswith(b"\nTask: wave\n")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "there is no task: describe in quotes what the robot should do"),
        ((" ",), "there is no task"),
        (("go", "--task-file", "task.txt"), "give the task or --task-file, not both"),
        (("--task-file", "absent.txt"), "absent.txt: cannot be read: No such file"),
        (("--task-file", "empty.txt"), "empty.txt: is empty"),
        (("--task-file", "latin.txt"), "latin.txt: is not UTF-8 text (byte 2)"),
        (("go", "--interface", "fly"), "no capability matches 'fly'"),
        (("go", "--example", "broken.xml"), "broken.xml:2:3: this example is not a correct plan: "),
        (("go", "--context", "300", "--max-tokens", "200"), "use a model with a longer context"),
        (("go", "--world", "absent.yaml"), "absent.yaml"),
        (("go", "--no-builtin-capabilities"), "there is no capability to offer"),
    ],
)
def test_what_is_refused(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    (tmp_path / "empty.txt").write_bytes(b"\n")
    (tmp_path / "latin.txt").write_bytes(b"f\xfcr")
    (tmp_path / "broken.xml").write_text(BROKEN)
    done = run("prompt", *arguments, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr.decode()
    assert done.stdout == b""


def test_nothing_heavy_is_loaded() -> None:
    code = (
        "import sys\nfrom gpsfsm.cli import main\n"
        "assert main(['prompt', 'go']) == 0\n"
        "bad = {'z3', 'httpx', 'pydantic', 'networkx'} & set(sys.modules)\nassert not bad, bad"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], env=environment(), capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
