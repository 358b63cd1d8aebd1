"""GP404: what a runner finds out is used by nobody."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.decisions.data_flow import DataFlow
from gpsfsm.analysis.rules.base import Rule, hear, note, plan
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Finding, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context

_MAX_RELATED = 20


def find(context: Context) -> Iterator[Finding]:
    """One finding per interface of which an instance gives something that nobody reads.

    What somebody misses is told there. The empty answer of a prompt that only fills its buffer
    does not count as an output.
    """
    flow: DataFlow = context.answers["data_flow"] or DataFlow()
    missed = {value.source for value in flow.lost}
    prompts = context.prompts.all if context.prompts is not None else ()
    empty = {each.runner: {each.answer} for each in prompts if each.flush is False}
    groups: dict[tuple[str, tuple[str, ...]], list[int]] = {}
    for unused in flow.unused:
        binding = context.bindings[unused.runner]
        assert binding is not None
        outputs = {output.name for output in binding.provider.outputs if not output.status}
        outputs -= empty.get(unused.runner, set())
        unread = tuple(name for name in unused.names if name in outputs)
        if unused.runner not in missed and outputs and len(unread) == len(outputs):
            groups.setdefault((binding.interface.name, unread), []).append(unused.runner)
    for (_, unread), numbers in groups.items():
        first, *others = (context.runner(number) for number in numbers)
        names = listed([f"'{name}'" for name in unread])
        more = f" ({len(others)} more like this)" if others else ""
        yield RULE.finding(
            f"nothing uses what {context.place(first)} gives: {names}{more}",
            context.plan.location(first),
            related=tuple(
                context.related(other, "nor what this one gives") for other in others[:_MAX_RELATED]
            ),
        )


RULE = Rule(
    code="GP404",
    name="unused-output",
    severity=Severity.INFO,
    summary="Nothing uses what a runner gives.",
    why=(
        "A value reaches the direct successor only. If that one does not read it, the runner "
        "looked, listened or asked for nothing."
    ),
    fix="put a runner that uses the value right behind it, or leave this one out",
    bad=plan(hear()),
    good=plan(hear(), note(uuid="guest")),
    options=("--select", "GP404"),
    find=find,
)
