"""``gpsfsm diff``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm import equivalence
from gpsfsm.cli import main
from gpsfsm.equivalence import comparison
from tests.cli.support import ACCEPTED, BROKEN, run, runner, write

if TYPE_CHECKING:
    from gpsfsm.equivalence import Difference
    from gpsfsm.model.plan import Plan

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
    capsys.readouterr()
    assert said("--consistent", "c.xml", "d.xml", capsys=capsys, code=0) == (
        "c.xml and d.xml do the same in every scenario that the options admit\n"
    )


def test_assumptions(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=GUARDED, b=NESTED)
    never = ("--assume", "never fails: WaypointRunner(x=1)")
    assert said(*never, "a.xml", "b.xml", capsys=capsys, code=0) == (
        "a.xml and b.xml do the same in every scenario that the options admit\n"
    )
    other = ("--assume", "never fails: WaypointRunner(x=0)")
    assert "starts WaypointRunner (x=0" in said(*other, "a.xml", "b.xml", capsys=capsys, code=1)


def test_assumptions_of_the_configuration_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=GUARDED, b=NESTED)
    Path("gpsfsm.toml").write_text('assume = ["never fails: WaypointRunner"]\n', encoding="utf-8")
    assert main(["diff", "a.xml", "b.xml"]) == 0
    text = 'gpsfsm: decided with assume = ["never fails: WaypointRunner"] in gpsfsm.toml\n'
    assert capsys.readouterr().err == text
    said("--isolated", "a.xml", "b.xml", capsys=capsys, code=1)


def test_an_assumption_that_neither_plan_has_a_runner_for_is_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=GUARDED, b=NESTED)
    assert main(["diff", "--assume", "never fails: WayponitRunner", "a.xml", "b.xml"]) == 1
    expected = "gpsfsm: the assumption matches no runner of either plan: WayponitRunner\n"
    assert capsys.readouterr().err == expected
    only_first = ("--assume", "never fails: WaypointRunner(x=0)")  # no misspelling
    said(*only_first, "a.xml", "b.xml", capsys=capsys, code=1)


@pytest.mark.parametrize(
    ("assumption", "message"),
    [
        ("line 3 fails", "gpsfsm: a.xml: line 3 contains no runner"),
        ("WaypointRunner flies", "gpsfsm: expected what happens"),
        ("line 4 fails and line 4 succeeds", "gpsfsm: a.xml: the assumptions and options admit no"),
    ],
)
def test_assumptions_that_cannot_be_used(
    assumption: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=GUARDED, b=NESTED)
    assert main(["diff", "--assume", assumption, "a.xml", "b.xml"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(message)


def test_a_tree_and_a_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = "nav2_capabilities/WaypointRunner"
    steps = f'<Action ID="{name}" x="1" y="2"/><Action ID="{name}" x="0" y="2"/>'
    tree = '<root BTCPP_format="4"><BehaviorTree ID="Main">{}</BehaviorTree></root>'
    write(tmp_path, a=GUARDED, b=tree.format(f"<Fallback>{steps}</Fallback>"))
    said("a.xml", "b.xml", capsys=capsys, code=0)
    write(tmp_path, b=tree.format(f"<Sequence>{steps}</Sequence>"))
    assert "1. WaypointRunner (x=1, y=2) succeeds (a.xml:2, b.xml:1:58)" in said(
        "a.xml", "b.xml", capsys=capsys, code=1
    )


def test_a_scenario_that_may_not_be_the_first_is_called_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    compare = equivalence.compare

    def longer(*plans: Plan, **options: Any) -> Difference | None:
        difference = compare(*plans, **options)
        return None if difference is None else difference.perhaps_not_first()

    monkeypatch.setattr(equivalence, "compare", longer)
    write(tmp_path, a=GUARDED, b=NESTED)
    out = said("a.xml", "b.xml", capsys=capsys, code=1)
    assert out.startswith(
        "a.xml and b.xml differ; a scenario (perhaps not the shortest) that shows it:\n"
    )
    data = json.loads(said("--format", "json", "a.xml", "b.xml", capsys=capsys, code=1))
    assert data["difference"]["shortest"] is False


def test_a_contradiction_between_the_deciders_is_exit_code_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(comparison, "prove", lambda *_, **__: None)
    write(tmp_path, a=GUARDED, b=NESTED)
    assert main(["diff", "a.xml", "b.xml"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("gpsfsm: the two deciders differ on whether the plans do the same\n")
    assert "This is a defect of gpsfsm" in err


def test_a_plan_with_errors_is_not_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED, b=BROKEN)
    assert main(["diff", "a.xml", "b.xml"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "b.xml:2:3: error GP107" in err
    assert "gpsfsm: b.xml: the text has errors, so the plan is ambiguous; fix them first" in err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "two plans are needed"),
        (["a.xml"], "two plans are needed"),
        (["-", "-"], "only one of the plans can be standard input"),
        (["a.xml", "missing.xml"], "missing.xml: cannot be read"),
        (["--tolerance", "nan", "a.xml", "a.xml"], "tolerance"),
        (["--tolerance", "inf", "a.xml", "a.xml"], "'--tolerance': inf is not a finite number"),
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
        raise comparison.UndecidedError("not within the limits")

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
