"""Properties of runs, and their breaches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.fuzzing.runs import Run


@dataclass(frozen=True, slots=True)
class Breach:
    """A run breaks a property.

    ``numbers`` are the instances that it shows at, the most important one first; (): the run as a
    whole. Breaches with the same ``about`` are told once, in the plainest scenario.
    """

    message: str
    numbers: tuple[int, ...] = ()
    about: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Property:
    """A property of every run; ``holds`` says it in a few words.

    ``check`` gives what breaks it in one run, in an order that depends on the run alone.
    ``by_default``: plans are held against it if nothing else is asked for.
    """

    name: str
    holds: str
    check: Callable[[Run], Iterable[Breach]]
    severity: Severity = Severity.ERROR
    by_default: bool = False
