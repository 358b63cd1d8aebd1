"""What is said of a statechart is what an interpreter of appendix D of the recommendation does."""

from __future__ import annotations

import random
import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.analysis.machines.decide import Judge
from gpsfsm.analysis.machines.search import Exploration
from gpsfsm.analysis.options import InconclusiveError
from gpsfsm.compile.formats.elements import Elements
from gpsfsm.compile.formats.scxml import _Reader, read
from gpsfsm.compile.formats.scxml_chart import Chart as ReadChart
from gpsfsm.compile.formats.scxml_writing import NAMESPACE, OWN_NAMESPACE
from gpsfsm.model.capability import OWN, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.report import Frequency
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import batches, many
from tests.compile.formats.random_statecharts import EventfulChart, OddChart, ReturningChart, odder
from tests.compile.formats.statecharts import Chart, TooManyError, Verdict

if TYPE_CHECKING:
    from gpsfsm.compile.units import MachinePlan
    from gpsfsm.model.plan import Element

MOST = 3_000
CHARTS = Path(__file__).parent / "charts"


def disagreements(text: str) -> list[str] | str:
    """Where the machine of a chart says what the judge denies; or why nothing was compared."""
    machine, problems = read(text, "chart.scxml", DEFAULT_LIMITS)
    if machine is None:
        return f"refused: {problems[0].message.partition(' ')[0]}"
    both = frozenset((Event.SUCCEEDED, Event.FAILED))
    allowed = [
        both - ({Event.FAILED} if each.interface == TICK else set()) for each in machine.runners
    ]
    try:
        exploration = Exploration(machine.automaton, allowed, limit=MOST)
        judge = Judge(exploration, machine.inexact)
        answers = judge.facts()
        verdict = Chart(text).verdict()
    except (InconclusiveError, TooManyError) as error:
        return type(error).__name__
    may = {claim[1:] or claim[:1] for claim in answers.may}
    rows = {
        "completes": (answers.completes, verdict.completes, (1,)),
        "gives up": (answers.gives_up, verdict.gives_up, (2,)),
        "stuck": (answers.stuck, verdict.stuck, (0,)),
        "endless": (answers.endless, verdict.endless, ("endless",)),
    }
    wrong = []
    for name, (frequency, can, claim) in rows.items():
        if frequency is Frequency.NEVER and can:
            wrong.append(f"never {name}")
        shown = can or (name == "endless" and (verdict.waits or verdict.faulty))
        if frequency is not Frequency.NEVER and claim not in may and not shown:
            wrong.append(f"{name}, proved")
        if frequency is Frequency.ALWAYS and any(
            other for word, (_, other, _) in rows.items() if word != name
        ):
            wrong.append(f"always {name}")
    part = judge.part if machine.inexact else exploration
    return wrong + moments(text, machine, exploration, part, verdict)


def name_of(runner: Element) -> str:
    """The name of a runner's node."""
    return next(each.text for each in runner.attributes if each.name == "name")


def moments(
    text: str,
    machine: MachinePlan,
    whole: Exploration,
    part: Exploration | None,
    verdict: Verdict,
) -> list[str]:
    """The stable configurations of the two: none is missing, and the exact ones are real."""
    elements = Elements(text, DEFAULT_LIMITS, NAMESPACE, OWN_NAMESPACE)
    reader = _Reader(ReadChart(elements))
    watching = {name for rows in reader.watchers.values() for name in rows}
    passive = {
        each.interface
        for number, each in enumerate(machine.runners)
        if not any(
            source == machine.automaton.runner_node(number)
            for source, *_ in machine.automaton.edges
        )
    }

    def seen(exploration: Exploration) -> set[frozenset[str]]:
        rows = set()
        for at in exploration.configurations[: exploration.reached]:
            active = [
                each for number, each in enumerate(machine.runners) if at.active >> number & 1
            ]
            pending = any(
                each.interface in OWN and name_of(each) not in watching for each in active
            )
            if not pending and not at.ended:
                rows.add(frozenset(each.interface for each in active if each.interface not in OWN))
        return rows

    def without(rows: set[frozenset[str]]) -> set[frozenset[str]]:
        return {each - passive for each in rows}

    wrong = [f"missing: {sorted(each)}" for each in without(verdict.acting) - without(seen(whole))]
    if part is not None:
        wrong += [
            f"unreal: {sorted(each)}"
            for each in without(seen(part)) - without(verdict.acting | verdict.passing)
        ]
    return wrong


