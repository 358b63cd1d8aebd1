"""The Python interface: as good as the command line."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, replace
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeGuard

from gpsfsm.analysis.constraints import FAULTS
from gpsfsm.analysis.options import (
    DEFAULT_MAX_SCENARIOS,
    DEFAULT_RLIMIT,
    DEFAULT_TOTAL_RLIMIT,
    MAX_RLIMIT,
    MAX_TOLERATED,
    MAX_TOTAL_RLIMIT,
    AnalysisOptions,
    SolverChoice,
    check_assumptions,
)
from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.checking import CheckOptions, check_graph, check_input, check_text
from gpsfsm.checking.check import options_for
from gpsfsm.checking.inputs import find_inputs, is_text
from gpsfsm.checking.option_table import BY_KEYWORD, BY_NAME, Group, Kind, group
from gpsfsm.checking.selection import Selection
from gpsfsm.errors import UsageError, misused
from gpsfsm.late import dataclass
from gpsfsm.model.report import PlanReport, Report
from gpsfsm.model.story import ENGINES, PAPER_ENGINE
from gpsfsm.progress import counted
from gpsfsm.syntax import Limits

if TYPE_CHECKING:
    from collections.abc import Iterator

    import networkx as nx

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.checking.option_table import Option
    from gpsfsm.progress import Progress


def check(
    text_or_path: str | bytes | Path | nx.Graph[Any] | Sequence[str | Path],
    *,
    assume: Sequence[str] = (),
    consistent: bool = False,
    faults: Sequence[str] = (),
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    from_response: bool = False,
    solver: SolverChoice = "auto",
    rlimit: int = DEFAULT_RLIMIT,
    total_rlimit: int = DEFAULT_TOTAL_RLIMIT,
    max_scenarios: int = DEFAULT_MAX_SCENARIOS,
    require_proof: bool = False,
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    robot: str | Path | None = None,
    deadline_s: float | None = None,
    energy_limit_j: float | None = None,
    tolerate: int = 0,
    engine: str = PAPER_ENGINE,
    progress: Progress | None = None,
) -> Report:
    """Check one or more plans and return a report.

    ``text_or_path`` is the text of a plan, the path of a file or folder, a list of paths, or a
    networkx graph, which is checked as a machine (docs/machines.md). Bytes are text. A ``str`` that
    is empty or contains a ``<`` or a line break is the text of a plan, any other is a path; with
    ``from_response`` it is a path only if such a file exists.

    The options are those of ``gpsfsm check``. ``progress=True`` shows a progress bar on a terminal
    or in a notebook; a function is called as ``progress(done, total)`` after each plan.

    Raises UsageError (or its subclass AssumptionError) for invalid options. Problems with a plan,
    or with reading or checking it, do not raise; they are in the report.

    >>> report = check('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>')
    >>> report.plans[0].facts.gives_up.value, report.ok
    ('sometimes', True)
    """
    settings = CheckSettings.of(locals())
    return Report(tuple(_reports(text_or_path, settings.options(), progress)))


@dataclass(frozen=True, kw_only=True)
class CheckSettings:
    """The options of a check as users give them: a field for each keyword of the table."""

    assume: Sequence[str] = ()
    consistent: bool = False
    faults: Sequence[str] = ()
    select: Sequence[str] = ()
    ignore: Sequence[str] = ()
    from_response: bool = False
    solver: SolverChoice = "auto"
    rlimit: int = DEFAULT_RLIMIT
    total_rlimit: int = DEFAULT_TOTAL_RLIMIT
    max_scenarios: int = DEFAULT_MAX_SCENARIOS
    require_proof: bool = False
    limits: Limits | None = None
    capabilities: Sequence[str | Path] = ()
    builtin_capabilities: bool = True
    robot: str | Path | None = None
    deadline_s: float | None = None
    energy_limit_j: float | None = None
    tolerate: int = 0
    engine: str = PAPER_ENGINE

    @classmethod
    def of(cls, arguments: Mapping[str, Any]) -> CheckSettings:
        """The settings among the arguments of a function, which a test compares with the fields."""
        names = {each.name for each in fields(cls)}
        chosen = {name: arguments[name] for name in names & arguments.keys()}
        robot = chosen.get("robot")
        if isinstance(robot, str | Path):  # what its profile sets counts where nothing else is said
            from gpsfsm.capabilities.robot import load_profile

            for name, value in load_profile(robot).settings.items():
                if chosen.get(name) == BY_KEYWORD[name].initial:
                    chosen[name] = value
        return cls(**chosen)

    def options(self, capabilities: Capabilities | None = None) -> CheckOptions:
        """The options as the check takes them. Raises UsageError for what makes no sense.

        ``capabilities`` are those to use, if they are there already.
        """
        for option in BY_KEYWORD.values():
            _refuse_kind(option, getattr(self, option.keyword))
        if not isinstance(self.limits, Limits | None):
            raise misused("limits", "a gpsfsm.Limits", self.limits)
        if capabilities is None:
            capabilities = choose_capabilities(
                self.capabilities, builtin=self.builtin_capabilities, robot=self.robot
            )
        analysis = AnalysisOptions(
            faults=tuple(self.faults),
            consistent=self.consistent,
            assumptions=tuple(self.assume),
            solver=self.solver,
            rlimit=self.rlimit,
            total_rlimit=self.total_rlimit,
            max_scenarios=self.max_scenarios,
            require_proof=self.require_proof,
            deadline_s=self.deadline_s,
            energy_limit_j=self.energy_limit_j,
            tolerate=self.tolerate,
        )
        options = check_options(
            analysis,
            select=self.select,
            ignore=self.ignore,
            from_response=self.from_response,
            limits=self.limits,
            capabilities=capabilities,
            engine=self.engine,
        )
        limits = {each.name: getattr(options.limits, each.name) for each in group(Group.LIMIT)}
        named = {name for name, value in limits.items() if value != BY_NAME[name].effective}
        named |= {"solver"} if self.solver != "auto" else set()
        return replace(options, named=frozenset(named))


def check_options(
    analysis: AnalysisOptions | None = None,
    *,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    from_response: bool = False,
    limits: Limits | None = None,
    capabilities: Capabilities | None = None,
    engine: str = PAPER_ENGINE,
) -> CheckOptions:
    """Validate options; raises UsageError, AssumptionError if an assumption does not parse.

    Without ``capabilities`` the built-in library is used.
    """
    if engine not in ENGINES:
        raise UsageError(f"there is no engine '{engine}'; the engines are {', '.join(ENGINES)}")
    return CheckOptions(
        engine=engine,
        analysis=_valid(analysis or AnalysisOptions()),
        limits=limits or Limits(),
        selection=Selection.of(select, ignore),
        from_response=from_response,
        capabilities=capabilities,
    )


def _valid(analysis: AnalysisOptions) -> AnalysisOptions:
    for fault in analysis.faults:
        if fault not in FAULTS:
            raise UsageError(
                f"there is no fault model '{fault}'; the fault models are {', '.join(FAULTS)}"
            )
    if analysis.solver not in ("auto", "z3", "structural"):
        raise UsageError(
            f"there is no solver '{analysis.solver}'; the solvers are auto, z3 and structural"
        )
    if not 1 <= analysis.rlimit <= MAX_RLIMIT:
        raise UsageError(f"rlimit must be from 1 to {MAX_RLIMIT}, not {analysis.rlimit}")
    if not 1 <= analysis.total_rlimit <= MAX_TOTAL_RLIMIT:
        raise UsageError(
            f"total_rlimit must be from 1 to {MAX_TOTAL_RLIMIT}, not {analysis.total_rlimit}"
        )
    if analysis.max_scenarios < 0:
        raise UsageError(f"max_scenarios must be at least 0, not {analysis.max_scenarios}")
    if not 0 <= analysis.tolerate <= MAX_TOLERATED:
        raise UsageError(f"tolerate must be from 0 to {MAX_TOLERATED}, not {analysis.tolerate}")
    for name, limit in (
        ("deadline", analysis.deadline_s),
        ("energy limit", analysis.energy_limit_j),
    ):
        if limit is not None and not _is_amount(limit):
            raise UsageError(f"the {name} must be a positive number, not {str(limit)[:40]}")
    check_assumptions(analysis.assumptions)
    added = tuple(fault for fault in FAULTS[1:] if fault in analysis.faults)
    return replace(analysis, faults=added)


def _is_amount(limit: object) -> bool:
    """True for a number with which durations or energies can be compared."""
    if isinstance(limit, bool) or not isinstance(limit, int | float):
        return False
    return 0 < limit <= sys.float_info.max


def _refuse_kind(option: Option, value: object) -> None:
    """Raise UsageError for a value of another type than the option has.

    A text where a list of texts belongs would be taken letter by letter.
    """
    name, kind = option.keyword, option.kind
    if kind is Kind.FILE and not isinstance(value, str | Path | None):
        raise misused(name, "the path of a file", value)
    if kind.is_list:
        if isinstance(value, str | Path):
            raise UsageError(f"{name} takes a list of texts, such as {name}=[{str(value)!r}]")
        texts = isinstance(value, Sequence) and all(isinstance(each, str | Path) for each in value)
        wrong = "" if texts and not isinstance(value, bytes) else "a list of texts"
    elif kind is Kind.FLAG:
        wrong = "" if isinstance(value, bool) else "True or False"
    elif kind is Kind.COUNT:
        whole = isinstance(value, Integral) and not isinstance(value, bool)
        wrong = "" if whole else "a whole number"
    else:  # amounts and choices: what is wrong with them is said where they are looked up
        return
    if wrong:
        raise misused(name, wrong, value)


def _reports(
    text_or_path: str | bytes | Path | nx.Graph[Any] | Sequence[str | Path],
    options: CheckOptions,
    progress: Progress | None,
) -> Iterator[PlanReport]:
    """The report of a text, or of each file."""
    if isinstance(text_or_path, bytes) or (
        isinstance(text_or_path, str) and is_text(text_or_path, from_response=options.from_response)
    ):
        one = (check_text(text_or_path, "<text>", options) for _ in range(1))
        yield from counted(one, 1, progress, "checking")
        return
    if is_graph(text_or_path):
        one = (check_graph(text_or_path, options) for _ in range(1))
        yield from counted(one, 1, progress, "checking")
        return
    inputs = list(find_inputs(paths_of(text_or_path, "check", "the text of a plan")))
    options = options_for(inputs, options)
    reports = (check_input(each, options) for each in inputs)
    yield from counted(reports, len(inputs), progress, "checking")


def is_graph(value: object) -> TypeGuard[nx.Graph[Any]]:
    """True for a graph of networkx, which is loaded by whoever has made one."""
    networkx = sys.modules.get("networkx")
    return networkx is not None and isinstance(value, networkx.Graph)


def paths_of(paths: object, function: str, text: str) -> list[str]:
    """The paths among the arguments of a function. Raises UsageError for what is none.

    ``text`` is the kind of text that may be given instead.
    """
    if isinstance(paths, str | Path):
        return [str(paths)]
    if isinstance(paths, Iterable) and not isinstance(paths, Mapping):
        listed = list(paths)
        wrong = [each for each in listed if not isinstance(each, str | Path)]
        if not wrong:
            return [str(each) for each in listed]
        raise misused(function, "paths in a list", wrong[0])
    raise misused(function, f"{text}, a path, or a list of paths", paths)
