"""Answers that are no well-formed XML, that are more than a plan, or that hold none."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.strategies._defect import Stage, listing

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn

__all__ = ["AROUND", "INSTEAD", "OF_MARKUP"]

_END_TAG = re.compile(r"</\w+>")
_START_TAG = re.compile(r"<(?=[A-Z])")
_ATTRIBUTE = re.compile(r' (\w+)="([^"]*)"')
_BEFORE = ("Sure! Here is the plan:\n\n", "The plan is as follows.\n\n", "Plan: ")
_AFTER = (
    "\nThis plan sends the robot to each place in turn.\n",
    "\nNote: the coordinates are <x, y> in metres.\n",
    "\nLet me know if you need anything else.",
)
_REFUSALS = (
    "I am sorry, but I cannot write this plan.",
    "Note: the robot should go to the lab first, and then to the office.",
)
_TREE = """<root BTCPP_format="4" main_tree_to_execute="MainTree">
  <BehaviorTree ID="MainTree">
    <Sequence>
      <MoveTo location="lab"/>
    </Sequence>
  </BehaviorTree>
</root>
"""

OF_MARKUP, _markup = listing(Stage.MARKUP)
AROUND, _around = listing(Stage.AROUND)
INSTEAD, _instead = listing(Stage.INSTEAD)


def _place(draw: DrawFn, text: str, pattern: re.Pattern[str]) -> re.Match[str] | None:
    found = list(pattern.finditer(text))
    return found[draw(st.integers(0, len(found) - 1))] if found else None


@_markup
def _truncated(draw: DrawFn, text: str) -> str:
    """The answer ends before the plan does."""
    end = text.rfind("</")
    return text if end < 1 else text[: draw(st.integers(min(5, end), end))]


@_markup
def _missing_close(draw: DrawFn, text: str) -> str:
    """An end tag is missing."""
    match = _place(draw, text, _END_TAG)
    return text if match is None else text[: match.start()] + text[match.end() :]


@_markup
def _mismatched_tag(draw: DrawFn, text: str) -> str:
    """An end tag has another name than its start tag."""
    match = _place(draw, text, _END_TAG)
    if match is None:
        return text
    other = draw(st.sampled_from(["</plan>", "</Sequence>", "</Controls>"]))
    return text[: match.start()] + other + text[match.end() :]


@_markup
def _duplicated_attribute(draw: DrawFn, text: str) -> str:
    """A tag has the same attribute twice."""
    match = _place(draw, text, _ATTRIBUTE)
    return text if match is None else text[: match.end()] + match[0] + text[match.end() :]


@_markup
def _unquoted_attribute(draw: DrawFn, text: str) -> str:
    """The value of an attribute has no quotes."""
    match = _place(draw, text, _ATTRIBUTE)
    if match is None:
        return text
    return f"{text[: match.start()]} {match[1]}={match[2]}{text[match.end() :]}"


@_markup
def _doubled_equals(draw: DrawFn, text: str) -> str:
    """An attribute is written with two equals signs."""
    match = _place(draw, text, _ATTRIBUTE)
    if match is None:
        return text
    return f'{text[: match.start()]} {match[1]}=="{match[2]}"{text[match.end() :]}'


@_markup
def _space_in_tag(draw: DrawFn, text: str) -> str:
    """There is a space between ``<`` and the name of an element."""
    match = _place(draw, text, _START_TAG)
    return text if match is None else f"{text[: match.end()]} {text[match.end() :]}"


@_markup
def _entity(draw: DrawFn, text: str) -> str:
    """A text holds an ampersand, or an entity that XML does not know."""
    match = _place(draw, text, _ATTRIBUTE)
    if match is None:
        return text
    bad = draw(st.sampled_from(["&", "&nbsp;", "R&D"]))
    return text[: match.end() - 1] + bad + text[match.end() - 1 :]


@_markup
def _missing_root(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """There is no element around the steps."""
    return text.replace("<Plan>\n", "", 1).replace("</Plan>\n", "", 1)


@_around
def _declaration(draw: DrawFn, text: str) -> str:
    """An XML declaration comes first, which is no mistake."""
    encoding = draw(st.sampled_from(['encoding="UTF-8"', 'encoding="utf-8"']))
    return f'<?xml version="1.0" {encoding}?>\n{text}'


@_around
def _several_plans(draw: DrawFn, text: str) -> str:
    """A draft comes before the answer; the last plan counts."""
    between = draw(st.sampled_from(["\n", "\nThe improved plan:\n\n"]))
    return f"<Plan>\n</Plan>\n{between}{text}"


@_around
def _fence(draw: DrawFn, text: str) -> str:
    """The plan is fenced as in Markdown."""
    return f"```{draw(st.sampled_from(['xml', '', 'XML']))}\n{text.rstrip()}\n```\n"


@_around
def _prose_before(draw: DrawFn, text: str) -> str:
    """A sentence comes before the plan."""
    return draw(st.sampled_from(_BEFORE)) + text


@_around
def _prose_after(draw: DrawFn, text: str) -> str:
    """A sentence comes after the plan."""
    return text + draw(st.sampled_from(_AFTER))


@_instead
def _empty(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """The answer is empty."""
    return draw(st.sampled_from(["", "\n"]))


@_instead
def _prose_only(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """There is no plan in the answer."""
    return draw(st.sampled_from(_REFUSALS))


@_instead
def _behaviour_tree(draw: DrawFn, text: str) -> str:  # noqa: ARG001
    """The answer is a behaviour tree."""
    return _TREE
