"""The Python interface: as good as the command line."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.analysis.constraints import FAULTS
from gpsfsm.analysis.options import (
    DEFAULT_MAX_SCENARIOS,
    DEFAULT_RLIMIT,
    DEFAULT_TOTAL_RLIMIT,
    MAX_RLIMIT,
    MAX_TOTAL_RLIMIT,
    AnalysisOptions,
    SolverChoice,
    check_assumptions,
)
from gpsfsm.capabilities.choice import choose_capabilities
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.errors import UsageError
from gpsfsm.inputs import find_inputs, read_input
from gpsfsm.model.engine import ENGINES, PAPER_ENGINE
from gpsfsm.model.report import PlanReport, Report
from gpsfsm.selection import Selection
from gpsfsm.syntax import Limits

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from gpsfsm.capabilities.library import Capabilities

__all__ = ["check", "check_options"]


def check(
    text_or_path: str | bytes | Path | Sequence[str | Path],
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
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    deadline_s: float | None = None,
    energy_limit_j: float | None = None,
    engine: str = PAPER_ENGINE,
) -> Report:
    """Check a plan: its text, the path of a file or of a folder, or several paths.

    A ``str`` that is empty or holds a ``<`` or a line break is a plan's text, any other is a path;
    with ``from_response`` it is a path only if such a file exists. Bytes are text. The options are
    those of ``gpsfsm check``.

    Raises UsageError (or AssumptionError, a kind of it) for options that make no sense. What is
    wrong with a plan, or with reading or checking it, is in the report.

    >>> report = check('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>')
    >>> report.plans[0].facts.gives_up.value, report.ok
    ('sometimes', True)
    """
    _refuse_text(
        assume=assume, faults=faults, select=select, ignore=ignore, capabilities=capabilities
    )
    analysis = AnalysisOptions(
        faults=tuple(faults), consistent=consistent, assumptions=tuple(assume), solver=solver
    )
    analysis = replace(analysis, deadline_s=deadline_s, energy_limit_j=energy_limit_j)
    options = check_options(
        replace(analysis, rlimit=rlimit, total_rlimit=total_rlimit, max_scenarios=max_scenarios),
        select=select,
        ignore=ignore,
        from_response=from_response,
        limits=limits,
        capabilities=choose_capabilities(capabilities, builtin=builtin_capabilities),
        engine=engine,
    )
    return Report(tuple(_reports(text_or_path, options)))


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
        raise UsageError(f"there is no engine '{engine}'; known are {', '.join(ENGINES)}")
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
            raise UsageError(f"there is no fault model '{fault}'; known are {', '.join(FAULTS)}")
    if analysis.solver not in ("auto", "z3", "structural"):
        raise UsageError(
            f"there is no solver '{analysis.solver}'; known are auto, z3 and structural"
        )
    if not 1 <= analysis.rlimit <= MAX_RLIMIT:
        raise UsageError(f"rlimit must be from 1 to {MAX_RLIMIT}, not {analysis.rlimit}")
    if not 1 <= analysis.total_rlimit <= MAX_TOTAL_RLIMIT:
        raise UsageError(
            f"total_rlimit must be from 1 to {MAX_TOTAL_RLIMIT}, not {analysis.total_rlimit}"
        )
    if analysis.max_scenarios < 0:
        raise UsageError(f"max_scenarios must be at least 0, not {analysis.max_scenarios}")
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
    """Whether it is a number that durations or energies can be compared with."""
    if isinstance(limit, bool) or not isinstance(limit, int | float):
        return False
    return 0 < limit <= sys.float_info.max


def _is_text(text: str, from_response: bool) -> bool:
    """Whether a ``str`` is a text to check, not a path."""
    if not text or "<" in text or "\n" in text:
        return True
    return from_response and text != "-" and not Path(text).exists()


def _refuse_text(**lists: Sequence[str | Path]) -> None:
    """A text where a list of texts belongs would be taken letter by letter."""
    for name, value in lists.items():
        if isinstance(value, str | Path):
            raise UsageError(f"{name} takes a list of texts, such as {name}=[{str(value)!r}]")


def _reports(
    text_or_path: str | bytes | Path | Sequence[str | Path], options: CheckOptions
) -> Iterator[PlanReport]:
    """The report of a text, or of each file."""
    if isinstance(text_or_path, bytes) or (
        isinstance(text_or_path, str) and _is_text(text_or_path, options.from_response)
    ):
        yield check_text(text_or_path, "<text>", options)
        return
    paths = [text_or_path] if isinstance(text_or_path, str | Path) else list(text_or_path)
    for found in find_inputs([str(path) for path in paths]):
        yield read_input(found, options)
