"""The table of the options of a check: name, type, bounds, unit, default, help, where each applies.

The options of commands, the keys of a configuration file, the fields of requests over HTTP and the
keywords of the functions in Python are made of it, or a test compares them with it.
"""

from __future__ import annotations

from enum import Enum, auto
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.options import (
    DEFAULT_MAX_SCENARIOS,
    DEFAULT_RLIMIT,
    DEFAULT_TOTAL_RLIMIT,
    MAX_RLIMIT,
    MAX_TOLERATED,
    MAX_TOTAL_RLIMIT,
)
from gpsfsm.errors import UsageError
from gpsfsm.late import dataclass
from gpsfsm.model.story import ENGINES, PAPER_ENGINE

if TYPE_CHECKING:
    from collections.abc import Mapping


class Kind(Enum):
    """The type of an option's value. ``CODES`` are texts in which commas separate items."""

    FLAG = auto()
    TEXT = auto()
    CHOICE = auto()
    COUNT = auto()
    AMOUNT = auto()
    TEXTS = auto()
    CODES = auto()
    FILE = auto()
    FOLDERS = auto()

    @property
    def is_list(self) -> bool:
        """True if there may be several values."""
        return self in (Kind.TEXTS, Kind.CODES, Kind.FOLDERS)


class Group(Enum):
    """The set of options in whose company a command declares one; its heading in help."""

    SELECTION = "Which findings count"
    OUTPUT = "Output"
    SCENARIO = "Scenarios"
    CAPABILITY = "Robot and capabilities"
    EFFORT = "Effort"
    ENGINE = "Engine"
    LIMIT = "Limits on the input"


@dataclass(frozen=True, slots=True)
class Service:
    """The option in a request: what the document of the service says of it, and tighter bounds.

    ``undefined``: null stands for the default, which the endpoint decides.
    """

    description: str = ""
    most: int | None = None
    undefined: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """An option of ``gpsfsm check`` that a configuration file may set.

    ``name`` is that of the command line, with ``_`` for ``-``; ``keyword`` that in Python and over
    HTTP, which names the unit ("": neither has the option). ``least`` and ``most`` belong to the
    range, ``above`` does not. A ``default`` of None: ``effective`` is what holds then. ``service``
    is None for what the operator of a service decides. ``common``: most people need it, so
    ``--help`` shows it.
    """

    name: str
    kind: Kind
    group: Group
    help: str
    default: Any = None
    effective: Any = None
    metavar: str | None = None
    choices: tuple[str, ...] = ()
    least: int | None = None
    most: int | None = None
    above: float | None = None
    keyword: str = ""
    service: Service | None = None
    common: bool = False

    @property
    def flag(self) -> str:
        """The option as one writes it."""
        return f"--{self.name.replace('_', '-')}"

    @property
    def initial(self) -> Any:
        """The default, in Python."""
        if self.kind.is_list:
            return ()
        return self.effective if self.default is None else self.default


def _limit(name: str, default: int, text: str) -> Option:
    """A limit on what is read; its default is that of ``gpsfsm.syntax.Limits``, as a test says."""
    return Option(
        name=name,
        kind=Kind.COUNT,
        group=Group.LIMIT,
        help=f"{text} [default: {default}]",
        effective=default,
        metavar="N",
        least=1,
    )


