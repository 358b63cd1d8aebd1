"""YASMIN: against an interpreter of its XML, and what is said of what the file does not say."""

from __future__ import annotations

import random
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.compile.formats.outcomes import is_failure
from gpsfsm.model.precision import Cause, Reading
from gpsfsm.model.report import Frequency, Precision
from tests.cases import batches
from tests.compile.formats.yasmin_runs import Interpreter

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.compile.formats.yasmin_runs import Runs

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


def random_machine(chance: random.Random, names: Iterator[int], tag: str, depth: int = 0) -> str:
    """A StateMachine, Region, Concurrence or OrthogonalState without the transitions behind it."""
    name = f'name="M{next(names)}"'
    inside = ["Region"] if tag == "OrthogonalState" else ["State", "State", "State"]
    if depth < 2 and tag != "OrthogonalState":
        inside += ["StateMachine", "Concurrence", "OrthogonalState"]
    kinds = [chance.choice(inside) for _ in range(chance.randint(1, 3 - (depth > 1)))]
    parallel = tag in ("Concurrence", "OrthogonalState")
    parts: list[tuple[str, str, list[str]]] = []  # name, element without its end, outcomes
    for kind in kinds:
        if kind == "State":
            number = next(names)
            ends = chance.choice((["ok"], ["ok", "failed"], ["ok", "no", "failed"], []))
            parts.append((f"S{number}", state(f"S{number}")[: -len("</State>")], ends))
        else:
            text = random_machine(chance, names, kind, depth + 1)
            own = text.partition('name="')[2].partition('"')[0]
            outcomes = ["won", "failed"]
            parts.append((own, text[: text.rindex("</")], outcomes))
    if parallel:
        maps = ""
        for outcome in chance.choice((["won"], ["won", "failed"])):
            items = [(each, chance.choice(ends)) for each, _, ends in parts if ends]
            chosen = [item for item in items if chance.random() < 0.7] or items[:1]
            rows = "".join(f'<Item state="{a}" outcome="{b}"/>' for a, b in chosen)
            maps += f'<OutcomeMap outcome="{outcome}">{rows}</OutcomeMap>' if rows else ""
        default = chance.choice(('default_outcome="won"', 'default_outcome="failed"', ""))
        body = "".join(f"{text}</{text[1:].split()[0]}>" for _, text, _ in parts)
        return f"<{tag} {name} {default}>{body}{maps}</{tag}>"
    targets = ["won", "failed", *(each for each, _, _ in parts)]
    body = ""
    for number, (_, text, ends) in enumerate(parts):
        rows = [(end, chance.choice(targets)) for end in ends]
        if number + 1 < len(parts) and rows:
            rows[0] = (rows[0][0], parts[number + 1][0])  # all are reached
        if text.startswith(("<Conc", "<Orth")):  # outcomes that there are
            there = [end for end in ("won", "failed") if f'ome="{end}"' in text.partition("<S")[0]]
            there += [end for end in ("won", "failed") if f'Map outcome="{end}"' in text]
            rows = [row for row in rows if row[0] in there]
        kept = [row for row in rows if chance.random() < 0.9 or row[1] not in ("won", "failed")]
        inner = "".join(f'<Transition from="{a}" to="{b}"/>' for a, b in kept)
        body += f"{text}{inner}</{text[1:].split()[0]}>"
    return f'<{tag} {name} outcomes="won failed">{body}</{tag}>'


def agrees(report: PlanReport, declared: Runs, all_runs: Runs) -> None:
    """What is proved holds for the runs of the file, whatever the classes declare."""
    facts = report.facts
    assert facts is not None
    assert facts.machine is not None
    leaves = {each.removeprefix("/machine/") for each in facts.unreachable}
    assert not leaves & all_runs.entered

    def gives_up(outcome: str) -> bool:
        return outcome == "an exception" or is_failure(outcome)

    for runs, proved in ((all_runs, False), (declared, True)):
        ends = {gives_up(each) for each in runs.ends}
        endless = runs.endless or not ends  # a run that never ends goes on
        for name, frequency, possible, others in (
            ("completes", facts.completes, False in ends, endless or True in ends),
            ("gives_up", facts.gives_up, True in ends, endless or False in ends),
            ("endless", facts.machine.endless, endless, bool(ends)),
        ):
            if not proved:
                assert not (possible and frequency is NEVER), name
                assert not (others and frequency is ALWAYS), name
            elif facts.precision.get(name, Precision.CAN) is Precision.CAN:
                # an exact run shows it; without a word, one shows the contrary, too
                assert possible or frequency is NEVER, name
    assert facts.stuck is NEVER


@pytest.mark.parametrize("batch", batches(4))
def test_random_machines_do_what_yasmin_does(batch: int) -> None:
    read = 0
    for seed in range(15 * batch, 15 * batch + 15):
        chance = random.Random(seed)  # noqa: S311
        text = random_machine(chance, iter(range(1, 1_000)), "StateMachine")
        report = checked(text)
        if report.facts is None:  # too many configurations, or what YASMIN refuses
            continue
        read += 1
        runs = [Interpreter(text, undeclared=each).runs() for each in (False, True)]
        try:
            agrees(report, *runs)
        except AssertionError as error:
            raise AssertionError(f"seed {seed}: {error}\n{text}") from error
    assert read >= 5
