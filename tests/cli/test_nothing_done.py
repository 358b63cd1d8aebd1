"""No command ends with 0 unless it can name what it did; what could not be written is a loss."""

from __future__ import annotations

import json
import shutil
from contextlib import chdir
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import group, main
from gpsfsm.streams import Stream, lose, losses
from tests.cli.support import REJECTED, runner, shell, write
from tests.execution.journaling import forge

if TYPE_CHECKING:
    import subprocess

PLAN = f"<Plan>{runner()}</Plan>"
TASK = """task: go
interface: WaypointRunner
places:
  there: {x: 1, y: 2}
steps:
  - do: there
"""

NOTHING = {
    "attempts": ("attempts run.db", "attempts tables.db", "attempts empty.db", "attempts none.db"),
    "capabilities": (
        "capabilities",
        "capabilities list --no-builtin",
        "capabilities list --no-builtin --format json",
        "capabilities list --capabilities folder",
        "capabilities show Nothing",
        "capabilities check folder",
        "capabilities check empty.xml",
    ),
    "check": ("check", "check folder", "check folder a.xml", "check none.xml", "check no*.xml"),
    "convert": ("convert", "convert a.xml", "convert folder --to tree", "convert a.xml --to x"),
    "diff": ("diff", "diff a.xml", "diff a.xml none.xml", "diff a.xml folder"),
    "events": (
        "events",
        "events empty.db",
        "events tables.db",
        "events tables.db --list",
        "events tables.db --queue",
        "events tables.db --format jsonl",
        "events bare.db --queue",
        "events run.db --run 2",
    ),
    "dispatch": ("dispatch", "dispatch none.xml", "dispatch folder", "dispatch empty.xml"),
    "fix": ("fix", "fix folder", "fix none.xml", "fix no*.xml", "fix --diff folder"),
    "fuzz": (
        "fuzz",
        "fuzz folder",
        "fuzz a.xml --time 0.0000001",
        "fuzz a.xml --time 0.0000001 --format json",
        "fuzz a.xml --time 0.0000001 --corpus folder",
        "fuzz a.xml --time 0.0000001 --mutate",
        "fuzz still.xml",
        "fuzz still.xml --mutate",
        "fuzz a.xml --runs 0",
        "fuzz a.xml --replay none.json",
    ),
    "gate": ("gate", "gate folder", "gate none.xml", "gate folder a.xml", "gate still.xml"),
    "generate": ("generate", "generate --model replay:empty.jsonl go", "generate '' --model x:y"),
    "grade": (
        "grade",
        "grade --task task.yaml",
        "grade folder --task task.yaml",
        "grade a.xml --task empty.xml",
        "grade a.xml --task task.yaml --labels empty.xml",
    ),
    "grammar": ("grammar", "grammar --format lark --no-builtin-capabilities"),
    "init": ("init --yes --runner a/B", "init --yes --capabilities none"),
    "lsp": ("lsp --stdio",),
    "port": ("port", "port --to fabric-v2", "port folder --to fabric-v2"),
    "prompt": ("prompt", "prompt ''", "prompt --task-file empty.xml"),
    "replay": ("replay", "replay empty.db", "replay tables.db", "replay bare.db"),
    "resume": ("resume", "resume none.db", "resume empty.db", "resume tables.db"),
    "ros": ("ros", "ros gate"),
    "completion": ("completion", "completion tcsh"),
    "explain": ("explain GP999", "explain ''"),
    "run": ("run", "run folder", "run no*.xml", "run broken.xml"),
    "serve": ("serve --journal folder", "serve --port x"),
    "show": ("show", "show folder", "show none.xml"),
    "view": ("view", "view folder", "view none.xml", "view no*.xml"),
}
"""Of each command, lines that leave it nothing to do."""

SOMETHING = {
    "attempts": "attempts asked.db",
    "capabilities": "capabilities list",
    "check": "check a.xml",
    "convert": "convert a.xml --to tree --output-file a.tree",
    "diff": "diff a.xml a.xml",
    "dispatch": "dispatch --help",
    "events": "events run.db",
    "fix": "fix a.xml",
    "fuzz": "fuzz a.xml --runs 2 --faults late",
    "gate": "gate good.xml",
    "generate": "generate go --model replay:answers.jsonl",
    "grade": "grade a.xml --task task.yaml",
    "grammar": "grammar --format gbnf",
    "init": "init --yes --force",
    "lsp": "lsp",
    "port": "port a.xml --to fabric-v2",
    "prompt": "prompt go",
    "replay": "replay run.db",
    "resume": "resume cut.db",
    "ros": "ros gate --help",
    "completion": "completion bash",
    "explain": "explain GP302",
    "run": "run a.xml --failure 0",
    "serve": "serve --help",
    "show": "show a.xml",
    "view": "view a.xml -o -",
}
"""Of each command, a line that tells what it did."""


