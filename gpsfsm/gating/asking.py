"""``gpsfsm.gate``: one call that says whether a plan may run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.analysis.options import DEFAULT_RLIMIT, AnalysisOptions, SolverChoice
from gpsfsm.api import check_options
from gpsfsm.capabilities.choice import choose_capabilities
from gpsfsm.errors import InputError, UsageError
from gpsfsm.gating.apart import DEFAULT_BUDGET_MS, Gate
from gpsfsm.gating.deciding import gate_text, unread
from gpsfsm.gating.verdicts import GateOptions, Verdict
from gpsfsm.inputs import Input, read_bytes
from gpsfsm.model.engine import PAPER_ENGINE
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.syntax import Limits
    from gpsfsm.tasks.task import Task

__all__ = ["DEFAULT_TOTAL_RLIMIT", "gate"]

DEFAULT_TOTAL_RLIMIT = 50_000_000
"""z3 steps per plan: some seconds on an ordinary machine, so that they run out before the time."""


def gate(
    text_or_path: str | bytes | Path,
    *,
    budget_ms: int | None = DEFAULT_BUDGET_MS,
    fail_on: str = "error",
    allow_suppressions: bool = False,
    allow_empty: bool = False,
    allow_trees: bool = False,
    task: str | Path | None = None,
    engine: str = PAPER_ENGINE,
    assume: Sequence[str] = (),
    consistent: bool = False,
    faults: Sequence[str] = (),
    ignore: Sequence[str] = (),
    from_response: bool = False,
    solver: SolverChoice = "auto",
    rlimit: int = DEFAULT_RLIMIT,
    total_rlimit: int = DEFAULT_TOTAL_RLIMIT,
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    deadline_s: float | None = None,
    energy_limit_j: float | None = None,
) -> Verdict:
    """Decide whether a plan may run: its text, or the path of a file. The verdict is a truth value.

    A ``str`` that is empty or holds a ``<`` or a line break is a plan's text, any other is a path.
    A process decides, which is killed after ``budget_ms`` milliseconds; None: this process decides,
    without a clock. Who has many plans uses ``gpsfsm.gating.Gate``, which keeps the process. The
    options are those of ``gpsfsm gate``; those that make no sense raise UsageError.

    >>> verdict = gate('<Plan><Runner interface="a/Go"/></Plan>', budget_ms=None)
    >>> bool(verdict), str(verdict), verdict.findings[0].rule
    (False, 'refused: findings', 'GP107')
    """
    _refuse_text(assume=assume, faults=faults, ignore=ignore, capabilities=capabilities)
    analysis = AnalysisOptions(tuple(faults), consistent, tuple(assume), solver, rlimit)
    analysis = replace(analysis, deadline_s=deadline_s, energy_limit_j=energy_limit_j)
    check = check_options(
        replace(analysis, total_rlimit=total_rlimit),
        ignore=ignore,
        from_response=from_response,
        limits=limits,
        capabilities=choose_capabilities(capabilities, builtin=builtin_capabilities),
        engine=engine,
    )
    check = replace(check, task=_task(task), trees=allow_trees)
    options = GateOptions(check, _severity(fail_on), allow_suppressions, allow_empty)
    return _gate(text_or_path, options, budget_ms)


def _refuse_text(**lists: Sequence[str | Path]) -> None:
    """A text where a list of texts belongs would be taken letter by letter."""
    for name, value in lists.items():
        if isinstance(value, str | Path):
            raise UsageError(f"{name} takes a list of texts, such as {name}=[{str(value)!r}]")


def _task(file: str | Path | None) -> Task | None:
    """The task in a file. Raises ConfigError."""
    if file is None:
        return None
    from gpsfsm.tasks.load import load_task  # noqa: PLC0415  (pydantic and a YAML parser)

    return load_task(file)


def _severity(fail_on: str) -> Severity:
    if fail_on not in (Severity.ERROR.value, Severity.WARNING.value):
        raise UsageError(f"fail_on must be error or warning, not {str(fail_on)[:40]}")
    return Severity(fail_on)


def _gate(text_or_path: str | bytes | Path, options: GateOptions, budget_ms: int | None) -> Verdict:
    name, text = "<text>", text_or_path
    if isinstance(text, Path) or (isinstance(text, str) and not _is_text(text)):
        name = str(text)
        try:
            text = read_bytes(Input(name), options.check.limits.max_bytes)
        except InputError as error:
            return unread(options, str(error), name)
    if not isinstance(text, str | bytes):
        raise UsageError(f"a plan is text or the path of a file, not {type(text).__name__}")
    if budget_ms is None:
        return gate_text(text, name, options)
    with Gate(options, budget_ms=budget_ms) as decide:
        return decide(text, name)


def _is_text(text: str) -> bool:
    return not text or "<" in text or "\n" in text
