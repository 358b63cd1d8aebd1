"""Plans in Python: ``fix``, ``diff``, ``view`` and ``port`` do what the commands do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.options import DEFAULT_RLIMIT, DEFAULT_TOTAL_RLIMIT, SolverChoice
from gpsfsm.analysis.rules import rule
from gpsfsm.api import CheckSettings, is_graph, paths_of
from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.checking.includes import includes_of, joined_text
from gpsfsm.checking.inputs import Input, find_inputs, is_text, text_of
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.equivalence import compare
from gpsfsm.equivalence.difference_text import comparison_as_data, difference_lines
from gpsfsm.errors import (
    GpsfsmError,
    InputError,
    UsageError,
    misused,
    require_amount,
    require_flag,
    require_list,
)
from gpsfsm.fixing import fix_text
from gpsfsm.grading.rewards import task_of
from gpsfsm.model.finding import Severity
from gpsfsm.model.plan import Plan
from gpsfsm.model.story import PAPER_ENGINE
from gpsfsm.syntax import DEFAULT_LIMITS, Limits, Parsed

if TYPE_CHECKING:
    from pathlib import Path

    import networkx as nx

    from gpsfsm.checking import CheckOptions
    from gpsfsm.equivalence import Difference
    from gpsfsm.fixing import Fixed
    from gpsfsm.grading.rewards import TaskLike
    from gpsfsm.porting import Ported
    from gpsfsm.viewing.plans import Viewed


def fix(
    text_or_path: str | bytes | Path,
    *,
    unsafe: bool = False,
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    assume: Sequence[str] = (),
    consistent: bool = False,
    faults: Sequence[str] = (),
    from_response: bool = False,
    solver: SolverChoice = "auto",
    rlimit: int = DEFAULT_RLIMIT,
    total_rlimit: int = DEFAULT_TOTAL_RLIMIT,
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    deadline_s: float | None = None,
    energy_limit_j: float | None = None,
    engine: str = PAPER_ENGINE,
) -> Fixed:
    """Repair a plan without a language model.

    ``text_or_path`` is the text of a plan or the path of its file. The file is not changed:
    ``text`` of the result is the repaired plan and ``report`` is its check. A fix is kept only if a
    new check shows that its finding is gone and no new one has appeared. ``unsafe`` also applies
    fixes that may change the meaning of the plan. ``select`` and ``ignore`` restrict which findings
    are fixed; the other options are those of ``check``.

    Raises UsageError for invalid options, InputError for a file that cannot be read.

    >>> fixed = fix('<Plan><Runner interface="a/Go" provider=a/Go></Plan>')
    >>> fixed.text, fixed.report.verdict.value
    ('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>', 'accepted')
    """
    require_flag("fix", "unsafe", unsafe)
    options = CheckSettings.of(locals()).options()
    name, text = text_of(text_or_path, "fix", options.limits.max_bytes, from_response=from_response)
    return fix_text(text, options, unsafe=unsafe, path=name)


@dataclass(frozen=True, slots=True)
class Comparison:
    """The result of comparing two plans; it is true if they do the same.

    ``difference`` is None if they do the same. ``str()`` describes the scenario that shows the
    difference.
    """

    first: Plan
    second: Plan
    difference: Difference | None

    @property
    def equal(self) -> bool:
        """True if the plans do the same in every scenario that the options admit."""
        return self.difference is None

    def __bool__(self) -> bool:
        return self.equal

    def __str__(self) -> str:
        if self.difference is None:
            return "the plans do the same"
        return "\n".join(difference_lines(self.first, self.second, self.difference))

    def to_dict(self) -> dict[str, Any]:
        """The data that ``gpsfsm diff --format json`` prints."""
        return comparison_as_data(self.first, self.second, self.difference)


def diff(
    first: str | bytes | Path | Plan | nx.Graph[Any],
    second: str | bytes | Path | Plan | nx.Graph[Any],
    *,
    assume: Sequence[str] = (),
    consistent: bool = False,
    tolerance: float = 0.0,
    from_response: bool = False,
    limits: Limits | None = None,
) -> Comparison:
    """Decide whether two plans do the same; if not, find the first scenario where they differ.

    ``first`` and ``second`` are each a text, the path of a file, a plan from ``parse``, or a
    machine, which may also be a networkx graph (docs/machines.md).

    - ``assume``: consider only scenarios in which these assumptions hold for both plans.
    - ``consistent``: equal actions have equal outcomes.
    - ``tolerance``: numeric parameters that differ by no more than this are equal.

    Raises UsageError for invalid arguments, InputError for a file that cannot be read, and
    GpsfsmError for a text with errors or if the limits are reached before there is an answer.

    >>> go = '<Runner interface="a/Go" provider="a/Go"/>'
    >>> in_a_row = f'<Control type="sequential">{go}{go}</Control>'
    >>> bool(diff(f"<Plan>{go}{go}</Plan>", f"<Plan>{in_a_row}</Plan>"))
    True
    """
    require_flag("diff", "consistent", consistent)
    require_flag("diff", "from_response", from_response)
    require_list("diff", "assume", assume)
    require_amount("diff", "tolerance", tolerance)
    one, _ = plan_of(first, "diff", limits, from_response=from_response)
    other, _ = plan_of(second, "diff", limits, from_response=from_response)
    difference = compare(
        one,
        other,
        consistent=consistent,
        assumptions=assume,
        tolerance=float(tolerance),
        second_opinion=True,
    )
    return Comparison(one, other, difference)


def plan_of(
    value: object,
    function: str,
    limits: Limits | None,
    *,
    from_response: bool = False,
    joined: bool = False,
) -> tuple[Plan, str]:
    """The plan or machine of an argument, and its text: "" for one that was read before.

    ``joined``: what a behaviour tree includes is written into its text.

    Raises UsageError for what is none, GpsfsmError for a text with errors.
    """
    if isinstance(value, Plan):
        return value, ""
    chosen = _limits(function, limits)
    if is_graph(value):
        from gpsfsm.compile.machines import machine_of

        name = "<graph>"
        machine, problems = machine_of(value, file=name)
        parsed = Parsed(name, "", machine, problems, machine=True)
    else:
        name, text = text_of(value, function, chosen.max_bytes, from_response=from_response)
        includes = None
        if isinstance(text, bytes) and text is not value:  # it was read from a file
            if joined:
                text = joined_text(Input(name), text, chosen)
            else:
                includes = includes_of(Input(name), text, chosen)
        parsed = read_plan_or_machine(
            text,
            file=name,
            limits=chosen,
            from_response=from_response,
            includes=includes,
        )
    wrong = [each for each in parsed.problems if rule(each.rule).severity is Severity.ERROR]
    if wrong or parsed.plan is None:
        detail = f": {wrong[0].message}" if wrong else ""
        if parsed.machine:
            raise GpsfsmError(f"{name}: the machine has errors{detail}")
        raise GpsfsmError(f"{name}: the text has errors{detail}; gpsfsm.fix may help")
    return parsed.plan, parsed.text


def view(
    text_or_path: str | bytes | Path | Sequence[str | Path],
    *,
    diff: bool = False,
    task: TaskLike | None = None,
    title: str = "",
    select: Sequence[str] = (),
    ignore: Sequence[str] = (),
    assume: Sequence[str] = (),
    consistent: bool = False,
    faults: Sequence[str] = (),
    from_response: bool = False,
    solver: SolverChoice = "auto",
    rlimit: int = DEFAULT_RLIMIT,
    total_rlimit: int = DEFAULT_TOTAL_RLIMIT,
    max_scenarios: int = CheckSettings.max_scenarios,
    require_proof: bool = False,
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    deadline_s: float | None = None,
    energy_limit_j: float | None = None,
    tolerate: int = 0,
    engine: str = PAPER_ENGINE,
) -> str:
    """Make an HTML page that shows one or more plans.

    ``text_or_path`` is the text of a plan, the path of a file or folder, or a list of paths. The
    page is self-contained: write it to a file and open it. ``diff`` shows two plans side by side.
    ``task`` is a task, as for ``grade``, and the page shows how each plan meets it. The other
    options are those of ``check``.

    Raises UsageError for invalid options, InputError if none of the inputs can be read.

    >>> view('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>').splitlines()[0]
    '<!doctype html>'
    """
    require_flag("view", "diff", diff)
    options = CheckSettings.of(locals()).options()
    if task is not None:
        options = replace(options, task=task_of(task))
    viewed = _viewed(text_or_path, options)
    if diff and len(viewed) != 2:
        raise UsageError(f"diff compares two plans, not {len(viewed)}")
    return _page(viewed, options, title, diff=diff)


def _viewed(value: object, options: CheckOptions) -> list[Viewed]:
    from gpsfsm.checking import check_text
    from gpsfsm.viewing.document import view_input
    from gpsfsm.viewing.plans import Viewed

    if isinstance(value, bytes) or (
        isinstance(value, str) and is_text(value, from_response=options.from_response)
    ):
        return [Viewed(value, check_text(value, "<text>", options))]
    problems: list[str] = []
    inputs = list(find_inputs(paths_of(value, "view", "the text of a plan")))
    viewed = [view_input(each, options, problems.append) for each in inputs]
    if len(problems) == len(viewed):
        raise InputError("\n".join(problems) or "there is no plan to show")
    return viewed


def _page(viewed: list[Viewed], options: CheckOptions, title: str, *, diff: bool) -> str:
    from gpsfsm.viewing.document import document
    from gpsfsm.viewing.page import page

    return page(document(viewed, options, title=title, diff=diff))


def port(
    text_or_path: str | bytes | Path,
    engine: str,
    *,
    unsafe: bool = False,
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
) -> Ported:
    """Rewrite a plan so that an original engine runs it as the paper specifies.

    ``text_or_path`` is the text of a plan or the path of its file; ``engine`` is a name such as
    ``fabric-v2``. ``text`` of the result is proved: it means the same as the plan under the paper's
    semantics, and the engine executes it that way. If the engine cannot do that, ``text`` is None
    and ``losses`` list why. With ``unsafe`` you then get the closest text, and ``change`` shows
    what it changes.

    Raises UsageError for an unknown engine, InputError for a file that cannot be read, and
    GpsfsmError for a text with errors that cannot be fixed or if the limits are reached before
    there is an answer.

    >>> plan = '<Plan><Control type="sequential"/><Runner interface="Go" provider="Go"/></Plan>'
    >>> port(plan, "fabric-v2").text
    '<Plan><Runner interface="Go" provider="Go"/></Plan>'
    """
    from gpsfsm import porting

    require_flag("port", "unsafe", unsafe)
    chosen_limits = _limits("port", limits)
    name, text = text_of(text_or_path, "port", chosen_limits.max_bytes)
    chosen = choose_capabilities(capabilities, builtin=builtin_capabilities)
    return porting.port(
        text, engine, file=name, capabilities=chosen, limits=chosen_limits, unsafe=unsafe
    )


def _limits(function: str, limits: Limits | None) -> Limits:
    if limits is None:
        return DEFAULT_LIMITS
    if not isinstance(limits, Limits):
        raise misused(function, "a gpsfsm.Limits as limits", limits)
    return limits
