"""The declarations of all readers: which constructs they take over exactly, and which not.

What a reader says of a file (``model/precision.py``) is covered by a row of its table; the tests
hold both against each other, and docs/generate.py writes the tables of the documentation. A
construct may have several rows, one for each reading that it can have.

    over Timeout, Cause.CLOCK      Approximation(Reading.OVER, "Timeout", line 4, Cause.CLOCK)
"""

from __future__ import annotations

from typing import Final

from gpsfsm.model.precision import EXACT, REFUSED, Cause, Construct, Reading


def _exact(names: str, about: str = "", how: str = "") -> Construct:
    return Construct(EXACT, tuple(names.split()), about, how)


def _over(names: str, about: str, how: str, *causes: Cause) -> Construct:
    return Construct(Reading.OVER, tuple(names.split()), about, how, causes)


def _skipped(names: str, about: str, how: str, *causes: Cause) -> Construct:
    return Construct(Reading.SKIPPED, tuple(names.split()), about, how, causes)


def _assumed(names: tuple[str, ...], about: str, how: str, *causes: Cause) -> Construct:
    return Construct(Reading.DEFAULTED, names, about, how, causes)


def _refused(names: str, about: str = "", how: str = "") -> Construct:
    return Construct(REFUSED, tuple(names.split()), about, how)


_SWITCHES: Final = "Switch2 Switch3 Switch4 Switch5 Switch6"
_CHECKS: Final = (
    "BlackboardCheckInt BlackboardCheckDouble BlackboardCheckString BlackboardCheckBool"
)
_LOOPS: Final = "LoopInt LoopBool LoopDouble LoopString"
_ROUNDS: Final = "RetryUntilSuccessful RetryUntilSuccesful Repeat RecoveryNode"
_MEMORY: Final = "SequenceWithMemory SequenceStar PersistentSequence FallbackStar"
_SCRIPTS: Final = "_onSuccess _onFailure _post _onHalted"
_CONDITIONS: Final = "_skipIf _failureIf _successIf _while"

