"""``gpsfsm.gate``: one call that says whether a plan may run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.options import DEFAULT_RLIMIT, SolverChoice
from gpsfsm.analysis.rules import rule, select_rules
from gpsfsm.api import CheckSettings, is_graph
from gpsfsm.checking.idle_options import GRAPH
from gpsfsm.checking.inputs import Input, read_bytes
from gpsfsm.errors import InputError, UsageError, misused
from gpsfsm.gating.deciding import GateOptions, Verdict, gate_text, unread
from gpsfsm.gating.gate_process import DEFAULT_BUDGET_MS, Gate
from gpsfsm.model.capability import Permission
from gpsfsm.model.finding import Severity
from gpsfsm.model.story import PAPER_ENGINE

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    import networkx as nx

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.syntax import Limits
    from gpsfsm.tasks.task import Task

IDLE_IGNORE = (
    "ignore has no effect on a gate that lets warnings pass: no finding of {codes} refuses a plan; "
    'leave it out, or use fail_on="warning"'
)
DEFAULT_TOTAL_RLIMIT = 50_000_000
"""z3 steps per plan: some seconds on an ordinary machine, so that they run out before the time."""


def gate(
    plan: str | bytes | Path | nx.Graph[Any],
    *,
    budget_ms: int | None = DEFAULT_BUDGET_MS,
    fail_on: str = "error",
    allow_suppressions: bool = False,
    allow_empty: bool = False,
    allow_trees: bool = False,
    allow_approximated: bool = False,
    task: str | Path | Task | None = None,
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
    robot: str | Path | None = None,
    allow: Mapping[str, Sequence[str]] | None = None,
    deadline_s: float | None = None,
    energy_limit_j: float | None = None,
    tolerate: int = 0,
) -> Verdict:
    """Decide whether a plan may run. The verdict is true if it may.

    ``plan`` is a text, a ``pathlib.Path`` (a ``str`` is never a path), or a machine as a networkx
    graph. A child process decides, and is killed after ``budget_ms`` milliseconds; with None, this
    one decides, without a time limit. ``allow`` lists what plans may reach, under ``program``,
    ``host`` and ``function``. For many plans, use ``Gate``. Raises UsageError for invalid options.

    >>> verdict = gate('<Plan><Runner interface="a/Go"/></Plan>', budget_ms=None)
    >>> bool(verdict), str(verdict), verdict.findings[0].rule
    (False, 'rejected: findings', 'GP107')
    """
    flags = {"allow_suppressions": allow_suppressions, "allow_empty": allow_empty}
    flags |= {"allow_approximated": allow_approximated, "allow_trees": allow_trees}
    for name, value in flags.items():
        if not isinstance(value, bool):
            raise misused("gate", f"True or False as {name}", value)
    check = CheckSettings.of(locals()).options()
    if is_idle(ignore, fail_on):
        raise UsageError(IDLE_IGNORE.format(codes=", ".join(ignore)[:100]))
    described = permitting(check.described, _permissions(allow))
    check = replace(check, task=_task(task), capabilities=described)
    return _gate(plan, GateOptions(check, _severity(fail_on), **flags), budget_ms)


def _gate(
    plan: str | bytes | Path | nx.Graph[Any], options: GateOptions, budget_ms: int | None
) -> Verdict:
    if budget_ms is not None:
        with Gate(options, budget_ms=budget_ms) as decide:
            return decide(plan)
    try:
        return gate_text(*text_of(plan, "", options), options)
    except InputError as error:
        return unread(options, str(error), str(plan))


def options_with(
    options: GateOptions | None,
    *,
    task: str | Path | Task | None,
    robot: str | Path | None,
    allow_trees: bool,
) -> GateOptions:
    """The options of a gate with these added. Raises UsageError for what is there already."""
    options = options or GateOptions()
    check = options.check
    if not isinstance(allow_trees, bool):
        raise misused("Gate", "True or False as allow_trees", allow_trees)
    for name, added, there in (
        ("task", task, check.task),
        ("robot", robot, check.capabilities),
    ):
        if added is not None and there is not None:
            raise UsageError(f"Gate takes a {name} once: as an argument, or in its options")
    if task is not None:
        check = replace(check, task=_task(task))
    if robot is not None:
        analysis = check.analysis
        settled = {"tolerate": analysis.tolerate, "deadline_s": analysis.deadline_s}
        chosen = CheckSettings.of({**settled, "robot": robot, "engine": check.engine})
        analysis = replace(analysis, tolerate=chosen.tolerate, deadline_s=chosen.deadline_s)
        described = chosen.options().capabilities
        check = replace(check, analysis=analysis, engine=chosen.engine, capabilities=described)
    return replace(options, check=check, allow_trees=allow_trees or options.allow_trees)


def text_of(
    plan: str | bytes | Path | nx.Graph[Any], name: str, options: GateOptions
) -> tuple[str | bytes, str]:
    """The text and the name of a plan. Raises InputError; UsageError for what is none."""
    if isinstance(plan, Path):
        return read_bytes(Input(str(plan)), options.check.limits.max_bytes), name or str(plan)
    if is_graph(plan):
        from gpsfsm.compile.machine_files import graph_to_json

        return graph_to_json(plan), name or GRAPH
    if not isinstance(plan, str | bytes):
        raise misused("gate", "the text of a plan or a pathlib.Path or a networkx graph", plan)
    return plan, name or "<text>"


def is_idle(ignore: Sequence[str], fail_on: str) -> bool:
    """True if ignoring these rules changes nothing: none of their findings would refuse a plan.

    Errors count in a gate even where an option does not show them, and findings below ``fail_on``
    never do; so it is the warnings under ``fail_on="warning"`` that can be ignored.
    """
    if not ignore or fail_on == Severity.WARNING.value:
        return False
    chosen = [rule(code) for code in select_rules(tuple(ignore))]
    return not any(each.severity is Severity.ERROR or each.severities for each in chosen)


def _permissions(allow: Mapping[str, Sequence[str]] | None) -> list[tuple[str, str]]:
    names = [each.value for each in Permission]
    pairs: list[tuple[str, str]] = []
    for name, texts in (allow or {}).items():
        if name not in names or isinstance(texts, str):
            raise misused("gate", f"lists of texts by {', '.join(names)} as allow", allow)
        pairs += [(name, text) for text in texts]
    return pairs


def permitting(described: Capabilities, allowed: Iterable[tuple[str, str]]) -> Capabilities:
    """The capabilities for a gate: nothing else may be reached than these and what a profile has.

    >>> from gpsfsm.capabilities.library import builtin_capabilities
    >>> permitting(builtin_capabilities(), [("program", "echo")]).allow
    ((<Permission.PROGRAM: 'program'>, 'echo'),)
    """
    added = ((Permission(name), text) for name, text in allowed)
    return replace(described, allow=tuple(dict.fromkeys((*(described.allow or ()), *added))))


def _task(task: str | Path | Task | None) -> Task | None:
    """The task, or that in a file. Raises ConfigError."""
    from gpsfsm.tasks.task import Task

    if task is None or isinstance(task, Task):
        return task
    if not isinstance(task, str | Path):
        raise misused("gate", "the path of a task file as task", task)
    from gpsfsm.tasks.load import load_task

    return load_task(task)


def _severity(fail_on: str) -> Severity:
    if fail_on not in (Severity.ERROR.value, Severity.WARNING.value):
        raise UsageError(f"fail_on must be error or warning, not {str(fail_on)[:40]}")
    return Severity(fail_on)
