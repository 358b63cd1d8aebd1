"""ParameterValidation of fabric-v3, against its rules written out over the connections."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hypothesis import event, given, settings
from hypothesis import strategies as st

from gpsfsm.capabilities.library import Library
from gpsfsm.compile.engine_text import EngineReading, EngineText, read_for_engine
from gpsfsm.compile.validation import Renamed, Taken, Validation
from gpsfsm.model.capability import Input, Interface, Output, Parameter, Provider, Source, ValueType
from gpsfsm.model.engine import Connection, EnginePlan, Rejected
from gpsfsm.model.event import Event
from tests.cases import many
from tests.compile.fabric.brute import RUNNER, Node, to_xml
from tests.compile.fabric.support import listed
from tests.compile.fabric.test_random import any_children, controls

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

WORDS = {"": ValueType.ANY, "int": ValueType.INT, "bool": ValueType.BOOL, "boolean": ValueType.BOOL}
UPSTREAM_OR_PLAN = (Source.UPSTREAM, Source.EXTERNAL)
keys = st.sampled_from(["a", "b", "c"])
semantic = st.sampled_from(["", "", "a", "k"])
aliases = st.lists(keys | st.just("k"), max_size=1).map(tuple)
words = st.sampled_from(["", "", "", "", "int", "bool", "boolean"])


def _input(name: str, word: str, key: str, others: tuple[str, ...], **more: object) -> Input:
    other = "" if WORDS[word].value == word else word
    return Input(
        name, WORDS[word], semantic_key=key, aliases=others, type_word=other, **more  # type: ignore[arg-type]
    )  # fmt: skip


def _output(name: str, word: str, key: str, others: tuple[str, ...], happened: Event) -> Output:
    other = "" if WORDS[word].value == word else word
    return Output(
        name, WORDS[word], happened, semantic_key=key, aliases=others, type_word=other
    )  # fmt: skip


inputs = st.builds(
    _input, keys, words, semantic, aliases,
    demanded=st.sampled_from([True, True, False]),
    required=st.booleans(),
    default=st.sampled_from([None, None, 1]),
    satisfiable_from=st.sampled_from([(), (), (Source.UPSTREAM,), UPSTREAM_OR_PLAN])
    | st.lists(st.sampled_from(Source), max_size=2, unique=True).map(tuple),
    fallback=st.sampled_from(["", "", "d"]),
)  # fmt: skip
outcomes = st.sampled_from([Event.SUCCEEDED, Event.SUCCEEDED, Event.FAILED])
outputs = st.builds(_output, keys, words, semantic, aliases, outcomes)
parameters = st.builds(Parameter, st.sampled_from("abd"), default=st.sampled_from([None, 1]))


@st.composite
def libraries(draw: st.DrawFn) -> Library:
    """Three runners of which everything is described; there is nothing else."""
    providers = []
    for name in ("t/A", "t/B", "t/C"):
        taken = draw(st.lists(inputs, max_size=1, unique_by=lambda each: each.name))
        configured = draw(st.lists(parameters, max_size=2, unique_by=lambda each: each.name))
        drawn = draw(
            st.lists(
                outputs, min_size=1, max_size=2, unique_by=lambda each: (each.name, each.event)
            )
        )
        providers.append(
            Provider(
                name, name, described=True, configuration=tuple(configured),
                inputs=tuple(taken), outputs=tuple(drawn),
            )
        )  # fmt: skip
    named = tuple(Interface(each.name) for each in providers)
    return Library(named, tuple(providers), complete=True)


written = st.lists(st.sampled_from("abdk"), max_size=1)
runners = st.builds(
    lambda name, names: Node(
        RUNNER, (("interface", name), ("provider", name), *((each, "x") for each in names))
    ),
    st.sampled_from(["t/A", "t/B", "t/C"]),
    written,
)
plans = st.lists(
    st.one_of(runners, st.recursive(runners, controls, max_leaves=5)), min_size=1, max_size=4
)


# -- the rules, written out ------------------------------------------------------------------------


def keys_of(value: Input | Output) -> set[str]:
    return {key for key in (value.name, value.semantic_key, *value.aliases) if key}


def word_of(value: Input | Output) -> str:
    return value.type_word or str(value.type.value)


def ways(plan: Sequence[Connection], target: Connection) -> Iterator[tuple[Connection, Event]]:
    """The entries with a connection to an instance, and by which event."""
    for entry in plan:
        for happened, node in (
            (Event.STARTED, entry.on_start),
            (Event.SUCCEEDED, entry.on_success),
            (Event.FAILED, entry.on_failure),
        ):
            if node is not None and node.named and node.instance == target.source.instance:
                yield entry, happened


def matching(
    plan: Sequence[Connection], target: Connection, wanted: Input, library: Library
) -> Iterator[tuple[Output, Event]]:
    for entry, happened in ways(plan, target):
        giver = library.provider(entry.source.interface)
        for output in giver.outputs if giver else ():
            same = word_of(output) == word_of(wanted) or "" in (word_of(output), word_of(wanted))
            if same and keys_of(output) & keys_of(wanted):
                yield output, happened


def by_plan(target: Connection, wanted: Input, provider: Provider) -> tuple[bool, bool]:
    """Whether the plan writes it, and whether a parameter or a default stands in for it."""
    sources = wanted.satisfiable_from
    names = {each.name for each in target.source.parameters}
    explicit = bool(names & {wanted.name, *wanted.aliases})
    explicit = explicit and (Source.EXTERNAL in sources or Source.CONFIGURATION in sources)
    stand_in = [
        each for each in provider.configuration if each.name == (wanted.fallback or wanted.name)
    ]
    defaulted = any(each.default is not None for each in stand_in)
    fallback = Source.CONFIGURATION in sources and (
        defaulted or any(each.name in names for each in stand_in)
    )
    default = Source.DEFAULT in sources and (defaulted or wanted.default is not None)
    return explicit, fallback or default


def first_refusal(plan: EnginePlan, library: Library) -> str:
    """What the engine says of a plan; "" if it accepts it."""
    for entry in plan.connections:
        provider = library.provider(entry.source.interface)
        for wanted in provider.inputs if provider else ():
            assert provider is not None
            upstream = not wanted.satisfiable_from or Source.UPSTREAM in wanted.satisfiable_from
            taken = upstream and any(matching(plan.connections, entry, wanted, library))
            if wanted.demanded and not taken and not any(by_plan(entry, wanted, provider)):
                key = f" (semantic_key={wanted.semantic_key})" if wanted.semantic_key else ""
                name = entry.source.interface
                return (
                    f"Unsatisfied required runtime input '{wanted.name}' for capability {name} "
                    f"provider {name}{key}"
                )
    return ""


def missing(plan: EnginePlan, library: Library) -> list[tuple[int, str]]:
    """The demanded inputs that the plan passes with, and that are not there at run time."""
    lacking = []
    for entry in plan.connections:
        provider = library.provider(entry.source.interface)
        for wanted in provider.inputs if provider else ():
            assert provider is not None
            comes = any(
                output.name == wanted.name and output.event is happened
                for output, happened in matching(plan.connections, entry, wanted, library)
            )
            here = wanted.name in {each.name for each in entry.source.parameters}
            if wanted.demanded and not (comes or here or by_plan(entry, wanted, provider)[1]):
                lacking.append((entry.source.instance, wanted.name))
    return lacking


# -- the comparison --------------------------------------------------------------------------------


@settings(max_examples=many(400))
@given(plans.map(tuple), libraries())
def test_validation(children: tuple[Node, ...], library: Library) -> None:
    text = to_xml(Node("Plan", (), children))
    second = read_for_engine(text, "fabric-v2", "plan.xml", library)
    third = read_for_engine(text, "fabric-v3", "plan.xml", library)
    if not isinstance(second, EngineReading):
        assert isinstance(third, EngineText)
        assert isinstance(third.result, Rejected)
        assert isinstance(second.result, Rejected)
        assert third.result.message == second.result.message
        return
    expected = first_refusal(second.connections, library)
    event("refused" if expected else "accepted")
    if expected:
        assert isinstance(third, EngineText)
        assert isinstance(third.result, Rejected)
        assert third.result.message == expected
        assert text[third.result.offset :].startswith("<Runner")
        return
    assert isinstance(third, EngineReading)
    assert third.compiled.automaton.edges == second.compiled.automaton.edges
    instances = [
        each.source.instance
        for each in third.connections.connections
        if each.source.element is not None
    ]
    unreceived = Validation(third.compiled, library).unreceived()
    actual = [(instances[each.runner], each.wanted.name) for each in unreceived]
    assert actual == missing(third.connections, library)
    if actual:
        event("accepted, and something is missing")


@given(any_children.map(tuple))
@settings(max_examples=many(100))
def test_connections_are_those_of_the_second_version(children: tuple[Node, ...]) -> None:
    text = to_xml(Node("Plan", (), children))
    assert listed(3, text) == listed(2, text)


# -- what is told ----------------------------------------------------------------------------------

GIVE = Provider("t/Give", "t/Give", described=True, outputs=(Output("x"),))
TAKE = Provider("t/Take", "t/Take", described=True, inputs=(Input("x", demanded=True),))
ELSE = Provider("t/Else", "t/Else", described=True)


def library_of(*providers: Provider, complete: bool = True) -> Library:
    named = tuple(Interface(name) for name in dict.fromkeys(each.implements for each in providers))
    return Library(named, providers, complete=complete)


def step(name: str, more: str = "", provider: str = "") -> str:
    return f'<Runner interface="{name}" provider="{provider or name}" {more}/>'


def outcome(library: Library, *steps: str) -> str:
    """The reason of the refusal, "" if there is none."""
    text = f"<Plan>{''.join(steps)}</Plan>"
    reading = read_for_engine(text, "fabric-v3", "plan.xml", library)
    if isinstance(reading, EngineReading):
        return ""
    assert isinstance(reading.result, Rejected)
    assert reading.result.elements == ()
    return f"{reading.line}:{reading.column} {reading.result.reason}"


LIBRARY = library_of(GIVE, TAKE, ELSE)


def test_a_value_behind_a_join_is_told_as_such() -> None:
    recovery = f'\n<Control type="recovery">{step("t/Else")}</Control>\n'
    assert outcome(LIBRARY, step("t/Give"), recovery, step("t/Take")) == (
        "3:1 nothing provides the input 'x' of this runner: Give at line 1 outputs "
        "it, but only through the join of the recovery at line 2, and joins pass "
        "no values on"
    )


def test_a_value_on_a_failure_passes() -> None:
    assert (
        outcome(LIBRARY, step("t/Give"), f'<Control type="recovery">{step("t/Take")}</Control>')
        == ""
    )


def test_one_hop_is_all() -> None:
    assert outcome(LIBRARY, step("t/Give"), step("t/Take")) == ""
    assert "neither a step that leads directly to it nor the plan" in outcome(
        LIBRARY, step("t/Give"), step("t/Else"), step("t/Take")
    )
    assert "so the attribute does not count" in outcome(LIBRARY, step("t/Take", 'x="1"'))


def test_a_provider_that_the_robot_lacks() -> None:
    refused = "1:7 the robot has no such provider of this runner's interface"
    assert outcome(LIBRARY, step("t/Fly")) == refused
    assert outcome(LIBRARY, step("t/Give", provider="t/Else")) == refused
    assert outcome(LIBRARY, step("t/Give", provider="t/Fly")) == refused
    partly = replace(LIBRARY, complete=False)
    assert outcome(partly, step("t/Fly")) == ""
    assert outcome(partly, step("t/Give", provider="t/Else")) == refused


def test_nobody_knows_what_an_undescribed_runner_hands_over() -> None:
    assert outcome(replace(LIBRARY, complete=False), step("t/Fly"), step("t/Take")) == ""
    silent = library_of(TAKE, Provider("t/Old", "t/Old", version="1.1"))
    assert "nothing provides" in outcome(silent, step("t/Old"), step("t/Take"))


def test_a_definition_that_is_lent_is_none_to_the_engine() -> None:
    """The robot's own file, of an older form, says nothing of inputs and outputs."""
    older = Library(providers=(Provider("t/Take", "t/Take", version="1.1", origin="robot.yaml"),))
    assert outcome(library_of(TAKE).extended(older), step("t/Take")) == ""
    older = Library(providers=(Provider("t/Give", "t/Give", version="1.1", origin="robot.yaml"),))
    assert "nothing provides" in outcome(LIBRARY.extended(older), step("t/Give"), step("t/Take"))


def test_kinds_of_what_is_missing_at_run_time() -> None:
    wanted = Input(
        "y", semantic_key="x", aliases=("z",), satisfiable_from=UPSTREAM_OR_PLAN, demanded=True
    )
    changed = replace(TAKE, inputs=(wanted,))
    library = library_of(GIVE, changed)
    for steps, kind in (
        ((step("t/Give"), step("t/Take")), Taken),
        ((step("t/Take", 'z="1"'),), Renamed),
    ):
        reading = read_for_engine(f"<Plan>{''.join(steps)}</Plan>", "fabric-v3", "a", library)
        assert isinstance(reading, EngineReading)
        (actual,) = Validation(reading.compiled, library).unreceived()
        assert isinstance(actual, kind)
