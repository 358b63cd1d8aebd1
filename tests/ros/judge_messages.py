"""Messages as docs/ros.md defines them: a judge that shares no code with gpsfsm.

A type is a table of fields and kinds, a message nested dictionaries and lists. ``judge_fill`` says
what message a request makes, ``judge_read`` what a path reads, ``judge_success`` whether an answer
is a success. A comment that begins with SILENT marks a choice that the page does not make.
"""

from __future__ import annotations

import json
import math
import operator
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, NoReturn, TypeAlias, cast

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence


Value: TypeAlias = "bool | int | float | str | list[Value] | dict[str, Value] | None"
Message: TypeAlias = "dict[str, Value]"
Type: TypeAlias = dict[str, str]
Registry: TypeAlias = "Mapping[str, Type]"
Index: TypeAlias = tuple[int, ...]


class Outcome(Enum):
    """The outcome of reading that is no value."""

    ABSENT = "not measured"
    ERROR = "the step fails"


ABSENT, ERROR = Outcome.ABSENT, Outcome.ERROR


class RefusedError(Exception):
    """An error in the sense of the page: the step fails."""


# --- types and their default messages


@dataclass(frozen=True)
class Kind:
    """The kind of a field: that of one value or item, and for a list how many it takes."""

    item: str
    many: bool = False
    least: int = 0
    most: float = math.inf

    @property
    def nested(self) -> bool:
        return "/" in self.item

    def takes(self, size: int) -> bool:
        return self.least <= size <= self.most


def kind_of(text: str) -> Kind:
    if match := re.fullmatch(r"sequence<([^,]+)(?:, *(\d+))?>", text):
        return Kind(match[1], many=True, most=int(match[2]) if match[2] else math.inf)
    if match := re.fullmatch(r"(.+)\[(\d+)\]", text):
        return Kind(match[1], many=True, least=int(match[2]), most=int(match[2]))
    return Kind(text)


def field_of(registry: Registry, name: str, field: str) -> Kind:
    if field not in registry[name]:
        raise RefusedError
    return kind_of(registry[name][field])


_DEFAULTS: dict[str, Value] = {"double": 0.0, "float": 0.0, "boolean": False, "string": ""}


def default(registry: Registry, kind: Kind) -> Value:
    if kind.many:
        return [default(registry, Kind(kind.item)) for _ in range(kind.least)]
    if kind.nested:
        return default_message(registry, kind.item)
    return _DEFAULTS.get(kind.item, 0)


def default_message(registry: Registry, name: str) -> Message:
    return {field: default(registry, kind_of(text)) for field, text in registry[name].items()}


# --- a text that is a list

# SILENT: the form of a number. A decimal one: not nan, inf, 0x10 or 1_000.
NUMBER = r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?"
# SILENT: whether values may be missing (`1,,2`, `1 2,`). No: a value would be left out in silence.
BETWEEN = r"(?:\s*[,;]\s*|\s+)"


def _no_constant(name: str) -> NoReturn:
    raise ValueError(name)


def json_list(text: str) -> list[Value] | None:
    """The list that a text of JSON contains; NaN and Infinity are not JSON."""
    try:
        value = json.loads(text, parse_constant=_no_constant)
    except ValueError:
        return None
    return value if isinstance(value, list) else None


def numbers(text: str) -> list[Value] | None:
    """The numbers of a text. SILENT: a text of one number, `xs="1"`, is a list of one."""
    if not re.fullmatch(rf"\s*{NUMBER}(?:{BETWEEN}{NUMBER})*\s*", text):
        return None
    words = re.findall(NUMBER, text)
    return [int(word) if re.fullmatch(r"[+-]?[0-9]+", word) else float(word) for word in words]


def texts(text: str) -> list[Value]:
    """The texts of a text. SILENT: blanks around them go, and what is empty between commas stays.

    Broken JSON is a text like any other, and split.
    """
    if re.search("[,;]", text):
        return [word.strip() for word in re.split("[,;]", text)]
    return list(text.split())


def read_text(text: str, lists: int, field: Kind) -> Value:
    """The list that a text is for its path, or the text itself.

    SILENT: whether numbers in a text make items for a field of text or a boolean, too. As the page
    makes no difference, they do: the item of text is the JSON text of the number.
    SILENT: texts within a list are not read again, so `["1 2", "3"]` is no list of lists.
    """
    if not lists and not field.many:
        return text
    if field.many and not text.strip():
        raise RefusedError
    if (listed := json_list(text)) is not None:
        return listed
    if field.many and field.item == "string":
        return texts(text)
    if (listed := numbers(text)) is not None:
        return listed
    return text


