"""The check of a machine, where it differs from that of a plan (semantics, section 9).

A machine whose scenario fixes its run is decided by z3 (``order_free``), and by exploring its
configurations if they are few. Others are explored, and z3 proves that nothing was missed
(``proof``). Few configurations are explored by the definitions of the options as well (``plain``).
Where two ways have an answer, it is the same or gpsfsm has a defect.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import islice
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.definitions import Definitions
from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.machines.decide import Answers, Judge
from gpsfsm.analysis.machines.findings import (
    Findings,
    TreeFindings,
    answers_for_tree,
    facts_of,
)
from gpsfsm.analysis.machines.order_free import OrderFree, is_order_free
from gpsfsm.analysis.machines.plain import Plain
from gpsfsm.analysis.machines.search import MAX_CONFIGURATIONS, Exploration
from gpsfsm.analysis.options import DEFAULT_RLIMIT, SECOND_OPINION, InconclusiveError
from gpsfsm.compile.units import MachinePlan, TreeMachine
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import NodeKind, Tie
from gpsfsm.model.capability import OWN
from gpsfsm.model.report import By, Frequency, Proof
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    from gpsfsm.analysis.constraints import Constraints
    from gpsfsm.analysis.machines.proof import Formulas
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.compile import Compiled
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.event import Outcome
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import Facts

ANALYSES = (
    "completion",
    "stuck",
    "endless",
    "reachability",
    "loops",
    "dangling",
    "joins",
    "orphans",
    "fewest_failures",
)
"""The analyses of a machine, as ``DecidedMachine.decided_by`` names them."""

ALSO_EXPLORED = 500
"""Configurations up to which answers are held against the definitions of the options as well."""


MAX_PROVED = 2_000
"""Configurations up to which z3 proves that an exploration is complete."""


_LEAST_CHARACTERS = 3
"""Characters of a component of a configuration in z3's table, at least."""


class DecidedMachine(NamedTuple):
    """The facts and findings; or, without them, the reason why nothing was decided.

    ``decided_by``: per analysis ``z3``, or ``search`` where the exploration alone decided it;
    ``unproved`` is the limit that kept z3 from it. ``contradictory``: no scenario is left.
    ``too_large``: the runs reach too many configurations.
    """

    facts: Facts | None
    findings: tuple[Finding, ...] = ()
    reason: str = ""
    hint: str = ""
    decided_by: Mapping[str, str] = MappingProxyType({})
    unproved: str = ""
    contradictory: bool = False
    too_large: bool = False

    @property
    def proof(self) -> Proof:
        """The procedures on which the facts rest."""
        decided_by = {name: By(each) for name, each in self.decided_by.items()}
        searched = (name for name, by in decided_by.items() if by is By.SEARCH)
        return Proof(decided_by, dict.fromkeys(searched, self.unproved))


def decide_machine(
    compiled: Compiled, constraints: Constraints, options: AnalysisOptions
) -> DecidedMachine:
    """Decide everything about a machine. Raises InternalError if two ways disagree."""
    tree = compiled.automaton.plan.vocabulary is Vocabulary.TREE
    free = not tree and is_order_free(compiled.automaton)
    if constraints.no_start:
        reason = "a machine cannot be decided under --faults no-start"
        return DecidedMachine(None, reason=reason, hint="check it without that")
    if free:
        decided = _by_scenarios(compiled, constraints, options)
        if decided is not None:
            return decided
    allowed, ties = tied(compiled.automaton, constraints)
    for refused, name in (
        (ties and constraints.hang, "--consistent together with runners that may hang"),
        (constraints.formulas, "assumptions that tie runners together"),
    ):
        if refused:
            reason = f"a machine whose runs depend on the order cannot be decided under {name}"
            return DecidedMachine(None, reason=reason, hint="check it without that")
    plain = Plain(compiled.automaton, Definitions(compiled, options))
    if not all(allowed):
        return _contradictory(plain)
    try:
        exploration = Exploration(compiled.automaton, allowed, ties=ties, limit=MAX_CONFIGURATIONS)
        answers = Judge(exploration, inexact_nodes(compiled.automaton)).facts()
    except InconclusiveError:
        reason = f"the runs of the machine reach more than {MAX_CONFIGURATIONS:,} configurations"
        hint = "check its parts as machines of their own"
        return DecidedMachine(None, reason=reason, hint=hint, too_large=True)
    _by_definition(answers, plain)
    unproved = _proof(exploration, answers, options)
    return _reported(answers, plain, options, unproved)


def inexact_nodes(automaton: Automaton) -> frozenset[int]:
    """The nodes of a machine that stand for constructs which were over-approximated."""
    plan = automaton.plan
    return plan.inexact if isinstance(plan, MachinePlan) else frozenset()


