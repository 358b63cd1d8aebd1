"""Records of a run as sentences, as plain lines of text, and as the steps that a model reads."""

from __future__ import annotations

from enum import IntEnum
from typing import TYPE_CHECKING

from gpsfsm.execution.journal_rows import RowMaker
from gpsfsm.execution.records import Kind, Record
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.labels import action
from gpsfsm.model.plan import ControlType, Element
from gpsfsm.model.printable import clip
from gpsfsm.model.story import Vocabulary
from gpsfsm.watch.moments import moments, seconds, status_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.records import Input, RunValue
    from gpsfsm.generation.prompt_builder import Step
    from gpsfsm.model.automaton import Automaton

_MAX_NAME = 120
_MAX_VALUE = 60
_MAX_VALUES = 4
_MAX_MESSAGE = 300


class Detail(IntEnum):
    """The level of detail: ``ALL`` are all records, ``RUN`` those that tell what the plan does."""

    RUN = 0
    ALL = 1


_SENTENCES = {
    Kind.BEGIN: "the run begins",
    Kind.TRIGGERED: "triggered",
    Kind.STARTED: "started",
    Kind.SUCCEEDED: "succeeded",
    Kind.FAILED: "failed",
    Kind.TIMEOUT: "timed out",
    Kind.STOPPED: "stopped",
    Kind.STOPPING: "is asked to stop",
    Kind.HELD: "is held until the run continues",
    Kind.LATE: "answered when it was no longer active",
    Kind.LOADING: "is being loaded",
    Kind.LOADED: "loaded",
    Kind.NOT_LOADED: "could not be loaded",
    Kind.UNLOADED: "unloaded",
    Kind.PAUSE: "the run pauses",
    Kind.RESUME: "the run continues",
    Kind.CANCEL: "the run is cancelled",
    Kind.SILENCE: "nothing more can happen by itself",
    Kind.REPORTED: "the server reports the end",
    Kind.ENDED: "the run has ended",
    Kind.LOG: "says",
    Kind.NOTE: "note",
    Kind.CONTINUED: "the run continues in another process",
    Kind.RESTARTED: "is asked again",
}
_DETAILS = frozenset(
    (
        Kind.BEGIN,
        Kind.TRIGGERED,
        Kind.STOPPING,
        Kind.LOADING,
        Kind.LOADED,
        Kind.UNLOADED,
        Kind.SILENCE,
        Kind.ENDED,
    )
)
_OF_CHOICES = {
    Kind.TRIGGERED: "triggered",
    Kind.SUCCEEDED: "holds",
    Kind.FAILED: "does not hold",
}
_OWN_RUNNERS = {CHOICE: "the runner of choices", TICK: "the runner of ticks"}
_JOINS = {
    (ControlType.PARALLEL_ALL, True): "all have succeeded",
    (ControlType.PARALLEL_ALL, False): "one has failed",
    (ControlType.PARALLEL_ANY, True): "all have failed",
    (ControlType.PARALLEL_ANY, False): "one has succeeded",
    (ControlType.RECOVERY, False): "what it guards has succeeded, or it has",
}


