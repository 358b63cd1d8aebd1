"""The gate fails closed, excuses nothing unasked, and says for what its verdict holds."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from dataclasses import fields, replace
from typing import TYPE_CHECKING, Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsfsm.gating.deciding
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.api import check_options
from gpsfsm.capabilities.library import EMPTY
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.errors import InternalError, UsageError
from gpsfsm.gating import GateOptions, Reason, gate_text, refusal
from gpsfsm.gating.deciding import digests_of, reason_of
from gpsfsm.gating.receipts import write_receipt
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Frequency, Report
from gpsfsm.model.report import Verdict as CheckVerdict
from gpsfsm.syntax import Limits
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from pathlib import Path

RUNNER = '<Runner interface="a/Go" provider="a/Go"/>'
TASK = """
task: Stop.
actions:
  stop: {interface: Stop}
steps:
  - do: stop
"""
GOOD = '<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>'
RECOVERY = '<Control type="recovery"/>'
STOP = GOOD.replace("Go", "Stop")
WARNS = f'<Plan>{RECOVERY}<Runner interface="a/Go" provider="a/Go"/></Plan>'
WRONG = '<Plan><Runner provider="a/Go"/></Plan>'


def excused(plan: str, rule: str) -> str:
    return f"<!-- gpsfsm: ignore {rule} because I say so -->{plan}"


def test_a_good_plan_passes() -> None:
    verdict = gate_text(GOOD, "plan.xml")
    assert (verdict.decision, verdict.reason, verdict.findings) == (
        CheckVerdict.ACCEPTED,
        Reason.PASSED,
        (),
    )
    assert verdict.accepted


@pytest.mark.parametrize("text", [WRONG, "", "hello", b"\xff", "<Plan>", "<Plan/>", "<Plan>" * 500])
def test_whatever_is_not_sure_to_be_right_is_refused(text: str | bytes) -> None:
    verdict = gate_text(text, "plan.xml")
    assert not verdict.accepted
    assert verdict.reason is not Reason.PASSED
    assert verdict.message


@given(st.text(max_size=60) | st.binary(max_size=60))
def test_no_text_makes_it_raise_and_no_noise_passes(text: str | bytes) -> None:
    assert not gate_text(text, "noise").accepted


def test_a_limit_makes_it_inconclusive() -> None:
    options = GateOptions(check=CheckOptions(limits=Limits(max_elements=1), trees=False))
    verdict = gate_text(GOOD, "plan.xml", options)
    assert (verdict.decision, verdict.reason) == (CheckVerdict.UNDECIDED, Reason.INCONCLUSIVE)


@pytest.mark.parametrize("error", [ZeroDivisionError, MemoryError, RecursionError, SystemExit(0)])
def test_a_check_that_breaks_lets_nothing_through(
    monkeypatch: pytest.MonkeyPatch, error: BaseException | type[BaseException]
) -> None:
    def broken(*_: object) -> None:
        raise error

    monkeypatch.setattr(gpsfsm.gating.deciding, "check_text", broken)
    verdict = gate_text(GOOD, "plan.xml")
    assert (verdict.decision, verdict.reason) == (CheckVerdict.UNDECIDED, Reason.INCONCLUSIVE)
    kind = error if isinstance(error, type) else type(error)
    assert kind.__name__ in verdict.message
    assert verdict.digests == digests_of(GOOD, GateOptions())
    assert verdict.report is not None
    assert verdict.report.verdict is CheckVerdict.UNDECIDED


def test_digests_that_break_let_nothing_through(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object) -> None:
        raise MemoryError

    monkeypatch.setattr(gpsfsm.gating.deciding, "digests_of", broken)
    verdict = gate_text(GOOD, "plan.xml")
    assert (verdict.decision, verdict.reason) == (CheckVerdict.UNDECIDED, Reason.INCONCLUSIVE)
    assert verdict.digests.all == ""


UNSURE = (
    {"facts": None},
    {"facts": "completes"},
    {"facts": "gives_up"},
    {"facts": "stuck"},
    {"verdict": CheckVerdict.UNDECIDED},
)


@pytest.mark.parametrize("changes", UNSURE)
def test_an_acceptance_that_knows_nothing_is_none(
    monkeypatch: pytest.MonkeyPatch, changes: dict[str, Any]
) -> None:
    good = check_text(GOOD, "plan.xml", CheckOptions())
    assert good.facts is not None
    unknown = changes.get("facts")
    if unknown is not None:
        changes = {"facts": replace(good.facts, **{unknown: Frequency.UNKNOWN})}
    unsure = replace(good, findings=(), **changes)
    monkeypatch.setattr(gpsfsm.gating.deciding, "check_text", lambda *_: unsure)
    verdict = gate_text(GOOD, "plan.xml", GateOptions(allow_suppressions=True))
    assert (bool(verdict), verdict.reason) == (False, Reason.INCONCLUSIVE)


@pytest.mark.parametrize("lenient", [True, False])
def test_a_rejection_without_reasons_is_one(monkeypatch: pytest.MonkeyPatch, lenient: bool) -> None:
    good = check_text(GOOD, "plan.xml", CheckOptions())
    rejected = replace(good, findings=(), verdict=CheckVerdict.REJECTED)
    monkeypatch.setattr(gpsfsm.gating.deciding, "check_text", lambda *_: rejected)
    verdict = gate_text(GOOD, "plan.xml", GateOptions(allow_suppressions=lenient))
    assert (verdict.accepted, verdict.reason) == (False, Reason.FINDINGS)


def test_z3_running_out_of_steps_is_a_refusal() -> None:
    twice = f"<Plan>{RUNNER}{RUNNER}</Plan>"
    analysis = AnalysisOptions(consistent=True, total_rlimit=1)
    options = GateOptions(check=CheckOptions(trees=False, analysis=analysis))
    verdict = gate_text(twice, "plan.xml", options)
    assert (verdict.accepted, verdict.reason, verdict.reason.exit_code) == (
        False,
        Reason.INCONCLUSIVE,
        2,
    )
    assert {each.rule for each in verdict.findings} == {"GP904"}
    assert gate_text(twice, "plan.xml").accepted


def test_the_truth_value_and_the_words_are_those_of_the_verdict() -> None:
    verdicts = [gate_text(each, "plan.xml") for each in (GOOD, WRONG, "<Plan/>")]
    assert [(bool(each), str(each), each.reason.exit_code) for each in verdicts] == [
        (True, "accepted (structure only: no task was given)", 0),
        (False, "rejected: findings", 1),
        (False, "rejected: empty", 1),
    ]
    liar = replace(verdicts[1], decision=CheckVerdict.ACCEPTED)
    assert not liar


def test_it_says_that_only_the_structure_was_decided(tmp_path: Path) -> None:
    without = gate_text(GOOD, "plan.xml")
    assert without.message == "the plan may run; structure only: no task was given"
    basis = {"scope": "structure", "task": None, "engine": None, "allow_approximated": False}
    assert without.to_dict()["basis"] == basis
    file = tmp_path / "task.yaml"
    file.write_text(TASK, "utf-8")
    options = GateOptions(check=CheckOptions(trees=False, task=load_task(file)))
    for plan, words in ((STOP, "accepted"), (GOOD, "rejected: findings")):
        verdict = gate_text(plan, "plan.xml", options)
        assert str(verdict) == words
        digest = hashlib.sha256(TASK.encode()).hexdigest()
        basis |= {"scope": "structure and task", "task": digest}
        assert verdict.to_dict()["basis"] == basis
    assert refusal(GOOD, options, "no time").basis.task == digest


def test_it_says_that_failures_hang_on_an_engine() -> None:
    waits = RUNNER.replace("a/Go", "std_capabilities/WaitRunner")
    options = GateOptions(check=CheckOptions(trees=False, engine="fabric-v2"))
    verdict = gate_text(f"<Plan>{waits}</Plan>", "plan.xml", options)
    assert "any unhandled failure hangs on fabric-v2" in verdict.basis.remarks
    engine = verdict.to_dict()["basis"]["engine"]
    assert engine["name"] == "fabric-v2"
    assert engine["hangs"] in ("always", "sometimes", "never")


@pytest.mark.parametrize("reason", list(Reason))
def test_the_reason_settles_the_verdict(reason: Reason) -> None:
    codes = {CheckVerdict.ACCEPTED: 0, CheckVerdict.REJECTED: 1, CheckVerdict.UNDECIDED: 2}
    assert codes[reason.decision] == reason.exit_code


@pytest.mark.parametrize(
    ("text", "options"),
    [
        (WARNS, GateOptions(fail_on=Severity.WARNING)),
        ("<Plan/>", GateOptions()),
        (WRONG, GateOptions()),
    ],
)
def test_in_the_report_what_refuses_is_an_error(text: str, options: GateOptions) -> None:
    verdict = gate_text(text, "plan.xml", options)
    assert verdict.report is not None
    assert verdict.report.verdict is CheckVerdict.REJECTED
    shown = {each.rule for each in verdict.report.findings if each.severity is Severity.ERROR}
    assert shown == {each.rule for each in verdict.findings} != set()
    assert Report((verdict.report,)).exit_code() == 1
    accepted = gate_text(GOOD, "plan.xml").report
    assert accepted is not None
    assert Report((accepted,)).exit_code() == 0


def test_a_task_and_an_engine_refuse_as_well(tmp_path: Path) -> None:
    (tmp_path / "task.yaml").write_text(TASK, encoding="utf-8")
    options = GateOptions(check=CheckOptions(trees=False, task=load_task(tmp_path / "task.yaml")))
    assert gate_text(GOOD, "plan.xml", options).reason is Reason.FINDINGS
    assert gate_text(GOOD.replace("a/Go", "a/Stop"), "plan.xml", options).accepted
    engine = GateOptions(check=replace(check_options(engine="fabric-v2"), trees=False))
    assert gate_text(GOOD, "plan.xml").accepted
    hangs = gate_text(GOOD, "plan.xml", engine)  # this engine has no give-up
    assert hangs.report is not None
    assert hangs.report.facts is not None
    assert hangs.report.facts.engine is not None


def test_warnings_refuse_where_that_is_asked_for() -> None:
    assert gate_text(WARNS, "plan.xml").accepted
    verdict = gate_text(WARNS, "plan.xml", GateOptions(fail_on=Severity.WARNING))
    assert verdict.reason is Reason.FINDINGS
    assert {each.severity for each in verdict.findings} == {Severity.WARNING}


def test_comments_in_a_plan_excuse_nothing_unless_they_may() -> None:
    strict = GateOptions(fail_on=Severity.WARNING)
    rules = {each.rule for each in gate_text(WARNS, "plan.xml", strict).findings}
    text = excused(WARNS, ",".join(sorted(rules)))
    verdict = gate_text(text, "plan.xml", strict)
    assert {each.rule for each in verdict.findings} >= rules
    lenient = replace(strict, allow_suppressions=True)
    assert gate_text(text, "plan.xml", lenient).accepted


def test_options_hide_no_errors() -> None:
    rules = tuple(each.rule for each in gate_text(WRONG, "plan.xml").findings)
    options = GateOptions(check=replace(check_options(ignore=rules), trees=False))
    verdict = gate_text(WRONG, "plan.xml", options)
    assert {each.rule for each in verdict.findings} == set(rules)


def test_an_empty_plan_passes_where_it_may() -> None:
    assert gate_text("<Plan/>", "plan.xml").reason is Reason.EMPTY
    assert gate_text("<Plan/>", "plan.xml", GateOptions(allow_empty=True)).accepted


def test_behaviour_trees_are_no_plans_unless_they_may_be() -> None:
    tree = '<root BTCPP_format="4"><BehaviorTree ID="a"><Go/></BehaviorTree></root>'
    assert not gate_text(tree, "tree.xml").accepted
    assert gate_text(tree, "tree.xml", GateOptions(allow_trees=True)).accepted


def test_options_that_make_no_sense_are_told() -> None:
    with pytest.raises(UsageError):
        check_options(AnalysisOptions(assumptions=("((",)))


def test_digests_are_the_same_in_every_process(tmp_path: Path) -> None:
    """Also those of sets of rules, and of a task, though a task is more than plain data."""
    (tmp_path / "task.yaml").write_text(f"{TASK}not_answers: [shown.xml]\n", encoding="utf-8")
    (tmp_path / "shown.xml").write_text(GOOD, encoding="utf-8")
    code = (
        "from dataclasses import replace\n"
        "from gpsfsm.api import check_options\n"
        "from gpsfsm.gating import GateOptions, gate_text\n"
        "from gpsfsm.gating.deciding import digests_of\n"
        "from gpsfsm.tasks.load import load_task\n"
        "options = GateOptions(check=check_options(select=['GP1', 'GP3'], ignore=['GP2']))\n"
        "print(gate_text('<Plan/>', 'plan.xml', options).digests.all)\n"
        "check = replace(check_options(), task=load_task('task.yaml'))\n"
        "print(digests_of(b'', GateOptions(check=check)).options)\n"
    )
    output = {
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(output) == 1
    with_task = output.pop().splitlines()[1]
    without = digests_of(b"", GateOptions(check=check_options())).options
    engine = digests_of(b"", GateOptions(check=check_options(engine="fabric-v1"))).options
    assert len({with_task, without, engine}) == 3


def test_what_has_no_form_of_its_own_has_no_digest() -> None:
    strange = GateOptions(fail_on=object())  # type: ignore[arg-type]
    with pytest.raises(InternalError, match="no digest of a object"):
        digests_of(b"", strange)


def test_digests_tell_what_was_decided_about() -> None:
    actual = gate_text(GOOD, "plan.xml").digests
    assert actual.plan == hashlib.sha256(GOOD.encode()).hexdigest()
    assert gate_text(GOOD.encode(), "other.xml").digests == actual
    assert refusal(GOOD, GateOptions(), "too slow").digests == actual
    others = [
        GateOptions(fail_on=Severity.WARNING),
        GateOptions(allow_suppressions=True),
        GateOptions(allow_empty=True),
        GateOptions(check=CheckOptions(trees=False, analysis=AnalysisOptions(consistent=True))),
        GateOptions(check=CheckOptions(trees=False, limits=Limits(max_depth=9))),
        GateOptions(check=replace(check_options(ignore=["GP302"]), trees=False)),
    ]
    digests = [gate_text(GOOD, "plan.xml", each).digests for each in others]
    assert len({each.options for each in digests} | {actual.options}) == len(others) + 1
    assert len({each.all for each in digests} | {actual.all}) == len(others) + 1
    unknown = GateOptions(check=CheckOptions(trees=False, capabilities=EMPTY))
    other = gate_text(GOOD, "plan.xml", unknown).digests
    assert (other.options, other.plan) == (actual.options, actual.plan)
    assert other.capabilities != actual.capabilities
    assert other.all != actual.all


WAIT = "generic_capabilities/WaitRunner"


def _waits(count: int, seconds: float) -> str:
    one = f'<Runner interface="{WAIT}" provider="{WAIT}" seconds="{seconds}"/>'
    return f"<Plan>{one * count}</Plan>"


@pytest.mark.parametrize(
    ("count", "deadline_s", "accepted"),
    [(10, 1.0, False), (10, 1.1, False), (10, 1.11, True), (1, 0.11, False), (1, 0.13, True)],
)
def test_a_deadline_allows_for_what_a_real_run_adds(
    count: int, deadline_s: float, accepted: bool
) -> None:
    """Ten waits of a tenth of a second take more than a second: 10 ms each, and 10 to begin."""
    options = GateOptions(check_options(AnalysisOptions(deadline_s=deadline_s)))
    verdict = gate_text(_waits(count, 0.1), "plan.xml", options)
    assert verdict.accepted is accepted
    if not accepted:
        (finding,) = verdict.findings
        assert finding.rule == "GP502"
        assert "a deadline applies to declared durations, not to a loaded machine" in str(
            finding.message
        )
    exact = check_text(_waits(count, 0.1), "plan.xml", options.check)
    assert exact.verdict is CheckVerdict.ACCEPTED  # check goes by the declared durations alone


def test_without_a_deadline_nothing_is_allowed_for() -> None:
    verdict = gate_text(_waits(10, 0.1), "plan.xml", GateOptions())
    assert verdict.accepted
    assert verdict.report is not None
    assert verdict.report.facts is not None
    assert verdict.report.facts.makespan is not None
    assert verdict.report.facts.makespan.max == pytest.approx(1.0)  # the fact is as declared


@pytest.mark.parametrize(
    "text",
    [
        "<Plan/>",
        "<Plan><Runner/></Plan>",
        '<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>',
    ],
)
def test_a_verdict_is_data_as_in_the_receipt(text: str) -> None:
    verdict = gate_text(text, "a.xml")
    (entry,) = json.loads(write_receipt([verdict]))["plans"]
    assert verdict.to_dict() == entry
    assert (entry["path"], entry["verdict"]) == ("a.xml", verdict.decision.value)


def test_what_kept_a_plan_from_being_proved_is_told_without_a_finding_as_well() -> None:
    """A check accepts such a plan, and a run asks the gate for the reason not to run it."""
    both = f"<Plan><Control type='parallel_all'>{RUNNER}{RUNNER}</Control>{RUNNER}</Plan>"
    options = CheckOptions(analysis=AnalysisOptions(rlimit=1))
    report = check_text(both, "plan.xml", options)
    assert report.verdict is CheckVerdict.ACCEPTED
    wanted = Reason.INCONCLUSIVE, "not proved: over --rlimit"
    assert reason_of(report, GateOptions()) == wanted


def test_receipts_list_every_option() -> None:
    def names(of: object) -> set[str]:
        return {each.name for each in fields(of)}  # type: ignore[arg-type]

    check = check_options(AnalysisOptions(consistent=True, faults=("hang",)), ignore=["GP302"])
    options = GateOptions(check, allow_trees=True)
    listed = gate_text(GOOD, "plan.xml", options).to_dict()["options"]
    nested = {"check", "analysis", "limits", "selection", "named"}
    parts = (options, check, check.analysis, check.limits, check.selection)
    assert listed.keys() == set().union(*map(names, parts)) - nested | {"robot", "allow"}
    assert listed["consistent"] is True
    assert (listed["faults"], listed["ignore"], listed["task"]) == (["hang"], ["GP302"], None)
    assert (listed["allow_trees"], listed["trees"], listed["robot"]) == (True, True, None)
    assert refusal(b"", options, "no").to_dict()["options"] == listed