@pytest.mark.parametrize("seed", [1262, 2138, 100_700, 102_229, 102_764])
def test_no_word_is_false_that_once_was(seed: int) -> None:
    """What may fail ends its block, and what it would have raised does not come."""
    assert disagreements(EventfulChart(seed).text) == []


WAITS = '<transition event="a" target="failed"/><transition event="done.state.s" target="ok"/>'


@pytest.mark.parametrize(
    "body",
    [
        '<send event="a" targetexpr="t"/>',
        '<send event="a" targetexpr="\'#_internal\'"/>',
        '<send eventexpr="\'a\'" targetexpr="t"/>',
        '<send event="a" target="#_internal" typeexpr="t"/>',
    ],
)
def test_an_expression_may_say_that_an_event_is_internal(body: str) -> None:
    """Then it comes before the end of the state, which is raised later."""
    state = f'<state id="s"><onentry>{body}</onentry>{WAITS}<final id="e"/></state>'
    text = f"{HEAD}{state}{ENDS}"
    assert disagreements(text) == []
    assert Chart(text).verdict().gives_up


@pytest.mark.parametrize("model", ["", ' datamodel="python"', ' datamodel="ecmascript"'])
@pytest.mark.parametrize("cond", ["true", "True", "false", "False"])
@pytest.mark.parametrize("waits", ["error.*", "*", "b"])
def test_a_literal_of_another_data_model_is_false_and_may_fail(
    model: str, cond: str, waits: str
) -> None:
    text = (
        f'{HEAD[:-1]}{model}><state id="s"><onentry><raise event="a"/></onentry>'
        f'<transition event="a" cond="{cond}" target="ok"/>'
        f'<transition event="done.state.p" target="ok"/><transition event="{waits}" '
        f'target="failed"/></state>{ENDS}'
    )
    assert disagreements(text) == []
    own = {"true": "ecmascript", "True": "python"}.get(cond, "")
    (report,) = gpsfsm.check(text).plans
    assert report.facts is not None
    assert (report.facts.gives_up == "never") is (bool(own) and own in model)


@pytest.mark.parametrize("batch", batches(8))
def test_no_word_about_a_chart_that_raises_events_is_false(batch: int) -> None:
    compared = 0
    for seed in range(25 * batch, 25 * batch + 25):
        text = EventfulChart(seed).text
        wrong = disagreements(odder(text, seed) if seed % 2 else text)
        compared += not isinstance(wrong, str)
        assert isinstance(wrong, str) or not wrong, f"seed {seed}: {wrong}"
    assert compared > 10


@pytest.mark.parametrize("batch", batches(4))
def test_no_word_about_a_chart_that_leads_back_is_false(batch: int) -> None:
    for seed in range(15 * batch, 15 * batch + 15):
        wrong = disagreements(ReturningChart(seed).text)
        assert isinstance(wrong, str) or not wrong, f"seed {seed}: {wrong}"


@pytest.mark.parametrize("batch", batches(6))
def test_no_word_about_a_random_chart_is_false(batch: int) -> None:
    reasons: Counter[str] = Counter()
    for seed in range(25 * batch, 25 * batch + 25):
        wrong = disagreements(OddChart(seed, 5).text)
        if isinstance(wrong, str):
            reasons[wrong] += 1
        else:
            assert not wrong, f"seed {seed}: {wrong}"
    assert reasons.total() < 10, reasons