TREE: Final = (
    _exact("Sequence Fallback AsyncSequence AsyncFallback", how="one child after the other"),
    _exact(
        "Inverter ForceSuccess ForceFailure AlwaysSuccess AlwaysFailure", how="as their names say"
    ),
    _exact(
        "Sleep WasEntryUpdated",
        "and every other leaf: actions, conditions, custom nodes without children",
        "a runner instance, which succeeds or fails; one that never fails, such as Sleep, needs an "
        "assumption",
    ),
    _exact("IfThenElse", how="the second or the third child after the first"),
    _over(
        "IfThenElse",
        "of two children that is entered again, if the first one is more than conditions",
        "the first child runs, or fails as before",
        Cause.HISTORY,
    ),
    _exact(
        "SubTree SubTreePlus",
        how="the tree with that ID, inserted, with its ports replaced",
    ),
    _exact("include", how="the trees of the other file, too"),
    _exact(
        "Parallel ParallelAll",
        how="a join of the successes, and one of the failures, that end it; a ParallelAll waits "
        "until all its children have ended. In the automaton of a plan, halted children continue",
    ),
    _over(
        "Parallel ParallelAll",
        "with a child that can be skipped",
        "the child is entered later, or stays skipped",
        Cause.VALUE,
    ),
    _over(
        "Parallel ParallelAll",
        "with a number on the blackboard",
        "as a custom node with children",
        Cause.UNKNOWN_NODE,
    ),
    _exact(
        _ROUNDS,
        "of up to 8 rounds and 300 nodes; without a bound, except for a RecoveryNode",
        "written out; a loop without a bound",
    ),
    _over(
        _ROUNDS,
        "with more rounds, or with a number on the blackboard",
        "a loop with a choice after each round",
        Cause.ROUNDS,
    ),
    _exact("KeepRunningUntilFailure", how="a loop"),
    _exact(
        "ReactiveSequence ReactiveFallback WhileDoElse",
        "if only conditions are asked again",
        "the conditions watch, and halt the running child",
    ),
    _over(
        "ReactiveSequence ReactiveFallback WhileDoElse",
        "if another node is asked again",
        "it runs again at any time, or answers as before",
        Cause.ORDER,
        Cause.HISTORY,
    ),
    _over(
        "ReactiveSequence ReactiveFallback",
        "with a child that can be skipped",
        "all children are skipped, or not",
        Cause.VALUE,
    ),
    _exact(_MEMORY, "that is entered once", "one child after the other"),
    _over(_MEMORY, "that is entered again", "it begins at any child", Cause.HISTORY, Cause.VALUE),
    _exact("RoundRobin", 'with `wrap_around="true"` that is entered once', "as a Fallback"),
    _over(
        "RoundRobin",
        "without `wrap_around` or entered again",
        "a success may count as a failure, as since December 2025; it begins at any child",
        Cause.VERSION,
        Cause.HISTORY,
    ),
    _over(
        f"{_SWITCHES} {_CHECKS} {_LOOPS} Precondition EntryUpdated SkipUnlessUpdated "
        f"WaitValueUpdate {_CONDITIONS}",
        "",
        "a choice",
        Cause.VALUE,
    ),
    _over(
        f"Precondition {_CHECKS} {_LOOPS}",
        "whose `else`, `return_on_mismatch` or `if_empty` names no status",
        "a failure, or an exception, which ends the tree as a failure",
        Cause.THROWS,
    ),
    _over(
        "Timeout",
        "",
        "a choice that is open while the child runs; if it holds, the child is halted",
        Cause.CLOCK,
    ),
    _exact("Delay", how="its child, a moment later"),
    _exact("RunOnce SingleTrigger", "that is entered once", "its child"),
    _over(
        "RunOnce SingleTrigger",
        "that is entered again",
        "its child, or what it returns after that",
        Cause.HISTORY,
    ),
    _exact(
        "TryCatch",
        how="the last child after a failure of another one, and then a failure",
    ),
    _over(
        "TryCatch",
        "with `catch_on_halt`",
        "as without it; the last child is inexact",
        Cause.HISTORY,
    ),
    _over(
        "PipelineSequence NonblockingSequence",
        "",
        "earlier children run again while later ones run, independently of each other",
        Cause.ORDER,
    ),
    _exact(
        "RateController DistanceController SpeedController GoalUpdatedController GoalUpdater",
        how="their child; what they wait for is assumed to happen",
    ),
    _over(
        "PathLongerOnApproach",
        "",
        "its child, or a success, also while the child runs",
        Cause.VALUE,
    ),
    _over("ManualSelector", "", "a choice among its children", Cause.VALUE),
    _exact("UnsetBlackboard", how="a success at once"),
    _exact("SetBlackboard", "with a text", "a success at once"),
    _over(
        "SetBlackboard",
        "with an entry of the blackboard",
        "a success, a failure if the entry is empty, or an exception if there is none",
        Cause.THROWS,
        Cause.VALUE,
    ),
    _exact(
        f"Script ScriptCondition {_SCRIPTS}",
        "with a script that only assigns literals by `:=` to keys of one type",
        "a success at once; a ScriptCondition is a leaf",
    ),
    _over(
        f"Script ScriptCondition Precondition {_SCRIPTS} {_CONDITIONS}",
        "with any other script",
        "it is evaluated, or throws an exception, which ends the tree as a failure",
        Cause.THROWS,
    ),
    _over(
        "",
        "a custom node with children, Nav2's PauseResumeController",
        "any child, one after the other, any number of times; any result at any time",
        Cause.UNKNOWN_NODE,
    ),
    _skipped(
        "",
        "attributes, elements and text that BehaviorTree.CPP does not read",
        "",
        Cause.NO_MEANING,
    ),
    _skipped("", "a port of a node of Nav2 that gpsfsm does not know", "", Cause.VERSION),
    _refused(
        "",
        "a DOCTYPE; a file or tree that is missing; wrong numbers of children; malformed numbers",
        "with the rule that applies",
    ),
)