def tied(
    automaton: Automaton, constraints: Constraints
) -> tuple[tuple[frozenset[Outcome], ...], list[Tie]]:
    """The ties of a machine under ``--consistent``, and the outcomes that they leave.

    Equal actions have equal outcomes, at every visit. The conditions of a behaviour tree on its
    blackboard are no actions: two that ask the same have one answer until what they ask for may
    have been written.
    """
    allowed = list(constraints.allowed)
    ties: list[Tie] = []
    if not constraints.consistent:
        return tuple(allowed), ties
    plan = automaton.plan
    conditions = plan.ties if isinstance(plan, TreeMachine) else ()
    others = {number for tie in conditions for number in tie.runners}
    inexact = inexact_nodes(automaton)
    actions: dict[object, list[int]] = {}
    for number, runner in enumerate(plan.runners):
        own = runner.interface in OWN and (
            isinstance(plan, TreeMachine) or automaton.runner_node(number) in inexact
        )
        if not own and number not in others:
            actions.setdefault(runner.action, []).append(number)
    again = _visited_again(automaton)
    for members in actions.values():
        outcomes = frozenset.intersection(*(allowed[number] for number in members))
        for number in members:
            allowed[number] = outcomes
        if len(members) > 1 or members[0] in again:
            ties.append(Tie(tuple(members)))
    # An assumption about one condition alone says nothing of those that came before.
    ties += (
        tie
        for tie in conditions
        if len({allowed[number] for number in tie.runners}) == 1
        and (len(tie.runners) > 1 or tie.runners[0] in again)
    )
    return tuple(allowed), ties


def _visited_again(automaton: Automaton) -> frozenset[int]:
    """The runners that may have several visits in a run.

    Without a cycle of triggers, an event comes as often as its source is triggered. So a runner has
    several visits if it is on a cycle, if several events trigger it, or if what triggers it comes
    several times. A join whose inputs come once fires once, unless something makes it forget them.
    """
    import networkx

    graph: networkx.DiGraph[int] = networkx.DiGraph()
    graph.add_nodes_from(range(len(automaton.nodes)))
    graph.add_edges_from((source, target) for source, _, target in automaton.edges)
    begins, forgetful = set(automaton.starts), {target for _, _, target in automaton.stops}
    often: set[int] = set()
    for members in networkx.strongly_connected_components(graph):
        first = min(members)
        if len(members) > 1 or graph.has_edge(first, first):
            often |= members
    for node in automaton.nodes:
        # All start nodes emit at one instant.
        triggers = {
            (-1 if each.node in begins else each.node, each.event)
            for each in automaton.inputs[node.index]
        }
        if len(triggers) > 1 and (node.kind is NodeKind.RUNNER or node.index in forgetful):
            often.add(node.index)
    graph.add_edges_from((-1, number) for number in often)
    often = networkx.descendants(graph, -1) if often else often
    return frozenset(
        number for number in range(len(automaton.runners)) if automaton.runner_node(number) in often
    )


def _proof(exploration: Exploration, answers: Answers, options: AnalysisOptions) -> str:
    """Have z3 prove that nothing was missed; the limit that kept it from that, or nothing."""
    if exploration.reached > MAX_PROVED:
        return f"{MAX_PROVED:,} configurations"
    from gpsfsm.analysis.machines.proof import Completeness, Formulas
    from gpsfsm.analysis.solver import PER_CHARACTER

    # The search has decided already. Only a limit above the default buys more than an opinion.
    raised = options.rlimit > DEFAULT_RLIMIT
    rlimit = options.rlimit
    if not raised:
        rlimit = min(options.rlimit, options.total_rlimit, SECOND_OPINION)
    components = len(exploration.automaton.runners) + len(exploration.instants.inputs)
    if PER_CHARACTER * _LEAST_CHARACTERS * components * exploration.reached > rlimit:
        return "--rlimit"  # the table alone would be too long
    ties = exploration.instants.ties
    formulas = Formulas(exploration.automaton, exploration.allowed_outcomes, ties)
    try:
        Completeness(exploration, formulas).require(never(answers, formulas), rlimit=rlimit)
    except InconclusiveError:
        return "--rlimit"
    return ""


def never(answers: Answers, formulas: Formulas) -> Iterator[str]:
    """Terms for what no run does, according to the answers."""
    ends = (
        "completed",
        "gave_up",
        conjunction((formulas.still, "(not completed)", "(not gave_up)")),
    )
    for end, how in zip(ends, (answers.completes, answers.gives_up, answers.stuck), strict=True):
        if how is Frequency.NEVER:
            yield end
    for number in answers.unreachable:
        yield from (name for name in (f"a{number}", f"h{number}") if name in formulas.names)


def _by_scenarios(
    compiled: Compiled, constraints: Constraints, options: AnalysisOptions
) -> DecidedMachine | None:
    """The answers of z3 without any order; None where the order decides, or at a limit."""
    try:
        decider = OrderFree(compiled, constraints, options)
        plain = Plain(compiled.automaton, Definitions(compiled, options), by_scenario=True)
        if decider.contradictory:
            return _contradictory(plain)
        answers = decider.answers()
    except InconclusiveError:
        return None
    if answers is None:
        return None
    if not inexact_nodes(compiled.automaton):
        return _reported(_by_definition(answers, plain), plain, options)
    answers = _by_definition(answers.without_exact_runs(), plain, MAX_CONFIGURATIONS)
    return _reported(answers, plain, options)