N, S, A = Frequency.NEVER, Frequency.SOMETIMES, Frequency.ALWAYS
REFUSED = {
    "scxml_final_with_transition": (2, "a <final> cannot contain a <transition>"),
    "scxml_events_multi": (1, "the targets 'B C' are never active together"),
}
READ = {
    # completes, gives up, stuck, endless; unreachable; facts that are not proved
    "scxml_bom": (A, N, N, N, "", ""),
    "scxml_history_target": (N, N, N, A, "", ""),
    "scxml_events_onentry": (S, S, N, S, "B", "completes gives_up endless"),
    "scxml_document_order": (A, N, N, N, "trap", ""),
    "scxml_done_cond": (S, S, N, N, "", "completes gives_up"),
    "scxml_eventless_before_done": (A, N, N, N, "", ""),
    "scxml_eventless_on_atomic": (A, N, N, N, "Bad", ""),
    "scxml_eventless_on_compound": (A, N, N, N, "", ""),
    "scxml_foreign_namespace": (A, N, N, N, "", ""),
    "scxml_nested_parallel": (S, N, S, S, "", "completes stuck endless"),
    "scxml_superstate_stop": (S, N, N, S, "", ""),
    "scxml_events_both": (S, S, N, N, "", ""),
    "scxml_events_dup": (S, S, N, N, "C", ""),
    "scxml_events_failstar": (N, A, N, N, "", ""),
    "scxml_events_prefix2": (S, S, N, N, "C", ""),
    "scxml_events_star1": (S, S, N, N, "C", ""),
    "scxml_events_targetless": (S, S, N, S, "C", ""),
    "scxml_events_trap2": (N, N, N, A, "", ""),
}


def test_every_chart_has_an_answer() -> None:
    assert sorted(path.stem for path in CHARTS.iterdir()) == sorted((*REFUSED, *READ))


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_what_is_not_read_is_refused_in_one_sentence(name: str) -> None:
    (report,) = gpsfsm.check(CHARTS / f"{name}.scxml").plans
    line, words = REFUSED[name]
    assert report.facts is None
    (finding,) = report.findings
    assert (finding.rule, finding.location.line) == ("GP117", line)
    assert finding.message.startswith(words)
    assert finding.hint


@pytest.mark.parametrize("name", sorted(READ))
def test_an_answer_is_right_or_not_proved(name: str) -> None:
    (report,) = gpsfsm.check(CHARTS / f"{name}.scxml").plans
    completes, gives_up, stuck, endless, unreachable, may = READ[name]
    facts = report.facts
    assert facts is not None
    assert facts.machine is not None
    assert (facts.completes, facts.gives_up, facts.stuck) == (completes, gives_up, stuck)
    assert facts.machine.endless == endless
    assert [each.rpartition("/")[2] for each in facts.unreachable] == unreachable.split()
    ends = ("completes", "gives_up", "stuck", "endless")
    assert [each for each in ends if each in facts.precision] == may.split()
    if "parallel" in name or "superstate" in name:
        assert not [each for each in report.findings if each.severity.value == "error"]


FOREIGN = (
    '<x:state xmlns:x="urn:x" id="{}"/>', '<x:transition xmlns:x="urn:x" target="{}"/>',
    '<y xmlns="urn:y"><state id="{}"/></y>', '<q xmlns=""><transition target="{}"/></q>',
)  # fmt: skip
UNKNOWN = ("<stat id='{}'/>", "<State/>", "<choose/>", "<initial id='{}'/>", "<scxml/>")
ATTRIBUTES = (' xmlns:z="urn:z" z:event="{}"', ' evnt="{}"', ' Cond="{}"', ' next="{}"')


