"""What all commands have in common: exit codes, messages, help, import time."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.cli import group, main
from gpsfsm.errors import GpsfsmError, InternalError
from tests.cli.support import ACCEPTED, TIMEOUT_S, environment, run, start, write

if TYPE_CHECKING:
    from pathlib import Path

HEAVY = ("z3", "networkx", "lxml", "pydantic", "yaml", "lark", "httpx", "multiprocessing")
COMMANDS = (
    *(
        "attempts",
        "capabilities",
        "check",
        "completion",
        "convert",
        "diff",
        "dispatch",
        "events",
        "explain",
        "fix",
        "fuzz",
        "gate",
        "generate",
    ),
    *(
        "grade",
        "grammar",
        "init",
        "lsp",
        "port",
        "prompt",
        "replay",
        "resume",
        "ros",
        "run",
        "serve",
    ),
    *("show", "view"),
)


def test_version() -> None:
    for option in ("-v", "-V", "--version"):
        done = run(option)
        assert (done.returncode, done.stdout) == (0, f"gpsfsm {gpsfsm.__version__}\n".encode())


def test_no_command_shows_the_help_and_fails() -> None:
    done = run()
    assert done.returncode == 2
    assert done.stdout == b""
    assert b"Usage: gpsfsm" in done.stderr


def test_help_lists_every_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--help"]) == 0
    shown = capsys.readouterr().out
    assert all(f"\n  {name} " in shown for name in COMMANDS)
    assert group.list_commands(group.make_context("gpsfsm", ["check"])) == list(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_a_command_has_an_example(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([name, "--help"]) == 0
    shown = capsys.readouterr().out.replace("Examples:", "Example:")
    assert f"Example:\n    gpsfsm {name}" in shown


def test_help_loads_nothing_heavy() -> None:
    """One process for all: what one of them loads stays loaded."""
    commands = (
        ["--help"],
        ["check", "--help"],
        ["capabilities", "--help"],
        ["capabilities", "list", "--help"],
        ["capabilities", "show", "--help"],
        ["capabilities", "check", "--help"],
        ["explain", "GP302"],
    )
    program = (
        f"import sys; from gpsfsm.cli import main; codes = [main(words) for words in {commands}]; "
        f"print(codes, set(sys.modules) & set({HEAVY}), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment(),
        capture_output=True,
        timeout=TIMEOUT_S,
        check=True,
    )
    assert done.stderr.decode() == f"{[0] * len(commands)} set()\n"
    assert all(done.stdout.count(b"Usage: gpsfsm " + name) for name in (b"check", b"capabilities"))


def test_check_loads_the_graph_library_but_no_settings(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    program = (
        "import sys; from gpsfsm.cli import main; main(['check', 'a.xml']); "
        f"print(*(set(sys.modules) & set({HEAVY}) - {{'z3', 'lxml'}}), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=environment(),
        capture_output=True,
        timeout=TIMEOUT_S,
        check=True,
    )
    assert done.stderr.decode().split() == ["networkx"]  # what it decides is the graph: ADR 0009


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["chek", "a.xml"], "there is no command 'chek'; did you mean: gpsfsm check a.xml"),
        (["lint", "a.xml"], "there is no command 'lint'; did you mean: gpsfsm check a.xml"),
        (["verify", "a.xml"], "there is no command 'verify'; did you mean: gpsfsm check a.xml"),
        (["rules"], "did you mean: gpsfsm explain"),
        (["xyzzy"], "'gpsfsm --help' lists the commands."),
        (["version"], "for the version: gpsfsm --version"),
        (["check", "a.xml", "-o", "a.html"], "; for a page: gpsfsm view"),
        (["check", "a.xml", "-o", "a.svg"], "a.svg: svg is none of the formats text, github, "),
        (["events", "a.db", "-o", "a.json"], "a.json: json is none of the formats "),
        (["show", "a.xml", "-o", "a.png"], "a.png: png is none of the formats tree, dot, "),
        (["help", "check"], "for help: gpsfsm check --help"),
        (["help"], "for help: gpsfsm COMMAND --help"),
        (["gp303"], "to explain a rule: gpsfsm explain GP303"),
        (["check", "--hlep"], "--help"),
        (["plan.xml"], "to check a plan: gpsfsm check plan.xml"),
        (["xyzzy"], f"the commands are {', '.join(COMMANDS)}"),
        (["check"], "Example:\n  gpsfsm check plan.xml"),
        (["show"], "Example:\n  gpsfsm show plan.xml"),
        (["check", "a.xml", ""], "no plan is given"),
        (["show", ""], "no plan is given"),
        (["check", "--fail-on", "info", "a.xml"], "'info' is not one of 'error', 'warning'"),
        (["check", "--jobs", "-1", "a.xml"], "-1 is not in the range"),
        (["check", "--selct", "GP3", "a.xml"], "--select"),
        (["check", "a.xml", "--select", "GP0"], "no rule matches 'GP0'"),
        (["check", "a.xml", "--select", ","], "no rule matches ','"),
        (["check", "a.xml", "--faults", "melt"], "there is no fault model 'melt'"),
        (["check", "a.xml", "--format", "xlsx"], "there is no format 'xlsx'"),
        (["check", "a.xml", "--assume", "never"], "^"),
        (["check", "a.xml", "--config", "a.toml", "--isolated"], "cannot be used together"),
    ],
)
def test_misuse_is_a_message(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("gpsfsm: ")
    assert message in captured.err


class TestUnexpectedErrors:
    def fail(self, monkeypatch: pytest.MonkeyPatch, error: BaseException) -> None:
        def raising(*_: object) -> object:
            raise error

        monkeypatch.setattr("gpsfsm.cli.check._run", raising)

    @pytest.mark.parametrize(
        ("error", "message"),
        [
            (GpsfsmError("no such thing"), "gpsfsm: no such thing\n"),
            (
                MemoryError(),
                "gpsfsm: the memory has run out\nallow more memory, or take a smaller plan\n",
            ),
            (GpsfsmError("red \x1b[31m"), "gpsfsm: red \\x1b[31m\n"),
            (GpsfsmError(), "gpsfsm: it failed, without a reason\n"),
        ],
    )
    def test_known_ones(
        self,
        error: Exception,
        message: str,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        self.fail(monkeypatch, error)
        assert main(["check", "a.xml"]) == 2
        assert capsys.readouterr().err == message

    @pytest.mark.parametrize(
        ("error", "words"),
        [
            (InternalError("z3 disagrees"), "z3 disagrees"),
            (KeyError("x"), "unexpected KeyError: 'x'"),
        ],
    )
    def test_defects_ask_for_a_report(
        self,
        error: Exception,
        words: str,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        self.fail(monkeypatch, error)
        assert main(["check", "a.xml"]) == 2
        shown = capsys.readouterr().err
        assert words in shown
        assert f"defect of gpsfsm {gpsfsm.__version__}, please report it" in shown

    def test_debugging_raises_on(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.fail(monkeypatch, KeyError("x"))
        monkeypatch.setenv("GPSFSM_DEBUG", "1")
        with pytest.raises(KeyError):
            main(["check", "a.xml"])

    def test_interrupt(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.fail(monkeypatch, KeyboardInterrupt())
        assert main(["check", "a.xml"]) == 130


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
@pytest.mark.parametrize("jobs", ["1", "2"])
def test_ctrl_c_while_it_reads(tmp_path: Path, jobs: str) -> None:
    """The plans before the pipe make it use z3, which handles signals in its own way."""
    os.mkfifo(tmp_path / "pipe")
    write(tmp_path, a=ACCEPTED, b=ACCEPTED)
    process = start("check", "a.xml", "b.xml", "pipe", "--jobs", jobs, cwd=tmp_path)
    with (tmp_path / "pipe").open("wb"):  # waits until the other side has opened it
        out, err = _interrupted(process)
    assert process.returncode == 130
    assert (out, err.strip()) == (b"", b"")


def _interrupted(process: subprocess.Popen[bytes]) -> tuple[bytes, bytes]:
    """Press Ctrl-C, as often as a person would: one just before a read begins does not end it."""
    for _ in range(5):
        process.send_signal(signal.SIGINT)
        with contextlib.suppress(subprocess.TimeoutExpired):
            return process.communicate(timeout=TIMEOUT_S / 5)
    process.kill()
    return process.communicate()