class Words:
    """Names the nodes of one automaton and its runners (interface, provider), and tells records."""

    def __init__(self, automaton: Automaton, runners: Sequence[tuple[str, str]]) -> None:
        self.automaton = automaton
        self.runners = runners
        self._line_width = len(str(max(each.line for each in automaton.plan.elements)))

    def element(self, node: int) -> Element:
        """The element that a node comes from."""
        return self.automaton.plan.elements[self.automaton.nodes[node].origin]

    def node(self, node: int) -> str:
        """The name of a node: ``WaypointRunner (x=1.0)``, ``parallel_all 'look'``."""
        element = self.element(node)
        if self.automaton.nodes[node].kind is NodeKind.RUNNER:
            return clip(action(element), _MAX_NAME)
        name = element.text("name")
        what = element.words or "plan"
        return f"{what} '{clip(name, _MAX_NAME)}'" if name else what

    def line(self, node: int) -> str:
        """``line  5``, as wide for every line of the plan; ``node 'drive'`` where there is none."""
        if self.element(node).lineless:
            return self.element(node).where
        return f"line {self.element(node).line:>{self._line_width}}"

    def shown(self, record: Record, detail: Detail) -> bool:
        """True if a record is shown at this level of detail."""
        if detail is Detail.ALL:
            return True
        if is_running_news(record):
            return False
        if record.kind is Kind.JOINED:
            kind = self.element(record.node).control_type
            return kind in (ControlType.PARALLEL_ALL, ControlType.PARALLEL_ANY)
        return record.kind not in _DETAILS

    def subject(self, record: Record) -> str:
        """The subject of a record: ``line 5  WaypointRunner (x=1.0)``, ``runner a/Go``, or ""."""
        if record.node >= 0:
            return f"{self.line(record.node)}  {self.node(record.node)}"
        if record.runner >= 0:
            interface, provider = self.runners[record.runner]
            if interface in _OWN_RUNNERS:
                return _OWN_RUNNERS[interface]
            shown = interface if interface == provider else f"{interface} ({provider})"
            return f"runner {clip(shown, _MAX_NAME)}"
        return ""

    def verb(self, record: Record) -> str:
        """The event, with values and messages: ``failed: no way to (1, 3)``."""
        tree = self.automaton.plan.vocabulary is Vocabulary.TREE
        if record.kind is Kind.JOINED and (tree or not self.automaton.traits.gives_up):
            return "its join has all that it waits for"
        if record.kind is Kind.JOINED:
            control = self.element(record.node).control_type
            many = self.automaton.nodes[record.node].need > 1
            joined = _JOINS.get((control, many)) if control else None
            return joined or "one of its parts has failed"
        if record.kind in _OF_CHOICES and self._is_choice(record.node):
            said = _OF_CHOICES[record.kind]  # whatever was drawn, there is no more to say
            visit = record.message if record.kind is Kind.TRIGGERED else ""
            return f"{said}: {visit}" if visit else said
        if record.kind is Kind.ENDED:
            return f"the run has ended: {status_of(record).value}"
        if is_feedback(record):
            return feedback_words(record.data or {}) or clip(record.message, _MAX_MESSAGE)
        marked = record.kind in (Kind.LOG, Kind.NOTE)  # their data are for programs
        added = [values(record.data)] if record.data and not (marked and record.message) else []
        if record.message and record.kind is not Kind.LATE:
            added.append(clip(" ".join(record.message[: 2 * _MAX_MESSAGE].split()), _MAX_MESSAGE))
        said = _SENTENCES[record.kind]
        if added == [said]:
            return said
        return f"{said}: {'; '.join(added)}" if added else said

    def _is_choice(self, node: int) -> bool:
        return node >= 0 and self.element(node).interface == CHOICE

    def sentence(self, record: Record) -> str:
        """The whole sentence."""
        colon = ":" if record.kind is Kind.JOINED or is_feedback(record) else ""
        return f"{self.subject(record)}{colon} {self.verb(record)}".strip()


def values(data: Mapping[str, RunValue]) -> str:
    """``x=1.0, text='Hello'``, clipped."""
    shown = [
        f"{clip(name, _MAX_VALUE)}={clip(_value(value), _MAX_VALUE)}"
        for name, value in list(data.items())[:_MAX_VALUES]
    ]
    more = ["…"] if len(data) > _MAX_VALUES else []
    return ", ".join([*shown, *more])


def _value(value: RunValue) -> str:
    if isinstance(value, str):
        return f"'{' '.join(value[: 2 * _MAX_VALUE].split())}'"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        few = [_value(each) for each in value[:_MAX_VALUES]]
        return f"[{', '.join([*few, '…'] if len(value) > _MAX_VALUES else few)}]"
    return str(value)


_FEEDBACK, _MAP = "feedback", "world"


def is_feedback(record: Record) -> bool:
    """True for a line in which a runner says how far it is."""
    return record.kind is Kind.LOG and bool(record.data) and _FEEDBACK in (record.data or {})


def is_running_news(record: Record) -> bool:
    """True for what a runner says as long as all is well: how far it is, where, and accepted."""
    data = (record.data or {}) if record.kind is Kind.LOG else {}
    return is_feedback(record) or _MAP in data or data.get("ledger") == "ACCEPTED"


_UNITS = {"_m_per_s": ("m/s", 2), "_m": ("m", 1), "_s": ("s", 0), "_percent": ("%", 0)}
_PLAIN = frozenset(("distance", "time"))
_LARGE = 1e9


def feedback_words(data: Mapping[str, RunValue]) -> str:
    """The feedback of a runner in words; its names end with their units.

    >>> feedback_words({"feedback": "drive", "distance_left_m": 1.24, "time_left_s": 12.3})
    '1.2 m left, 12 s left'
    >>> feedback_words({"feedback": "dock", "battery_percent": 45, "state": "turns"})
    'battery 45 %, state turns'
    >>> feedback_words({"feedback": "drive", "distance_left_m": 1.7976931348623157e308})
    '1.79769e+308 m left'
    """
    fields = [(name, each) for name, each in data.items() if name not in (_FEEDBACK, _MAP)]
    parts = [_field_words(clip(name, _MAX_VALUE), each) for name, each in fields[:_MAX_VALUES]]
    return ", ".join(each for each in parts if each)


