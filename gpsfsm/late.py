"""Dataclasses and regular expressions that are made when they are first needed.

The decorator of the standard library writes and compiles up to seven functions for each class while
a module is loaded, which takes 0.4 ms for a small class; a check of one plan loads 80 classes and
needs few of their methods. Here the standard library reads the fields at once. A stand-in holds the
place of each method and is replaced at its first look-up by a method of the same meaning, which is
as fast from then on as that of the standard library. Likewise a check uses few patterns.

Python also looks for cycles later where many objects are made that have none.

Modules that each check loads take the decorator from here, all others from the standard library.
"""

from __future__ import annotations

import dataclasses
import gc
import re
import sys
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar, overload

__all__ = ["collecting_rarely", "dataclass", "maker", "pattern"]

_Made = TypeVar("_Made")

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator
    from dataclasses import dataclass

    @overload
    def pattern(text: str, flags: int = 0) -> re.Pattern[str]: ...
    @overload
    def pattern(text: bytes, flags: int = 0) -> re.Pattern[bytes]: ...
    def pattern(text: Any, flags: int = 0) -> Any:
        """``re.compile``, as late as possible."""
else:

    def dataclass(cls=None, /, **options: bool):
        """``dataclasses.dataclass``, with methods as late as possible.

        >>> @dataclass(frozen=True)
        ... class Point:
        ...     x: int
        ...     y: int = 0
        >>> Point(1)
        Point(x=1, y=0)
        """
        return _prepared(cls, **options) if cls else lambda each: _prepared(each, **options)

    class _Pattern:
        """``re.compile``, as late as possible; what has been asked for once is looked up directly.

        >>> pattern("[a-z]+").findall("one, two")
        ['one', 'two']
        """

        def __init__(self, text: str | bytes, flags: int = 0) -> None:
            self._arguments = (text, flags)

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):  # copy, pickle and the like ask for what a pattern has not
                raise AttributeError(name)
            value = getattr(re.compile(*self._arguments), name)
            setattr(self, name, value)
            return value

    pattern = _Pattern


_BARE = {"init": False, "repr": False, "eq": False}


def _prepared(
    cls: type[Any],
    *,
    frozen: bool = False,
    eq: bool = True,
    slots: bool = False,
    kw_only: bool = False,
) -> type[Any]:
    """The class with its fields and its stand-ins."""
    own = {name for name in _WRITERS if cls.__dict__.get(name) is not None}
    cls.__doc__ = cls.__doc__ or cls.__name__  # a signature as text would need the methods
    with _not_frozen(cls.__mro__[1:]):
        cls = dataclasses.dataclass(**_BARE, slots=slots, kw_only=kw_only)(cls)
    names = [
        "__init__",
        "__repr__",
        *(["__eq__"] if eq else []),
        *(["__hash__"] if eq and frozen else []),
    ]
    methods: dict[str, Any] = {name: _StandIn(cls, name) for name in names}
    if eq and not frozen:
        methods["__hash__"] = None
    for name in own:
        methods.pop(name, None)
    if frozen:
        cls.__dataclass_params__.frozen = True
        methods |= {"__setattr__": _refuse_assignment, "__delattr__": _refuse_deletion}
        if slots:
            methods |= {"__getstate__": _state, "__setstate__": _set_state}
    for name, method in methods.items():
        setattr(cls, name, method)
    return cls


@contextmanager
def _not_frozen(bases: tuple[type[Any], ...]) -> Iterator[None]:
    """Let the standard library take the bases for what it takes their child for meanwhile."""
    noted = [
        each.__dict__["__dataclass_params__"]
        for each in bases
        if "__dataclass_params__" in each.__dict__
    ]
    frozen = [each.frozen for each in noted]
    for params in noted:
        params.frozen = False
    try:
        yield
    finally:
        for params, each in zip(noted, frozen, strict=True):
            params.frozen = each


class _StandIn:
    """Holds the place of a method until it is looked up."""

    __slots__ = ("name", "owner")

    def __init__(self, owner: type[Any], name: str) -> None:
        self.owner = owner
        self.name = name

    def __get__(self, instance: object, _: type[Any] | None = None) -> Any:
        method = _WRITERS[self.name](self.owner)
        method.__qualname__ = f"{self.owner.__qualname__}.{self.name}"
        setattr(self.owner, self.name, method)
        return method if instance is None else method.__get__(instance)


class _Fresh:
    """The default of an argument for which a new value is made."""

    def __repr__(self) -> str:
        return "<factory>"


_FRESH = _Fresh()


def _written(cls: type[Any], head: str, lines: list[str], values: dict[str, Any]) -> Any:
    """A function with this head and these lines; ``values`` are names that they use."""
    body = "\n  ".join(lines or ["pass"])
    text = (
        f"def make({', '.join(values)}):\n def {head}:\n  {body}\n return {head.partition('(')[0]}"
    )
    made: dict[str, Any] = {}
    module = sys.modules.get(cls.__module__)
    exec(text, vars(module) if module else {}, made)
    return made["make"](**values)


