"""Task files and what they say (docs/tasks.md). Imports pydantic and a YAML parser.

The shape of a file comes first, in pydantic; then what its parts mean: places, actions, steps,
examples, nodes and rules. A rule is a formula, or a Declare template, a formula by name: the
templates are those of Pesic and van der Aalst (2006), as LTLf formulas over events.
"""

from __future__ import annotations

import hashlib
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, cast

from pydantic import BeforeValidator, Field

from gpsfsm.capabilities.defects import Notes, errors_text, quoted
from gpsfsm.capabilities.defects import Place as Spot
from gpsfsm.capabilities.files import read_bytes
from gpsfsm.capabilities.reading import (
    FileModel,
    Items,
    ListOf,
    MappingOf,
    Number,
    Scalar,
    Some,
    Table,
    Text,
    kind_of,
    read_table,
    validate,
    wrong,
)
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.errors import ConfigError
from gpsfsm.model.tree import RESERVED
from gpsfsm.tasks.ltlf import MistakeError, atoms_of, parse_formula
from gpsfsm.tasks.task import DEFAULT_TOLERANCE, Example, NodeForm, Pattern, Place, Rule, Step, Task

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.capabilities.reading import Node
    from gpsfsm.model.plan import Value


def _action(node: object) -> object:
    """A name, or what an action looks like."""
    if isinstance(node, Table) or (isinstance(node, Scalar) and node.value is not None):
        return node
    raise wrong("the name of an action or place, or a mapping", node)


def _actions(node: object) -> object:
    """A list of actions; one stands for itself."""
    return list(map(_action, node)) if isinstance(node, Items) else [_action(node)]


Tables = MappingOf[Any]
Written = Annotated[Any, BeforeValidator(_action)]
Actions = Annotated[list[Any], BeforeValidator(_actions)]


class StepFile(FileModel):
    """An entry of ``steps``."""

    do: Written
    else_: Actions = Field(default_factory=list, alias="else")


class TaskFile(FileModel):
    """A task file."""

    task: Text = ""
    interface: Some = Field(default_factory=list)
    tolerance: Number | None = None
    places: Tables = Field(default_factory=dict)
    actions: Tables = Field(default_factory=dict)
    steps: ListOf[StepFile] = Field(default_factory=list)
    others: Text = "refused"
    allow: Actions = Field(default_factory=list)
    rules: ListOf[Tables] = Field(default_factory=list)
    not_answers: Some = Field(default_factory=list)
    nodes: Tables = Field(default_factory=dict)


_ROUNDS = 5
_MAX_STEPS = 2_000
_MAX_RULES = 200
_MAX_INTERFACES = 50
_MAX_EXAMPLES = 20


def load_task(file: str | Path) -> Task:
    """Load a task file; paths in it are relative to its folder.

    Raises ConfigError, with one line for each defect, if the file is invalid.
    """
    notes = Notes(str(file), kind="task")
    content = read_bytes(str(file), notes)
    if content is None:
        raise ConfigError(errors_text(notes))
    return read_task(content, file=str(file))


def read_task(content: bytes, *, file: str = "<task>") -> Task:
    """The task that the content of a file describes. Raises ConfigError like ``load_task``."""
    notes = Notes(file, kind="task")
    table = read_table(content, notes)
    model = None
    for _ in range(_ROUNDS if table is not None else 0):  # each notes what is wrong, and drops it
        model = model or validate(TaskFile, cast("Table", table), notes)
    if model is None:
        raise ConfigError(errors_text(notes))
    task = _Reader(model, notes).task()
    if notes.defects:
        raise ConfigError(errors_text(notes))
    return replace(task, sha256=hashlib.sha256(content).hexdigest())


