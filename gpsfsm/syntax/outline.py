"""GP104: what to say where the outermost element is not ``<Plan>``, or nothing is there."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.syntax.chars import SPACED_TAG, WHITE, clip
from gpsfsm.syntax.words import behavior_tree_root

if TYPE_CHECKING:
    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.tokens import StartTag

__all__ = ["OF_PLANS", "no_element", "other_root"]

OF_PLANS = re.compile(
    r"(?:<|&lt;)\s*/?\s*(?:[\w.-]+:)?(?:plan|control|runner|behaviou?r_?tree)", re.I
)
"""What looks like a part of a plan; a text without any of it may be anything."""

_RESPONSE = "if this is a model's answer, check it with --from-response"


def no_element(text: str, collector: Collector) -> None:
    """Report that ``text`` has no element at all."""
    start = len(text) - len(text.lstrip(WHITE))
    if start == len(text):
        message = "the text is empty: there is no <Plan>"
        collector.add("GP104", 0, 0, message=message, hint="a plan is written <Plan>…</Plan>")
        return
    message = "there is no <Plan> in this text, nor any other element"
    hint = "a plan is written <Plan>…</Plan>"
    if SPACED_TAG.match(text, start):
        hint = "remove the blanks after '<'"
    elif "&lt;Plan" in text:
        hint = "the plan is written with '&lt;' instead of '<': replace these"
    elif "```" in text or "<Plan" in text:
        hint = _RESPONSE
    collector.add("GP104", start, len(text) - start, message=message, hint=hint)


def other_root(text: str, tag: StartTag, inner_plan: int, collector: Collector) -> None:
    """Report an outermost element that is not ``<Plan>``.

    ``inner_plan`` is the offset of a ``<Plan>`` elsewhere in the text, -1 if there is none. Of a
    text in which nothing looks like a part of a plan, not even this name is shown.
    """
    names = [attribute.name for attribute in tag.attributes]
    trees = behavior_tree_root(tag.name, names)
    if not (trees or OF_PLANS.search(text)):
        message = "the outermost element is not <Plan>: a plan is one <Plan> element"
        hint = f"a plan is written <Plan>…</Plan>; {_RESPONSE}"
        collector.add("GP104", tag.start, 1, message=message, hint=hint)
        return
    name = clip(tag.name)
    message = f"the outermost element is <{name}>, but a plan is one <Plan> element"
    if tag.name.lower() == "plan":
        hint = "write <Plan>: names of elements are case-sensitive"
    elif inner_plan >= 0:
        line = collector.location(inner_plan).line
        hint = f"the <Plan> on line {line} must be outermost; {_RESPONSE}"
    elif tag.name in ("Control", "Runner"):
        hint = "put <Plan> before it and </Plan> after it"
    elif trees:
        message = (
            f"the outermost element is <{name}>: this is a BehaviorTree.CPP behaviour tree, "
            "not a plan"
        )
        hint = "a plan is written <Plan>…</Plan> with <Control> and <Runner> elements inside"
    else:
        hint = f"a plan is written <Plan>…</Plan>; {_RESPONSE}"
    length = 1 + len(tag.name)
    collector.add("GP104", tag.start, length, message=message, hint=hint, element=f"/{name}")
