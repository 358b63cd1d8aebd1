"""What ``gpsfsm fuzz --mutate`` does: score what the checks of a plan notice."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import select_rules
from gpsfsm.capabilities.choice import choose_capabilities
from gpsfsm.checking import CheckOptions
from gpsfsm.cli._fuzz_progress import progress_bar
from gpsfsm.cli._options import limits_of, words
from gpsfsm.cli._reading import read_text, tell_errors
from gpsfsm.cli._streams import complain, form_of, write_text
from gpsfsm.errors import GpsfsmError
from gpsfsm.fuzzing.mutation import DEFAULT_MUTANTS, Mutant, Notice, Score, mutate
from gpsfsm.model.printable import clip, printable
from gpsfsm.selection import Selection
from gpsfsm.syntax import parse
from gpsfsm.tasks.load import load_task

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["run_mutants"]

_VERSION = 1
_OF_TASKS = ("GP6",)
_MAX_TOLD = 500


def run_mutants(values: Mapping[str, Any]) -> int:
    """Score the checks of a plan: 1 if they miss a mutant. Raises GpsfsmError."""
    limits = limits_of(values)
    name, content = read_text(values["path"], limits)
    parsed = parse(content, file=name, limits=limits)
    if tell_errors(parsed) or parsed.plan is None:
        raise GpsfsmError(f"{name}: the text has errors; mend it first ('gpsfsm fix' may help)")
    options = _options(values)
    runs = values["runs"] or (DEFAULT_MUTANTS if values["time_s"] is None else 10**9)
    with progress_bar("mutants", None) as tick:
        score = mutate(
            parsed.plan,
            options,
            seed=values["seed"],
            most=runs,
            time_s=values["time_s"],
            jobs=values["jobs"],
            tick=lambda done, _: tick(done),
        )
    by = "the task file notices" if values["task"] else "the rules notice"
    text = _json(score) if values["output_format"] == "json" else _text(score, by)
    write_text(text, values["output_file"], form=form_of(values["output_format"]))
    if len(score.mutants) == score.count(Notice.UNDECIDED):
        why = "no mutant was decided" if score.mutants else "there was no mutant"
        complain(f"{name}: {why}, so nothing was tried")
        return 2
    return 1 if score.count(Notice.MISSED) else 0


def _options(values: Mapping[str, Any]) -> CheckOptions:
    """How mutants are checked. Raises UsageError."""
    task = load_task(values["task"]) if values["task"] else None
    select = words(values["select"]) or (_OF_TASKS if task is not None else ())
    ignore = words(values["ignore"])
    select_rules((*select, *ignore))
    analysis = AnalysisOptions(assumptions=tuple(values["assume"]), consistent=values["consistent"])
    return CheckOptions(
        analysis=analysis,
        limits=limits_of(values),
        selection=Selection.of(select, ignore),
        capabilities=choose_capabilities(
            values["capabilities"], builtin=values["builtin_capabilities"]
        ),
        task=task,
        trees=False,
    )


def _text(score: Score, by: str) -> str:
    name = printable(score.plan.file)
    lines: list[str] = []
    for notice in (Notice.MISSED, Notice.UNDECIDED):
        found = [each for each in score.mutants if each.notice is notice]
        lines += [f"{_place(score, each)}: {notice} {_told(each)}" for each in found[:_MAX_TOLD]]
        if len(found) > _MAX_TOLD:
            lines.append(f"and {len(found) - _MAX_TOLD} more that are {notice}")
    if lines:
        lines.append("")
    if score.known:
        has = _count(score.known, "finding")
        lines.append(f"{name}: note: the plan itself has {has}; only further ones notice a mutant")
    lines.append(f"{name}: {_summary(score, by)}")
    return "\n".join(lines) + "\n"


def _summary(score: Score, by: str) -> str:
    noticed, missed = score.count(Notice.NOTICED), score.count(Notice.MISSED)
    told = "there is nothing to notice" if score.score is None else f"{score.score:.0%}"
    tried, equal = len(score.mutants), score.count(Notice.EQUAL)
    parts = [
        f"{_count(tried, 'mutant')}: {by} {noticed} of {noticed + missed} ({told})",
        f"{equal} the same as the plan",
        f"{score.count(Notice.UNDECIDED)} undecided",
    ]
    if score.cut_off:
        parts.append("then the time was over")
    return "; ".join(parts)


def _count(number: int, one: str) -> str:
    return f"{number} {one}{'' if number == 1 else 's'}"


def _place(score: Score, mutant: Mutant) -> str:
    element = score.plan.elements[mutant.mutation.element]
    return f"{printable(score.plan.file)}:{element.line}:{element.column}"


def _told(mutant: Mutant) -> str:
    return f"{mutant.mutation.operator}: {clip(mutant.mutation.told, 300)}"


def _json(score: Score) -> str:
    plan = score.plan
    data = {
        "mutation": _VERSION,
        "plan": plan.file,
        "score": score.score,
        "possible": score.possible,
        "cut_off": score.cut_off,
        "counts": {notice.value: score.count(notice) for notice in Notice},
        "mutants": [
            {
                "operator": each.mutation.operator,
                "line": plan.elements[each.mutation.element].line,
                "column": plan.elements[each.mutation.element].column,
                "element": plan.path(each.mutation.element),
                "told": each.mutation.told,
                "notice": each.notice.value,
                "by": list(each.by),
            }
            for each in score.mutants
        ],
    }
    return json.dumps(data, ensure_ascii=True, indent=2) + "\n"