class _Reader:
    """Makes a task of what a file holds, and notes what makes no sense."""

    def __init__(self, model: TaskFile, notes: Notes) -> None:
        self._model = model
        self._notes = notes
        self._tolerance = self._positive(model)
        self._interfaces = self._globs(model.interface, model.at("interface"))
        self._places: dict[str, Place] = {}
        self._actions: dict[str, Pattern] = {}
        self._patterns: dict[str, Pattern] = {}

    def task(self) -> Task:
        """The whole task."""
        model, notes = self._model, self._notes
        for name, node in model.places.items():
            self._places[name] = Place(name, self._values(name, node))
        for name, node in model.actions.items():
            if name in self._places:
                message = f"{quoted(name)} is both a place and an action"
                notes.error(model.below("actions", name), message, "give one of them another name")
            elif not isinstance(node, Table):
                message = f"the action {quoted(name)} must be a mapping, not {kind_of(node)}"
                notes.error(
                    model.below("actions", name), message, "write interface, x, y, … below it"
                )
            else:
                self._actions[name] = self._described(node, name)
        steps = tuple(map(self._step, model.steps[:_MAX_STEPS]))
        if len(model.steps) > _MAX_STEPS:
            notes.error(model.at("steps"), f"the task has more than {_MAX_STEPS} steps")
        rules = self._rules()
        if not steps and not rules and not notes.defects:
            hint = "say what to do below 'steps', or what must hold below 'rules'"
            notes.error((1, 1), "the task asks for nothing", hint)
        if model.others not in ("allowed", "refused"):
            message = f"'others' must be allowed or refused, not {quoted(model.others)}"
            notes.error(model.at("others"), message)
        return Task(
            text=model.task,
            steps=steps,
            rules=rules,
            allowed=tuple(self._pattern(node) for node in model.allow),
            others=model.others == "allowed" or not steps,
            patterns=tuple(self._patterns.values()),
            not_answers=self._examples(),
            nodes=nodes_of(model, notes),
            file=notes.file,
        )

    def _positive(self, model: TaskFile) -> float:
        tolerance = DEFAULT_TOLERANCE if model.tolerance is None else model.tolerance
        if tolerance < 0:
            self._notes.error(model.at("tolerance"), f"'tolerance' is negative: {tolerance:g}")
        return tolerance

    def _globs(self, globs: list[str], place: tuple[int, int]) -> tuple[str, ...]:
        if len(globs) > _MAX_INTERFACES:
            self._notes.error(place, f"there are more than {_MAX_INTERFACES} interfaces here")
        for glob in globs:
            if not glob or len(glob) > 200:
                self._notes.error(place, f"{quoted(glob)} is not an interface")
        return tuple(globs[:_MAX_INTERFACES])

    def _values(self, name: str, node: object) -> tuple[tuple[str, Value], ...]:
        """The parameters of a place."""
        place = self._model.below("places", name)
        if not isinstance(node, Table):
            message = f"the place {quoted(name)} must be a mapping, not {kind_of(node)}"
            self._notes.error(place, message, "write {x: 2.0, y: -0.5} behind it")
            return ()
        return tuple((key, self._value(key, value, node)) for key, value in node.items())

    def _value(self, key: str, node: object, table: Table) -> Value:
        where = table.places.get(key, table.place)
        if not isinstance(node, Scalar) or node.value is None:
            message = f"{quoted(key)} must be a text, a number, true or false, not {kind_of(node)}"
            self._notes.error(where, message)
            return ""
        value = node.value
        if isinstance(value, float) and not math.isfinite(value):
            self._notes.error(where, f"{quoted(key)} must be a finite number")
        return value

    def _step(self, model: StepFile) -> Step:
        return Step((self._pattern(model.do), *(self._pattern(one) for one in model.else_)))

    def _pattern(self, node: object) -> Pattern:
        if isinstance(node, Table):
            return self._described(node, "")
        assert isinstance(node, Scalar)
        return self._named(node.text, node.place)

    def _named(self, name: str, where: tuple[int, int]) -> Pattern:
        """The action of this name, or being at the place of this name."""
        pattern = self._actions.get(name) or self._patterns.get(name)
        if pattern is None:
            pattern = Pattern(name, self._interfaces, (), self._place(name, where), self._tolerance)
        return self._patterns.setdefault(name, pattern)

    def _place(self, name: str, where: tuple[int, int]) -> Place | None:
        if name in self._places:
            return self._places[name]
        candidates = [*self._places, *self._actions]
        hint = self._notes.near(name, candidates) or "describe it below 'places' or 'actions'"
        self._notes.error(where, f"there is no place or action {quoted(name)}", hint)
        return None

    def _described(self, table: Table, name: str) -> Pattern:
        """An action that is described where it is used, or below ``actions``."""
        interfaces, place, tolerance = self._interfaces, None, self._tolerance
        parameters: list[tuple[str, Value]] = []
        for key, node in table.items():
            where = table.places[key]
            if key == "interface":
                globs = node if isinstance(node, list) else [node]
                texts = [one.text for one in globs if isinstance(one, Scalar)]
                if len(texts) != len(globs):
                    self._notes.error(where, "'interface' must be a text or a list of texts")
                interfaces = self._globs(texts, where)
            elif key == "place" and isinstance(node, Scalar):
                place = self._place(node.text, where)
            elif key == "tolerance":
                value = self._value(key, node, table)
                if isinstance(value, int | float) and not isinstance(value, bool) and value >= 0:
                    tolerance = float(value)
                else:
                    self._notes.error(where, "'tolerance' must be a number that is not negative")
            else:
                parameters.append((key, self._value(key, node, table)))
        if not table:
            self._notes.error(table.place, "this action says nothing", "write interface, x, y, …")
        shown = name or _name_of(interfaces, place, parameters)
        return Pattern(shown, interfaces, tuple(parameters), place, tolerance)

    def _rules(self) -> tuple[Rule, ...]:
        nodes = self._model.rules
        if len(nodes) > _MAX_RULES:
            message = f"the task has more than {_MAX_RULES} rules"
            self._notes.error(self._model.at("rules"), message)
        for name in self._actions:
            self._patterns.setdefault(name, self._actions[name])
        rules = [rule_of(node, self._notes, self._named) for node in self._tables("rules")]
        return tuple(rule for rule in rules if rule is not None)

    def _tables(self, key: str) -> list[Table]:
        node = self._model._table.get(key)
        items = node[:_MAX_RULES] if isinstance(node, list) else []
        return [one for one in items if isinstance(one, Table)]

    def _examples(self) -> tuple[Example, ...]:
        """The plans that are no answers; their files are found from that of the task."""
        place = self._model.at("not_answers")
        examples: list[Example] = []
        for name in self._model.not_answers[:_MAX_EXAMPLES]:
            file = str(Path(self._notes.file).parent / name)
            theirs = Notes(file, kind="plan")
            content = read_bytes(file, theirs)
            if content is None:
                self._notes.error(place, f"{quoted(name)}: {theirs.defects[0].message}")
                continue
            parsed = read_plan(content, file=file)
            if parsed.plan is None or parsed.over_limit:
                message = f"{quoted(name)} cannot be read as a plan"
                self._notes.error(place, message, f"'gpsfsm check {name}' says why")
            else:
                examples.append(Example(name, parsed.plan))
        if len(self._model.not_answers) > _MAX_EXAMPLES:
            self._notes.error(place, f"there are more than {_MAX_EXAMPLES} plans here")
        return tuple(examples)