OPTIONS: tuple[Option, ...] = (
    Option(
        name="format",
        common=True,
        kind=Kind.TEXT,
        group=Group.OUTPUT,
        help="Output format: {formats}. [default: text]",
        default="text",
        metavar="NAME",
    ),
    Option(
        name="select",
        common=True,
        kind=Kind.CODES,
        group=Group.SELECTION,
        help="Show only these rules: GP303, join-deadlock, GP3, ALL.",
        metavar="CODES",
        keyword="select",
        service=Service("Show only these rules."),
    ),
    Option(
        name="ignore",
        common=True,
        kind=Kind.CODES,
        group=Group.SELECTION,
        help="Hide these rules; same forms as --select.",
        metavar="CODES",
        keyword="ignore",
        service=Service("Hide these rules; same forms as --select."),
    ),
    Option(
        name="fail_on",
        common=True,
        kind=Kind.CHOICE,
        group=Group.SELECTION,
        help="Lowest severity that makes the exit code 1.",
        default="error",
        choices=("error", "warning", "never"),
    ),
    Option(
        name="allow_suppressions",
        kind=Kind.FLAG,
        group=Group.SELECTION,
        help="Let comments in a plan suppress its findings, also for the exit code.",
        default=False,
    ),
    Option(
        name="quiet",
        kind=Kind.FLAG,
        group=Group.OUTPUT,
        help="Show findings only, one line each.",
        default=False,
    ),
    Option(
        name="verbose",
        common=True,
        kind=Kind.FLAG,
        group=Group.OUTPUT,
        help="Show every scenario and related location.",
        default=False,
    ),
    Option(
        name="statistics",
        kind=Kind.FLAG,
        group=Group.OUTPUT,
        help="Count the findings per rule.",
        default=False,
    ),
    Option(
        name="jobs",
        kind=Kind.COUNT,
        group=Group.OUTPUT,
        help="{verb} in N processes, 0: one per core; or on a Ray cluster: ray, or "
        "ray://HOST:PORT. [default: 1]",
        default=1,
        metavar="N|ray",
        least=0,
        most=256,
    ),
    Option(
        name="assume",
        common=True,
        kind=Kind.TEXTS,
        group=Group.SCENARIO,
        help="Assume this, such as 'never fails: SpeechRunner'.",
        metavar="TEXT",
        keyword="assume",
        service=Service("Consider only runs where this holds."),
    ),
    Option(
        name="consistent",
        kind=Kind.FLAG,
        group=Group.SCENARIO,
        help="Assume that equal actions have equal outcomes.",
        default=False,
        keyword="consistent",
        service=Service("Equal actions have equal outcomes."),
    ),
    Option(
        name="faults",
        kind=Kind.CODES,
        group=Group.SCENARIO,
        help="Faults to consider: failed, no-start, hang. [default: failed]",
        metavar="LIST",
        choices=("failed", "no-start", "hang"),
        keyword="faults",
        service=Service(most=3),
    ),
    Option(
        name="solver",
        kind=Kind.CHOICE,
        group=Group.EFFORT,
        help="How to decide.",
        default="auto",
        choices=("auto", "z3", "structural"),
        keyword="solver",
        service=Service(),
    ),
    Option(
        name="rlimit",
        kind=Kind.COUNT,
        group=Group.EFFORT,
        help="Step limit of z3 per question; beyond it, the answer is 'unknown', exit code 2.",
        effective=DEFAULT_RLIMIT,
        metavar="N",
        least=1,
        most=MAX_RLIMIT,
        keyword="rlimit",
        service=Service(most=DEFAULT_RLIMIT),
    ),
    Option(
        name="total_rlimit",
        kind=Kind.COUNT,
        group=Group.EFFORT,
        help="Step limit of z3 per plan; beyond it, likewise.",
        effective=DEFAULT_TOTAL_RLIMIT,
        metavar="N",
        least=1,
        most=MAX_TOTAL_RLIMIT,
        keyword="total_rlimit",
        service=Service(
            "Steps of z3 for the whole plan; null: the limit of the command.",
            most=DEFAULT_TOTAL_RLIMIT,
            undefined=True,
        ),
    ),
    Option(
        name="max_scenarios",
        kind=Kind.COUNT,
        group=Group.EFFORT,
        help=f"Maximum number of scenarios per rule and plan. [default: {DEFAULT_MAX_SCENARIOS}]",
        effective=DEFAULT_MAX_SCENARIOS,
        metavar="N",
        least=0,
        keyword="max_scenarios",
        service=Service(most=DEFAULT_MAX_SCENARIOS),
    ),
    Option(
        name="require_proof",
        kind=Kind.FLAG,
        group=Group.EFFORT,
        help="Require z3 to prove all that the plan never does; else undecided, exit code 2.",
        default=False,
        keyword="require_proof",
        service=Service("Undecided unless z3 has proved everything that the plan never does."),
    ),
    Option(
        name="from_response",
        kind=Kind.FLAG,
        group=Group.SCENARIO,
        help="The text is a model's raw answer: take its last plan.",
        default=False,
        keyword="from_response",
        service=Service("The text is a raw answer of a model."),
    ),
    Option(
        name="capabilities",
        common=True,
        kind=Kind.FOLDERS,
        group=Group.CAPABILITY,
        help="Folder of capability files; may be repeated.",
        metavar="DIR",
        keyword="capabilities",
    ),
    Option(
        name="builtin_capabilities",
        kind=Kind.FLAG,
        group=Group.CAPABILITY,
        help="Use the built-in capability library. [default: yes]",
        default=True,
        keyword="builtin_capabilities",
    ),
    Option(
        name="robot",
        common=True,
        kind=Kind.FILE,
        group=Group.CAPABILITY,
        help="Robot profile: runners, bounds and permissions.",
        metavar="FILE",
        keyword="robot",
    ),
    Option(
        name="deadline",
        kind=Kind.AMOUNT,
        group=Group.CAPABILITY,
        help="Maximum duration of a run, as far as it is declared.",
        metavar="SECONDS",
        above=0,
        keyword="deadline_s",
        service=Service(),
    ),
    Option(
        name="energy_limit",
        kind=Kind.AMOUNT,
        group=Group.CAPABILITY,
        help="Maximum energy of a run, as far as it is declared.",
        metavar="JOULES",
        above=0,
        keyword="energy_limit_j",
        service=Service(),
    ),
    Option(
        name="tolerate",
        kind=Kind.COUNT,
        group=Group.CAPABILITY,
        help="Warn if N failures or fewer can end the plan. [default: 0]",
        effective=0,
        metavar="N",
        least=0,
        most=MAX_TOLERATED,
        keyword="tolerate",
        service=Service(
            "This many failures must not end the plan; 0: any failure may.", most=MAX_TOLERATED
        ),
    ),
    Option(
        name="engine",
        common=True,
        kind=Kind.CHOICE,
        group=Group.ENGINE,
        help="Semantics to use: the paper's, or those of an original engine.",
        default=PAPER_ENGINE,
        choices=tuple(ENGINES),
        keyword="engine",
        service=Service("The engine that is to run the plan."),
    ),
    Option(
        name="baseline",
        kind=Kind.FILE,
        group=Group.OUTPUT,
        help="Ignore the findings of this earlier JSON report.",
        metavar="FILE",
    ),
    _limit("max_bytes", 64 * 1024 * 1024, "Maximum size of a plan's text in bytes."),
    _limit("max_depth", 200, "Maximum nesting depth."),
    _limit("max_elements", 250_000, "Maximum number of elements in a plan."),
    _limit("max_attributes", 200, "Maximum number of attributes of an element."),
    _limit("max_attribute_length", 65_536, "Maximum length of an attribute in characters."),
    Option(
        name="color",
        kind=Kind.CHOICE,
        group=Group.OUTPUT,
        help="Use colours; auto: only on a terminal.",
        default="auto",
        choices=("auto", "always", "never"),
    ),
)
"""In the order in which messages list the keys of a configuration file."""

