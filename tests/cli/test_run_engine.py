"""``gpsfsm run --engine``: plans end as they would on an original engine, and are replayed so."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.cli import main
from tests.cli.support import write

if TYPE_CHECKING:
    from pathlib import Path

GO = "nav2_capabilities/WaypointRunner"
SAY = "perception_capabilities/SpeechRunner"


def go(x: str) -> str:
    return f'<Runner interface="{GO}" provider="{GO}" x="{x}" y="1.0"/>'


def say(text: str) -> str:
    return f'<Runner interface="{SAY}" provider="{SAY}" text="{text}"/>'


def recovery(*steps: str) -> str:
    return f'<Control type="recovery">{"".join(steps)}</Control>'


ABORTS = f"<Plan>{go('1.0')}{recovery(go('2.0'))}{recovery(go('3.0'))}</Plan>"
HANGS = f'<Plan>{go("1.0")}<Control type="parallel_all">{say("a")}{say("b")}</Control></Plan>'
COMPLETES = f"<Plan>{go('1.0')}{recovery(go('2.0'))}{say('a')}</Plan>"
RACES = f'<Plan>{go("1.0")}<Control type="parallel_any">{say("a")}</Control>{go("2.0")}</Plan>'


def run(*words: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = main(["run", *words])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize(
    ("text", "engine", "end"),
    [
        (ABORTS, "fabric-v2", "ABORT"),
        (ABORTS, "fabric-v1", "ABORT"),
        (ABORTS, "paper", "COMPLETED"),
        (HANGS, "fabric-v2", "HANG"),
        (HANGS, "fabric-v1", "COMPLETED"),
        (COMPLETES, "fabric-v2", "COMPLETED"),
    ],
)
def test_ends(
    text: str, engine: str, end: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing fails here; what is run, is replayed as the same engine would do it."""
    write(tmp_path, a=text)
    words = ("a.xml", "--engine", engine, "--force", "--failure", "0", "--format", "plain")
    code, out, _ = run(*words, "--journal", "j.db", capsys=capsys)
    assert code == (0 if end == "COMPLETED" else 1)
    assert out.splitlines()[-1].startswith(f"{end} after ")
    assert main(["replay", "j.db"]) == 0
    assert f"run 1 ({end}): replayed and simulated again" in capsys.readouterr().out
    assert main(["events", "j.db"]) == 0
    assert f"the run has ended: {end}" in capsys.readouterr().out


def test_an_unhandled_failure_hangs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f"<Plan>{go('1.0')}</Plan>")
    words = ("a.xml", "--force", "--failure", "1", "--format", "plain")
    assert run(*words, capsys=capsys)[1].splitlines()[-1].startswith("GAVE_UP")
    _, out, _ = run(*words, "--engine", "fabric-v2", capsys=capsys)
    assert out.splitlines()[-1].startswith("HANG")


def test_the_plan_is_checked_for_the_engine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ABORTS)
    code, out, err = run("a.xml", "--engine", "fabric-v2", capsys=capsys)
    assert (code, out) == (1, "")
    assert "GP704" in err


@pytest.mark.parametrize(
    "text", ["<Plan/> bye", "<Plan><Control type='recovery'>t</Control></Plan>"]
)
def test_what_the_engine_does_not_take_is_not_run(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=text)
    code, out, err = run("a.xml", "--engine", "fabric-v2", "--force", capsys=capsys)
    assert (code, out) == (2, "")
    assert "gpsfsm: a.xml:1:" in err
    assert "fabric-v2 does not run this" in err


def findings(text: str, engine: str, capsys: pytest.CaptureFixture[str]) -> list[dict[str, Any]]:
    code = main(["check", "a.xml", "--engine", engine, "--format", "json"])
    assert code == (0 if text == COMPLETES else 1), text  # that it may hang is no error
    out = capsys.readouterr().out
    with open("report.json", "w", encoding="utf-8") as file:  # noqa: PTH123  (in its own folder)
        file.write(out)
    results: list[dict[str, Any]] = json.loads(out)["plans"][0]["findings"]
    return results


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
@pytest.mark.parametrize("text", [ABORTS, HANGS, COMPLETES, RACES])
def test_every_scenario_of_a_report_replays(
    text: str, engine: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As its own finding says: on the engine, or, where the paper is meant, without one."""
    write(tmp_path, a=text)
    played = 0
    for number, finding in enumerate(findings(text, engine, capsys), start=1):
        if finding["scenario"] is None:
            continue
        words = ("--scenario", "report.json", "--finding", str(number), "--format", "plain")
        _, out, _ = run("a.xml", *words, capsys=capsys)
        assert out.splitlines()[-1].startswith(finding["scenario"]["ends"]), finding
        played += 1
    assert played


def test_the_engine_can_be_configured(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ABORTS)
    (tmp_path / "gpsfsm.toml").write_text('engine = "fabric-v2"\n', "utf-8")
    words = ("a.xml", "--force", "--failure", "0", "--format", "plain")
    _, out, _ = run(*words, capsys=capsys)
    assert out.splitlines()[-1].startswith("COMPLETED")  # a file that nobody names decides nothing
    _, out, _ = run(*words, "--config", "gpsfsm.toml", capsys=capsys)
    assert out.splitlines()[-1].startswith("ABORT")


def test_an_unknown_engine_in_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ABORTS)
    findings(ABORTS, "fabric-v2", capsys)
    report = tmp_path / "report.json"
    report.write_text(report.read_text("utf-8").replace('"fabric-v2",', '"fabric-v9",'), "utf-8")
    code, out, err = run("a.xml", "--scenario", "report.json", capsys=capsys)
    assert (code, out) == (2, "")
    assert "there is no engine 'fabric-v9'" in err