def _name_of(
    interfaces: tuple[str, ...], place: Place | None, parameters: list[tuple[str, Value]]
) -> str:
    """The name in messages of an action that has none."""
    words = [f"{name}={value}" for name, value in parameters]
    if place is not None:
        words.insert(0, place.name)
    interface = interfaces[0].rpartition("/")[2] if interfaces else ""
    if interface and words:
        return f"{interface} ({', '.join(words)})"
    return interface or ", ".join(words)


_NAME = re.compile(r"[^\W\d]\w{0,99}")
_FORMS = ("compact", "any")
_MAX_NODES = 1_000
_MAX_PORTS = 100
_PORTS = "the ports must be a name or a list of names"


def nodes_of(model: TaskFile, notes: Notes) -> tuple[NodeForm, ...]:
    """The nodes by their order; what makes no sense is noted and left out."""
    forms = []
    if len(model.nodes) > _MAX_NODES:
        notes.error(model.at("nodes"), f"there are more than {_MAX_NODES} nodes here")
    for name, node in list(model.nodes.items())[:_MAX_NODES]:
        place = model.below("nodes", name)
        if not _NAME.fullmatch(name):
            notes.error(place, f"{quoted(name)} is not a name for a node")
        elif name in RESERVED:
            notes.error(place, f"{quoted(name)} is a built-in node", "leave it out here")
        else:
            forms.append(_form(name, node, place, notes))
    return tuple(forms)


def _form(name: str, node: object, place: Spot, notes: Notes) -> NodeForm:
    """A node: its ports, or a mapping with ``ports`` and ``form``."""
    if not isinstance(node, Table):
        return NodeForm(name, _ports(node, place, notes))
    for key in node:
        if key not in ("ports", "form"):
            hint = "the keys are ports and form"
            notes.error(node.places[key], f"{quoted(key)} is not a key of a node", hint)
    form = node.get("form")
    text = form.text if isinstance(form, Scalar) else ""
    if form is not None and text not in _FORMS:
        notes.error(node.places["form"], "'form' must be compact or any")
    ports = node.get("ports", Items(place))
    where = node.places.get("ports", place)
    return NodeForm(name, _ports(ports, where, notes), text == "compact")