BY_NAME: Mapping[str, Option] = {option.name: option for option in OPTIONS}
BY_KEYWORD: Mapping[str, Option] = {option.keyword: option for option in OPTIONS if option.keyword}


def group(kind: Group) -> tuple[Option, ...]:
    """The options of a group, in the order of the table."""
    return tuple(option for option in OPTIONS if option.group is kind)


# --- what has no effect --------------------------------------------------------------------------

NO_EFFECT: Mapping[str, Mapping[str, str]] = {
    "fix": {
        "tolerate": "no fix takes a failure away, since what else to try is not known; "
        "'gpsfsm check --tolerate' decides about failures",
        "require_proof": "the verdict is not what a fix is about; 'gpsfsm check' requires proofs",
        "max_scenarios": "no scenario is shown; leave it out, 'gpsfsm check' shows them",
    },
    "grade": {
        "deadline": "a task sets no deadline; 'gpsfsm check --deadline' decides about it",
        "energy_limit": "a task sets no bound on energy; 'gpsfsm check --energy-limit' decides "
        "about it",
        "tolerate": "a task says itself what has to be tried; 'gpsfsm check --tolerate' decides "
        "about failures",
        "max_scenarios": "a grade has at most one scenario; leave the option out",
        "require_proof": "a grade is compared with z3 in any case; leave it out",
        "total_rlimit": "the steps of a grade are bounded for each question; use --rlimit",
        "from_response": "an answer is always taken as it is, with the last plan in it; leave the "
        "option out",
        "select": "a grade depends on the task, not on which findings are shown; leave it out",
        "ignore": "a grade depends on the task, not on which findings are shown; leave it out",
        "engine": "a task is decided by the semantics of the paper; leave it out, and let "
        "'gpsfsm check --engine' tell what the engine does otherwise",
    },
}
"""By command: the options that it cannot honour, and what to do instead."""


