"""The rules on engines that need only documentation (GP701 to GP703).

GP701 and GP702 are reported where a plan is read for the engine, GP703 where its behaviour on paper
and on the engine is compared (``checking/engine_check.py``).
"""

from __future__ import annotations

from gpsfsm.analysis.rules.base import Rule, control, go, look, plan, say
from gpsfsm.model.finding import Severity

RULES = (
    Rule(
        code="GP701",
        name="rejected-by-engine",
        severity=Severity.ERROR,
        summary="The engine does not accept the text of the plan.",
        why=(
            "The engines read plans with a parser and a check of their own. What they refuse is "
            "never run: the plan gets no identifier, or it stands as failed in the list. Behind "
            "'it says' stands the message that the engine itself gives. fabric-v3 also refuses "
            "plans whose runners lack a required input."
        ),
        fix="let gpsfsm port rewrite the plan for the engine, or change what the message names",
        bad=plan(go(1.0, 2.0)) + "That is all.\n",
        good=plan(go(1.0, 2.0)),
        options=("--engine", "fabric-v2"),
    ),
    Rule(
        code="GP702",
        name="crashes-engine",
        severity=Severity.ERROR,
        summary="The engine dies while it reads the plan.",
        why=(
            "Some texts lead the engine's server to read what is not there. The whole process "
            "ends, and with it all plans that wait in its queue."
        ),
        fix="let gpsfsm port rewrite the plan for the engine, or change what the message names",
        bad=plan(go(1.0, 2.0), control("sequential", "<!-- nothing to do -->")),
        good=plan(go(1.0, 2.0)),
        options=("--engine", "fabric-v2"),
    ),
    Rule(
        code="GP703",
        name="differs-on-engine",
        severity=Severity.ERROR,
        summary="The plan does something else on this engine than the paper says.",
        why=(
            "The published engines do not connect controls as the paper draws them, and they have "
            "no give-up. What was checked, simulated and agreed on is then not what the robot "
            "does. The scenario is the first in which the difference can be seen; that a plan "
            "hangs where it should give up is no difference of its own, since the engine knows no "
            "other way."
        ),
        fix=(
            "on these engines, let runners follow each other, each with at most one recovery of "
            "runners right behind it; gpsfsm port rewrites the plan so"
        ),
        bad=plan(go(1.0, 2.0), control("parallel_all", look("Is the door open?"), say("Hello."))),
        good=plan(go(1.0, 2.0), control("recovery", go(0.0, 2.0)), say("Hello.")),
        options=("--engine", "fabric-v2"),
    ),
)
