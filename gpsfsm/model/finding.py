"""Problems, findings and scenarios: what gpsfsm tells its users."""

from __future__ import annotations

from dataclasses import replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Literal

from gpsfsm.late import dataclass
from gpsfsm.model.showing import shown
from gpsfsm.model.story import Sentence, Vocabulary

if TYPE_CHECKING:
    from gpsfsm.model.event import End, Event, Outcome
    from gpsfsm.model.plan import Location


_MAY = "unless the over-approximated constructs rule that out"


class Severity(StrEnum):
    """The severity of a finding; ``rank`` orders them."""

    ERROR = "error"
    WARNING = "warning"
    INFO = "info"

    @property
    def rank(self) -> int:
        """2 for error, 1 for warning, 0 for info."""
        return {"error": 2, "warning": 1, "info": 0}[self.value]


class Confidence(StrEnum):
    """``proved`` by analysis or by the grammar; ``heuristic`` where intent is guessed.

    ``may``: only runs that the automaton has and the file may not have show it (semantics, 9.6).
    """

    PROVED = "proved"
    MAY = "may"
    HEURISTIC = "heuristic"


@dataclass(frozen=True, slots=True)
class Related:
    """Another place that belongs to a finding, and why (``message`` may be empty)."""

    location: Location
    message: str = ""


@dataclass(frozen=True, slots=True)
class TraceStep:
    """One event of a run.

    ``element`` is the element path of the runner that emits it, ``line`` the line of its start tag,
    ``file`` that of its location.
    """

    event: Event
    element: str
    line: int
    file: str = ""


@dataclass(frozen=True, slots=True)
class Scenario:
    """A counterexample: the decisions that matter; every outcome that is not listed is open.

    ``outcomes`` are (element path, outcome) in document order. ``trace`` holds the events that are
    causally necessary for the claim, in causal order; if there are more than 200, only the last
    200, and ``trace_truncated`` is true. ``sentences`` are the story of the run as data.
    """

    outcomes: tuple[tuple[str, Outcome], ...]
    ends: End
    trace: tuple[TraceStep, ...] = ()
    trace_truncated: bool = False
    sentences: tuple[Sentence, ...] = ()
    vocabulary: Vocabulary = Vocabulary.PLAN

    @property
    def story(self) -> tuple[str, ...]:
        """The run in short sentences, as in reports."""
        return tuple(sentence.text(self.vocabulary) for sentence in self.sentences)

    @property
    def ending(self) -> str:
        """The end of the run in words: ``the plan gives up``."""
        return self.vocabulary.ending(self.ends)


@dataclass(frozen=True, slots=True)
class Problem:
    """A report of the front end: a rule code, a place and words; rules turn it into a finding.

    ``length`` is the number of code points to underline on that line (0: only a caret);
    ``severity`` is that of the rule, unless it is given.
    """

    rule: str
    message: str
    location: Location
    hint: str = ""
    length: int = 0
    related: tuple[Related, ...] = ()
    severity: Severity | None = None


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding. ``rule`` is the code of its rule (GP302), ``name`` the kebab-case name.

    ``suppressed_by`` says what suppressed the finding: ``comment``, ``option`` or ``baseline``; it
    is "" for a finding that is shown. ``justification`` is the reason given in a comment, even if
    an option or a baseline already hides the finding. ``unless`` is the code of a rule that may
    report the same problem ("": none): if a finding of that rule names the element of this one,
    this one is omitted. Reports do not contain ``unless``. ``if_proved`` is the severity of a
    finding of confidence ``may`` if it were proved.
    """

    rule: str
    name: str
    severity: Severity
    message: str
    location: Location
    hint: str = ""
    length: int = 0
    related: tuple[Related, ...] = ()
    scenario: Scenario | None = None
    confidence: Confidence = Confidence.PROVED
    suppressed_by: Literal["", "comment", "option", "baseline"] = ""
    justification: str = ""
    unless: str = ""
    if_proved: Severity | None = None

    def as_may(self) -> Finding:
        """The same where nobody knows whether it can happen: never an error."""
        severity = Severity.WARNING if self.severity is Severity.ERROR else self.severity
        return replace(
            self,
            severity=severity,
            confidence=Confidence.MAY,
            if_proved=self.severity,
            message=f"{self.message} ({_MAY})",
        )

    @property
    def excused(self) -> bool:
        """True if a comment in the plan excuses it; the plan's author can write such a comment."""
        return bool(self.justification)

    def _repr_html_(self) -> str | None:
        """Message, scenario and hint, for notebooks."""
        return shown("finding_html", self)

    def _repr_pretty_(self, printer: Any, _cycle: bool) -> None:
        """The same as text, where nothing draws: IPython on a terminal."""
        printer.text(str(self))

    def __str__(self) -> str:
        """The same for ``print``."""
        return shown("finding_text", self) or repr(self)

    @property
    def elements(self) -> frozenset[str]:
        """The element paths of its location and of the related locations."""
        places = (self.location, *(other.location for other in self.related))
        return frozenset(place.element for place in places)
