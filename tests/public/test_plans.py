"""``fix``, ``diff``, ``view`` and ``port`` from Python, beside the commands of these names."""

from __future__ import annotations

import json
import sys
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from tests.cli.support import run

if TYPE_CHECKING:
    from pathlib import Path

GO = '<Runner interface="a/Go" provider="a/Go"/>'
SAY = '<Runner interface="a/Say" provider="a/Say"/>'
PLAN = f"<Plan>{GO}{SAY}</Plan>"
OTHER = f'<Plan>{GO}<Control type="parallel_any">{SAY}{GO}</Control></Plan>'
ODD = '<Plan><Runner interface="a/Go" provider=a/Go></Plan>'


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    paths = tmp_path / "a.xml", tmp_path / "b.xml"
    for path, text in zip(paths, (PLAN, OTHER), strict=True):
        path.write_text(text)
    return str(paths[0]), str(paths[1])


def test_a_report_is_what_the_command_prints_as_json(files: tuple[str, str]) -> None:
    report = gpsfsm.check(files)
    assert report.to_dict() == json.loads(run("check", "--format", "json", *files).stdout)
    assert report.plans[1].to_dict() == report.to_dict()["plans"][1]
    assert report.findings == (*report.plans[0].findings, *report.plans[1].findings)


class FakePandas:
    """As much of pandas as a frame of findings needs."""

    @staticmethod
    def DataFrame(rows: list[Any], columns: list[str]) -> list[dict[str, Any]]:  # noqa: N802
        return [dict(zip(columns, row, strict=True)) for row in rows]


def test_a_frame_has_a_row_for_each_finding(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", FakePandas)
    report = gpsfsm.Report((*gpsfsm.check(ODD).plans, *gpsfsm.check("<Plan>").plans))
    rows = report.to_frame()
    assert [row["rule"] for row in rows] == [each.rule for each in report.findings]
    assert {row["path"] for row in rows} == {"<text>"}
    assert rows[0]["line"] == 1
    assert rows[0]["severity"] == "error"


def test_a_frame_without_pandas_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(gpsfsm.UsageError, match="pip install pandas"):
        gpsfsm.check(PLAN).to_frame()


def test_fix_leaves_the_file_as_it_is(tmp_path: Path) -> None:
    file = tmp_path / "odd.xml"
    file.write_text(ODD)
    fixed = gpsfsm.fix(file)
    assert fixed.changed
    assert file.read_text() == ODD
    assert fixed.report.path == str(file)
    assert gpsfsm.check(fixed.text).ok
    assert fixed.to_dict()["report"] == fixed.report.to_dict()
    run("fix", str(file))
    assert file.read_text() == fixed.text
    json.dumps(fixed.to_dict())


def test_fix_heeds_its_options() -> None:
    assert not gpsfsm.fix(ODD, ignore=["ALL"]).changed
    answer = "Of course! " + ODD
    assert gpsfsm.fix(answer, from_response=True).text.startswith("<Plan>")


def test_diff_is_what_the_command_prints(files: tuple[str, str]) -> None:
    difference = gpsfsm.diff(*files)
    assert not difference
    assert not difference.equal
    assert "starts Go" in str(difference)
    assert difference.to_dict() == json.loads(run("diff", "--format", "json", *files).stdout)
    same = gpsfsm.diff(files[0], PLAN)
    assert same
    assert str(same) == "the plans do the same"
    assert same.to_dict()["difference"] is None


def test_diff_takes_plans_that_were_read() -> None:
    plan = gpsfsm.parse(PLAN).plan
    assert plan is not None
    assert gpsfsm.diff(plan, PLAN)


def test_diff_of_a_text_with_errors_says_which() -> None:
    with pytest.raises(gpsfsm.GpsfsmError, match=r"<text>: the text has errors: .*gpsfsm\.fix"):
        gpsfsm.diff(PLAN, ODD)


def test_view_is_the_page_of_the_command(files: tuple[str, str], tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    run("view", "--diff", "-o", str(page), *files)
    written = page.read_text(encoding="utf-8")
    assert written.count(',"check":""') == 1, "only a command line can be copied"
    assert gpsfsm.view(files, diff=True) == written.replace(',"check":""', "")
    assert "the title" in gpsfsm.view(PLAN, title="the title")


def test_port_is_what_the_command_writes(files: tuple[str, str], tmp_path: Path) -> None:
    target = tmp_path / "ported.xml"
    run("port", files[0], "--to", "fabric-v2", "-o", str(target))
    ported = gpsfsm.port(files[0], "fabric-v2")
    assert ported.text == target.read_text()
    lost = gpsfsm.port(files[1], "fabric-v2")
    assert lost.text is None
    assert lost.to_dict()["losses"][0]["line"] == 1
    unsafe = gpsfsm.port(OTHER, "fabric-v2", unsafe=True)
    assert unsafe.to_dict()["change"]["difference"] is not None
    json.dumps(unsafe.to_dict())
