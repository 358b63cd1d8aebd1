"""Reading task files (docs/tasks.md). Imports pydantic and a YAML parser."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, cast

from gpsfsm.capabilities.defects import Notes, quoted
from gpsfsm.capabilities.files import read_bytes
from gpsfsm.capabilities.reading import Scalar, Table, kind_of, read_table
from gpsfsm.capabilities.validate import validate
from gpsfsm.errors import ConfigError
from gpsfsm.reading import read_plan
from gpsfsm.tasks.load_nodes import nodes_of
from gpsfsm.tasks.load_rules import rule_of
from gpsfsm.tasks.schema import TaskFile
from gpsfsm.tasks.task import DEFAULT_TOLERANCE, Example, Pattern, Place, Rule, Step, Task

if TYPE_CHECKING:
    from gpsfsm.model.plan import Value
    from gpsfsm.tasks.schema import StepFile

__all__ = ["load_task", "read_task"]

_MAX_SHOWN = 20
_ROUNDS = 5
_MAX_STEPS = 2_000
_MAX_RULES = 200
_MAX_INTERFACES = 50
_MAX_EXAMPLES = 20


def load_task(file: str | Path) -> Task:
    """The task that a file describes; the files it names are found from its folder.

    Raises ConfigError, with a line for each defect, if anything is wrong with the file.
    """
    notes = Notes(str(file), kind="task")
    content = read_bytes(str(file), notes)
    if content is None:
        raise ConfigError(_told(notes))
    return read_task(content, file=str(file))


def read_task(content: bytes, *, file: str = "<task>") -> Task:
    """The task that the content of a file describes. Raises ConfigError like ``load_task``."""
    notes = Notes(file, kind="task")
    table = read_table(content, notes)
    model = None
    for _ in range(_ROUNDS if table is not None else 0):  # each notes what is wrong, and drops it
        model = model or validate(TaskFile, cast("Table", table), notes)
    if model is None:
        raise ConfigError(_told(notes))
    task = _Reader(model, notes).task()
    if notes.defects:
        raise ConfigError(_told(notes))
    return task


def _told(notes: Notes) -> str:
    shown = sorted(notes.defects, key=lambda defect: defect.order)
    lines = [f"{one.told}\n    {one.hint}" if one.hint else one.told for one in shown[:_MAX_SHOWN]]
    if len(shown) > _MAX_SHOWN:
        lines.append(f"and {len(shown) - _MAX_SHOWN} more")
    return "\n".join(line.replace(": warning: ", ": error: ", 1) for line in dict.fromkeys(lines))


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
        found = DEFAULT_TOLERANCE if model.tolerance is None else model.tolerance
        if found < 0:
            self._notes.error(model.at("tolerance"), f"'tolerance' is negative: {found:g}")
        return found

    def _globs(self, globs: list[str], place: tuple[int, int]) -> tuple[str, ...]:
        if len(globs) > _MAX_INTERFACES:
            self._notes.error(place, f"there are more than {_MAX_INTERFACES} interfaces here")
        for glob in globs:
            if not glob or len(glob) > 200:
                self._notes.error(place, f"{quoted(glob)} is no interface")
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
        found = self._actions.get(name) or self._patterns.get(name)
        if found is None:
            found = Pattern(name, self._interfaces, (), self._place(name, where), self._tolerance)
        return self._patterns.setdefault(name, found)

    def _place(self, name: str, where: tuple[int, int]) -> Place | None:
        if name in self._places:
            return self._places[name]
        known = [*self._places, *self._actions]
        hint = self._notes.near(name, known) or "describe it below 'places' or 'actions'"
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
        found = [rule_of(node, self._notes, self._named) for node in self._tables("rules")]
        return tuple(rule for rule in found if rule is not None)

    def _tables(self, key: str) -> list[Table]:
        node = self._model._table.get(key)
        items = node[:_MAX_RULES] if isinstance(node, list) else []
        return [one for one in items if isinstance(one, Table)]

    def _examples(self) -> tuple[Example, ...]:
        """The plans that are no answers; their files are found from that of the task."""
        place = self._model.at("not_answers")
        found: list[Example] = []
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
                found.append(Example(name, parsed.plan))
        if len(self._model.not_answers) > _MAX_EXAMPLES:
            self._notes.error(place, f"there are more than {_MAX_EXAMPLES} plans here")
        return tuple(found)


def _name_of(
    interfaces: tuple[str, ...], place: Place | None, parameters: list[tuple[str, Value]]
) -> str:
    """What to call an action that has no name."""
    words = [f"{name}={value}" for name, value in parameters]
    if place is not None:
        words.insert(0, place.name)
    interface = interfaces[0].rpartition("/")[2] if interfaces else ""
    if interface and words:
        return f"{interface} ({', '.join(words)})"
    return interface or ", ".join(words)
