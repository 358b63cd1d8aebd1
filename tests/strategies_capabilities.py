"""Hypothesis strategies for small capability libraries and for plans over them.

``to_library`` gives the same library in the form of the product. Strategies are made once, for
Hypothesis looks at each new one, and that takes longer than to draw from it.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import combinations
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.capabilities.library import Library
from gpsfsm.model import capability as product
from gpsfsm.model.event import Event
from tests.oracle import FAILED, SUCCEEDED, C, P, R
from tests.oracle.capabilities import (
    CONFIGURATION,
    EXTERNAL,
    UPSTREAM,
    Bounds,
    Described,
    Input,
    Output,
    Parameter,
    Prompt,
    Value,
)
from tests.strategies import TYPES, plans

if TYPE_CHECKING:
    from hypothesis.strategies import DrawFn, SearchStrategy

    from tests.oracle.model import Node

NAMES = ("text", "x")
# What a plan may write; few values, so that they collide, and 1 and true, which differ.
WRITTEN = {
    "text": ("hello", "$text", "{x}", "${go.text}", "1", "01"),
    "x": ("1", "1.0", "true", "$x", "2"),
    "uuid": ("a", "b", "1"),
    "flush": ("true", "false"),
    "seconds": ("1", "3", "0"),
}
DEFAULTS: dict[str, Value] = {"text": "hi", "x": 1}
RESOURCES = ("base", "speaker")
UNDESCRIBED = ("demo_capabilities/SecretRunner", "demo_runners/Secret")

_EITHER = st.booleans()
_ONE_OF_FOUR, _ONE_OF_FIVE = st.integers(0, 3), st.integers(0, 4)
_DEFAULTS = {name: st.sampled_from([None, None, None, DEFAULTS[name]]) for name in NAMES}
_WRITTEN = {name: st.sampled_from(texts) for name, texts in WRITTEN.items()}
_STATING = {  # more often what outcomes depend on
    **_WRITTEN,
    **{name: st.sampled_from([*WRITTEN[name], "1", "1", "01"]) for name in NAMES},
}
_NAMED_BOUNDS: SearchStrategy[Bounds] = st.sampled_from(
    [("seconds", "seconds"), ("seconds", None), (0, "seconds")]
)
_MORE = st.sampled_from([0, 1, 2, None])
# uuid and flush arrive rarely: nothing is said about such buffers
_ATTRIBUTES = st.sampled_from(
    [NAMES, NAMES, NAMES, (*NAMES, "uuid"), (*NAMES, "flush"), (*NAMES, "seconds")]
)
_TYPES = {"text": st.sampled_from(["", "string"]), "x": st.just("")}
_ANSWERS, _UUIDS = st.sampled_from(["", "answer", "text"]), st.sampled_from([None, "a"])
_OUTCOMES = st.sampled_from(["", "", "", "never fails", "may hang", "never succeeds"])
_UNLESS: SearchStrategy[tuple[tuple[str, Value], ...]] = st.sampled_from(
    [(), (("x", 1),), (("x", True),), (("flush", False),), (("text", "1"),), (("text", "hello"),)]
)
_STATED: SearchStrategy[Value] = st.sampled_from(["1", 1])
_DURATIONS: SearchStrategy[Bounds] = st.sampled_from(
    [(1, 1), (1, 2), (2, 2), (0, 1), (0, 0), (3, 4), (2, None)]
)
_PARALLELS = st.sampled_from(TYPES[2:])


@cache
def _subset(names: tuple[str, ...]) -> SearchStrategy[tuple[str, ...]]:
    sizes = range(len(names) + 1)
    return st.sampled_from([some for size in sizes for some in combinations(names, size)])


@cache
@st.composite
def _parameters(draw: DrawFn) -> tuple[Parameter, ...]:
    results = []
    for name in draw(_subset(NAMES)):
        required = draw(_EITHER)
        default = None if required or draw(_EITHER) else DEFAULTS[name]
        results.append(Parameter(name, required, default, draw(_TYPES[name])))
    return tuple(results)


@cache
@st.composite
def _inputs(draw: DrawFn, parameters: tuple[str, ...]) -> tuple[Input, ...]:
    result, fallbacks = [], st.sampled_from(["", *parameters])
    for name in draw(_subset(NAMES)):
        fallback = draw(fallbacks)
        result.append(
            Input(
                name,
                required=draw(_EITHER),
                default=draw(_DEFAULTS[name]),
                sources=draw(_subset((UPSTREAM, CONFIGURATION, EXTERNAL))),
                fallback=fallback,
                type=draw(_TYPES[name]),
            )
        )
    return tuple(result)


@cache
@st.composite
def _outputs(draw: DrawFn, names: tuple[str, ...]) -> tuple[Output, ...]:
    return tuple(
        Output(name, event, draw(_EITHER), draw(_EITHER), "double" if name == "seconds" else "")
        for event in (SUCCEEDED, FAILED)
        for name in (draw(_subset(names)) if event == SUCCEEDED or draw(_EITHER) else ())
    )


@cache
@st.composite
def _bounds(draw: DrawFn) -> Bounds | None:
    if draw(_EITHER):
        return None
    if draw(_ONE_OF_FIVE) == 4:
        return draw(_NAMED_BOUNDS)
    low = draw(_ONE_OF_FOUR)
    more = draw(_MORE)
    return low, None if more is None else low + more


@cache
@st.composite
def _acting(draw: DrawFn, *, values: bool, clocks: bool) -> Described:
    """A runner that acts; with ``values`` it takes and gives, with ``clocks`` it occupies."""
    described = Described("")
    if values:
        parameters = draw(_parameters())
        names = draw(_ATTRIBUTES)
        described = replace(
            described,
            parameters=parameters,
            inputs=draw(_inputs(tuple(one.name for one in parameters))),
            outputs=draw(_outputs(names)),
        )
    if clocks:
        described = replace(
            described,
            parameters=(*described.parameters, Parameter("seconds", type="double")),
            resources=draw(_subset(RESOURCES)),
            duration=draw(_bounds()),
            energy=draw(_bounds()),
        )
    return described


@cache
@st.composite
def _prompting(draw: DrawFn, *, values: bool, clocks: bool) -> Described:
    """A runner that prompts a model."""
    drawn = draw(_acting(values=values, clocks=clocks))
    answer = draw(_ANSWERS)
    outputs = tuple(one for one in drawn.outputs if (one.name, one.event) != (answer, SUCCEEDED))
    answers = (Output(answer),) if answer else ()
    kind = draw(_TYPES["text"])
    own = (
        Parameter("uuid", default=draw(_UUIDS), type=kind),
        Parameter("flush", default=draw(_EITHER)),
    )
    falls_back = drawn.parameter("text") is not None and draw(_ONE_OF_FOUR) == 3
    stand_in = (Input("uuid", fallback="text", type=kind),) if falls_back else ()
    return replace(
        drawn,
        parameters=(*drawn.parameters, *own),
        inputs=(*drawn.inputs, *stand_in),
        outputs=(*outputs, *answers),
        prompt=Prompt("uuid", "flush", answer),
    )


def _declared(draw: DrawFn, described: Described) -> Described:
    """The same with declared outcomes, mostly none."""
    kind = draw(_OUTCOMES)
    if kind != "never fails":
        return replace(
            described, may_hang=kind == "may hang", never_succeeds=kind == "never succeeds"
        )
    stands_in = [one.name for one in described.inputs if one.fallback and one.name != "uuid"]
    if len(stands_in) > 0 and draw(_EITHER):  # what is written for another name decides
        return replace(described, never_fails=True, unless=((stands_in[0], draw(_STATED)),))
    return replace(described, never_fails=True, unless=draw(_UNLESS))


@cache
@st.composite
def libraries(
    draw: DrawFn,
    *,
    values: bool = False,
    prompts: bool = False,
    clocks: bool = False,
    outcomes: bool = False,
    goals: bool = False,
) -> tuple[Described, ...]:
    """A few providers: of two interfaces that act and, with ``prompts``, of two that prompt.

    With ``goals`` some of them achieve something.
    """
    results = []
    kinds = ("Go", "Say", *(("Ask", "Tell") if prompts else ()))
    for name in kinds:
        for provider in ("", "Other") if draw(_EITHER) else ("",):
            make = _prompting if name in ("Ask", "Tell") else _acting
            drawn = draw(make(values=values, clocks=clocks))
            if outcomes:
                drawn = _declared(draw, drawn)
            if goals:
                drawn = replace(drawn, achieves=draw(_EITHER))
            results.append(
                replace(
                    drawn,
                    interface=f"demo_capabilities/{name}Runner",
                    provider=f"demo_runners/{name}{provider}",
                )
            )
    return tuple(results)


def _runner(draw: DrawFn, library: tuple[Described, ...], undescribed: bool) -> R:
    if undescribed and draw(_ONE_OF_FOUR) == 3:
        return R(UNDESCRIBED[0], provider=UNDESCRIBED[1])
    described = library[draw(st.integers(0, len(library) - 1))]
    names = sorted(
        {one.name for one in described.parameters} | {one.name for one in described.inputs}
    )
    written = _STATING if described.unless else _WRITTEN
    words = [f"{name}={draw(written[name])}" for name in names if draw(_EITHER)]
    return R(" ".join([described.interface, *words]), provider=described.provider)


@st.composite
def plans_over(
    draw: DrawFn,
    library: tuple[Described, ...],
    *,
    min_runners: int = 1,
    max_runners: int = 5,
    undescribed: bool = True,
) -> P:
    """A plan whose runners are of the library, but for a few that nobody describes."""

    def dressed(node: Node) -> Node:
        if isinstance(node, C):
            return C(node.type, tuple(dressed(child) for child in node.children))
        return _runner(draw, library, undescribed)

    whole = draw(plans(min_runners=min_runners, max_runners=max_runners, max_depth=3))
    return P(tuple(dressed(child) for child in whole.children))


@st.composite
def races(draw: DrawFn) -> tuple[P, tuple[Described, ...]]:
    """A plan in which sequences run beside each other, and all takes its time.

    Here the clock often decides whether two instances can meet.
    """
    library = tuple(
        Described(
            f"demo_capabilities/{name}Runner",
            f"demo_runners/{name}",
            resources=resources,
            duration=draw(_DURATIONS),
            never_fails=draw(_EITHER),
        )
        for name, resources in (("Go", ("base",)), ("Turn", ("base",)), ("Wait", ()))
    )
    size = draw(st.integers(2, 6))
    runners = [_runner(draw, library, False) for _ in range(size)]
    cut, last = draw(st.integers(1, size - 1)), draw(_EITHER)
    guarded = draw(_EITHER)
    inside = runners[: size - 1] if last and cut < size - 1 else runners
    units = C("sequential", tuple(inside[:cut])), C("sequential", tuple(inside[cut:]))
    both = C(draw(_PARALLELS), units)
    behind = tuple(runners[len(inside) :])
    return P((both, C("recovery", behind)) if guarded else (both, *behind)), library


def with_own_providers(whole: P, library: tuple[Described, ...]) -> tuple[P, tuple[Described, ...]]:
    """The same with one provider per interface: the product wants their names to differ."""

    def provided(node: Node) -> Node:
        if isinstance(node, C):
            return C(node.type, tuple(provided(child) for child in node.children))
        return replace(node, provider=f"demo_runners/{node.interface}")

    plan = P(tuple(provided(child) for child in whole.children))
    own = [
        replace(described, provider=f"demo_runners/{described.interface}") for described in library
    ]
    return plan, tuple(own)


def to_library(library: tuple[Described, ...]) -> Library:
    """The library in the form of the product."""
    names = sorted({described.interface for described in library})
    providers = sorted((_provider(described) for described in library), key=lambda one: one.name)
    return Library(tuple(product.Interface(name) for name in names), tuple(providers))


def _provider(described: Described) -> product.Provider:
    prompt = described.prompt
    return product.Provider(
        name=described.provider,
        implements=described.interface,
        described=True,
        configuration=tuple(
            product.Parameter(
                one.name,
                product.ValueType(one.type),
                one.required,
                one.default,
            )
            for one in described.parameters
        ),
        inputs=tuple(
            product.Input(
                one.name,
                product.ValueType(one.type),
                required=one.required,
                default=one.default,
                satisfiable_from=tuple(product.Source(source) for source in one.sources),
                fallback=one.fallback,
            )
            for one in described.inputs
        ),
        outputs=tuple(
            product.Output(
                one.name,
                product.ValueType(one.type),
                Event(one.event),
                optional=one.optional,
                status=one.status,
            )
            for one in described.outputs
        ),
        outcomes=product.Outcomes(
            described.never_fails, described.never_succeeds, described.may_hang, described.unless
        ),
        duration=None if described.duration is None else product.Span(*described.duration),
        energy=None if described.energy is None else product.Span(*described.energy),
        resources=described.resources,
        effects=product.Effects(
            None
            if prompt is None
            else product.PromptBuffer(prompt.uuid, prompt.flush, prompt.answer),
            described.sets_plan,
        ),
        achieves=described.achieves,
    )
