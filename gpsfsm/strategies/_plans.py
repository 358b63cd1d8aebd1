"""Plans as texts: runners with parameters as described, controls, and how they are nested."""

from __future__ import annotations

import math
from functools import cache
from textwrap import indent
from typing import TYPE_CHECKING, Literal, TypeVar
from xml.sax.saxutils import quoteattr

from hypothesis import strategies as st

from gpsfsm.capabilities.library import Capabilities, builtin_capabilities
from gpsfsm.model.capability import Source, ValueType

if TYPE_CHECKING:
    from collections.abc import Callable

    from hypothesis.strategies import DrawFn, SearchStrategy

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Input, Parameter, Provider


T = TypeVar("T")
ControlWord = Literal["sequential", "recovery", "parallel_any", "parallel_all"]

TYPES: tuple[ControlWord, ...] = ("sequential", "recovery", "parallel_any", "parallel_all")
# Kinds of children; the more often one is named the more often it is drawn. None is a runner,
# first, to shrink to it. At the start of a list recoveries are rare, for they guard nothing there.
_FIRST: list[ControlWord | None] = [
    *([None] * 4),
    "sequential",
    "sequential",
    "parallel_any",
    "parallel_any",
    "parallel_any",
    "parallel_all",
    "parallel_all",
    "parallel_all",
    "recovery",
]
_RECOVERY: ControlWord = "recovery"
_LATER: list[ControlWord | None] = [*_FIRST, *([_RECOVERY] * 14)]

# Made once: Hypothesis looks at each new strategy, and that takes longer than to draw from it.
_FIRST_KIND, _LATER_KIND = st.sampled_from(_FIRST), st.sampled_from(_LATER)
_NO_CONTROL: SearchStrategy[ControlWord | None] = st.none()
_ANY_TYPE, _ONE_OF_TEN = st.sampled_from(TYPES), st.integers(0, 9)


def forests(
    runners: SearchStrategy[T],
    control: Callable[[ControlWord, tuple[T, ...]], T],
    *,
    size: int,
    max_depth: int = 4,
) -> SearchStrategy[tuple[T, ...]]:
    """Children of one element that hold exactly ``size`` runners in all, and any controls.

    ``control`` makes an element of a type and its children. Controls are nested at most
    ``max_depth`` deep, may be empty, and occur anywhere. For those who have nodes of their own;
    ``plans`` draws texts.

    >>> from hypothesis import find, settings, strategies as st
    >>> trees = forests(st.just("go"), lambda word, inside: f"{word}({', '.join(inside)})", size=2)
    >>> simple = settings(database=None)
    >>> find(trees, lambda found: len(found) == 1, settings=simple)
    ('sequential(go, go)',)
    """

    @cache
    def within(size: int, depth: int) -> SearchStrategy[tuple[T, ...]]:
        return _children(runners, control, within, size=size, depth=depth)

    return within(size, max_depth)


@st.composite
def _children(
    draw: DrawFn,
    runners: SearchStrategy[T],
    control: Callable[[ControlWord, tuple[T, ...]], T],
    within: Callable[[int, int], SearchStrategy[tuple[T, ...]]],
    *,
    size: int,
    depth: int,
) -> tuple[T, ...]:
    children: list[T] = []
    while size:
        kinds = (_LATER_KIND if children else _FIRST_KIND) if depth else _NO_CONTROL
        kind = draw(kinds)
        if kind is None:
            children.append(draw(runners))
            size -= 1
        else:
            # The larger of two, or most plans would be one long sequence.
            sizes = st.integers(1, size)
            inside = max(draw(sizes), draw(sizes))
            children.append(control(kind, draw(within(inside, depth - 1))))
            size -= inside
        if depth and draw(_ONE_OF_TEN) == 9:
            children.append(control(draw(_ANY_TYPE), ()))
    return tuple(children)


_WORDS = ("hello", "door", "Is anybody there?", "a < b & c", "ü")
_MOST = 100.0


def runners(library: Library | Capabilities | None = None) -> SearchStrategy[str]:
    """Draw a ``<Runner …/>`` of a library, the built-in one if none is given.

    Required parameters are there, others may be; values have the declared type and keep to the
    declared bounds and choices. Deprecated runners are not drawn. Shrinks to the first
    runner by name that needs no parameters.

    >>> from hypothesis import find, settings
    >>> find(runners(), lambda text: True, settings=settings(database=None))
    '<Runner interface="capabilities2_runner/GetCapabilitySpecsRunner" \
provider="capabilities2_runner/GetCapabilitySpecsRunner"/>'
    """
    capabilities = library or builtin_capabilities()
    if isinstance(capabilities, Capabilities):
        capabilities = capabilities.library
    usable = [provider for provider in capabilities.providers if not provider.deprecated]
    if not usable:
        raise ValueError("the library has no runner that could be drawn")
    ordered = sorted(usable, key=lambda provider: provider.name)
    return st.sampled_from(ordered).flatmap(_runner)


