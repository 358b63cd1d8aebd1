"""Behaviour trees as answers: what is wrong with the file, and what it means (docs/tasks.md)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import rule
from gpsfsm.compile.trees import unfold
from gpsfsm.model.finding import Problem, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.tree import NodeModel, PortKind
from gpsfsm.reading import holds_trees
from gpsfsm.syntax import DEFAULT_LIMITS, Limits
from gpsfsm.syntax.trees import last_root, read_trees
from gpsfsm.tasks.place_names import PlaceNames
from gpsfsm.tasks.tree_gist import tree_gist_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.plan import Plan
    from gpsfsm.model.tree import Forest, TreeNode
    from gpsfsm.tasks.task import NodeForm, Task

__all__ = ["TreeAnswer", "holds_tree_answer", "read_tree_answer"]

_UNDEFINED, _MAIN, _RESERVED, _UNKNOWN, _LOST = "GP801", "GP802", "GP804", "GP812", "GP813"
_NAMES = (_UNDEFINED, _RESERVED, _LOST)
"""What is no fault: how trees are called, trees of other files, and what no automaton expresses."""
_OVER = "GP103"


@dataclass(frozen=True, slots=True)
class TreeAnswer:
    """What an answer with behaviour trees comes to.

    ``faults`` are what makes the syntax wrong; None: there is no file of trees in it. ``plan`` is
    what the main tree means; None if it means nothing, and ``why`` says so. ``gist``: it is read
    by its gist. ``over``: a limit ended the reading.
    """

    faults: tuple[Problem, ...] | None
    plan: Plan | None
    why: str = ""
    gist: bool = False
    over: bool = False


def holds_tree_answer(text: str) -> bool:
    """Whether an answer is to be read as behaviour trees and not as a plan."""
    if "<Plan" in text:
        return holds_trees(text, from_response=True)
    return "<root" in text or holds_trees(text, from_response=True)


def read_tree_answer(
    text: str, file: str, task: Task, limits: Limits = DEFAULT_LIMITS
) -> TreeAnswer:
    """Read the last ``<root>…</root>`` of an answer; never raises for anything that is in it."""
    span = last_root(text)
    if span is None:
        return TreeAnswer(None, None, "there is no whole <root>…</root> in it")
    start, end = span
    before = "".join(each if each in "\r\n" else " " for each in text[:start])
    whole = before + text[start:end]
    read = read_trees(whole, file, limits, _models(task))
    problems = read.collector.problems()
    over = [one for one in problems if one.rule == _OVER]
    if over:
        return TreeAnswer(tuple(over), None, over[0].message, over=True)
    forest = read.forest
    faults = [one for one in problems if _is_fault(one, forest, task)]
    faults += () if forest is None else _misused(forest, task)
    faults.sort(key=lambda one: (one.location.line, one.location.column))
    if not faults and forest is not None:
        unfolded = unfold(forest)
        if unfolded.over:
            return TreeAnswer((), None, unfolded.problems[0].message, over=True)
        if not any(one.rule == _LOST for one in (*problems, *unfolded.problems)):
            return TreeAnswer(unfolded.problems, unfolded.plan, _missing(problems))
        faults += [one for one in unfolded.problems if one.rule != _LOST]
    plan = tree_gist_of(whole, PlaceNames(task), file)
    return TreeAnswer(tuple(faults), plan, "it is meant to drive nowhere", gist=True)


def _models(task: Task) -> dict[str, NodeModel] | None:
    """The nodes of the task, for the reader; None if the task names none."""
    found = {
        node.name: NodeModel("Action", dict.fromkeys(node.ports, PortKind.INPUT), 0)
        for node in task.nodes
    }
    return found or None


def _is_fault(problem: Problem, forest: Forest | None, task: Task) -> bool:
    if problem.rule in _NAMES:
        return False
    if problem.rule == _MAIN:
        return forest is None or forest.main < 0
    if problem.rule == _UNKNOWN:
        return bool(task.nodes)
    return rule(problem.rule).severity is Severity.ERROR


def _misused(forest: Forest, task: Task) -> Iterator[Problem]:
    """Nodes of the task that are written in a form that it does not have."""
    told = {node.name: node for node in task.nodes}
    for node in forest.nodes:
        name = node.text("ID") if node.tag in ("SubTree", "SubTreePlus") else node.identity
        form = told.get(name)
        if form is None or "/BehaviorTree[" not in node.path:
            continue
        message = _mistake(node, form)
        if message:
            place = Location(node.line, node.column, node.path)
            yield Problem(_UNKNOWN, message, place)


def _mistake(node: TreeNode, form: NodeForm) -> str:
    if node.tag in ("SubTree", "SubTreePlus"):
        return f"{form.name} is a node of the task, not a tree"
    if node.explicit and form.compact:
        return f"the task has the node <{form.name}>, not <{node.tag} ID=…>"
    if node.explicit and node.tag != "Action":
        return f"{form.name} is an Action, not a {node.tag}"
    return ""


def _missing(problems: tuple[Problem, ...]) -> str:
    """Why there is no plan although nothing is wrong with the file."""
    undefined = next((one.message for one in problems if one.rule == _UNDEFINED), "")
    return undefined or "the tree that runs cannot be known"
