"""Data comes back as it was, by its types, and nothing else comes back."""

from __future__ import annotations

import ast
import importlib
import inspect
import json
import math
import sys
import typing
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, is_dataclass
from enum import Enum, StrEnum
from itertools import chain
from typing import TYPE_CHECKING, Any, Literal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.checking import CheckOptions
from gpsfsm.checking.parallel import CheckWork
from gpsfsm.errors import UsageError
from gpsfsm.fuzzing import campaign, mutation
from gpsfsm.gating import GateOptions, Verdict
from gpsfsm.grading import grader, rewards
from gpsfsm.lsp import checking as lsp_checking
from gpsfsm.running.answer_judge import PlanJudge
from gpsfsm.workers import codec
from gpsfsm.workers.codec import decode, encode, result_type

if TYPE_CHECKING:
    from gpsfsm.model.plan import Location


class Colour(StrEnum):
    RED = "red"
    BLUE = "blue"


class Size(Enum):
    SMALL = 1
    LARGE = 2


@dataclass(frozen=True)
class Point:
    x: float
    y: float = 0.0


@dataclass(frozen=True)
class Circle:
    centre: Point
    radius: float | None = None
    colour: Colour = Colour.RED
    seen: int = field(default=0, init=False)


@dataclass(frozen=True)
class Drawing:
    shapes: tuple[Point | Circle, ...] = ()
    names: frozenset[str] | None = None
    sizes: Mapping[str, Size] = field(default_factory=dict)
    counts: Counter[tuple[str, int]] = field(default_factory=Counter)
    pair: tuple[int, str] = (0, "")
    kind: Literal["ink", 3] = "ink"
    value: bool | int | float | str = 0
    place: Location | None = None  # imported for type checkers only


@dataclass(frozen=True)
class Strict:
    """As ``Limits`` are: what it does not like is no ValueError."""

    number: int

    def __post_init__(self) -> None:
        raise UsageError("misuse") if self.number == 1 else KeyError(self.number)


POINTS = st.builds(Point, st.floats(allow_nan=False), st.integers())
CIRCLES = st.builds(Circle, POINTS, st.none() | st.floats(allow_nan=False), st.sampled_from(Colour))
DRAWINGS = st.builds(
    Drawing,
    st.lists(POINTS | CIRCLES, max_size=3).map(tuple),
    st.none() | st.frozensets(st.text(max_size=3), max_size=3),
    st.dictionaries(st.text(max_size=3), st.sampled_from(Size), max_size=3),
    st.lists(st.tuples(st.text(max_size=2), st.integers()), max_size=4).map(Counter),
    st.tuples(st.integers(), st.text()),
    st.sampled_from(["ink", 3]),
    st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
)


@given(DRAWINGS)
def test_data_comes_back_as_it_was(drawing: Drawing) -> None:
    again = decode(Drawing, encode(drawing))
    assert again == drawing
    assert encode(again) == encode(drawing)  # also an int is no float, and true is no 1
    assert type(again.value) is type(drawing.value)
    assert type(again.counts) is Counter


def test_types_that_are_imported_for_type_checkers_only() -> None:
    from gpsfsm.model.plan import Location

    drawing = Drawing(place=Location(1, 2, "/Plan"))
    assert decode(Drawing, encode(drawing)) == drawing


@pytest.mark.parametrize(
    ("kind", "value"),
    [
        (int, True),
        (int, 1.0),
        (bool, 1),
        (str, None),
        (float, True),
        (float, "1"),
        (Colour, "green"),
        (Colour, 1),
        (Size, True),
        (Size, "1"),
        (tuple[int, ...], "12"),
        (tuple[int, str], [1]),
        (tuple[int, str], [1, "", 2]),
        (frozenset[int], {"1": 1}),
        (Mapping[str, int], [["a"]]),
        (Mapping[str, int], ["ab"]),
        (Mapping[str, int], [["a", "b"]]),
        (Literal["ink", 3], 3.0),
        (int | None, "x"),
        (Point, [1.0, 2.0]),
        (Point, {"Point": [1.0]}),
        (Point, {"Point": {"x": 1.0, "y": 2.0}}),
        (Point, {"Point": [1.0, 2.0], "more": 1}),
        (Point, {"Circle": [{"Point": [1.0, 2.0]}, None, "red"]}),
        (Point | Circle, {"Drawing": []}),
        (object, {}),
        (Any, 1),
        (list[int], [1]),
        (Mapping[str, int], [["a", 1], ["a", 2]]),
        (Counter[str], [["a", 1], ["a", 1]]),
        (frozenset[int], [1, 1]),
        (Mapping[Mapping[str, int], int], [[[], 1]]),  # no key of a mapping
        (float, math.nan),
        (float, 10**400),  # no float can hold it
        (Strict, {"Strict": [1]}),
        (Strict, {"Strict": [2]}),
    ],
)
def test_what_does_not_fit_is_refused(kind: Any, value: object) -> None:
    with pytest.raises(ValueError, match=r"."):
        decode(kind, json.dumps(value).encode())


