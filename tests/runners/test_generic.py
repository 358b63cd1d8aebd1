"""The generic runners act for real: on this computer, and only where they may."""

from __future__ import annotations

import asyncio
import os
import sys
import threading
import time
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.lane import Action, Lane
from gpsfsm.execution.runner import Runner, StopRequested
from gpsfsm.runners import generic
from tests.runners.acting import WAIT_S, act, acting, context, fails

if TYPE_CHECKING:
    from pathlib import Path


def test_the_family_has_its_runners_and_nothing_else() -> None:
    for name in generic.__all__:
        assert issubclass(getattr(generic, name), Runner)
    with pytest.raises(AttributeError, match="no attribute 'os'"):
        _ = generic.os


# -- wait and log ---------------------------------------------------------------------------


def test_waiting_lets_time_pass() -> None:
    passed: list[float] = []

    async def sleeper(seconds: float) -> None:
        passed.append(seconds)

    here = context()
    here.sleeper = sleeper
    asyncio.run(generic.WaitRunner().run({"seconds": 2}, here))
    assert passed == [2.0]


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({}, "it does not wait: 'seconds' is missing"),
        (
            {"seconds": "soon"},
            "it does not wait: 'seconds' is 'soon' and has to be a number",
        ),
        ({"seconds": True}, "it does not wait: 'seconds' is True and has to be a number"),
        (
            {"seconds": float("nan")},
            "it does not wait: 'seconds' is nan and has to be a number",
        ),
        ({"seconds": 10**400}, "it does not wait: int too large to convert to float"),
        ({"seconds": [1]}, "it does not wait: 'seconds' is [1] and has to be a number"),
        ({"seconds": -1}, "it cannot wait -1 seconds and waits 0"),
    ],
)
def test_waiting_never_fails(parameters: dict[str, Any], message: str) -> None:
    """Its capability file says so; what it makes of a strange value is in the journal."""
    lines: list[str] = []
    asyncio.run(generic.WaitRunner().run(parameters, context(lines)))
    assert lines == [message]


def test_logging_writes_a_line() -> None:
    lines: list[str] = []
    runner = generic.LogRunner()
    asyncio.run(runner.run({"text": "hello", "level": "warning"}, context(lines)))
    asyncio.run(runner.run({"text": 7}, context(lines)))
    assert lines == ["warning: hello", "info: 7"]
    lines.clear()
    for strange in ({"text": ["a", True]}, {}, {"text": "x", "level": ["a"]}):
        asyncio.run(runner.run(strange, context(lines)))
    assert lines == ["info: a\ntrue", "info: ", "a: x"]


# -- programs -------------------------------------------------------------------------------


PYTHON = {"allow_programs": [sys.executable]}


def python(code: str, **more: Any) -> dict[str, Any]:
    return {"command": [sys.executable, "-c", code], **more}


def test_a_program_runs_without_a_shell() -> None:
    outputs = act(
        generic.ProcessRunner(), {"allow_programs": ["echo"]}, command="echo 'a b' $HOME *"
    )
    assert outputs == {"stdout": "a b $HOME *\n", "stderr": "", "exit_code": 0}


@pytest.mark.parametrize(
    ("command", "message"),
    [
        ("rm -rf x", "the program 'rm' is not allowed"),
        ("/bin/echo x", "the program '/bin/echo' is not allowed"),
        ("", "the command has 0 parts"),
        ("echo 'x", "the command cannot be read: a quotation has no end"),
        (["echo", "a\0b"], "echo cannot be run: a NUL character is not allowed"),
        ("no-such-program", "no-such-program cannot be run: "),
    ],
)
def test_what_cannot_be_run(command: Any, message: str) -> None:
    services = {"allow_programs": ["echo", "no-such-program"]}
    assert str(fails(generic.ProcessRunner(), services, command=command)).startswith(message)


def test_nothing_is_allowed_by_itself() -> None:
    assert "is not allowed" in str(fails(generic.ProcessRunner(), {}, command="echo"))
    assert "is not allowed" in str(fails(generic.PythonRunner(), {}, function="os:getcwd"))
    assert "is not allowed" in str(fails(generic.HttpRunner(), {}, url="http://127.0.0.1:9/"))


def test_an_exit_code_is_a_failure() -> None:
    code = "import sys; sys.stderr.write('bad'); sys.exit(3)"
    error = fails(generic.ProcessRunner(), PYTHON, **python(code))
    assert str(error).endswith("ended with exit code 3")
    assert error.outputs == {"stderr": "bad", "exit_code": 3}


def test_a_program_that_floods_is_ended() -> None:
    code = "while True: print('x' * 1000)"
    error = fails(generic.ProcessRunner(), PYTHON, **python(code))
    assert str(error) == "it writes more than 400,000 bytes"