# --- entries of a request


@dataclass(frozen=True)
class Entry:
    """An entry of a request: the lists on its path, and which of them its value makes.

    The outer ``levels`` of its value are the items of the last ``levels`` lists; what is within
    them is for the field. ``listed``: it is a list, so the lists before have at least one item.
    """

    lists: tuple[str, ...]
    field: Kind
    value: Value
    levels: int
    listed: bool

    def makes(self, prefix: str) -> bool:
        return prefix in self.lists[len(self.lists) - self.levels :]

    def at(self, index: Index) -> Value:
        """Its value for these indices of the lists on its path, the outermost first."""
        value = self.value
        for place in index[len(self.lists) - self.levels :]:
            value = cast("list[Value]", value)[place]
        return value


def resolve(registry: Registry, name: str, path: str) -> tuple[tuple[str, ...], Kind]:
    """The lists on a path of a request, as `a[]` and `a[].b[]`, and the field at its end.

    SILENT: `a[]` or a whole message at the end, and picks such as `a[first]`, are errors.
    """
    *steps, last = path.split(".")
    lists: list[str] = []
    for place, step in enumerate(steps):
        kind = field_of(registry, name, step.removesuffix("[]"))
        if not kind.nested or kind.many != step.endswith("[]"):
            raise RefusedError
        if kind.many:
            lists.append(".".join(steps[: place + 1]))
        name = kind.item
    field = field_of(registry, name, last)
    if field.nested:
        raise RefusedError
    return tuple(lists), field


def _ends(value: Value, level: int = 0) -> Iterator[tuple[bool, int]]:
    """The depth of each value that is no list, and of each empty list (False)."""
    if not isinstance(value, list):
        yield True, level
    elif not value:
        yield False, level + 1
    else:
        for item in value:
            yield from _ends(item, level + 1)


def depth(value: Value) -> int:
    """The depth of nested lists, which must be the same everywhere.

    SILENT: an empty list has its own depth or any greater one, as that of its neighbours.
    SILENT: different depth is an error as well where the deeper lists would become JSON texts.
    """
    ends = list(_ends(value))
    depths = {level for valued, level in ends if valued}
    deepest = max(depths or {level for _, level in ends})
    if len(depths) > 1 or any(level > deepest for _, level in ends):
        raise RefusedError
    return deepest


def entry(registry: Registry, name: str, path: str, value: Value) -> Entry:
    """An entry; a field that is a list is like one more list at the end of the path.

    SILENT: so a list for `a[].names` is for the field, in all items, and a list of lists makes the
    items; and a list or a single value ("a list of one") alone gives `a` its one item.
    """
    lists, field = resolve(registry, name, path)
    if isinstance(value, str):
        value = read_text(value, len(lists), field)
    deep = depth(value) if lists or field.many else 0
    if field.many and not deep:
        value, deep = [value], 1
    # SILENT: lists deeper than the path has lists are left to the field: JSON in a text, else wrong
    levels = min(deep - field.many, len(lists))
    return Entry(lists, field, value, levels, listed=deep > 0)


def fit(item: str, value: Value) -> Value:
    """A value as the item of a field takes it."""
    if item == "string":
        return value if isinstance(value, str) else _json_text(value)
    if item == "boolean" and isinstance(value, bool):
        return value
    if item == "boolean" or isinstance(value, bool) or not isinstance(value, int | float):
        raise RefusedError  # SILENT: a text of a number is no number, where it is no list
    return _real(item, value) if item in ("double", "float") else _whole(item, value)


def _json_text(value: Value) -> str:
    try:
        return json.dumps(value, ensure_ascii=False, allow_nan=False)
    except ValueError:  # SILENT: NaN has no JSON text
        raise RefusedError from None


def _real(item: str, value: float) -> float:
    try:
        real = float(value)  # SILENT: NaN and infinity may be sent
    except OverflowError:
        raise RefusedError from None
    if item == "float" and math.isfinite(real) and abs(real) > 3.4028234663852886e38:
        raise RefusedError
    return real


def _whole(item: str, value: float) -> int:
    signed, bits = not item.startswith("u"), int(re.sub("u?int", "", item))
    least = -(2 ** (bits - 1)) if signed else 0
    most = 2 ** (bits - signed) - 1
    if value % 1 or not least <= value <= most:
        raise RefusedError
    return int(value)