def with_something(text: str, chance: random.Random) -> str:
    """The text with an element or an attribute that means nothing in SCXML."""
    tags = [*re.finditer(r"<(\w+)(?=[\s>/])[^<>]*?(/?)>", text)]
    tag = chance.choice(tags)
    name = chance.choice(("a", "s0", "stop"))
    if chance.random() < 0.5:
        at = tag.end(1)
        return text[:at] + chance.choice(ATTRIBUTES).format(name) + text[at:]
    piece = chance.choice((*FOREIGN, *UNKNOWN)).format(name)
    if tag[2]:
        return f"{text[: tag.end() - 2]}>{piece}</{tag[1]}>{text[tag.end() :]}"
    return text[: tag.end()] + piece + text[tag.end() :]


def test_nothing_is_passed_over_without_a_word() -> None:
    chance = random.Random(5)  # noqa: S311
    refused = 0
    for seed in range(many(60)):
        text = OddChart(seed, 5).text
        machine, _ = read(text, "chart", DEFAULT_LIMITS)
        for _ in range(5 if machine is not None else 0):
            changed = with_something(text, chance)
            other, problems = read(changed, "chart", DEFAULT_LIMITS)
            if other is None:
                assert problems
                refused += 1
            else:
                assert len(other.approximations) > len(machine.approximations), changed
    assert refused


HEAD = '<scxml xmlns="http://www.w3.org/2005/07/scxml" version="1.0">'
ENDS = '<final id="ok"/><final id="failed"/></scxml>'
KINDS = {
    # what an end marks, at the first instant: x never comes in time
    "events of the machine itself": (
        '<parallel id="p"><state id="a"><final id="f"/></state><state id="b"><transition'
        ' event="done.state.a" target="ok"/><transition event="x" target="failed"/>'
        '<state id="c"/></state></parallel>',
        (S, S, N, S, "completes gives_up endless"),
    ),
    "done together": (
        '<parallel id="p"><transition event="done.state.p" target="ok"/><state id="a">'
        '<final id="f"/></state><state id="b"><final id="g"/></state></parallel>',
        (A, N, N, N, ""),
    ),
    "internal again": (
        '<state id="a"><transition event="x" type="internal" target="b"/>'
        '<state id="b"><transition event="y" target="ok"/></state></state>',
        (S, N, N, S, ""),
    ),
    "if else": (
        '<state id="a"><transition event="x" cond="c" target="ok"/>'
        '<transition event="x" target="failed"/></state>',
        (S, S, N, N, "completes gives_up"),
    ),
    "consumed": (
        '<state id="a"><transition event="*"/><state id="b"/></state>',
        (N, N, N, A, ""),
    ),
    "awaits what nothing sends": (
        '<state id="a"><transition event="done.state.q" target="ok"/></state>',
        (S, N, S, S, "completes stuck endless"),
    ),
    "one event in two regions": (
        '<parallel id="p"><state id="a"><state id="a1"><transition event="x" target="a2"/></state>'
        '<final id="a2"/></state><state id="b"><state id="b1"><transition event="x" target="b2"/>'
        '</state><final id="b2"/></state><transition event="done.state.p" target="ok"/></parallel>',
        (A, N, N, N, ""),
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_kinds_that_were_misread_are_read(kind: str) -> None:
    text, (completes, gives_up, stuck, endless, may) = KINDS[kind]
    assert disagreements(HEAD + text + ENDS) == []
    facts = gpsfsm.check(HEAD + text + ENDS).plans[0].facts
    assert facts is not None
    assert facts.machine is not None
    ends = (facts.completes, facts.gives_up, facts.stuck, facts.machine.endless)
    assert ends == (completes, gives_up, stuck, endless)
    names = ("completes", "gives_up", "stuck", "endless")
    assert [each for each in names if each in facts.precision] == may.split()


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ('<state id="a"><transition/></state>', "neither event, cond nor target"),
        ('<state id="a"><transition event=" " target="ok"/></state>', "the event of this"),
        ('<state id="a"><transition type="in" target="ok"/></state>', "no type 'in'"),
        ('<state id="a" initial="ok"><state id="b"/></state>', "is not in this state"),
        ('<state id="a"><initial/><state id="b"/></state>', "exactly one transition"),
        ('<parallel id="a"><final id="b"/></parallel>', "cannot contain a <final>"),
        (
            '<parallel id="p"><state id="a"><state id="b"><transition target="c"/></state><state'
            ' id="c"><transition cond="x" target="b"/></state></state><state id="d"/></parallel>',
            "lead in a circle",
        ),
    ],
)
def test_what_no_engine_reads_so_is_refused(body: str, words: str) -> None:
    machine, problems = read(HEAD + body + ENDS, "chart.scxml", DEFAULT_LIMITS)
    assert machine is None
    assert words in problems[0].message
    assert problems[0].hint
    assert problems[0].location.line == 1


