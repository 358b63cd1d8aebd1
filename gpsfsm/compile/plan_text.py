"""Text → plan, written as a plan or as a behaviour tree, or → machine.

How an original engine reads a text is ``compile/engine_text.py``.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.syntax import DEFAULT_LIMITS, Limits, Parsed, parse
from gpsfsm.syntax.source import read_source

if TYPE_CHECKING:
    from gpsfsm.compile.units import TreeMachine
    from gpsfsm.model.finding import Problem
    from gpsfsm.model.tree import Forest

_EXTRACTED = "GP115"
_LOST = "GP813"
_APPROXIMATED = "GP816"
_TOO_MUCH = "GP103"
_BEGINNING = 2_000


def read_plan_or_machine(
    text: str | bytes,
    *,
    file: str = "<text>",
    limits: Limits = DEFAULT_LIMITS,
    from_response: bool = False,
) -> Parsed:
    """Read a plan, a behaviour tree or a machine; never raises on bad input.

    A model's answer holds no machine: with ``from_response`` it is a plan or a behaviour tree.
    """
    machine = None if from_response else machine_in(text, file=file, limits=limits)
    if machine is not None:
        return machine
    return read_plan(text, file=file, limits=limits, from_response=from_response)


def machine_in(
    text: str | bytes, *, file: str = "<text>", limits: Limits = DEFAULT_LIMITS
) -> Parsed | None:
    """The machine in a text; None for a text that holds none, as most texts show at once."""
    begin = text[:_BEGINNING]
    if isinstance(begin, bytes):
        begin = begin.replace(b"\0", b"").decode("latin-1")
    if "{" not in begin and "<graphml" not in begin:
        return None
    from gpsfsm.compile.machine_files import read_machine  # loads networkx

    return read_machine(text, file=file, limits=limits)


def read_plan(
    text: str | bytes,
    *,
    file: str = "<text>",
    limits: Limits = DEFAULT_LIMITS,
    from_response: bool = False,
) -> Parsed:
    """Read a plan or a behaviour tree; never raises on bad input, but says what is wrong with it.

    A behaviour tree is told by its outermost element, ``<root>``. With ``from_response`` the text
    is a language model's raw answer; its last tree is taken if there is no plan in it.

    >>> tree = '<root BTCPP_format="4"><BehaviorTree><Go/></BehaviorTree></root>'
    >>> [element.interface for element in read_plan(tree).plan.runners]
    ['Go']
    """
    decoded = read_source(text, limits).text
    span = None if decoded is None else _span(decoded, from_response)
    if decoded is None or span is None:
        return parse(text, file=file, limits=limits, from_response=from_response)
    return _trees(decoded, file, limits, span)


def holds_trees(text: str, *, from_response: bool = False) -> bool:
    """True if ``read_plan`` takes the text for a behaviour tree."""
    return _span(text, from_response) is not None


def _span(text: str, from_response: bool) -> tuple[int, int] | None:
    """The span of the behaviour trees in a text; None if it is to be read as a plan."""
    if "<root" not in text and "<BehaviorTree" not in text:
        return None
    from gpsfsm.syntax.trees import cut_trees, is_trees

    if is_trees(text):
        return 0, len(text)
    return cut_trees(text) if from_response and "<Plan" not in text else None


def _trees(text: str, file: str, limits: Limits, span: tuple[int, int]) -> Parsed:
    from gpsfsm.compile.trees import unfold
    from gpsfsm.syntax.trees import read_trees

    start, end = span
    before = "".join(each if each in "\r\n" else " " for each in text[:start])
    read = read_trees(before + text[start:end], file, limits)
    collector = read.collector
    notes: tuple[str, ...] = ()
    if end - start < len(text):
        first, last = collector.location(start).line, collector.location(end - 1).line
        lines = f"line {first}" if first == last else f"lines {first} to {last}"
        note = f"took {lines} of the answer as the tree; left out: the rest"
        hint = "nothing to do, if that is the tree you mean"
        collector.add(_EXTRACTED, start, len("<root"), message=note, hint=hint, element="/root")
        notes = (note,)
    unfolded = None if read.forest is None else unfold(read.forest)
    problems: tuple[Problem, ...] = collector.problems()
    plan, over = None, read.over
    if unfolded is not None:
        plan, over = unfolded.plan, over or unfolded.over
        problems = tuple(sorted((*problems, *unfolded.problems), key=_place))
    lost = any(problem.rule == _LOST for problem in problems)
    plan = None if lost else plan
    if (lost or over) and read.forest is not None:
        plan, problems = _machine(read.forest, problems)
        lost = plan is None and any(problem.rule == _LOST for problem in problems)
        over = plan is None and over
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
    )


def _machine(
    forest: Forest, problems: tuple[Problem, ...]
) -> tuple[TreeMachine | None, tuple[Problem, ...]]:
    """The machine of a tree that is no plan, and what is to be said of it.

    Without a machine the tree is too large, or what is wrong with it has been reported.
    """
    from gpsfsm.compile.tree_machine import machine_of_tree
    from gpsfsm.model.finding import Problem

    machine = machine_of_tree(forest) if forest.main >= 0 else None
    others = tuple(problem for problem in problems if problem.rule not in (_LOST, _TOO_MUCH))
    if machine is None:
        return None, problems if any(each.rule == _TOO_MUCH for each in problems) else others
    places = machine.approximated
    if not places:
        return machine, others
    lines = list(dict.fromkeys(place.line for place in places))
    where = f"line {lines[0]}" if len(lines) == 1 else f"lines {', '.join(map(str, lines[:-1]))}"
    if len(lines) > 1:
        where += f" and {lines[-1]}"
    message = f"the automaton says more than this tree does, because of {where}"
    hint = "what it never does the tree never does; what it can do may need values that never occur"
    problem = Problem(_APPROXIMATED, message, places[0], hint)
    return machine, tuple(sorted((*others, problem), key=_place))


def _place(problem: Problem) -> tuple[int, int]:
    return problem.location.line, problem.location.column
