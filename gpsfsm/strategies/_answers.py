"""Answers of language models, with the defects that real ones have.

A defect is wrong words or structure in a plan, broken markup, or text around it.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import IntEnum
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.strategies._plans import plans

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from hypothesis.strategies import DrawFn, SearchStrategy


class Stage(IntEnum):
    """When a defect is put in: what is wrong with the plan comes first, what is around it last."""

    PLAN = 0
    MARKUP = 1
    AROUND = 2
    INSTEAD = 3


@dataclass(frozen=True, slots=True)
class Defect:
    """One defect: ``summary`` says what it is; ``put`` puts it into a text.

    ``put`` gives the text unchanged if it has no place for this defect.
    """

    name: str
    summary: str
    stage: Stage
    put: Callable[[DrawFn, str], str]


def listing(stage: Stage) -> tuple[list[Defect], Callable[[Callable[[DrawFn, str], str]], None]]:
    """A list, and a decorator that adds functions to it; names and docstrings say the rest."""
    defects: list[Defect] = []

    def add(put: Callable[[DrawFn, str], str]) -> None:
        name = put.__name__.strip("_").replace("_", "-")
        defects.append(Defect(name, (put.__doc__ or "").strip(), stage, put))

    return defects, add


_RUNNER = re.compile(r"[ \t]*<Runner\b[^>]*/>")
_CONTROL = re.compile(r'<Control type="(\w+)"')
_NAMED_TYPE = re.compile(r' (interface|provider)="[^"]*"')
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


def _one(draw: DrawFn, matches: Sequence[re.Match[str]]) -> re.Match[str] | None:
    return matches[draw(st.integers(0, len(matches) - 1))] if matches else None


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
    attributes = draw(st.sampled_from(['ID="MainTree"', 'BTCPP_format="4"']))
    return text.replace("<Plan>", f"<Plan {attributes}>", 1)


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
    packed = draw(st.sampled_from(['coordinates="(1.0, 2.0)"', 'x="1.0, 2.0"', 'goal="1.0,2.0"']))
    name = "nav2_capabilities/WaypointRunner"
    return _replaced(
        draw, text, _RUNNER, f'  <Runner interface="{name}" provider="{name}" {packed}/>'
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
    attribute = draw(
        st.sampled_from([' success_count="1"', ' num_attempts="3"', ' interface="Retry"'])
    )
    return text[: match.end()] + attribute + text[match.end() :]


@_defect
def _empty_control(draw: DrawFn, text: str) -> str:
    """There is a control with nothing in it."""
    word = draw(st.sampled_from(["sequential", "recovery", "parallel_any", "parallel_all"]))
    return _plan(f'{_inside(text)}  <Control type="{word}"/>\n') if _OPEN in text else text


@_defect
def _recovery_first(_draw: DrawFn, text: str) -> str:
    """The first child of the plan is put into a recovery, which has nothing to recover from."""
    recovery = _first(text)
    return text if recovery is None else _plan(_control("recovery", recovery[0]) + recovery[1])


@_defect
def _recovery_holds_goal(_draw: DrawFn, text: str) -> str:
    """The goal stands in the recovery, before its alternative."""
    recovery = _first(text)
    if recovery is None:
        return text
    return _plan(_control("recovery", recovery[0] + recovery[0]) + recovery[1])


@_defect
def _recovery_before_goal(_draw: DrawFn, text: str) -> str:
    """The recovery stands before what it should guard."""
    recovery = _first(text)
    return (
        text
        if recovery is None
        else _plan(_control("recovery", recovery[0]) + recovery[0] + recovery[1])
    )


@_defect
def _goals_in_parallel(draw: DrawFn, text: str) -> str:
    """All goals are launched together."""
    word = draw(st.sampled_from(["parallel_all", "parallel_any"]))
    return _plan(_control(word, _inside(text))) if _OPEN in text else text


@_defect
def _rest_in_recovery(_draw: DrawFn, text: str) -> str:
    """All that comes after the first step stands in its recovery."""
    recovery = _first(text)
    return text if recovery is None else _plan(recovery[0] + _control("recovery", recovery[1]))


@_defect
def _missing_attribute(draw: DrawFn, text: str) -> str:
    """A runner has no interface, or no provider."""
    return _replaced(draw, text, _NAMED_TYPE, "")


@_defect
def _misspelt_interface(draw: DrawFn, text: str) -> str:
    """The interface of a runner does not exist."""
    new = draw(st.sampled_from(["nav2_capabilities/MoveToRunner", "WaypointRunner", "Waypoint"]))
    return _replaced(draw, text, re.compile(r'(?<=<Runner interface=")[^"]*'), new)


@_defect
def _explicit_completion(_draw: DrawFn, text: str) -> str:
    """The plan ends with the completion runner, which nobody has to write."""
    return _plan(f"{_inside(text)}  {_COMPLETION}\n") if _OPEN in text else text


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
    matches = list(pattern.finditer(text))
    return matches[draw(st.integers(0, len(matches) - 1))] if matches else None


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
def _missing_root(_draw: DrawFn, text: str) -> str:
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
def _empty(draw: DrawFn, _text: str) -> str:
    """The answer is empty."""
    return draw(st.sampled_from(["", "\n"]))


@_instead
def _prose_only(draw: DrawFn, _text: str) -> str:
    """There is no plan in the answer."""
    return draw(st.sampled_from(_REFUSALS))


@_instead
def _behaviour_tree(_draw: DrawFn, _text: str) -> str:
    """The answer is a behaviour tree."""
    return _TREE


_DEFECTS = {defect.name: defect for defect in (*OF_PLANS, *OF_MARKUP, *AROUND, *INSTEAD)}

DEFECTS: dict[str, str] = {name: defect.summary for name, defect in _DEFECTS.items()}
"""What can be wrong with an answer, by name."""


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer: its text, the plan that was meant, and the names of its defects."""

    text: str
    plan: str
    defects: tuple[str, ...]