# --- the message that a request makes


@dataclass(frozen=True)
class Filled:
    """The message of a request: each field from its entry, each list as long as entries say."""

    registry: Registry
    entries: Mapping[str, Entry]

    def message(self, name: str, before: str, index: Index) -> Message:
        """The message whose fields are ``before + field``, at these indices of its lists."""
        return {
            field: self.field(kind_of(text), before + field, index)
            for field, text in self.registry[name].items()
        }

    def field(self, kind: Kind, path: str, index: Index) -> Value:
        if path in self.entries:
            return self.leaf(self.entries[path], index)
        if not kind.nested or (kind.many and not self.on(f"{path}[]")):
            return default(self.registry, kind)
        if not kind.many:
            return self.message(kind.item, f"{path}.", index)
        size = self.size(kind, f"{path}[]", index)
        return [self.message(kind.item, f"{path}[].", (*index, i)) for i in range(size)]

    def on(self, prefix: str) -> list[Entry]:
        return [each for each in self.entries.values() if prefix in each.lists]

    def size(self, kind: Kind, prefix: str, index: Index) -> int:
        """The number of items of a list at these indices of the lists around it."""
        made = {len(cast("list[Value]", e.at(index))) for e in self.on(prefix) if e.makes(prefix)}
        if kind.least:  # an array has its items already
            made.add(kind.least)
        if not made and any(each.listed for each in self.on(prefix)):
            made = {1}
        if len(made) != 1 or 0 in made or not kind.takes(min(made)):
            raise RefusedError
        return min(made)

    def leaf(self, each: Entry, index: Index) -> Value:
        value = each.at(index)
        if not each.field.many:
            return fit(each.field.item, value)
        items = cast("list[Value]", value)
        if not each.field.takes(len(items)):
            raise RefusedError
        return [fit(each.field.item, item) for item in items]


def judge_fill(registry: Registry, type_name: str, request: Mapping[str, Value]) -> Message | None:
    """The message that a request makes, or None if it is an error.

    Parameters are replaced; None is one without a value, and its entry counts as not written.
    """
    try:
        entries = {
            path: entry(registry, type_name, path, value)
            for path, value in request.items()
            if value is not None
        }
        return Filled(registry, entries).message(type_name, "", ())
    except RefusedError:
        return None


# --- reading

Step: TypeAlias = "tuple[str, str | None]"  # a field, and what is between its brackets


def steps_of(path: str) -> list[Step]:
    """The steps of a path: split at the dots outside of brackets."""
    parts, open_brackets = [""], 0
    for letter in path:
        open_brackets += {"[": 1, "]": -1}.get(letter, 0)
        if letter == "." and not open_brackets:
            parts.append("")
        else:
            parts[-1] += letter
    matches = [re.fullmatch(r"(\w+)(?:\[(.*)\])?", part) for part in parts]
    if not all(matches):
        raise RefusedError
    return [(match[1], match[2]) for match in matches if match]


def kind_at(registry: Registry, kind: Kind, steps: Sequence[Step]) -> Kind:
    """The kind of what a path reads: a path that the definition lacks is an error in any message.

    SILENT: `a[]` is the end of a path, `a[all].b[]` a list of lengths, `a[all].b[all].c` one of
    lists. One may pick from a list of numbers or texts (`ranges[last]`). A score is a number, so
    not a boolean, but may be the length of a list.
    """
    if not steps:
        return kind
    (name, pick), *rest = steps
    if kind.many or not kind.nested:
        raise RefusedError
    field = field_of(registry, kind.item, name)
    if pick is None:
        return kind_at(registry, field, rest)
    item = Kind(field.item)
    if not field.many or (pick == "" and rest):
        raise RefusedError
    if pick == "":
        return Kind("int64")
    if pick.startswith("best by "):
        score = kind_at(registry, item, _score(pick))
        if score.many or score.nested or score.item in ("string", "boolean"):
            raise RefusedError
    elif pick not in ("first", "last", "all"):
        raise RefusedError
    end = kind_at(registry, item, rest)
    return Kind(end.item, many=True) if pick == "all" else end


def _score(pick: str) -> list[Step]:
    return steps_of(pick.removeprefix("best by "))


