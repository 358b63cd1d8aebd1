"""Text → plan, written as a plan or as a behaviour tree, or → machine.

How an original engine reads a text is ``compile/engine_text.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.finding import Problem
from gpsfsm.model.plan import Location
from gpsfsm.syntax import DEFAULT_LIMITS, Limits, Parsed, parse
from gpsfsm.syntax.source import read_source
from gpsfsm.syntax.text import is_json, root_name
from gpsfsm.syntax.tree import OF_PLANS

if TYPE_CHECKING:
    from gpsfsm.compile.units import TreeMachine, TreePlan
    from gpsfsm.model.tree import Forest
    from gpsfsm.syntax.trees import Includes

_EXTRACTED = "GP115"
_LOST = "GP813"
_OF_ALL_FILES = ("GP801", "GP802")
_PLANS = ("", "Plan", "Control", "Runner", "root", "BehaviorTree")
_BUILDERS = {
    "langgraph": (
        "this Python builds a LangGraph graph, which gpsfsm does not run",
        "write its JSON and check that: json.dump(graph.get_graph().to_json(), file)",
    ),
    "yasmin": (
        "this Python builds a YASMIN state machine; of YASMIN, gpsfsm reads only XML",
        "write the machine as the XML that YASMIN's factory loads and its editor saves",
    ),
    "py_trees": (
        "this Python builds a tree of py_trees, which gpsfsm does not run",
        "write the tree as XML of BehaviorTree.CPP, and check that",
    ),
}
"""Packages whose Python is not read: what it is, and what can be checked instead."""
_UNREAD = {
    ".py": "this Python imports neither flexbe_core nor smach, so it builds no machine to be read",
    ".ipynb": "this is a notebook, and gpsfsm does not run its Python",
    ".json": 'this JSON is no machine: it lacks "nodes" or "edges"',
    ".yaml": "this is YAML, in which there are no plans, trees or machines",
    ".yml": "this is YAML, in which there are no plans, trees or machines",
    ".mdl": "this is a model of Simulink, which gpsfsm does not read",
}
"""Kinds of files, by the ends of their names, that hold nothing that can be checked."""
_READ = "docs/machines.md and docs/behaviour-trees.md list what gpsfsm reads"


def read_plan_or_machine(
    text: str | bytes,
    *,
    file: str = "<text>",
    limits: Limits = DEFAULT_LIMITS,
    from_response: bool = False,
    includes: Includes | None = None,
) -> Parsed:
    """Read a plan, a behaviour tree or a machine; never raises on bad input.

    A model's answer holds no machine: with ``from_response`` it is a plan or a behaviour tree.
    ``includes`` are the files that a behaviour tree includes, if it is itself a file.
    """
    machine = None if from_response else machine_in(text, file=file, limits=limits)
    if machine is not None:
        return machine
    return read_plan(text, file=file, limits=limits, from_response=from_response, includes=includes)


def machine_in(
    text: str | bytes, *, file: str = "<text>", limits: Limits = DEFAULT_LIMITS
) -> Parsed | None:
    """The machine in a text; None for a text that holds none, as most texts show at once."""
    decoded = read_source(text, limits).text
    if decoded is None:
        return None
    python, json = file.endswith(".py"), is_json(decoded)
    root = "" if python or json else root_name(decoded).rpartition(":")[2]
    if json or root == "graphml":
        from gpsfsm.compile.machine_files import read_machine  # loads networkx

        machine = read_machine(decoded, file=file, limits=limits)
        if machine is not None:
            return machine
    if python or json or root not in _PLANS:
        from gpsfsm.compile.formats import format_of

        chosen = format_of(decoded, file)
        if chosen is not None and chosen.read is not None:
            plan, problems = chosen.read(decoded, file, limits)
            return Parsed(file, decoded, plan, problems, machine=True)
    return _unread(decoded, file, json=json)


def _unread(text: str, file: str, *, json: bool) -> Parsed | None:
    """The sentence about a text of a kind that holds nothing to be checked; None for others."""
    ending = file[file.rfind(".") :].lower()
    if (ending not in _UNREAD and not json) or OF_PLANS.search(text):
        return None
    message, hint = _UNREAD.get(ending, _UNREAD[".json"]), _READ
    if ending == ".py":
        from gpsfsm.compile.formats.python_values import imports

        builder = next((each for each in _BUILDERS if imports(text, each)), None)
        message, hint = (message, hint) if builder is None else _BUILDERS[builder]
    problem = Problem("GP104", message, Location(1, 1), hint)
    return Parsed(file, text, None, (problem,), foreign=True)


def read_plan(
    text: str | bytes,
    *,
    file: str = "<text>",
    limits: Limits = DEFAULT_LIMITS,
    from_response: bool = False,
    includes: Includes | None = None,
) -> Parsed:
    """Read a plan or a behaviour tree; never raises on bad input, but says what is wrong with it.

    A behaviour tree is told by its outermost element, ``<root>``. With ``from_response`` the text
    is a language model's raw answer; its last tree is taken if there is no plan in it. An answer
    includes no files: only without it do ``includes`` count.

    >>> tree = '<root BTCPP_format="4"><BehaviorTree><Go/></BehaviorTree></root>'
    >>> [element.interface for element in read_plan(tree).plan.runners]
    ['Go']
    """
    decoded = read_source(text, limits).text
    span = None if decoded is None else _span(decoded, from_response)
    if decoded is None or span is None:
        return parse(text, file=file, limits=limits, from_response=from_response)
    return _trees(decoded, file, limits, span, None if from_response else includes)


def holds_trees(text: str, *, from_response: bool = False) -> bool:
    """True if ``read_plan`` takes the text for a behaviour tree."""
    return _span(text, from_response) is not None


def forest_in(
    text: str | bytes, *, limits: Limits = DEFAULT_LIMITS, from_response: bool = False
) -> Forest | None:
    """The behaviour trees that ``read_plan`` takes a text for; None if it holds none."""
    decoded = read_source(text, limits).text
    span = None if decoded is None else _span(decoded, from_response)
    if decoded is None or span is None:
        return None
    from gpsfsm.syntax.trees import read_trees

    return read_trees(_only(decoded, span), "<text>", limits).forest


def _only(text: str, span: tuple[int, int]) -> str:
    """A part of a text in its place, with blanks before it."""
    start, end = span
    return "".join(each if each in "\r\n" else " " for each in text[:start]) + text[start:end]


def _span(text: str, from_response: bool) -> tuple[int, int] | None:
    """The span of the behaviour trees in a text; None if it is to be read as a plan."""
    if "<root" not in text and "<BehaviorTree" not in text:
        return None
    from gpsfsm.syntax.trees import cut_trees, is_trees

    if is_trees(text, alone=from_response):
        return 0, len(text)
    return cut_trees(text) if from_response and "<Plan" not in text else None


def _trees(
    text: str, file: str, limits: Limits, span: tuple[int, int], includes: Includes | None
) -> Parsed:
    from gpsfsm.compile.tree_scripts import unread
    from gpsfsm.syntax.trees import read_trees

    start, end = span
    read = read_trees(_only(text, span), file, limits, includes=includes)
    collector = read.collector
    notes = () if includes is None else includes.notes
    if end - start < len(text):
        first, last = collector.location(start).line, collector.location(end - 1).line
        lines = f"line {first}" if first == last else f"lines {first} to {last}"
        note = f"took {lines} of the answer as the tree; left out: the rest"
        hint = "nothing to do if that is the tree you mean"
        collector.add(_EXTRACTED, start, len("<root"), message=note, hint=hint, element="/root")
        notes = (*notes, note)
    problems = collector.problems()
    plan, over = None, read.over
    lost = any(problem.rule == _LOST for problem in problems)
    if lost:  # a tree that is in no file may be in one that was not read
        problems = tuple(each for each in problems if each.rule not in _OF_ALL_FILES)
    if read.forest is not None and not lost:
        plan, more, beyond = _meaning(read.forest)
        over = over or beyond
        problems = tuple(sorted((*problems, *more), key=_place_order))
    return Parsed(
        file,
        text,
        plan,
        problems,
        read.suppressions,
        (*notes, *collector.notes()),
        over_limit=over,
        trees=True,
        lost=lost,
        included={} if includes is None else includes.texts,
        forest=read.forest,
        approximations=() if read.forest is None else tuple(unread(read.forest, read.texts)),
    )


def _meaning(forest: Forest) -> tuple[TreePlan | TreeMachine | None, tuple[Problem, ...], bool]:
    """The plan that a forest stands for, else its machine; what is wrong; whether it is too large.

    Without both of them and without a problem, what is wrong has been reported.
    """
    from gpsfsm.compile.trees import unfold

    unfolded = unfold(forest)
    lost = any(problem.rule == _LOST for problem in unfolded.problems)
    if unfolded.plan is not None or not (lost or unfolded.over):
        return unfolded.plan, unfolded.problems, unfolded.over
    from gpsfsm.compile.tree_machine import machine_of_tree

    machine = machine_of_tree(forest)
    if machine is not None:
        return machine, (), False
    others = (each for each in unfolded.problems if unfolded.over or each.rule != _LOST)
    return None, tuple(others), unfolded.over


def _place_order(problem: Problem) -> tuple[str, int, int]:
    return problem.location.order
