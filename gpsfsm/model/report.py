"""The result of a check: one report, one entry per plan (the JSON contract, version 2)."""

from __future__ import annotations

from dataclasses import field
from enum import StrEnum
from typing import TYPE_CHECKING, Any, Literal

from gpsfsm.late import dataclass
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.showing import as_data, shown

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.model.event import Event
    from gpsfsm.model.plan import Location
    from gpsfsm.model.precision import Approximation


class Verdict(StrEnum):
    """The verdict on a plan. ``rejected``: it has an error; ``undecided``: there is no answer."""

    ACCEPTED = "accepted"
    REJECTED = "rejected"
    UNDECIDED = "undecided"


class Frequency(StrEnum):
    """In which runs something happens. UNKNOWN only where a limit was hit."""

    ALWAYS = "always"
    SOMETIMES = "sometimes"
    NEVER = "never"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Dangling:
    """An event that leads to no runner instance and not to completion."""

    runner: str
    event: Event
    effect: Literal["give_up", "stuck", "dont_care"]


@dataclass(frozen=True, slots=True)
class JoinDeadlock:
    """A parallel_all whose join never fires in some run that triggered its units."""

    control: str
    effect: Literal["escalated", "absorbed", "give_up", "stuck", "endless"]


@dataclass(frozen=True, slots=True)
class Interval:
    """The infimum and the supremum of an amount over all runs; ``max`` None: unbounded."""

    min: float
    max: float | None


@dataclass(frozen=True, slots=True)
class Loaded:
    """The number of runners that have to be loaded, one per interface and provider.

    ``peak``: at most so many are needed at one instant; None where the plan has too many different
    ones beside each other to find out. ``all``: so many does the plan name.
    """

    peak: int | None
    all: int


@dataclass(frozen=True, slots=True)
class EngineFacts:
    """The facts that only an engine without give-up has; ``name`` is that of its profile.

    ``hangs``: the plan stays running for ever. ``aborts``: the engine dies before it completes.
    """

    name: str
    hangs: Frequency
    aborts: Frequency


@dataclass(frozen=True, slots=True)
class LoopFact:
    """A loop that some run never leaves, with its ``runners``; ``trap``: no run leaves it."""

    runners: tuple[str, ...]
    trap: bool


@dataclass(frozen=True, slots=True)
class MachineFacts:
    """The facts that only a machine has (semantics, 9.4).

    ``completes_if_fair``: as ``completes``, if outcomes that can occur at every visit occur.
    """

    endless: Frequency
    completes_if_fair: Frequency
    loops: tuple[LoopFact, ...] = ()


class Precision(StrEnum):
    """The part of a fact about an over-approximated machine that is proved (semantics, 9.6).

    A fact that is not named is proved as it stands. MAY: nobody knows whether it happens in any
    run. CAN: it happens in some run; nobody knows whether in all. AT_LEAST: the number is a lower
    bound.
    """

    MAY = "may"
    CAN = "can"
    AT_LEAST = "at least"


@dataclass(frozen=True, slots=True)
class Facts:
    """The facts about a plan (semantics, sections 5 and 8); lists are in document order.

    ``makespan`` is in seconds, ``energy`` in joules. ``engine`` is None for the paper's semantics,
    ``machine`` is None for a plan. A fact that a limit left undecided is UNKNOWN, an empty list or
    None; then the verdict is ``undecided`` and finding GP904 names the fact. Otherwise an empty
    list means that there is nothing of the kind. ``precision``: the facts that are not proved as
    they stand, by name.
    """

    runners: int
    completes: Frequency
    gives_up: Frequency
    stuck: Frequency
    unreachable: tuple[str, ...] = ()
    dangling: tuple[Dangling, ...] = ()
    join_deadlocks: tuple[JoinDeadlock, ...] = ()
    orphans: tuple[str, ...] = ()
    swallowed: tuple[str, ...] = ()  # of plans by the paper's semantics alone
    fewest_failures_to_give_up: int | None = None
    makespan: Interval | None = None  # seconds; None also if nothing is declared
    energy: Interval | None = None  # joules; None also if nothing is declared
    loaded: Loaded | None = None
    engine: EngineFacts | None = None
    machine: MachineFacts | None = None
    precision: Mapping[str, Precision] = field(default_factory=dict)


class By(StrEnum):
    """The procedure on which an answer rests.

    STRUCTURAL: the linear pass, without a proof. Z3: z3 has decided it, or refuted all runs that
    contradict it. REPLAY: runs that show it were replayed, and it rules nothing out. SEARCH: all
    configurations of a machine were looked at.
    """

    STRUCTURAL = "structural"
    Z3 = "z3"
    REPLAY = "replay"
    SEARCH = "search"


@dataclass(frozen=True, slots=True)
class Proof:
    """The procedures on which answers rest; ``unproved``: those that lack a proof, and its limit.

    The limit is the option that set it, or a number of runners.
    """

    decided_by: Mapping[str, By] = field(default_factory=dict)
    unproved: Mapping[str, str] = field(default_factory=dict)

    @property
    def limits(self) -> tuple[str, ...]:
        """The limits that kept something from being proved, as one says them."""
        limits = dict.fromkeys(self.unproved.values())
        return tuple(each if each.startswith("--solver") else f"over {each}" for each in limits)


