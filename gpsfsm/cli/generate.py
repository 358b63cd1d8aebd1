"""``gpsfsm generate``: a model writes a plan, and is asked again until it is a good one."""

from __future__ import annotations

import json
from contextlib import ExitStack
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import Command, Section, declare, declare_file
from gpsfsm.cli._model import (
    ASKING,
    MODEL_PARAMETERS,
    AskingValues,
    asking_options,
    capabilities_of,
    model_options,
    model_settings,
    prompt_options,
    task_of,
)
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
from gpsfsm.streams import Form, check_writable, to_stderr, write_private

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
        declare(
            "--attempts",
            type=click.IntRange(1, 100),
            default=3,
            show_default=True,
            metavar="N",
            common=True,
            help="Maximum number of attempts.",
        ),
        declare(
            "--candidates",
            type=click.IntRange(1, 16),
            default=1,
            show_default=True,
            metavar="N",
            common=True,
            help="Answers per attempt; the best is kept.",
        ),
        declare(
            "--total",
            type=NumberRange(0, 1e6, min_open=True),
            metavar="SECONDS",
            help="Time limit for all attempts. [default: none]",
        ),
        declare("--seed", type=int, metavar="N", help="Seed, for servers that take one."),
        option(
            "fail_on",
            type=click.Choice(["error", "warning"]),
            help="Lowest severity that rejects a plan.",
        ),
        declare(
            "--no-fix",
            is_flag=True,
            common=True,
            help="Do not repair answers, even where it is safe.",
        ),
    )
    return apply(options, command, "The search")


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


@click.command(
    "generate",
    cls=Command,
    section=Section.GENERATE,
    short_help="Have a language model write a plan.",
)
@asking_options
@_search_options
@model_options()
@declare_file(
    "--journal",
    default=JOURNAL,
    show_default=True,
    common=True,
    help="Record every attempt in this file.",
)
@declare("--no-journal", is_flag=True, help="Record nothing.")
@format_option("text", "json", text="The plan only, or everything about the search.")
@output_option()
@declare("--served", is_flag=True, hidden=True, help="As a part of 'gpsfsm serve'.")
@config_options
@click.pass_context
def command(context: click.Context, /, **_: Any) -> int:
    r"""Ask a language model for a plan, check it, and ask again with the findings.

    The accepted plan goes to standard output, everything else to standard error.

    Exit code: 0 a plan was accepted, 1 none was, 2 the model gave no answer.

    \b
    Example:
      gpsfsm generate "go to (2, 0.5)" --model ollama:qwen3:8b -o plan.xml
    """
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
            to_stderr(f"asking {model.name}: about {prompt.tokens:,} tokens\n")
            to_stderr("".join(f"note: {note}\n" for note in notes))
            generated = _run(search, keeper, journal)
    except JournalError as error:
        raise JournalError(f"{error}\n{_ELSEWHERE}") from error
    to_stderr(f"{result_line(generated)}\n")
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
        to_stderr(f"{attempt_line(attempt, candidates=search.options.candidates)}\n")

    try:
        return asyncio.run(search.run(tell, keeper))
    except KeyboardInterrupt:
        kept = f"; the answers are in {journal}" if journal is not None else ""
        to_stderr(f"stopped{kept}\n")
        raise click.exceptions.Exit(_INTERRUPTED) from None


def _written(generated: Generated, values: GenerateCommand) -> int:
    """Write what was found; the exit code."""
    if values.output_format == "json":
        write_private(_json(generated), values.output_file, form=Form.JSON)
    elif generated.accepted:
        write_private(generated.plan + "\n", values.output_file, form=Form.EXACT)
    else:
        _tell_best(generated)
    if generated.accepted:
        return 0
    return 1 if any(attempt.answer is not None for attempt in generated.attempts) else 2


def _tell_best(generated: Generated) -> None:
    """Tell the best answer and its defects; not as a result that a program may take."""
    from gpsfsm.model.printable import printable

    if (best := generated.best) is None or best.judgement is None:
        return
    judged, title = best.judgement, f"the best answer, from attempt {best.round}:"
    lines = [title, "", *judged.feedback.splitlines()]
    if judged.plan:
        lines += ["", "its plan, which was not accepted:", "", *judged.plan.splitlines()]
    to_stderr("".join(f"{printable(line.expandtabs(4))}\n" for line in lines))


def _json(generated: Generated) -> str:
    return json.dumps(generated.to_dict(), indent=2, ensure_ascii=False) + "\n"
