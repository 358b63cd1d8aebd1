"""Runners without a world, and where runners come from."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.evaluate import Evaluator
from gpsfsm.capabilities.library import Library
from gpsfsm.compile import compile_plan
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.execution.records import Kind, Status
from gpsfsm.model.capability import (
    Effects,
    Interface,
    Outcomes,
    Output,
    Parameter,
    PromptBuffer,
    Provider,
    Span,
    ValueType,
)
from gpsfsm.model.event import Event, Outcome
from gpsfsm.simulation.makers import (
    Drawn,
    drawn_maker,
    scripted_maker,
    simulated_class,
    world_maker,
)
from gpsfsm.simulation.world import Settings
from tests import strategies
from tests.oracle import to_xml
from tests.simulation.support import LIBRARY, control, field_of, plan, run, runner
from tests.support import plan_of

WORLD = field_of()
STEPS = [runner("Waypoint", x=n, y=0) for n in range(300)]


def drawn(text, *, seed=1, **options):
    return run(text, WORLD, seed=seed, make=drawn_maker(LIBRARY, **options))


def outcomes(ran):
    kinds = (Kind.SUCCEEDED, Kind.FAILED)
    return {row.number: row.kind for _, row, _ in ran.rows if row.kind in kinds}


@pytest.mark.parametrize(("failure", "status"), [(0.0, "COMPLETED"), (1.0, "GAVE_UP")])
def test_outcomes_follow_the_probability(failure, status):
    assert drawn(plan(*STEPS[:20]), failure=failure).status == status


def test_about_a_tenth_fails():
    steps = [
        f"{step}<Control type='recovery'>{runner('Log', text='-')}</Control>" for step in STEPS
    ]
    ran = drawn(plan(*steps))
    assert ran.status is Status.COMPLETED
    failed = sum(kind is Kind.FAILED for kind in outcomes(ran).values())
    assert 10 < failed < 60


def test_the_seed_decides():
    text = plan(control("parallel_any", *STEPS[:10]))
    assert drawn(text, seed=3).rows == drawn(text, seed=3).rows
    assert drawn(text, seed=3).rows != drawn(text, seed=4).rows


def ends_of(*steps, seeds=range(60)):
    return [drawn(plan(*steps), seed=seed, failure=0.5).status for seed in seeds]


@pytest.mark.parametrize(
    "other",
    [
        runner("Waypoint", x="1.0", y="2.0"),
        runner("Waypoint", x="1.0", y="1"),
        runner("Waypoint", x="1.0", y="1.0", z="0.0"),
        runner("RobotPose"),
    ],
)
def test_plans_of_the_same_shape_meet_different_fates(other):
    ends, others = ends_of(runner("Waypoint", x="1.0", y="1.0")), ends_of(other)
    same = sum(one is two for one, two in zip(ends, others, strict=True))
    assert 12 < same < 48  # about half of them by chance
    assert others == ends_of(other)


def test_a_later_step_changes_the_fate_of_the_first():
    first = runner("Waypoint", x="1.0", y="1.0")
    seeds = range(60)
    ended = [
        [outcomes(drawn(plan(first, *rest), seed=seed, failure=0.5))[0] for seed in seeds]
        for rest in ((), (runner("RobotPose"),))
    ]
    assert 12 < sum(one is two for one, two in zip(*ended, strict=True)) < 48


def test_the_layout_does_not_change_the_fate():
    name = "nav2_capabilities/WaypointRunner"
    tidy = plan(*(runner("Waypoint", x=n, y="1.0") for n in range(5)))
    untidy = "".join(
        f"<!-- {n} -->\n  <Runner y='1.0'\n   x='{n}' name='step {n}' provider='{name}'"
        f" interface='{name}' />"
        for n in range(5)
    )
    for seed in range(5):
        assert (
            drawn(tidy, seed=seed).rows == drawn(f"<Plan name='p'>{untidy}</Plan>", seed=seed).rows
        )


def test_what_never_fails_does_not():
    text = plan(*[runner("PromptText", text="a", uuid="u")] * 20)
    assert drawn(text, failure=1.0).status is Status.COMPLETED
    text = plan(runner("PromptText", text="a", uuid="u", flush="true"))
    assert drawn(text, failure=1.0).status is Status.GAVE_UP


def test_declared_durations_are_kept():
    ran = drawn(plan(runner("Wait", seconds="7.5"), runner("Transcribe", audio_request_window=50)))
    assert ran.ended_s[0] == pytest.approx(7.5, abs=0.01)
    if ran.status is Status.COMPLETED:
        assert ran.ended_s[1] - ran.ended_s[0] >= 50


def test_outputs_have_the_declared_types():
    ran = drawn(plan(runner("RobotPose"), runner("GetCapabilitySpecs")), failure=0.0)
    assert {type(value) for value in ran.outputs[0].values()} == {float}
    assert len(ran.outputs[0]) == 7
    specs = ran.outputs[1]["CapabilitySpecs"]
    assert specs
    assert all(isinstance(text, str) for text in specs)


def test_only_a_flush_has_an_answer():
    text = plan(
        runner("PromptSpeech", task="a", uuid="u"),
        runner("PromptSpeech", task="a", uuid="u", flush="true"),
    )
    ran = drawn(text, failure=0.0)
    assert ran.outputs[0] == {"text": ""}
    assert ran.outputs[1]["text"].startswith("sample text")


def test_undescribed_runners_are_drawn_too():
    text = plan('<Runner interface="a/B" provider="a/C" x="1"/>')
    ran = drawn(text, failure=0.0)
    assert ran.status is Status.COMPLETED
    assert 1 <= ran.seconds <= 10


def library_of(**about):
    provider = Provider("p/R", "p/R", described=True, **about)
    return Library((Interface("p/R"),), (provider,))


def drawn_from(library, *, seed, failure=0.5):
    text = plan('<Runner interface="p/R" provider="p/R"/>')
    return run(text, WORLD, seed=seed, make=drawn_maker(library, failure=failure))


@pytest.mark.parametrize("seed", range(5))
def test_never_succeeds_and_may_hang(seed):
    never = library_of(outcomes=Outcomes(never_succeeds=True))
    assert drawn_from(never, seed=seed, failure=0.0).status is Status.GAVE_UP


def test_some_of_those_that_may_hang_do():
    library = library_of(outcomes=Outcomes(may_hang=True))
    ends = [drawn_from(library, seed=seed, failure=0.0).status for seed in range(300)]
    assert 0 < ends.count(Status.STUCK) < 50
    assert ends.count(Status.COMPLETED) == 300 - ends.count(Status.STUCK)


def test_optional_outputs_are_there_at_times():
    library = library_of(outputs=(Output("n", ValueType.INTS, optional=True),))
    actual = [drawn_from(library, seed=seed, failure=0.0).outputs[0] for seed in range(40)]
    assert {} in actual
    assert any(isinstance(outputs.get("n"), list) for outputs in actual)


def test_failure_outputs_belong_to_failures():
    declared = (Output("good"), Output("message", event=Event.FAILED))
    library = library_of(outputs=declared, duration=Span(2.0, 3.0))
    for seed in range(10):
        ran = drawn_from(library, seed=seed)
        expected = {"good"} if ran.status is Status.COMPLETED else {"message"}
        assert set(ran.outputs[0]) == expected
        assert 2.0 <= ran.seconds <= 3.01


def test_a_fill_by_default_value():
    buffer = Effects(PromptBuffer("uuid", "flush", "answer"))
    library = library_of(
        configuration=(Parameter("flush", ValueType.BOOL, default=False),),
        outputs=(Output("answer", ValueType.STRING),),
        effects=buffer,
    )
    assert drawn_from(library, seed=1, failure=0.0).outputs[0] == {"answer": ""}


def test_a_probability_is_asked_for():
    with pytest.raises(ValueError, match="probability"):
        Drawn(None, failure=1.5)


def test_a_choice_is_no_action_that_fails() -> None:
    """Whatever the failures of actions, both branches are drawn."""
    tree = "<Switch2 variable='{x}' case_1='a' case_2='b'><A/><B/><C/></Switch2>"
    text = f"<root BTCPP_format='4'><BehaviorTree ID='M'>{tree}</BehaviorTree></root>"
    whole = read_plan(text).plan
    assert whole is not None
    make = drawn_maker(LIBRARY, failure=0.0)
    ran = [run(whole, WORLD, seed=seed, make=make) for seed in range(30)]
    ended = {whole.runners[number].interface for each in ran for number in outcomes(each)}
    assert ended >= {"A", "B", "C"}


# -- scenarios ------------------------------------------------------------------------------


def test_a_scenario_is_followed():
    text = plan(STEPS[0], control("recovery", STEPS[1]), STEPS[2])
    script = {"/Plan/Runner[1]": Outcome.FAILED, "/Plan/Runner[2]": Outcome.HANG}
    ran = run(text, WORLD, make=scripted_maker(script, LIBRARY))
    assert ran.status is Status.STUCK
    assert outcomes(ran) == {0: Kind.FAILED, 1: Kind.SUCCEEDED}
    others = scripted_maker({}, LIBRARY, otherwise=Outcome.FAILED)
    assert outcomes(run(text, WORLD, make=others)) == {0: Kind.FAILED, 1: Kind.FAILED}


@given(strategies.plans(), st.data())
def test_every_scenario_ends_as_the_evaluator_says(whole, data):
    text = to_xml(whole)
    parsed = plan_of(text)
    compiled = compile_plan(parsed)
    kinds = st.sampled_from([Outcome.SUCCEEDED, Outcome.FAILED, Outcome.HANG])
    chosen = [data.draw(kinds) for _ in parsed.runners]
    names = [compiled.automaton.name(compiled.automaton.runner_node(n)) for n in range(len(chosen))]
    script = dict(zip(names, chosen, strict=True))
    expected = Evaluator(compiled.automaton).run(lambda number: chosen[number])
    ran = run(text, WORLD, make=scripted_maker(script, LIBRARY))
    assert ran.status.value == expected.ends.value


# -- where runners come from ----------------------------------------------------------------


def test_every_built_in_runner_has_a_simulated_form():
    for provider in LIBRARY.providers:
        chosen = simulated_class(provider)
        assert chosen is not None, provider.name
        assert chosen.__name__ == provider.name.rpartition("/")[2]


@pytest.mark.parametrize(
    "dotted",
    [
        "os:system",
        "gpsfsm.runners.os:system",
        "gpsfsm.simulation.makers:Drawn",
        "gpsfsm.runnersx:Drawn",
        "gpsfsm.runners.navigation:",
        "gpsfsm.runners.:X",
        "gpsfsm.runners...os:X",
        "",
    ],
)
def test_a_file_cannot_name_other_code(dotted):
    assert simulated_class(replace(LIBRARY.providers[0], runner=dotted)) is None


def test_unknown_runners_are_drawn_in_a_world():
    make = world_maker(field_of(settings={"B": Settings(fails=1.0)}), LIBRARY)
    assert isinstance(make("a/B", "a/C"), Drawn)
    ran = run(plan('<Runner interface="a/B" provider="a/C"/>'), WORLD, make=make)
    assert ran.status is Status.GAVE_UP
