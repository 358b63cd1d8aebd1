"""What goes wrong inside gpsfsm while it checks a plan is reported for that plan, not raised."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
from gpsfsm.errors import AssumptionError, InternalError, UsageError
from gpsfsm.model.report import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PLAN = '<Plan><Runner interface="demo/Go" provider="demo/Go"/></Plan>'
PARTS = [
    "gpsfsm.checking.check.read_plan_or_machine",
    "gpsfsm.checking.check.apply_suppressions",
    "gpsfsm.analysis.constraints.constraints_of",
    "gpsfsm.analysis.context.Context",
    "gpsfsm.analysis.decide.decide",
    "gpsfsm.compile.compile_plan",
]


@pytest.fixture(autouse=True)
def _not_debugging(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("GPSFSM_DEBUG", raising=False)


def raising(error: BaseException) -> Callable[..., Any]:
    def fail(*_: object, **__: object) -> None:
        raise error

    return fail


def message_of(plan: gpsfsm.PlanReport, rule: str = "GP903") -> str:
    """What the only finding says, which must be that there is no verdict."""
    (finding,) = plan.findings
    assert (finding.rule, plan.verdict, plan.facts) == (rule, Verdict.UNDECIDED, None)
    return finding.message


@pytest.mark.parametrize("part", PARTS)
def test_a_defect(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert gpsfsm.check(PLAN).exit_code() == 0
    monkeypatch.setattr(part, raising(ZeroDivisionError("of the universe")))
    report = gpsfsm.check(PLAN)
    assert "(ZeroDivisionError: of the universe)" in message_of(report.plans[0])
    assert "please report this" in report.plans[0].findings[0].hint
    assert report.exit_code() == 2


def test_a_defect_does_not_hide_other_plans(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fragile(text: bytes, *, file: str, **options: Any) -> Any:
        del options["includes"]
        return gpsfsm.parse(text, file=file, **options) if file.endswith("b.xml") else 1 // 0

    for name in ("a.xml", "b.xml"):
        (tmp_path / name).write_text(PLAN, encoding="utf-8")
    monkeypatch.setattr("gpsfsm.checking.check.read_plan_or_machine", fragile)
    first, second = gpsfsm.check(tmp_path).plans
    assert "ZeroDivisionError" in message_of(first)
    assert second.verdict is Verdict.ACCEPTED


@pytest.mark.parametrize("part", PARTS)
def test_a_contradiction(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(part, raising(InternalError("two and two are five")))
    (plan,) = gpsfsm.check(PLAN).plans
    assert plan.verdict is Verdict.UNDECIDED
    assert any(
        (finding.rule, finding.message) == ("GP903", "two and two are five")
        for finding in plan.findings
    )


@pytest.mark.parametrize("part", PARTS)
def test_no_memory_is_no_defect(part: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(part, raising(MemoryError()))
    (plan,) = gpsfsm.check(PLAN).plans
    assert message_of(plan, "GP904") == "memory ran out before the plan was decided"
    assert "defect" not in plan.findings[0].hint
    assert "report it" not in plan.findings[0].hint


@pytest.mark.parametrize("error", [UsageError("nonsense"), KeyboardInterrupt()])
def test_what_is_raised_on(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsfsm.checking.check.read_plan_or_machine", raising(error))
    with pytest.raises(type(error)):
        gpsfsm.check(PLAN)


def test_debugging_raises_on(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gpsfsm.checking.check.read_plan_or_machine", raising(KeyError("x")))
    monkeypatch.setenv("GPSFSM_DEBUG", "1")
    with pytest.raises(KeyError):
        gpsfsm.check(PLAN)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (
            {"faults": ["fire"]},
            "there is no fault model 'fire'; the fault models are failed, no-start, hang",
        ),
        ({"solver": "oracle"}, "there is no solver 'oracle'"),
        ({"rlimit": 0}, "rlimit must be from 1 to 4294967295, not 0"),
        ({"rlimit": 2**32}, "rlimit must be from 1 to 4294967295, not 4294967296"),
        ({"total_rlimit": 0}, "total_rlimit must be from 1 to 1000000000000000, not 0"),
        ({"max_scenarios": -1}, "max_scenarios must be at least 0, not -1"),
        ({"select": ["GP0"]}, "no rule matches 'GP0'"),
    ],
)
def test_options_that_make_no_sense(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=f"^{message}"):
        gpsfsm.check(PLAN, **options)


def test_an_assumption_that_does_not_parse() -> None:
    with pytest.raises(AssumptionError):
        gpsfsm.check(PLAN, assume=["never"])
