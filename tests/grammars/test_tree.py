"""From trees in JSON to plans."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.grammars import TreeError, rendered
from gpsfsm.grammars.tree import MAX_CHARACTERS, MAX_LEVELS
from gpsfsm.syntax import parse
from tests.test_package import loaded_by

GO = {"interface": "demo/Go"}
JSON = st.recursive(
    st.one_of(st.none(), st.booleans(), st.integers(), st.floats(), st.text()),
    lambda inner: st.one_of(
        st.lists(inner, max_size=3),
        st.dictionaries(
            st.sampled_from(["plan", "interface", "control", "steps", "parameters", "x"]),
            inner,
            max_size=3,
        ),
    ),
)


def of(*steps: Any) -> str:
    return rendered(json.dumps({"plan": steps}))


def test_a_plan() -> None:
    say = {
        "interface": "demo/Say",
        "provider": "demo/Loud",
        "parameters": {"text": 'a "b" <c> & d\n', "times": 3, "gain": 0.5, "now": True},
    }
    control = {"control": "recovery", "steps": [say, {"control": "parallel_all", "steps": [GO]}]}
    assert of(GO, control) == (
        "<Plan>\n"
        '    <Runner interface="demo/Go" provider="demo/Go"/>\n'
        '    <Control type="recovery">\n'
        '        <Runner interface="demo/Say" provider="demo/Loud" '
        'text="a &quot;b&quot; &lt;c&gt; &amp; d&#10;" times="3" gain="0.5" now="true"/>\n'
        '        <Control type="parallel_all">\n'
        '            <Runner interface="demo/Go" provider="demo/Go"/>\n'
        "        </Control>\n"
        "    </Control>\n"
        "</Plan>"
    )


VALUES = st.one_of(
    st.booleans(),
    st.integers(-(2**63), 2**63 - 1),
    st.floats(allow_nan=False, allow_infinity=False),
    st.text(st.characters(exclude_categories=["Cs", "Cc"], exclude_characters="\ufffe\uffff")),
)


@given(st.dictionaries(st.sampled_from(["a", "b", "é", "steps", "control"]), VALUES))
def test_values_arrive_as_they_are(values: dict[str, Any]) -> None:
    parsed = parse(of({**GO, "parameters": values}))
    assert not [each for each in parsed.problems if each.rule not in ("GP111", "GP112")]
    assert parsed.plan is not None
    (runner,) = parsed.plan.runners
    written = {one.name: one for one in runner.attributes if one.name in values}
    assert written.keys() == values.keys()
    for name, value in values.items():
        if isinstance(value, str):
            assert written[name].text == value
        else:
            assert written[name].value == value
            assert isinstance(written[name].value, type(value))


@given(JSON)
def test_any_json_is_rendered_or_refused(value: Any) -> None:
    for tree in (value, {"plan": value}, {"plan": [value]}):
        try:
            text = rendered(json.dumps(tree))
        except TreeError as error:
            text, line = "<Plan/>", str(error)
        else:
            line = ""
        assert line.isprintable()
        assert not [each for each in parse(text).problems if each.rule in ("GP101", "GP108")]


@given(st.text())
def test_any_text_is_rendered_or_refused(text: str) -> None:
    with pytest.raises(TreeError):
        rendered(text)


def test_a_fence_around_json_is_removed() -> None:
    bare = json.dumps({"plan": [GO]})
    assert rendered(f"```json\n{bare}\n```\n") == rendered(bare) == rendered(f" \n{bare}\n")


def test_lists_and_nothing() -> None:
    text = of({**GO, "parameters": {"a": [1, 2.5, True, "x y"], "b": None}})
    assert 'a="[1, 2.5, true, &quot;x y&quot;]"/>' in text


def nested(levels: int) -> str:
    start, end = '{"control":"recovery","steps":[', "]}"
    return '{"plan":[' + start * levels + json.dumps(GO) + end * levels + "]}"


def test_depth_is_bounded() -> None:
    assert rendered(nested(MAX_LEVELS - 1)).count("<Control") == MAX_LEVELS - 1
    with pytest.raises(TreeError, match="nested deeper than 100 levels"):
        rendered(nested(MAX_LEVELS))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "the answer is not JSON: a value is expected at line 1, column 1"),
        ("{}", "plan: nothing stands where a list of steps is needed"),
        ("[]", 'the answer: a list stands where an object {"plan": […]} is needed'),
        ('{"plan": {}}', "plan: an object stands where a list of steps is needed"),
        (
            '{"plan": [7]}',
            "plan[0]: a number stands where an object with 'interface' or 'control' is needed",
        ),
        ('{"plan": [{}]}', "plan[0].interface: nothing stands where a text is needed"),
        (
            '{"plan": [{"interface": "a", "speed": 1}]}',
            "plan[0]: the key 'speed' is unknown; "
            "the keys here are 'interface', 'provider', 'parameters'",
        ),
        (
            '{"plan": [{"control": "recovery", "steps": [{"control": 1, "steps": []}]}]}',
            "plan[0].steps[0].control: a number stands where a text is needed",
        ),
        (
            '{"plan": [{"interface": "a", "parameters": {"x": {}}}]}',
            "plan[0].parameters.x: an object stands where a text is needed",
        ),
        (
            '{"plan": [{"interface": "a", "parameters": {"x y": 1}}]}',
            "plan[0].parameters: 'x y' cannot be the name of a parameter",
        ),
        (
            '{"plan": [{"interface": "a", "parameters": {"provider": "b"}}]}',
            "plan[0].parameters: 'provider' cannot be the name of a parameter",
        ),
        (
            '{"plan": [{"interface": "a", "parameters": {"x": "\\u0007"}}]}',
            "plan[0]: x holds the character U+0007, which no plan can hold; leave it out",
        ),
        (
            '{"plan": [{"interface": "\\ud800"}]}',
            "plan[0]: interface holds the character U+D800, which no plan can hold; leave it out",
        ),
        (
            '{"plan": [{"interface": "a", "parameters": {"x": 1e999}}]}',
            "plan[0].parameters.x: the number is too great; write a smaller one",
        ),
        ('{"plan": [], "plan": []}', "the answer has the key 'plan' twice in one object"),
        ('{"plan": NaN}', "NaN is not JSON, and no value of a plan"),
        (
            '{"plan": ' + "9" * 5000 + "}",
            "the number 99999999999999999999… has 5000 digits; write a shorter one",
        ),
        ("[" * 100_000, "the answer is nested too deeply to be a plan"),
        (
            " " * (MAX_CHARACTERS + 1),
            "the answer has 4,194,305 characters; a plan in JSON has at most 4,194,304",
        ),
        (
            '{"\\u001b[31m": 1}',
            "the answer: the key '\\x1b[31m' is unknown; the keys here are 'plan'",
        ),
    ],
    ids=range(20),
)
def test_messages(text: str, message: str) -> None:
    with pytest.raises(TreeError) as caught:
        rendered(text)
    assert str(caught.value) == message


def test_rendering_loads_nothing_heavy() -> None:
    heavy = {"z3", "lxml", "lark", "pydantic", "yaml", "httpx", "click", "networkx", "llguidance"}
    assert not heavy & loaded_by("from gpsfsm.grammars import rendered\nrendered('{\"plan\":[]}')")