@given(st.binary(max_size=40))
def test_noise_is_refused(noise: bytes) -> None:
    with pytest.raises(ValueError, match=r"."):
        decode(Drawing, noise)


def test_what_has_no_form_is_refused() -> None:
    for value in (object(), [1], {1, 2}, b"bytes", Point):
        with pytest.raises(ValueError, match="there is no JSON form of a"):
            encode((value,))


class Works:
    def __call__(self, item: int) -> tuple[Location, ...] | None:
        return None


def test_the_result_of_work() -> None:
    from gpsfsm.model.plan import Location

    assert result_type(Works()) == tuple[Location, ...] | None


MESSAGES = (
    GateOptions,
    Verdict,
    tuple[CheckOptions, *typing.get_args(lsp_checking._PACKED)],
    *(
        result_type(work.__new__(work))
        for work in (
            CheckWork,
            PlanJudge,
            lsp_checking.Work,
            grader.GradeWork,
            rewards._Work,
            campaign.Work,
            mutation._Try,
        )
    ),
)
"""The types of all data that goes through the codec."""


def kinds_in(messages: tuple[Any, ...]) -> list[Any]:
    """All types that these types are made of."""
    kinds, left = [], list(messages)
    while left:
        if (kind := left.pop()) not in kinds:
            kinds.append(kind)
            left += codec._hints(kind).values() if is_dataclass(kind) else typing.get_args(kind)
    return kinds


def test_every_type_of_a_message_is_known_and_is_the_one_that_its_module_imports() -> None:
    data = [kind for kind in kinds_in(MESSAGES) if is_dataclass(kind)]
    assert len(data) > 50
    homes = {}
    for module in {kind.__module__ for kind in data}:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
        classes = {kind.__name__ for kind in data if kind.__module__ == module}
        bodies = [e.body for e in tree.body if isinstance(e, ast.ClassDef) and e.name in classes]
        needed = {
            name.id
            for each in chain.from_iterable(bodies)
            if isinstance(each, ast.AnnAssign)
            for name in ast.walk(each.annotation)
            if isinstance(name, ast.Name)
        }
        blocks = [each for each in tree.body if isinstance(each, ast.If)]
        for each in ast.walk(ast.Module([line for block in blocks for line in block.body], [])):
            if isinstance(each, ast.ImportFrom) and str(each.module).startswith("gpsfsm."):
                homes |= {name.name: each.module for name in each.names if name.name in needed}
    assert homes.items() <= codec._HOMES.items()
    for name, home in codec._HOMES.items():
        assert hasattr(importlib.import_module(home), name)


def test_members_of_unions_can_be_told_apart() -> None:
    for kind in kinds_in(MESSAGES):
        names: Counter[object] = Counter()
        if typing.get_origin(kind) not in (typing.Union, type(int | str)):
            continue
        for member in typing.get_args(kind):
            if is_dataclass(member):
                names[member.__name__] += 1  # type: ignore[union-attr]
            elif typing.get_origin(member) is not None:
                names["list"] += 1
            elif issubclass(member, Enum):
                names.update({type(each.value) for each in member})
            else:
                names[member] += 1
        assert max(names.values()) == 1, kind


def test_who_is_named_by_a_type_comes_with_all_its_kinds() -> None:
    """A value of a subclass has no form of the class: a union names both."""
    kinds = kinds_in(MESSAGES)
    ours = [kind for kind in kinds if is_dataclass(kind)]
    for kind in ours:
        assert set(kind.__subclasses__()) <= set(ours), kind  # type: ignore[union-attr]
