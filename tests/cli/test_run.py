"""``gpsfsm run``: the gate, who acts, what is shown, how it ends."""

from __future__ import annotations

import json
import os
import pty
import re
import signal
import termios
import time
from contextlib import suppress
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import BROKEN, REJECTED, environment, run, runner, shell, start, write
from tests.forked import Forked

if TYPE_CHECKING:
    from pathlib import Path

PLAN = f"""<Plan>
{runner()}
<Control type="recovery">
{runner(x="5")}
</Control>
{runner(x="7")}
</Plan>
"""
WORLD = "world: 1\n"
WAIT = "generic_capabilities/WaitRunner"


def waits(seconds: float) -> str:
    return f"""<Plan>
<Runner interface="{WAIT}" provider="{WAIT}" seconds="{seconds}"/>
</Plan>
"""


DRAWN = """\
     0.000 s  line 2  WaypointRunner (x=1, y=2) started
"""


def ran(*arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0) -> tuple[str, str]:
    exit_code = main(["run", *arguments])
    out, err = capsys.readouterr()
    assert exit_code == code, (exit_code, out, err)
    return out, err


def test_outcomes_are_drawn_from_the_seed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    first, _ = ran("a.xml", "--seed", "3", capsys=capsys)
    assert first.startswith(DRAWN)
    assert first.splitlines()[-1].startswith("COMPLETED after ")
    assert ran("a.xml", "--seed", "3", capsys=capsys) == (first, "")
    assert ran("a.xml", "--seed", "4", capsys=capsys)[0] != first


def test_the_same_bytes_in_every_process(tmp_path: Path) -> None:
    write(tmp_path, a=PLAN)
    stdouts = {
        run("run", "a.xml", "--format", "json", cwd=tmp_path, env={"PYTHONHASHSEED": seed}).stdout
        for seed in ("0", "77")
    }
    assert len(stdouts) == 1
    lines = [json.loads(line) for line in next(iter(stdouts)).splitlines()]
    assert lines[0]["journal"] == 1
    assert lines[-1]["data"] == {"status": "COMPLETED"}


def test_how_it_ends_is_the_exit_code(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=PLAN)
    out, _ = ran("a.xml", "--failure", "0", capsys=capsys)
    assert "COMPLETED after" in out
    assert out.endswith(": 2 started, 2 succeeded, 0 failed\n")
    out, _ = ran("a.xml", "--failure", "1", capsys=capsys, code=1)
    assert out.splitlines()[-1].startswith("GAVE_UP after ")
    assert out.endswith(": 2 started, 0 succeeded, 2 failed\n")


def test_a_plan_with_errors_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=REJECTED, b=BROKEN)
    out, err = ran("a.xml", "--journal", "run.db", capsys=capsys, code=1)
    assert out == ""
    assert "a.xml:2:3: error GP307" in err
    assert "it is not run; --force runs it anyway" in err
    assert not (tmp_path / "run.db").exists()
    assert "error GP1" in ran("b.xml", capsys=capsys, code=1)[1]
    assert "there is no plan that could be run" in ran("b.xml", "--force", capsys=capsys, code=2)[1]


def test_a_check_comment_does_not_open_the_gate(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hidden = REJECTED.replace("<Control", "<!-- gpsfsm: ignore GP307 because --><Control")
    write(tmp_path, a=hidden)
    assert "GP307" in ran("a.xml", capsys=capsys, code=1)[1]


def test_what_cannot_be_decided_is_not_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    assert "GP103" in ran("a.xml", "--max-elements", "2", capsys=capsys, code=2)[1]


def test_force_is_journaled(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f'<Plan>{runner()}<Control type="recovery">{runner(x="1")}</Control></Plan>')
    assert main(["run", "a.xml", "--capabilities", "nowhere"]) == 2
    write(tmp_path, a=REJECTED.replace("</Plan>", f"{runner()}</Plan>"))
    out, err = ran("a.xml", "--force", "--journal", "run.db", capsys=capsys)
    assert "note: forced in spite of GP307 at line 2" in out
    assert "GP307" in err
    assert main(["events", "run.db"]) == 0
    assert "NOTE        note: forced in spite of GP307 at line 2" in capsys.readouterr().out


def test_an_action_may_take_so_long(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=waits(3600))
    out, _ = ran("a.xml", "--timeout", "5", capsys=capsys, code=1)
    assert out.splitlines()[1:] == [
        "     5.000 s  line 2  WaitRunner (seconds=3600) timed out: its time is over",
        "     5.000 s  line 2  WaitRunner (seconds=3600) stopped",
        "     5.000 s  line 2  WaitRunner (seconds=3600) failed: its time is over",
        "GAVE_UP after 5.000 s: 1 started, 0 succeeded, 1 failed",
    ]


def test_every_event_can_be_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=PLAN)
    out, _ = ran("a.xml", "--verbose", capsys=capsys)
    assert "runner nav2_capabilities/WaypointRunner is being loaded\n" in out
    assert "     0.000 s  the run begins\n" in out


