"""``gpsfsm show``."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
from lxml import etree

import gpsfsm
from gpsfsm.cli import main
from tests.cli.support import ACCEPTED, BROKEN, run, runner, write

if TYPE_CHECKING:
    from pathlib import Path


def drawn(*arguments: str, capsys: pytest.CaptureFixture[str], code: int = 0) -> tuple[str, str]:
    assert main(["show", *arguments]) == code
    return capsys.readouterr()


def test_formats(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED)
    plan = gpsfsm.parse(ACCEPTED).plan
    assert plan is not None
    automaton = gpsfsm.compile_plan(plan).automaton
    for name, wanted in (
        ("dot", automaton.to_dot()),
        ("mermaid", automaton.to_mermaid()),
        ("json", automaton.to_json()),
    ):
        assert drawn("a.xml", "--format", name, capsys=capsys) == (wanted, "")
    assert drawn("a.xml", capsys=capsys)[0] == (
        "1  plan\n2  └── nav2_capabilities/WaypointRunner x=1 y=2\n"
    )


def test_the_engine_of_the_paper_is_the_plan_itself(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=ACCEPTED)
    for name in ("tree", "dot", "json"):
        wanted = drawn("a.xml", "--format", name, capsys=capsys)
        assert drawn("a.xml", "--format", name, "--engine", "paper", capsys=capsys) == wanted


def test_standard_input_and_output_file(tmp_path: Path) -> None:
    done = run(
        "show", "-", "--format", "json", "--output-file", "a.json", stdin=ACCEPTED.encode(),
        cwd=tmp_path,
    )  # fmt: skip
    assert (done.returncode, done.stdout, done.stderr) == (0, b"", b"")
    assert json.loads((tmp_path / "a.json").read_text(encoding="utf-8"))["nodes"]


@pytest.mark.parametrize(
    ("command", "file", "begins"),
    [
        ("show", "a.svg", "<svg"),
        ("show", "a.gv", "digraph"),
        ("show", "a.txt", "1  plan"),
        ("check", "a.sarif", '{"$schema"'),
        ("check", "a.md", "#"),
        ("check", "a.out", "a.xml:"),
        ("gate", "a.json", '{"version"'),
    ],
)
def test_the_name_of_the_file_says_the_format(
    tmp_path: Path, command: str, file: str, begins: str
) -> None:
    write(tmp_path, a=ACCEPTED)
    assert main([command, "a.xml", "-o", file]) == 0
    assert (tmp_path / file).read_text("utf-8").startswith(begins)


def test_an_option_or_a_setting_goes_before_the_name_of_the_file(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    assert main(["show", "a.xml", "--format", "tree", "-o", "a.svg"]) == 0
    assert (tmp_path / "a.svg").read_text("utf-8").startswith("1  plan")
    (tmp_path / "gpsfsm.toml").write_text('format = "markdown"\n', "utf-8")
    assert main(["check", "a.xml", "-o", "a.json"]) == 0
    assert (tmp_path / "a.json").read_text("utf-8").startswith("#")


def test_a_raw_answer(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f"Sure!\n```xml\n{ACCEPTED}```\n")
    out, err = drawn("a.xml", "--from-response", capsys=capsys)
    assert "nav2_capabilities/WaypointRunner x=1 y=2" in out
    assert err == ""


def test_a_text_without_a_plan(tmp_path: Path) -> None:
    write(tmp_path, a=BROKEN, b="prose")
    for name in ("a.xml", "b.xml"):
        done = run("show", name, cwd=tmp_path)
        assert (done.returncode, done.stdout) == (1, b"")
        assert done.stderr.startswith(f"{name}:".encode())
        assert b": error GP1" in done.stderr
        assert done.stderr.endswith(b"there is no plan that could be drawn\n")


def test_a_plan_with_errors_is_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f"<Plan>oops{runner()}</Plan>")
    out, err = drawn("a.xml", capsys=capsys, code=1)
    assert "nav2_capabilities/WaypointRunner x=1 y=2" in out
    assert "error GP108" in err


def test_a_limit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED)
    out, err = drawn("a.xml", "--max-bytes", "5", capsys=capsys, code=2)
    assert out == ""
    assert "GP103" in err


@pytest.mark.parametrize("path", ["missing.xml", ".", "/dev/zero"])
def test_what_cannot_be_read(path: str, capsys: pytest.CaptureFixture[str]) -> None:
    out, err = drawn(path, capsys=capsys, code=2)
    assert out == ""
    assert err.startswith(f"gpsfsm: {path}: ")


def test_all_stops_are_for_pictures(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    loop = (
        '{"nodes": [{"id": "s", "kind": "start"}, '
        '{"id": "a", "kind": "runner", "interface": "x/A"}, '
        '{"id": "b", "kind": "runner", "interface": "x/B"}], '
        '"edges": [{"source": "s", "event": "SUCCEEDED", '
        '"target": "a"}, {"source": "a", "event": "STARTED", "target": "b"}, '
        '{"source": "a", "event": "FAILED", "target": "b", "action": "stop"}, '
        '{"source": "b", "event": "FAILED", "target": "a", "action": "stop"}, '
        '{"source": "b", "event": "SUCCEEDED", "target": "a", "action": "stop"}]}'
    )
    (tmp_path / "a.json").write_text(loop, encoding="utf-8")
    few, _ = drawn("a.json", "--format", "svg", capsys=capsys)
    whole, _ = drawn("a.json", "--format", "svg", "--all-stops", capsys=capsys)
    assert (few.count("edge stop"), whole.count("edge stop")) == (0, 3)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("gpsfsm.picture.automaton_to_svg", lambda _, *, all_stops: f"{all_stops}\n")
        (tmp_path / "b.xml").write_text(ACCEPTED, encoding="utf-8")
        words = ("b.xml", "--engine", "fabric-v2", "--format", "svg", "--all-stops")
        assert drawn(*words, capsys=capsys) == ("True\n", "")
    _, err = drawn("a.json", "--all-stops", capsys=capsys, code=2)
    assert "--all-stops needs --format svg" in err


def test_svg_needs_no_other_program(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=f"<Plan>{runner(x='&lt;b> é &quot;')}</Plan>")
    monkeypatch.setenv("PATH", "")
    out, err = drawn("a.xml", "--format", "svg", capsys=capsys)
    assert etree.fromstring(out.encode()).tag == "{http://www.w3.org/2000/svg}svg"
    assert "x=&lt;b&gt; é" in out
    assert err == ""
