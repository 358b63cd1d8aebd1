"""Scripts of trees: their faults and keys, and the real BehaviorTree.CPP as their judge."""

from __future__ import annotations

import random
from xml.sax.saxutils import quoteattr

import pytest

from gpsfsm.syntax.scripts import Script, read_script
from tests.cases import many

TOKENS = (
    *("a", "b", "@c", "a1", "1", "2.5", "+1", "0x1f", "'t'", "true", ":=", "=", "+=", "==", "!="),
    *("<", "<=", ">", "&&", "||", "&", "|", "^", "!", "~", "-", "+", "*", "/", "..", "?", ":"),
    *("(", ")", ";", " "),
)
INFIX = ("==", "<", "&&", "||", "&", "|", "^", "+", "-", "*", "/", "..", " <= ", " == ", " + ")
ODD = ("", "a..b", "1..2", "truex", "é := 1", "a := 'é'", "0XFF", "+a", "+1", "a?b:c?d:e", "!-1")


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("a := ", 5),
        ("a + b | c", 6),
        ("(a + b) | c", -1),
        ("!a && b == c + 1", 13),
        ("!a && b == (c + 1)", -1),
        ("!a ? b + 1 : c", -1),
        ("!a ? b : c + 1", 11),
        ("a | b; c + d", -1),
        ("a?b:c?d:e", 5),
        ("trueish", 4),
        ("x == +a", 5),
        ("", 0),
    ],
)
def test_the_fault_of_a_script(text: str, fault: int) -> None:
    assert read_script(text).fault == fault


def test_the_keys_of_a_script() -> None:
    script = read_script("count += 1; goal := (true ? @home : other); limit = 'x'")
    assert script == Script(("count", "@home", "other"), ("count", "goal", "limit"))


def test_a_deep_script_is_no_crash() -> None:
    assert read_script("(" * 4000 + "a" + ")" * 4000).fault == -1
    assert read_script("(" * 4000).fault == 4000


def _expression(choose: random.Random, depth: int) -> str:
    if depth <= 0:
        return choose.choice(("a", "b", "@c", "1", "2.5", "'t'", "true"))
    kind = choose.random()
    inner = _expression(choose, depth - 1)
    if kind < 0.6:
        return inner + choose.choice(INFIX) + _expression(choose, depth - 2)
    if kind < 0.75:
        return f"({inner})"
    if kind < 0.85:
        return choose.choice("!-~") + inner
    if kind < 0.93:
        return f"{_expression(choose, depth - 2)}?{inner}:{_expression(choose, depth - 2)}"
    return "a" + choose.choice((":=", "=", "+=", " := ")) + inner


def _script(choose: random.Random) -> str:
    """A script, or an expression with a token too much, or tokens as they come."""
    if choose.random() < 0.4:
        return "".join(choose.choice(TOKENS) for _ in range(choose.randint(1, 7)))
    text = _expression(choose, choose.randint(1, 4))
    if choose.random() < 0.4:
        at = choose.randrange(len(text) + 1)
        text = text[:at] + choose.choice(TOKENS) + text[at + choose.randint(0, 1) :]
    return text


def test_the_engine_takes_what_we_take() -> None:
    reason = "the wheel behaviortreepy is not installed"
    factory = pytest.importorskip("behaviortreepy", reason=reason).BehaviorTreeFactory()
    choose = random.Random(11)  # noqa: S311
    taken = 0
    for text in (*ODD, *(_script(choose) for _ in range(many(2500)))):
        if text.rstrip().endswith(";"):
            continue  # releases differ
        node = f"<AlwaysSuccess _onSuccess={quoteattr(text)}/>"
        tree = f'<root BTCPP_format="4"><BehaviorTree ID="M">{node}</BehaviorTree></root>'
        try:
            factory.create_tree_from_text(tree)
        except Exception:
            loads = False
        else:
            loads = True
        assert loads == (read_script(text).fault < 0), text
        taken += loads
    assert taken > many(500)
