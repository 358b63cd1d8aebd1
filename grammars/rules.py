"""The rules of a grammar of plans: an alphabet of runners, to a depth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.errors import UsageError
from gpsfsm.grammars.expressions import (
    Choice,
    Expression,
    Literal,
    Name,
    Repeat,
    Sequence,
    choice,
    opt,
)
from gpsfsm.grammars.forms import FormKind, attribute_text, expression
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from gpsfsm.grammars.forms import Form
    from gpsfsm.grammars.writable import Alphabet, Writable

DEPTH = 6
"""How deep runners may stand, where nobody says it: inside of up to five controls."""
MAX_DEPTH = 32
MAX_CHILDREN = 64
"""Steps of a plan or control."""
INDENT = "    "
_MOST_PARTS = 10


@dataclass(frozen=True, slots=True)
class Rule:
    """A rule by name. ``is_token``: it is regular, and its texts are one piece to a lexer."""

    name: str
    body: Expression
    is_token: bool = False


def checked_depth(depth: int) -> int:
    """The depth; raises UsageError if it is out of range."""
    if not 1 <= depth <= MAX_DEPTH:
        raise UsageError(f"the depth is {depth}; it has to be from 1 to {MAX_DEPTH}")
    return depth


def rules_of(words: Alphabet, depth: int = DEPTH) -> tuple[Rule, ...]:
    """The rules, the first being that of a whole plan; raises UsageError for a wrong depth.

    Every line break and blank is fixed: each element has a line of its own, indented by four blanks
    per level, and so there is one way to write a plan.
    """
    levels = [_level(level, depth) for level in range(1, checked_depth(depth) + 1)]
    plan = Sequence((Literal("<Plan>"), _steps(1), Literal("\n</Plan>")))
    values = _Values()
    runners: list[Rule] = []
    for number, each in _counted(words):
        runners += _runner(f"r{number}", each, values)
    named = choice([Name(f"r{number}") for number, _ in _counted(words)])
    runner = Sequence((Literal('Runner interface="'), named, Literal("/>")))
    types = choice([Literal(f'{kind}">') for kind in ControlType])
    controls = [Rule("type", types)] if depth > 1 else []
    return (
        Rule("start", plan),
        *levels,
        *controls,
        Rule("runner", runner),
        *runners,
        *values.rules,
    )


def _counted(words: Alphabet) -> enumerate[Writable]:
    return enumerate(words.runners, start=1)


def _steps(level: int) -> Expression:
    return Repeat(Name(f"s{level}"), 1, MAX_CHILDREN)


def _level(level: int, depth: int) -> Rule:
    """A step so many levels below the plan, from the line break before it."""
    line = "\n" + INDENT * level
    runner = Name("runner")
    if level == depth:
        return Rule(f"s{level}", Sequence((Literal(f"{line}<"), runner)))
    control = Sequence(
        (
            Literal('Control type="'),
            Name("type"),
            _steps(level + 1),
            Literal(f"{line}</Control>"),
        )
    )
    return Rule(f"s{level}", Sequence((Literal(f"{line}<"), Choice((runner, control)))))


def _runner(name: str, runner: Writable, values: _Values) -> list[Rule]:
    """From the name of the interface to the last attribute.

    One rule, and further ones if there are many attributes: engines that write every choice out,
    as Lark does, take twice as long for each attribute of a rule that may be left out.
    """
    interface, provider = map(attribute_text, (runner.interface, runner.provider))
    text = f'{interface}" provider="{provider}"'
    parts: list[Expression] = []
    for slot in runner.slots:
        start, value = f' {slot.name}="', values.name(slot.form)
        if slot.required:
            parts += [Literal(text + start), value]
            text = ""
            continue
        if text:
            parts.append(Literal(text))
            text = ""
        parts.append(opt(Sequence((Literal(start), value))))
    if text:
        parts.append(Literal(text))
    if len(parts) <= _MOST_PARTS:
        return [Rule(name, Sequence(tuple(parts)))]
    groups = [
        Rule(f"{name}x{number}", Sequence(tuple(parts[start : start + _MOST_PARTS])))
        for number, start in enumerate(range(0, len(parts), _MOST_PARTS), start=1)
    ]
    return [Rule(name, Sequence(tuple(Name(group.name) for group in groups))), *groups]


class _Values:
    """Gives each form of values one rule."""

    def __init__(self) -> None:
        self._names: dict[Form, str] = {}
        self.rules: list[Rule] = []

    def name(self, form: Form) -> Expression:
        """The rule of a form, by name."""
        if form not in self._names:
            body = expression(form)
            assert body is not None
            self._names[form] = name = self._new_name(form)
            self.rules.append(Rule(name, body, is_token=True))
        return Name(self._names[form])

    def _new_name(self, form: Form) -> str:
        if form.is_boolean:
            return "bool"
        if form.kind is FormKind.CHOICE or form.kind is FormKind.LIST or form.bounded:
            return f"v{len(self.rules) + 1}"
        return form.kind.value
