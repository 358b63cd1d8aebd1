"""GP104: no <Plan> to be found."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP104",
    name="missing-plan",
    severity=Severity.ERROR,
    summary="The text has no `<Plan>` as its outermost element.",
    why=(
        "An executor runs one `<Plan>` element and nothing else. Without it there is nothing to "
        "run: the text is empty, or prose, or written in another plan language."
    ),
    fix=(
        "put the controls and runners into one <Plan>…</Plan>. Check a language model's raw answer "
        "with --from-response"
    ),
    bad=('<mission name="patrol">\n    <goto goal="dock"/>\n</mission>\n'),
    good=plan(go(2.0, -0.5)),
)
