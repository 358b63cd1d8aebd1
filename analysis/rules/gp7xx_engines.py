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
            "The engines read plans with their own parser and check. A plan that they reject "
            "never runs: it gets no identifier, or it is listed as failed. The engine's own "
            "message follows 'engine message'. fabric-v3 also rejects plans whose runners lack a "
            "required input."
        ),
        fix="rewrite the plan for the engine with gpsfsm port, or change what the message names",
        bad=plan(go(1.0, 2.0)) + "That is all.\n",
        good=plan(go(1.0, 2.0)),
        options=("--engine", "fabric-v2"),
    ),
    Rule(
        code="GP702",
        name="crashes-engine",
        severity=Severity.ERROR,
        summary="The engine crashes while it reads the plan.",
        why=(
            "Some texts make the engine's server read data that does not exist. The whole process "
            "ends, and with it all plans in its queue."
        ),
        fix="rewrite the plan for the engine with gpsfsm port, or change what the message names",
        bad=plan(go(1.0, 2.0), control("sequential", "<!-- nothing to do -->")),
        good=plan(go(1.0, 2.0)),
        options=("--engine", "fabric-v2"),
    ),
    Rule(
        code="GP703",
        name="differs-on-engine",
        severity=Severity.ERROR,
        summary="The plan behaves differently on this engine than in the paper.",
        why=(
            "The published engines do not connect controls as the paper draws them, and they have "
            "no give-up. The robot then does not do what was checked, simulated and agreed on. "
            "The scenario is the first in which the difference shows. A plan that hangs where it "
            "should give up does not count as a difference, because the engine cannot give up."
        ),
        fix=(
            "rewrite the plan with gpsfsm port; on these engines, use only runners in sequence, "
            "each with at most one recovery of runners right after it"
        ),
        bad=plan(go(1.0, 2.0), control("parallel_all", look("Is the door open?"), say("Hello."))),
        good=plan(go(1.0, 2.0), control("recovery", go(0.0, 2.0)), say("Hello.")),
        options=("--engine", "fabric-v2"),
    ),
)
