"""Dataclasses with late methods behave as those of the standard library."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
import typing
from dataclasses import FrozenInstanceError, field, replace
from typing import Any, ClassVar

import pytest

from gpsfsm import late

OPTIONS = [
    {"frozen": frozen, "slots": slots, "eq": eq, "kw_only": kw_only}
    for frozen in (False, True)
    for slots in (False, True)
    for eq in (False, True)
    for kw_only in (False, True)
]


def family(decorator: Any, **options: bool) -> tuple[type[Any], type[Any]]:
    """A class with each kind of field, and its child."""

    @decorator(**options)
    class Parent:
        """A class of its own."""

        number: int
        text: str = "abc"
        items: list[int] = field(default_factory=list, hash=False)
        hidden: int = field(default=3, repr=False, compare=False)
        named: float = field(default=0.5, kw_only=True)
        made: list[int] = field(default_factory=list, init=False, hash=False)
        fixed: str = field(default="x", init=False)
        LIMIT: ClassVar[int] = 9

        def __post_init__(self) -> None:
            self.items.append(self.number)

        def double(self) -> int:
            return 2 * self.number

    @decorator(**options)
    class Child(Parent):
        """A class that takes fields over."""

        text: str = "child"
        more: str = ""

        def __repr__(self) -> str:
            return f"<{self.more}>"

    return Parent, Child


def outcome(act: Any, cls: type[Any]) -> Any:
    """The value or the error, as what two classes of one name can be compared by."""
    try:
        return repr(act(cls))
    except (TypeError, AttributeError) as error:
        return type(error), str(error).replace("Parent.__init__", "__init__")


ACTS = [
    lambda cls: cls(number=1),
    lambda cls: cls(1),
    lambda cls: cls(1, "b", [4], 7, named=2.0),
    lambda cls: cls(),
    lambda cls: cls(number=1, unknown=2),
    lambda cls: cls(number=1, made=[2]),
    lambda cls: cls(number=1) == cls(number=1, hidden=8),
    lambda cls: cls(number=1) == cls(number=2),
    lambda cls: cls(number=1).__eq__(1),
    lambda cls: len({hash(each) for each in (cls(number=1), cls(number=1, items=[7]))}),
    lambda cls: setattr(cls(number=1), "number", 2),
    lambda cls: delattr(cls(number=1), "number"),
    lambda cls: replace(cls(number=1), number=5),
    lambda cls: dataclasses.asdict(cls(number=1, named=1.5)),
    lambda cls: copy.copy(cls(number=1)),
    lambda cls: copy.deepcopy(cls(number=1)),
    lambda cls: copy.deepcopy(cls(number=1)).made,
    inspect.signature,
    lambda cls: typing.get_type_hints(cls.__init__),
    lambda cls: cls.__match_args__,
    lambda cls: cls.__init__.__qualname__.rpartition(".")[2],
    lambda cls: cls(number=1).double(),
    lambda cls: cls.__doc__[:10],
]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
def test_they_behave_as_those_of_the_standard_library(options: dict[str, bool]) -> None:
    for act in ACTS:  # each on new classes, so that it is the first to ask for a method
        pairs = zip(
            family(dataclasses.dataclass, **options), family(late.dataclass, **options), strict=True
        )
        for standard, own in pairs:
            assert outcome(act, own) == outcome(act, standard)
            assert outcome(act, own) == outcome(act, standard)  # and once more
            assert own.__dataclass_params__.frozen is options["frozen"]


@late.dataclass(frozen=True, slots=True)
class Point:
    x: int
    y: int = 0


@dataclasses.dataclass(frozen=True, slots=True)
class Named(Point):
    """A child that the standard library makes."""

    name: str = ""


class Free(Point):
    """A child that is no dataclass: it may have attributes of its own."""


def test_pickles_come_back() -> None:
    for value in (Point(1, 2), Named(1, 2, "n")):
        assert pickle.loads(pickle.dumps(value)) == value  # noqa: S301  (own bytes)


def test_the_standard_library_extends_them() -> None:
    assert repr(Named(1, name="n")) == "Named(x=1, y=0, name='n')"
    with pytest.raises(FrozenInstanceError):
        Named(1).x = 2  # type: ignore[misc]


def test_a_child_that_is_no_dataclass_has_attributes_of_its_own() -> None:
    free: Any = Free(1)
    free.other = 2
    del free.other
    with pytest.raises(FrozenInstanceError):
        free.x = 2


def test_a_method_is_written_once() -> None:
    @late.dataclass
    class Pair:
        left: int
        right: int

    assert type(vars(Pair)["__init__"]).__name__ == "_StandIn"
    Pair(1, 2)
    assert inspect.isfunction(vars(Pair)["__init__"])
    assert type(vars(Pair)["__eq__"]).__name__ == "_StandIn"
    assert Pair(1, 2) == Pair(1, 2)
    assert inspect.isfunction(vars(Pair)["__eq__"])


def test_a_circle_is_printed() -> None:
    @late.dataclass
    class Ring:
        other: Any = None

    ring = Ring()
    ring.other = ring
    assert repr(ring).endswith("Ring(other=...)")


def test_what_a_maker_makes_is_what_the_constructor_makes():
    @late.dataclass(frozen=True, slots=True)
    class Point:
        x: int
        y: int = 0
        name: str = ""

    point = late.maker(Point)(1, 2, "a")
    assert type(point) is Point
    assert point == Point(1, 2, "a")
    assert hash(point) == hash(Point(1, 2, "a"))
    with pytest.raises(FrozenInstanceError):
        point.x = 3
    partly = late.maker(Point, unset=("y",))(1, "a")
    assert (partly.x, partly.name, hasattr(partly, "y")) == (1, "a", False)
