"""The rules on gpsfsm itself (GP9xx): documentation of what it reports of its own work."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.model.finding import Severity

RULES = (
    Rule(
        code="GP901",
        name="unreadable-input",
        severity=Severity.ERROR,
        summary="The input cannot be read.",
        why=(
            "What could not be read was not checked, and what was not checked must not be "
            "dispatched."
        ),
        fix="give the path of a readable plan, of a folder with plans, or - for standard input",
        bad="",
        good=plan(go(1.0, 1.0)),
    ),
    Rule(
        code="GP902",
        name="contradictory-assumptions",
        severity=Severity.ERROR,
        summary="The assumptions and options admit no scenario.",
        why=(
            "Of no scenario everything can be said, that the plan is safe as well as that it is "
            "not. So nothing is said."
        ),
        fix="drop or correct one of the assumptions",
        bad=plan(go(1.0, 1.0), go(1.0, 1.0)),
        good=plan(go(1.0, 1.0), go(2.0, 2.0)),
        options=("--consistent", "--assume", "line 2 succeeds and line 3 fails"),
    ),
    Rule(
        code="GP903",
        name="internal-error",
        severity=Severity.ERROR,
        summary="gpsfsm contradicts itself or its check failed, so there is no verdict.",
        why=(
            "Every answer is checked in a second way: by another procedure, or by replaying the "
            "scenario. Here the two do not agree, or the check itself failed: there was an "
            "unexpected error, or the process of the check was killed. Nothing is known of the "
            "plan then, so it must not be dispatched. Contradictions and unexpected errors are "
            "defects of gpsfsm, not of the plan."
        ),
        fix="please report it, with the plan and the options",
        bad="",
        good=plan(go(1.0, 1.0), go(2.0, 2.0)),
    ),
    Rule(
        code="GP904",
        name="inconclusive",
        severity=Severity.ERROR,
        summary=(
            "A limit was hit, or the time or the memory was too short, before all was answered."
        ),
        why=(
            "What is undecided is not safe. Unknown is an answer of its own, and a gate refuses it."
        ),
        fix=(
            "raise the limit that the message names (--rlimit and --total-rlimit for steps, "
            "--time-limit for time), or split the plan"
        ),
        bad=plan(go(1.0, 1.0), go(1.0, 1.0), go(2.0, 2.0)),
        good=plan(go(1.0, 1.0), go(2.0, 2.0)),
        options=("--consistent", "--rlimit", "1"),
    ),
    Rule(
        code="GP905",
        name="unused-suppression",
        severity=Severity.WARNING,
        summary="A suppression comment suppresses nothing.",
        why=(
            "The finding is gone, the comment gives no reason, or it does not name single rules by "
            "their codes or names. A stale suppression hides the next real finding."
        ),
        fix="remove the comment, or name the rule in it and say why it does not matter",
        bad="<Plan>\n    <!-- gpsfsm: ignore GP303 because I say so -->\n"
        + plan(go(1.0, 1.0)).removeprefix("<Plan>\n"),
        good="<Plan>\n    <!-- gpsfsm: ignore GP302 because an operator is there -->\n"
        + plan(go(1.0, 1.0)).removeprefix("<Plan>\n"),
    ),
    Rule(
        code="GP906",
        name="assumption-matches-nothing",
        severity=Severity.INFO,
        summary="An assumption matches no runner of this plan.",
        why=(
            "It restricts nothing here. That is fine when many plans are checked with one "
            "assumption, and a misspelt interface when it is meant for this plan."
        ),
        fix="check the spelling of the interface and its parameters",
        bad=plan(go(1.0, 1.0), go(2.0, 2.0)),
        good=plan(go(1.0, 1.0)).replace("WaypointRunner", "SpeechRunner"),
        options=("--assume", "never fails: SpeechRunner"),
    ),
    Rule(
        code="GP907",
        name="unusable-assumption",
        severity=Severity.ERROR,
        summary="An assumption names a line or an element that the plan does not have.",
        why=(
            "An assumption about the wrong place would change the verdict without anybody noticing."
        ),
        fix="name a line that holds a runner, or select runners by interface and parameters",
        bad=plan(go(1.0, 1.0)),
        good=plan(go(1.0, 1.0), go(2.0, 2.0)),
        options=("--assume", "line 3 never fails"),
    ),
)
