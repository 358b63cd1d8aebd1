"""Hostile texts: what a plan, a file name or a value may hold to fool whoever reads the output.

Each case is a command line as somebody runs it who has got the plan from somebody else. It has to
end in time, with an exit code of its own, and in what it writes there must be nothing that a
terminal, the log of a server, a spreadsheet or a reader of Markdown would obey, and no line that
the plan has made.
"""

from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import time
import unicodedata
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING
from xml.etree import ElementTree

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.cli.support import TIMEOUT_S, run, start

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from hypothesis.strategies import DrawFn

__all__ = ["PAIR", "Case", "commands", "judge"]

FORGED = "FORGED: accepted"
_LONGEST_S = 45.0
_TASK = "task: go\nactions:\n  go: {interface: Go}\nsteps:\n  - do: go\n"
_RUNNER = 'interface="a/Go" provider="a/Go"'

_PIECES = (
    *("\n::error::x", "\n::stop-commands::x", "::add-mask::x", "##[error]x", "##vso[task.x]y"),
    *(f"\n{FORGED}", f"\r{FORGED}", f"\x85{FORGED}", f"\u2028{FORGED}", "\n  ::warning file=a::b"),
    *("\x1b[31m", "\x1b]0;title\x07", "\x9b2J", "\x08\x08", "\x7f", "\x00", "\u202e", "\u2066"),
    *("\u200b", "\ufeff", "\u00ad", "\U000e0041", "\u0430", "\u2170", "\udc80", "\u200d::error::x"),
    *("=cmd|' /C calc'!A0", "+1+1", "-2", "@SUM(A1)", "\t=1", "|", "`", "```\n"),
    *(
        "<img src=x onerror=alert(1)>",
        "[a](javascript:alert(1))",
        "![a](http://e.org)",
        "</script>",
    ),
    *("**x**", "# head", "\n- item", "&amp;", "%0A::error::x", "]]>", "<!--", "{}", "{0}", "%s"),
)
_WHOLE = (
    '<!DOCTYPE a [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;"><!ENTITY c "&b;&b;">]>'
    "<Plan>&c;</Plan>",
    '<!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><Plan>&x;</Plan>',
    "<Plan>" + "<Control type='sequential'>" * 400 + "</Control>" * 400 + "</Plan>",
    "<Plan" + ' a="b"' * 3000 + "/>",
    f'<Plan><Runner {_RUNNER} x="' + "A" * 100_000 + '"/></Plan>',
    "<" * 5000,
    "&#10;::error::x" * 50,
    "\x00\xff\xfe<Plan/>",
    "",
)
_ALLOWED = "\u200c\u200d"
_LINE_ENDS = "\r\x0b\x0c\x1c\x1d\x1e\x85\u2028\u2029"
"""What ``patch`` compares, so that a difference has to hold it."""


@dataclass(frozen=True, slots=True)
class Case:
    """A plan's text and name, the words of a command line and how its output is to be read."""

    text: bytes
    name: str
    words: tuple[str, ...]
    form: str
    server: bool