def _init(cls: type[Any]) -> Any:
    values: dict[str, Any] = {"_set_": object.__setattr__, "_fresh_": _FRESH}
    by_name: dict[str, str] = {}  # arguments with their defaults
    positional: dict[str, str] = {}
    frozen = cls.__dataclass_params__.frozen
    lines = []
    each = dataclasses.fields(cls)
    for field in each:
        name = value = field.name
        default = ""
        if field.default_factory is not dataclasses.MISSING:
            values[f"_make_{name}"] = field.default_factory
            default = "=_fresh_"
            value = f"_make_{name}() if {name} is _fresh_ else {name}"
            value = value if field.init else f"_make_{name}()"
        elif field.default is not dataclasses.MISSING:
            values[f"_default_{name}"] = field.default
            default = f"=_default_{name}"
            value = name if field.init else f"_default_{name}"
        elif not field.init:
            continue
        if field.init:
            (by_name if field.kw_only else positional)[name] = default
        lines.append(f"_set_(self, {name!r}, {value})" if frozen else f"self.{name} = {value}")
    if hasattr(cls, "__post_init__"):
        lines.append("self.__post_init__()")
    arguments = {"self": "", **positional, **({"*": ""} if by_name else {}), **by_name}
    head = ", ".join(name + default for name, default in arguments.items())
    method = _written(cls, f"__init__({head})", lines, values)
    types = {field.name: field.type for field in each}
    method.__annotations__ = {name: types[name] for name in positional | by_name} | {"return": None}
    return method


def maker(cls: type[_Made], unset: tuple[str, ...] = ()) -> Callable[..., _Made]:
    """A function that makes what the constructor makes, four times as fast, for readers.

    The class is frozen and has slots; values come in the order of its fields, all but those that
    stay unset. A frozen class is filled by a function call per field. Here an object of a class
    with the same slots that is not frozen is filled directly, and then becomes one of ``cls``.
    """
    meant: Any = cls
    fields = [each.name for each in dataclasses.fields(meant) if each.name not in unset]
    draft = type(cls.__name__, (), {"__slots__": meant.__slots__})
    lines = [
        "made = _new_(_draft_)",
        *(f"made.{name} = {name}" for name in fields),
        "made.__class__ = _class_",
        "return made",
    ]
    values = {"_new_": object.__new__, "_draft_": draft, "_class_": cls}
    made: Callable[..., _Made] = _written(cls, f"make_({', '.join(fields)})", lines, values)
    return made


def _repr(cls: type[Any]) -> Any:
    """The method of the standard library, which guards against circles."""
    return _twin(cls, repr=True).__repr__


def _eq(cls: type[Any]) -> Any:
    return _twin(cls, eq=True).__eq__


def _hash(cls: type[Any]) -> Any:
    return _twin(cls, unsafe_hash=True).__hash__


def _twin(cls: type[Any], **options: bool) -> type[Any]:
    """A class of the same fields for which the standard library writes one method."""
    each = {field.name: field for field in dataclasses.fields(cls)}
    body: dict[str, Any] = {
        "__module__": cls.__module__,
        "__doc__": cls.__doc__,
        "__annotations__": {name: field.type for name, field in each.items()},
        **each,
    }
    options = {**_BARE, **options}
    return dataclasses.dataclass(**options, match_args=False)(type(cls.__name__, (), body))


_WRITERS = {"__init__": _init, "__repr__": _repr, "__eq__": _eq, "__hash__": _hash}


def _refuse_assignment(self: Any, name: str, value: object) -> None:
    _refuse(self, name, "assign to")
    object.__setattr__(self, name, value)


def _refuse_deletion(self: Any, name: str) -> None:
    _refuse(self, name, "delete")
    object.__delattr__(self, name)


def _refuse(instance: Any, name: str, act: str) -> None:
    """Refuse it for a field, and for any name unless the class has been extended."""
    cls = type(instance)
    if "__dataclass_fields__" in cls.__dict__ or name in cls.__dataclass_fields__:
        raise dataclasses.FrozenInstanceError(f"cannot {act} field {name!r}")


def _state(self: Any) -> list[Any]:
    """The state of an instance with slots, for copies and pickles."""
    return [getattr(self, field.name) for field in dataclasses.fields(self)]


def _set_state(self: Any, state: list[Any]) -> None:
    for field, value in zip(dataclasses.fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)


_THRESHOLD = 50_000


@contextmanager
def collecting_rarely() -> Generator[None]:
    """Let Python look for cycles after 50,000 new objects and not after 700; then as before.

    It still looks, so a run whose runners leave cycles behind does not grow without end.
    """
    before = gc.get_threshold()
    if 0 < before[0] < _THRESHOLD:
        gc.set_threshold(_THRESHOLD, *before[1:])
    try:
        yield
    finally:
        gc.set_threshold(*before)