SCXML: Final = (
    _exact(
        "state",
        "without states in it",
        "a runner, until one of its events comes; its id is the interface, unless "
        "`gpsfsm:interface`, `gpsfsm:provider` and `gpsfsm:parameters` say otherwise",
    ),
    _exact("state initial", "with states in it", "its states"),
    _exact(
        "parallel",
        how="its regions start together; `done.state` occurs when each is in a final state",
    ),
    _over(
        "parallel",
        "with a `parallel` or with transitions in its regions",
        "a region may leave its final state, so a choice decides whether all are done",
        Cause.ORDER,
    ),
    _exact("final", how="ends the run, or leads to `done.state` of the state around it"),
    _exact(
        "transition",
        "with an event that takes no other transition at the same time",
        "the event comes, now, later or never (`nav` also means `nav.failed`, and `*` all events); "
        "what is left is stopped, and the states around each target are entered with all regions",
    ),
    _over(
        "event",
        "that may take another transition, too",
        "which of them is taken is open",
        Cause.ORDER,
    ),
    _over(
        "event",
        "that the machine itself may send, or that only it sends",
        "it comes now, later or never",
        Cause.EVENTS,
    ),
    _exact("transition", "without event, if nothing else can happen", "it is taken at once"),
    _over(
        "",
        "a transition without event, beside other regions or below other transitions",
        "it is taken a moment later",
        Cause.ORDER,
    ),
    _over("cond", "", "a choice", Cause.VALUE),
    _exact(
        "cond",
        "`true` or `True` in its data model, `In()` where all active states are known",
        "as it says",
    ),
    _exact(
        "raise",
        "and a `send` to `#_internal`, where all active states are known",
        "the macrostep is followed: transitions without event first, then the internal queue; "
        "a moment that passes is a tick, and a state that only passes is no runner",
    ),
    _over(
        "raise",
        "in regions, beside states that are not known",
        "its event comes now, later or never",
        Cause.EVENTS,
    ),
    _over(
        "send",
        "of an event that a transition waits for; of any, with `eventexpr`; inside or outside, "
        "with `targetexpr`",
        "the event comes now, later or never",
        Cause.EVENTS,
    ),
    _over(
        "if foreach",
        "around a `raise` that a transition waits for",
        "any events of the machine itself come, or none",
        Cause.EVENTS,
    ),
    _over(
        "assign script log send cancel data param content if foreach",
        "with an expression that may fail, if a transition waits for the error or for what is "
        "raised after it in the same block",
        "any events of the machine itself come, or none",
        Cause.EVENTS,
    ),
    _over(
        "history",
        "of up to 16 possibilities",
        "a choice of its default and all that may have been active; only the default, if nothing "
        "can have been",
        Cause.HISTORY,
    ),
    _over(
        "invoke",
        "",
        "any event comes now, later or never; what is inside is not looked at",
        Cause.INVOKED,
    ),
    _exact("done.state", "that only one state waits for", "its transition follows at once"),
    _over(
        "done.state",
        "that other states wait for, or that may come late",
        "it comes now, later or never",
        Cause.EVENTS,
        Cause.ORDER,
    ),
    _skipped(
        "data donedata assign script if foreach finalize param content",
        "that raise nothing",
        "conditions are choices anyway",
        Cause.DATA,
    ),
    _skipped("log cancel", "", "what is cancelled may come anyway", Cause.NO_MEANING),
    _skipped("", "attributes that SCXML does not have here", "", Cause.NO_MEANING),
    _skipped(
        "transition", "after an unconditional one for the same events", "", Cause.EARLIER
    ),
    _skipped("transition", "with a condition that is false, as it is written", "", Cause.FALSE),
    _skipped(
        "", "elements and attributes of other namespaces", "with all that is inside",
        Cause.NAMESPACE,
    ),
    _refused(
        "history",
        "of more than 16 possibilities; a deep one that a transition from deep within its state "
        "leads to",
        "what is left would have to be known",
    ),
    _refused(
        "",
        "other elements, or elements in a wrong place; targets that are never active together; "
        "circles of transitions without event in a region; more than 2,000 moments that pass; "
        "files that gpsfsm wrote and that were changed",
    ),
)  # fmt: skip

_BUILT: Final = (
    _skipped("", "other machines of the file", "", Cause.ANOTHER_MACHINE),
    _skipped(
        "remapping input_keys output_keys", "", "every outcome is possible anyway", Cause.NO_MEANING
    ),
    _assumed((), "`from … import *`", "", Cause.IMPORTS),
    _assumed(
        (),
        "a call of code that is not followed, in a constructor while a container is open",
        "",
        Cause.ADDS_NOTHING,
    ),
    _refused("", "names, transitions, outcomes or conditions that are computed"),
    _refused(
        "",
        "a state under a condition, in a loop or in a `try` statement, if only a run decides "
        "whether it is added",
    ),
    _refused(
        "",
        "a container that code of another file may change; private attributes, replaced methods, "
        "and callbacks that change the machine while it runs",
    ),
)
_FOLLOWED: Final = _exact(
    "",
    "functions, classes, loops, texts, lists and dictionaries of the same file",
    "followed, provided that all values are written in the file",
)
_COMBINATIONS: Final = "with more than 64 combinations of outcomes"
_ANY: Final = "any of its outcomes"

FLEXBE: Final = (
    _exact("OperatableStateMachine", how="its states; the first one starts, or the initial state"),
    _exact(
        "ConcurrencyContainer",
        how="the first condition that holds ends it and stops the others; without one, it is stuck",
    ),
    _over("", f"a `ConcurrencyContainer` {_COMBINATIONS}", _ANY, Cause.COMBINATIONS),
    _exact("PriorityContainer", "that nothing runs beside", "its states"),
    _over(
        "",
        "states of a `PriorityContainer` beside others",
        "the others do not wait",
        Cause.PRIORITY,
    ),
    _exact("", "states", "a runner that ends with any outcome of its transitions"),
    _over("use_behavior", "", "one state with the outcomes of its transitions", Cause.ELSEWHERE),
    _exact("", "an outcome `preempted` that a state declares", "ends the container, too"),
    _assumed(("preempted",), "of all other states", "", Cause.PREEMPTION),
    _skipped("autonomy", "", "every outcome is possible anyway", Cause.NO_MEANING),
    _FOLLOWED,
    *_BUILT,
)

