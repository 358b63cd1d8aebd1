"""What may be written to standard output and standard error, and that there is one way to it."""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.streams import Form, Stream, drawing, guarded
from tests.cli.support import ACCEPTED, environment, run

ROOT = Path(__file__).resolve().parents[1]
_NAMES = ("stdout", "stderr", "__stdout__", "__stderr__")
_EXEMPT = {
    "gpsfsm/streams.py",  # the one
    "gpsfsm/workers/parent_link.py",  # takes the streams away from what is printed in a worker
    "gpsfsm/lsp/server.py",  # likewise: standard output belongs to the editor
    "runners/generic/python.py",  # keeps what functions print
}
_HOSTILE = st.text(
    st.one_of(
        st.sampled_from("\n\r\t :#[]\x1b\x9b\u202e\u200b\u200d\ufeff\udc80a=|"), st.characters()
    ),
    max_size=40,
)


def _modules() -> list[Path]:
    folders = ("gpsfsm", "analysis", "grammars", "runners")
    actual = {path.resolve() for folder in folders for path in (ROOT / folder).rglob("*.py")}
    return sorted(path for path in actual if str(path.relative_to(ROOT)) not in _EXEMPT)


def _around(code: str) -> list[str]:
    """The lines of a module that write to a standard stream, or could."""
    results = []
    for node in ast.walk(ast.parse(code)):
        what = ""
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            owner, name = node.value.id, node.attr
            if owner == "sys" and name in _NAMES:
                what = f"sys.{name}"
            elif owner == "click" and name in (
                "echo",
                "secho",
                "echo_via_pager",
                "get_text_stream",
            ):
                what = f"click.{name}"
        elif isinstance(node, ast.ImportFrom) and node.module in ("sys", "click"):
            wrong = {"stdout", "stderr", "echo", "secho"} & {alias.name for alias in node.names}
            what = ", ".join(wrong)
        elif isinstance(node, ast.Call):
            function = node.func
            if isinstance(function, ast.Name) and function.id == "print":
                what = "print()"
            elif isinstance(function, ast.Attribute) and function.attr == "write" and node.args:
                first = node.args[0]
                if isinstance(first, ast.Constant) and first.value in (1, 2):
                    what = "os.write()"
        if what:
            results.append(f"{node.lineno}: {what}")  # type: ignore[attr-defined]
    return results


def test_no_module_goes_around_it() -> None:
    assert len(_modules()) > 400
    actual = {path: _around(path.read_text(encoding="utf-8")) for path in _modules()}
    assert {path: places for path, places in actual.items() if places} == {}


def test_that_test_would_notice() -> None:
    code = (
        "import sys, os, click\nsys.stdout.write('')\nprint(1)\nclick.echo('')\nos.write(1, b'')\n"
        "x = sys.stderr\nfrom click import echo\n"
    )
    assert sorted(place.split(":")[0] for place in _around(code)) == list("234567")


class TestGuarded:
    @given(_HOSTILE)
    def test_text_is_nothing_but_text(self, text: str) -> None:
        shown = guarded(text)
        assert not re.search(
            r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069\u200b]", shown
        )
        assert not any("\ud800" <= each <= "\udfff" for each in shown)
        assert not re.search(r"(?m)^[^!-~]*:[^!-~\n]*:", shown)
        assert "##[" not in shown
        assert guarded(shown) == shown
        assert shown.count("\n") == text.count("\n")

    @given(st.lists(st.dictionaries(_HOSTILE, _HOSTILE, max_size=3), max_size=3))
    def test_json_keeps_its_value(self, value: object) -> None:
        for ascii_only in (True, False):
            text = json.dumps(value, ensure_ascii=ascii_only, indent=1)
            shown = guarded(text, Form.JSON)
            assert json.loads(shown) == json.loads(text)
            assert not re.search(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u200b]", shown)
            assert "##[" not in shown

    @given(_HOSTILE)
    def test_exact_text_stays(self, text: str) -> None:
        assert guarded(text, Form.EXACT) is text

    def test_plain_text_stays(self) -> None:
        text = "a::b x=1 “Grüße” │ ├─▶\n\tx: y\n日本語 한국어 العربية 👩‍🚀\n"
        assert guarded(text) == text

    @pytest.mark.parametrize(
        ("text", "form", "shown"),
        [
            ("::error::a", Form.TEXT, "\\x3a:error::a"),
            ("a\n \t::error::a", Form.TEXT, "a\n \t\\x3a:error::a"),
            ("\u200d:\u200d:error::a", Form.TEXT, "\u200d\\x3a\u200d:error::a"),
            ("a ##[error]b", Form.TEXT, "a \\x23#[error]b"),
            ("##vso[x]", Form.TEXT, "\\x23#vso[x]"),
            ("##teamcity[x]", Form.TEXT, "\\x23#teamcity[x]"),
            ("::error file=a::b", Form.COMMANDS, "::error file=a::b"),
            ("::error file=a::\x1b", Form.COMMANDS, "::error file=a::\\x1b"),
            ("\x1b[1;31ma\x1b[2J", Form.COLORED, "\x1b[1;31ma\\x1b[2J"),
            ("\x1b[1m::error::", Form.COLORED, "\x1b[1m\\x3a:error::"),
            ("+\ufeffa\r\n+\u202e\x1b\r\n", Form.DIFF, "+\ufeffa\r\n+\\u202e\\x1b\r\n"),
            (" ::a\r::b", Form.DIFF, " \\x3a:a\r\\x3a:b"),
            ("+a\ufeff", Form.DIFF, "+a\\ufeff"),
        ],
    )
    def test_forms(self, text: str, form: Form, shown: str) -> None:
        assert guarded(text, form) == shown

    @pytest.mark.parametrize("form", Form)
    @pytest.mark.parametrize("count", [2, 3, 50_000])
    def test_of_a_long_text_only_what_would_be_obeyed_is_changed(
        self, form: Form, count: int
    ) -> None:
        """Signs that almost are a command stay, however many of them there are."""
        for text in ("#é" * count, " " * count, "#" * count, "é:" + "#" * count, ":" + " " * count):
            assert guarded(text, form) == text
        sign = {Form.EXACT: "#", Form.JSON: "\\u0023"}.get(form, "\\x23")
        assert guarded("#é" * count + "[", form) == "#é" * (count - 2) + f"{sign}é#é["
        begins = form in (Form.TEXT, Form.COLORED, Form.DIFF)
        shown = "\\x3a" if begins else ":"
        assert guarded(":é" * count, form) == shown + "é" + ":é" * (count - 1)


