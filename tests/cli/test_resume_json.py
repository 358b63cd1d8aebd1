"""Lines of JSON of a run that was killed: what was told and what is told later is the journal."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import runner, start, write
from tests.execution.journaling import cut, ends_of_writes, forge

if TYPE_CHECKING:
    from pathlib import Path

WAIT = "generic_capabilities/WaitRunner"


def wait(seconds: float) -> str:
    return f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="{seconds}"/>'


MIXED = f"""<Plan>
{wait(0.001)}
<Control type="parallel_all">{wait(0.003)}{wait(0.001)}</Control>
<Control type="recovery">{wait(0.001)}{wait(0.001)}</Control>
{wait(0.002)}
</Plan>
"""
DRAWN = f"""<Plan>
{runner()}
<Control type="recovery">{runner(x="3")}{runner(x="4")}</Control>
{runner(x="5")}
</Plan>
"""
REAL = ("--real",)


def written(
    folder: Path, journal: str, number: int, capsys: pytest.CaptureFixture[str]
) -> list[str]:
    """The events of a run as the journal has them, without their heading."""
    words = ["events", str(folder / journal), "--run", f"{number}", "--format", "jsonl"]
    assert main(words) == 0
    return capsys.readouterr().out.splitlines()[1:]


@pytest.mark.parametrize("queued", [True, False])
@pytest.mark.parametrize("how", [REAL, ("--failure", "0.3", "--seed", "5")], ids=["real", "drawn"])
def test_resume_tells_what_run_has_not_told(
    how: tuple[str, ...], queued: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=MIXED if how == REAL else DRAWN)
    whole = tmp_path / "whole.db"
    options = ["--format", "json", "--journal", str(whole)]
    code = main(["run", str(tmp_path / "a.xml"), *how, *options])
    heading, *first = capsys.readouterr().out.splitlines()
    assert json.loads(heading)["journal"] == 1
    assert first == written(tmp_path, "whole.db", 1, capsys)
    for last in ends_of_writes(whole)[:-1]:
        part = tmp_path / f"{last}.db"
        cut(whole, part, last)
        forge(part, "DELETE FROM queue WHERE kind = 'ENDED'" if queued else "DELETE FROM queue")
        real = [*how] if how == REAL else []
        assert main(["resume", str(part), *real, "--format", "json"]) == code
        rest = capsys.readouterr().out.splitlines()
        assert first[:last] + rest == written(tmp_path, part.name, 1, capsys)
        assert json.loads(rest[0])["seq"] == last + 1


@pytest.mark.parametrize("how", [REAL, ("--speed", "1", "--failure", "0")], ids=["real", "paced"])
def test_a_run_that_is_killed_has_told_how_it_began(
    how: tuple[str, ...], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = f"<Plan>{wait(0.01) * 3}{wait(1.2)}{wait(0.01)}</Plan>"
    write(tmp_path, a=text, b=f"<Plan>{wait(0.01)}</Plan>")
    options = ["--format", "json", "--journal", "run.db"]
    with start("run", "a.xml", "b.xml", *how, *options, cwd=tmp_path) as process:
        assert process.stdout is not None
        begun = []
        while not begun or begun[-1].count('"cause"') == 0 or '"node":4' not in begun[-1]:
            begun.append(process.stdout.readline().decode().rstrip("\n"))
        process.send_signal(signal.SIGKILL)
        out, _ = process.communicate()
        begun += out.decode().splitlines()
    before = written(tmp_path, "run.db", 1, capsys)
    assert begun[1:] == before[: len(begun) - 1]
    real = ["--real"] if how == REAL else []
    assert main(["resume", str(tmp_path / "run.db"), *real, "--format", "json"]) == 0
    rest = capsys.readouterr().out.splitlines()
    first, second = (written(tmp_path, "run.db", number, capsys) for number in (1, 2))
    assert before + rest[: len(first) - len(before)] == first
    assert json.loads(rest[len(first) - len(before)])["journal"] == 1
    assert rest[len(first) - len(before) + 1 :] == second
