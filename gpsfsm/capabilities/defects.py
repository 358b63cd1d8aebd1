"""Defects of the files that people write: capabilities, worlds, tasks."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import islice
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Severity
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterable

Place = tuple[int, int]
"""Line and column, from 1, in code points."""

_MAX_SHOWN = 60
_MAX_PER_FILE = 100
_MAX_LISTED = 20
_MAX_NAMES = 5000


@dataclass(frozen=True, slots=True)
class Defect:
    """One thing that is wrong: where, what, and what to do (``hint``, may be empty).

    An error means that something of the file is not used; a warning, that something is used but
    hardly meant so.
    """

    file: str
    line: int
    column: int
    message: str
    hint: str = ""
    severity: Severity = Severity.ERROR

    @property
    def order(self) -> tuple[str, int, int, int, str]:
        """Sorts defects by place, errors before warnings."""
        return self.file, self.line, self.column, -self.severity.rank, self.message

    @property
    def summary(self) -> str:
        """In one line, without the hint."""
        place = f"{printable(self.file)}:{self.line}:{self.column}"
        return f"{place}: {self.severity.value}: {self.message}"

    def __str__(self) -> str:
        return f"{self.summary}\n    {self.hint}" if self.hint else self.summary


@dataclass(slots=True)
class Notes:
    """Collects the defects of one file. ``kind`` is what such a file describes, in a word."""

    file: str
    defects: list[Defect] = field(default_factory=list)
    kind: str = "capability"

    def error(self, place: Place, message: str, hint: str = "") -> None:
        """Note that something cannot be used."""
        self._add(Defect(self.file, *place, message, hint))

    def warning(self, place: Place, message: str, hint: str = "") -> None:
        """Note that something is hardly meant so."""
        self._add(Defect(self.file, *place, message, hint, Severity.WARNING))

    @property
    def full(self) -> bool:
        """True if there are so many that more would help nobody."""
        return len(self.defects) >= _MAX_PER_FILE

    def near(self, word: str, names: Iterable[str], *, cutoff: float = 0.6) -> str:
        """``did_you_mean``, but for files with so many defects that it would take long."""
        return "" if self.full else did_you_mean(word, names, cutoff=cutoff)

    def _add(self, defect: Defect) -> None:
        if not self.full:
            self.defects.append(defect)


def errors_text(notes: Notes) -> str:
    """The worst defects of a file of which nothing is used then: all of them are errors."""
    defects = sorted(notes.defects, key=lambda defect: defect.order)
    lines = [str(replace(each, severity=Severity.ERROR)) for each in defects[:_MAX_LISTED]]
    if len(defects) > _MAX_LISTED:
        lines.append(f"and {len(defects) - _MAX_LISTED} more")
    return "\n".join(dict.fromkeys(lines))


def quoted(text: str) -> str:
    """A piece of a file in a message: in quotation marks, printable, and not too long."""
    shown = text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 1] + "…"
    return f"'{printable(shown)}'"


def did_you_mean(word: str, names: Iterable[str], *, cutoff: float = 0.6) -> str:
    """A question with the nearest known word; "" if none is near. ``cutoff``: as of difflib."""
    from difflib import get_close_matches

    near = get_close_matches(word[:_MAX_SHOWN], list(islice(names, _MAX_NAMES)), n=1, cutoff=cutoff)
    return f"did you mean {quoted(near[0])}?" if near else ""
