"""What a function prints is kept in the journal and reaches nothing else."""

from __future__ import annotations

import asyncio
import io
import json
import subprocess
import sys
import threading
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.runners import generic
from gpsfsm.runners.generic.python import Printed
from tests.runners.acting import WAIT_S, context

if TYPE_CHECKING:
    from pathlib import Path


def call(function: str, lines: list[str]) -> Any:
    runner = generic.PythonRunner()
    runner._functions = frozenset([f"{__name__}:{function}"])
    return asyncio.run(runner.run({"function": f"{__name__}:{function}"}, context(lines)))


def prints() -> str:
    print("one\ntwo", end="")
    print("bad", file=sys.stderr)
    print(" is done")
    sys.stdout.write("three")
    sys.stdout.buffer.write("ü".encode()[:1])
    sys.stdout.buffer.write("ü".encode()[1:])
    sys.stdout.flush()
    print("\nfour", sys.stdout.isatty(), sys.stdout.writable(), end="")
    return "result"


def floods() -> None:
    for number in range(3000):
        print(number)
    print("x" * 100_000)


def prints_much_in_a_line() -> None:
    for _ in range(100):
        print("x" * 1000, end="")
    print("\nnext")


def fails_after_printing() -> None:
    print("before")
    raise ValueError("wrong")


def closes() -> None:
    print(type(sys.stdout).__name__ == "StringIO")
    sys.stdout.close()
    print("still open")
    for wrong in (sys.stdout.fileno, lambda: sys.stdout.write(b"x")):  # type: ignore[arg-type]
        try:
            wrong()
        except (OSError, TypeError) as error:
            print(type(error).__name__)


@pytest.mark.parametrize(
    ("function", "expected"),
    [
        (
            "prints",
            [
                *("stdout: one", "stderr: bad", "stdout: two is done", "stdout: threeü"),
                "stdout: four False True",
            ],
        ),
        ("floods", [f"stdout: {number}" for number in range(1001)]),
        ("prints_much_in_a_line", ["stdout: " + "x" * 10_000, "stdout: next"]),
        (
            "closes",
            [
                *("stdout: False", "stdout: still open", "stdout: UnsupportedOperation"),
                "stdout: TypeError",
            ],
        ),
    ],
)
def test_what_a_function_prints_are_lines(
    function: str, expected: list[str], capfd: pytest.CaptureFixture[str]
) -> None:
    before, lines = (sys.stdout, sys.stderr), []  # type: ignore[var-annotated]
    call(function, lines)
    assert lines == expected
    assert (sys.stdout, sys.stderr) == before
    assert capfd.readouterr() == ("", "")


def test_what_is_printed_before_a_failure_is_kept(capfd: pytest.CaptureFixture[str]) -> None:
    lines: list[str] = []
    with pytest.raises(ValueError, match="wrong"):
        call("fails_after_printing", lines)
    assert lines[-1] == "stdout: before"
    assert capfd.readouterr() == ("", "")


def test_other_threads_print_as_ever(capsys: pytest.CaptureFixture[str]) -> None:
    """Two functions and somebody else at the same time: each has its own."""
    actual: dict[str, list[str]] = {"a": [], "b": []}
    together = threading.Barrier(3)

    def work(name: str) -> None:
        with Printed(actual[name].append).taking():
            for number in range(100):
                together.wait(WAIT_S)
                print(name, number)

    threads = [threading.Thread(target=work, args=(name,)) for name in actual]
    for thread in threads:
        thread.start()
    for number in range(100):
        together.wait(WAIT_S)
        print("usual", number)
    for thread in threads:
        thread.join()
    for name, lines in actual.items():
        assert lines == [f"stdout: {name} {number}" for number in range(100)]
    assert capsys.readouterr().out == "".join(f"usual {number}\n" for number in range(100))


def test_a_stream_that_was_put_in_place_meanwhile_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    own = io.StringIO()
    with Printed([].append).taking():
        monkeypatch.setattr(sys, "stdout", own)
    assert sys.stdout is own


def test_what_is_printed_after_its_time_is_thrown_away() -> None:
    lines: list[str] = []
    printed = Printed(lines.append)
    printed.write("stdout", "begun")
    printed.close()
    printed.write("stdout", " and ended\n")
    assert lines == ["stdout: begun"]


def test_the_report_of_a_run_stays_readable(tmp_path: Path) -> None:
    """``run --format json`` prints nothing else, and no escape reaches a terminal."""
    (tmp_path / "talker.py").write_text(
        "import os\nprint('imported')\n"
        "def talk(argument):\n    print('red: \\x1b[31m', argument)\n    return 'fine'\n"
    )
    plan = tmp_path / "plan.xml"
    plan.write_text(
        '<Plan><Runner interface="generic_capabilities/PythonRunner" '
        'provider="generic_capabilities/PythonRunner" function="talker:talk" argument="x"/></Plan>'
    )
    for output_format in ("json", "plain"):
        arguments = ["run", "--real", "--allow-function", "talker:talk", "--force"]
        done = subprocess.run(
            [sys.executable, "-m", "gpsfsm", *arguments, "--format", output_format, str(plan)],
            capture_output=True,
            text=True,
            check=False,
            env={"PYTHONPATH": str(tmp_path), "PATH": ""},
        )
        assert done.returncode == 0, done.stderr
        assert "\x1b" not in done.stdout + done.stderr
        if output_format == "json":
            events = [json.loads(line) for line in done.stdout.splitlines()]
            said = [event["message"] for event in events if event.get("kind") == "LOG"]
            assert said == ["stdout: imported", "stdout: red: \x1b[31m x"]