_OF_MACHINES = {
    "task": "tasks are decided for plans",
    "deadline": "the durations of its runs are not decided",
    "energy_limit": "the energy of its runs is not decided",
    "solver": "its configurations are explored, and z3 proves that none is missing",
}
_OF_TREES = {
    "engine": "original engines run plans",
    "faults": "a leaf that does not start is one that fails",
}
_UNNESTED = dict.fromkeys(("max_depth", "max_attributes", "max_attribute_length"), "it has no tags")
_ALL_OF_MACHINES = _OF_MACHINES | {
    "engine": "original engines run plans",
    "faults": "a runner that does not start is not decided",
}

IDLE_ON: Mapping[str, Mapping[str, str]] = {
    "behaviour tree": _OF_TREES,
    "behaviour tree that is no plan": _OF_TREES | _OF_MACHINES,
    "machine in XML": _ALL_OF_MACHINES,
    "machine in JSON": _ALL_OF_MACHINES | _UNNESTED,
    "machine in GraphML": _ALL_OF_MACHINES,
    "machine in Python": _ALL_OF_MACHINES
    | _UNNESTED
    | {"max_elements": "it has no tags and no list of nodes"},
    "graph": _ALL_OF_MACHINES
    | _UNNESTED
    | dict.fromkeys(("max_bytes", "max_elements", "from_response"), "it is no text"),
}
"""By kind of input: the options that have no effect on it, and why; of faults, no-start alone."""

HARMLESS = frozenset({"solver", *(option.name for option in group(Group.LIMIT))})
"""Options that ask nothing of an input: in a configuration file, they are for others beside it."""


def refuse_idle(command: str, values: Mapping[str, Any]) -> None:
    """Raise UsageError for an option, by keyword, that this command cannot honour.

    A value that is the default was not asked for: nothing depends on it.
    """
    for option in OPTIONS:
        why = NO_EFFECT[command].get(option.name)
        if why is None or option.keyword not in values:
            continue
        value = values[option.keyword]
        if value is not None and value != option.initial and tuple_of(value) != ():
            raise UsageError(f"{option.keyword} has no effect on {command}: {why}")


def tuple_of(value: Any) -> Any:
    """A list as a tuple, anything else as it is."""
    return tuple(value) if isinstance(value, list) else value
