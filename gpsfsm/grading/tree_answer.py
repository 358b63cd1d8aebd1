"""Behaviour trees as answers: what is wrong with the file, and what it means (docs/tasks.md).

Where the syntax is wrong, or where no automaton expresses the tree, the gist is read: where it is
meant to drive, however it is written. Only grades rest on that. A reader puts the trees in that the
main tree uses; the words of a node say whether it drives, and places of the task are recognised
however they are written: ``BayA``, ``go_to_bay_a``.
"""

from __future__ import annotations

import re
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules import rule
from gpsfsm.compile.plan_text import holds_trees
from gpsfsm.compile.trees import unfold
from gpsfsm.grading.gist import (
    GAP,
    LABELS,
    NUMBER,
    Element,
    Kind,
    Part,
    Reader,
    elements_of,
    held,
    plain_name,
    plan_lines,
)
from gpsfsm.model.finding import Problem, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.tree import BUILTINS, Meaning, NodeModel, PortKind
from gpsfsm.syntax import DEFAULT_LIMITS, Limits, parse
from gpsfsm.syntax.trees import last_root, read_trees

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.model.plan import Plan
    from gpsfsm.model.tree import Forest, TreeNode
    from gpsfsm.tasks.task import NodeForm, Pattern, Task

_UNDEFINED, _MAIN, _RESERVED, _UNKNOWN, _LOST = "GP801", "GP802", "GP804", "GP812", "GP813"
_NAMES = (_UNDEFINED, _RESERVED, _LOST)
"""What is no fault: how trees are called, trees of other files, and what no automaton expresses."""
_OVER = "GP103"


