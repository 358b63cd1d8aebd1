"""``gpsfsm port``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main

if TYPE_CHECKING:
    from pathlib import Path

A, B, C = (f'<Runner interface="a/{n}" provider="a/{n}"/>' for n in "ABC")
RIGHT = f"<Plan>\n  {A}\n  <Control type='recovery'>\n    {B}\n  </Control>\n</Plan>\n"
RECOVERIES = "".join(f"<Control type='recovery'>{runner}</Control>" for runner in (B, C))
TWO = f"<Plan>\n{A}\n{RECOVERIES}</Plan>\n"
PORTED = f"""<Plan>
    {A}
    <Control type='recovery'>
        {B}
        {C}
    </Control>
</Plan>
"""
PARALLEL = f"<Plan>\n{A}\n<Control type='parallel_all' name='both'>\n{B}\n{C}\n</Control></Plan>\n"
V2 = ("--to", "fabric-v2")


@pytest.fixture(autouse=True)
def _plans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("GPSFSM_DEBUG", raising=False)
    for name, text in {"right": RIGHT, "two": TWO, "parallel": PARALLEL, "bad": "<Plan>"}.items():
        (tmp_path / f"{name}.xml").write_text(text)


def said(*arguments: str, capsys: pytest.CaptureFixture[str], code: int) -> tuple[str, str]:
    assert main(["port", *arguments]) == code
    out, err = capsys.readouterr()
    return out, err


def test_a_plan_that_is_right_is_written_byte_for_byte(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = b"\xef\xbb\xbf" + RIGHT.replace("\n", "\r\n").encode()
    (tmp_path / "right.xml").write_bytes(data)
    _, err = said("right.xml", *V2, "-o", "out.xml", capsys=capsys, code=0)
    assert (
        err == "right.xml: fabric-v2 runs this plan as the paper specifies; no change is needed\n"
    )
    assert (tmp_path / "out.xml").read_bytes() == data
    said("right.xml", *V2, "--check", capsys=capsys, code=0)
    assert said("right.xml", *V2, "--diff", capsys=capsys, code=0)[0] == ""


def test_a_plan_is_rewritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, err = said("two.xml", *V2, capsys=capsys, code=0)
    assert out == PORTED
    place = TWO.splitlines()[2].rfind("<Control") + 1
    assert err == (
        f"two.xml:3:{place}: note: this recovery is merged with the recovery before it\n"
        "two.xml: rewritten for fabric-v2; proved to behave the same there\n"
    )
    assert (tmp_path / "two.xml").read_text() == TWO
    (tmp_path / "again.xml").write_text(out)
    assert said("again.xml", *V2, capsys=capsys, code=0)[0] == PORTED


def test_check_and_diff_write_no_plan(capsys: pytest.CaptureFixture[str]) -> None:
    assert said("two.xml", *V2, "--check", capsys=capsys, code=1)[0] == ""
    out, _ = said("two.xml", *V2, "--diff", capsys=capsys, code=1)
    assert out.splitlines()[:2] == ["--- two.xml", "+++ two.xml"]
    added = [line[1:] for line in out.splitlines()[2:] if line.startswith(("+", " "))]
    assert "\n".join(added) + "\n" == PORTED


def test_what_is_lost_is_told_and_nothing_is_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, err = said("parallel.xml", *V2, "-o", "out.xml", capsys=capsys, code=1)
    assert out == ""
    assert not (tmp_path / "out.xml").exists()
    first, second, last = err.splitlines()
    assert first.startswith("parallel.xml:3:1: lost on fabric-v2: parallel_all 'both': 2 steps")
    assert second.startswith("  with --unsafe: the steps run in sequence")
    assert last.startswith("parallel.xml: fabric-v2 cannot run this plan as the paper specifies")


def test_the_unsafe_reading_is_told(capsys: pytest.CaptureFixture[str]) -> None:
    out, err = said("parallel.xml", *V2, "--unsafe", capsys=capsys, code=0)
    assert out == f"<Plan>\n    {A}\n    {B}\n    {C}\n</Plan>\n"
    assert err.splitlines()[1].startswith("  instead: the steps run in sequence")
    assert err.splitlines()[2:] == [
        "parallel.xml: the ported plan is NOT equivalent; the first scenario that shows it:",
        "  1. A succeeds (parallel.xml:2, the ported plan:2)",
        "  then parallel.xml starts C at line 5",
        "       the ported plan starts nothing else",
        "  (where a plan gives up according to the paper, it hangs on fabric-v2)",
    ]


def test_capabilities_tell_types(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = "nav2_capabilities/WaypointRunner"
    text = f'<Plan><Runner interface="{name}" provider="{name}" x="1" y="2.0"/></Plan>'
    (tmp_path / "types.xml").write_text(text)
    out, _ = said("types.xml", *V2, capsys=capsys, code=0)
    assert out == text.replace('"1"', '"1.0"')
    out, _ = said("types.xml", *V2, "--no-builtin-capabilities", capsys=capsys, code=0)
    assert out == text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["bad.xml", *V2], "so the plan is ambiguous"),
        (["none.xml", *V2], "none.xml"),
        (["two.xml", *V2, "-o", "two.xml"], "would overwrite a plan"),
        (["two.xml", *V2, "--diff", "-o", "x.xml"], "write no plan"),
        (["two.xml"], "--to"),
        (["two.xml", "--to", "paper"], "paper"),
        ([*V2], "no plan is given"),
    ],
)
def test_what_cannot_be_done(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    out, err = said(*arguments, capsys=capsys, code=2)
    assert out == ""
    assert message in err
    assert "Traceback" not in err


def test_hostile_text_is_escaped(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = PARALLEL.replace("both", "\u202eboth&#x9b;31m")
    (tmp_path / "parallel.xml").write_text(text, encoding="utf-8")
    _, err = said("parallel.xml", *V2, capsys=capsys, code=1)
    assert "\\u202eboth\\x9b31m" in err
