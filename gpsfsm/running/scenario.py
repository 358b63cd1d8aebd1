"""Scenarios from files: a report of ``gpsfsm check --format json``, a finding, or a scenario."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import InputError, UsageError
from gpsfsm.files import read_whole
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.printable import clip
from gpsfsm.model.story import ENGINES, PAPER_ENGINE
from gpsfsm.strict_json import json_defect, strict_loads

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan

_MAX_BYTES = 1 << 28


@dataclass(frozen=True, slots=True)
class FromFile:
    """Outcomes by element path, and how the run ends with them ("" if that is not said).

    ``order`` are the elements whose outcomes the claim needs, in causal order. ``engine`` is the
    engine on which it happens, "" for none.
    """

    outcomes: tuple[tuple[str, Outcome], ...]
    ends: str = ""
    order: tuple[str, ...] = ()
    engine: str = ""

    @property
    def no_start(self) -> bool:
        """True if an instance fails without having started."""
        return any(outcome is Outcome.NO_START for _, outcome in self.outcomes)


def read_scenario(file: str, plan: str, finding: int | None = None) -> FromFile:
    """The scenario in a file; of a report that of one finding about the plan with this path.

    ``finding`` counts from 1; without it the first one that has a scenario is taken. Raises
    UsageError or InputError.
    """
    try:
        content = read_whole(file, _MAX_BYTES)
        data = strict_loads(content)
    except InputError as error:
        raise InputError(f"{file}: {error}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(json_defect(file, error)) from error
    try:
        chosen = _chosen(data, plan, finding, file)
        return replace(_scenario(chosen, file), engine=_engine(data, chosen))
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InputError(
            f"{file}: is neither a report of 'gpsfsm check --format json' nor a scenario of one"
        ) from error


def _chosen(data: dict[str, Any], plan: str, number: int | None, file: str) -> dict[str, Any]:
    """The finding or scenario to take."""
    if "plans" not in data:
        return data
    plans = data["plans"]
    same = [report for report in plans if report["path"] == plan]
    if not same and len(plans) == 1:
        same = plans
    if not same:
        raise UsageError(f"{file}: the report says nothing about {plan}")
    findings = same[0]["findings"]
    if number is not None:
        if number > len(findings):
            raise UsageError(f"{file}: --finding {number}: there are only {len(findings)} findings")
        chosen: dict[str, Any] = findings[number - 1]
        if chosen["scenario"] is None:
            raise UsageError(f"{file}: --finding {number}: this finding has no scenario")
        return chosen
    for chosen in findings:
        if chosen["scenario"] is not None:
            return chosen
    raise UsageError(f"{file}: no finding has a scenario")


def _engine(report: dict[str, Any], finding: dict[str, Any]) -> str:
    """The engine of a report, if the finding is about what happens there."""
    ends = (finding.get("scenario") or {}).get("ends")
    there = finding.get("rule", "").startswith("GP7") or ends in (End.HANG, End.ABORT)
    names = [
        plan["facts"]["engine"]["name"]
        for plan in report.get("plans", ())
        if plan["facts"] and plan["facts"].get("engine")
    ]
    return str(names[0]) if there and names else ""


def _scenario(data: dict[str, Any], file: str) -> FromFile:
    if "scenario" in data:
        if data["scenario"] is None:
            raise UsageError(f"{file}: this finding has no scenario")
        data = data["scenario"]
    outcomes = [
        (_text(decided["element"]), Outcome(decided["outcome"])) for decided in data["outcomes"]
    ]
    order = [
        _text(step["element"])
        for step in data.get("trace", ())
        if step["event"] in (Event.SUCCEEDED, Event.FAILED)
    ]
    if data.get("trace_truncated"):
        order = []
    return FromFile(tuple(outcomes), str(data.get("ends", "")), tuple(dict.fromkeys(order)))


def _text(value: object) -> str:
    if not isinstance(value, str):
        raise TypeError(value)
    return value


def check_scenario(scenario: FromFile, plan: Plan, file: str) -> None:
    """Raise UsageError for a scenario of another plan."""
    paths = {plan.path(runner) for runner in plan.runners}
    for element in (*(element for element, _ in scenario.outcomes), *scenario.order):
        if element not in paths:
            shown = clip(element, 200)
            raise UsageError(
                f"{file}: the scenario is about {shown}, which is not a runner of this plan; "
                "was the plan changed after it was checked?"
            )


def engine_for(engine: str, scenario: FromFile | None, file: str) -> str:
    """The engine whose way of running plans is wanted: that of a scenario if none is named."""
    if engine != PAPER_ENGINE or scenario is None or not scenario.engine:
        return engine
    if scenario.engine not in ENGINES:
        raise UsageError(f"{file}: there is no engine '{clip(scenario.engine, 40)}'")
    return scenario.engine