def _field_words(name: str, value: RunValue) -> str:
    if isinstance(value, bool) or not isinstance(value, int | float):
        text = value if isinstance(value, str) else _value(value)
        return f"{name.replace('_', ' ')} {clip(' '.join(text.split()), _MAX_VALUE)}"
    amount = f"{value}" if isinstance(value, int) else f"{value:.6g}"
    for suffix, (unit, digits) in _UNITS.items():
        if name.endswith(suffix):
            shown = f"{value:.{digits}f}" if abs(value) < _LARGE else f"{value:.6g}"
            name, amount = name.removesuffix(suffix), f"{shown} {unit}"
            break
    words = name.split("_")
    if words[-1:] == ["left"]:
        rest = [each for each in words[:-1] if each not in _PLAIN]
        return " ".join([amount, *rest, "left"])
    return " ".join([*words, amount])


_EVERY_US = 10_000_000


class Lines:
    """A watcher of a host that writes a line for each event.

    What runners say again and again while they act is written every ten seconds at most.

    >>> from gpsfsm.compile import compile_plan
    >>> from gpsfsm.execution.records import Input, Kind, Record
    >>> from gpsfsm.syntax import parse
    >>> text = '<Plan><Runner interface="a/Go" provider="a/Go" x="1"/></Plan>'
    >>> automaton = compile_plan(parse(text, file="p.xml").plan).automaton
    >>> lines = Lines(Words(automaton, [("a/Go", "a/Go")]), print)
    >>> lines(12_300_000, Input(Kind.SUCCEEDED, 0), [Record(Kind.SUCCEEDED, 1)])
        12.300 s  line 1  Go (x=1) succeeded
    """

    def __init__(
        self, words: Words, write: Callable[[str], object], *, detail: Detail = Detail.RUN
    ) -> None:
        self._words = words
        self._write = write
        self._detail = detail
        self._heard_us: dict[int, int] = {}  # by nodes, when feedback was shown last

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Tell what has happened."""
        for moment in moments(at_us, happened, records):
            record = moment.record
            if record.kind is Kind.STARTED:
                self._heard_us[record.node] = at_us
            if self._words.shown(record, self._detail) or self._is_due(at_us, record):
                self._write(f"{seconds(at_us):>10} s  {self._words.sentence(record)}")

    def _is_due(self, at_us: int, record: Record) -> bool:
        """True for feedback of an instance of which nothing was shown for a while."""
        if not is_feedback(record) or at_us - self._heard_us.get(record.node, at_us) < _EVERY_US:
            return False
        self._heard_us[record.node] = at_us
        return True


_POSE = "RobotPoseRunner"
_OUTCOMES = frozenset((Kind.SUCCEEDED.value, Kind.FAILED.value, Kind.STOPPED.value))


class StepTaker:
    """A watcher of a run that collects its outcomes in order, as rows of a journal tell them.

    So the steps are the same, to the letter, whether a run was watched or is read from a journal.
    """

    def __init__(self, kernel: Kernel, words: Words) -> None:
        self._words = words
        self._maker = RowMaker(kernel)
        self._nodes = len(kernel.automaton.nodes)
        self._steps: list[Step] = []
        self.pose: tuple[float, float] | None = None  # the last one that a runner has told

    def __call__(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Take in what has happened."""
        if any(record.kind.value in _OUTCOMES for record in records):
            self.take(self._maker.make(at_us, happened, records))

    def take(self, rows: Iterable[Row]) -> None:
        """Take in what a journal has kept."""
        from gpsfsm.generation.prompt_builder import Step  # few runs ask a model

        for row in rows:
            if row.record and row.kind in _OUTCOMES and 0 < row.node < self._nodes:
                kind, values = Kind(row.kind), row.values
                if row.interface.rpartition("/")[2] == _POSE:
                    self.pose = _place(values) or self.pose
                record = Record(kind, row.node, data=values or None, message=row.message)
                action = f"{self._words.line(row.node)}  {self._words.node(row.node)}"
                outcome = self._words.verb(record)
                self._steps.append(Step(action, outcome, failed=kind is Kind.FAILED))

    @property
    def steps(self) -> tuple[Step, ...]:
        """The outcomes so far."""
        return tuple(self._steps)


def _place(values: Mapping[str, object]) -> tuple[float, float] | None:
    x, y = values.get("x"), values.get("y")
    if isinstance(x, int | float) and isinstance(y, int | float):
        return float(x), float(y)
    return None
