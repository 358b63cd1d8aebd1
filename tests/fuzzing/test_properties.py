"""Properties: the built-in ones, those of tasks, and where a user's come from."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given, settings

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.compile import compile_plan
from gpsfsm.errors import UsageError
from gpsfsm.fuzzing import Fate, Property, play, run_campaign, subject_of
from gpsfsm.fuzzing.own_properties import property_of, property_of_task
from gpsfsm.fuzzing.properties import (
    default_properties,
    find_property,
    guarded,
    property_names,
)
from gpsfsm.tasks.deciding import decide_task
from gpsfsm.tasks.load import read_task
from tests.fuzzing.support import FREE, acts, control, go, messages, strange, subject
from tests.oracle import to_xml
from tests.strategies import plans

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.tasks.task import Task

ROUNDS = b"""
task: Go to a, and to c if that fails, then to b. Say something at the end only.
actions:
  first: {interface: A}
  other: {interface: C}
  second: {interface: B}
  say: {interface: Say}
steps:
  - do: first
    else: other
  - do: second
allow: say
rules:
  - precedence: [second, say]
"""


def rounds() -> Task:
    return read_task(ROUNDS)


def test_the_properties_are_those_of_the_folder() -> None:
    assert property_names() == ("completes", "ends", "no-orphan", "no-overlap", "replays")
    assert [each.name for each in default_properties()] == [
        "ends",
        "no-orphan",
        "no-overlap",
        "replays",
    ]
    assert {find_property(name).name for name in property_names()} == set(property_names())


def test_an_unknown_property_is_refused_with_those_there_are() -> None:
    with pytest.raises(UsageError, match="there is no property 'order'; the properties are: comp"):
        find_property("order")


def test_other_packages_add_properties(monkeypatch: pytest.MonkeyPatch) -> None:
    theirs = Property("order", "it is in order", lambda run: [])
    entry = EntryPoint("order", "theirs:ORDER", "gpsfsm.properties")
    monkeypatch.setattr(EntryPoint, "load", lambda self: theirs)
    monkeypatch.setattr(
        "importlib.metadata.entry_points", lambda *, group: [entry] * (group == entry.group)
    )
    own = find_property("order")
    assert (own.name, own.holds) == (theirs.name, theirs.holds)
    assert run_campaign(subject(go("A")), [own], runs=3).failures == []
    with pytest.raises(UsageError, match="replays, order"):
        find_property("other")


def test_a_failure_in_the_property_of_another_package_is_its_own() -> None:
    theirs = guarded(Property("order", "it is in order", lambda run: 1 // 0))
    with pytest.raises(UsageError, match="order cannot be checked: ZeroDivisionError: integer"):
        run_campaign(subject(go("A")), [theirs], runs=3)
    texts: Any = Property("order", "it is in order", lambda run: ["oops"])  # type: ignore[list-item]
    with pytest.raises(UsageError, match="order must yield Breach objects, not str"):
        run_campaign(subject(go("A")), [guarded(texts)], runs=3)


def test_progress_is_a_function() -> None:
    progress: Any = True
    with pytest.raises(UsageError, match="takes a function or None as progress, not True"):
        run_campaign(subject(go("A")), [], runs=3, progress=progress)


def test_a_plan_that_does_what_the_task_asks_for_holds_it() -> None:
    target = subject(go("A"), control("recovery", go("C")), go("B"), go("Say"))
    assert run_campaign(target, [property_of_task(rounds())], runs=150).failures == []


def test_a_missing_alternative_is_found_with_the_failure_that_shows_it() -> None:
    target = subject(go("A"), go("B"))
    (failure,) = run_campaign(target, [property_of_task(rounds())], runs=50).failures
    assert strange(failure) == {0: ("FAILED", 1_000)}
    assert failure.breach.about[0] == "GP605"


def test_a_broken_rule_is_found_with_the_failure_that_shows_it() -> None:
    target = subject(go("A"), control("recovery", go("Say"), go("C")), go("B"))
    failures = run_campaign(target, [property_of_task(rounds())], runs=60).failures
    (broken,) = [each for each in failures if each.breach.about[0] == "GP608"]
    assert strange(broken) == {0: ("FAILED", 1_000)}
    assert broken.breach.numbers == (1,)


TASK = b"""
actions:
  go: {interface: GoRunner}
  say: {interface: SayRunner}
steps:
  - do: go
rules:
  - precedence: [go, say]
"""


def test_what_starts_at_the_instant_of_the_end_has_started() -> None:
    """An empty control completes the plan at once, while both others start."""
    twice = go("GoRunner") * 2
    target = subject(control("parallel_any", twice, control("sequential")), faults=("failed",))
    campaign = run_campaign(target, [property_of_task(read_task(TASK))], runs=20)
    assert [failure.breach.about[0] for failure in campaign.failures] == ["GP604"]


@settings(max_examples=25)
@given(plans(min_runners=1, max_runners=4, max_depth=2))
def test_what_runs_break_the_decision_procedure_finds_too(whole) -> None:
    """No run leaves a task that the exact decision calls fulfilled, nor in another way."""
    task = read_task(TASK)
    target = subject_of(to_xml(whole), faults=("failed",), library=FREE)
    if not target.plan.runners:
        return
    campaign = run_campaign(target, [property_of_task(task)], runs=60)
    compiled = compile_plan(target.plan)
    decision = decide_task(compiled, constraints_of(target.plan), task)
    codes = {departure.rule for departure in decision.departures}
    assert {failure.breach.about[0] for failure in campaign.failures} <= codes
    if decision.fulfilled:
        assert messages(campaign) == []


PROPERTIES = '''
"""Properties of a user."""
from gpsfsm.fuzzing import Breach, Property

def quick(run):
    """Every run takes less than five seconds."""
    assert run.at_s < 5, f"it takes {run.at_s:g} s"

def named(run):
    return [Breach("it is told", (0,))]

WHOLE = Property("whole", "it holds", lambda run: [])
NUMBER = 7
'''


def test_a_function_of_a_file_is_a_property(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(PROPERTIES)
    quick = property_of(f"{file}:quick")
    assert quick.holds == "Every run takes less than five seconds."
    target = subject(go("A"))
    run = play(target, acts(target, n0=(Fate.SUCCEEDED, 7_000)))
    assert [breach.message for breach in quick.check(run)] == ["it takes 7 s"]
    assert [breach.numbers for breach in property_of(f"{file}:named").check(run)] == [(0,)]
    assert property_of(f"{file}:WHOLE").holds == "it holds"


@pytest.mark.parametrize("name", ["NUMBER", "missing", ""])
def test_what_is_no_function_is_refused(tmp_path: Path, name: str) -> None:
    file = tmp_path / "mine.py"
    file.write_text(PROPERTIES)
    with pytest.raises(UsageError, match="there is no function"):
        property_of(f"{file}:{name}")


@pytest.mark.parametrize("content", ["import nothing_of_this_name", "raise SystemExit(3)", "(("])
def test_a_file_that_cannot_be_imported_is_refused(tmp_path: Path, content: str) -> None:
    file = tmp_path / "mine.py"
    file.write_text(content)
    with pytest.raises(UsageError, match="cannot be imported"):
        property_of(f"{file}:quick")


@pytest.mark.parametrize("name", ["no_such_module_here:quick", "missing.py:quick", ":quick"])
def test_a_module_that_is_not_there_is_refused(name: str) -> None:
    with pytest.raises(UsageError, match="cannot be imported"):
        property_of(name)
