"""GP904: a limit was hit before an answer was found."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.analysis.rules.examples import go, plan
from gpsfsm.model.finding import Severity

__all__ = ["RULE"]

RULE = Rule(
    code="GP904",
    name="inconclusive",
    severity=Severity.ERROR,
    summary="A limit was hit, or the time or the memory was too short, before all was answered.",
    why=("What is undecided is not safe. Unknown is an answer of its own, and a gate refuses it."),
    fix=(
        "raise --rlimit or --total-rlimit, allow more time (--time-limit) or memory, split the "
        "plan, or drop some assumptions"
    ),
    bad=plan(go(1.0, 1.0), go(1.0, 1.0), go(2.0, 2.0)),
    good=plan(go(1.0, 1.0), go(2.0, 2.0)),
    options=("--consistent", "--rlimit", "1"),
)