@dataclass(frozen=True, slots=True)
class PlanReport:
    """The report on the check of one plan.

    - ``findings``: those that are shown.
    - ``suppressed``: those that a comment, an option or a baseline suppressed, as their
      ``suppressed_by`` states.
    - ``source``: the text of the plan; None if it cannot be read.
    - ``notes``: what was done to the text before parsing, such as removing prose from a model's
      answer.
    - ``proof``: the procedures that the facts rest on; None without facts.
    - ``machine``: the text was parsed as a machine.
    - ``included``: the texts of included files, by name.
    - ``approximations``: the constructs that were not read exactly, in document order.
    """

    path: str
    verdict: Verdict
    facts: Facts | None
    findings: tuple[Finding, ...]
    suppressed: tuple[Finding, ...] = ()
    source: str | None = None
    notes: tuple[str, ...] = ()
    proof: Proof | None = None
    machine: bool = False
    included: Mapping[str, str] = field(default_factory=dict)
    approximations: tuple[Approximation, ...] = ()

    def file_of(self, location: Location) -> str:
        """The path of the file that contains a place."""
        return location.file or self.path

    def text_of(self, location: Location) -> str:
        """The text that contains a place; "" if it cannot be read."""
        return self.included.get(location.file, "") if location.file else self.source or ""

    @property
    def excused(self) -> list[Finding]:
        """The findings that are suppressed only by comments in the plan."""
        return [finding for finding in self.suppressed if finding.suppressed_by == "comment"]

    def to_dict(self) -> dict[str, Any]:
        """The entry of the plan in the JSON of ``gpsfsm check --format json``."""
        data: dict[str, Any] = as_data("plan_report_data", self)
        return data

    def _repr_html_(self) -> str | None:
        """Verdict, findings and picture, for notebooks."""
        return shown("plan_report_html", self)

    def _repr_pretty_(self, printer: Any, _cycle: bool) -> None:
        """The same as text, where nothing draws: IPython on a terminal."""
        printer.text(str(self))

    def __str__(self) -> str:
        """The same for ``print``."""
        return shown("plan_report_text", self) or repr(self)


class Effect(StrEnum):
    """The effect of a setting on a report.

    HIDES: findings are not shown. NARROWS: plans are decided for less than everything. EXCUSES:
    findings do not count for the exit code.
    """

    HIDES = "hides"
    NARROWS = "narrows"
    EXCUSES = "excuses"


@dataclass(frozen=True, slots=True)
class SettingUsed:
    """A setting without which a report would say more, or an exit code would be another.

    ``setting`` is written as it stands there, ``file`` is where, "" for the command line.
    ``findings`` and, of level error, ``errors`` are how many it hides or excuses.
    """

    setting: str
    effect: Effect
    file: str = ""
    findings: int = 0
    errors: int = 0


@dataclass(frozen=True, slots=True)
class Report:
    """The reports on all checked plans, in the order in which the plans were given.

    ``settings`` lists the settings that hide findings, narrow the check or excuse findings.
    """

    plans: tuple[PlanReport, ...] = field(default=())
    settings: tuple[SettingUsed, ...] = ()

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings of all plans, one plan after the other."""
        return tuple(finding for plan in self.plans for finding in plan.findings)

    def to_dict(self) -> dict[str, Any]:
        """The output of ``gpsfsm check --format json`` (docs/json.md)."""
        data: dict[str, Any] = as_data("report_data", self)
        return data

    def to_frame(self) -> Any:
        """The findings as a pandas DataFrame, one row each. Raises UsageError without pandas."""
        return as_data("report_frame", self)

    def _repr_html_(self) -> str | None:
        """All plans with their findings, for notebooks."""
        return shown("report_html", self)

    def _repr_pretty_(self, printer: Any, _cycle: bool) -> None:
        """The same as text, where nothing draws: IPython on a terminal."""
        printer.text(str(self))

    def __str__(self) -> str:
        """The same for ``print``."""
        return shown("report_text", self) or repr(self)

    @property
    def ok(self) -> bool:
        """True if every plan was checked and accepted, and there was at least one."""
        return bool(self.plans) and all(plan.verdict is Verdict.ACCEPTED for plan in self.plans)

    def exit_code(
        self, fail_on: Severity | None = Severity.ERROR, *, allow_suppressions: bool = False
    ) -> int:
        """0: nothing at or above ``fail_on``; 1: findings; 2: could not check.

        ``fail_on=None`` means that findings never fail; a check that could not be done always does.
        What a comment in a plan suppresses fails as well, unless ``allow_suppressions``: the author
        of a plan is no judge of it.
        """
        if not self.plans or any(plan.verdict is Verdict.UNDECIDED for plan in self.plans):
            return 2
        if fail_on is None:
            return 0
        counting = list(self.findings)
        if not allow_suppressions:
            counting += self.excused
        return int(any(finding.severity.rank >= fail_on.rank for finding in counting))

    @property
    def excused(self) -> list[Finding]:
        """The findings that are suppressed only by comments in the plans."""
        return [finding for plan in self.plans for finding in plan.excused]
