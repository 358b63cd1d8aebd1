"""Grammars for constrained decoding in real engines, at the level of token masks.

Canonical plans are accepted, sentences of a grammar are plans without errors, and what is damaged
is refused: by all engines alike.
"""

from __future__ import annotations

import json
import re
from functools import cache
from typing import TYPE_CHECKING

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from gpsfsm.capabilities.library import Capabilities, Library, builtin_capabilities
from gpsfsm.grammars import TreeError, alphabet, grammars_for, rendered
from gpsfsm.grammars.emit.json_schema import schema
from gpsfsm.model.capability import Interface, Parameter, Provider, ValueType
from gpsfsm.model.plan import ControlType
from tests.grammars.engines import Engines, accepts, allowed, errors, matcher, sentence
from tests.grammars.gbnf import Gbnf
from tests.grammars.libraries import canonical_plans, capabilities

if TYPE_CHECKING:
    from random import Random

LIBRARY = builtin_capabilities().library
RANDOM = st.randoms(use_true_random=True)
FEW = settings(max_examples=max(1, settings.default.max_examples // 2))
WAIT = "generic_capabilities/WaitRunner"
WAYPOINT = "nav2_capabilities/WaypointRunner"


@cache
def builtin() -> Engines:
    return Engines.of(builtin_capabilities())


def runner(name: str, **parameters: str) -> str:
    words = "".join(f' {key}="{value}"' for key, value in parameters.items())
    return f'<Runner interface="{name}" provider="{name}"{words}/>'


def plan(*lines: str) -> str:
    return "\n".join(["<Plan>", *(f"    {line}" for line in lines), "</Plan>"])


PLAN = plan(
    runner(WAYPOINT, x="1.5", y="-2"),
    '<Control type="recovery">',
    f"    {runner(WAIT, seconds='2')}",
    "</Control>",
    runner("perception_capabilities/SpeechRunner", text="Hello!"),
)


def agreed(engines: Engines, text: str) -> bool:
    """What the engines say, which must be the same."""
    verdicts = engines.verdicts(text)
    assert len(set(verdicts.values())) == 1, (verdicts, text)
    return verdicts["lark"]


# -- plans ⊆ sentences ------------------------------------------------------------------------


@given(canonical_plans(LIBRARY))
@FEW  # tests/campaigns/pairs/grammars.py puts very many more
def test_canonical_plans_are_accepted(text: str) -> None:
    assert agreed(builtin(), text)
    assert errors(text, builtin_capabilities()) == []


def test_the_longest_control_is_accepted_and_no_longer_one() -> None:
    step = runner(WAIT, seconds="1")
    assert agreed(builtin(), plan(*[step] * 64))
    assert not agreed(builtin(), plan(*[step] * 65))


@pytest.mark.parametrize("depth", [1, 2, 6, 9])
def test_the_depth_is_bounded(depth: int) -> None:
    engines = Engines.of(builtin_capabilities(), depth=depth)

    def nested(levels: int) -> str:
        start = ["    " * level + '<Control type="sequential">' for level in range(1, levels)]
        end = ["    " * level + "</Control>" for level in range(levels - 1, 0, -1)]
        inner = "    " * levels + runner(WAIT, seconds="1")
        return "\n".join(["<Plan>", *start, inner, *end, "</Plan>"])

    assert agreed(engines, nested(depth))
    assert not agreed(engines, nested(depth + 1))


# -- sentences ⊆ plans without errors ---------------------------------------------------------


@pytest.mark.parametrize("kind", ["gbnf", "lark"])
@given(RANDOM)
def test_sentences_are_plans_without_errors(kind: str, random: Random) -> None:
    engines = builtin()
    text = sentence(kind, getattr(engines, kind), random)
    assert errors(text, builtin_capabilities()) == []
    assert agreed(engines, text)


@pytest.mark.parametrize("patterns", [True, False])
@given(RANDOM)
@FEW
def test_trees_become_plans_without_errors(patterns: bool, random: Random) -> None:
    library = builtin_capabilities()
    text = json.dumps(schema(alphabet(library.library), 3, patterns=patterns))
    _is_sound(sentence("json_schema", text, random), library, patterns=patterns)


@given(capabilities(), RANDOM)
def test_trees_over_any_library_become_plans_without_errors(
    library: Capabilities, random: Random
) -> None:
    text = json.dumps(schema(alphabet(library.library), 2, patterns=True))
    _is_sound(sentence("json_schema", text, random), library, patterns=True)


def _is_sound(tree: str, library: Capabilities, *, patterns: bool) -> None:
    try:
        text = rendered(tree)
    except TreeError as error:
        # control characters and too great numbers are all that a schema cannot forbid
        assert re.search(r"no plan can hold|too great|digits; write", str(error))  # noqa: PT017
        assume(False)
        raise
    messages = errors(text, library)
    assert [each for each in messages if patterns or not each.startswith("GP207")] == []


# -- what is damaged --------------------------------------------------------------------------


@given(canonical_plans(LIBRARY, depth=2), st.data())
def test_mutants(text: str, data: st.DataObject) -> None:
    place = data.draw(st.integers(0, len(text) - 1))
    wild = data.draw(st.sampled_from([*'<>"/= &;$\n\t{x0.-', "\x01", "é", "\ufffe", "</Plan>"]))
    mutant = data.draw(
        st.sampled_from(
            [
                text[:place] + text[place + 1 :],
                text[:place] + wild + text[place:],
                text[:place] + wild + text[place + 1 :],
                text[:place] + text[place:][::-1],
                text[: place + 1],
            ]
        )
    )
    if agreed(builtin(), mutant):
        assert errors(mutant, builtin_capabilities()) == []


@pytest.mark.parametrize(
    "mutant",
    [
        "",
        "<Plan>\n</Plan>",
        f"Here is the plan:\n{PLAN}",
        f"```xml\n{PLAN}\n```",
        f"{PLAN}\n",
        f"{PLAN} ",
        f'<?xml version="1.0"?>\n{PLAN}',
        PLAN.replace("\n    ", "\n  "),
        PLAN.replace("\n", ""),
        PLAN.replace("<Plan>", '<Plan name="x">'),
        PLAN.replace(f'interface="{WAYPOINT}"', f'interface="{WAIT}"'),
        PLAN.replace(f'provider="{WAYPOINT}"', f'provider="{WAIT}"'),
        PLAN.replace(WAYPOINT, "nav2_capabilities/FlyRunner"),
        PLAN.replace(WAYPOINT, "nav2_capabilities/Waypoint"),
        PLAN.replace(WAYPOINT, "capabilities2_runner_nav2/WaypointRunner"),
        PLAN.replace(WAYPOINT, "fabric_capabilities/FabricCompletionRunner"),
        PLAN.replace(' seconds="2"', ""),
        PLAN.replace('"2"', '"-1"'),
        PLAN.replace('"2"', '"2s"'),
        PLAN.replace('"2"', '"nan"'),
        PLAN.replace('"2"', '""'),
        PLAN.replace('"2"', '"1e400"'),
        PLAN.replace(' x="1.5" y="-2"', ' y="-2" x="1.5"'),
        PLAN.replace(' x="1.5"', ' x="1.5" x="1.5"'),
        PLAN.replace(' y="-2"', ' y="-2" speed="1"'),
        PLAN.replace(' y="-2"', ' y="-2" name="a"'),
        PLAN.replace("Hello!", "$text"),
        PLAN.replace("Hello!", "I am at ${pose.x}"),
        PLAN.replace("Hello!", "{text}"),
        PLAN.replace("Hello!", "&lt;text&gt;"),
        PLAN.replace("Hello!", "&amp;text"),
        PLAN.replace("Hello!", "\u3000&amp;text"),
        PLAN.replace("Hello!", "a < b"),
        PLAN.replace("Hello!", "R&D"),
        PLAN.replace("Hello!", "&nbsp;"),
        PLAN.replace("Hello!", "bell\x07"),
        PLAN.replace("recovery", "fallback"),
        PLAN.replace(' type="recovery"', ""),
        re.sub(r'(?s)(<Control type="recovery">).*(\n    </Control>)', r"\1\2", PLAN),
        PLAN.replace("</Control>", "</Plan>"),
        PLAN.replace("/>", "></Runner>"),
    ],
    ids=ascii,
)
def test_refused(mutant: str) -> None:
    assert mutant != PLAN
    assert agreed(builtin(), PLAN)
    assert not agreed(builtin(), mutant)


# -- masks ------------------------------------------------------------------------------------


def words_after(text: str, end: str) -> set[str]:
    """The words that a model may write next, up to and without ``end``."""
    start = matcher("gbnf", builtin().gbnf)
    assert start.try_consume_tokens(list(text.encode())) == len(text)
    result, pending = set(), [(start, "")]
    while pending:
        current, written = pending.pop()
        for byte in allowed(current):
            if chr(byte) == end:
                result.add(written)
                continue
            following = current.deep_copy()
            assert following.consume_token(byte)
            pending.append((following, written + chr(byte)))
    return result


def test_masks_at_points_of_decision() -> None:
    start = "<Plan>\n    <"
    assert words_after("", "\n") == {"<Plan>"}
    assert words_after(f"{start}", " ") == {"Runner", "Control"}
    assert words_after(f'{start}Control type="', '"') == {kind.value for kind in ControlType}
    runners = alphabet(LIBRARY).runners
    names = {each.interface for each in runners}
    assert words_after(f'{start}Runner interface="', '"') == names
    wait = f'{start}Runner interface="{WAIT}" '
    assert words_after(wait, '"') == {"provider="}
    assert words_after(f'{wait}provider="', '"') == {WAIT}
    assert words_after(f'{wait}provider="{WAIT}" ', '"') == {"seconds="}
    log = "generic_capabilities/LogRunner"
    level = f'{start}Runner interface="{log}" provider="{log}" text="x" level="'
    assert words_after(level, '"') == {"debug", "info", "warning", "error"}


def test_after_the_plan_only_the_end_is_allowed() -> None:
    for kind in ("gbnf", "lark"):
        match = matcher(kind, getattr(builtin(), kind))
        assert match.try_consume_tokens(list(PLAN.encode())) == len(PLAN)
        assert match.is_accepting()
        assert all(number > 255 for number in allowed(match))


def optional(size: int) -> Capabilities:
    words = tuple(Parameter(f"p{number}", ValueType.INT, default="1") for number in range(size))
    provider = Provider(WAIT, WAIT, described=True, configuration=words)
    return Capabilities(Library((Interface(WAIT),), (provider,), complete=True))


def with_some(*numbers: int) -> str:
    return plan(runner(WAIT, **{f"p{number}": "5" for number in numbers}))


def test_twenty_parameters_that_may_be_left_out() -> None:
    engines = Engines.of(optional(20), depth=2)
    for numbers in ((), (0,), (9, 10, 19), range(20)):
        assert agreed(engines, with_some(*numbers))
    assert not agreed(engines, with_some(10, 9))
    assert not agreed(engines, with_some(20))


def test_sixty_parameters_that_may_be_left_out_on_a_server() -> None:
    """Where decoding is constrained while a model writes."""
    grammars = {str(key): text for key, text in grammars_for(optional(60), depth=2)}
    read = Gbnf(grammars["gbnf"])
    for numbers in ((), (0,), (9, 10, 59), range(60)):
        assert read.accepts(with_some(*numbers))
    for kind in ("lark", "gbnf"):
        for numbers in ((), (0,), (9, 10, 59), range(60)):
            assert accepts(kind, grammars[kind], with_some(*numbers))
        assert not accepts(kind, grammars[kind], with_some(10, 9))
        assert not accepts(kind, grammars[kind], with_some(60))


def fleet(size: int) -> tuple[list[str], Capabilities]:
    names = [f"fleet_{number}/Runner{number}" for number in range(size)]
    speed = Parameter("speed", ValueType.DOUBLE, required=True, minimum=0, maximum=2.5)
    providers = [Provider(name, name, described=True, configuration=(speed,)) for name in names]
    library = Library(tuple(map(Interface, names)), tuple(providers), complete=True)
    return names, Capabilities(library)


def test_two_hundred_interfaces() -> None:
    names, library = fleet(200)
    engines = Engines.of(library, depth=2)
    assert agreed(engines, plan(runner(names[199], speed="2.5")))
    assert not agreed(engines, plan(runner(names[199], speed="2.50000001")))
    assert not agreed(engines, plan(runner("fleet_1/Runner2", speed="1")))


def test_a_thousand_interfaces_on_a_server() -> None:
    """Where decoding is constrained while a model writes."""
    names, library = fleet(1000)
    grammars = {str(key): text for key, text in grammars_for(library, depth=2)}
    for kind in ("lark", "gbnf"):
        assert accepts(kind, grammars[kind], plan(runner(names[999], speed="2.5")))
        assert not accepts(kind, grammars[kind], plan(runner(names[999], speed="2.50000001")))
        assert not accepts(kind, grammars[kind], plan(runner("fleet_1/Runner2", speed="1")))
    step = {"interface": names[500], "parameters": {"speed": 1}}
    tree = json.dumps({"plan": [step]}, separators=(",", ":"))
    assert accepts("json_schema", grammars["json-schema"], tree)
