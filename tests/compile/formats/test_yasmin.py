"""YASMIN: against an interpreter of its XML, and what is said of what the file does not say."""

from __future__ import annotations

import random
import re
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.compile.formats.outcomes import is_failure
from gpsfsm.compile.formats.yasmin import read
from gpsfsm.model.precision import Cause, Reading
from gpsfsm.model.report import Frequency, Precision
from gpsfsm.syntax.source import DEFAULT_LIMITS
from tests.cases import batches
from tests.compile.formats.against_runs import COMPLETES, GIVES_UP, Graph, compared
from tests.compile.formats.yasmin_machines import YasminMachine
from tests.compile.formats.yasmin_runs import Interpreter, TooManyError

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.report import PlanReport

CASES = Path(__file__).parent / "cases"
NEVER, SOMETIMES, ALWAYS = Frequency.NEVER, Frequency.SOMETIMES, Frequency.ALWAYS


def checked(text: str) -> PlanReport:
    (report,) = gpsfsm.check(text, rlimit=1).plans
    return report


def refused(text: str) -> list[tuple[int, str]]:
    report = checked(text)
    assert report.facts is None
    return [(each.location.line, each.message) for each in report.findings]


def machine(body: str, outcomes: str = "done failed", more: str = "") -> str:
    return f'<StateMachine outcomes="{outcomes}" {more}>{body}</StateMachine>'


def state(name: str, *transitions: str) -> str:
    """A state, with transitions like ``ok>done``."""
    rows = (each.partition(">") for each in transitions)
    inner = "".join(f'<Transition from="{a}" to="{b}"/>' for a, _, b in rows)
    return f'<State name="{name}" type="py" module="m" class="{name}">{inner}</State>'


_Y = '<Transition from="y" to="done"/><Transition from="x" to="done"/>'


# -- the cases -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["one_map", "item_for_one", "full_maps"])
def test_concurrences_whose_states_have_outcomes_that_only_items_name(name: str) -> None:
    report = checked((CASES / f"yasmin_concurrence_{name}.xml").read_text())
    facts = report.facts
    assert facts is not None
    assert (facts.completes, facts.gives_up, facts.stuck) == (SOMETIMES, SOMETIMES, NEVER)
    assert facts.unreachable == ()
    assert "GP301" not in {each.rule for each in report.findings}
    maps = name == "full_maps"  # both ends are in the file; else only default_outcome gives up
    assert facts.precision.get("gives_up") is (None if maps else Precision.MAY)
    assert {each.cause for each in report.approximations} == {Cause.UNDECLARED}


def test_an_outcome_without_a_transition_ends_the_machine_of_that_outcome() -> None:
    report = checked((CASES / "yasmin_implicit_outcome.xml").read_text())
    assert report.facts is not None
    assert report.facts.gives_up is NEVER
    assert report.facts.stuck is NEVER
    assert report.facts.precision["completes"] is Precision.MAY
    assert [each.construct for each in report.approximations] == ["A"]


def test_the_outcomes_of_an_orthogonal_state_are_those_of_its_maps() -> None:
    report = checked((CASES / "yasmin_orthogonal.xml").read_text())
    facts = report.facts
    assert facts is not None
    assert (facts.gives_up, facts.stuck, facts.unreachable) == (NEVER, NEVER, ())
    assert facts.precision["completes"] is Precision.CAN


def test_a_state_named_as_an_outcome_is_refused_with_that_reason() -> None:
    text = (CASES / "yasmin_state_named_as_outcome.xml").read_text()
    message = "the state 'succeeded' has the name of an outcome of its machine"
    assert refused(text) == [(3, message)]


# -- what the file does not say --------------------------------------------------------------------


def test_transitions_that_are_complete_leave_nothing_open() -> None:
    body = state("A", "ok>B") + state("B", "ok>B")
    declared = 'xmlns:gpsfsm="urn:gpsfsm" gpsfsm:complete="true"'
    closed, opened = (checked(machine(body, "done", more)) for more in (declared, ""))
    assert closed.approximations == ()
    assert "GP313" in {each.rule for each in closed.findings}
    assert "GP313" not in {each.rule for each in opened.findings}
    assert opened.facts is not None
    assert opened.facts.precision["completes"] is Precision.MAY


def test_two_maps_that_hold_at_once_are_an_exception() -> None:
    maps = '<OutcomeMap outcome="one"><Item state="A" outcome="x"/></OutcomeMap>' + (
        '<OutcomeMap outcome="two"><Item state="B" outcome="x"/></OutcomeMap>'
    )
    out = '<Transition from="one" to="done"/><Transition from="two" to="done"/>'
    body = f'<Concurrence name="C">{state("A")}{state("B")}{maps}{out}</Concurrence>'
    facts = checked(machine(body)).facts
    assert facts is not None
    assert facts.gives_up is SOMETIMES
    assert "gives_up" not in facts.precision or facts.precision["gives_up"] is Precision.CAN


def concurrence(name: str, states: str, more: str = "", **maps: dict[str, str]) -> str:
    """A Concurrence with outcome maps and without a default, unless there is more."""
    rows = "".join(
        f'<OutcomeMap outcome="{outcome}">'
        + "".join(f'<Item state="{a}" outcome="{b}"/>' for a, b in items.items())
        + "</OutcomeMap>"
        for outcome, items in maps.items()
    )
    return f'<Concurrence name="{name}" {more}>{states}{rows}'


