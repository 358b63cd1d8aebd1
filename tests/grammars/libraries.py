"""Hypothesis strategies for libraries with typed parameters, and for canonical plans over them.

The plans are written from the library alone, by other means than the product's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import escape

from hypothesis import strategies as st

from gpsfsm.capabilities.library import Capabilities, Library
from gpsfsm.model.capability import Input, Interface, Output, Parameter, Provider, Source, ValueType

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn, SearchStrategy

__all__ = ["canonical_plans", "capabilities", "value_texts"]

TYPES = ("sequential", "recovery", "parallel_any", "parallel_all")
NAMES = ("x", "text", "speed", "type", "value", "plan", "control", "start", "root", "kühn", "a-b.c")
ODD_NAMES = ("name", "id", "interface", "provider", "xmlns", "xml:id", "p:q", "a b", 'a"', "1st")
INTERFACES = (
    *("demo/Go", "demo/Say", "demo/GoFar", "demo/Go<b>", 'demo/"quoted"', "demo/A&amp;B"),
    *(
        "demo/Größe",
        "demo/\U0001f916",
        "demo/a\\nb",
        "demo/[x]",
        "demo/{y}",
        "demo/b\\",
        "root ::= x",
        "demo/#",
    ),
)
CHOICES = (
    *("a", "ab", "a b", 'say "x"', "<b>", "a & b", "\\", "", "é", "\U0001f600", "5", "0.5", "true"),
    *("$x", "${x}", "{x}", "a\nb", "tab\there", "\x01", "//", "[z]", "'", " "),
)
BOUNDS = (-1e300, -1000.0, -12.5, -0.001, 0.0, 0.1, 1.0, 3.0, 99.75, 1e6, 5e14, 1e300)
WORDS = ("Hello, door!", "x", "5", "3 < 4 & more", 'he said "hi"', "costs $5", '{"a": [1, {}]}')


@st.composite
def _parameters(draw: DrawFn, name: str) -> Parameter:
    kind = draw(st.sampled_from(list(ValueType)))
    numeric = kind in (ValueType.ANY, ValueType.INT, ValueType.DOUBLE)
    low, high = None, None
    if numeric and draw(st.booleans()):
        low, high = draw(st.sampled_from([None, *BOUNDS])), draw(st.sampled_from([None, *BOUNDS]))
        if low is not None and high is not None:
            low, high = min(low, high), max(low, high)
    required = draw(st.booleans())
    default = None if required or draw(st.booleans()) else "1"
    some = st.lists(st.sampled_from(CHOICES), max_size=4, unique=True)
    return Parameter(
        name,
        kind,
        required=required,
        default=default,
        aliases=tuple(draw(st.lists(st.sampled_from(("alt", "x", "other")), max_size=1))),
        minimum=low,
        maximum=high,
        choices=tuple(draw(some)) if draw(st.integers(0, 3)) == 3 else (),
    )


@st.composite
def _inputs(draw: DrawFn, name: str) -> Input:
    sources = draw(st.lists(st.sampled_from(list(Source)), unique=True))
    return Input(
        name,
        draw(st.sampled_from(list(ValueType))),
        required=draw(st.booleans()),
        default=draw(st.sampled_from([None, None, "1"])),
        satisfiable_from=tuple(sources),
        fallback=draw(st.sampled_from(["", "x", "text"])),
    )


@st.composite
def _providers(draw: DrawFn, name: str, implements: str) -> Provider:
    names = st.sampled_from(NAMES)
    if draw(st.integers(0, 5)) == 5:
        names = st.sampled_from(NAMES + ODD_NAMES)
    drawn = draw(st.lists(names, max_size=4, unique=True))
    taken = draw(st.lists(st.sampled_from(NAMES), max_size=2, unique=True))
    value = draw(st.lists(st.sampled_from(NAMES), max_size=2, unique=True))
    return Provider(
        name=name,
        implements=implements,
        described=draw(st.integers(0, 9)) > 0,
        configuration=tuple(draw(_parameters(one)) for one in drawn),
        inputs=tuple(draw(_inputs(one)) for one in taken),
        outputs=tuple(Output(one) for one in value),
        deprecated=draw(st.sampled_from(["", "", "", "old"])),
    )


@st.composite
def capabilities(draw: DrawFn) -> Capabilities:
    """A small library, often an odd one; its first runner can always be written."""
    interfaces = draw(st.lists(st.sampled_from(INTERFACES), min_size=1, max_size=4, unique=True))
    providers = [Provider("demo/Wait", "demo/Wait", described=True)]
    for interface in interfaces:
        providers.append(draw(_providers(interface, interface)))
        if draw(st.booleans()):
            providers.append(draw(_providers(f"{interface}Other", interface)))
    described = tuple(Interface(name) for name in ("demo/Wait", *interfaces))
    complete = draw(st.booleans())
    return Capabilities(Library(described, tuple(providers), complete=complete))


# -- plans over a library whose parameters are all plain ---------------------------------------


def value_texts(parameter: Parameter) -> SearchStrategy[str]:
    """Values that a parameter may have, as a plan writes them."""
    low, high = parameter.minimum, parameter.maximum
    if parameter.choices:
        return st.sampled_from(parameter.choices)
    if parameter.type is ValueType.BOOL:
        return st.sampled_from(["true", "false"])
    if parameter.type is ValueType.INT:
        least = -(10**9) if low is None else int(-(-low // 1))
        return st.integers(least, 10**9 if high is None else int(high // 1)).map(str)
    if parameter.type is ValueType.DOUBLE:
        least = -1e9 if low is None else low
        numbers = st.floats(least, 1e9 if high is None else high)
        return numbers.map(lambda number: _decimal(number, low))
    words = st.text(st.characters(min_codepoint=97, max_codepoint=0x2FFF), min_size=1).map(_plain)
    return st.one_of(st.sampled_from(WORDS), words)


def _decimal(number: float, low: float | None) -> str:
    written = f"{number:.9f}"
    if low is not None and float(written) < low:
        written = repr(low)
    return written if float(written) else "0.0"


def _plain(text: str) -> str:
    return "w" + "".join(each for each in text if each.isprintable() and each not in "{}")


@st.composite
def _runners(draw: DrawFn, library: Library) -> str:
    usable = [
        provider
        for provider in library.providers
        if not provider.deprecated and not provider.implements.endswith("CompletionRunner")
    ]
    provider = draw(st.sampled_from(usable))
    interface = library.interface(provider.implements)
    assert interface is not None
    if interface.deprecated:
        return _runner("generic_capabilities/WaitRunner", [("seconds", "1")])
    written = [
        (each.name, draw(value_texts(each)))
        for each in provider.configuration
        if each.required or draw(st.booleans())
    ]
    return _runner(provider.name, written)


def _runner(name: str, written: list[tuple[str, str]]) -> str:
    attributes = [("interface", name), ("provider", name), *written]
    return "<Runner" + "".join(f' {key}="{_escaped(text)}"' for key, text in attributes) + "/>"


def _escaped(text: str) -> str:
    return escape(text, {'"': "&quot;"})


@st.composite
def canonical_plans(draw: DrawFn, library: Library, *, depth: int = 6) -> str:
    """A plan in the layout that models are bound to; its providers are named as interfaces."""

    def steps(level: int) -> list[str]:
        indent = "    " * level
        lines = []
        for _ in range(draw(st.integers(1, 3))):
            if level < depth and draw(st.integers(0, 3)) == 3:
                lines.append(f'{indent}<Control type="{draw(st.sampled_from(TYPES))}">')
                lines += [*steps(level + 1), f"{indent}</Control>"]
            else:
                lines.append(indent + draw(_runners(library)))
        return lines

    return "\n".join(["<Plan>", *steps(1), "</Plan>"])
