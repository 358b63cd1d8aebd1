"""The unit of systemd: hardened, readable by systemd, and its command serves."""

from __future__ import annotations

import configparser
import re
import shlex
import shutil
import subprocess
from pathlib import Path
from threading import Timer
from typing import TYPE_CHECKING

import httpx
import pytest

from tests.cli.support import start
from tests.installation.support import section
from tests.pipelines.support import REPO, snippets

if TYPE_CHECKING:
    from collections.abc import Mapping

UNIT = REPO / "packaging" / "gpsfsm.service"
PROGRAM = "/opt/gpsfsm/bin/gpsfsm"
MOST_EXPOSURE = 1.5
"""systemd calls 2 and less "OK" and up to 10 "UNSAFE"; 1.3 was measured with systemd 252."""
needs_systemd = pytest.mark.skipif(
    shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed"
)


def settings() -> Mapping[str, str]:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment,method-assign]
    parser.read(UNIT, encoding="utf-8")
    return parser["Service"]


def drop_in() -> str:
    (snippet,) = (each for each in snippets(REPO / "docs" / "install.md") if each.language == "ini")
    assert snippet.file == "/etc/systemd/system/gpsfsm.service.d/robot.conf"
    return snippet.text


def analyze(*words: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        ["systemd-analyze", *words], cwd=cwd, capture_output=True, text=True, check=False
    )


def placed(folder: Path) -> Path:
    """The unit with a program that is there, since systemd looks for it."""
    unit = folder / UNIT.name
    unit.write_text(UNIT.read_text("utf-8").replace(PROGRAM, "/bin/true"), encoding="utf-8")
    return unit


@needs_systemd
@pytest.mark.parametrize("dropped", [False, True])
def test_systemd_has_nothing_to_say(tmp_path: Path, dropped: bool) -> None:
    unit = placed(tmp_path)
    if dropped:
        (tmp_path / "gpsfsm.service.d").mkdir()
        text = drop_in().replace(PROGRAM, "/bin/true")
        (tmp_path / "gpsfsm.service.d" / "robot.conf").write_text(text, encoding="utf-8")
    done = analyze("verify", "--man=no", unit, cwd=tmp_path)
    about = [line for line in done.stderr.splitlines() if "gpsfsm" in line]
    assert (done.returncode, about) == (0, [])
    unit.write_text(unit.read_text("utf-8").replace("PrivateTmp", "PrivateTemp"), encoding="utf-8")
    assert "PrivateTemp" in analyze("verify", "--man=no", unit, cwd=tmp_path).stderr


@needs_systemd
def test_it_is_hardly_exposed(tmp_path: Path) -> None:
    done = analyze("security", "--offline=true", "--no-pager", placed(tmp_path), cwd=tmp_path)
    match = re.search(r"Overall exposure level for \S+: ([\d.]+)", done.stdout)
    if match is None:
        pytest.skip(f"this systemd-analyze cannot do it offline: {done.stderr}")
    assert float(match[1]) <= MOST_EXPOSURE


def test_it_may_do_little() -> None:
    unit = settings()
    assert unit["DynamicUser"] == unit["NoNewPrivileges"] == unit["PrivateTmp"] == "yes"
    assert unit["ProtectSystem"] == "strict"
    assert unit["CapabilityBoundingSet"] == ""
    assert "ProcSubset" not in unit, "the journal reads the boot of the machine below /proc/sys"
    assert "User" not in unit


def started(line: str, folder: Path) -> subprocess.Popen[bytes]:
    program, *words = shlex.split(line.replace("${STATE_DIRECTORY}", str(folder)))
    assert program == PROGRAM
    return start(*words, cwd=folder)


def test_the_command_serves_and_ends_as_systemd_ends_it(tmp_path: Path) -> None:
    """The line as it stands; only the port is one that is free."""
    process = started(f"{settings()['ExecStart']} --port 0", tmp_path)
    late = Timer(120, process.kill)
    late.start()
    try:
        assert process.stderr is not None
        said: list[str] = []
        while not (serving := re.search(r"serving at (http://127\.0\.0\.1:\d+)", "".join(said))):
            said.append(process.stderr.readline().decode())
            assert said[-1], "".join(said)  # it has ended
        answer = httpx.get(f"{serving[1]}/livez", timeout=60, trust_env=False)
        assert answer.status_code == 200
        assert (tmp_path / "queue.db").exists()
        process.terminate()
        assert process.wait(timeout=60) == 0, "Restart=on-failure would start it again"
    finally:
        late.cancel()
        process.kill()
        process.communicate()


def test_the_command_of_a_robot_is_read(tmp_path: Path) -> None:
    """Without the file of the robot and without a token it does not begin, and is not restarted."""
    *_, line = re.findall(r"^ExecStart=(.+)$", drop_in(), re.MULTILINE)
    process = started(line, tmp_path)
    _, complaint = process.communicate(timeout=60)
    assert str(process.returncode) == settings()["RestartPreventExitStatus"] == "2"
    assert b"robot.yaml" in complaint or b"token" in complaint
    assert b"No such option" not in complaint


def test_the_commands_of_the_page_place_it_where_it_looks() -> None:
    lines = section("systemd").splitlines()
    assert "cp gpsfsm.service /etc/systemd/system/" in lines
    folder = Path(PROGRAM).parents[1]
    assert lines[0] == f"python3 -m venv {folder}"
    assert any(line.startswith(f"{folder}/bin/pip install 'gpsfsm[serve]==") for line in lines)