GO = '<state id="{0}"><transition event="{0}.done" target="{1}"/></state>'
LOOP = GO.format("a", "b") + GO.format("b", "a")
ONCE = GO.format("c", "e") + '<final id="e"/>'
OTHER = GO.format("d", "f") + '<final id="f"/>'
STOP = '<transition event="stop" target="ok"/>'
COND = ' cond="x" target'
SUPERSTATES = {
    "a loop": f'<state id="w">{STOP}{LOOP}</state>',
    "a dead end": f'<state id="w">{STOP}<state id="a"/></state>',
    "two levels": f'<state id="w">{STOP}<state id="i"><transition event="pause" target="p"/>{LOOP}'
    f'</state>{GO.format("p", "i")}</state>',
    "loops in regions": f'<parallel id="w">{STOP}<state id="r">{LOOP}</state><state id="q">'
    f'{GO.format("c", "d")}{GO.format("d", "c")}</state></parallel>',
    "an internal transition": f'<state id="w" initial="a">{STOP}<transition event="reset" '
    f'type="internal" target="a"/>{LOOP}</state>',
    "a transition without target": f'<state id="w">{STOP}<transition event="ping"/>{LOOP}</state>',
    "a return by history": '<state id="w"><history id="h"><transition target="a"/></history>'
    f'<transition event="halt" target="o"/>{LOOP}</state><state id="o"><transition event="on" '
    f'target="h"/><transition event="off" target="ok"/></state>',
    "before a join": f'<parallel id="w">{STOP}<transition event="done.state.w" target="ok"/>'
    f'<state id="r">{ONCE}</state><state id="q">{OTHER}</state></parallel>',
    "in one region of a join": '<parallel id="w"><transition event="done.state.w" target="ok"/>'
    f'<state id="r"><state id="s"><transition event="stop" target="f"/>{LOOP}</state>'
    f'<final id="f"/></state><state id="q">{ONCE}</state></parallel>',
    "by any event": f'<state id="w">{STOP.replace("stop", "*")}{LOOP}</state>',
    "on a condition": f'<state id="w">{STOP.replace(" target", COND)}{LOOP}</state>',
}  # fmt: skip


@pytest.mark.parametrize("kind", sorted(SUPERSTATES))
def test_what_leaves_a_superstate_may_still_come(kind: str) -> None:
    """So there is no dead end while it is active, and no choice that fails."""
    text = f"{HEAD}{SUPERSTATES[kind]}{ENDS}"
    assert disagreements(text) == []
    (report,) = gpsfsm.check(text).plans
    assert report.facts is not None
    assert report.facts.stuck == "never"
    assert not [each for each in report.findings if each.severity.value in ("error", "warning")]
    told = [each for each in report.findings if each.rule in ("GP302", "GP306", "GP311", "GP313")]
    assert not told
    stories = [each.scenario.story for each in report.findings if each.scenario]
    assert not [line for story in stories for line in story if "choice" in line and "fail" in line]