def test_a_world(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=PLAN)
    (tmp_path / "good.yaml").write_text(WORLD, encoding="utf-8")
    out, _ = ran("a.xml", "--world", "good.yaml", "--journal", "run.db", capsys=capsys)
    assert out.splitlines()[-1].endswith(": 2 started, 2 succeeded, 0 failed")
    assert main(["replay", "run.db"]) == 0
    assert "and simulated again" in capsys.readouterr().out
    (tmp_path / "bad.yaml").write_text(WORLD + "nonsense: 5\n", encoding="utf-8")
    _, err = ran("a.xml", "--world", "bad.yaml", capsys=capsys, code=2)
    assert "bad.yaml:2:1: " in err
    assert "nonsense" in err
    assert "nowhere.yaml" in ran("a.xml", "--world", "nowhere.yaml", capsys=capsys, code=2)[1]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--world", "a", "--real"], "--world and --real cannot be used together"),
        (["--scenario", "a", "--real"], "--scenario and --real cannot be used together"),
        (["--finding", "1"], "--finding needs --scenario"),
        (["--via", "capabilities2"], "--via needs --real"),
        (["--dry-run"], "--dry-run needs --real"),
        *(
            (["--real", "--dry-run", *words], f"--dry-run and {words[0]} cannot be used together")
            for words in (
                *(("--journal", "a.db"), ("--max-plans", "3"), ("--max-visits", "3")),
                *(("--timeout", "3"), ("--bond", "3"), ("--groot", "1667"), ("--verbose",)),
            )
        ),
        (["--real", "--via", "fabric"], "'fabric' is not"),
        (["--failure", "0.5", "--real"], "--failure cannot be used with --real"),
        (["--speed", "2", "--real"], "--real and --speed cannot be used together"),
        (["--allow-program", "ls"], "--allow-program needs --real"),
        (["--failure", "2"], "--failure"),
        (["--speed", "0"], "--speed"),
        (["--timeout", "nan"], "--timeout"),
        (["--speed", "nan"], "--speed"),
    ],
)
def test_options_that_make_no_sense(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=PLAN)
    assert message in ran("a.xml", *arguments, capsys=capsys, code=2)[1]


def test_no_plan(capsys: pytest.CaptureFixture[str]) -> None:
    assert "gpsfsm run plan.xml" in ran(capsys=capsys, code=2)[1]
    assert "nowhere.xml" in ran("nowhere.xml", capsys=capsys, code=2)[1]


def test_standard_input_and_an_answer_of_a_model(tmp_path: Path) -> None:
    answer = f"Sure!\n```xml\n{PLAN}```\n".encode()
    done = run(
        "run", "-", "--from-response", "--failure", "0", "--journal", "run.db",
        stdin=answer, cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1].startswith(b"COMPLETED")
    done = run("replay", "run.db", cwd=tmp_path)
    assert (done.returncode, done.stdout[:17]) == (0, b"run 1 (COMPLETED)")


