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
            "Input that could not be read was not checked, and a plan that was not checked must "
            "not be dispatched."
        ),
        fix="pass the path of a readable plan, of a folder with plans, or - for standard input",
        bad="",
        good=plan(go(1.0, 1.0)),
    ),
    Rule(
        code="GP902",
        name="contradictory-assumptions",
        severity=Severity.ERROR,
        summary="The assumptions and options admit no scenario.",
        why=(
            "Without a scenario every statement holds, both that the plan is safe and that it is "
            "not. So gpsfsm reports neither."
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
            "scenario. Here the two disagree, or the check itself failed because of an unexpected "
            "error or because its process was killed. The plan has no verdict, so it must not be "
            "dispatched. Contradictions and unexpected errors are defects of gpsfsm, not of the "
            "plan."
        ),
        fix="please report this, with the plan and the options",
        bad="",
        good=plan(go(1.0, 1.0), go(2.0, 2.0)),
    ),
    Rule(
        code="GP904",
        name="inconclusive",
        severity=Severity.ERROR,
        summary="A limit, the time or the memory was exhausted before the plan was decided.",
        why=(
            "An undecided plan is not a safe plan. Unknown is a verdict of its own, and a gate "
            "rejects it."
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
            "The finding is gone, the comment gives no reason, or it does not name individual "
            "rules by code or name. A stale suppression hides the next real finding."
        ),
        fix="remove the comment, or name the rule in it and explain why it does not matter",
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
            "The assumption has no effect here. That is fine if you check many plans with the same "
            "assumption; if it is meant for this plan, the interface is probably misspelt."
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
        why="An assumption about the wrong place would silently change the verdict.",
        fix="name a line that contains a runner, or select runners by interface and parameters",
        bad=plan(go(1.0, 1.0)),
        good=plan(go(1.0, 1.0), go(2.0, 2.0)),
        options=("--assume", "line 3 never fails"),
    ),
    Rule(
        code="GP908",
        name="idle-option",
        severity=Severity.ERROR,
        summary="An option has no effect on the input.",
        why=(
            "Whoever sets an option asks for something. Where gpsfsm cannot do it for this kind of "
            "input, such as a behaviour tree on an original engine, an answer without it would "
            "answer another question. So the input is undecided."
        ),
        fix="leave the option out for this input",
        bad="",
        good=plan(go(1.0, 1.0)),
    ),
)