def commands() -> tuple[tuple[str, tuple[str, ...]], ...]:
    """How output is to be read, and the command; PLAN and OTHER stand for names of plans."""
    formats = ("text", "json", "sarif", "gitlab", "junit", "markdown", "github", "llm")
    engines = ("--engine", "fabric-v2")
    forms = {"json": "json", "sarif": "json", "gitlab": "json", "junit": "xml", "github": "github"}
    shown = {"tree": "text", "dot": "text", "mermaid": "text", "svg": "xml", "json": "json"}
    return (
        *((forms.get(each, "text"), ("check", "PLAN", "--format", each)) for each in formats),
        ("text", ("check", "PLAN", *engines)),
        ("text", ("check", "PLAN", "--from-response")),
        ("text", ("check", "PLAN", "--assume", "NAME fails")),
        ("colored", ("check", "PLAN", "--color", "always")),
        ("diff", ("check", "PLAN", "--diff")),
        *((shown[each], ("show", "PLAN", "--format", each)) for each in shown),
        *((shown[each], ("show", "PLAN", "--format", each, *engines)) for each in ("tree", "svg")),
        ("json", ("show", "PLAN", "--format", "connections", *engines)),
        ("text", ("diff", "PLAN", "OTHER")),
        ("json", ("diff", "PLAN", "OTHER", "--format", "json")),
        ("diff", ("fix", "PLAN", "--diff", "--unsafe-fixes")),
        ("exact", ("fix", "-", "--unsafe-fixes")),
        ("diff", ("port", "PLAN", "--to", "fabric-v2", "--unsafe", "--diff")),
        ("exact", ("port", "PLAN", "--to", "fabric-v1")),
        ("text", ("run", "PLAN", "--seed", "1")),
        ("json lines", ("run", "PLAN", "--format", "json")),
        ("text", ("fuzz", "PLAN", "--runs", "3")),
        ("json", ("fuzz", "PLAN", "--runs", "3", "--format", "json")),
        ("text", ("gate", "PLAN")),
        ("json", ("gate", "PLAN", "--format", "json")),
        ("text", ("grade", "PLAN", "--task", "TASK")),
        ("markdown", ("grade", "PLAN", "--task", "TASK", "--table", "md")),
        ("csv", ("grade", "PLAN", "--task", "TASK", "--table", "csv")),
        ("json", ("grade", "PLAN", "--task", "TASK", "--table", "json")),
        ("text", ("check", "OTHER", "--task", "PLAN")),
        ("text", ("check", "OTHER", "--capabilities", "PLAN")),
        ("text", ("check", "OTHER", "--config", "PLAN")),
        ("text", ("check", "OTHER", "--baseline", "PLAN")),
        ("text", ("run", "OTHER", "--world", "PLAN")),
        ("text", ("run", "OTHER", "--scenario", "PLAN")),
        ("text", ("capabilities", "check", "PLAN")),
        ("text", ("gate", "OTHER", "--verify", "PLAN")),
        ("prompt", ("prompt", "NAME")),
        ("json", ("prompt", "NAME", "--format", "json")),
        ("text", ("events", "PLAN")),
        ("text", ("replay", "PLAN")),
        ("text", ("attempts", "PLAN")),
        ("text", ("generate", "NAME", "--model", "replay:PLAN")),
        ("text", ("rule", "NAME")),
    )


@st.composite
def _texts(draw: DrawFn) -> bytes:
    if draw(st.integers(0, 5)) == 0:
        return draw(st.sampled_from(_WHOLE)).encode("utf-8", "surrogateescape")
    raw = draw(st.booleans())

    def value() -> str:
        drawn = "".join(draw(st.lists(st.sampled_from(_PIECES), min_size=1, max_size=3)))
        return drawn if raw else "".join(map(_reference, drawn))

    names = draw(st.sampled_from(("x", "name", "id", "interface", "provider", "task", "type")))
    first = f'<Runner {_RUNNER} {names}="{value()}"/>'
    if names in ("interface", "provider"):
        first = f'<Runner {names}="{value()}" x="{value()}"/>'
    if draw(st.integers(0, 3)) == 0:
        first = f"<{draw(st.sampled_from(('Runer', 'Control', 'x')))} type='{value()}'>" + first
    kind = draw(st.sampled_from(("sequential", "parallel_all", "recovery", value())))
    between = draw(st.sampled_from(("", "", "<!--", "text ")))
    between += value() + ("-->" if between == "<!--" else "") if between else ""
    text = (
        f'<Plan>\n{between}<Control type="{kind}">\n{first}\n<Runner {_RUNNER}/></Control></Plan>'
    )
    return text.encode("utf-8", "surrogatepass")


def _reference(character: str) -> str:
    """Characters as a careful attacker writes them, so that the text is XML."""
    if character in '<&"' or not character.isprintable():
        return f"&#{ord(character)};"
    return character


@st.composite
def _cases(draw: DrawFn) -> Case:
    form, words = draw(st.sampled_from(commands()))
    name = "plan.xml"
    if draw(st.integers(0, 2)) == 0:
        pieces = draw(st.lists(st.sampled_from(_PIECES), min_size=1, max_size=2))
        name = "".join(pieces).replace("/", "_").replace("\0", "_")[:60].lstrip("-.") + ".xml"
    return Case(draw(_texts()), name, words, form, draw(st.booleans()))


def judge(case: Case) -> Iterator[str]:
    """Run the command line and look at all that it writes."""
    with TemporaryDirectory() as place:
        folder = Path(place)
        plan = folder / case.name
        try:
            plan.write_bytes(case.text)
        except (OSError, UnicodeEncodeError):
            yield "no such file name"
            return
        (folder / "other.xml").write_text(f"<Plan><Runner {_RUNNER}/></Plan>")
        (folder / "task.yaml").write_text(_TASK)
        words_ = {"PLAN": case.name, "OTHER": "other.xml", "TASK": "task.yaml", "NAME": case.name}
        words_["replay:PLAN"] = f"replay:{case.name}"
        words = [words_.get(word, word) for word in case.words]
        stdin = case.text if "-" in words else b""
        env = {"GITHUB_ACTIONS": "true"} if case.server else {}
        began = time.monotonic()
        code, out, err = _run(words, folder, stdin, env, piped=case.form == "exact")
        took = time.monotonic() - began
    assert code in (0, 1, 2), (code, err)
    assert "Traceback" not in out + err, err
    assert took < _LONGEST_S, took
    assert "defect of gpsfsm" not in out + err, err
    _check_text(err)
    _FORMS.get(case.form, _check_text)(out) if case.form != "exact" else _check_exact(out, case)
    yield f"{case.words[0]}: exit code {code}"
    yield "named by the attacker" if case.name != "plan.xml" else "plain name"


