"""The fields that a call needs, compared with its definition before anything is sent.

A request is looked at as far as its values are settled. For the others there may be values with
which it can be filled; if there are none, that is said. No graph is needed, only definitions.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.model.ros import WHOLE, Comparison, RosKind, parameter_in
from gpsfsm.ros.messages import NUMBERS, NoCountError, fill, kind_at, misfit
from gpsfsm.ros.node import RosError
from gpsfsm.ros.runner import parameter_value
from gpsfsm.ros.topics import check_conditions

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.ros import Condition, RosCall


_ORDERED = (Comparison.AT_LEAST, Comparison.AT_MOST, Comparison.ABOVE, Comparison.BELOW)


def settled(
    value: Any, parameters: Mapping[str, RunValue], open_names: Collection[str]
) -> tuple[Any, bool]:
    """The value of an entry, None without one, and whether it is settled before the run.

    Raises RosError for a parameter in a list that has no value and gets none, and for a yaw that
    is no number.
    """
    if isinstance(value, str) and value.startswith("$"):
        name, axis = parameter_in(value)
        if name in open_names:
            return None, False
        return parameter_value(name, axis, parameters), True
    if isinstance(value, tuple):
        items = [settled(each, parameters, open_names) for each in value]
        if not all(is_settled for _, is_settled in items):
            return None, False
        if any(each is None for each, _ in items):
            raise RosError("a parameter in a list has no value")
        return [each for each, _ in items], True
    return value, True


class Request:
    """The request of a call, with the values that are settled before the run.

    ``misses`` says why it cannot be filled, whatever the others are; ``message`` has what is
    settled; ``later`` are the fields whose values come with the run.
    """

    def __init__(
        self,
        kind: Any,
        call: RosCall,
        parameters: Mapping[str, RunValue],
        open_names: Collection[str] = (),
    ) -> None:
        self.message = kind()
        self.misses: list[str] = []
        self.later: list[str] = []
        self._optional = frozenset(call.optional)
        values: dict[str, RunValue] = {}
        wrong: set[str] = set()
        for path, written in call.request:
            try:
                value, is_settled = settled(written, parameters, open_names)
                why = misfit(self.message, path, value, optional=path in self._optional)
            except RosError as error:
                why = f"{path}: {error}"
            if why:
                wrong.add(_group(path))
                self.misses.append(why)
            elif not is_settled:
                self.later.append(path)
            elif value is not None:
                values[path] = value
        self._fill(kind, values, wrong)

    def _fill(self, kind: Any, values: Mapping[str, RunValue], wrong: Collection[str]) -> None:
        """Fill group after group, so that each says what is wrong with it, then all together."""
        whole: dict[str, RunValue] = {}
        late = {_group(path) for path in self.later}
        for group in dict.fromkeys(map(_group, values)):
            part = {path: each for path, each in values.items() if _group(path) == group}
            why = "" if group in wrong else self._try(kind(), part, group in late)
            if why is None:
                continue
            if why:
                self.misses.append(why)
            elif group not in wrong:
                whole |= part
        if why := self._try(self.message, whole):
            self.misses.append(why)

    def _try(self, message: Any, values: Mapping[str, RunValue], more: bool = False) -> str | None:
        """The reason why these values do not fill a message; None if that depends on ``more``."""
        try:
            fill(message, values, self._optional)
        except NoCountError as error:
            return None if more else str(error)
        except RosError as error:
            return str(error)
        return ""


def _group(path: str) -> str:
    """The fields that are filled together: those of one list, or one field alone."""
    return path.partition("[]")[0]


def request_type(call: RosCall, kind: Any) -> Any:
    """The class of the message that a call sends; None if it sends none."""
    if call.kind is RosKind.ACTION:
        return kind.Goal
    return kind.Request if call.kind is RosKind.SERVICE else None


def answer_type(call: RosCall, kind: Any) -> Any:
    """The class of the message that comes back."""
    if call.kind is RosKind.ACTION:
        return kind.Result
    return kind.Response if call.kind is RosKind.SERVICE else kind


def answer_misses(
    message: Any,
    call: RosCall,
    parameters: Mapping[str, RunValue],
    open_names: Collection[str] = (),
) -> list[str]:
    """The reasons why what a call reads can never be in its answer."""
    misses: dict[str, None] = {}
    needed = [("outputs", path) for _, path in call.outputs if path != WHOLE]
    for key, sets in (("success", call.success), ("until", call.until)):
        needed += [(key, field) for each in sets for field, _, _ in each]
    for key, path in needed:
        if (why := _unreadable(message, path)) and path not in call.optional:
            misses[f"{key}: {why}"] = None
    if not misses:
        never = [_never(message, each, parameters, open_names) for each in call.success]
        if never and all(never):
            misses[f"success: {'; '.join(dict.fromkeys(never))}"] = None
        if why := _unwatched(message, call, parameters, open_names):
            misses[why] = None
    return [*misses]


def _unwatched(
    message: Any, call: RosCall, parameters: Mapping[str, RunValue], open_names: Collection[str]
) -> str:
    """The reason why a topic cannot be watched for what is settled; "" if it can."""
    try:
        for each in (each for conditions in call.until for each in conditions):
            value, is_settled = settled(each.value, parameters, open_names)
            if is_settled:
                check_conditions(message, [[each._replace(value=value)]])
    except RosError as error:
        return str(error)
    return ""


def lesser_misses(kind: Any, call: RosCall) -> list[str]:
    """The fields that a definition lacks of those that are only told: the run goes on without."""
    rows: list[tuple[str, Any, str]] = []
    if call.kind is RosKind.ACTION:
        feedback = kind.Feedback()
        rows += [("feedback", feedback, path) for _, path in call.feedback]
        rows += [("pose", feedback, call.pose)] * bool(call.pose)
    if call.message:
        rows.append(("message", answer_type(call, kind)(), call.message))
    return _reasons((key, _unreadable(message, path)) for key, message, path in rows)


def _reasons(rows: Iterable[tuple[str, str]]) -> list[str]:
    return [f"{key}: {why}" for key, why in rows if why]


def _unreadable(message: Any, path: str) -> str:
    try:
        kind_at(message, path)
    except RosError as error:
        return str(error)
    return ""


def _never(
    message: Any,
    conditions: tuple[Condition, ...],
    parameters: Mapping[str, RunValue],
    open_names: Collection[str],
) -> str:
    """The reason why a set of conditions can never hold; "" if it can."""
    for field, comparison, wanted in conditions:
        if _unreadable(message, field):
            return f"there is no {field}"
        try:
            value, is_settled = settled(wanted, parameters, open_names)
        except RosError as error:
            return str(error)
        if not is_settled:
            continue
        if value is None:
            return f"{wanted} has no value to compare {field} with"
        if "[all]" not in field and (why := _apart(kind_at(message, field), comparison, value)):
            return f"{field} is {why}"
    return ""


def _apart(kind: str, comparison: Comparison, value: RunValue) -> str:
    """The reason why no value of a type can be to another value as a comparison has it."""
    if comparison is Comparison.IS_NOT or kind.endswith((">", "]")):
        return ""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind.startswith(NUMBERS):
        fits = is_number
    elif comparison in _ORDERED:
        fits = False
    elif kind == "boolean":
        fits = isinstance(value, bool)
    else:
        fits = not kind.startswith(("string", "wstring")) or isinstance(value, str)
    return "" if fits else f"a {kind}, and never {comparison} {value!r}"