@pytest.mark.parametrize(
    ("item", "completes", "gives_up"),
    [
        ({"B": "x"}, SOMETIMES, NEVER),  # nobody asks how the inner one has ended
        ({"I": "won"}, SOMETIMES, SOMETIMES),
        ({"I": "won", "B": "x"}, SOMETIMES, SOMETIMES),
    ],
)
def test_an_inner_concurrence_without_an_outcome_raises_where_a_map_asks_for_it(
    item: dict[str, str], completes: Frequency, gives_up: Frequency
) -> None:
    """It ends with the empty outcome, which the one around it takes for missing."""
    inner = concurrence("I", state("A"), won={"A": "x"}) + "</Concurrence>"
    out = '<Transition from="one" to="done"/><Transition from="done" to="done"/></Concurrence>'
    around = concurrence("O", inner + state("B"), 'default_outcome="done"', one=item) + out
    facts = checked(machine(around)).facts
    assert facts is not None
    assert facts.gives_up is gives_up
    assert facts.completes in (completes, ALWAYS)


def test_the_old_form_of_a_map_is_named_by_its_own_attribute() -> None:
    old = '<Outcome to="one" outcome="two"><Transition state="A" outcome="x"/></Outcome>'
    out = '<Transition from="one" to="done"/></Concurrence>'
    report = checked(machine(f'<Concurrence name="C">{state("A")}{old}{out}'))
    assert report.facts is not None
    assert [each.construct for each in report.approximations if each.reading is Reading.SKIPPED]


def test_the_body_of_a_machine_in_another_file_is_not_read() -> None:
    for place in ('file_path="x.xml"', 'file_name="x.xml" package="p"'):
        inner = f'<StateMachine name="A" {place}>{state("B", "ok>ok")}{{}}</StateMachine>'
        report = checked(machine(inner.format('<Transition from="end" to="done"/>')))
        assert report.facts is not None
        (over, skipped) = sorted(report.approximations, key=lambda each: each.reading)
        assert (over.reading, over.cause) == (Reading.OVER, Cause.ELSEWHERE)
        assert skipped.reading is Reading.SKIPPED


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (machine(state("A", "ok>done") + state("B", "ok>done")), "no transition leads to the st"),
        (machine(state("A", "ok>nowhere")), "leads to 'nowhere', which is no state here"),
        (machine('<JoinState name="A" sync_id="s"/>'), "<JoinState> in <StateMachine> is not read"),
        (machine("<State><Transition from='a' to='done'/></State>"), "has no attribute 'name'"),
        (machine('<Concurrence name="C" default_outcome="done"/>'), "there is no state in 'C'"),
        (machine('<State name="A"><State name="B"/></State>'), "<State> in <State> is not read"),
        (machine("", more='file_path="x.xml"'), "this machine is in another file"),
        (
            machine(
                f'<Concurrence name="C" default_outcome="done">{state("A")}'
                '<OutcomeMap outcome="failed"/></Concurrence>'
            ),
            "the outcome map of 'failed' has no <Item>",
        ),
        (
            machine(f'<StateMachine name="A" outcomes="x">{state("B", "ok>x")}{_Y}</StateMachine>'),
            "'A' never ends with 'y'",
        ),
    ],
)  # fmt: skip
def test_what_yasmin_refuses_is_refused(text: str, message: str) -> None:
    assert any(message in each for _, each in refused(text)), refused(text)


@pytest.mark.parametrize(
    ("text", "construct"),
    [
        (machine(state("A", "ok>done"), more='start_stat="A"'), "start_stat"),
        (machine(state("A", "ok>done", "ok>failed")), "<Transition> from 'ok' before this one"),
        (machine(state("A", "ok>done") + '<FinalOutcome name="x"/>'), "<FinalOutcome> 'x'"),
        (machine(state("A", "ok>done") + '<Transition from="a" to="b"/>'), "<Transition> of what"),
    ],
)
def test_what_has_no_effect_in_yasmin_is_reported(text: str, construct: str) -> None:
    report = checked(text)
    assert report.facts is not None
    told = [each.construct for each in report.approximations if each.reading is Reading.SKIPPED]
    assert len(told) == 1
    assert construct in told[0]
    assert "GP119" in {each.rule for each in report.findings}


# -- against the interpreter -----------------------------------------------------------------------


def graph(text: str, *, undeclared: bool) -> Graph:
    """The runs of a file by the interpreter."""
    runs = Interpreter(text, undeclared=undeclared)
    steps = {
        at: {(who, _end(what) if isinstance(what, str) else what) for (who, _), what in row}
        for at, row in runs.steps.items()
    }
    return Graph(frozenset([runs.first]), steps, frozenset(runs.entered), runs.endless)


def _end(outcome: str) -> str:
    return GIVES_UP if outcome == "an exception" or is_failure(outcome) else COMPLETES


def judged(text: str) -> Iterator[str]:
    """What the check says of a file holds for the runs of the interpreter; labels for a campaign.

    What is proved holds whatever outcomes the classes declare.
    """
    machine, problems = read(text, "random.xml", DEFAULT_LIMITS)
    if machine is None:
        yield "refused: " + re.sub("'[^']*'", "…", problems[0].message)
        return
    try:
        every, certain = (graph(text, undeclared=each) for each in (True, False))
    except TooManyError:
        yield "too many configurations"
        return
    yield from compared(machine, every, certain, random.Random(1))  # noqa: S311


@pytest.mark.parametrize("batch", batches(4))
def test_random_machines_do_what_yasmin_does(batch: int) -> None:
    labels: Counter[str] = Counter()
    for seed in range(40 * batch, 40 * batch + 40):
        text = YasminMachine(seed).text
        try:
            labels.update(judged(text))
        except AssertionError as error:
            raise AssertionError(f"seed {seed}: {error}\n{text}") from error
    assert labels["compared"] >= 15
