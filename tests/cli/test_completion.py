"""``gpsfsm completion``: the scripts, where they go, and what a real shell makes of them."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import TIMEOUT_S, environment

if TYPE_CHECKING:
    from collections.abc import Mapping

FILES: Mapping[str, str] = {
    "bash": "share/bash-completion/completions/gpsfsm",
    "zsh": "share/zsh/site-functions/_gpsfsm",
    "fish": "config/fish/completions/gpsfsm.fish",
}
BASH = """
source {script}
complete() {{ :; }}
COMP_WORDS=({words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1))
compopt() {{ echo "compopt:$1:$2"; }}
_gpsfsm_completion gpsfsm
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "share"))
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "config"))


@pytest.mark.parametrize("shell", FILES)
def test_install_writes_one_file_once(
    shell: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    home(tmp_path, monkeypatch)
    (tmp_path / ".bashrc").write_text("# mine\n")
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    file = tmp_path / FILES[shell]
    for done in ("is written", "is up to date"):
        assert main(["completion", shell, "--install"]) == 0
        assert f"{file} {done}." in capsys.readouterr().err
        assert file.read_text() == script
    file.write_text("old")
    assert main(["completion", shell, "--install"]) == 0
    assert f"{file} is replaced." in capsys.readouterr().err
    written = {each for each in tmp_path.rglob("*") if each.is_file()}
    assert written == {file, tmp_path / ".bashrc"}
    assert (tmp_path / ".bashrc").read_text() == "# mine\n"


def test_a_relative_folder_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The specification of these variables says that such values are ignored."""
    home(tmp_path, monkeypatch)
    monkeypatch.setenv("XDG_DATA_HOME", "here")
    monkeypatch.chdir(tmp_path)
    assert main(["completion", "bash", "--install"]) == 0
    assert (tmp_path / ".local" / FILES["bash"]).is_file()


def test_a_folder_that_cannot_be_made_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "share").touch()
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "share"))
    assert main(["completion", "bash", "--install"]) == 2
    file = tmp_path / FILES["bash"]
    assert capsys.readouterr().err == f"gpsfsm: cannot write {file}: Not a directory\n"


def test_who_has_no_home_is_told_what_to_set(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)

    def home() -> Path:
        raise RuntimeError

    monkeypatch.setattr(Path, "home", home)
    assert main(["completion", "fish", "--install"]) == 2
    assert capsys.readouterr().err == "gpsfsm: there is no home folder; set XDG_CONFIG_HOME\n"


def completed(tmp_path: Path, *words: str) -> list[str]:
    """What bash would offer for the last of these words."""
    program = tmp_path / "gpsfsm"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m gpsfsm "$@"\n')
    program.chmod(0o755)
    script = tmp_path / "script"
    with script.open("wb") as file:
        subprocess.run([program, "completion", "bash"], env=environment(), stdout=file, check=True)
    done = subprocess.run(
        ["bash", "-c", BASH.format(script=script, words=" ".join(map(repr, ("gpsfsm", *words))))],
        env={**environment(), "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"},
        capture_output=True,
        timeout=TIMEOUT_S,
        check=True,
    )
    assert done.stderr == b""
    return done.stdout.decode().split("\n")[:-1]


@pytest.mark.skipif(not shutil.which("bash"), reason="needs bash")
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["expl"], ["explain"]),
        (["re"], ["replay", "resume"]),
        (["check", "--req"], ["--require-proof"]),
        (["check", "--outp"], ["--output"]),
        (["check", "--fail-on", ""], ["error", "warning", "never"]),
        (["explain", "gp303"], ["GP303"]),
        (["explain", "join-d"], ["join-deadlock"]),
        (["check", "--select", "GP1,GP303"], ["GP1,GP303"]),
        (["check", "--format", "js"], ["json", "jsonl"]),
        (["capabilities", "sh"], ["show"]),
        (["check", "pla"], ["compopt:-o:default", ""]),
        (["check", "-o", "rep"], ["compopt:-o:default", ""]),
    ],
)
def test_bash_completes(words: list[str], offered: list[str], tmp_path: Path) -> None:
    assert completed(tmp_path, *words) == offered


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_read_their_script(shell: str, tmp_path: Path) -> None:
    if not shutil.which(shell):
        pytest.skip(f"needs {shell}")
    done = subprocess.run(
        [sys.executable, "-m", "gpsfsm", "completion", shell],
        env=environment(),
        capture_output=True,
        check=True,
    )
    (tmp_path / "script").write_bytes(done.stdout)
    subprocess.run([shell, "-n", str(tmp_path / "script")], timeout=TIMEOUT_S, check=True)


def test_completing_loads_nothing_heavy() -> None:
    heavy = "sorted({'z3', 'networkx', 'lxml', 'pydantic'} & set(sys.modules))"
    program = "import atexit, sys; from gpsfsm.cli import main; "
    program += f"atexit.register(lambda: print('\\n', {heavy})); main()"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={
            **environment(),
            "_GPSFSM_COMPLETE": "bash_complete",
            "COMP_WORDS": "gpsfsm explain GP30",
            "COMP_CWORD": "2",
        },
        capture_output=True,
        timeout=TIMEOUT_S,
        check=False,
    )
    lines = done.stdout.decode().splitlines()
    assert "plain,GP303" in lines
    assert lines[-1].strip() == "[]"