def _contradictory(plain: Plain) -> DecidedMachine:
    """The answer where no scenario is left. InternalError if the definitions leave some."""
    with suppress(InconclusiveError):
        if not plain.definitions.contradictory():
            raise InternalError("options that are said to contradict each other do not")
    return DecidedMachine(None, contradictory=True)


def _by_definition(answers: Answers, plain: Plain, limit: int = ALSO_EXPLORED) -> Answers:
    """The same answers with the shortest runs, exact ones first; as they are over ``limit``.

    InternalError if they are others.
    """
    try:
        # It looks for exact runs, and at what other outcomes lead to.
        second = Judge(_explored(plain, limit), inexact_nodes(plain.automaton)).facts()
    except InconclusiveError:
        return answers
    require_agreement(answers, second)
    return second


def _explored(plain: Plain, limit: int = ALSO_EXPLORED) -> Exploration:
    """The exploration by the definitions of the options."""
    if plain.definitions.contradictory():
        raise InternalError("options that contradict each other are said to leave scenarios")
    outcomes = plain.definitions.outcomes
    return Exploration(plain.automaton, outcomes, limit=limit, stepper=plain)


def require_agreement(answers: Answers, second: Answers) -> None:
    """Raise InternalError where two ways to decide differ in more than the runs they show."""
    one, other = _without_runs(answers), _without_runs(second)
    traps = [any(loop.trap for loop in each.loops) for each in (answers, second)]
    if one != other or traps[0] is not traps[1]:
        raise InternalError(
            f"two ways to decide disagree about this machine: {one}, trap {traps[0]}, and {other}, "
            f"trap {traps[1]}"
        )


def _without_runs(answers: Answers) -> Answers:
    return replace(
        answers,
        loops=(),
        dangling=tuple(replace(each, shown=None) for each in answers.dangling),
        waiting=tuple(replace(each, shown=(), loop=()) for each in answers.waiting),
        orphans=tuple((number, ()) for number, _ in answers.orphans),
        shown={},
        configurations=0,
        with_fewest=(),
        may=frozenset(),
    )


def _reported(
    answers: Answers, plain: Plain, options: AnalysisOptions, unproved: str = ""
) -> DecidedMachine:
    kind, automaton = Findings, plain.automaton
    if automaton.plan.vocabulary is Vocabulary.TREE:
        kind, answers = TreeFindings, answers_for_tree(answers, automaton)
    findings = kind(answers, plain, options.max_scenarios, options.tolerate).all()
    return DecidedMachine(
        facts_of(answers, automaton),
        tuple(findings),
        decided_by=dict.fromkeys(ANALYSES, "search" if unproved else "z3"),
        unproved=unproved,
    )


def overlap_findings(
    compiled: Compiled, constraints: Constraints, options: AnalysisOptions
) -> Iterable[Finding]:
    """The findings about runners that hold one resource at once.

    Raises InconclusiveError if the runs reach too many configurations for that, and InternalError
    if two ways to decide disagree.
    """
    from gpsfsm.analysis.machines.overlaps import MOST, held_twice, weighed_overlaps

    shared = held_twice(compiled.bindings)
    if not shared:
        return ()
    inexact = inexact_nodes(compiled.automaton)
    tree = compiled.automaton.plan.vocabulary is Vocabulary.TREE
    related = bool(constraints.formulas or constraints.groups)
    by_scenario = related and not tree and is_order_free(compiled.automaton)
    if by_scenario:
        decider = OrderFree(compiled, constraints, options)
        rows = islice(decider.overlaps(shared), MOST)
        overlaps = tuple(each._replace(sure=not inexact) for each in rows)
    else:
        allowed, ties = tied(compiled.automaton, constraints)
        exploration = Exploration(compiled.automaton, allowed, ties=ties)
        overlaps = weighed_overlaps(exploration, compiled.bindings, inexact)
    plain = Plain(compiled.automaton, Definitions(compiled, options), by_scenario=by_scenario)
    with suppress(InconclusiveError):
        second = weighed_overlaps(_explored(plain), compiled.bindings, inexact)
        if [each[:3] for each in second] != [each[:3] for each in overlaps]:
            raise InternalError(f"two ways to decide disagree: {overlaps} and {second}")
        overlaps = second  # whose runs are the shortest ones
    return list(Findings(None, plain, options.max_scenarios).of_overlaps(overlaps))


def findings_of_runners(
    compiled: Compiled,
    capabilities: Capabilities,
    options: AnalysisOptions,
    decided: DecidedMachine,
) -> Iterable[Finding]:
    """The findings of the rules that look at one runner alone."""
    from gpsfsm.analysis.machines.runners import RunnersContext, runner_findings

    reached = None
    if decided.facts is not None:
        plan, unreachable = compiled.automaton.plan, set(decided.facts.unreachable)
        reached = frozenset(
            number
            for number, runner in enumerate(plan.runners)
            if plan.path(runner) not in unreachable
        )
    return runner_findings(RunnersContext(compiled, capabilities, options, reached))
