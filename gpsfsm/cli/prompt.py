"""``gpsfsm prompt``: what a model would be asked."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import Command, Section
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
from gpsfsm.cli._options import config_options, format_option, output_option, read_values
from gpsfsm.streams import form_of, to_stderr, write_private

if TYPE_CHECKING:
    from gpsfsm.generation.prompt_builder import Prompt

_FORMAT_VERSION = 1


@dataclass(frozen=True, kw_only=True)
class PromptCommand(AskingValues):
    """The options of ``gpsfsm prompt``."""

    elsewhere = MODEL_PARAMETERS


@click.command(
    "prompt",
    cls=Command,
    section=Section.GENERATE,
    short_help="Show the prompt that generate would send.",
)
@asking_options
@format_option("text", "json", text="Output format.")
@output_option()
@model_options()
@config_options
@click.pass_context
def command(context: click.Context, /, **_: Any) -> int:
    r"""Print the prompt that 'gpsfsm generate' would send to a model.

    The approximate number of tokens, and what was left out to make it fit, go to standard error.

    \b
    Example:
      gpsfsm prompt "go to (2, 0.5)" --interface 'nav2_capabilities/*'
    """
    values = read_values(context, PromptCommand, ASKING)
    task = task_of(values.task, values.task_file)
    from gpsfsm.generation.prompt_builder import build_prompt
    from gpsfsm.running.model_access import budgeted

    settings, less = budgeted(model_settings(context))
    options = prompt_options(values, settings)
    prompt = build_prompt(task, capabilities_of(values).library, options)
    text = _json(prompt) if values.output_format == "json" else _text(prompt)
    write_private(text, values.output_file, form=form_of(values.output_format))
    characters = sum(len(each.text) for each in prompt.messages)
    to_stderr(f"about {prompt.tokens:,} tokens, {characters:,} characters\n")
    for note in filter(None, (less, *prompt.notes)):
        to_stderr(f"note: {note}\n")
    return 0


def _text(prompt: Prompt) -> str:
    return "\n".join(each.text.rstrip() + "\n" for each in prompt.messages)


def _json(prompt: Prompt) -> str:
    data = {
        "version": _FORMAT_VERSION,
        "template": {"id": prompt.template.id, "sha256": prompt.template.sha256},
        "tokens": prompt.tokens,
        "notes": list(prompt.notes),
        "offered": list(prompt.offered),
        "messages": [{"role": each.role.value, "content": each.text} for each in prompt.messages],
    }
    return json.dumps(data, indent=2, ensure_ascii=False) + "\n"
