"""Plays: what is shown of a scenario is what it says."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import check_options
from gpsfsm.checking import check_text
from gpsfsm.compile import compile_plan
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Status
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.story import Statement
from gpsfsm.syntax import parse
from gpsfsm.viewing import plays
from gpsfsm.viewing.document import document
from gpsfsm.viewing.plans import Viewed
from gpsfsm.viewing.plays import Wanted, play
from tests.conftest import REPO
from tests.fixing.support import go, say
from tests.oracle import par_any, to_xml
from tests.oracle import plan as plan_of
from tests.strategies import faults, plans
from tests.viewing.support import holds, kinds, only

if TYPE_CHECKING:
    from collections.abc import Collection

    from gpsfsm.compile import Compiled
    from gpsfsm.model.finding import Finding, Scenario
    from gpsfsm.model.report import PlanReport
    from tests.oracle import P


@given(plans(max_runners=8), faults(), st.booleans())
def test_a_play_is_the_run_that_the_finding_tells_of(
    whole: P, wanted: Collection[str], consistent: bool
) -> None:
    options = check_options(AnalysisOptions(faults=tuple(sorted(wanted)), consistent=consistent))
    text = to_xml(whole)
    report = check_text(text, "plan.xml", options)
    shown = document([Viewed(text, report)], options)
    holds(shown)
    (plan,) = shown["plans"]
    findings = worst_first(report)
    assert plan["plays_left_out"] == 0
    for finding, row in zip(findings, plan["findings"], strict=True):
        if row["play"] >= 0:
            _as_described(finding, plan, plan["plays"][row["play"]])
        elif finding.scenario is not None:
            on_paper = parse(text).plan
            assert on_paper is not None
            _comes_too_late(compile_plan(on_paper), finding.scenario)


@given(plans(max_runners=8), st.data())
def test_a_play_is_the_run_of_the_whole_kernel(whole: P, data: st.DataObject) -> None:
    """The kernel of plays leaves values and unloading out; the rest is that of a real run."""
    compiled = _compiled(to_xml(whole))
    number = len(compiled.automaton.runners)
    numbers = st.integers(0, max(number - 1, 0))
    outcomes = data.draw(st.dictionaries(numbers, st.sampled_from(Outcome)))
    played = play(compiled, Wanted(outcomes))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(plays, "_Course", Kernel)
        assert play(compiled, Wanted(outcomes)) == played


def test_no_play_works_out_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    """No page shows them, and they took most of the time of a play of 1,000 runners."""
    text = (REPO / "corpus" / "plans" / "tour_guide.xml").read_text(encoding="utf-8")
    monkeypatch.setattr("gpsfsm.execution.kernel.parameters", lambda *_: 1 / 0)
    assert play(_compiled(text), Wanted({})).status is Status.COMPLETED


def _compiled(text: str) -> Compiled:
    plan = parse(text).plan
    assert plan is not None
    return compile_plan(plan)


def _comes_too_late(compiled: Compiled, scenario: Scenario) -> None:
    """What the finding tells of would come at or after the instant at which the plan completes."""
    plan = compiled.automaton.plan
    numbers = {plan.path(each): number for number, each in enumerate(plan.runners)}
    outcomes = {numbers[path]: outcome for path, outcome in scenario.outcomes}
    trace = [(step.event, numbers[step.element]) for step in scenario.trace]
    played = play(compiled, Wanted(outcomes, trace))
    assert played.status is Status.COMPLETED
    assert scenario.ends is End.COMPLETED
    missing = {number for event, number in trace if (event, number) not in played.places}
    ended = {number for event, number in played.places if event in (Event.SUCCEEDED, Event.FAILED)}
    assert missing
    assert missing.isdisjoint(ended)


def _as_described(finding: Finding, plan: dict[str, Any], played: dict[str, Any]) -> None:
    """Every outcome of the scenario that comes is the one it says, and its events come in order."""
    scenario = finding.scenario
    assert scenario is not None
    assert played["ends"] == scenario.ends.value
    assert tuple(played["story"]) == scenario.story
    paths = {element["path"]: number for number, element in enumerate(plan["elements"])}
    nodes = {
        node["element"]: number
        for number, node in enumerate(plan["automaton"]["nodes"])
        if node["kind"] == "runner"
    }
    happened = kinds(played)
    for path, outcome in scenario.outcomes:
        node = nodes[paths[path]]
        came = {kind for kind, at in happened if at == node and kind in ("SUCCEEDED", "FAILED")}
        expected = {Outcome.SUCCEEDED: {"SUCCEEDED"}, Outcome.HANG: set()}
        assert came <= expected.get(outcome, {"FAILED"})
        if outcome is Outcome.NO_START:
            assert ("STARTED", node) not in happened
    places = [
        happened.index((step.event.value, nodes[paths[step.element]]))
        for step in scenario.trace
        if step.event is not Event.STARTED
    ]
    if not finding.rule.startswith("GP5"):  # there two are active at once, and then things go on
        assert places == sorted(places)
    _marked_as_traced(finding, played, {path: nodes[paths[path]] for path, _ in _traced(scenario)})


def _traced(scenario: Scenario) -> list[tuple[str, Event]]:
    """The events of the evaluator's trace that its story speaks of.

    Of a runner that ends, its start is not told.
    """
    ended = {step.element for step in scenario.trace if step.event is not Event.STARTED}
    return [
        (step.element, step.event)
        for step in scenario.trace
        if step.event is not Event.STARTED or step.element not in ended
    ]


def _marked_as_traced(finding: Finding, played: dict[str, Any], nodes: dict[str, int]) -> None:
    """Each sentence is marked where the records have its events of the trace."""
    scenario = finding.scenario
    assert scenario is not None
    happened = kinds(played)
    ahead = iter(_traced(scenario))
    spans = zip(scenario.sentences, played["story_from"], played["story_at"], strict=True)
    for sentence, first, last in spans:
        if sentence.statement is Statement.STEPS_LEFT_OUT:
            return  # a row may be left out: how many events that are is not said
        if sentence.statement.event is not None:
            row = [next(ahead) for _ in range(len(sentence.actors) + sentence.count)]
            assert {row[0][0], row[-1][0]} == {actor.element for actor in sentence.actors}
            marks = [happened.index((event.value, nodes[path])) for path, event in row]
            assert (first, last) == (min(marks), max(marks))
        elif sentence.statement is Statement.CANNOT_SUCCEED:
            assert happened[last][0] in ("JOINED", "FAILED", "SUCCEEDED")
        elif not sentence.statement.at_once:
            assert happened[last][0] in ("ENDED", "SILENCE")


SPEECH_NEVER_FAILS = check_options(AnalysisOptions(assumptions=("never fails: SpeechRunner",)))


def _finding(plan: dict[str, Any], code: str) -> dict[str, Any]:
    return next(each for each in plan["findings"] if each["rule"] == code)


def test_the_records_of_a_failure_that_nothing_handles() -> None:
    plan = only(f"<Plan>{say('a')}{go(1, 2)}</Plan>", SPEECH_NEVER_FAILS)
    second = _finding(plan, "GP302")
    assert kinds(plan["plays"][second["play"]]) == [
        *(("TRIGGERED", 1), ("STARTED", 1), ("SUCCEEDED", 1)),
        *(("TRIGGERED", 2), ("STARTED", 2), ("FAILED", 2), ("JOINED", 3), ("ENDED", -1)),
    ]
    assert plan["plays"][second["play"]]["story_at"] == [2, 5, 7]
    assert plan["plays"][second["play"]]["story_from"] == [2, 5, 7]


def test_a_join_that_can_no_longer_succeed_is_marked_behind_the_failure() -> None:
    plan = only(f"<Plan><Control type='parallel_all'>{say('a')}{go(1, 2)}</Control></Plan>")
    played = plan["plays"][_finding(plan, "GP303")["play"]]
    said = [kinds(played)[place] for place in played["story_at"]]
    assert [kind for kind, _ in said] == ["FAILED", "JOINED", "ENDED"]
    join = plan["automaton"]["nodes"][said[1][1]]
    assert plan["elements"][join["element"]]["type"] == "parallel_all"


def test_of_two_joins_that_fail_the_one_is_marked_that_the_sentence_names() -> None:
    inner = f"<Control type='parallel_all'>{go(1, 2)}{go(3, 4)}</Control>"
    rescue = f"<Control type='recovery'>{go(5, 6)}</Control>"
    text = f"<Plan><Control type='parallel_any'>{inner}{go(7, 8)}</Control>{rescue}</Plan>"
    plan = only(text)
    joined = next(each for each in plan["findings"] if each["rule"] == "GP303")
    played = plan["plays"][joined["play"]]
    line = next(n for n, text in enumerate(played["story"]) if "can no longer" in text)
    kind, node = kinds(played)[played["story_at"][line]]
    assert kind == "JOINED"
    assert plan["automaton"]["nodes"][node]["element"] == joined["element"]


def test_what_two_hold_at_once_is_marked_when_the_second_starts() -> None:
    text = (REPO / "corpus" / "rules" / "GP501" / "fail-two-voices.xml").read_text("utf-8")
    plan = only(text)
    played = plan["plays"][_finding(plan, "GP501")["play"]]
    said = [kinds(played)[place] for place in played["story_at"]]
    speakers = [("STARTED", 2), ("STARTED", 4)]
    assert said[-3:] == [*speakers, speakers[-1]]


def test_sentences_that_tell_of_many_stand_at_the_last_of_them() -> None:
    plan = only(f"<Plan>{say('a') * 6}{go(1, 2)}</Plan>", SPEECH_NEVER_FAILS)
    played = plan["plays"][_finding(plan, "GP302")["play"]]
    assert played["story"][0].count("and so do 4 more") == 1
    begins = [kinds(played)[place] for place in played["story_from"]]
    assert begins == [("SUCCEEDED", 1), ("FAILED", 7), ("ENDED", -1)]
    said = [kinds(played)[place] for place in played["story_at"]]
    assert said == [("SUCCEEDED", 6), ("FAILED", 7), ("ENDED", -1)]


def test_a_text_that_reads_like_a_sentence_moves_no_mark() -> None:
    steps = "".join(say(text) for text in ("a", "one more and two", "c", "b succeeds"))
    text = f"<Plan>{steps[: steps.rindex('<Runner')]}{go(1, 2)}</Plan>"
    plan = only(text, SPEECH_NEVER_FAILS)
    played = plan["plays"][_finding(plan, "GP302")["play"]]
    assert "one more and two" in played["story"][1]
    said = [kinds(played)[place] for place in played["story_at"]]
    assert said == [*(("SUCCEEDED", number) for number in (1, 2, 3)), ("FAILED", 4), ("ENDED", -1)]


def test_a_runner_that_does_not_start_and_one_that_hangs() -> None:
    text = f"<Plan><Control type='parallel_all'>{say('a')}{go(1, 2)}</Control></Plan>"
    options = check_options(AnalysisOptions(faults=("no-start", "hang")))
    plan = only(text, options)
    stuck = [play for play in plan["plays"] if play["ends"] == "STUCK"]
    assert stuck
    assert any(kind == "SILENCE" for play in stuck for kind, _ in kinds(play))
    compiled = compile_plan(parse(text).plan, start_chain=True)  # type: ignore[arg-type]
    run = play(compiled, Wanted({0: Outcome.SUCCEEDED, 1: Outcome.NO_START}))
    events = [(record["kind"], record["node"]) for record in run.records]
    assert ("NOT_LOADED", 2) in events
    assert ("STARTED", 2) not in events
    assert run.status.value == "GAVE_UP"


def test_what_is_active_at_the_end_is_stopped() -> None:
    text = f"<Plan><Control type='parallel_any'>{say('a')}{go(1, 2)}</Control></Plan>"
    compiled = compile_plan(parse(text).plan)  # type: ignore[arg-type]
    run = play(compiled, Wanted({1: Outcome.SUCCEEDED}, [(Event.SUCCEEDED, 1)]))
    events = [(record["kind"], record["node"]) for record in run.records]
    assert events[-3:] == [("STOPPING", 1), ("STOPPED", 1), ("ENDED", -1)]
    assert run.status.value == "COMPLETED"


def test_the_order_of_a_scenario_is_kept() -> None:
    text = f"<Plan><Control type='parallel_all'>{say('a') * 3}</Control></Plan>"
    compiled = compile_plan(parse(text).plan)  # type: ignore[arg-type]
    for order in ([2, 0, 1], [1, 2, 0]):
        wanted = Wanted({}, [(Event.SUCCEEDED, number) for number in order])
        run = play(compiled, wanted)
        came = [each["node"] - 1 for each in run.records if each["kind"] == "SUCCEEDED"]
        assert came == order


def test_plays_for_which_there_is_no_room_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(plays.Budget.__init__, "__defaults__", (10, 1_000_000))
    either = f"<Control type='parallel_any'>{say('a')}{go(1, 2)}</Control>"
    plan = only(f"<Plan>{either * 3}</Plan>")
    with_story = [each for each in plan["findings"] if each["ends"]]
    assert 0 < len(plan["plays"]) < len(with_story)
    assert plan["plays_left_out"] == len(with_story) - len(plan["plays"])
    without = [each for each in with_story if each["play"] < 0]
    assert all(each["story"] for each in without)


GO = "demo_capabilities/GoRunner x=1"


@given(plans(max_runners=6), st.sampled_from(["fabric-v1", "fabric-v2"]))
@example(plan_of(GO, GO, GO, GO, GO, par_any(GO)), "fabric-v1")
def test_what_an_engine_does_otherwise_is_played_on_the_engine(whole: P, engine: str) -> None:
    options = check_options(engine=engine)
    text = to_xml(whole)
    report = check_text(text, "plan.xml", options)
    shown = document([Viewed(text, report)], options)
    holds(shown)
    (plan,) = shown["plans"]
    findings = worst_first(report)
    for finding, row in zip(findings, plan["findings"], strict=True):
        if finding.scenario is None or not finding.rule.startswith("GP7"):
            continue
        if row["play"] >= 0:
            assert plan["plays"][row["play"]]["ends"] == finding.scenario.ends.value
        else:  # a join that dies of a second success may have completed the plan with its first
            assert finding.rule == "GP704", (text, finding)
            reading = read_for_engine(text, engine, "plan.xml", options.described.library)
            assert isinstance(reading, EngineReading)
            _comes_too_late(reading.compiled, finding.scenario)


def worst_first(report: PlanReport) -> list[Finding]:
    """The findings as the page lists them: by severity, then as reported, suppressed ones last."""
    ranked = [
        each
        for severity in ("error", "warning", "info")
        for each in report.findings
        if each.severity.value == severity
    ]
    return [*ranked, *report.suppressed]


def test_a_failure_that_comes_after_completion_is_told_and_not_played() -> None:
    one = '<Runner interface="demo/Go" provider="demo/Go"/>'
    empty = '<Control type="sequential"/>'
    both = f'<Control type="parallel_all">{one}{one}</Control>'
    text = f'<Plan>{one}<Control type="parallel_any">{both}{empty}</Control></Plan>'
    options = check_options(AnalysisOptions())
    report = check_text(text, "plan.xml", options)
    shown = document([Viewed(text, report)], options)
    late = [
        row
        for finding, row in zip(worst_first(report), shown["plans"][0]["findings"], strict=True)
        if finding.scenario is not None and row["play"] < 0
    ]
    assert [row["rule"] for row in late] == ["GP303"]
    assert late[0]["story"]
