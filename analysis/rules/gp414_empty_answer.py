"""GP414: an answer is used that the model was never asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.prompts import PromptFlow
from gpsfsm.analysis.rules.base import Rule, ask_plan, go, plan, set_plan
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context


def find(context: Context) -> Iterator[Finding]:
    """One finding per answer, at the prompt."""
    flow: PromptFlow = context.answers["prompts"] or PromptFlow()
    for answer in flow.empty_answers:
        binding = context.bindings[answer.runner]
        assert binding is not None
        prompt, taker = context.runner(answer.source), context.runner(answer.runner)
        if binding.provider.effects.sets_plan == answer.name:
            effect = f"so {context.place(taker)} sets an empty plan, and nothing follows"
        else:
            effect = f"so {context.place(taker)} gets an empty text as '{answer.name}'"
        yield RULE.finding(
            f"{context.place(prompt)} only puts its prompt into a buffer, the model is not asked: "
            f"{effect}",
            context.plan.location(prompt),
            related=(context.related(taker, "uses the empty answer"),),
            scenario=context.triggering(RULE.code, answer.runner),
        )


RULE = Rule(
    code="GP414",
    name="empty-answer",
    severity=Severity.ERROR,
    summary="A runner uses the answer to a prompt that was only buffered.",
    why=(
        "A prompt is sent only if flush is true. Until then its answer is the empty text, and the "
        "runner reports success. A plan that leaves its next step to the model ends there: an "
        "empty plan is refused, and the robot does nothing more."
    ),
    fix='write flush="true" at the prompt, and the uuid of the prompts that belong to it',
    bad=plan(go(1.0, 2.0), ask_plan("Continue the tour."), set_plan()),
    good=plan(go(1.0, 2.0), ask_plan("Continue the tour.", flush="true"), set_plan()),
    find=find,
)
