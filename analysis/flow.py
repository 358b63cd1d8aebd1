"""Data that runners hand on: values, placeholders for them, and prompts (semantics, 8.2 and 8.3).

Values travel along one connection, so this is read off the automaton; whether the connection is
ever used is for the deciders to say. A placeholder in the text of an attribute (``$name``,
``${a.b}``, ``{name}``, ``&name``, ``<name>``) is never filled; what it names tells which value the
author hoped for. Prompts gather in buffers, which some instances fill and others flush.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Literal, NamedTuple

from gpsfsm.late import dataclass, pattern
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import Source
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding, Output, Provider
    from gpsfsm.model.plan import Value

How = Literal["always", "sometimes"]


class Need(NamedTuple):
    """A value that an instance cannot do without.

    ``literal``: an attribute of the plan meets it; ``arriving``: a value from upstream does;
    ``fallback`` is the parameter whose attribute or default stands in for it ("": none).
    """

    name: str
    kind: Literal["parameter", "input"]
    arriving: bool
    literal: bool
    fallback: str


def needs(provider: Provider) -> tuple[Need, ...]:
    """The needs of a provider, parameters first, in the order of its file."""
    named = {each.name for each in provider.inputs}
    result = [
        Need(parameter.name, "parameter", arriving=True, literal=True, fallback="")
        for parameter in provider.configuration
        if parameter.required and parameter.default is None and parameter.name not in named
    ]
    for expected in provider.inputs:
        if not expected.required or expected.default is not None:
            continue
        allowed = expected.satisfiable_from
        configured = Source.CONFIGURATION in allowed
        result.append(
            Need(
                expected.name,
                "input",
                arriving=not allowed or Source.UPSTREAM in allowed,
                literal=configured or Source.EXTERNAL in allowed,
                fallback=(expected.fallback or expected.name) if configured else "",
            )
        )
    return tuple(result)


def knows(binding: Binding, name: str) -> bool:
    """True if the instance reads a value of this name, if it arrives."""
    provider = binding.provider
    parameter = provider.parameter(name)
    return provider.input(name) is not None or (parameter is not None and parameter.name == name)


class Values:
    """The values that arrive at the instances of a compiled plan.

    ``arriving[number]`` are the outputs by name; None where an undescribed instance may hand over
    anything. ``source[number]`` is the number of the instance whose ``event[number]`` triggers the
    instance, -1 and None if a join or the start does. With STARTED a source hands over nothing.
    """

    def __init__(self, compiled: Compiled) -> None:
        self.bindings: Sequence[Binding | None] = compiled.bindings
        self._needs: dict[int, tuple[Need, ...]] = {}  # by the identity of the provider
        self._outputs: dict[tuple[int, Event], Mapping[str, Output]] = {}
        automaton = compiled.automaton
        self.arriving: list[Mapping[str, Output] | None] = []
        self.source: list[int] = []
        self.event: list[Event | None] = []
        for node in automaton.runners:
            source, event = -1, None
            outputs: Mapping[str, Output] | None = _NOTHING
            for signal in automaton.inputs[node.index]:
                if automaton.nodes[signal.node].kind is NodeKind.RUNNER:
                    source, event = automaton.runner_number(signal.node), signal.event
                    outputs = self._handed_over(source, event)
            self.source.append(source)
            self.event.append(event)
            self.arriving.append(outputs)

    def _handed_over(self, number: int, event: Event) -> Mapping[str, Output] | None:
        if event is Event.STARTED:
            return _NOTHING
        binding = self.bindings[number]
        if binding is None:
            return None
        key = id(binding.provider), event
        if key not in self._outputs:
            outputs = binding.provider.outputs
            self._outputs[key] = {
                output.name: output for output in outputs if output.event is event
            }
        return self._outputs[key]

    def needs(self, binding: Binding) -> tuple[Need, ...]:
        """The needs of an instance, whether or not they are met."""
        key = id(binding.provider)
        if key not in self._needs:
            self._needs[key] = needs(binding.provider)
        return self._needs[key]

    def unmet(self, number: int) -> Iterator[tuple[Need, How]]:
        """The needs of an instance that are missing in some run that triggers it."""
        binding, arriving = self.bindings[number], self.arriving[number]
        if binding is None:
            return
        for need in self.needs(binding):
            if need.literal and need.name in binding.written:
                continue
            if need.fallback and binding.value(need.fallback) is not None:
                continue
            if need.arriving and arriving is None:
                continue  # it may come from an undescribed instance
            output = arriving.get(need.name) if need.arriving and arriving else None
            if output is None:
                yield need, "always"
            elif output.optional:
                yield need, "sometimes"

    def certain(self, number: int, name: str) -> Value | None:
        """The value that the instance works with, if it is the same in every run and known.

        None also where there is none.
        """
        binding = self.bindings[number]
        if binding is None or not binding.settled(name):
            return None
        return binding.worked_with(name)


_NOTHING: Mapping[str, Output] = {}


# Every quantifier is possessive or bounded: no text makes these slower than linear.
_WORD = r"[^\W\d]\w*+"
_PATH = rf"{_WORD}(?:(?:::|[./:-])\w++|\[\w*+\])*+"
_BRACED = rf"\$\{{\s*+(?P<braced>{_PATH})\s*+\}}"
_CURLY = rf"\{{\{{?+\s*+(?P<curly>{_PATH})\s*+\}}\}}?+"

_WHOLE = pattern(
    rf"\$(?P<dollar>{_PATH})|&(?P<reference>{_PATH})|{_BRACED}|{_CURLY}"
    rf"|<(?P<angle>{_PATH}(?:[ ]{_PATH}){{0,5}}+)>"
)
_SURE = pattern(rf"{_BRACED}(?!\$(?!\{{))")
# In longer text $name and {name} may be something else, above all a formula.
_DOLLAR = pattern(rf"(?<![\w$\\])\$(?P<dollar>{_WORD}(?:[./]\w++)*+)")
_CURLY_INSIDE = pattern(rf"(?<![{{}}$^\])])(?<!\b[^\W\d]_){_CURLY}(?![{{}}])")
_FORMULA = pattern(r"\$(?=[^\s$])[^$]{1,200}+(?<=\S)\$(?![\w{])")
_SEPARATOR = pattern(r"[./:\-]|\[\w*\]")
_MAX_NAMES = 20


@dataclass(frozen=True, slots=True)
class Placeholder:
    """A placeholder: ``text`` as it is written (the first one), ``whole`` if it is all there is.

    ``names`` are the values that all placeholders of the text ask for: the last part of each path.
    ``certain`` is false where the text might mean something else: ``$name`` and ``{name}`` inside
    longer text.
    """

    text: str
    whole: bool
    names: tuple[str, ...]
    certain: bool


def placeholder(text: str) -> Placeholder | None:
    """The placeholder in the text of an attribute, None if there is none.

    >>> placeholder("${prompt_capabilities/PromptSpeechRunner.text}").names
    ('text',)
    >>> placeholder("It costs $5.") is placeholder('{"a": 1}') is None
    True
    """
    if not any(mark in text for mark in "${&<"):
        return None
    whole = _WHOLE.fullmatch(text.strip())
    if whole is not None:
        return Placeholder(whole[0], True, _names([whole]), True)
    sure = list(_SURE.finditer(text))
    guessed = list(_guessed(text))
    if not sure and not guessed:
        return None
    every = sorted([*sure, *guessed], key=re.Match.start)
    first = sure[0] if sure else every[0]
    return Placeholder(first[0], False, _names(every), bool(sure))


def _guessed(text: str) -> Iterator[re.Match[str]]:
    """The part of a longer text that looks like a placeholder."""
    if "$" in text and _FORMULA.search(text) is None:
        yield from _DOLLAR.finditer(text)
    if "{" in text and "\\" not in text and "^{" not in text:
        yield from _CURLY_INSIDE.finditer(text)


def _names(matches: Iterable[re.Match[str]]) -> tuple[str, ...]:
    """The last part of each path, each once, in order; what is no identifier names nothing."""
    names: dict[str, None] = {}
    for match in matches:
        parts = [part for part in _SEPARATOR.split(match[match.lastgroup or 0]) if part]
        if parts and parts[-1].isidentifier():
            names[parts[-1]] = None
        if len(names) >= _MAX_NAMES:
            break
    return tuple(names)


class Prompt(NamedTuple):
    """An instance that prompts a model.

    ``flush`` and ``uuid`` are None where they are not known before the run; ``uuid`` is "" where
    there is none. ``answer`` names the output that holds the answer.
    """

    runner: int
    flush: bool | None
    uuid: str | None
    answer: str


class Prompts:
    """The prompts of a plan in document order, and the values that arrive at its instances."""

    def __init__(self, prompts: tuple[Prompt, ...], values: Values) -> None:
        self.all = prompts
        self.values = values
        self._filling: dict[str, list[int]] = {}
        self._flushing: dict[str, list[int]] = {}
        self._unsure: set[tuple[str, bool]] = set()  # buffers that something unknown may change
        self._any: set[bool] = set()  # and what may be done to any buffer
        for prompt in prompts:
            for flush, by_buffer in ((True, self._flushing), (False, self._filling)):
                if prompt.flush is (not flush):
                    continue
                if prompt.uuid is None:
                    self._any.add(flush)
                elif prompt.flush is None:
                    self._unsure.add((prompt.uuid, flush))
                else:
                    by_buffer.setdefault(prompt.uuid, []).append(prompt.runner)

    @property
    def fills(self) -> tuple[Prompt, ...]:
        """The instances that are known to fill a buffer that is known."""
        return tuple(
            prompt for prompt in self.all if prompt.flush is False and prompt.uuid is not None
        )

    @property
    def flushes(self) -> tuple[Prompt, ...]:
        """The instances that are known to flush a named buffer."""
        return tuple(prompt for prompt in self.all if prompt.flush and prompt.uuid)

    def flushing(self, uuid: str) -> tuple[int, ...] | None:
        """The runners that flush a buffer; None if one of which this is not known may.

        Nothing flushes the buffer of a prompt without uuid.
        """
        return () if not uuid else self._of(uuid, flush=True)

    def filling(self, uuid: str) -> tuple[int, ...] | None:
        """The runners that fill a buffer; None if one of which this is not known may."""
        return self._of(uuid, flush=False)

    def _of(self, uuid: str, *, flush: bool) -> tuple[int, ...] | None:
        if flush in self._any or (uuid, flush) in self._unsure:
            return None
        return tuple((self._flushing if flush else self._filling).get(uuid, ()))


def prompts_of(compiled: Compiled) -> Prompts | None:
    """The prompts of a plan; None if there are none."""
    prompting = [
        number
        for number, binding in enumerate(compiled.bindings)
        if binding is not None and binding.provider.effects.prompt_buffer is not None
    ]
    if not prompting:
        return None
    values = Values(compiled)
    return Prompts(tuple(_prompt(values, number) for number in prompting), values)


def _prompt(values: Values, number: int) -> Prompt:
    binding = values.bindings[number]
    assert binding is not None
    buffer = binding.provider.effects.prompt_buffer
    assert buffer is not None
    flush = _said_true(values.certain(number, buffer.flush))
    uuid = buffer_name(binding)
    return Prompt(
        runner=number,
        flush=flush if binding.settled(buffer.flush) else None,
        uuid=uuid if binding.settled(buffer.uuid) else None,
        answer=buffer.answer,
    )


def _said_true(value: Value | None) -> bool | None:
    """True if a value asks to flush; None where it says neither."""
    if isinstance(value, str):
        return {"true": True, "false": False}.get(value.strip().lower())
    return value if isinstance(value, bool) else False if value is None else None


def buffer_name(binding: Binding | None) -> str:
    """The uuid of the buffer of a prompt, as its runner reads it; "" if it names none."""
    buffer = binding.provider.effects.prompt_buffer if binding else None
    value = binding.worked_with(buffer.uuid) if binding and buffer else None
    return str(value).lower() if isinstance(value, bool) else "" if value is None else str(value)