def _ports(node: object, place: Spot, notes: Notes) -> tuple[str, ...]:
    items = node if isinstance(node, Items) else [node]
    texts = [item.text for item in items if isinstance(item, Scalar) and item.value is not None]
    if len(texts) != len(items):
        notes.error(place, _PORTS, "" if isinstance(node, Items) else f"it is {kind_of(node)}")
    elif len(texts) > _MAX_PORTS:
        notes.error(place, f"there are more than {_MAX_PORTS} ports here")
    for text in texts[:_MAX_PORTS]:
        if not _NAME.fullmatch(text):
            notes.error(place, f"{quoted(text)} is not a name for a port")
    return tuple(texts[:_MAX_PORTS])


After = Literal["start", "success", "failure"]
AFTER: tuple[After, ...] = ("start", "success", "failure")

COUNTED = ("existence", "absence", "exactly")
"""Templates on one action that take ``times``."""

UNARY = {
    "init": "!start(*) W {a}",
    "last": "G (start(*) -> ({a} | X F (start(*) | {a})))",
}
"""Templates on one action."""

_PRECEDENCE = "(!{b} W {a})"
_RESPONSE = "G ({a} -> F {b})"
_ALTERNATE_RESPONSE = "G ({a} -> X (!{a} U {b}))"
_ALTERNATE_PRECEDENCE = "((!{b} W {a}) & G ({b} -> WX (!{b} W {a})))"
_CHAIN_RESPONSE = "G ({a} -> X (!start(*) U {b}))"
_CHAIN_PRECEDENCE = (
    "((!{b} W (start(*) & !{b})) & G ((start(*) & !{A}) -> WX (!start(*) W (start(*) & !{b})))"
    " & G ({A} -> ({a} | WX (!{b} W ({a} | (start(*) & !{b}))))))"
)

BINARY = {
    "responded_existence": "F {a} -> F {b}",
    "coexistence": "F {a} <-> F {b}",
    "response": _RESPONSE,
    "precedence": _PRECEDENCE,
    "succession": f"{_RESPONSE} & {_PRECEDENCE}",
    "alternate_response": _ALTERNATE_RESPONSE,
    "alternate_precedence": _ALTERNATE_PRECEDENCE,
    "alternate_succession": f"{_ALTERNATE_RESPONSE} & {_ALTERNATE_PRECEDENCE}",
    "chain_response": _CHAIN_RESPONSE,
    "chain_precedence": _CHAIN_PRECEDENCE,
    "chain_succession": f"{_CHAIN_RESPONSE} & {_CHAIN_PRECEDENCE}",
    "not_coexistence": "!(F {a} & F {b})",
    "not_succession": "G ({a} -> WX G !{b})",
    "not_chain_succession": "G ({a} -> WX (!start(*) W (start(*) & !{b})))",
}
"""Templates on two actions."""

_EVENTS: dict[After, str] = {"start": "start", "success": "succeeds", "failure": "fails"}


def formula_text(
    template: str, names: tuple[str, ...], *, after: After = "start", times: int = 1
) -> str:
    """The formula of a template, as text. ``names`` hold no quotation marks.

    >>> formula_text("precedence", ("A", "B"), after="success")
    '(!start("B") W succeeds("A"))'
    """
    first = f'"{names[0]}"'
    event = f"{_EVENTS[after]}({first})"
    if template in COUNTED:
        if template == "exactly":
            return f"{_times(event, times)} & !({_times(event, times + 1)})"
        text = _times(event, times)
        return text if template == "existence" else f"!({text})"
    pattern = UNARY[template] if template in UNARY else BINARY[template]
    text = pattern.replace("{a}", event).replace("{A}", f"start({first})")
    return text.replace("{b}", f'start("{names[-1]}")')


def _times(event: str, times: int) -> str:
    """At least so often."""
    text = f"F {event}"
    for _ in range(times - 1):
        text = f"F ({event} & X {text})"
    return text if times else "true"


_TEMPLATES = (*COUNTED, *UNARY, *BINARY)
_MAX_TIMES = 20
_KEYS = ("name", "after", "times", "runs")

_Named = "Callable[[str, Spot], Pattern]"


