"""Executable content of SCXML: what is raised, sent, remembered and invoked, and in which order."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

import gpsfsm
from gpsfsm.compile.formats.scxml import read
from gpsfsm.model.precision import Cause, Reading
from gpsfsm.model.report import Frequency
from gpsfsm.syntax.source import DEFAULT_LIMITS

W3C = Path(__file__).parents[4] / "shared" / "corpus" / "scxml_w3c"
HEAD = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0">'
ENDS = '<final id="ok"/><final id="failed"/></scxml>'
LETTERS = {Frequency.ALWAYS: "A", Frequency.SOMETIMES: "S", Frequency.NEVER: "N"}


def facts_of(source: str | Path) -> tuple[str, str, str]:
    """Completes, gives up, stuck, endless; the unreachable; what is not proved of the first."""
    facts = gpsfsm.check(source).plans[0].facts
    assert facts is not None
    assert facts.machine is not None
    ends = (facts.completes, facts.gives_up, facts.stuck, facts.machine.endless)
    unreachable = " ".join(each.rpartition("/")[2] for each in facts.unreachable)
    names = ("completes", "gives_up", "stuck", "endless")
    unproved = " ".join(each for each in names if each in facts.precision)
    return "".join(LETTERS[each] for each in ends), unreachable, unproved


def entering(name: str, raised: str, rows: str, inside: str = "") -> str:
    """A state that raises events when it is entered."""
    events = "".join(f'<raise event="{each}"/>' for each in raised.split())
    return f'<state id="{name}"><onentry>{events}</onentry>{rows}{inside}</state>'


def on(event: str, target: str, content: str = "") -> str:
    """A transition."""
    name = f' event="{event}"' if event else ""
    return f'<transition{name} target="{target}">{content}</transition>'


X = '<raise event="x"/>'
Y = '<raise event="y"/>'
REST = on("*", "failed")
FOLLOWED = {
    "first in, first out": entering("a", "x y", on("x", "b") + REST)
    + f'<state id="b">{on("y", "ok")}{REST}</state>',
    "without event first": entering("a", "x", on("x", "failed") + on("", "ok")),
    "by whole tokens": entering("a", "x.y", on("x.y.z", "failed") + on("x", "ok") + REST),
    "the inner state first": entering(
        "a", "x", on("x", "failed"), f'<state id="b">{on("x", "ok")}</state>'
    ),
    "what nobody waits for is lost": entering("a", "z x", on("x", "ok")),
    "exit, transition, entry": (
        f'<state id="a"><onexit><raise event="u"/></onexit>{on("", "b", X)}</state>'
        + entering("b", "y", on("u", "c") + REST)
        + f'<state id="c">{on("x", "d")}{REST}</state><state id="d">{on("y", "ok")}{REST}</state>'
    ),
    "exit inside first": (
        f'<state id="a"><onexit>{Y}</onexit>{on("", "c")}'
        f'<state id="b"><onexit>{X}</onexit></state></state>'
        f'<state id="c">{on("x", "d")}{REST}</state><state id="d">{on("y", "ok")}{REST}</state>'
    ),
    "initial after entry, before what is inside": (
        f'<state id="a"><onentry>{X}</onentry><initial>{on("", "b", Y)}</initial>'
        f'{entering("b", "z", on("", "c"))}</state>'
        f'<state id="c">{on("x", "d")}{REST}</state><state id="d">{on("y", "e")}{REST}</state>'
        f'<state id="e">{on("z", "ok")}{REST}</state>'
    ),
    "entry of a final state before its done.state": (
        f'<state id="a">{on("done.state.a", "failed")}{on("x", "ok")}'
        f'<state id="b">{on("", "f")}</state><final id="f"><onentry>{X}</onentry></final></state>'
    ),
    "done.state before what comes later": (
        f'<state id="a">{on("done.state.a", "b", X)}{on("x", "failed")}{on("y", "failed")}'
        f'<state id="i">{on("", "f")}</state><final id="f"/></state>'
        f'<state id="b">{on("x", "ok")}{REST}</state>'
    ),
    "regions in document order": (
        f'<parallel id="p">{on("y", "failed")}{on("x", "ok")}{entering("a", "x", "")}'
        f'{entering("b", "y", "")}</parallel>'
    ),
    "one event in two regions": (
        f'<parallel id="p"><onentry>{X}</onentry>{on("done.state.p", "ok")}'
        f'<state id="a"><state id="a1">{on("x", "a2")}</state><final id="a2"/></state>'
        f'<state id="b"><state id="b1">{on("x", "b2")}</state><final id="b2"/></state></parallel>'
    ),
    "sent inwards": (
        '<state id="a"><onentry><send event="x" target="#_internal"/></onentry>'
        f'{on("x", "ok")}</state>'
    ),
    "In": (
        '<parallel id="p"><state id="a"><transition cond="In(\'b\')" target="ok"/>'
        '<transition target="failed"/></state><state id="b"/></parallel>'
    ),
    "no history yet": (
        f'<state id="a">{on("", "h")}</state><state id="b"><history id="h">{on("", "d")}</history>'
        f'<state id="c">{on("", "failed")}</state><state id="d">{on("", "ok")}</state></state>'
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(FOLLOWED))
def test_a_macrostep_is_followed(kind: str) -> None:
    ends, unreachable, unproved = facts_of(HEAD + FOLLOWED[kind] + ENDS)
    assert (ends, unproved) == ("ANNN", "")
    assert set(unreachable.split()) <= {"c"}


HISTORY = '<history id="h" type="{}">' + on("", "b") + "</history>"
OTHERS = {
    # the kind: the chart; its facts, unreachable states, facts that are not proved
    "a moment without end": (entering("a", "x", on("x", "a")), ("NNNA", "", "")),
    "a state that is passed and entered, too": (
        entering("a", "x", on("x", "b")) + f'<state id="b">{on("u", "c")}</state>'
        f'<state id="c">{on("", "b")}</state><state id="d"/>',
        ("NNNA", "d", ""),
    ),
    "a false condition": (
        '<state id="a"><transition event="x" cond="false" target="b"/>'
        f'{on("x", "ok")}</state><state id="b"/>',
        ("ANNN", "b", ""),
    ),
    "a condition that decides": (
        entering("a", "x", '<transition event="x" cond="c" target="ok"/>' + on("x", "failed")),
        ("SSNN", "", "completes gives_up"),
    ),
    "if": (
        f'<state id="a"><onentry><if cond="c">{X}<else/>{Y}</if></onentry>{on("x", "ok")}'
        f'{on("y", "failed")}{on("", "b")}</state><state id="b">{on("x", "ok")}{on("y", "failed")}'
        "</state>",
        ("SSSS", "", "completes gives_up stuck endless"),
    ),
    "raised beside unknown states": (
        f'<parallel id="p"><state id="a"><state id="a1">{on("u", "a2")}</state>'
        f'{entering("a2", "x", "")}</state><state id="b">{on("x", "ok")}{on("v", "failed")}</state>'
        "</parallel>",
        ("SSNN", "", "completes gives_up"),
    ),
    "without end beside unknown states": (
        f'<parallel id="p"><state id="a"><state id="a1">{on("x u", "a1", X)}</state></state>'
        f'<state id="b">{on("v", "ok")}</state></parallel>',
        ("SNNS", "", "completes endless"),
    ),
    "history": (
        f'<state id="a">{on("u", "o")}{HISTORY.format("shallow")}<state id="b">{on("x", "c")}'
        f'</state><state id="c">{on("y", "ok")}</state></state>'
        f'<state id="o">{on("v", "h")}</state>',
        ("SNNS", "", "completes endless"),
    ),
    "a history from within": (  # a is not left
        f'<state id="a">{HISTORY.format("deep")}{on("u", "ok")}<state id="b">{on("x", "c")}'
        f'</state><state id="c">{on("y", "h")}</state></state>',
        ("SNNS", "", "completes endless"),
    ),
    "a history of what is left": (  # a is left, and entered again as it was
        f'<state id="a">{HISTORY.format("shallow")}{on("u", "h")}<state id="b">{on("x", "c")}'
        f'</state><state id="c">{on("y", "ok")}</state></state>',
        ("SNNS", "", "completes endless"),
    ),
    "raised on the way in, without end, beside unknown states": (
        f'<parallel id="p"><state id="a"><state id="a1">{on("u", "a2")}</state><state id="a2">'
        f'<initial>{on("", "i", X)}</initial>{on("x", "a2")}<state id="i"/></state></state>'
        f'<state id="b">{on("v", "ok")}</state></parallel>',
        ("SNNS", "", "completes endless"),
    ),
    "what fails": (
        '<state id="a"><onentry><assign location="i" expr="1/0"/></onentry>'
        f'{on("error", "failed")}{on("x", "ok")}</state>',
        ("SSNN", "", "completes gives_up"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(OTHERS))
def test_the_rest_is_over_approximated(kind: str) -> None:
    body, expected = OTHERS[kind]
    assert facts_of(HEAD + body + ENDS) == expected


OVER, SKIPPED = Reading.OVER, Reading.SKIPPED
READINGS = [
    ('<onentry><send event="x"/></onentry>', "send", OVER, Cause.EVENTS),
    ('<onentry><send eventexpr="e"/></onentry>', "send", OVER, Cause.EVENTS),
    ('<onentry><foreach array="a" item="i"><raise event="x"/></foreach></onentry>', "foreach", OVER,
     Cause.EVENTS),
    ('<onentry><foreach array="a" item="i"/></onentry>', "foreach", SKIPPED, Cause.DATA),
    ('<onentry><if cond="c"/></onentry>', "if", SKIPPED, Cause.DATA),
    ("<onentry><script>raise()</script></onentry>", "script", SKIPPED, Cause.DATA),
    ('<onentry><assign location="i" expr="i + 1"/></onentry>', "assign", SKIPPED, Cause.DATA),
    ('<onentry><log expr="i"/></onentry>', "log", SKIPPED, Cause.NO_MEANING),
    ('<onentry><cancel sendid="i"/></onentry>', "cancel", SKIPPED, Cause.NO_MEANING),
    ('<onentry><send event="x"><param name="n" expr="1"/></send></onentry>', "param", SKIPPED,
     Cause.DATA),
    ('<datamodel><data id="i" expr="1"/></datamodel>', "data", SKIPPED, Cause.DATA),
    ('<invoke src="other.scxml"/>', "invoke", OVER, Cause.INVOKED),
    ("<invoke><finalize><log/></finalize></invoke>", "finalize", SKIPPED, Cause.DATA),
    ('<invoke><content><scxml><state id="a"/><nonsense/></scxml></content></invoke>', "content",
     SKIPPED, Cause.DATA),
    ('<transition event="u" cond="False" target="failed"/>', "transition", SKIPPED, Cause.FALSE),
]  # fmt: skip


@pytest.mark.parametrize(("body", "construct", "reading", "cause"), READINGS)
def test_what_is_not_exact_is_reported(
    body: str, construct: str, reading: Reading, cause: Cause
) -> None:
    text = f'{HEAD}<state id="a">{body}<transition event="x" target="ok"/></state>{ENDS}'
    machine, problems = read(text, "chart.scxml", DEFAULT_LIMITS)
    assert machine is not None, problems
    said = {(each.construct, each.reading, each.cause) for each in machine.approximations}
    assert (construct, reading, cause) in said
    assert bool(machine.inexact) == (reading is OVER or "<send" in body or "<invoke" in body)


DEEP = "".join(f'<state id="r{n}"><state id="a{n}"/><state id="b{n}"/></state>' for n in range(5))
REFUSED = [
    ('<state id="a"><raise event="x"/></state>', "a <state> cannot contain a <raise>"),
    ('<state id="a"><onentry><else/></onentry></state>', "a <onentry> cannot contain a <else>"),
    ('<state id="a"><onentry><raise/></onentry></state>', "this <raise> has no event"),
    ('<state id="a"><history id="h"/><state id="b"/></state>', "does not have exactly one"),
    ('<state id="a"><history type="all"/></state>', "a history has no type 'all'"),
    ('<state id="a"><history id="h"><transition target="ok"/></history></state>', "is not in this"),
    (f'<state id="a">{HISTORY.format("deep")}<state id="b"><state id="c">{on("x", "h")}</state>'
     "</state></state>", "cannot be followed from here"),
    (f'<state id="a">{on("x", "o")}<history id="h" type="deep">{on("", "p")}</history>'
     f'<parallel id="p">{DEEP}</parallel></state><state id="o">{on("x", "h")}</state>',
     "more than 16 possibilities"),
]  # fmt: skip


@pytest.mark.parametrize(("body", "words"), REFUSED)
def test_what_cannot_be_followed_is_refused(body: str, words: str) -> None:
    machine, problems = read(HEAD + body + ENDS, "chart.scxml", DEFAULT_LIMITS)
    assert machine is None
    assert words in problems[0].message
    assert problems[0].hint


DECIDED = {
    "144", "145", "189", "310", "355", "364", "375", "377", "387", "399", "403a", "404", "405",
    "406", "412", "413", "416", "417", "419", "421", "451", "570", "576",
}  # fmt: skip
"""The tests that no environment can make fail, without data."""


@pytest.mark.skipif(not W3C.exists(), reason="the tests of the W3C are not here")
def test_the_tests_of_the_w3c() -> None:
    with (W3C / "files.csv").open(encoding="utf-8", newline="") as rows:
        names = [row["file"] for row in csv.DictReader(rows)]
    decided = set()
    for name in names:
        ends, _, unproved = facts_of(W3C / name)
        assert ends[0] != "N", name
        if ends == "ANNN" and "sub" not in name:
            assert not unproved
            decided.add(Path(name).stem.removeprefix("test"))
    assert decided == DECIDED
    assert len(names) == 81
