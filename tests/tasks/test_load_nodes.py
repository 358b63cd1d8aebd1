"""The nodes of a task file."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import ConfigError
from gpsfsm.tasks.load import read_task
from gpsfsm.tasks.task import NodeForm

STEPS = "{places: {A: {x: 1}}, steps: [{do: A}], nodes: %s}"


def nodes(text: str) -> tuple[NodeForm, ...]:
    return read_task((STEPS % text).encode()).nodes


def messages(text: str) -> list[str]:
    with pytest.raises(ConfigError) as caught:
        read_task((STEPS % text).encode(), file="t")
    lines = str(caught.value).splitlines()
    return [line.partition(" error: ")[2] for line in lines if not line.startswith(" ")]


def test_nodes_and_their_ports() -> None:
    assert nodes("{}") == ()
    assert nodes("{Go: to, Say: [text, voice], Stop: []}") == (
        NodeForm("Go", ("to",)),
        NodeForm("Say", ("text", "voice")),
        NodeForm("Stop"),
    )
    assert nodes("{Go: {ports: to, form: compact}, Say: {form: any}, Stop: {}}") == (
        NodeForm("Go", ("to",), compact=True),
        NodeForm("Say"),
        NodeForm("Stop"),
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[Go]", "'nodes' must be a mapping ('key: value' lines), not a list"),
        ("{Sequence: []}", "'Sequence' is a built-in node"),
        ("{Go to: []}", "'Go to' is not a name for a node"),
        ("{Go: }", "the ports must be a name or a list of names"),
        ("{Go: [[to]]}", "the ports must be a name or a list of names"),
        ("{Go: {ports: {to: x}}}", "the ports must be a name or a list of names"),
        ("{Go: [to, 'a b']}", "'a b' is not a name for a port"),
        ("{Go: {port: to}}", "'port' is not a key of a node"),
        ("{Go: {form: short}}", "'form' must be compact or any"),
        ("{Go: {form: [compact]}}", "'form' must be compact or any"),
        ("{Go: [" + "a, " * 101 + "]}", "there are more than 100 ports here"),
        ("{" + "".join(f"N{n}: a, " for n in range(1001)) + "}", "there are more than 1000 nodes"),
    ],
)  # fmt: skip
def test_what_is_said_about_nodes_that_make_no_sense(text: str, message: str) -> None:
    (line,) = messages(text)
    assert line.startswith(message)


@given(st.text(st.sampled_from("{}[]:, ax\n'"), max_size=20))
def test_nothing_breaks_it(text: str) -> None:
    with contextlib.suppress(ConfigError):
        assert isinstance(nodes(text), tuple)
