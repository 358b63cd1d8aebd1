"""``gpsfsm dispatch`` and ``gpsfsm ros gate`` as far as they go without ROS 2."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import ACCEPTED, write

if TYPE_CHECKING:
    from pathlib import Path

WITHOUT_ROS = pytest.mark.skipif(
    importlib.util.find_spec("rclpy") is not None, reason="this Python has rclpy"
)


@WITHOUT_ROS
def test_without_ros_it_is_said_what_to_do(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, plan=ACCEPTED)
    for words in (["dispatch", str(tmp_path / "plan.xml")], ["ros", "gate"]):
        assert main(words) == 2
        message = capsys.readouterr().err
        assert "rclpy cannot be used in Python" in message
        assert "source /opt/ros/" in message


def test_no_plan_is_no_dispatch(capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["dispatch"], ["dispatch", ""]):
        assert main(words) == 2
        assert "no plan is given" in capsys.readouterr().err


def test_a_text_that_cannot_be_sent_whole_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "plan.xml"
    for content, why in (
        (b"<Plan>\xff</Plan>", "byte 7 is not UTF-8"),
        (b"<Plan>\0</Plan>", "U+0000"),
    ):
        file.write_bytes(content)
        assert main(["dispatch", str(file)]) == 2
        assert why in capsys.readouterr().err


@pytest.mark.parametrize("words", [["dispatch", "plan.xml"], ["ros", "gate"]])
def test_options_that_make_no_sense_are_refused(
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    write(tmp_path, plan=ACCEPTED)
    for more, why in (
        (["--ignore", "GP203"], "--ignore has no effect on a gate that lets warnings pass"),
        (["--robot", "nowhere.yaml"], "nowhere.yaml"),
        (["--budget-ms", "0"], "--budget-ms"),
    ):
        assert main([*words, *more]) == 2
        assert why in capsys.readouterr().err
    if words[0] == "ros":
        assert main([*words, "--private", "/"]) == 2
        assert "'/' is not a valid ROS 2 name" in capsys.readouterr().err


def test_help_loads_neither_rclpy_nor_the_analyses() -> None:
    program = (
        "import sys; from gpsfsm.cli import main; main(['ros', 'gate', '--help']);"
        "main(['dispatch', '--help']);"
        "print(sorted({'rclpy', 'z3', 'networkx', 'asyncio'} & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"
