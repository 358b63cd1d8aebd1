"""``gpsfsm diff``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from gpsfsm.tasks import equivalence
from tests.cli.support import ACCEPTED, BROKEN, run, runner, write

if TYPE_CHECKING:
    from pathlib import Path

GUARDED = f"""<Plan>
  {runner()}
  <Control type="recovery">
    {runner(x="0")}
  </Control>
</Plan>
"""
NESTED = f"""<Plan>
  <!-- the same -->
  <Control type="sequential" name="go">
    {runner(name="first")}
  </Control>
</Plan>
"""


def said(*arguments: str, capsys: pytest.CaptureFixture[str], code: int) -> str:
    assert main(["diff", *arguments]) == code
    out, err = capsys.readouterr()
    assert err == ""
    return out


def test_equal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED, b=NESTED)
    assert said("a.xml", "b.xml", capsys=capsys, code=0) == (
        "a.xml and b.xml do the same in every scenario\n"
    )


def test_the_first_difference_is_told_side_by_side(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=GUARDED, b=NESTED)
    assert said("a.xml", "b.xml", capsys=capsys, code=1) == (
        "a.xml and b.xml differ; the first scenario that shows it:\n"
        "  1. WaypointRunner (x=1, y=2) fails (a.xml:2, b.xml:4)\n"
        "  then a.xml starts WaypointRunner (x=0, y=2) at line 4\n"
        "       b.xml gives up\n"
    )


def test_a_difference_at_the_beginning(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED, b="<Plan/>\n")
    assert said("a.xml", "b.xml", capsys=capsys, code=1).splitlines()[1:] == [
        "  at the beginning a.xml starts WaypointRunner (x=1, y=2) at line 2",
        "                   b.xml completes",
    ]


def test_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=GUARDED, b=NESTED)
    data = json.loads(said("--format", "json", "a.xml", "b.xml", capsys=capsys, code=1))
    assert data["equal"] is False
    (step,) = data["difference"]["steps"]
    assert step["event"] == "FAILED"
    assert step["second"] == {"line": 4, "column": 5, "path": "/Plan/Control[1]/Runner[1]"}
    assert data["difference"]["first"]["end"] is None
    assert data["difference"]["first"]["starts"][0]["line"] == 4
    assert data["difference"]["second"] == {"starts": [], "end": "GAVE_UP"}
    same = json.loads(said("--format", "json", "a.xml", "a.xml", capsys=capsys, code=0))
    assert same == {"first": "a.xml", "second": "a.xml", "equal": True, "difference": None}


def test_tolerance_and_consistent(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    twice = f"<Plan>{runner()}{runner()}</Plan>"
    guarded = f'<Plan>{runner()}{runner()}<Control type="recovery">{runner(x="5")}</Control></Plan>'
    write(tmp_path, a=ACCEPTED, b=f"<Plan>{runner(x='1.001')}</Plan>", c=twice, d=guarded)
    assert main(["diff", "a.xml", "b.xml"]) == 1
    assert main(["diff", "--tolerance", "0.01", "a.xml", "b.xml"]) == 0
    assert main(["diff", "c.xml", "d.xml"]) == 1
    assert main(["diff", "--consistent", "c.xml", "d.xml"]) == 0
    capsys.readouterr()


def test_a_plan_with_errors_is_not_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED, b=BROKEN)
    assert main(["diff", "a.xml", "b.xml"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "b.xml:2:3: error GP107" in err
    assert "gpsfsm: b.xml: the text has errors; it is not clear what the plan does" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "two plans are needed"),
        (["a.xml"], "two plans are needed"),
        (["-", "-"], "only one of the plans can be standard input"),
        (["a.xml", "missing.xml"], "missing.xml: cannot be read"),
        (["--tolerance", "nan", "a.xml", "a.xml"], "tolerance"),
        (["--tolerance", "inf", "a.xml", "a.xml"], "--tolerance must be a finite number"),
        (["--tolerance", "-1", "a.xml", "a.xml"], "tolerance"),
        (["--output-file", "a.xml", "a.xml", "a.xml"], "would overwrite a plan"),
    ],
)
def test_misuse(
    arguments: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED)
    assert main(["diff", *arguments]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert message in err


def test_standard_input_and_output_file(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    done = run("diff", "a.xml", "-", "--output-file", "o.txt", stdin=NESTED.encode(), cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
    text = (tmp_path / "o.txt").read_text(encoding="utf-8")
    assert text == "a.xml and <stdin> do the same in every scenario\n"


def test_what_is_not_decided_is_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*_: object, **__: object) -> None:
        raise equivalence.UndecidedError("not within the limits")

    write(tmp_path, a=ACCEPTED)
    monkeypatch.setattr(equivalence, "compare", never)
    assert main(["diff", "a.xml", "a.xml"]) == 2
    assert "not within the limits" in capsys.readouterr().err


def test_terminal_codes_in_a_plan_are_escaped(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=f"<Plan>{runner(x='&#x202e;evil')}</Plan>", b="<Plan/>")
    out = said("a.xml", "b.xml", capsys=capsys, code=1)
    assert "\u202e" not in out
    assert "\\u202e" in out