def test_what_draws_may_move_and_colour_only(capsys: pytest.CaptureFixture[str]) -> None:
    drawing(Stream.OUT).write("\x1b[2K\x1b[1;31ma\r\x1b]0;title\x07\x1b[?25h\u202e")
    assert capsys.readouterr().out == "\x1b[2K\x1b[1;31ma\r\\x1b]0;title\\x07\x1b[?25h\\u202e"


def test_the_difference_is_escaped(tmp_path: Path) -> None:
    text = '<Plan><!--\x1b[31m\u202e\n::error::x\n--><Runner interface="a/Go" provider="a/Go"/>'
    (tmp_path / "a.xml").write_text(text, encoding="utf-8")
    out = run("fix", "--diff", "--unsafe-fixes", "a.xml", cwd=tmp_path).stdout.decode()
    assert "\\x1b[31m" in out
    assert "\x1b" not in out
    assert "\u202e" not in out
    assert "\\x3a:error::x" in out


@pytest.mark.parametrize("value", ["a&#10;::error::x", "a&#13;&#10;##[error]x"])
@pytest.mark.parametrize(
    "words", [("show", "--engine", "fabric-v2"), ("run",), ("fuzz",), ("port", "--to", "fabric-v2")]
)
def test_a_line_break_in_a_value_begins_no_line(
    tmp_path: Path, value: str, words: tuple[str, ...]
) -> None:
    runner = f'<Runner interface="a/Go" provider="{value}"/>'
    text = f'<Plan><Control type="{value}">{runner}</Control></Plan>'
    (tmp_path / "a.xml").write_text(text, encoding="utf-8")
    done = run(*words, "a.xml", cwd=tmp_path)
    assert b"error" in done.stderr + done.stdout
    assert not re.search(rb"(?m)^\s*(::|##\[)", done.stderr + done.stdout)


def test_a_file_name_begins_no_line(tmp_path: Path) -> None:
    name = "a\n::error::x\ngpsfsm: all is well\n.xml"
    for words in (("check",), ("show",), ("run",), ("fuzz",), ("fix",), ("gate",)):
        lines = run(*words, name, cwd=tmp_path).stderr.decode().splitlines()
        assert not any(line.lstrip().startswith("::") for line in lines)
        assert not any(line.startswith("gpsfsm: all") for line in lines)


class TestExact:
    TEXT = ACCEPTED.replace("</Plan>", "<!--\n::error::x\n-->\n</Plan>")

    def written(
        self, folder: Path, redirect: str, **env: str
    ) -> subprocess.CompletedProcess[bytes]:
        command = [sys.executable, "-m", "gpsfsm", "fix", "-"]
        out = None if redirect == "pipe" else (folder / "out").open("wb")
        try:
            return subprocess.run(
                command,
                input=self.TEXT.encode(),
                stdout=out or subprocess.PIPE,
                stderr=subprocess.PIPE,
                env=environment(**env),
                check=False,
            )
        finally:
            if out is not None:
                out.close()

    def test_a_pipe_gets_every_byte(self, tmp_path: Path) -> None:
        assert self.written(tmp_path, "pipe").stdout == self.TEXT.encode()

    def test_not_if_it_may_be_a_log_that_obeys(self, tmp_path: Path) -> None:
        done = self.written(tmp_path, "pipe", GITHUB_ACTIONS="true")
        assert (done.returncode, done.stdout) == (2, b"")
        assert b"line 4 of this text would be a command" in done.stderr

    def test_a_file_is_no_log(self, tmp_path: Path) -> None:
        done = self.written(tmp_path, "file", GITHUB_ACTIONS="true")
        assert done.returncode == 0
        assert (tmp_path / "out").read_bytes() == self.TEXT.encode()