def answers(
    plan: SearchStrategy[str] | None = None,
    *,
    defects: Sequence[str] = tuple(DEFECTS),
    min_defects: int = 0,
    max_defects: int = 3,
) -> SearchStrategy[Answer]:
    r"""Draw an answer that was to be a plan, with some of these defects (names of ``DEFECTS``).

    ``plan`` draws the text of the plan that is meant. Every defect that ``Answer.defects`` names
    changes the text. Shrinks to an answer that is a plan and nothing else. Raises ValueError for a
    defect that does not exist.

    >>> from hypothesis import find, settings, strategies as st
    >>> simple = st.just("<Plan>\n  <Runner/>\n</Plan>\n")
    >>> fenced = answers(simple, defects=("fence", "plan-attributes"), min_defects=2)
    >>> print(find(fenced, lambda answer: True, settings=settings(database=None)).text)
    ```xml
    <Plan ID="MainTree">
      <Runner/>
    </Plan>
    ```
    <BLANKLINE>
    """
    for name in defects:
        if name not in _DEFECTS:
            raise ValueError(f"there is no defect '{name}'; the defects are {', '.join(DEFECTS)}")
    meant = plans(max_runners=5) if plan is None else plan
    return _answers(meant, tuple(defects), min_defects, max_defects)


@st.composite
def _answers(
    draw: DrawFn,
    plan: SearchStrategy[str],
    defects: tuple[str, ...],
    min_defects: int,
    max_defects: int,
) -> Answer:
    meant = text = draw(plan)
    names = st.lists(
        st.sampled_from(defects), unique=True, min_size=min_defects, max_size=max_defects
    )
    # a stable order: what is wrong with the plan first, what is around it last
    wanted = sorted(draw(names) if defects else [], key=[*_DEFECTS].index)
    present: list[str] = []
    for name in wanted:
        changed = _DEFECTS[name].put(draw, text)
        if changed != text:
            text = changed
            present.append(name)
    return Answer(text, meant, tuple(present))
