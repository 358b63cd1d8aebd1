"""``gpsfsm generate``: a model writes a plan, and is asked again until it is a good one."""

from __future__ import annotations

import json
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._asking import (
    ASKING,
    asking_options,
    budgeted,
    capabilities_of,
    prompt_options,
    task_of,
)
from gpsfsm.cli._check_options import tell_narrowing
from gpsfsm.cli._model import model_options, model_settings
from gpsfsm.cli._options import (
    NumberRange,
    apply,
    config_options,
    format_option,
    output_option,
    settle,
    settle_named,
)
from gpsfsm.cli._streams import Form, check_writable, write_message, write_text

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.generation.keeping import Keeper
    from gpsfsm.generation.language_model import LanguageModel
    from gpsfsm.generation.loop import Attempt, Generated
    from gpsfsm.generation.prompts.builder import Prompt
    from gpsfsm.generation.providers.settings import ModelSettings

__all__ = ["COMMAND", "JOURNAL"]

JOURNAL = "gpsfsm.db"
"""Where attempts are kept, if nothing else is said."""
_FORMAT_VERSION = 1
_INTERRUPTED = 130
_ELSEWHERE = "--journal FILE keeps the attempts elsewhere, --no-journal keeps none of them."


def _search_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """How long to search, and what is good enough."""
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
        click.option(
            "--fail-on",
            type=click.Choice(["error", "warning"]),
            default="error",
            show_default=True,
            help="From which severity on a finding rejects a plan.",
        ),
        click.option(
            "--no-fix",
            is_flag=True,
            help="Do not mend answers, even where that is safe.",
        ),
    )
    return apply(options, command)


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
    values = settle_named(context, ASKING) if context.params["served"] else settle(context, ASKING)
    tell_narrowing(values)
    task = task_of(values["task"], values["task_file"])
    settings, less = budgeted(model_settings(context))
    check_writable(values["output_file"], [])
    from gpsfsm.cli._generating import model_of, result_line  # noqa: PLC0415
    from gpsfsm.execution.journal_errors import JournalError  # noqa: PLC0415  (loads sqlite3)
    from gpsfsm.generation.prompts.builder import build_prompt  # noqa: PLC0415

    model = model_of(settings)
    capabilities = capabilities_of(values)
    prompt = build_prompt(task, capabilities.library, prompt_options(values, settings))
    notes = filter(None, (less, *prompt.notes))
    search = _Search(model, prompt, capabilities, settings, values)
    try:
        with ExitStack() as stack:
            keeper = _keeper(values, stack)
            write_message(f"asking {model.name}: about {prompt.tokens:,} tokens\n")
            write_message("".join(f"note: {note}\n" for note in notes))
            found = _search(search, keeper)
    except JournalError as error:
        raise JournalError(f"{error}\n{_ELSEWHERE}") from error
    write_message(f"{result_line(found)}\n")
    return _written(found, values)


class _Search:
    """All that the loop is made of."""

    def __init__(
        self,
        model: LanguageModel,
        prompt: Prompt,
        capabilities: Capabilities,
        settings: ModelSettings,
        values: Mapping[str, Any],
    ) -> None:
        self.model, self.prompt, self.values = model, prompt, values
        self.capabilities, self.settings = capabilities, settings

    async def run(self, keep: Callable[[Attempt], None]) -> Generated:
        """Ask until a plan is accepted."""
        from gpsfsm.capabilities.library import Capabilities  # noqa: PLC0415
        from gpsfsm.checking import CheckOptions  # noqa: PLC0415
        from gpsfsm.cli._generating import grammars_of  # noqa: PLC0415
        from gpsfsm.generation.language_model import Request  # noqa: PLC0415
        from gpsfsm.generation.loop import LoopOptions, generate, plan_key  # noqa: PLC0415
        from gpsfsm.generation.prompts.offer import closed  # noqa: PLC0415
        from gpsfsm.judging import PlanJudge  # noqa: PLC0415
        from gpsfsm.model.finding import Severity  # noqa: PLC0415

        values, prompt, library = self.values, self.prompt, self.capabilities.library
        options = LoopOptions(
            rounds=values["attempts"],
            candidates=values["candidates"],
            max_tokens=self.settings.max_tokens,
            temperature=self.settings.temperature,
            seed=values["seed"],
            total_s=values["total"],
            context_tokens=self.settings.context_tokens,
            grammars=grammars_of(self.capabilities, prompt.offered, self.settings),
            seen=tuple((plan_key(text), "this is an example") for text in prompt.examples),
        )
        judge = PlanJudge(
            CheckOptions(capabilities=Capabilities(closed(library, values["only"]))),
            fail_on=Severity(values["fail_on"]),
            mend=not values["no_fix"],
        )
        try:
            request = Request(prompt.messages, prompt.task)
            return await generate(self.model, request, judge, options, keep=keep)
        finally:
            await self.model.close()


def _keeper(values: Mapping[str, Any], stack: ExitStack) -> Keeper | None:
    if values["no_journal"]:
        return None
    from gpsfsm.execution.journal import Journal  # noqa: PLC0415
    from gpsfsm.generation.keeping import Keeper  # noqa: PLC0415

    return Keeper(stack.enter_context(Journal(values["journal"])))


def _search(search: _Search, keeper: Keeper | None) -> Generated:
    from gpsfsm.cli._generating import attempt_line, session_for  # noqa: PLC0415

    if keeper is not None:
        keeper.asked(
            session_for(
                search.prompt,
                search.model,
                options=search.values,
                capabilities=search.capabilities,
            )
        )

    def keep(attempt: Attempt) -> None:
        if keeper is not None:
            keeper.attempt(attempt)
        write_message(f"{attempt_line(attempt, candidates=search.values['candidates'])}\n")

    import asyncio  # noqa: PLC0415  (slow to import)

    try:
        found = asyncio.run(search.run(keep))
    except KeyboardInterrupt:
        kept = f"; what was answered is in {search.values['journal']}" if keeper else ""
        write_message(f"stopped{kept}\n")
        raise click.exceptions.Exit(_INTERRUPTED) from None
    if keeper is not None:
        keeper.generated(found)
    return found


def _written(found: Generated, values: Mapping[str, Any]) -> int:
    """Write what was found; the exit code."""
    if values["output_format"] == "json":
        write_text(_json(found), values["output_file"], form=Form.JSON)
    elif found.accepted:
        write_text(found.plan + "\n", values["output_file"], form=Form.EXACT)
    else:
        _tell_best(found)
    if found.accepted:
        return 0
    return 1 if any(attempt.answer is not None for attempt in found.attempts) else 2


def _tell_best(found: Generated) -> None:
    """What came nearest, and what is wrong with it; not as a result that a program may take."""
    from gpsfsm.model.printable import printable  # noqa: PLC0415

    best = found.best
    if best is None or best.judgement is None:
        return
    lines = [f"the best answer, of attempt {best.round}:", "", *best.judgement.told.splitlines()]
    if best.judgement.plan:
        lines += ["", "its plan, which was not accepted:", "", *best.judgement.plan.splitlines()]
    write_message("".join(f"{printable(line.expandtabs(4))}\n" for line in lines))


def _json(found: Generated) -> str:
    from gpsfsm.generation.stored import attempt_data  # noqa: PLC0415

    data = {
        "version": _FORMAT_VERSION,
        "accepted": found.accepted,
        "plan": found.plan,
        "reason": found.reason,
        "attempts": [attempt_data(attempt) for attempt in found.attempts],
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