def rule_of(table: Table, notes: Notes, named: Callable[[str, Spot], Pattern]) -> Rule | None:
    """The rule that an entry of ``rules`` stands for; None, with errors noted, if for none.

    ``named`` gives the pattern of a name and notes names that mean nothing.
    """
    before = len(notes.defects)
    kinds = [key for key in table if key == "ltlf" or key in _TEMPLATES]
    for key in table:
        if key not in (*_KEYS, "ltlf", *_TEMPLATES):
            every = ", ".join(("ltlf", *_TEMPLATES))
            hint = notes.near(key, (*_KEYS, "ltlf", *_TEMPLATES)) or f"the rules are: {every}"
            notes.error(table.places[key], f"there is no rule {quoted(key)}", hint)
    if len(kinds) != 1:
        if len(notes.defects) == before:
            hint = "write one such as 'precedence: [A, B]' or 'ltlf: …'"
            notes.error(table.place, "an entry of 'rules' must hold exactly one rule", hint)
        return None
    kind = kinds[0]
    entry = _Entry(table, notes)
    completed = entry.choice("runs", ("all", "completed")) == "completed"
    name = entry.text("name")
    if kind == "ltlf":
        entry.unused("after", "times", kind=kind)
        text = entry.text("ltlf")
        phrase = text
        place = table["ltlf"].place
    else:
        text, phrase = _declare(kind, entry, named)
        place = table.places[kind]
    if len(notes.defects) > before:
        return None
    if completed:
        text = f"F completes -> ({text})"
    try:
        formula = parse_formula(text)
    except MistakeError as mistake:
        at = f", at character {mistake.position + 1}" if kind == "ltlf" and not completed else ""
        notes.error(place, f"the formula does not parse{at}: {mistake.message}", mistake.hint)
        return None
    if kind == "ltlf":
        for atom in sorted(atoms_of(formula), key=lambda one: (one.name, one.happening)):
            if atom.name not in ("", "*"):
                named(atom.name, place)
    return Rule(name or phrase, phrase, formula, completed, place[0])


def _declare(kind: str, entry: _Entry, named: Callable[[str, Spot], Pattern]) -> tuple[str, str]:
    """The formula of a template, and the rule as it reads."""
    after = cast("After", entry.choice("after", AFTER))
    times = entry.times() if kind in COUNTED else 1
    if kind not in COUNTED:
        entry.unused("times", kind=kind)
    names = entry.names(kind, 2 if kind in BINARY else 1)
    for name, place in names:
        named(name, place)
    words = [quoted(name) for name, _ in names]
    phrase = f"{kind.replace('_', ' ')} of {' and '.join(words)}"
    if times != 1:
        phrase += f", {times} times"
    if after != "start":
        phrase += f", after {after}"
    if not names:
        return "true", phrase
    return formula_text(kind, tuple(name for name, _ in names), after=after, times=times), phrase


class _Entry:
    """One entry; its methods note what is wrong and return something of the right kind."""

    def __init__(self, table: Table, notes: Notes) -> None:
        self._table, self._notes = table, notes

    def text(self, key: str) -> str:
        """A text; "" if there is none."""
        node = self._table.get(key)
        if node is None:
            return ""
        if isinstance(node, Scalar) and node.value is not None:
            return node.text
        self._wrong(key, "a text", node)
        return ""

    def choice(self, key: str, choices: tuple[str, ...]) -> str:
        """One of a few words; the first is the default."""
        word = self.text(key)
        if word and word not in choices:
            message = f"'{key}' must be {' or '.join(choices)}, not {quoted(word)}"
            self._notes.error(self._table.places[key], message)
        return word if word in choices else choices[0]

    def times(self) -> int:
        """A small number."""
        node = self._table.get("times")
        if node is None:
            return 1
        value = node.value if isinstance(node, Scalar) else None
        if isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= _MAX_TIMES:
            return value
        self._wrong("times", f"a whole number from 1 to {_MAX_TIMES}", node)
        return 1

    def names(self, key: str, number: int) -> list[tuple[str, Spot]]:
        """So many names of actions."""
        node = self._table[key]
        items = node if isinstance(node, Items) else [node]
        texts = [one for one in items if isinstance(one, Scalar) and one.value is not None]
        if len(texts) != len(items) or len(items) != number:
            what = "the name of an action" if number == 1 else "the names of two actions: [A, B]"
            self._wrong(key, what, node)
            return []
        entries = [(one.text, one.place) for one in texts]
        for name, place in entries:
            if '"' in name:
                self._notes.error(
                    place, f"a name in a rule holds no quotation marks: {quoted(name)}"
                )
        return entries

    def unused(self, *keys: str, kind: str) -> None:
        """Keys that say nothing about this kind of rule."""
        for key in keys:
            if key in self._table:
                self._notes.error(self._table.places[key], f"'{key}' has no effect with '{kind}'")

    def _wrong(self, key: str, expected: str, node: Node) -> None:
        message = f"'{key}' must be {expected}, not {kind_of(node)}"
        self._notes.error(self._table.places[key], message)
