"""The picture of a checked plan, made again from the text that its report holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import PlanReport

__all__ = ["Drawn", "automaton_of", "can_be_drawn", "draw", "marks_of"]

_MOST_NODES = 60
_MOST_CHARACTERS = 40_000
"""Mermaid refuses a text of more than 50,000 characters."""
_LARGEST_SOURCE = 200_000
_FILE = "plan.xml"


@dataclass(frozen=True, slots=True)
class Drawn:
    """A picture in Mermaid's language; or why the plan is too large for one; or neither."""

    mermaid: str = ""
    too_large: str = ""


def draw(plan: PlanReport) -> Drawn:
    """Draw a plan, with what findings are about marked; nothing if the text holds no plan."""
    if plan.source is None:
        return Drawn()
    if not can_be_drawn(plan):
        return Drawn(too_large=f"its text is longer than {_LARGEST_SOURCE:,} characters")
    automaton = automaton_of(plan)
    if automaton is None:
        return Drawn()
    for count, what in (
        (len(automaton.nodes), "nodes"),
        (len(automaton.plan.elements) - len(automaton.plan.runners) - 1, "controls"),
    ):
        if count > _MOST_NODES:
            return Drawn(too_large=f"it has {count:,} {what}, which is more than {_MOST_NODES}")
    from gpsfsm.model.drawing import automaton_to_mermaid  # noqa: PLC0415  (few reports draw)

    text = automaton_to_mermaid(automaton, marks_of(plan, automaton.plan))
    if len(text) > _MOST_CHARACTERS:
        return Drawn(too_large="its labels are too long for Mermaid")
    return Drawn(text)


def can_be_drawn(plan: PlanReport) -> bool:
    """Whether there is a text, and none so long that reading it again would take its time."""
    return plan.source is not None and len(plan.source) <= _LARGEST_SOURCE


def automaton_of(report: PlanReport) -> Automaton | None:
    """The automaton that was checked, None if the text holds no plan or the engine refuses it."""
    from gpsfsm.compile import compile_plan  # noqa: PLC0415  (few reports draw)
    from gpsfsm.reading import read_plan  # noqa: PLC0415

    source = report.source or ""
    engine = report.facts.engine if report.facts is not None else None
    if engine is not None:
        return _on_engine(source, engine.name)
    plan = read_plan(source, file=_FILE).plan
    if plan is None and report.facts is not None:  # a model's answer, with prose around the plan
        plan = read_plan(source, file=_FILE, from_response=True).plan
    return None if plan is None else compile_plan(plan).automaton


def _on_engine(source: str, engine: str) -> Automaton | None:
    from gpsfsm.capabilities.library import Library  # noqa: PLC0415
    from gpsfsm.engines import EngineReading, read_for_engine  # noqa: PLC0415
    from gpsfsm.reading import read_plan  # noqa: PLC0415

    reading = read_for_engine(source, engine, _FILE, Library())
    if not isinstance(reading, EngineReading):
        body = read_plan(source, file=_FILE, from_response=True).body
        reading = read_for_engine(body, engine, _FILE, Library()) if body else reading
    return reading.compiled.automaton if isinstance(reading, EngineReading) else None


def marks_of(report: PlanReport, plan: Plan) -> dict[int, str]:
    """The codes of the findings of each element, by index."""
    codes: dict[str, list[str]] = {}
    for finding in report.findings:
        known = codes.setdefault(finding.location.element, [])
        if finding.rule not in known:
            known.append(finding.rule)
    codes.pop("", None)
    found: dict[int, str] = {}
    for element in plan.elements:
        words = codes.get(plan.path(element)) if codes else None
        if words:
            found[element.index] = ", ".join(words)
    return found
