"""Runs in Python: ``resume`` and ``replay`` take journals, ``fuzz`` runs a plan very often."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.errors import (
    InputError,
    UsageError,
    misused,
    require_amount,
    require_list,
    require_whole,
)
from gpsfsm.fuzzing.campaign_report import (
    CampaignOptions,
    CampaignReport,
    campaign_report,
    chosen_properties,
    refuse_task,
)
from gpsfsm.fuzzing.subject import FAULTS, MAX_VISITS, subject_of
from gpsfsm.grading.rewards import task_of
from gpsfsm.progress import ticking
from gpsfsm.public.plans import plan_of
from gpsfsm.running.replaying import Replayed, replayed_runs
from gpsfsm.running.run import run

if TYPE_CHECKING:
    from collections.abc import Callable

    import networkx as nx

    from gpsfsm.execution.runner import Runner
    from gpsfsm.fuzzing.properties import Property
    from gpsfsm.generation.language_model import LanguageModel
    from gpsfsm.grading.rewards import TaskLike
    from gpsfsm.model.plan import Plan
    from gpsfsm.progress import Progress
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.run_result import RunResult
    from gpsfsm.syntax import Limits


def resume(
    journal: str | Path,
    *,
    runners: Mapping[str, type[Runner]] | None = None,
    real: bool = False,
    durability: str = "power",
    model: str | LanguageModel | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    force: bool = False,
    interruption: Interruption | None = None,
) -> RunResult:
    """Continue the unfinished runs of a journal; the arguments are those of ``run``.

    A journal grants no permissions: real runners act only with ``real`` or ``runners``, and a model
    is used only if you name it in ``model``. Finished runs are not touched.

    Raises InputError for a journal that does not exist or holds no run, UsageError if the journal
    needs something that the arguments do not permit.

    >>> resume("no-such-journal.db")
    Traceback (most recent call last):
        ...
    gpsfsm.errors.InputError: no-such-journal.db: there is no such journal
    """
    path = _journal(journal, "resume")
    return run(
        journal=path,
        runners=runners,
        real=real,
        durability=durability,
        model=model,
        capabilities=capabilities,
        builtin_capabilities=builtin_capabilities,
        force=force,
        interruption=interruption,
    )


def replay(journal: str | Path, *, run: int | None = None) -> Replayed:
    """Repeat a journaled run without real runners, and compare every event.

    ``run`` is the number of the run; None means the last one and those that it continues. The
    result is true if all events are the same.

    Raises InputError for a journal that does not exist or is damaged, UsageError for a run that the
    journal does not hold.

    >>> replay("no-such-journal.db")
    Traceback (most recent call last):
        ...
    gpsfsm.errors.InputError: no-such-journal.db: there is no such journal
    """
    if run is not None:
        require_whole("replay", "run", run, least=1)
    notices: list[str] = []
    runs = tuple(replayed_runs(_journal(journal, "replay"), run, notices.append))
    return Replayed(runs, tuple(notices))


def _journal(journal: object, function: str) -> str:
    """The path of a journal that is there. Raises UsageError, InputError."""
    if not isinstance(journal, str | Path) or not str(journal):
        raise misused(function, "the path of a journal", journal, "gpsfsm.run writes one")
    if not Path(journal).exists():
        raise InputError(f"{journal}: there is no such journal")
    return str(journal)


def fuzz(
    plan: str | bytes | Path | Plan | nx.Graph[Any],
    *,
    seed: int = 0,
    runs: int | None = None,
    time_s: float | None = None,
    jobs: int | str = 1,
    faults: Sequence[str] = tuple(FAULTS),
    limit_s: float | Literal["auto"] | None = "auto",
    properties: Sequence[str | Property | Callable[..., Any]] = (),
    task: TaskLike | None = None,
    corpus: str | Path | None = None,
    assume: Sequence[str] = (),
    consistent: bool = False,
    max_visits: int = MAX_VISITS,
    limits: Limits | None = None,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    progress: Progress | None = None,
) -> CampaignReport:
    """Run a plan many times in virtual time with random faults, and report what breaks.

    ``plan`` is a text, the path of a file, a plan from ``parse``, or a machine (also a networkx
    graph), whose runs are cut off after ``max_visits``. From ``seed``, ``runs`` scenarios are drawn
    (1,000), or as many as fit in ``time_s`` seconds. ``faults`` are those that may occur,
    ``limit_s`` is the time limit of an action in seconds (None: none; ``auto``: 60, or more if more
    is declared). ``properties`` are names, functions of a ``Run``, or ``Property`` objects;
    ``task`` is a task that every run must fulfil. Cases in the folder ``corpus`` are played first.
    ``progress``: as for ``check``. Raises UsageError for invalid arguments, InputError for a file
    that cannot be read, GpsfsmError for a text with errors.

    >>> report = fuzz('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>', runs=20)
    >>> report.ok, report.campaign.runs
    (True, 20)
    """
    options = _campaign_options(seed, runs, time_s, jobs, corpus)
    parsed, source = _subject_plan(plan, limits, corpus, task, max_visits)
    subject = subject_of(
        parsed,
        faults=faults,
        limit_s=limit_s,
        library=choose_capabilities(capabilities, builtin=builtin_capabilities).library,
        assumptions=assume,
        consistent=consistent,
        most_visits=max_visits,
    )
    held, names = _properties(properties, task), {"name": parsed.file, "source": source}
    with ticking(progress, "runs", None if time_s is not None else options.most) as tick:
        return campaign_report(subject, held, options, **names, progress=tick)


def _properties(
    properties: Sequence[str | Property | Callable[..., Any]], task: TaskLike | None
) -> list[Property]:
    require_list("fuzz", "properties", properties)
    return chosen_properties(properties, None if task is None else task_of(task))


def _subject_plan(
    value: object, limits: Limits | None, corpus: object, task: object, max_visits: object
) -> tuple[Plan, str]:
    require_whole("fuzz", "max_visits", max_visits, least=1)
    parsed, source = plan_of(value, "fuzz", limits, joined=True)
    if task is not None:
        refuse_task(parsed)
    if not parsed.runners:
        raise UsageError(f"{parsed.file}: the plan has no runner, so nothing can happen in it")
    if corpus is not None and not source:
        raise UsageError("cases in a corpus contain the text of their plan: pass that, or a path")
    return parsed, source


def _campaign_options(
    seed: int,
    runs: int | None,
    time_s: float | None,
    jobs: int | str,
    corpus: str | Path | None,
) -> CampaignOptions:
    require_whole("fuzz", "seed", seed)
    if runs is not None:
        require_whole("fuzz", "runs", runs, least=1)
    if time_s is not None:
        require_amount("fuzz", "time_s", time_s)
    folder = None if corpus is None else str(corpus)
    return CampaignOptions(seed=seed, runs=runs, time_s=time_s, jobs=jobs, corpus=folder)