EMPTYING = {
    "bare": ["DELETE FROM event", "DELETE FROM queue"],
    "tables": [*map("DELETE FROM {}".format, ("event", "queue", "run", "content"))],
    "cut": ["DELETE FROM event WHERE seq > 3", "DELETE FROM queue WHERE kind = 'ENDED'"],
}
"""How journals are made poorer: a run without events, no run at all, a run that goes on."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Plans, journals and folders with nothing in them, and some with something."""
    made = tmp_path_factory.mktemp("nothing")
    write(made, a=PLAN, still="<Plan/>", broken=REJECTED, empty="")
    wait = "generic_capabilities/WaitRunner"
    write(made, good=f'<Plan><Runner interface="{wait}" provider="{wait}" seconds="0.01"/></Plan>')
    (made / "folder").mkdir()
    (made / "folder" / "read.me").write_text("no plan", encoding="utf-8")
    (made / "empty.db").touch()
    (made / "empty.jsonl").touch()
    (made / "task.yaml").write_text(TASK, encoding="utf-8")
    answer = {"answer": (made / "good.xml").read_text(encoding="utf-8")}
    (made / "answers.jsonl").write_text(json.dumps(answer) + "\n", encoding="utf-8")
    with chdir(made):
        for name in ("run", "bare", "tables", "cut"):
            assert main(["run", "a.xml", "--failure", "0", "--journal", f"{name}.db"]) == 0
        model = ["--model", "replay:answers.jsonl", "--journal", "asked.db"]
        assert main(["generate", "go", *model]) == 0
    for name, statements in EMPTYING.items():
        forge(made / f"{name}.db", *statements)
    return made


def test_every_command_is_tried() -> None:
    commands = {*group.list_commands(None)}  # type: ignore[arg-type]
    assert {*NOTHING} == commands
    assert {*SOMETHING} == commands


@pytest.mark.parametrize("line", [line for lines in NOTHING.values() for line in lines])
def test_nothing_to_do_is_no_success(line: str, folder: Path) -> None:
    done = shell(f"$GPSFSM {line} </dev/null", folder)
    assert done.returncode in (1, 2), (done.stdout, done.stderr)
    assert done.stdout + done.stderr
    if done.returncode == 1:  # a plan that is wrong, which is a verdict
        assert line.startswith(("gate ", "run "))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
@pytest.mark.parametrize("line", [*SOMETHING.values()])
def test_what_could_not_be_written_is_no_success(line: str, folder: Path, tmp_path: Path) -> None:
    def ran(where: str) -> subprocess.CompletedProcess[bytes]:
        shutil.copytree(folder, tmp_path, dirs_exist_ok=True)  # resume needs a run to go on with
        return shell(f"$GPSFSM {line} </dev/null {where}", tmp_path)

    whole = ran("")
    assert whole.returncode == 0, whole.stderr
    assert whole.stdout + whole.stderr
    lost = ran(">/dev/full")
    assert lost.returncode == (2 if whole.stdout else 0)
    assert b"No space left on device" in lost.stderr or not whole.stdout
    assert ran(">/dev/full 2>&1").returncode == 2
    assert ran("2>/dev/full").returncode == (2 if whole.stderr else 0)


@pytest.mark.parametrize("how", ["--failure 0", "--real", "--real --format json"])
def test_a_run_goes_on_without_its_lines_and_says_so(how: str, folder: Path) -> None:
    done = shell(f"$GPSFSM run good.xml good.xml {how} --journal lost.db >/dev/full", folder)
    assert done.returncode == 2
    assert b"the run continues" in done.stderr
    output = shell("$GPSFSM events lost.db --list; rm lost.db*", folder)
    assert output.stdout.count(b"COMPLETED") == 2


def test_a_reader_that_has_read_enough_loses_nothing(folder: Path) -> None:
    done = shell("($NEW_GPSFSM run a.xml --failure 0; echo $? >code) | true; cat code", folder)
    assert done.stdout == b"0\n"
    done = shell("($NEW_GPSFSM prompt go 2>&- >/dev/null; echo $? >code); cat code", folder)
    assert done.stdout == b"0\n"


def test_losses_are_those_of_one_command(capsys: pytest.CaptureFixture[str]) -> None:
    lose(Stream.ERR)
    assert main(["explain", "GP302"]) == 0
    assert losses() == frozenset()
    assert "GP302" in capsys.readouterr().out
