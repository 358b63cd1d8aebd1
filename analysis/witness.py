"""Scenarios that prove a counterfactual by being replayed.

To ask z3 whether something would have gone otherwise takes a second copy of the run in the
problem, for every runner. Mostly one scenario is proof enough, and the evaluator plays both runs.
Where none of the ``candidates`` convinces, the copy is asked for after all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.explain import explain
from gpsfsm.model.automaton import Automaton, NodeKind
from gpsfsm.model.event import Event, Outcome

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.analysis.claims import Claim
    from gpsfsm.analysis.solver import Solver

__all__ = ["Scenario", "candidates", "necessary", "plainest"]

Scenario = tuple[Outcome, ...]
"""All outcomes, by runner number."""


def necessary(automaton: Automaton, node: int) -> dict[int, Outcome]:
    """Outcomes, by runner number, without which the node is never triggered.

    Not all of them: joins of which one input is enough are not looked behind. FAILED stands for
    NO_START too.
    """
    found: dict[int, Outcome] = {}
    seen = {node}
    pending = [node]
    while pending:
        current = pending.pop()
        inputs = automaton.inputs[current]
        if (automaton.nodes[current].need or 1) < len(inputs):
            continue
        for source, event in inputs:
            if automaton.nodes[source].kind is NodeKind.RUNNER and event is not Event.STARTED:
                found[automaton.runner_number(source)] = Outcome(event.value)
            if source not in seen:
                seen.add(source)
                pending.append(source)
    return found


def plainest(solver: Solver, number: int, *others: tuple[int, Outcome]) -> Scenario | None:
    """The scenario in which nothing fails but what must, so that the instance is triggered.

    ``others`` are outcomes that are wanted besides. None if the constraints do not admit it.
    """
    wanted = necessary(solver.automaton, solver.automaton.runner_node(number)) | dict(others)
    size = len(solver.automaton.runners)
    plain = tuple(wanted.get(other, Outcome.SUCCEEDED) for other in range(size))
    return plain if solver.constraints.admit(plain) else None


def candidates(
    solver: Solver, claim: Claim, number: int, earlier: Iterable[Scenario]
) -> Iterator[Scenario]:
    """Scenarios in which the claim about a failure of this instance may hold.

    First the one in which nothing fails but what must, then ``earlier`` ones with this failure,
    then one that z3 finds for the claim, less the failures that do not matter; none if there is
    none. Raises Inconclusive at a limit.
    """
    plain = plainest(solver, number, (number, Outcome.FAILED))
    if plain is not None:
        yield plain
    for scenario in earlier:
        changed = (*scenario[:number], Outcome.FAILED, *scenario[number + 1 :])
        if solver.constraints.admit(changed):
            yield changed
    if not solver.must_check([solver.name(claim.term(solver))]):
        return
    found = solver.outcomes()
    reason = explain(
        claim, solver.evaluator, found.__getitem__, no_start=solver.constraints.no_start
    )
    decisive = set(reason.decisions)
    plain = tuple(
        outcome if other in decisive else Outcome.SUCCEEDED for other, outcome in enumerate(found)
    )
    if solver.constraints.admit(plain):
        yield plain
    yield found