SMACH: Final = (
    _exact("StateMachine", how="its states; the first one starts, or the initial state"),
    _exact("Sequence add_auto", how="the states, one after the other by connecting outcomes"),
    _exact("Concurrence", how="all children, then `outcome_map`, then `default_outcome`"),
    _over(
        "",
        "a `Concurrence` with `outcome_cb` or `child_termination_cb`",
        "any of its outcomes, after all children or after any child has ended",
        Cause.CODE,
    ),
    _over("", f"a `Concurrence` {_COMBINATIONS}", _ANY, Cause.COMBINATIONS),
    _over(
        "",
        "a `Concurrence` of which several rules hold",
        "the last rule, as in ROS 2, or the one with most criteria, as in ROS 1",
        Cause.VERSION,
    ),
    _exact(
        "SimpleActionState ServiceState MonitorState ConditionState",
        "and classes of the same file",
        "a runner that ends with one of the declared outcomes",
    ),
    _over(
        "",
        "states of classes in other files",
        "an outcome of the transitions, or any outcome of the container",
        Cause.UNDECLARED,
    ),
    _skipped("constants", "", "", Cause.NO_MEANING),
    _assumed(("request_preempt", "set_preempt_handler"), "", "", Cause.PREEMPTION),
    _FOLLOWED,
    _refused("Iterator", how="the number of repetitions is not read"),
    _refused(
        "child_termination_cb", "that may stop some of several children", "only a run decides which"
    ),
    *_BUILT,
)

YASMIN: Final = (
    _exact(
        "State",
        "that ends with an outcome of its transitions, or that an `Item` names",
        "a runner; module and class are its interface, `Param` its parameters",
    ),
    _over(
        "",
        'a `State` that ends otherwise, unless the file has `gpsfsm:complete="true"`',
        "any outcome of its machine, or the name of a state beside it",
        Cause.UNDECLARED,
    ),
    _exact("StateMachine Region", how="its states; without `start_state`, the first one starts"),
    _over(
        "",
        "a `StateMachine` with `file_path`, or with `file_name` and `package`",
        "one runner",
        Cause.ELSEWHERE,
    ),
    _exact(
        "Concurrence OrthogonalState OutcomeMap",
        how="a join for each combination of outcomes; an exception gives up if maps of different "
        "outcomes hold, or none and there is no default",
    ),
    _over(
        "",
        "an `Item` that names a `Concurrence` without default, which has ended without an outcome",
        "an exception, or the map does not hold",
        Cause.VERSION,
    ),
    _over(
        "",
        f"a `Concurrence` or `OrthogonalState` {_COMBINATIONS}",
        _ANY,
        Cause.COMBINATIONS,
    ),
    _exact("FinalOutcome Key Remap ParamRemap Text", how="no effect on what runs when"),
    _skipped("", "attributes and transitions that YASMIN does not read here", "", Cause.NO_MEANING),
    _skipped(
        "", "elements and attributes with a prefix", "with all that is inside", Cause.NAMESPACE
    ),
    _refused(
        "JoinState", "and other elements; what YASMIN refuses when it loads or validates the file"
    ),
)

LANGGRAPH: Final = (
    _exact("", "nodes", "a runner; one that raises ends the graph as a failure"),
    _exact(
        "",
        "the single edge behind a node, if it can belong to no join and no subgraph",
        "the drawing is followed; that it is not, is inexact",
    ),
    _over(
        "",
        "edges with `conditional`, several edges, and whatever the drawing leaves out",
        "the edges as drawn, or any nodes, or the end",
        Cause.DRAWING,
    ),
    _over("", "`defer`", "as without it", Cause.ORDER),
    _assumed((), "`__interrupt`", "", Cause.RESUMED),
    _assumed(("recursion_limit",), "of a graph with a loop", "", Cause.NO_LIMIT),
    _skipped("", "other keys", "", Cause.NO_MEANING),
    _refused("", "edges to missing nodes; two nodes of one name; no `__start__`"),
)

MACHINE: Final = (
    _exact("", "documented attributes of nodes and connections", "as they say"),
    _skipped("", "all other attributes and keys", "", Cause.NO_MEANING),
    _skipped("", "GraphML of other namespaces", "with all that is inside", Cause.NAMESPACE),
    _refused("", "a DOCTYPE; other elements of GraphML; values that are not documented"),
)

DECLARATIONS: Final = {
    "tree": TREE,
    "scxml": SCXML,
    "flexbe": FLEXBE,
    "smach": SMACH,
    "yasmin": YASMIN,
    "langgraph": LANGGRAPH,
    "machine": MACHINE,
}
"""By the names of the formats; ``machine`` for JSON, GraphML and graphs of networkx."""
