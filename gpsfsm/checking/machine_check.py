"""The check of a machine, where it differs from that of a plan (semantics, section 9).

A machine whose scenario fixes its run is decided by z3 (``order_free``), and by exploring its
configurations if they are few. Others are explored, and z3 proves that nothing was missed
(``proof``). Where two ways have an answer, it is the same or gpsfsm has a defect.
"""

from __future__ import annotations

from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.analysis.encode import conjunction
from gpsfsm.analysis.machines.decide import Answers, Judge
from gpsfsm.analysis.machines.findings import (
    Findings,
    TreeFindings,
    answers_for_tree,
    facts_of,
)
from gpsfsm.analysis.machines.order_free import OrderFree, is_order_free
from gpsfsm.analysis.machines.search import MAX_CONFIGURATIONS, Exploration
from gpsfsm.analysis.options import DEFAULT_RLIMIT, SECOND_OPINION, InconclusiveError
from gpsfsm.compile.units import TreeMachine
from gpsfsm.errors import InternalError
from gpsfsm.model.automaton import Tie
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
"""Configurations up to which a machine that z3 decides without an order is explored as well."""


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
    if not all(allowed):
        return DecidedMachine(None, contradictory=True)
    try:
        exploration = Exploration(compiled.automaton, allowed, ties=ties, limit=MAX_CONFIGURATIONS)
        answers = Judge(exploration).facts()
    except InconclusiveError:
        reason = f"the runs of the machine reach more than {MAX_CONFIGURATIONS:,} configurations"
        hint = "check its parts as machines of their own"
        return DecidedMachine(None, reason=reason, hint=hint, too_large=True)
    unproved = _proof(exploration, answers, options)
    return _reported(answers, compiled, options, unproved)


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
    actions: dict[object, list[int]] = {}
    for number, runner in enumerate(plan.runners):
        own = isinstance(plan, TreeMachine) and runner.interface in OWN
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
    """The runners that lead to themselves, by any events."""
    import networkx

    graph: networkx.DiGraph[int] = networkx.DiGraph()
    graph.add_edges_from((source, target) for source, _, target in automaton.edges)
    looping: set[int] = set()
    for members in networkx.strongly_connected_components(graph):
        first = min(members)
        if len(members) > 1 or graph.has_edge(first, first):
            looping |= members
    return frozenset(
        number
        for number in range(len(automaton.runners))
        if automaton.runner_node(number) in looping
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
        if decider.contradictory:
            return DecidedMachine(None, contradictory=True)
        answers = decider.answers()
    except InconclusiveError:
        return None
    if answers is None:
        return None
    if not constraints.groups and not constraints.formulas:
        try:
            exploration = Exploration(compiled.automaton, constraints.allowed, limit=ALSO_EXPLORED)
            second = Judge(exploration).facts()  # which looks at what other outcomes lead to, too
        except InconclusiveError:
            pass
        else:
            require_agreement(answers, second)
            answers = second  # whose runs are the shortest ones
    return _reported(answers, compiled, options)


def require_agreement(answers: Answers, second: Answers) -> None:
    """Raise InternalError where two ways to decide differ in more than the runs they show."""
    one, other = _without_runs(answers), _without_runs(second)
    if one != other:
        raise InternalError(f"z3 and the search disagree about this machine: {one} and {other}")


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
    )


def _reported(
    answers: Answers, compiled: Compiled, options: AnalysisOptions, unproved: str = ""
) -> DecidedMachine:
    kind = Findings
    if compiled.automaton.plan.vocabulary is Vocabulary.TREE:
        kind, answers = TreeFindings, answers_for_tree(answers, compiled.automaton)
    findings = kind(answers, compiled.automaton, options.max_scenarios, options.tolerate).all()
    return DecidedMachine(
        facts_of(answers, compiled.automaton),
        tuple(findings),
        decided_by=dict.fromkeys(ANALYSES, "search" if unproved else "z3"),
        unproved=unproved,
    )


def overlap_findings(
    compiled: Compiled, constraints: Constraints, options: AnalysisOptions
) -> Iterable[Finding]:
    """The findings about runners that hold one resource at once.

    Raises InconclusiveError if the runs reach too many configurations for that.
    """
    from gpsfsm.analysis.machines.overlaps import held_twice, overlaps_in

    if not held_twice(compiled.bindings):
        return ()
    allowed, ties = tied(compiled.automaton, constraints)
    exploration = Exploration(compiled.automaton, allowed, ties=ties)
    overlaps = overlaps_in(exploration, compiled.bindings)
    return Findings(None, compiled.automaton, options.max_scenarios).of_overlaps(overlaps)


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
