"""The judge of SCXML: small charts whose runs the recommendation says, and those of the W3C."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from tests.cases import many
from tests.compile.formats.random_statecharts import EventfulChart
from tests.compile.formats.statecharts import Chart, TooManyError

W3C = Path(__file__).parents[4] / "shared/corpus/scxml_w3c"
HEAD = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0">'
ENDS = '<final id="ok"/><final id="no"/></scxml>'
FIRST = '<transition event="{}" target="ok"/><transition event="*" target="no"/>'


def chart(body: str, *, fails: bool = True) -> Chart:
    return Chart(HEAD.replace(">", ' datamodel="python">') + body + ENDS, fails=fails)


def ends(judge: Chart, *events: str) -> set[str]:
    """The atomic states after events."""
    moments = judge.first()
    for event in events:
        moments = judge.after(moments, event)
    return {
        "+".join(sorted(judge.names[each] for each in here.at if judge.is_atomic(each)))
        for here in moments
    }


def raises(*events: str) -> str:
    return "".join(f'<raise event="{each}"/>' for each in events)


KNOWN = {
    "first in, first out": (
        f'<state id="a"><onentry>{raises("x", "y")}</onentry>{FIRST.format("x")}</state>', "ok"
    ),
    "exit, content, entry": (
        f'<state id="a"><onexit>{raises("x")}</onexit><transition target="b">{raises("y")}'
        f'</transition></state><state id="b"><onentry>{raises("z")}</onentry>'
        '<transition event="x" target="c"/></state>'
        '<state id="c"><transition event="y" target="d"/></state>'
        f'<state id="d">{FIRST.format("z")}</state>', "ok"
    ),
    "eventless first": (
        f'<state id="a"><onentry>{raises("x")}</onentry><transition event="x" target="no"/>'
        '<transition target="ok"/></state>', "ok"
    ),
    "entry of a final before its end": (
        f'<state id="a">{FIRST.format("x")}<final id="f"><onentry>{raises("x")}</onentry></final>'
        "</state>", "ok"
    ),
    "content of an initial element after the entry": (
        f'<state id="a"><onentry>{raises("x")}</onentry><initial><transition target="b">'
        f'{raises("y")}</transition></initial><transition event="x"/>{FIRST.format("y")}'
        '<state id="b"/></state>', "ok"
    ),
    "content of a default of a history": (
        f'<state id="a"><transition target="h"/></state><state id="s"><history id="h"><transition'
        f' target="c">{raises("y")}</transition></history><state id="b"/><state id="c">'
        f'<onentry>{raises("z")}</onentry>{FIRST.format("y")}</state></state>', "ok"
    ),
    "sent inside": (
        '<state id="a"><onentry><send event="x" target="#_internal"/></onentry>'
        f'{FIRST.format("x")}</state>', "ok"
    ),
    "what is active on exit": (
        '<parallel id="p"><state id="a"><onexit><if cond="In(\'b\')"><raise event="x"/><else/>'
        '<raise event="y"/></if></onexit></state><state id="b"/><transition target="q"/></parallel>'
        f'<state id="q">{FIRST.format("y")}</state>', "ok"
    ),
    "what is active on entry": (
        '<parallel id="p"><state id="a"><onentry><if cond="In(\'b\')"><raise event="x"/><else/>'
        f'<raise event="y"/></if></onentry>{FIRST.format("y")}</state><state id="b"/></parallel>',
        "ok",
    ),
    "literals": (
        '<state id="a"><transition cond="False" target="no"/><transition cond="True" target="ok"/>'
        "</state>", "ok"
    ),
    "an inner final": (
        f'<state id="a"><final id="f"><onentry>{raises("x")}</onentry>'
        '<transition event="x" target="ok"/></final></state>', "ok"
    ),
    "an end of the machine": (
        f'<state id="a"><transition target="end"/></state><final id="end"><onentry>{raises("x")}'
        '</onentry><transition event="x" target="no"/></final>', "end"
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(KNOWN))
def test_what_is_known_is_one_run(kind: str) -> None:
    body, end = KNOWN[kind]
    assert ends(chart(body)) == {end}


HISTORY = """<state id="s" initial="a"><transition event="out" target="o"/>
  <history id="h" type="{}"><transition target="b"/></history>
  <state id="a"><state id="a1"><transition event="x" target="a2"/></state><state id="a2"/></state>
  <state id="b"/></state>
  <state id="o"><transition event="in" target="h"/></state>"""


def test_a_history_holds_what_was_left() -> None:
    assert ends(chart(HISTORY.format("deep")), "x", "out", "in") == {"a2"}
    assert ends(chart(HISTORY.format("shallow")), "x", "out", "in") == {"a1"}
    fresh = HISTORY.format("deep").replace('initial="a"', "").partition('<state id="o">')
    assert ends(chart(f'<state id="w"><transition target="h"/></state>{fresh[0]}{fresh[1]}'
                      '<transition event="in" target="h"/></state>')) == {"b"}  # fmt: skip


MAY = {
    "assign": '<assign location="x" expr="1"/><raise event="x"/>',
    "script": '<script>1</script><raise event="x"/>',
    "log": '<log expr="n"/><raise event="x"/>',
    "send": '<send event="e" target="#_parent"/><raise event="x"/>',
    "loop": '<foreach array="c" item="i"><raise event="x"/></foreach><raise event="y"/>',
    "branch": '<if cond="c"><raise event="x"/><else/><raise event="y"/></if>',
}


@pytest.mark.parametrize("kind", sorted(MAY))
def test_what_is_evaluated_may_fail_and_ends_its_block(kind: str) -> None:
    body = (
        f'<state id="a"><onentry>{MAY[kind]}</onentry><transition event="error.*" target="no"/>'
        '<transition event="x" target="ok"/><transition event="y" target="y"/></state>'
        '<state id="y"/>'
    )
    first = {"loop": {"ok", "y"}, "branch": {"ok", "y"}}.get(kind, {"ok"})
    assert ends(chart(body, fails=False)) == first
    assert ends(chart(body)) == first | {"no"}


def test_a_condition_that_fails_is_false_and_is_told() -> None:
    body = (
        '<state id="a"><transition event="x" cond="c" target="ok"/>'
        '<transition event="error.execution" target="no"/></state>'
    )
    assert ends(chart(body), "x") == {"a", "ok", "no"}
    assert ends(chart(body, fails=False), "x") == {"a", "ok"}
    assert ends(chart(body), "error.execution.other") == {"no"}
    again = '<state id="a"><transition cond="c" target="ok"/><transition event="error"/></state>'
    verdict = chart(again).verdict()
    assert verdict.faulty
    assert not chart(again, fails=False).verdict().faulty


def test_services_answer() -> None:
    body = (
        '<state id="a"><invoke id="i" src="s.scxml"/>'
        '<transition event="done.invoke.i" target="ok"/></state>'
    )
    assert chart(body).verdict().completes
    assert chart(body.replace('<invoke id="i" src="s.scxml"/>', "")).verdict().stuck


def w3c() -> list[tuple[str, str]]:
    if not W3C.is_dir():
        return []
    with (W3C / "files.csv").open(encoding="utf-8") as rows:
        return [
            (row["file"], row["needs"])
            for row in csv.DictReader(rows)
            if "sub" not in row["file"] and "330" not in row["file"] and "336" not in row["file"]
        ]  # those two have their finals alone in the namespace


@pytest.mark.parametrize(("file", "needs"), w3c())
def test_the_charts_of_the_w3c_can_pass(file: str, needs: str) -> None:
    text = (W3C / file).read_text(encoding="utf-8-sig")
    assert Chart(text).verdict().completes
    if needs in ("structure only", "structure + In()/true/false conditions"):
        assert ends(Chart(text)) == {"pass"}


def test_a_literal_of_another_data_model_is_false_or_an_error() -> None:
    body = (
        '<state id="a"><onentry><raise event="x"/></onentry><transition event="x" cond="{}" '
        'target="ok"/><transition event="error.*" target="no"/></state>'
    )
    assert ends(chart(body.format("true"))) == {"ok", "no"}
    assert ends(chart(body.format("false"))) == {"a", "no"}
    assert ends(chart(body.format("True"))) == {"ok"}
    assert ends(chart(body.format("False"))) == {"a"}


def test_random_charts_without_data_have_one_run() -> None:
    done = 0
    for seed in range(many(200)):
        text = EventfulChart(seed, data=False, sends=False).text
        judge = Chart(text.replace("<scxml ", '<scxml datamodel="ecmascript" ', 1))
        try:
            moments = judge.first()
            for event in ("a", "b.c", "failed"):
                assert len(moments) == 1 or judge.spins
                moments = judge.after(moments, event)
        except TooManyError:
            continue
        done += 1
    assert done
