"""What it takes to ask a model for plans: the model, the grammars, the judge, the journal."""

from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.generation.language_model import Constraint, LanguageModel
    from gpsfsm.generation.loop import Attempt, Generated
    from gpsfsm.generation.prompts.builder import Prompt
    from gpsfsm.generation.providers.settings import ModelSettings
    from gpsfsm.generation.stored import Session

__all__ = [
    "attempt_line",
    "grammars_of",
    "model_of",
    "result_line",
    "session_for",
]

_NO_MODEL = """no model is named: use --model, GPSFSM_MODEL or [tool.gpsfsm.model]. Examples:
  --model ollama:qwen3:8b          a model on this machine
  --model openai:gpt-5             with a key in OPENAI_API_KEY
  --model replay:answers.jsonl     answers that were recorded"""


def model_of(settings: ModelSettings) -> LanguageModel:
    """The model to ask; raises GpsfsmError if none is named or it cannot be asked."""
    if not settings.spec:
        raise UsageError(_NO_MODEL)
    from gpsfsm.generation.providers.registry import find_model  # noqa: PLC0415
    from gpsfsm.grammars import rendered  # noqa: PLC0415

    return find_model(settings.spec, settings, rendered=rendered)


def grammars_of(
    capabilities: Capabilities, offered: Sequence[str], settings: ModelSettings
) -> tuple[tuple[Constraint, str], ...]:
    """The grammars over what the prompt offers; none if they are not wanted.

    A capability that no grammar can express safely leaves the answer free: it is checked anyway.
    """
    from gpsfsm.generation.providers.settings import Constrain  # noqa: PLC0415

    if settings.constrain is Constrain.NEVER:
        return ()
    from gpsfsm.grammars import alphabet, grammars_for  # noqa: PLC0415

    if alphabet(capabilities.library, offered).left_out:
        return ()
    return grammars_for(capabilities, only=offered)


def session_for(
    prompt: Prompt,
    model: LanguageModel,
    *,
    options: Mapping[str, Any],
    capabilities: Capabilities,
    why: str = "",
) -> Session:
    """What is written down before a model is asked."""
    from gpsfsm.capabilities.table import dump  # noqa: PLC0415
    from gpsfsm.generation.stored import Session  # noqa: PLC0415

    messages = json.dumps([[each.role.value, each.text] for each in prompt.messages])
    return Session(
        task=prompt.task,
        model=model.name,
        template=prompt.template.id,
        template_sha256=prompt.template.sha256,
        prompt_sha256=_digest(messages),
        library_sha256=_digest(dump(capabilities.library)),
        seed=options["seed"] or 0,
        rounds=options["attempts"],
        candidates=options["candidates"],
        why=why,
    )


def attempt_line(attempt: Attempt, *, candidates: int = 1) -> str:
    """What has come of an attempt, in one line."""
    number = f"attempt {attempt.round}"
    if candidates > 1:
        number += f", candidate {attempt.candidate}"
    parts = [f"{number}: {_verdict(attempt)}"]
    if (judged := attempt.judgement) is not None and judged.repairs:
        parts.append(f"mended: {', '.join(judged.repairs)}")
    if attempt.note:
        parts.append(attempt.note)
    if (answer := attempt.answer) is not None:
        parts.append(f"{answer.latency_s:.1f} s")
        if answer.usage.answer_tokens is not None:
            about = "about " if answer.usage.estimated else ""
            parts.append(f"{about}{answer.usage.answer_tokens:,} tokens")
        if answer.cost is not None:
            parts.append(f"cost {answer.cost:.4f}")
        if answer.constrained is not None:
            parts.append(f"constrained by {answer.constrained.value}")
    return clip("; ".join(parts), 2000)


def _verdict(attempt: Attempt) -> str:
    if attempt.problem or attempt.judgement is None:
        return attempt.problem or "no answer"
    judged = attempt.judgement
    if judged.accepted:
        return "accepted" + (f" with {_count(judged.warnings, 'warning')}" * (judged.warnings > 0))
    if not judged.plan:
        return "rejected, there is no plan in the answer"
    if not judged.decided:
        return "rejected, it could not be checked"
    number, kind = (judged.errors, "error") if judged.errors else (judged.warnings, "warning")
    codes = ", ".join(dict.fromkeys(code for code, _ in judged.findings[:number]))
    return f"rejected, {_count(number, kind)} ({codes})"


def result_line(found: Generated) -> str:
    """How it has ended, in one line."""
    answers = [each.answer for each in found.attempts if each.answer is not None]
    read = sum(each.usage.prompt_tokens or 0 for each in answers)
    written = sum(each.usage.answer_tokens or 0 for each in answers)
    costs = [each.cost for each in answers if each.cost is not None]
    parts = [_count(len(answers), "answer")]
    if read or written:
        parts.append(f"{read:,} tokens read and {written:,} written")
    if costs:
        parts.append(f"cost {sum(costs):.4f}")
    told = "accepted" if found.accepted else f"no plan: {clip(found.reason, 2000)}"
    return f"{told} ({', '.join(parts)})"


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'' if number == 1 else 's'}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()