def _run(
    words: list[str], folder: Path, stdin: bytes, env: dict[str, str], *, piped: bool
) -> tuple[int, str, str]:
    """The exit code and what was written: into files, or as a log is, into pipes."""
    if not piped:
        done = run(*words, cwd=folder, stdin=stdin, env=env)
        return done.returncode, done.stdout.decode(), done.stderr.decode()
    process = start(*words, cwd=folder, stdin=subprocess.PIPE, env=env)
    out, err = process.communicate(stdin, timeout=TIMEOUT_S)
    return process.returncode, out.decode("utf-8", "replace"), err.decode()


def _check_text(text: str, *, kept: str = "", own: bool = False, quotes: bool = False) -> None:
    """``quotes``: the text holds lines of the plan, or of the task, by its nature."""
    for character in text:
        plain = character.isprintable() or unicodedata.category(character) == "Zs"
        assert plain or character in "\n\t" + _ALLOWED + kept, (hex(ord(character)), text[:500])
    assert "##[" not in text, text[:500]
    assert "##vso[" not in text, text[:500]
    for line in text.split("\n"):
        bare = line.lstrip(" \t\u200c\u200d\u00a0\u2003\u3000")
        assert own or not bare.startswith("::"), line
        assert quotes or not line.startswith("FORGED"), line


def _check_prompt(text: str) -> None:
    _check_text(text, quotes=True)


def _check_github(text: str) -> None:
    _check_text(text, own=True)
    for line in text.split("\n"):
        command = line.lstrip()
        if command.startswith("::"):
            assert command.startswith(("::error file=", "::warning file=", "::notice file=")), line


def _check_json(text: str) -> None:
    _check_text(text)
    assert not text or json.loads(text) is not None


def _check_lines(text: str) -> None:
    _check_text(text)
    for line in text.splitlines():
        json.loads(line)


def _check_xml(text: str) -> None:
    _check_text(text)
    if text:
        ElementTree.fromstring(text)  # noqa: S314  (our own)
    assert "<img" not in text
    assert "<script" not in text


def _check_colored(text: str) -> None:
    _check_text(re.sub(r"\x1b\[[0-9;]*m", "", text))


def _check_diff(text: str) -> None:
    _check_text(
        text.replace("\n+\ufeff", "\n+").replace("\n-\ufeff", "\n-"), kept=_LINE_ENDS, quotes=True
    )
    assert "\r::" not in text


def _check_markdown(text: str) -> None:
    _check_text(text)
    for line in text.split("\n"):
        if line.startswith("| "):
            bare = line.replace("\\\\", "").replace("\\|", "").replace("\\[", "").replace("\\<", "")
            assert "<" not in bare, line
            assert "](" not in bare, line
            assert bare.count("|") == 6, line


def _check_csv(text: str) -> None:
    _check_text(text)
    rows = list(csv.reader(io.StringIO(text)))
    assert len({len(row) for row in rows}) <= 1
    for row in rows:
        assert not any(cell.startswith(("=", "+", "-", "@", "\t", "\r")) for cell in row), row


def _check_exact(out: str, case: Case) -> None:
    """A plan goes to a program as it is, and to a log only if nothing in it is a command."""
    if case.server:
        for line in out.replace("\r", "\n").split("\n"):
            assert not line.strip(" \t\u200d").startswith("::"), line
            assert "##[" not in line, line


_FORMS: dict[str, Callable[[str], None]] = {
    "github": _check_github,
    "prompt": _check_prompt,
    "json": _check_json,
    "json lines": _check_lines,
    "xml": _check_xml,
    "colored": _check_colored,
    "diff": _check_diff,
    "markdown": _check_markdown,
    "csv": _check_csv,
}


def _text(case: Case) -> str:
    return (
        f"# name {case.name!r}\n# gpsfsm {case.words!r} ({case.form}, server {case.server})\n"
        f"{case.text!r}\n"
    )


PAIR = Pair(
    name="texts",
    about="hostile texts, names and values in all that is written",
    cases=_cases,
    judge=judge,
    text=_text,
    full=20_000,
    batch=25,
    few=10,
    attack=True,
)
