"""GP203 to GP206: parameters that are unknown, missing or wrong."""

from __future__ import annotations

import pytest

from gpsfsm.capabilities.library import Library
from gpsfsm.model.capability import Interface, Parameter, Provider, ValueType
from tests.analysis.rules.support import GO_THERE, HEAR_IT, findings, messages, runner

# -- GP203 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("step", "message", "hint"),
    [
        (
            runner("nav/Go", 'x="1" y="1" colour="red"'),
            "Go has no parameter 'colour': its value is ignored",
            (
                "use one of its parameters: 'x', 'y', 'speed', 'tries', 'gait', "
                "'careful', 'tags' and 'note'"
            ),
        ),
        (
            runner("nav/Go", 'x="1" y="1" sped="2"'),
            "Go has no parameter 'sped': its value is ignored",
            "write 'speed' instead",
        ),
        (
            runner("nav/Go", 'x="1" pose_y="1"'),
            "Go has no parameter 'pose_y', but needs 'y'",
            "write 'y' instead",
        ),
        (
            runner("voice/Say", 'Text="hello"'),
            "Say has no parameter 'Text', but needs 'text'",
            "write 'text' instead",
        ),
        (
            runner("voice/Say", 'text="hello" feeling="glad"'),
            "Say has no parameter 'feeling': its value is ignored",
            "write 'mood' instead",
        ),
        (
            runner("voice/Say", 'text="hello" frames="map"'),
            "Say has no parameter 'frames': its value is ignored",
            "remove it: 'frame' can only come from the step right before this one",
        ),
        (
            runner("nav/Go", 'x="1" y="1" velocity="1" speed="2"'),
            "'speed' and 'velocity' are one parameter of Go: the value of 'velocity' is ignored",
            "remove 'velocity'",
        ),
        (
            runner("voice/Hear", 'language="en"'),
            "Hear has no parameter 'language': its value is ignored",
            "remove it: this runner takes no parameters",
        ),
    ],
)
def test_an_unknown_parameter(step: str, message: str, hint: str) -> None:
    assert messages("GP203", step) == [(2, "warning", message, hint)]


def test_an_unknown_parameter_is_told_where_it_stands() -> None:
    (finding,) = findings("GP203", runner("nav/Go", 'x="1" y="1"\n  colour="red"'))
    assert (finding.location.line, finding.location.column, finding.length) == (3, 3, 6)
    assert finding.location.element == "/Plan/Runner[1]"


@pytest.mark.parametrize(
    "step",
    [
        runner("nav/Go", 'x="1" y="1" velocity="2" name="door" id="7"'),
        runner("nav/Go", 'x="1" y="1" xml:lang="en"'),
        runner("voice/Say", 'text="a" mood="glad" frame="map"'),
        runner("lift/Go", 'colour="red"'),
        runner("nav/Locate", 'colour="red"'),
    ],
)
def test_a_parameter_that_may_be_known(step: str) -> None:
    assert messages("GP203", step) == []


# -- GP204 ----------------------------------------------------------------------------------


def test_missing_parameters() -> None:
    assert messages("GP204", runner("nav/Go", 'speed="2"')) == [
        (
            2,
            "error",
            "'x' and 'y' are missing: Go (speed=2) at line 2 needs them, and no "
            "other step can supply them",
            'write x="…" and y="…"',
        )
    ]


def test_a_parameter_that_arrives_is_not_missing() -> None:
    assert messages("GP204", GO_THERE, runner("nav/Go", 'y="1"')) == []
    steps = [GO_THERE, HEAR_IT, runner("nav/Go", 'y="1"')]
    assert [message for _, _, message, _ in messages("GP204", *steps)] == [
        "'x' is missing: Go (y=1) at line 4 needs it, and no other step can supply it"
    ]


@pytest.mark.parametrize("solver", ["auto", "z3", "structural"])
def test_a_parameter_is_missing_whoever_decides(solver: str) -> None:
    assert len(findings("GP204", runner("nav/Go", 'x="1"'), solver=solver)) == 1


def test_what_may_not_be_missing_is_left_alone() -> None:
    assert messages("GP204", runner("lift/Go"), runner("nav/Go", 'y="1"')) == []
    assert messages("GP204", runner("voice/Say")) == []
    dead = f'<Control type="recovery">{runner("nav/Go")}</Control>'
    assert messages("GP204", dead) == []


