"""Values written so that the engine reads the type that a runner takes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.compile.fabric_parameters import typed as typed_by_engine
from gpsfsm.model.capability import ValueType
from gpsfsm.model.engine import OptionType
from gpsfsm.model.plan import value_key
from gpsfsm.porting import port
from gpsfsm.porting.respelling import respelled
from gpsfsm.syntax.values import typed

OPTIONS = {
    ValueType.DOUBLE: OptionType.DOUBLE,
    ValueType.INT: OptionType.INT,
    ValueType.STRING: OptionType.STRING,
    ValueType.BOOL: OptionType.BOOL,
}
SPELLINGS = st.one_of(
    st.text(alphabet="0123456789+-.eExX tTrRuUeEfFaAlLsS", max_size=8),
    st.integers(-(2**70), 2**70).map(str),
    st.floats().map(repr),
    st.sampled_from(["", " ", "true", "False", "nan", "inf", "0x1F", "1e400", "007"]),
)


@given(text=SPELLINGS, wanted=st.sampled_from(sorted(OPTIONS)))
def test_the_engine_reads_the_type_and_safe_means_the_same_value(
    text: str, wanted: ValueType
) -> None:
    spelling = respelled(text, wanted)
    if spelling is None:
        return
    assert typed_by_engine("x", spelling.text).type is OPTIONS[wanted]
    assert spelling.safe == (value_key(typed(spelling.text)) == value_key(typed(text)))


@pytest.mark.parametrize(
    ("text", "wanted", "new", "safe"),
    [
        ("1", ValueType.DOUBLE, "1.0", True),
        ("-07", ValueType.DOUBLE, "-7.0", True),
        ("3000000000", ValueType.DOUBLE, "3000000000.0", True),
        ("9007199254740993", ValueType.DOUBLE, "9007199254740993.0", False),
        ("2.0 ", ValueType.DOUBLE, "2.0", False),
        ("2.0", ValueType.INT, "2", True),
        ("1e3", ValueType.INT, "1000", True),
        ("42", ValueType.STRING, "42 ", False),
        ("true", ValueType.STRING, "true ", False),
        ("", ValueType.STRING, " ", False),
        ("True", ValueType.BOOL, "true", False),
        ("0", ValueType.BOOL, "false", False),
    ],
)
def test_spellings(text: str, wanted: ValueType, new: str, safe: bool) -> None:
    assert respelled(text, wanted) == (new, safe)


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("far", ValueType.DOUBLE),
        ("true", ValueType.DOUBLE),
        ("1e400", ValueType.DOUBLE),
        ("2.5", ValueType.INT),
        ("inf", ValueType.INT),
        ("nan", ValueType.INT),
        ("maybe", ValueType.BOOL),
    ],
)
def test_no_spelling(text: str, wanted: ValueType) -> None:
    assert respelled(text, wanted) is None


def waypoint(x: str) -> str:
    name = "nav2_capabilities/WaypointRunner"
    return f'<Runner interface="{name}" provider="{name}" x="{x}" y="2.0"/>'


def speech(text: str) -> str:
    name = "prompt_capabilities/PromptTextRunner"
    return f"<Runner interface='{name}' provider='{name}' text='{text}'/>"


def test_an_integer_becomes_a_double_in_place() -> None:
    text = f"<Plan>\n\n{waypoint('1')}<!-- c -->\n</Plan>\n"
    ported = port(text, "fabric-v2")
    assert ported.text == text.replace('x="1"', 'x="1.0"')
    assert [note.text for note in ported.notes] == [
        'x="1" is changed to x="1.0", which fabric-v2 reads as a double'
    ]
    assert (ported.notes[0].line, ported.notes[0].column) == (
        3,
        text.splitlines()[2].find("x=") + 1,
    )


def test_the_first_version_does_not_type() -> None:
    text = f"<Plan>{waypoint('1')}</Plan>"
    ported = port(text, "fabric-v1")
    assert ported.text == text
    assert not ported.changed


def test_another_value_is_unsafe() -> None:
    text = f"<Plan>{speech('42')}</Plan>"
    ported = port(text, "fabric-v2")
    assert ported.text is None
    assert [loss.instead for loss in ported.losses] == ['text="42 ", which is a different value']
    unsafe = port(text, "fabric-v2", unsafe=True)
    assert unsafe.text == text.replace("'42'", "'42 '")
    assert unsafe.change is not None
    assert unsafe.change.difference is not None


def test_what_cannot_be_written_is_not_even_unsafe() -> None:
    ported = port(f"<Plan>{waypoint('far')}</Plan>", "fabric-v2", unsafe=True)
    assert ported.text is None
    assert [loss.instead for loss in ported.losses] == [""]


def test_lost_decimals_are_told() -> None:
    text = f"<Plan>{waypoint('0.12345678')}</Plan>"
    ported = port(text, "fabric-v2")
    assert ported.text == text
    assert not ported.changed
    assert [note.text for note in ported.notes] == [
        'fabric-v2 reads x="0.12345678" as 0.123457; this cannot be fixed'
    ]