@dataclass(frozen=True, slots=True)
class TreeAnswer:
    """The outcome of reading an answer with behaviour trees.

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
    """True if an answer is to be read as behaviour trees and not as a plan."""
    if "<Plan" in text:
        return holds_trees(text, from_response=True)
    return "<root" in text or holds_trees(text, from_response=True)


def read_tree_answer(
    text: str, file: str, task: Task, limits: Limits = DEFAULT_LIMITS
) -> TreeAnswer:
    """Read the last ``<root>…</root>`` of an answer; never raises for anything that is in it."""
    span = last_root(text)
    if span is None:
        return TreeAnswer(None, None, "there is no complete <root>…</root> in it")
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
    models = {
        node.name: NodeModel("Action", dict.fromkeys(node.ports, PortKind.INPUT), 0)
        for node in task.nodes
    }
    return models or None


def _is_fault(problem: Problem, forest: Forest | None, task: Task) -> bool:
    if problem.rule in _NAMES:
        return False
    if problem.rule == _MAIN:
        return forest is None or forest.main < 0
    if problem.rule == _UNKNOWN:
        return bool(task.nodes)
    return (problem.severity or rule(problem.rule).severity) is Severity.ERROR


def _misused(forest: Forest, task: Task) -> Iterator[Problem]:
    """Nodes of the task that are written in a form that it does not have."""
    forms = {node.name: node for node in task.nodes}
    for node in forest.nodes:
        name = node.text("ID") if node.tag in ("SubTree", "SubTreePlus") else node.identity
        form = forms.get(name)
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
        return f"the task writes this node as <{form.name}>, not as <{node.tag} ID=…>"
    if node.explicit and node.tag != "Action":
        return f"{form.name} is an Action, not a {node.tag}"
    return ""


def _missing(problems: tuple[Problem, ...]) -> str:
    """The reason for which there is no plan although nothing is wrong with the file."""
    undefined = next((one.message for one in problems if one.rule == _UNDEFINED), "")
    return undefined or "the tree that runs cannot be known"


_MAX_PARTS = 5_000
_FALLBACK = re.compile(r"(?i:fallback|selector|^priority)")
_BRANCH = re.compile(r"^(?i:IfThenElse|WhileDoElse|If|IfElse)$")
_PARALLEL = re.compile(r"^(?i:Parallel)")
_NOT_RUN = ("TreeNodesModel", "BehaviorTree", "include", "Metadata")
_UNNAMED = "?"
_ASKS = re.compile(
    r"(?i:check|condition|reachable|reached|visited|available)"
    r"|^(?i:is|has|can|if|find|get|read|compute|calculate|plan|look|query|detect)(?![a-z])"
)
_TELLS = re.compile(
    r"^(?i:set|unset|clear|update|write|log|print|say|speak|report|notify|announce|wait|sleep"
    r"|delay|stop|cancel|script|always|init|initialize|start|end)(?![a-z])"
)
_MOVES = re.compile(
    r"^(?i:nav2?_?)?(?i:move|go|goto|drive|navigate|navigation|visit|travel)(?![a-z])"
)
_ELSE = re.compile(r"(?i:fallback|alternative|backup|otherwise|else|on_?fail|unreachable)")
_FOR_FAILURE = re.compile(r"(?i:on_?fail|if_?fail|else|otherwise|alternative|backup)")
_NUMBERS = re.compile(rf"[\s(\[{{]*+({NUMBER}){GAP}({NUMBER})(?:{GAP}{NUMBER})*+[\s)\]}}]*+")
_HOPS = 5


def tree_gist_of(text: str, places: PlaceNames, file: str = "<text>") -> Plan | None:
    """The plan that a text of behaviour trees means; None if it is meant to drive nowhere.

    A drive to a place of the task has the parameter ``place`` with its name, any other drive has
    ``place="?"``. The lines of the plan are those of the text.

    >>> from gpsfsm.tasks.load import read_task
    >>> from gpsfsm.grading.tree_answer import PlaceNames
    >>> places = PlaceNames(read_task(b"{places: {Bay: {}}, steps: [{do: Bay}]}"))
    >>> tree = '<root><BehaviorTree><Drive goal="{bay}"/></BehaviorTree></root>'
    >>> [runner.parameters for runner in tree_gist_of(tree, places).runners]
    [{'place': 'Bay'}]
    """
    lines = plan_lines(_TreeReader(elements_of(text), places).read())
    plan = parse("\n".join(line for line, _ in lines), file=file).plan if lines else None
    if plan is None:
        return None
    elements = (replace(each, line=lines[each.line - 1][1], column=1) for each in plan.elements)
    return replace(plan, elements=tuple(elements))


class _TreeReader(Reader):
    """Reads the tree that runs, with the trees that it uses put in."""

    def __init__(self, whole: Element, places: PlaceNames) -> None:
        self.places = places
        self.words = Words(places)
        self.left = _MAX_PARTS
        roots = [each for each in whole.descendants() if each.tag == "root"]
        self.root = roots[-1] if roots else whole
        self.trees: dict[str, Element] = {}
        self.tops = [each for each in self.root.descendants() if each.tag == "BehaviorTree"]
        for top in self.tops:
            self.trees.setdefault(top.attributes.get("ID", ""), top)

    def read(self) -> tuple[Part, ...]:
        """The parts of the tree that runs; none, if they are too many."""
        parts = self.children(self._main(), 0)
        return parts if self.left > 0 else ()

    def _main(self) -> Element:
        """The tree that is named, or else the first that no other one uses, or else the first."""
        named = self.trees.get(self.root.attributes.get("main_tree_to_execute", ""))
        if named is not None or not self.tops:
            return named or self.root
        used = {self._tree(each) for top in self.tops for each in top.descendants()}
        free = [top for top in self.tops if top.attributes.get("ID", "") not in used]
        return (free or self.tops)[0]

    def _tree(self, element: Element) -> str | None:
        """The ID of the tree that an element stands for."""
        name = element.tag
        if name in ("SubTree", "SubTreePlus"):
            name = element.attributes.get("ID", "")
        return name if name and name in self.trees else None

    def part(self, element: Element, depth: int) -> tuple[Part, ...]:
        """A tree that is used, a control that holds drives, or a leaf."""
        self.left -= 1
        if self.left <= 0 or element.tag in _NOT_RUN:
            return ()
        tree = self._tree(element)
        if tree is not None:
            with self.words.inside(element):
                parts = self.children(self.trees[tree], depth + 1)
            if parts or not self.words.moves(element):
                return self._called(element, parts)
        if element.children:
            parts = self._control(element, depth)
            if parts and all(map(self.words.is_else, element.children)):
                return _instead(self._leaf(element), parts)
            if parts or self.words.is_control(element):
                return self._called(element, parts)
        return self._leaf(element)

    def _control(self, element: Element, depth: int) -> tuple[Part, ...]:
        name = element.identity
        if _FALLBACK.search(name) or _BRANCH.match(name):  # the question of a branch is left out
            guard = self.alternatives(element, Kind.GUARD, depth)
            return (Part(Kind.SEQUENCE, guard),) if guard else ()
        if _PARALLEL.match(name):
            return self.alternatives(element, Kind.ALL, depth)
        inner = self.children(element, depth + 1)
        return (Part(Kind.SEQUENCE, inner),) if inner else ()

    def _leaf(self, element: Element) -> tuple[Part, ...]:
        first, other = self.words.drives(element)
        parts = self._drives(first, element)
        return _instead(parts, self._drives(other, element)) if other else parts

    def _called(self, element: Element, parts: tuple[Part, ...]) -> tuple[Part, ...]:
        """Drives to places that nothing names, in an element that names one: they go there."""
        if not parts or any(place != _UNNAMED for place in _places(parts)):
            return parts
        named = self.words.named(element)
        return self._drives(named, element) if len(named) == 1 else parts

    def _drives(self, names: tuple[str, ...], element: Element) -> tuple[Part, ...]:
        written = [
            (("interface", self.places.interface(at)), ("place", at or _UNNAMED)) for at in names
        ]
        return tuple(Part(Kind.DRIVE, attributes=each, line=element.line) for each in written)


def _instead(first: tuple[Part, ...], other: tuple[Part, ...]) -> tuple[Part, ...]:
    """The first parts, guarded by the others."""
    guard = held(Kind.GUARD, (first, other))
    return (Part(Kind.SEQUENCE, guard),) if guard else ()


def _places(parts: tuple[Part, ...]) -> list[str]:
    """The places of all drives."""
    names: list[str] = []
    pending = list(reversed(parts))
    while pending:
        part = pending.pop()
        names += [value for name, value in part.attributes if name == "place"]
        pending.extend(reversed(part.parts))
    return names


class Words:
    """Reads nodes in the order in which they run, since some of them say what others mean.

    ``values`` is what the blackboard is known to hold, ``defined`` where a place is by what the
    tree itself says; ``open`` are the places that were named and to which nothing has driven yet.
    """

    def __init__(self, places: PlaceNames) -> None:
        self.places = places
        self.values: dict[str, str] = {}
        self.open: list[str] = []
        self.defined: dict[tuple[float, float], str] = {}

    @contextmanager
    def inside(self, subtree: Element) -> Iterator[None]:
        """Inside of a SubTree its ports are known as well."""
        around = self.values
        ports = {
            name: self._value(value)
            for name, value in subtree.attributes.items()
            if name and name not in LABELS
        }
        self.values = {**around, **ports}
        try:
            yield
        finally:
            self.values = around

    def is_else(self, element: Element) -> bool:
        """True if an element says by its name that it is for a failure."""
        return _FOR_FAILURE.match(element.tag) is not None

    def is_control(self, element: Element) -> bool:
        """True if it is a built-in node that says nothing but how others are run."""
        builtin = BUILTINS.get(element.identity)
        return builtin is not None and builtin.most != 0

    def named(self, element: Element) -> tuple[str, ...]:
        """The places that an element names: in its values, or else in its labels and its text."""
        return self._in_values(element) or self._in_labels(element)

    def moves(self, element: Element) -> bool:
        """True if an element says by its name that it drives somewhere."""
        name = element.identity
        if element.tag in ("SubTree", "SubTreePlus"):
            name = element.attributes.get("ID", "")
        alike = (one.rpartition("/")[2].lower() for one in self.places.interfaces)
        return _MOVES.search(name) is not None or any(one in name.lower() for one in alike)

    def drives(self, element: Element) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """The places to which a leaf drives, and if that fails; "" is a place that is not known."""
        name = element.identity
        builtin = BUILTINS.get(name)
        if name.startswith("Set"):
            if not self._define(element):
                self._ask(element)
            return (), ()
        if builtin is not None and builtin.meaning is not Meaning.SUBTREE:
            return (), ()
        if builtin is None and (element.tag == "Condition" or _ASKS.search(name)):
            self._ask(element)
            return (), ()
        if builtin is None and _TELLS.search(name):
            return (), ()
        drives = self._in_values(element) or self._by_numbers(element) or self._in_labels(element)
        if not drives and self.moves(element):
            drives = tuple(self.open[:1]) or ("",)
        self.open = [place for place in self.open if place not in drives]
        return drives, self._instead(element) if drives else ()

    def _value(self, text: str) -> str:
        """A text, or what the blackboard holds below the key that it names."""
        for _ in range(_HOPS):
            name = _key(text) or text.strip()
            if name not in self.values or self.values[name] == text:
                break
            text = self.values[name]
        return text

    def _ports(self, element: Element) -> list[tuple[str, str]]:
        return [
            (name, value)
            for name, value in element.attributes.items()
            if name not in LABELS and not name.startswith("_")
        ]

    def _in_values(self, element: Element) -> tuple[str, ...]:
        """The places of the first port that names some, by itself or by what its key holds."""
        ports = [(name, value) for name, value in self._ports(element) if not _ELSE.search(name)]
        broken = [(name, value) for name, value in ports if not name]
        for _, value in broken or ports:
            place = self.places.named(value) or self.places.named(self._value(value))
            if place:
                return place
        return ()

    def _in_labels(self, element: Element) -> tuple[str, ...]:
        labels = [element.text, *(element.attributes.get(name, "") for name in LABELS)]
        for text in (*labels, element.tag):
            place = self.places.named(text)
            if place:
                return place
        return ()

    def _instead(self, element: Element) -> tuple[str, ...]:
        for name, value in self._ports(element):
            if _ELSE.search(name):
                return self.places.named(value)
        return ()

    def _by_numbers(self, element: Element) -> tuple[str, ...]:
        """The place with the coordinates of a leaf, as the tree or as the task has it."""
        ports = dict(self._ports(element))
        pairs = [(ports.get("x", ""), ports.get("y", "")), *map(_pair, ports.values())]
        for x, y in pairs:
            if re.fullmatch(NUMBER, x.strip()) and re.fullmatch(NUMBER, y.strip()):
                at = float(x), float(y)
                place = self.defined.get(at) or self.places.at(*at)
                if place:
                    return (place,)
        return ()

    def _ask(self, element: Element) -> None:
        """A question: what it answers, below its keys or not, is about the places it names."""
        named = self.named(element)
        self._name(named)
        for _, value in self._ports(element) if named else ():
            key = _key(value)
            if key and not self.places.named(value):
                self.values[key] = " ".join(named)

    def _define(self, element: Element) -> bool:
        """Take in what a SetBlackboard says; False if it does not name a key."""
        attributes = element.attributes
        key = attributes.get("output_key", "") or attributes.get("key", "")
        key = _key(key) or key
        self.values[key] = attributes.get("value", "")
        named = self.places.named(key)
        x, y = _pair(self.values[key])
        if len(named) == 1 and x:
            self.defined[float(x), float(y)] = named[0]
        self._name(named)
        return bool(key)

    def _name(self, places: tuple[str, ...]) -> None:
        self.open += [place for place in places if place not in self.open]


def _key(text: str) -> str:
    """The key of the blackboard that ``{key}`` or ``${key}`` names; "" if it is no such text."""
    text = text.strip().removeprefix("$")
    inner = text[1:-1]
    braced = text[:1] == "{" and text[-1:] == "}" and "{" not in inner and "}" not in inner
    return inner.strip(" \t\r\n=") if braced else ""


def _pair(text: str) -> tuple[str, str]:
    """The first two of the numbers that a text consists of; two empty texts if it does not."""
    match = _NUMBERS.fullmatch(text[:200])
    return (match[1], match[2]) if match else ("", "")


_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|[0-9]+|[^\W_]+")
_BEFORE = r"(?:(?<![A-Za-z0-9])|(?<=[a-z])(?=[A-Z]))"
_AFTER = r"(?:(?![A-Za-z0-9])|(?=[A-Z][a-z])|(?<=[a-z0-9])(?=[A-Z]))"
_MAX_TEXT = 2_000


class PlaceNames:
    """The places that the steps of a task, what it allows and its rules speak of.

    >>> from gpsfsm.tasks.load import read_task
    >>> task = read_task(b"{places: {BayA: {}, BayB: {}}, steps: [{do: BayA, else: BayB}]}")
    >>> PlaceNames(task).named("go_to_bay_a; {BayB} bayer")
    ('BayA', 'BayB')
    """

    def __init__(self, task: Task) -> None:
        self.patterns: dict[str, Pattern] = {}
        self.nodes = tuple(node.name for node in task.nodes)
        self.interfaces: list[str] = []
        for pattern in _patterns(task):
            self.interfaces += [one for one in map(plain_name, pattern.interfaces) if one]
            if pattern.place is not None:
                self.patterns.setdefault(pattern.place.name, pattern)
        longest = sorted(self.patterns, key=lambda name: (-len(name), name))
        self._names = {_folded(name): name for name in longest}
        words = (r"[\s_-]*".join(map(re.escape, _WORD.findall(name))) for name in longest)
        any_word = "|".join(f"(?i:{word})" for word in words if word)
        self._any = re.compile(f"{_BEFORE}(?:{any_word}){_AFTER}") if any_word else None

    def named(self, text: str) -> tuple[str, ...]:
        """The places that a text names, in its order; one named twice in a row counts once."""
        names: list[str] = []
        for match in self._any.finditer(text[:_MAX_TEXT]) if self._any else ():
            name = self._names.get(_folded(match[0]))
            if name is not None and names[-1:] != [name]:
                names.append(name)
        return tuple(names)

    def at(self, x: float, y: float) -> str:
        """The place with these coordinates, "" if there is none."""
        for name, pattern in self.patterns.items():
            assert pattern.place is not None
            values = dict(pattern.place.parameters)
            if set(values) == {"x", "y"} and all(
                isinstance(value, int | float) and abs(value - written) <= pattern.tolerance
                for value, written in ((values["x"], x), (values["y"], y))
            ):
                return name
        return ""

    def interface(self, place: str) -> str:
        """An interface that the task accepts for a drive to this place: a node, if there is one."""
        pattern = self.patterns.get(place)
        globs = pattern.interfaces if pattern is not None else ()
        node = next((one for one in self.nodes for glob in globs if fnmatchcase(one, glob)), "")
        plain = plain_name(globs[0] if globs else "")
        return node or plain or next(iter((*self.nodes, *self.interfaces)), "Drive")


def _patterns(task: Task) -> Iterator[Pattern]:
    for step in task.steps:
        yield from step.attempts
    yield from task.allowed
    yield from task.patterns


def _folded(name: str) -> str:
    return re.sub(r"[\W_]+", "", name).lower()