def read(value: Value, steps: Sequence[Step]) -> Value:
    """The value at a path, as it is in the message."""
    if not steps:
        return value
    (name, pick), *rest = steps
    field = cast("Message", value)[name]
    if pick is None:
        return read(field, rest)
    items = cast("list[Value]", field)
    if pick == "":
        return len(items)
    if pick == "all":
        return [read(item, rest) for item in items]
    if pick.startswith("best by "):
        items = _best(items, _score(pick))
    if not items:  # SILENT: the best of an empty list, or one without scores, fails as the first
        raise RefusedError
    return read(items[-1 if pick == "last" else 0], rest)


def _best(items: list[Value], score: list[Step]) -> list[Value]:
    """The items with the greatest score.

    SILENT: a score that cannot be read fails the step.
    """
    scores = [cast("float", read(item, score)) for item in items]
    greatest = max((each for each in scores if math.isfinite(each)), default=None)
    return [item for item, each in zip(items, scores, strict=True) if each == greatest]


def _unmeasured(value: Value) -> bool:
    if isinstance(value, list):
        return any(map(_unmeasured, value))
    if isinstance(value, dict):
        return any(map(_unmeasured, value.values()))
    return isinstance(value, float) and not math.isfinite(value)


def judge_whole(value: Value) -> Value:
    """The content of the text of `.`: null for every number that is not measured."""
    if isinstance(value, list):
        return [judge_whole(item) for item in value]
    if isinstance(value, dict):
        return {name: judge_whole(item) for name, item in value.items()}
    return None if _unmeasured(value) else value


def _raw(registry: Registry, type_name: str, message: Message, path: str) -> Value:
    """The value at a path; a list with a number that is not measured is an error."""
    steps = steps_of(path)
    kind_at(registry, Kind(type_name), steps)
    value = read(message, steps)
    if isinstance(value, list) and _unmeasured(value):
        raise RefusedError
    return value


def judge_read(registry: Registry, type_name: str, message: Message, path: str) -> Value | Outcome:
    """The value that a path hands over. SILENT: a message at its end, with null as in `.`."""
    try:
        value = _raw(registry, type_name, message, path)
    except RefusedError:
        return ERROR
    if isinstance(value, dict):
        return judge_whole(value)
    return ABSENT if _unmeasured(value) else value


# --- success

COMPARISONS: dict[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def _is_number(value: Value) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def equal(left: Value, right: Value) -> bool:
    """Equality of values. SILENT: true is not 1, the text "1" is not 1, and 1.0 is 1."""
    if isinstance(left, list) and isinstance(right, list):
        return len(left) == len(right) and all(map(equal, left, right))
    if _is_number(left) and _is_number(right):
        return left == right
    return type(left) is type(right) and left == right


def holds(actual: Value, wanted: Value, parameters: Mapping[str, Value]) -> bool:
    """The verdict on one entry: the field has this value or stands this comparison.

    Only numbers are less or greater; `!=` holds between
    values of different types. A comparison with neither a number nor a parameter (`> abc`) is a
    text to be equal to, and so is the value of a parameter that looks like a comparison.
    SILENT: a parameter without a value makes its entry false.
    """
    sign, bound = "", wanted
    if isinstance(wanted, str) and (
        match := re.fullmatch(rf"\s*(<=|>=|!=|==|<|>|)\s*({NUMBER}|\$\w+)\s*", wanted)
    ):
        sign = match[1]
        if match[2].startswith("$"):
            bound = parameters.get(match[2][1:])
        elif sign:
            bound = float(match[2])
    if bound is None or _is_unmeasured(actual) or _is_unmeasured(bound):
        return False
    if sign in COMPARISONS:
        comparable = _is_number(actual) and _is_number(bound)
        return comparable and COMPARISONS[sign](cast("float", actual), cast("float", bound))
    return equal(actual, bound) != (sign == "!=")


def _is_unmeasured(value: Value) -> bool:
    return isinstance(value, float) and not math.isfinite(value)


def judge_success(
    registry: Registry,
    type_name: str,
    message: Message,
    success: Mapping[str, Value] | Sequence[Mapping[str, Value]],
    parameters: Mapping[str, Value] | None = None,
) -> bool:
    """The verdict on an answer: all entries hold, of one of the mappings.

    SILENT: an entry that cannot be read (an empty list, NaN in a list) does not hold, but another
    mapping may. A mapping without entries holds, a list without mappings does not.
    """

    def entry_holds(path: str, wanted: Value) -> bool:
        try:
            actual = _raw(registry, type_name, message, path)
        except RefusedError:
            return False
        return holds(actual, wanted, parameters or {})

    choices = [success] if isinstance(success, Mapping) else success
    return any(all(entry_holds(*each) for each in choice.items()) for choice in choices)
