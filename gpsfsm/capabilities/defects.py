"""What is wrong with capability files."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import islice
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Severity
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["Defect", "Notes", "Place", "did_you_mean", "quoted"]

Place = tuple[int, int]
"""Line and column, from 1, in code points."""

_MAX_SHOWN = 60
_MAX_PER_FILE = 100
_MAX_KNOWN = 5000


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
    def told(self) -> str:
        """In one line, without the hint."""
        place = f"{printable(self.file)}:{self.line}:{self.column}"
        return f"{place}: {self.severity.value}: {self.message}"

    def __str__(self) -> str:
        return f"{self.told}\n    {self.hint}" if self.hint else self.told


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
        """Whether there are so many that more would help nobody."""
        return len(self.defects) >= _MAX_PER_FILE

    def near(self, word: str, known: Iterable[str]) -> str:
        """``did_you_mean``, but for files with so many defects that it would take long."""
        return "" if self.full else did_you_mean(word, known)

    def _add(self, defect: Defect) -> None:
        if not self.full:
            self.defects.append(defect)


def quoted(text: str) -> str:
    """A piece of a file in a message: in quotation marks, printable, and not too long."""
    shown = text if len(text) <= _MAX_SHOWN else text[: _MAX_SHOWN - 1] + "…"
    return f"'{printable(shown)}'"


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """A question with the nearest known word; "" if none is near."""
    from difflib import get_close_matches  # noqa: PLC0415  (only when something is wrong)

    near = get_close_matches(word[:_MAX_SHOWN], list(islice(known, _MAX_KNOWN)), n=1)
    return f"did you mean {quoted(near[0])}?" if near else ""
