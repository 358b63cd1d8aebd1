"""GP204: a parameter that must have a value and never gets one."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan, wait
from gpsfsm.analysis.rules.names import quoted
from gpsfsm.analysis.words import listed
from gpsfsm.model.finding import Severity
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.analysis.decisions.data_flow import DataFlow
    from gpsfsm.model.finding import Finding

_SHOWN = 5


def find(context: Context) -> Iterator[Finding]:
    """One finding per runner instance."""
    flow: DataFlow | None = context.answers.get("data_flow")
    missing: dict[int, list[str]] = {}
    for need in flow.missing if flow else ():
        if need.kind == "parameter" and need.how == "always":
            missing.setdefault(need.runner, []).append(clip(need.name, 40))
    for number, names in missing.items():
        runner = context.runner(number)
        several = len(names) > 1
        missing_names = listed([quoted(name) for name in names], most=_SHOWN)
        yield RULE.finding(
            f"{missing_names} {'are' if several else 'is'} missing: {context.place(runner)} needs "
            f"{'them' if several else 'it'}, and no such value can arrive",
            context.plan.location(runner),
            hint="write " + listed([f'{name}="…"' for name in names], most=_SHOWN),
        )


RULE = Rule(
    code="GP204",
    name="missing-parameter",
    severity=Severity.ERROR,
    summary="A runner lacks a parameter that it needs, and nothing can supply it.",
    why=(
        "The parameter has no default, the plan writes none, and the step before hands over no "
        "value of this name. The runner fails, or works with whatever it happens to find."
    ),
    fix="write the parameter",
    bad=plan(go(2.0, -0.5), wait(5.0).replace(' seconds="5.0"', "")),
    good=plan(go(2.0, -0.5), wait(5.0)),
    find=find,
)
