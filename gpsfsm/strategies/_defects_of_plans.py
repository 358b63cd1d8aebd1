"""Answers that are XML but not the plan that was meant: wrong words, wrong structure."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.strategies._defect import Stage, listing

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypothesis.strategies import DrawFn

__all__ = ["OF_PLANS"]

_RUNNER = re.compile(r"[ \t]*<Runner\b[^>]*/>")
_CONTROL = re.compile(r'<Control type="(\w+)"')
_ATTRIBUTE = re.compile(r' (interface|provider)="[^"]*"')
_FOREIGN_NODES = (
    '<MoveBase goal="1.0,2.0"/>',
    '<SubTree ID="Patrol"/>',
    "<Sequence/>",
    '<Action ID="MoveTo" location="lab"/>',
)
_COMPLETION = (
    '<Runner interface="fabric_capabilities/FabricCompletionRunner" '
    'provider="fabric_capabilities/FabricCompletionRunner"/>'
)
_OPEN = "<Plan>\n"
_CLOSE = "</Plan>"

OF_PLANS, _defect = listing(Stage.PLAN)


def _one(draw: DrawFn, found: Sequence[re.Match[str]]) -> re.Match[str] | None:
    return found[draw(st.integers(0, len(found) - 1))] if found else None


def _replaced(draw: DrawFn, text: str, pattern: re.Pattern[str], new: str) -> str:
    """One match, replaced."""
    match = _one(draw, list(pattern.finditer(text)))
    return text if match is None else text[: match.start()] + new + text[match.end() :]


def _inside(text: str) -> str:
    return text[text.find(_OPEN) + len(_OPEN) : text.rfind(_CLOSE)]


def _control(word: str, inside: str) -> str:
    return f'  <Control type="{word}">\n{inside}  </Control>\n'


def _plan(inside: str) -> str:
    return f"{_OPEN}{inside}{_CLOSE}\n"


def _first(text: str) -> tuple[str, str] | None:
    """The first child of the plan, if it is a runner, and the other ones."""
    inside = _inside(text)
    line, _, rest = inside.partition("\n")
    return (f"{line}\n", rest) if _RUNNER.fullmatch(line) else None


@_defect
def _plan_attributes(draw: DrawFn, text: str) -> str:
    """The plan has an attribute: ``<Plan ID="MainTree">``."""
    given = draw(st.sampled_from(['ID="MainTree"', 'BTCPP_format="4"']))
    return text.replace("<Plan>", f"<Plan {given}>", 1)


@_defect
def _hallucinated_element(draw: DrawFn, text: str) -> str:
    """An element that does not exist stands where a runner should."""
    return _replaced(draw, text, _RUNNER, f"  {draw(st.sampled_from(_FOREIGN_NODES))}")


@_defect
def _no_runner(draw: DrawFn, text: str) -> str:
    """Nodes of behaviour trees stand for all runners."""
    return _RUNNER.sub(f"  {draw(st.sampled_from(_FOREIGN_NODES))}", text)


@_defect
def _packed_coordinates(draw: DrawFn, text: str) -> str:
    """Both coordinates are in one attribute."""
    given = draw(st.sampled_from(['coordinates="(1.0, 2.0)"', 'x="1.0, 2.0"', 'goal="1.0,2.0"']))
    name = "nav2_capabilities/WaypointRunner"
    return _replaced(
        draw, text, _RUNNER, f'  <Runner interface="{name}" provider="{name}" {given}/>'
    )


@_defect
def _unknown_control_type(draw: DrawFn, text: str) -> str:
    """A control has a type that does not exist."""
    word = draw(st.sampled_from(["fallback", "parallel", "loop", "Sequential"]))
    return _replaced(draw, text, _CONTROL, f'<Control type="{word}"')


@_defect
def _missing_control_type(draw: DrawFn, text: str) -> str:
    """A control has no type."""
    return _replaced(draw, text, _CONTROL, "<Control")


@_defect
def _foreign_attribute(draw: DrawFn, text: str) -> str:
    """A control has an attribute that means nothing."""
    match = _one(draw, list(_CONTROL.finditer(text)))
    if match is None:
        return text
    given = draw(st.sampled_from([' success_count="1"', ' num_attempts="3"', ' interface="Retry"']))
    return text[: match.end()] + given + text[match.end() :]


@_defect
def _empty_control(draw: DrawFn, text: str) -> str:
    """There is a control with nothing in it."""
    word = draw(st.sampled_from(["sequential", "recovery", "parallel_any", "parallel_all"]))
    return _plan(f'{_inside(text)}  <Control type="{word}"/>\n') if _OPEN in text else text


@_defect
def _recovery_first(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """The first child of the plan is put into a recovery, which has nothing to recover from."""
    found = _first(text)
    return text if found is None else _plan(_control("recovery", found[0]) + found[1])


@_defect
def _recovery_holds_goal(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """The goal stands in the recovery, before its alternative."""
    found = _first(text)
    if found is None:
        return text
    return _plan(_control("recovery", found[0] + found[0]) + found[1])


@_defect
def _recovery_before_goal(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """The recovery stands before what it should guard."""
    found = _first(text)
    return text if found is None else _plan(_control("recovery", found[0]) + found[0] + found[1])


@_defect
def _goals_in_parallel(draw: DrawFn, text: str) -> str:
    """All goals are launched together."""
    word = draw(st.sampled_from(["parallel_all", "parallel_any"]))
    return _plan(_control(word, _inside(text))) if _OPEN in text else text


@_defect
def _rest_in_recovery(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """All that comes after the first step stands in its recovery."""
    found = _first(text)
    return text if found is None else _plan(found[0] + _control("recovery", found[1]))


@_defect
def _missing_attribute(draw: DrawFn, text: str) -> str:
    """A runner has no interface, or no provider."""
    return _replaced(draw, text, _ATTRIBUTE, "")


@_defect
def _misspelt_interface(draw: DrawFn, text: str) -> str:
    """The interface of a runner does not exist."""
    new = draw(st.sampled_from(["nav2_capabilities/MoveToRunner", "WaypointRunner", "Waypoint"]))
    return _replaced(draw, text, re.compile(r'(?<=<Runner interface=")[^"]*'), new)


@_defect
def _explicit_completion(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """The plan ends with the completion runner, which nobody has to write."""
    return _plan(f"{_inside(text)}  {_COMPLETION}\n") if _OPEN in text else text
