"""GP302: one finding per plan, and a budget of failures that is decided exactly."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.words import fewest_words
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.selection import Selection
from gpsfsm.gating import GateOptions
from gpsfsm.gating.deciding import gate_text
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.story import Vocabulary
from tests.oracle.facts import facts
from tests.oracle.model import P, to_xml
from tests.strategies import plans, plans_of_few_actions


def dangling(text: str, engine: str = "paper", **analysis: object) -> Finding | None:
    """The one finding about failures that end the plan."""
    options = CheckOptions(engine=engine, analysis=AnalysisOptions(**analysis))  # type: ignore[arg-type]
    findings = [each for each in check_text(text, "", options).findings if each.rule == "GP302"]
    assert len(findings) <= 1
    return findings[0] if findings else None


@given(plans(max_runners=7), st.integers(0, 3))
def test_the_budget_is_that_of_brute_force(whole: P, tolerate: int) -> None:
    expected = facts(whole)
    assert expected is not None
    fewest = expected["fewest_failures_to_give_up"]
    finding = dangling(to_xml(whole), tolerate=tolerate)
    decisive = [each for each in expected["dangling"] if each["effect"] == "give_up"]
    if fewest is None:
        assert finding is None
        return
    assert finding is not None
    broken = tolerate > 0 and fewest <= tolerate
    assert finding.severity is (Severity.WARNING if broken else Severity.INFO)
    assert len(finding.related) == max(0, len(decisive) - 1)
    assert {path for path, _ in finding.scenario.outcomes} if finding.scenario else decisive
    words = {0: "; no failure is needed", 1: "; 1 failure is enough"}
    several = f"; this takes at least {fewest} failures in total"
    demand = f", but --tolerate {tolerate} requires more" if broken else ""
    assert finding.message.endswith(f"{words.get(fewest, several)}{demand}")


@given(plans_of_few_actions(max_runners=6), st.integers(1, 3))
def test_the_budget_counts_equal_actions_as_brute_force_does(whole: P, tolerate: int) -> None:
    expected = facts(whole, consistent=True)
    assert expected is not None
    fewest = expected["fewest_failures_to_give_up"]
    finding = dangling(to_xml(whole), tolerate=tolerate, consistent=True)
    assert (finding is None) == (fewest is None)
    if fewest is not None and fewest <= tolerate:
        assert finding is not None
        assert finding.severity is Severity.WARNING


GO = '<Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/WaypointRunner" x="{}.0" y="0.0"/>'  # noqa: E501
GUARDED = f'<Plan>\n{GO.format(1)}\n<Control type="recovery">\n{GO.format(2)}\n</Control>\n</Plan>'


@pytest.mark.parametrize("engine", ["paper", "fabric-v1", "fabric-v2"])
def test_an_engine_is_judged_by_the_same_budget(engine: str) -> None:
    for tolerate, severity in ((0, "info"), (1, "info"), (2, "warning")):
        finding = dangling(GUARDED, engine, tolerate=tolerate)
        assert finding is not None
        assert finding.severity.value == severity
        assert ("cannot give up" in finding.message) == (engine != "paper")
        check = CheckOptions(
            engine=engine, analysis=AnalysisOptions(tolerate=tolerate), trees=False
        )
        verdict = gate_text(GUARDED, "", GateOptions(check))
        assert verdict.accepted == (severity == "info")
        if not verdict:
            assert verdict.message == "2 failures or fewer end the plan (--tolerate 2)"


def test_the_message_says_where_and_how_many() -> None:
    finding = dangling(GUARDED.replace("</Plan>", f"{GO.format(3)}\n</Plan>"))
    assert finding is not None
    assert finding.message == (
        "2 of 3 failures end the plan (line 4: last step of a recovery; line 6: nothing handles "
        "it); 1 failure is enough"
    )
    assert [each.location.line for each in finding.related] == [6]
    assert finding.scenario is not None
    assert finding.scenario.story == (
        "WaypointRunner (x=1.0, y=0.0) at line 2 succeeds",
        "WaypointRunner (x=3.0, y=0.0) at line 6 fails",
        "nothing handles this failure: the plan gives up",
    )


def test_a_comment_excuses_a_place_and_all_of_them_the_finding() -> None:
    comment = "<!-- gpsfsm: ignore GP302 because it may -->"
    one = f"<Plan>{comment}{GO.format(1)}{GO.format(2)}</Plan>"
    both = f"<Plan>{comment}{GO.format(1)}{comment}{GO.format(2)}</Plan>"
    assert dangling(one) is not None
    assert dangling(both) is None
    assert "GP905" not in {each.rule for each in check_text(one, "", CheckOptions()).findings}


WAIT = "generic_capabilities/WaitRunner"
RECOVERED = GUARDED.replace(
    GO.format(2), f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="1.0"/>'
)


@pytest.mark.parametrize("text", [GUARDED, RECOVERED])
@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
def test_an_engine_that_waits_for_what_does_not_start_is_no_paper(text: str, engine: str) -> None:
    """By the paper it has failed, and the recovery runs; the engines hear nothing of it."""
    analysis = AnalysisOptions(faults=("no-start",), tolerate=1)
    check = CheckOptions(engine=engine, analysis=analysis, trees=False)
    report = check_text(text, "", check)
    (finding,) = [each for each in report.findings if each.rule == "GP703"]
    assert finding.location.line == 2
    assert "WaypointRunner (x=1.0, y=0.0) at line 2 does not start" in finding.message
    assert not gate_text(text, "", GateOptions(check)).accepted
    paper = replace(check, engine="paper")
    assert gate_text(text, "", GateOptions(paper)).accepted


def test_no_option_hides_a_broken_budget_from_the_gate() -> None:
    for ignored in ((), ("GP302",)):
        check = CheckOptions(
            analysis=AnalysisOptions(tolerate=2), selection=Selection.of(ignore=ignored)
        )
        verdict = gate_text(GUARDED, "", GateOptions(replace(check, trees=False)))
        assert not verdict.accepted
        assert [each.rule for each in verdict.findings] == ["GP302"]


ONE = "<Fallback><A/><AlwaysFailure/></Fallback>"
BOTH = '<Parallel success_count="2" failure_count="1"><A/><B/></Parallel>'
SWITCH = (
    '<Sequence><Ask answer="{r}"/><Switch2 variable="{r}" case_1="k" case_2="h"><A/><B/>'
    "<AlwaysFailure/></Switch2></Sequence>"
)


@pytest.mark.parametrize(
    ("tree", "message"),
    [
        ("<AlwaysFailure/>", "the tree can fail although no action fails"),
        ("<Sequence><A/><AlwaysFailure/></Sequence>", "the tree can fail although no action fails"),
        (
            f"<Inverter>{BOTH}</Inverter>",
            "2 of 4 outcomes make the tree fail (line 1: an Inverter turns it into a failure); no "
            "failure is needed",
        ),
        (
            SWITCH,
            "3 failures make the tree fail (line 1: nothing handles it); it is unknown how many "
            "failures are needed (unless the over-approximated constructs rule that out)",
        ),
        (
            ONE,
            "1 of 1 failure makes the tree fail (line 1: nothing handles it); 1 failure is enough",
        ),
    ],
)
def test_the_parts_of_a_message_are_true_together(tree: str, message: str) -> None:
    finding = dangling(f'<root BTCPP_format="4"><BehaviorTree ID="M">{tree}</BehaviorTree></root>')
    assert finding is not None
    assert finding.message == message


def test_failures_that_were_named_are_not_said_to_be_needless() -> None:
    terms = Vocabulary.TREE.terms
    assert fewest_words(0, terms) == "the tree can also fail although no action fails"
    assert fewest_words(0, terms, failures=False) == "no failure is needed"
