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
        why="Whatever happens, the plan cannot do what the task requires.",
        fix="add a runner for the step, at its place in the order",
        bad=plan(*ROUNDS[:-1]),
        good=plan(*ROUNDS),
        options=ROUNDS_TASK,
    ),
    Rule(
        code="GP602",
        name="extra-action",
        severity=Severity.ERROR,
        summary="The plan does something that the task does not contain.",
        why=(
            "The robot does something that nobody requested. Actions that the task does not "
            "mention are rejected unless the task declares 'others: allowed' or lists the action "
            "under 'allow'."
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
        summary="The plan repeats something that it has already done.",
        why=(
            "Something that the task requires once happens twice in some run, for example an "
            "alternative as well as its step, or a step that was copied by mistake."
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
            "The task defines an order. In some run, or in some order of concurrent events, the "
            "plan violates it."
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
        summary="A step fails, and the plan does not try the alternative of the task.",
        why=(
            "The task says what to do when the step fails. The plan continues without it, or "
            "gives up although an alternative was left."
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
            "The plan tries an alternative that the task does not name, or at the wrong time."
        ),
        why=(
            "When the step fails, the plan does something other than the task requires; or it "
            "tries the alternative although the step has not failed."
        ),
        fix="put the task's alternative, and nothing else, into the recovery of the step",
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
        summary="The plan ends while a step is still due, or completes without a step.",
        why=(
            "The robot stops in the middle of its task, reports a failure although everything is "
            "done, or reports success although a step and all its alternatives have failed."
        ),
        fix="let the plan continue with the next step",
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
        summary="The plan does the same as an example from the prompt.",
        why=(
            "A language model that repeats the example from its prompt has not solved the task. "
            "The task lists such plans under 'not_answers'; behaviour is compared, not text."
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
        summary="A behaviour tree writes a node in another form than the task.",
        why=(
            "The task defines under 'nodes' how its nodes are written. With "
            "'form: compact', `<Speak …/>` is correct and `<Action ID=\"Speak\" …/>` is an error."
        ),
        fix="write the node as the task does",
        bad=_TREE.format('<Action ID="MoveTo" location="StationA"/>'),
        good=_TREE.format('<MoveTo location="StationA"/>'),
        options=("--task", "experiments/navigation/task1.yaml"),
    ),
)
