"""The scores of ``gpsfsm fuzz --mutate``: mutants that the checks of a plan notice."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import select_rules
from gpsfsm.checking import CheckOptions
from gpsfsm.checking.selection import Selection
from gpsfsm.cli._options import words
from gpsfsm.cli._reading import read_text, tell_errors
from gpsfsm.errors import GpsfsmError
from gpsfsm.fuzzing.mutation import DEFAULT_MUTANTS, Notice, mutate, score_json, score_text
from gpsfsm.streams import complain, form_of, progress_bar, write_text
from gpsfsm.syntax import parse
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from gpsfsm.cli.fuzz import FuzzCommand

_OF_TASKS = ("GP6",)


def run_mutants(path: str, values: FuzzCommand) -> int:
    """Score the checks of a plan: 1 if they miss a mutant. Raises GpsfsmError."""
    limits = values.limits
    name, content = read_text(path, limits)
    parsed = parse(content, file=name, limits=limits)
    if tell_errors(parsed) or parsed.plan is None:
        raise GpsfsmError(f"{name}: the text has errors; mend it first ('gpsfsm fix' may help)")
    options = _options(values)
    runs = values.runs or (DEFAULT_MUTANTS if values.time_s is None else 10**9)
    with progress_bar("mutants", None) as tick:
        score = mutate(
            parsed.plan,
            options,
            seed=values.seed,
            most=runs,
            time_s=values.time_s,
            jobs=values.jobs,
            tick=tick,
        )
    by = "the task file notices" if values.task else "the rules notice"
    text = score_json(score) if values.output_format == "json" else score_text(score, by)
    write_text(text, values.output_file, form=form_of(values.output_format))
    if len(score.mutants) == score.count(Notice.UNDECIDED):
        why = "no mutant was decided" if score.mutants else "there was no mutant"
        complain(f"{name}: {why}, so nothing was tried")
        return 2
    return 1 if score.count(Notice.MISSED) else 0


def _options(values: FuzzCommand) -> CheckOptions:
    """How mutants are checked. Raises UsageError."""
    task = load_task(values.task) if values.task else None
    select = words(values.select) or (_OF_TASKS if task is not None else ())
    ignore = words(values.ignore)
    select_rules((*select, *ignore))
    analysis = AnalysisOptions(assumptions=tuple(values.assume), consistent=values.consistent)
    return CheckOptions(
        analysis=analysis,
        limits=values.limits,
        selection=Selection.of(select, ignore),
        capabilities=values.library,
        task=task,
        trees=False,
    )
