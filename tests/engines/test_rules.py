"""What the rules about engines tell (GP706 to GP709), word for word where it matters."""

from __future__ import annotations

import pytest

from gpsfsm.analysis.rules.base import control, go, plan, say
from gpsfsm.capabilities.library import Capabilities
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.capability import Output, Parameter, ValueType
from tests.analysis.rules.support import library, places, provider, runner


def messages(code: str, text: str, capabilities: Capabilities | None = None) -> list[str]:
    """What one rule says about a plan on fabric-v2."""
    report = check_text(
        text, "plan.xml", CheckOptions(engine="fabric-v2", capabilities=capabilities)
    )
    return [finding.message for finding in report.findings if finding.rule == code]


def test_each_runner_that_is_cut_off_is_shown_at_its_place() -> None:
    recoveries = control("recovery", go(0.0, 2.0)), control("recovery", go(0.0, 0.0), say("Help."))
    text = plan(go(1.0, 2.0), *recoveries)
    report = check_text(text, "plan.xml", CheckOptions(engine="fabric-v2"))
    (actual,) = [finding for finding in report.findings if finding.rule == "GP706"]
    assert (actual.location.line, places(actual)) == (7, [(8, "never runs")])


def test_a_join_that_waits_for_two_successes_is_told() -> None:
    text = plan(control("parallel_all", go(1.0, 2.0), say("Hello.")))
    assert messages("GP707", text) == [
        "on fabric-v2 the join of the parallel_all at line 2 waits for 2 "
        "successes, of which only 1 can arrive: the plan hangs there"
    ]


def test_an_empty_text_becomes_a_number() -> None:
    """The plan has a text there, and the engine a 0."""
    text = plan(runner("nav2_capabilities/WaypointRunner", 'x="" y="2.0"'))
    assert messages("GP709", text) == [
        'fabric-v2 changes x="" of WaypointRunner (x=, y=2.0) at line 2 to 0'
    ]


@pytest.mark.parametrize("optional", [False, True], ids=["surely", "maybe"])
def test_only_a_value_that_surely_arrives_replaces_one_that_kills(optional: bool) -> None:
    capabilities = library(
        provider("a/Find", outputs=(Output("x", ValueType.DOUBLE, optional=optional),)),
        provider("a/Go", configuration=(Parameter("x", ValueType.DOUBLE),)),
    )
    text = plan(runner("a/Find"), runner("a/Go", 'x="1"'))
    assert bool(messages("GP708", text, Capabilities(capabilities, ()))) is optional