def gone(file: Path) -> bool:
    """Whether the process with the number in the file ends in time."""
    end = time.monotonic() + WAIT_S
    while time.monotonic() < end:
        if file.exists() and file.read_text():
            number = int(file.read_text())
            try:
                os.kill(number, 0)
                with open(f"/proc/{number}/stat") as stat:  # noqa: PTH123
                    if stat.read().rpartition(")")[2].split()[0] == "Z":
                        return True
            except (ProcessLookupError, FileNotFoundError):
                return True
        time.sleep(0.02)
    return False


SLEEP = "import time; time.sleep(60)"
IGNORES = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN); "


def starts_another(file: Path, before: str = "", after: str = "time.sleep(60)") -> str:
    return (
        f"import subprocess, sys, time; {before}"
        f"child = subprocess.Popen([sys.executable, '-c', {SLEEP!r}]); "
        f"open({str(file)!r}, 'w').write(str(child.pid)); {after}"
    )


@pytest.mark.parametrize("before", ["", IGNORES])
def test_after_its_time_a_program_and_its_children_are_ended(tmp_path: Path, before: str) -> None:
    file = tmp_path / "child"
    code = starts_another(file, before)
    error = fails(generic.ProcessRunner(), PYTHON, **python(code, timeout_s=1.0))
    assert str(error).endswith("was stopped after 1 s")
    assert gone(file)


def test_what_a_program_leaves_behind_is_ended(tmp_path: Path) -> None:
    file = tmp_path / "child"
    code = starts_another(file, after="print('done')")
    assert act(generic.ProcessRunner(), PYTHON, **python(code))["stdout"] == "done\n"
    assert gone(file)


@pytest.mark.parametrize("before", ["", IGNORES])
def test_stopping_ends_the_program(tmp_path: Path, before: str) -> None:
    file = tmp_path / "child"
    ended: list[BaseException | None] = []
    over = threading.Event()

    def tell(value: object, error: BaseException | None) -> None:
        ended.append(error)
        over.set()

    lane = Lane("tested")
    completed = python(starts_another(file, before))
    action = Action(lane, lambda: acting(generic.ProcessRunner(), PYTHON, completed), tell)
    end = time.monotonic() + WAIT_S
    while not (file.exists() and file.read_text()):
        assert time.monotonic() < end
        time.sleep(0.02)
    action.interrupt()
    assert over.wait(WAIT_S)
    lane.close()
    assert isinstance(ended[0], StopRequested)
    assert gone(file)


def test_a_program_gets_few_variables(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SECRET", "s3cret")
    services = {**PYTHON, "environment": {"ROBOT": "r2"}}
    code = "import os; print(os.environ.get('SECRET'), os.environ['ROBOT'], os.environ['PATH'])"
    outputs = act(generic.ProcessRunner(), services, **python(code))
    assert outputs["stdout"] == f"None r2 {os.environ['PATH']}\n"


# -- functions ------------------------------------------------------------------------------


def shout(argument: str, *, text: str = "") -> str:
    return f"{argument}!{text}"


def nothing() -> None:
    return None


def everything(argument: str, **more: str) -> dict[str, str]:
    return {"argument": argument, **more}


def wrong() -> None:
    raise ValueError("it is wrong")


def long() -> str:
    return "x" * 1_000_000


async def waits() -> None:
    return None


FUNCTIONS = {
    "allow_functions": [
        *(f"{__name__}:{name}" for name in ("shout", "nothing", "everything", "wrong", "long")),
        f"{__name__}:waits",
        "os.path:basename",
        "no.such:function",
        "os:no_such",
        "nonsense",
    ]
}


@pytest.mark.parametrize(
    ("name", "parameters", "result"),
    [
        ("shout", {"argument": "hello", "text": "?", "stdout": "unused"}, "hello!?"),
        ("nothing", {"argument": "ignored"}, ""),
        ("everything", {"argument": 1, "result": "r"}, '{"argument": 1, "result": "r"}'),
    ],
)
def test_a_function_gets_what_it_takes(name: str, parameters: dict[str, Any], result: str) -> None:
    outputs = act(generic.PythonRunner(), FUNCTIONS, function=f"{__name__}:{name}", **parameters)
    assert outputs == {"result": result}


def test_a_function_of_the_library() -> None:
    outputs = act(generic.PythonRunner(), FUNCTIONS, function="os.path:basename", argument="a/b")
    assert outputs == {"result": "b"}


@pytest.mark.parametrize(
    ("function", "message"),
    [
        ("os:system", "the function 'os:system' is not allowed"),
        ("no.such:function", "there is no function no.such:function: "),
        ("os:no_such", "there is no function os:no_such: "),
        ("nonsense", "there is no function nonsense: "),
        (f"{__name__}:waits", f"{__name__}:waits is not a function that can be called directly"),
        (f"{__name__}:long", f"{__name__}:long returns more than 900,000 characters"),
    ],
)
def test_what_cannot_be_called(function: str, message: str) -> None:
    error = fails(generic.PythonRunner(), FUNCTIONS, function=function)
    assert str(error).startswith(message)


def test_what_a_function_raises_is_the_failure() -> None:
    with pytest.raises(ValueError, match="it is wrong"):
        act(generic.PythonRunner(), FUNCTIONS, function=f"{__name__}:wrong")