@st.composite
def _runner(draw: DrawFn, provider: Provider) -> str:
    texts = {"interface": provider.implements, "provider": provider.name}
    inputs = {each.name for each in provider.inputs}
    for parameter in provider.configuration:
        needed = parameter.required and parameter.name not in inputs
        if needed or draw(st.integers(0, 3)) == 3:
            texts[parameter.name] = draw(_values(parameter))
    for wanted in provider.inputs:
        outside = {Source.EXTERNAL, Source.CONFIGURATION} & set(wanted.satisfiable_from)
        if wanted.required and outside and wanted.name not in texts:
            texts[wanted.name] = draw(_values(provider.parameter(wanted.name) or wanted))
    attributes = "".join(f" {name}={quoteattr(text)}" for name, text in texts.items())
    return f"<Runner{attributes}/>"


def _values(described: Parameter | Input) -> SearchStrategy[str]:
    choices: tuple[str, ...] = getattr(described, "choices", ())
    if choices:
        return st.sampled_from(choices)
    least, greatest = _bounds(described)
    kind = described.type
    if kind in (ValueType.BOOL, ValueType.BOOLS):
        return st.sampled_from(["false", "true"])
    if kind in (ValueType.INT, ValueType.INTS):
        return st.integers(math.ceil(least), math.floor(greatest)).map(str)
    if kind in (ValueType.DOUBLE, ValueType.DOUBLES):
        steps = st.integers(math.ceil(least * 2), math.floor(greatest * 2))
        return steps.map(lambda step: str(step / 2))
    return st.sampled_from(_WORDS)


def _bounds(described: Parameter | Input) -> tuple[float, float]:
    """Bounds between which there are numbers that shrink to 0, or to the least of them."""
    least: float | None = getattr(described, "minimum", None)
    greatest: float | None = getattr(described, "maximum", None)
    low = (
        (0.0 if greatest is None or greatest >= 0 else greatest - _MOST) if least is None else least
    )
    return low, max(low + 1.0, low + _MOST) if greatest is None else max(low, greatest)


_any_runners = runners  # `plans` has a parameter of that name


@st.composite
def controls(
    draw: DrawFn,
    children: SearchStrategy[str] | None = None,
    *,
    types: tuple[ControlWord, ...] = TYPES,
    min_children: int = 0,
    max_children: int = 4,
) -> str:
    """Draw a ``<Control …>`` with these children, runners if none are given.

    >>> from hypothesis import find, settings, strategies as st
    >>> pairs = controls(st.just("<Runner/>"), types=("parallel_any",), min_children=2)
    >>> print(find(pairs, lambda text: True, settings=settings(database=None)))
    <Control type="parallel_any">
      <Runner/>
      <Runner/>
    </Control>
    """
    inside = st.lists(
        _any_runners() if children is None else children,
        min_size=min_children,
        max_size=max_children,
    )
    return _control(draw(st.sampled_from(types)), tuple(draw(inside)))


def plans(
    runners: SearchStrategy[str] | None = None,
    *,
    min_runners: int = 1,
    max_runners: int = 10,
    max_depth: int = 4,
) -> SearchStrategy[str]:
    """Draw the text of a plan that reads without an error.

    Its runners are drawn by ``runners`` (the function of this name, with the built-in library, if
    none are given). All controls occur anywhere: also empty ones, recoveries that guard nothing and
    parallels of one unit.
    """
    one = _any_runners() if runners is None else runners

    @cache
    def of_size(size: int) -> SearchStrategy[tuple[str, ...]]:
        return forests(one, _control, size=size, max_depth=max_depth)

    return st.integers(min_runners, max_runners).flatmap(of_size).map(_plan)


def _plan(children: tuple[str, ...]) -> str:
    return _element("<Plan>", "</Plan>", children) + "\n"


def _control(word: ControlWord, children: tuple[str, ...]) -> str:
    if not children:
        return f'<Control type="{word}"/>'
    return _element(f'<Control type="{word}">', "</Control>", children)


def _element(start: str, end: str, children: tuple[str, ...]) -> str:
    return "\n".join([start, *(indent(child, "  ") for child in children), end])
