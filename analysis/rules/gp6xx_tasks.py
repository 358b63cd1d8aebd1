"""The rules on tasks (GP6xx): documentation of what the comparison with a task reports."""

from __future__ import annotations

from gpsfsm.analysis.rules.base import ROUNDS, ROUNDS_TASK, Rule, control, go, plan, say
from gpsfsm.model.finding import Severity

_TREE = """\
<root BTCPP_format="4" main_tree_to_execute="Main">
    <BehaviorTree ID="Main">
        {}
    </BehaviorTree>
</root>
"""

RULES = (
    Rule(
        code="GP601",
        name="missing-step",
        severity=Severity.ERROR,
        summary="A step of the task is missing: no runner of the plan does it.",
        why="The plan cannot do what it was asked to do, whatever happens.",
        fix="add a runner for the step, at its place in the order",
        bad=plan(*ROUNDS[:-1]),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP602",
        name="extra-action",
        severity=Severity.ERROR,
        summary="The plan does something that the task does not ask for.",
        why=(
            "The robot goes where nobody sent it. What the task is silent about is refused, "
            "unless it says 'others: allowed' or names the action below 'allow'."
        ),
        fix="remove the runner, or allow it in the task",
        bad=plan(*ROUNDS, go(0.0, 0.0)),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP603",
        name="repeated-action",
        severity=Severity.ERROR,
        summary="The plan does again what it has done already.",
        why=(
            "What was asked for once happens twice in some run: an alternative and its step, "
            "or a step copied by mistake."
        ),
        fix="remove one of the runners, or add a step to the task",
        bad=plan(*ROUNDS, go(4.0, 1.0)),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP604",
        name="misordered-action",
        severity=Severity.ERROR,
        summary="The plan does a step too early, or two steps at once.",
        why=(
            "The task gives an order. In some run, or in some order of events beside each "
            "other, the plan does not keep it."
        ),
        fix="put the runners into the order of the task, one after the other",
        bad=plan(
            go(6.5, 3.0),
            control("recovery", go(6.5, 5.0)),
            go(4.0, 1.0),
            go(0.5, 3.0),
        ),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP605",
        name="skipped-alternative",
        severity=Severity.ERROR,
        summary=("A step fails, and the plan does not try the alternative of the task."),
        why=(
            "The task says what to do when the step fails. The plan goes on without it, or "
            "gives up though there was something left to try."
        ),
        fix="guard the runner of the step with a recovery that holds the alternative",
        bad=plan(
            go(4.0, 1.0),
            go(6.5, 3.0),
            go(0.5, 3.0),
        ),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP606",
        name="wrong-alternative",
        severity=Severity.ERROR,
        summary=(
            "The plan tries another alternative than that of the task, or one that is not due."
        ),
        why=(
            "When the step fails, something else is done than what was asked for; or the "
            "alternative is done though the step has not failed."
        ),
        fix="put the alternative of the task, and nothing else, into the recovery of the step",
        bad=plan(
            go(4.0, 1.0),
            go(6.5, 3.0),
            control("recovery", go(9.0, 9.0)),
            go(0.5, 3.0),
        ),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP607",
        name="ends-too-early",
        severity=Severity.ERROR,
        summary="The plan completes or gives up though a step is due, or completes without a step.",
        why=(
            "The robot stops in the middle of its task, or reports a failure where everything is "
            "done, or success where a step and all its alternatives have failed."
        ),
        fix="let the plan go on to the next step",
        bad=plan(
            control(
                "parallel_any",
                control("sequential", *ROUNDS),
                say("On my way."),
            ),
        ),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP608",
        name="broken-rule",
        severity=Severity.ERROR,
        summary="A run of the plan breaks a rule of the task.",
        why=(
            "The rules of a task must hold in every run, whatever fails and in whatever order "
            "things happen."
        ),
        fix="change the plan so that the run in the scenario keeps the rule",
        bad=plan(say("Good evening."), *ROUNDS),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP609",
        name="example-returned",
        severity=Severity.ERROR,
        summary="The plan does what an example of the prompt does.",
        why=(
            "A language model that repeats the example it was shown has not answered. The "
            "task names such plans below 'not_answers'; behaviour is compared, not text."
        ),
        fix="ask again for a plan for this task",
        bad=plan(go(9.0, 9.0), say("I am here.")),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP610",
        name="misused-node",
        severity=Severity.ERROR,
        summary="A behaviour tree has a node of the task in another form.",
        why=(
            "The task says below 'nodes' how its nodes are written. With 'form: compact' an engine "
            "in which they are registered otherwise is not what was asked for."
        ),
        fix="write the node as the task has it",
        bad=_TREE.format('<Action ID="MoveTo" location="StationA"/>'),
        good=_TREE.format('<MoveTo location="StationA"/>'),
        options=("--task", "experiments/navigation/task1.yaml"),
    ),
)
