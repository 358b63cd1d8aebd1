"""Verdicts as JSON and back: how a worker tells what it has decided.

A worker has read a hostile text, so that nothing it says is taken for more than data: what does not
fit the types exactly is no verdict.
"""

from __future__ import annotations

import json
import types
import typing
from dataclasses import fields, is_dataclass, replace
from enum import Enum
from functools import cache
from typing import Any, Literal, Union

from gpsfsm.gating.verdicts import Verdict
from gpsfsm.model.event import End, Event, Outcome
from gpsfsm.model.finding import Finding
from gpsfsm.model.plan import Location
from gpsfsm.model.report import PlanReport
from gpsfsm.strict_json import strict_loads

__all__ = ["MOST_FINDINGS", "decode", "encode"]

MOST_FINDINGS = 1_000
"""Findings of each kind that are handed over; a verdict is no less refused for more of them."""

_NAMES = {
    "End": End,
    "Event": Event,
    "Finding": Finding,
    "Location": Location,
    "Outcome": Outcome,
    "PlanReport": PlanReport,
}
"""What the modules of the model import for type checkers only."""


def encode(verdict: Verdict) -> bytes:
    """A verdict as JSON, with at most ``MOST_FINDINGS`` findings of each kind."""
    return json.dumps(_plain(_bounded(verdict)), separators=(",", ":")).encode("ascii")


def _bounded(verdict: Verdict) -> Verdict:
    """The part of a verdict that is handed over; the text of a plan goes only with findings."""
    report = verdict.report
    if report is not None:
        report = replace(
            report,
            findings=_cut(report.findings),
            suppressed=_cut(report.suppressed),
            source=report.source if report.findings else None,
        )
    return replace(verdict, findings=_cut(verdict.findings), report=report)


def decode(text: bytes) -> Verdict:
    """The verdict; raises ValueError for anything that ``encode`` does not write."""
    try:
        verdict: Verdict = _made(Verdict, strict_loads(text))
    except RecursionError as error:
        raise ValueError("nested too deeply") from error
    if _bounded(verdict) != verdict:
        raise ValueError("this is more than a worker hands over")
    return verdict


def _cut(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Those of the greatest severity, in their order."""
    if len(findings) <= MOST_FINDINGS:
        return findings
    worst = sorted(range(len(findings)), key=lambda at: -findings[at].severity.rank)
    return tuple(findings[at] for at in sorted(worst[:MOST_FINDINGS]))


def _plain(value: object) -> object:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: _plain(getattr(value, each.name)) for each in fields(value)}
    return value.value if isinstance(value, Enum) else value


def _made(kind: Any, value: Any) -> Any:
    """The value as one of this type."""
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType):
        if value is None and type(None) in arguments:
            return None
        (only,) = (each for each in arguments if each is not type(None))
        return _made(only, value)
    if origin is Literal:
        return _checked(value, value in arguments)
    if origin is tuple:
        return _tuple(arguments, value)
    if is_dataclass(kind):
        return _object(kind, value)
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(_checked(value, isinstance(value, str)))
    if kind is float:
        fits = isinstance(value, int | float) and not isinstance(value, bool)
        return float(_checked(value, fits))
    return _checked(value, type(value) is kind)


def _tuple(kinds: tuple[Any, ...], value: Any) -> tuple[Any, ...]:
    _checked(value, isinstance(value, list))
    if len(kinds) == 2 and kinds[1] is Ellipsis:
        return tuple(_made(kinds[0], each) for each in value)
    _checked(value, len(value) == len(kinds))
    return tuple(_made(kind, each) for kind, each in zip(kinds, value, strict=True))


def _object(kind: Any, value: Any) -> Any:
    hints = _hints(kind)
    _checked(value, isinstance(value, dict) and set(value) == set(hints))
    return kind(**{name: _made(hint, value[name]) for name, hint in hints.items()})


@cache
def _hints(kind: Any) -> dict[str, Any]:
    hints = typing.get_type_hints(kind, localns=_NAMES)
    return {each.name: hints[each.name] for each in fields(kind)}


def _checked(value: Any, fits: bool) -> Any:
    if not fits:
        raise ValueError(f"this is no part of a verdict: {str(value)[:60]}")
    return value