# -- GP205 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "message", "hint"),
    [
        ('careful="True"', 'careful to be true or false, not "True"', 'write careful="true"'),
        ('careful="1"', 'careful to be true or false, not "1"', 'write careful="true"'),
        ('careful="no"', 'careful to be true or false, not "no"', 'write careful="false"'),
        (
            'careful=""',
            'careful to be true or false, not ""',
            'write careful="true" or careful="false"',
        ),
        ('tries="1.0"', 'tries to be an integer, not "1.0"', 'write tries="1"'),
        ('tries="two"', 'tries to be an integer, not "two"', 'write an integer, as in tries="3"'),
        ('tries="1.5"', 'tries to be an integer, not "1.5"', 'write an integer, as in tries="3"'),
        ('tries="true"', 'tries to be an integer, not "true"', 'write an integer, as in tries="3"'),
        ('speed="1,5"', 'speed to be a finite number, not "1,5"', 'write speed="1.5"'),
        ('speed="2 m"', 'speed to be a finite number, not "2 m"', 'write speed="2"'),
        (
            'speed="nan"',
            'speed to be a finite number, not "nan"',
            'write a number, as in speed="1.5"',
        ),
        (
            'velocity="fast"',
            'velocity to be a finite number, not "fast"',
            'write a number, as in velocity="1.5"',
        ),
        (
            'speed="about $a"',
            'speed to be a finite number, not "about $a"',
            'write a number, as in speed="1.5"',
        ),
    ],
)
def test_a_mistyped_parameter(words: str, message: str, hint: str) -> None:
    step = runner("nav/Go", f'x="1" y="1" {words}')
    assert messages("GP205", step) == [(2, "error", f"Go expects {message}", hint)]
    assert messages("GP206", step) == []
    assert messages("GP207", step) == []


@pytest.mark.parametrize(
    "words",
    [
        'careful="true"',
        'careful="false"',
        'tries="1"',
        'tries="-007"',
        'speed="1"',
        'speed="1e-1"',
        'gait="walk"',
        'tags="1"',
        'note="1.0"',
        'careful="$careful"',
        'colour="red"',
    ],
)
def test_a_value_that_fits(words: str) -> None:
    assert messages("GP205", runner("nav/Go", f'x="1" y="1" {words}')) == []
    assert messages("GP205", runner("lift/Go", words)) == []


# -- GP206 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "message", "hint"),
    [
        ('x="11" y="1"', 'x="11" is not allowed: Go accepts -10 to 10', None),
        ('x="-1e9" y="1"', 'x="-1e9" is not allowed: Go accepts -10 to 10', None),
        (
            'x="1" y="1" velocity="-1"',
            'velocity="-1" is not allowed: Go accepts at least 0',
            None,
        ),
        ('x="1" y="1" tries="4"', 'tries="4" is not allowed: Go accepts at most 3', None),
        (
            'x="1" y="1" gait="Walk"',
            "gait=\"Walk\" is not allowed: Go accepts 'walk' or 'creep'",
            "write 'walk'",
        ),
        (
            'x="1" y="1" gait="7"',
            "gait=\"7\" is not allowed: Go accepts 'walk' or 'creep'",
            None,
        ),
    ],
)
def test_a_value_out_of_range(words: str, message: str, hint: str | None) -> None:
    assert messages("GP206", runner("nav/Go", words)) == [
        (2, "error", message, hint or "write an allowed value")
    ]


@pytest.mark.parametrize(
    "words", ['x="10" y="999"', 'x="-10.0" speed="0"', 'tries="-9"', 'gait="$gait"', 'gait="creep"']
)
def test_a_value_in_range(words: str) -> None:
    assert messages("GP206", runner("nav/Go", words)) == []


@pytest.mark.parametrize("words", ['speed="1" velocity="-1"', 'velocity="-1" speed="1"'])
def test_a_second_name_that_is_ignored_is_not_judged(words: str) -> None:
    step = runner("nav/Go", f'x="1" y="1" {words}')
    assert messages("GP206", step) == []
    assert len(messages("GP203", step)) == 1
    assert messages("GP205", step.replace('"-1"', '"fast"')) == []
    assert messages("GP207", step.replace('"-1"', '"$fast"')) == []
    # alone it counts
    assert len(messages("GP206", runner("nav/Go", 'x="1" y="1" velocity="-1"'))) == 1


# -- GP111, where the provider is described -------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "is_packed"),
    [
        (ValueType.DOUBLES, False),
        (ValueType.INTS, False),
        (ValueType.DOUBLE, True),
        (ValueType.STRING, True),
        (ValueType.STRINGS, True),
    ],
)
@pytest.mark.parametrize("written", ["0.1 0.2 0.3", "[1, 2]"])
def test_numbers_in_one_text_are_a_list(kind: ValueType, is_packed: bool, written: str) -> None:
    bend = Provider(
        "arm/Bend", "arm/Bend", described=True, configuration=(Parameter("joints", kind),)
    )
    library = Library(interfaces=(Interface("arm/Bend"),), providers=(bend,))
    steps = (runner("arm/Bend", f'joints="{written}"'), runner("x/Y", 'place="1 2"'))
    lines = [line for line, *_ in messages("GP111", *steps, library=library)]
    assert lines == ([2, 3] if is_packed else [3])