def test_a_reader_that_leaves_does_not_stop_the_run(tmp_path: Path) -> None:
    plan = f"<Plan>{runner() * 1000}</Plan>"
    write(tmp_path, a=plan)
    command = "$GPSFSM run a.xml --failure 0 --journal run.db --durability none | head -n 1"
    done = shell(command, tmp_path)
    assert done.stdout.count(b"\n") == 1
    assert done.stderr == b""
    listed = run("events", "run.db", "--list", cwd=tmp_path).stdout
    assert b"COMPLETED" in listed


def test_a_run_of_real_runners(tmp_path: Path) -> None:
    write(tmp_path, a=waits(0.2))
    done = run("run", "a.xml", "--real", "--journal", "run.db", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stdout.splitlines()[-1].endswith(b": 1 started, 1 succeeded, 0 failed")
    done = run("replay", "run.db", cwd=tmp_path)
    assert done.returncode == 0
    assert b"without simulating it again" in done.stdout


def test_runners_that_are_not_installed(tmp_path: Path) -> None:
    write(tmp_path, a=PLAN)
    done = run("run", "a.xml", "--real", "--journal", "run.db", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"the plan cannot be run for real" in done.stderr
    assert b"nav2_capabilities/WaypointRunner" in done.stderr


@pytest.mark.parametrize("how", [["--speed", "1"], ["--real"]])
def test_ctrl_c_cancels_in_good_order(how: list[str], tmp_path: Path) -> None:
    write(tmp_path, a=waits(50))
    with start("run", "a.xml", "--journal", "run.db", *how, cwd=tmp_path) as process:
        assert process.stdout is not None
        assert process.stdout.readline().endswith(b"WaitRunner (seconds=50) started\n")
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=30)
    assert process.returncode == 130
    assert err == b"gpsfsm: the run is being cancelled; Ctrl-C again aborts it\n"
    lines = out.decode().splitlines()
    assert lines[0].endswith("the run is cancelled: interrupted")
    assert lines[1].endswith("WaitRunner (seconds=50) stopped")
    assert lines[2].startswith("CANCELLED after ")
    assert lines[2].endswith(": 1 started, 0 succeeded, 0 failed, 1 stopped")
    assert run("replay", "run.db", cwd=tmp_path).returncode == 0


def on_terminal(folder: Path, *arguments: str, **env: str) -> str:
    """What a run writes on a terminal of 100 columns."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(ours, (30, 100))
    with Forked(
        ["run", *arguments],
        cwd=folder,
        environment=environment(TERM="xterm-256color", **env),
        stdin=theirs,
        stdout=theirs,
        stderr=theirs,
    ):
        os.close(theirs)
        output = b""
        with suppress(OSError):  # the terminal is closed at the end
            while part := os.read(ours, 65536):
                output += part
    os.close(ours)
    return output.decode()


def test_a_terminal_shows_the_plan_as_a_tree(tmp_path: Path) -> None:
    write(tmp_path, a=PLAN)
    shown = on_terminal(tmp_path, "a.xml", "--failure", "0")
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", shown)
    assert plain != shown
    lines = plain.splitlines()
    assert re.fullmatch(r"✓ +[\d.]+ s  2  ├── nav2_capabilities/WaypointRunner x=1 y=2", lines[-6])
    assert re.fullmatch(r"· +4  │   └── nav2_capabilities/WaypointRunner x=5 y=2", lines[-4])
    assert lines[-1].startswith("COMPLETED after ")
    assert lines[-1].endswith(": 2 started, 2 succeeded, 0 failed")


def test_a_terminal_without_colours_or_without_a_tree(tmp_path: Path) -> None:
    write(tmp_path, a=PLAN)
    shown = on_terminal(tmp_path, "a.xml", "--failure", "0", NO_COLOR="1")
    assert "✓" in shown
    assert not re.search(r"\x1b\[[0-9;]*3[0-7]m", shown)
    shown = on_terminal(tmp_path, "a.xml", "--failure", "0", "--format", "plain")
    assert "\x1b" not in shown
    assert "line 2  WaypointRunner (x=1, y=2) started" in shown


def test_speed_takes_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=waits(8))
    began = time.monotonic()
    slow, _ = ran("a.xml", "--speed", "20", capsys=capsys)
    assert time.monotonic() - began >= 0.4
    assert ran("a.xml", capsys=capsys)[0] == slow
