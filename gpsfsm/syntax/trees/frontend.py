"""The front end of behaviour trees as one function, and how such a text is told from a plan."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.syntax.chars import ILLEGAL, WHITE
from gpsfsm.syntax.collector import Collector
from gpsfsm.syntax.limits import DEFAULT_LIMITS, Limits
from gpsfsm.syntax.lines import Lines
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.trees.checks import TreeRules
from gpsfsm.syntax.trees.models import models_of
from gpsfsm.syntax.trees.reader import TreeReader
from gpsfsm.syntax.wellformed import DEEPEST, well_formedness_fault

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.model.tree import Forest, NodeModel
    from gpsfsm.syntax.suppress import Suppression

__all__ = ["ReadTrees", "cut_trees", "is_trees", "last_root", "read_trees"]

_FIRST = re.compile(
    rf"(?:[{WHITE}\ufeff]++|<\?(?:[^?]++|\?(?!>))*+\?>|<!--(?:[^-]++|-(?!->))*+-->)*+"
    r"<(root|BehaviorTree)(?=[\s/>])"
)
_SIGNS = ("<BehaviorTree", "BTCPP_format", "main_tree_to_execute")
_ROOT = re.compile(r"<root(?=[\s/>])|</root\s*+>")


@dataclass(frozen=True, slots=True)
class ReadTrees:
    """What is known of a text of behaviour trees.

    ``forest`` is None where the trees cannot be known. ``over`` tells that a limit ended the
    reading. ``collector`` takes what the compiler finds wrong, too.
    """

    forest: Forest | None
    collector: Collector
    suppressions: tuple[Suppression, ...]
    over: bool


def is_trees(text: str) -> bool:
    """Whether a text is a file of behaviour trees and not a plan.

    >>> is_trees('<root BTCPP_format="4"/>'), is_trees("<Plan/>"), is_trees("<root/>")
    (True, False, False)
    """
    return _FIRST.match(text) is not None and any(sign in text for sign in _SIGNS)


def last_root(text: str) -> tuple[int, int] | None:
    """Where the last whole ``<root>…</root>`` of a text is.

    >>> answer = "Here: <root><Go/></root> Done."
    >>> start, end = last_root(answer)
    >>> answer[start:end]
    '<root><Go/></root>'
    """
    found: tuple[int, int] | None = None
    start = -1
    for match in _ROOT.finditer(text):
        if not match[0].startswith("</"):
            start = match.start()
        elif start >= 0:
            found, start = (start, match.end()), -1
    return found


def cut_trees(text: str) -> tuple[int, int] | None:
    """Where the last ``<root>…</root>`` of a language model's answer is, if it holds trees.

    >>> cut_trees("Here: <root><BehaviorTree/></root> Done."), cut_trees("<root><Go/></root>")
    ((6, 34), None)
    """
    found = last_root(text)
    return found if found and is_trees(text[found[0] : found[1]]) else None


def read_trees(
    text: str,
    file: str,
    limits: Limits = DEFAULT_LIMITS,
    known: Mapping[str, NodeModel] | None = None,
) -> ReadTrees:
    """Read decoded text; never raises on bad input, but tells the collector what is wrong.

    ``known`` are the nodes that there are besides the built-in ones, whatever the text says in a
    TreeNodesModel.
    """
    collector = Collector(Lines(text), limits.max_problems)
    illegal = ILLEGAL.search(text)
    if illegal:
        collector.add(
            "GP116",
            illegal.start(),
            1,
            message=f"the text holds the character U+{ord(illegal[0]):04X}; XML does not allow it",
            hint="remove it",
        )
    body = ILLEGAL.sub(" ", text) if illegal else text
    reader = TreeReader(body, limits, collector)
    nodes = reader.read(scan(body, limits))
    broken = reader.broken or reader.over or illegal is not None
    if not broken and reader.deepest <= DEEPEST:
        fault = well_formedness_fault(body)
        if fault is not None:
            line, column, (_, length, message, hint, rule) = fault
            offset = collector.lines.offset(line, column)
            collector.add(rule, offset, length, message=message, hint=hint)
            broken = True
    suppressions = tuple(reader.suppressions)
    if reader.over or reader.fatal or not nodes:
        return ReadTrees(None, collector, suppressions, reader.over)
    described = models_of(nodes, collector)
    models = described if known is None else known
    forest = TreeRules(nodes, file, models, collector).forest()
    return ReadTrees(forest, collector, suppressions, over=False)
