"""Messages, requests and paths for the judge of docs/ros.md, the odd ones most."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, cast

from hypothesis import strategies as st

from tests.ros.judge_messages import Kind, Message, Type, Value, kind_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hypothesis.strategies import DrawFn, SearchStrategy

    from tests.ros.judge_messages import Index

REGISTRY: dict[str, Type] = {
    "demo/Point": {"x": "double", "n": "int32", "ok": "boolean", "label": "string"},
    "demo/Joint": {
        "name": "string",
        "position": "double",
        "weight": "uint8",
        "gains": "double[3]",
        "tags": "sequence<string, 2>",
        "samples": "sequence<double>",
    },
    "demo/Group": {
        "joints": "sequence<demo/Joint>",
        "label": "string",
        "limits": "sequence<int32>",
        "names": "sequence<string>",
    },
    "demo/Plan": {
        "groups": "sequence<demo/Group>",
        "origin": "demo/Point",
        "legs": "demo/Point[2]",
        "score": "double",
    },
    "demo/Goal": {
        "plans": "sequence<demo/Plan>",
        "few": "sequence<demo/Point, 2>",
        "flags": "sequence<boolean>",
        "urgent": "boolean",
    },
}

_ROOTS = st.sampled_from([*REGISTRY, "demo/Group", "demo/Plan", "demo/Goal", "demo/Goal"])
_LISTS: list[Value] = [[], [[]], [[1], 2], [[1, 2], []], [[[1]]], [[1, 2], [3]], ["1 2", "3"]]
_SCALARS: list[Value] = [True, 2.5, 2.0, -1, 300, 2**31, math.inf, 10**400, "map", "", " ", "5"]
_TEXTS: list[Value] = ["1, 2;3 4", "1,,2", "1 2,", " 1\t2 ", "-.5 1e1", "1 nan", "[1, 2", '["a",]']
_JSON: list[Value] = ["[[0, 1], [2, 3]]", "[]", "[[1], 2]", '["a", "b"]', "[true]", "true", "{}"]
_WORDS: list[Value] = ["a, b c;d", "a b", "a,,b", ",", "a;", ["a b", "c,d"], [["a"], ["b", "c"]]]
_MIXED: list[Value] = [[True], ["1"], [1, "a"]]
_ODD = st.sampled_from([*_LISTS, *_SCALARS, *_TEXTS, *_JSON, *_WORDS, *_MIXED])
_FITTING: dict[str, SearchStrategy[Value]] = {
    "double": st.sampled_from([0, 1, 0.5, -2.5, 1e3]),
    "int32": st.sampled_from([0, 7, -3, 2.0, 2**31 - 1]),
    "uint8": st.sampled_from([0, 3.0, 255]),
    "boolean": st.booleans(),
    "string": st.sampled_from(["a", "map", "b c", "", 5, True]),
}
_SIZES = st.tuples(*[st.integers(0, 2)] * 3)
_ONE_IN_FOUR = st.sampled_from([True, False, False, False])
_ONE_IN_TWENTY = st.sampled_from([*[False] * 19, True])
_SEPARATORS = st.sampled_from([" ", ",", ", ", ";", " ; "])
_DEPTHS = [st.sampled_from([*range(capacity + 1), capacity]) for capacity in range(5)]


@dataclass(frozen=True)
class Leaf:
    """A path of a request, with the kinds of the lists on it and of the field at its end."""

    path: str
    lists: tuple[Kind, ...]
    field: Kind


def leaves(name: str, before: str = "", lists: tuple[Kind, ...] = ()) -> Iterator[Leaf]:
    for field, text in REGISTRY[name].items():
        kind, path = kind_of(text), before + field
        if not kind.nested:
            yield Leaf(path, lists, kind)
        elif kind.many:
            yield from leaves(kind.item, f"{path}[].", (*lists, kind))
        else:
            yield from leaves(kind.item, f"{path}.", lists)


_LEAVES = {name: list(leaves(name)) for name in REGISTRY}
_LEAF = {name: st.sampled_from(each) for name, each in _LEAVES.items()}
_MISTAKEN = st.sampled_from(
    ["nope", "plans", "groups[]", "groups.label", "plans[].nope", "x[]", "x.y", "names[].a", ""]
)
_OTHERS = st.lists(st.integers(0, 99), max_size=4)


@dataclass(frozen=True)
class _Sizes:
    """The lengths that the lists of one request have, where its entries agree."""

    outer: tuple[int, int, int]
    uneven: bool

    def of(self, kind: Kind, index: Index) -> int:
        drawn = 1 + (self.outer[len(index)] + sum(index) * self.uneven) % 3
        return int(min(max(drawn, kind.least), kind.most))


def _nested(draw: DrawFn, leaf: Leaf, sizes: _Sizes, index: Index) -> Value:
    """A value for the path at these indices, whose further levels are lists."""
    if len(index) < len(leaf.lists):
        count = sizes.of(leaf.lists[len(index)], index)
        return [_nested(draw, leaf, sizes, (*index, i)) for i in range(count)]
    if not leaf.field.many:
        return draw(_FITTING[leaf.field.item])
    least, most = leaf.field.least, int(min(leaf.field.most, 3))
    return draw(st.lists(_FITTING[leaf.field.item], min_size=least, max_size=most))


def _as_text(draw: DrawFn, value: Value) -> Value:
    """A list as a text: numbers or texts between separators, or JSON."""
    flat = isinstance(value, list) and not any(isinstance(item, list | bool) for item in value)
    if flat and draw(st.booleans()):
        text = ""
        for item in cast("list[Value]", value):
            text += (draw(_SEPARATORS) if text else "") + str(item)
        return text
    return json.dumps(value) if isinstance(value, list) else value


def _regular(draw: DrawFn, leaf: Leaf, sizes: _Sizes) -> Value:
    """A value that fits, with as many levels of lists as drawn; the outer lists are left out."""
    capacity = len(leaf.lists) + leaf.field.many
    outer = (0,) * (capacity - draw(_DEPTHS[capacity]))
    if len(outer) > len(leaf.lists):  # a single value for a field that is a list
        return draw(_FITTING[leaf.field.item])
    value = _nested(draw, leaf, sizes, outer)
    return _as_text(draw, value) if draw(_ONE_IN_FOUR) else value


@st.composite
def requests(draw: DrawFn) -> tuple[str, dict[str, Value]]:
    """The name of a type and a request for it, whose entries mostly share lists."""
    name = draw(_ROOTS)
    first = draw(_LEAF[name])
    top = re.split(r"[.[]", first.path)[0]
    near = [leaf for leaf in _LEAVES[name] if re.split(r"[.[]", leaf.path)[0] == top]
    chosen = [first, *(near[place % len(near)] for place in draw(_OTHERS))]
    if draw(_ONE_IN_FOUR):
        chosen.append(draw(_LEAF[name]))
    sizes = _Sizes(draw(_SIZES), draw(_ONE_IN_FOUR))
    request = {
        leaf.path: draw(_ODD) if draw(_ONE_IN_FOUR) else _regular(draw, leaf, sizes)
        for leaf in chosen
    }
    if draw(_ONE_IN_TWENTY):
        request[draw(_MISTAKEN)] = draw(_ODD)
    return name, request


_MEASURED = [0.0, 0.5, 1.5, 1.5, -2.0, 3.0, 7.25, 1e3]
_READ: dict[str, list[Value]] = {
    "double": [*_MEASURED, *_MEASURED, math.nan, math.inf, -math.inf],
    "int32": [0, 1, -3, 7],
    "uint8": [0, 1, 255],
    "boolean": [False, True],
    "string": ["", "a", "1", "> 5", "b c"],
}


def _lists(kind: Kind) -> list[Value]:
    """Lists of single values, made at once: drawing each item takes long."""
    values, most = _READ[kind.item], int(min(kind.most, 3))
    repeated = values * 2
    sizes = range(kind.least, most + 1)
    return [repeated[place : place + size] for size in sizes for place in range(len(values))]


@cache
def messages(name: str) -> SearchStrategy[Message]:
    """Messages of a type of the registry, with NaN, infinite numbers and empty lists."""

    def values(kind: Kind) -> SearchStrategy[Value]:
        if not kind.nested:
            return st.sampled_from(_lists(kind) if kind.many else _READ[kind.item])
        item = messages(kind.item)
        if not kind.many:
            return item
        inner = any("/" in text for text in REGISTRY[kind.item].values())
        most = int(min(kind.most, 2 if inner else 3))
        some = st.lists(item, min_size=max(kind.least, 1), max_size=most)
        return st.one_of(some, some, st.lists(item, min_size=kind.least, max_size=most))

    return st.fixed_dictionaries(
        {field: values(kind_of(text)) for field, text in REGISTRY[name].items()}
    )


@cache
def _scores(name: str) -> SearchStrategy[str]:
    """Paths of scores of an item: mostly numbers, with the lists on the path picked from."""
    usable = [
        leaf.path.replace("[]", "[first]") + "[]" * leaf.field.many
        for leaf in _LEAVES[name]
        if leaf.field.many or leaf.field.item not in ("string", "boolean")
    ]
    near = [path for path in usable if "." not in path]
    odd = ["nope", "label", "joints[all].position", "joints[best by weight].position", "legs[].x"]
    return st.sampled_from([*near * (4 * len(usable) // len(near)), *usable, *odd])


_PICKS = st.sampled_from(["[]", "[first]", "[last]", "[all]", "[all]", "best", "best"])
_PLAIN_PICKS = st.sampled_from(["", "", "[]", "[first]", "[last]", "[all]", "[0]"])
_SPOILED = st.sampled_from([".nope", ".x", "[]", "[first]", "[0]", "[", "[best by ]", "."])


def _path(draw: DrawFn, name: str) -> str:
    """A path that reads a field of a type; it does not end in a message."""
    field = draw(st.sampled_from(list(REGISTRY[name])))
    kind = kind_of(REGISTRY[name][field])
    if not kind.nested:
        return field + (draw(_PLAIN_PICKS) if kind.many else "")
    pick = draw(_PICKS) if kind.many else ""
    if pick == "[]":
        return field + pick
    if pick == "best":
        pick = f"[best by {draw(_scores(kind.item))}]"
    return f"{field}{pick}.{_path(draw, kind.item)}"


@st.composite
def readings(draw: DrawFn) -> tuple[str, Message, str]:
    """The name of a type, a message of it, and a path to read."""
    name = draw(_ROOTS)
    spoiled = draw(_SPOILED) if draw(_ONE_IN_TWENTY) else ""
    return name, draw(messages(name)), _path(draw, name) + spoiled


_PARAMETERS: dict[str, Value] = {"limit": 1.5, "word": "a", "none": None}
_NUMBERS: list[Value] = [0, 1, 1.5, 2, "> 5", "> 1", ">= 1.5", "<1.5", "<= 0", "!= 1", "== 1.5"]
_OTHER: list[Value] = [True, False, "a", "1", "!= $word", "$word", "> abc", [], [1.5], ["a"]]
_WANTED = st.sampled_from([*_NUMBERS, *_OTHER, "> $limit", "!= $limit", "$limit", "$none"])


@st.composite
def successes(
    draw: DrawFn,
) -> tuple[str, Message, list[dict[str, Value]], dict[str, Value]]:
    """The name of a type, a message of it, the alternatives of ``success``, and parameters."""
    name = draw(_ROOTS)
    alternatives: list[dict[str, Value]] = []
    for size in draw(st.lists(st.integers(1, 2), min_size=1, max_size=2)):
        alternatives.append({_path(draw, name): draw(_WANTED) for _ in range(size)})
    return name, draw(messages(name)), alternatives, dict(_PARAMETERS)
