"""Placeholders are recognised, and what only looks like one is left alone."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.analysis.flow import Placeholder, placeholder


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("$x", ("x",)),
        ("$response", ("response",)),
        ("$pose.position.x", ("x",)),
        ("$prompt_capabilities/PromptSpeechRunner.text", ("text",)),
        ("${x}", ("x",)),
        ("${ x }", ("x",)),
        ("${prompt_capabilities/PromptSpeechRunner.text}", ("text",)),
        ("${answers[0]}", ("answers",)),
        ("{goal}", ("goal",)),
        ("{{goal}}", ("goal",)),
        ("{{ step.goal }}", ("goal",)),
        ("&plan", ("plan",)),
        ("<text>", ("text",)),
        ("<your text here>", ()),
        (" $x ", ("x",)),
        ("$größe", ("größe",)),
    ],
)
def test_a_whole_value(text: str, names: tuple[str, ...]) -> None:
    assert placeholder(text) == Placeholder(text.strip(), True, names, True)


@pytest.mark.parametrize(
    ("text", "first", "names", "certain"),
    [
        ("The robot says ${text}.", "${text}", ("text",), True),
        ("${a}${b}", "${a}", ("a", "b"), True),
        ("${a.b} and $c", "${a.b}", ("b", "c"), True),
        ("$c and ${a.b}", "${a.b}", ("c", "b"), True),
        ("I see $answer.", "$answer", ("answer",), False),
        ("$x $y $x", "$x", ("x", "y"), False),
        ("Hello {name}, welcome", "{name}", ("name",), False),
        ("Hello {{ name }}!", "{{ name }}", ("name",), False),
        ("plan_{id}", "{id}", ("id",), False),
        ('{"object": "{target}"}', "{target}", ("target",), False),
        ("{$name}", "$name", ("name",), False),
        ("$$x ${y}", "${y}", ("y",), True),
    ],
)
def test_inside_longer_text(text: str, first: str, names: tuple[str, ...], certain: bool) -> None:
    assert placeholder(text) == Placeholder(first, False, names, certain)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "$",
        "$5",
        "It costs $5, or 7$ at the desk.",
        "US$ and AU$20",
        "{}",
        "{ }",
        '{"a": 1}',
        '{"a": {"b": [1, 2]}}',
        "{a, b}",
        "{1}",
        "{a b}",
        "^[a-z]{2,3}$",
        "[a-z]{n}",
        r"\$x",
        r"\frac{a}{b}",
        r"$\alpha$",
        "$x$",
        "the value $x + y$ is right",
        "x_{i}",
        "x^{n}",
        "${x}$",
        "R&D",
        "&",
        "&lt;",
        "a < b > c",
        "<b>bold</b>",
        "<br/>",
        "< 5",
        "press <enter> now",
        "plain text",
    ],
)
def test_what_is_none(text: str) -> None:
    assert placeholder(text) is None


def test_at_most_twenty_names() -> None:
    reference = placeholder(" ".join(f"${{n{number}}}" for number in range(100)))
    assert reference is not None
    assert reference.names == tuple(f"n{number}" for number in range(20))


@given(st.text(alphabet='$&<>{}ax_.:/[]-^\\ 1"', max_size=30))
def test_what_is_found_stands_in_the_text(text: str) -> None:
    reference = placeholder(text)
    if reference is None:
        return
    assert reference.text in text
    assert reference.text[0] in "$&<{"
    assert reference.whole == (reference.text == text.strip())
    assert reference.certain or not reference.whole
    assert all(name in text for name in reference.names)
