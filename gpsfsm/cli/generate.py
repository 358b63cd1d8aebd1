"""``gpsfsm generate``: a model writes a plan, and is asked again until it is a good one."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._asking import (
    ASKING,
    AskingValues,
    asking_options,
    capabilities_of,
    prompt_options,
    task_of,
)
from gpsfsm.cli._model import MODEL_PARAMETERS, model_options, model_settings
from gpsfsm.cli._options import (
    NumberRange,
    apply,
    config_options,
    format_option,
    option,
    output_option,
    read_values,
    tell_narrowing,
)
from gpsfsm.streams import Form, check_writable, write_message, write_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.generation.attempt_log import Keeper
    from gpsfsm.generation.loop import Attempt, Generated
    from gpsfsm.running.search import Search, SearchOptions

JOURNAL = "gpsfsm.db"
"""Where attempts are kept, if nothing else is said."""
_INTERRUPTED = 130
_ELSEWHERE = "--journal FILE keeps the attempts elsewhere, --no-journal keeps none of them."


def _search_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Options about how long to search, and what is good enough."""
    options = (
        click.option(
            "--attempts",
            type=click.IntRange(1, 100),
            default=3,
            show_default=True,
            metavar="N",
            help="How often the model is asked at most.",
        ),
        click.option(
            "--candidates",
            type=click.IntRange(1, 16),
            default=1,
            show_default=True,
            metavar="N",
            help="How many answers are asked for at once; the best is kept.",
        ),
        click.option(
            "--total",
            type=NumberRange(0, 1e6, min_open=True),
            metavar="SECONDS",
            help="What all attempts together may take. [default: no limit]",
        ),
        click.option("--seed", type=int, metavar="N", help="Seed for servers that take one."),
        option(
            "fail_on",
            type=click.Choice(["error", "warning"]),
            help="From which severity on a finding rejects a plan.",
        ),
        click.option(
            "--no-fix",
            is_flag=True,
            help="Do not mend answers, even where that is safe.",
        ),
    )
    return apply(options, command)


@dataclass(frozen=True, kw_only=True)
class GenerateCommand(AskingValues):
    """The options of ``gpsfsm generate``."""

    attempts: int
    candidates: int
    total: float | None
    seed: int | None
    fail_on: str
    no_fix: bool
    journal: str
    no_journal: bool
    served: bool
    elsewhere = MODEL_PARAMETERS


@click.command("generate", short_help="Let a model write a plan.")
@asking_options
@_search_options
@model_options()
@click.option(
    "--journal",
    metavar="FILE",
    type=click.Path(),
    default=JOURNAL,
    show_default=True,
    help="Keep every attempt in this journal; see 'gpsfsm attempts'.",
)
@click.option("--no-journal", is_flag=True, help="Keep nothing.")
@format_option("text", "json", text="Write the plan alone, or all that is known about the search.")
@output_option("-o", text="Write to this file. [default: standard output]")
@click.option("--served", is_flag=True, hidden=True, help="As a part of 'gpsfsm serve'.")
@config_options
@click.pass_context
def COMMAND(context: click.Context, /, **_: Any) -> int:  # noqa: N802  (it is an object)
    """Ask a language model for a plan, check it, and ask again with what is wrong about it.

    The plan that is accepted goes to standard output, everything else to standard error. Exit
    codes: 0 a plan was accepted, 1 none was, 2 the model could not be asked.

    \b
    Example:
      gpsfsm generate "go to (2, 0.5) and say hello" --model ollama:qwen3:8b -o plan.xml
    """  # noqa: D301  (click wants the \b)
    served = context.params["served"]
    values = read_values(context, GenerateCommand, ASKING, named=served)
    tell_narrowing(values)
    task = task_of(values.task, values.task_file)
    from gpsfsm.running.model_access import budgeted
    from gpsfsm.running.search import Search, keeper_of

    settings, less = budgeted(model_settings(context))
    check_writable(values.output_file, [])
    from gpsfsm.execution.journal_errors import JournalError
    from gpsfsm.generation.attempt_log import result_line
    from gpsfsm.generation.prompt_builder import build_prompt
    from gpsfsm.running.model_access import model_of

    model = model_of(settings)
    capabilities = capabilities_of(values)
    prompt = build_prompt(task, capabilities.library, prompt_options(values, settings))
    notes = filter(None, (less, *prompt.notes))
    search = Search(model, prompt, capabilities, settings, _search_options_of(values))
    journal = None if values.no_journal else values.journal
    try:
        with ExitStack() as stack:
            keeper = keeper_of(journal, stack)
            write_message(f"asking {model.name}: about {prompt.tokens:,} tokens\n")
            write_message("".join(f"note: {note}\n" for note in notes))
            generated = _run(search, keeper, journal)
    except JournalError as error:
        raise JournalError(f"{error}\n{_ELSEWHERE}") from error
    write_message(f"{result_line(generated)}\n")
    return _written(generated, values)


def _search_options_of(values: GenerateCommand) -> SearchOptions:
    from gpsfsm.running.search import SearchOptions

    return SearchOptions(
        attempts=values.attempts,
        candidates=values.candidates,
        total_s=values.total,
        seed=values.seed,
        fail_on=values.fail_on,
        mend=not values.no_fix,
        only=tuple(values.only),
    )


def _run(search: Search, keeper: Keeper | None, journal: str | None) -> Generated:
    """Search, and tell of every attempt."""
    import asyncio

    from gpsfsm.generation.attempt_log import attempt_line

    def tell(attempt: Attempt) -> None:
        write_message(f"{attempt_line(attempt, candidates=search.options.candidates)}\n")

    try:
        return asyncio.run(search.run(tell, keeper))
    except KeyboardInterrupt:
        kept = f"; what was answered is in {journal}" if journal is not None else ""
        write_message(f"stopped{kept}\n")
        raise click.exceptions.Exit(_INTERRUPTED) from None


def _written(generated: Generated, values: GenerateCommand) -> int:
    """Write what was found; the exit code."""
    if values.output_format == "json":
        write_text(_json(generated), values.output_file, form=Form.JSON)
    elif generated.accepted:
        write_text(generated.plan + "\n", values.output_file, form=Form.EXACT)
    else:
        _tell_best(generated)
    if generated.accepted:
        return 0
    return 1 if any(attempt.answer is not None for attempt in generated.attempts) else 2


def _tell_best(generated: Generated) -> None:
    """Tell the best answer and its defects; not as a result that a program may take."""
    from gpsfsm.model.printable import printable

    best = generated.best
    if best is None or best.judgement is None:
        return
    lines = [f"the best answer, of attempt {best.round}:", "", *best.judgement.told.splitlines()]
    if best.judgement.plan:
        lines += ["", "its plan, which was not accepted:", "", *best.judgement.plan.splitlines()]
    write_message("".join(f"{printable(line.expandtabs(4))}\n" for line in lines))


def _json(generated: Generated) -> str:
    return json.dumps(generated.to_dict(), indent=2, ensure_ascii=False) + "\n"
