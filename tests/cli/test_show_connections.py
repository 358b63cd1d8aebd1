"""``gpsfsm show --format connections``: what an original engine makes of a text."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.cli import main
from gpsfsm.cli.show import ENGINES
from gpsfsm.compile.fabric import PROFILES
from tests.cli.support import write

if TYPE_CHECKING:
    from pathlib import Path

GO = '<Runner interface="A" provider="A" x="1.5"/>'


def show(
    path: str, *options: str, capsys: pytest.CaptureFixture[str], code: int, engine: str = ""
) -> tuple[Any, str]:
    engine = engine or "fabric-v2"
    assert main(["show", path, "--engine", engine, "--format", "connections", *options]) == code
    out, err = capsys.readouterr()
    return (json.loads(out) if out else None), err


def test_the_engines_are_those_of_the_compiler() -> None:
    assert tuple(PROFILES) == ENGINES


def test_connections(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f'<Plan>{GO}<Control type="recovery" name="é">{GO}</Control></Plan>')
    rows, err = show("a.xml", capsys=capsys, code=0)
    assert err == ""
    assert [(row["success"], row["failure"], row["desc"]) for row in rows] == [
        (2, 1, "fabric_completion_control"),
        (2, None, "é"),
        (3, None, "parallel_any_for_muxing_recovery"),
        (None, None, ""),
    ]
    assert rows[0]["params"] == {"x": ["1.500000", 1]}
    assert rows[3]["params"] == {"plan_id": ["PLAN-ID", 3]}
    rows, _ = show("a.xml", capsys=capsys, code=0, engine="fabric-v1")
    assert rows[0]["params"] == {}
    assert rows[2]["params"] == {"input_count": [2, 2]}


def test_what_is_no_xml_may_be_a_plan(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.xml").write_bytes(
        b'Sure: <Plan><Runner interface="&A" provider="\xff" t="a < b &c"/></Plan>'
    )
    rows, err = show("a.xml", capsys=capsys, code=0)
    assert (rows[0]["interface"], rows[0]["params"]["t"]) == ("&A", ["a < b &c", 3])
    assert err == ""


@pytest.mark.parametrize(
    ("text", "expected", "said"),
    [
        (
            f"<Plan>\n  {GO}\n  <Control>{GO}</Control></Plan>",
            {"rejected": 1},
            "a.xml:3:3: fabric-v2 refuses this text: the control has no type",
        ),
        (
            "<Plan>\n</plan>",
            {"error": "check_compatibility failed"},
            "a.xml:2:1: fabric-v2 refuses this text: XML_ERROR_MISMATCHED_ELEMENT: "
            "</plan> does not close <Plan>",
        ),
        (
            '<Plan>\n<Control type="recovery">\n</Control>\n'
            '<Control type="recovery">t</Control></Plan>',
            {"crash": "signal 11"},
            "a.xml:4:1: fabric-v2 crashes on this text: this control contains text",
        ),
    ],
)
def test_refusals(
    text: str,
    expected: dict[str, Any],
    said: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    write(tmp_path, a=text)
    output, err = show("a.xml", capsys=capsys, code=1)
    assert output.items() >= expected.items()
    assert err.startswith(f"gpsfsm: {said}")


def test_limits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=f"<Plan>{GO * 1100}</Plan>")
    for option in ("--max-bytes", "--max-elements"):
        output, err = show("a.xml", option, "20", capsys=capsys, code=2)
        assert output is None
        assert err.startswith("gpsfsm: a.xml: ")
        assert option in err


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--format", "connections"), "needs --engine"),
        (("--engine", "fabric-v1", "--from-response"), "reads the text as it is"),
        (("--engine", "fabric-v9", "--format", "connections"), "fabric-v9"),
        (
            ("--engine", "fabric-v2", "--format", "connections", "--from-response"),
            "reads the text as it is",
        ),
    ],
)
def test_options_that_do_not_fit(
    options: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=f"<Plan>{GO}</Plan>")
    assert main(["show", "a.xml", *options]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert said in err


RECOVERY = f'<Control type="recovery">{GO}</Control>'
TWO = f"<Plan>{GO}{RECOVERY}{RECOVERY}</Plan>"


def test_the_automaton_of_an_engine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Joins that lead to themselves, counts, what never comes, and what comes to nothing."""
    write(tmp_path, a=TWO)
    assert main(["show", "a.xml", "--engine", "fabric-v2", "--format", "dot"]) == 0
    dot, _ = capsys.readouterr()
    assert 'label="1 of 2\\n2nd: ABORT"' in dot
    assert 'n4 -> n4 [label="SUCCEEDED: ABORT"' in dot
    assert 'n4 -> n3 [label="FAILED: never"' in dot
    assert '[label="FAILED: nothing"' in dot
    assert "give up" not in dot
    assert main(["show", "a.xml", "--engine", "fabric-v1", "--format", "mermaid"]) == 0
    assert "|SUCCEEDED: ABORT|" in capsys.readouterr().out
    assert main(["show", "a.xml", "--engine", "fabric-v2", "--format", "json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["engine"] == {
        "name": "fabric-v2",
        "silent": [1, 2, 3],
        "breaking": [4, 5],
        "looping": [4],
    }
    assert main(["show", "a.xml", "--engine", "fabric-v2"]) == 0
    assert capsys.readouterr().out.count("recovery") == 2
    assert main(["show", "a.xml", "--format", "json"]) == 0
    assert "engine" not in json.loads(capsys.readouterr().out)


def test_the_automaton_of_what_an_engine_refuses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, a=f'<Plan>\n<Control type="recovery"/>{GO}</Plan>')
    assert main(["show", "a.xml", "--engine", "fabric-v2", "--format", "dot"]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith(
        "gpsfsm: a.xml:2:1: fabric-v2 refuses this text: the engine makes a connection to"
    )
