"""Random plans: structural pass, z3, brute force over all runs, and the executor on all runs.

Every run that the executor can take is compared with the run of the same scenario in the brute
force: how it ends and which instances it triggers.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any
from unittest.mock import patch

from hypothesis import strategies as st

from gpsfsm.analysis import decide
from gpsfsm.analysis.definitions import Definitions
from gpsfsm.execution.explore import explore
from gpsfsm.execution.records import Kind, Status
from tests import oracle
from tests.campaigns.base import Pair
from tests.execution.support import compiled_of, without_ends
from tests.strategies import constraints, faults, plans
from tests.support import decided, facts_as_dict

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hypothesis.strategies import DrawFn

    from gpsfsm.execution.explore import Run

LIMIT = 1_000_000
_ENDS = {"completes": "COMPLETED", "gives_up": "GAVE_UP", "stuck": "STUCK"}


def _decided(whole: oracle.P, **options: Any) -> dict[str, Any] | None:
    """The facts that need no durations: those of the brute force."""
    # The product's own judge by definitions looks at everything here.
    with patch.object(decide, "ALL_PLAYED", LIMIT), patch.object(Definitions, "plain", new=False):
        facts = facts_as_dict(decided(whole, **options).facts())
    if facts is not None:
        assert facts.pop("makespan") is None
        assert facts.pop("energy") is None
        facts.pop("loaded")
    return facts


def executed(whole: oracle.P, models: frozenset[str] = frozenset()) -> dict[str, Any]:
    """The facts that all runs of the executor show; each run is compared with the brute force."""
    compiled = compiled_of(whole, models)
    system = oracle.System(whole, models)
    seen: set[str] = set()
    active: set[int] = set()
    for run in explore(compiled, faults=models, orders=False, limit=LIMIT):
        status = run.status.value
        seen.add(status)
        if run.status is Status.COMPLETED:
            active.update(run.active)
        _compare(system, run, maximal=False)
    triggered: set[int] = set()
    for run in explore(without_ends(compiled), faults=models, orders=False, limit=LIMIT):
        triggered |= _compare(system, run, maximal=True)
    missed = set(range(len(system.paths))) - triggered
    return {
        **{name: _how_often(end, seen) for name, end in _ENDS.items()},
        "orphans": [system.paths[number] for number in sorted(active)],
        "unreachable": [system.paths[number] for number in sorted(missed)],
    }


def _how_often(end: str, seen: set[str]) -> str:
    return "never" if end not in seen else "always" if len(seen) == 1 else "sometimes"


def _compare(system: oracle.System, run: Run, *, maximal: bool) -> set[int]:
    """The instances that a run triggers, which must be those of the brute force.

    What had not come when the run ended is open: it is played as SUCCEEDED, which changes neither
    the end nor what was triggered before; only maximal runs trigger all that can be.
    """
    rest = oracle.SUCCEEDED if run.status is not Status.STUCK else oracle.HANG
    outcomes = [str(run.outcomes.get(n, rest)) for n in range(len(system.paths))]
    wanted = system.run(tuple(outcomes))
    triggered = {each.node - 1 for each in run.records if each.kind is Kind.TRIGGERED}
    expected = {n for n, path in enumerate(system.paths) if wanted.triggers(path)}
    if maximal:
        assert triggered == expected
    else:
        assert run.status.value == wanted.ends
        assert triggered <= expected
    return triggered


def judge(whole: oracle.P) -> Iterator[str]:
    """The four answers about free outcomes."""
    wanted = oracle.facts(whole)
    assert wanted is not None
    by_structure = _decided(whole, solver="structural")
    by_z3 = _decided(whole, solver="z3")
    assert by_structure == wanted, "the structural pass differs from brute force"
    assert by_z3 == wanted, "z3 differs from brute force"
    for name, frequency in executed(whole).items():
        assert frequency == wanted[name], f"the executor differs in {name}"
    yield f"{wanted['runners']} runners"
    yield f"completes {wanted['completes']}"
    yield from {f"join deadlock {each['effect']}" for each in wanted["join_deadlocks"]}
    yield from {f"dangling {each['effect']}" for each in wanted["dangling"]}
    if wanted["orphans"]:
        yield "orphans"
    if wanted["unreachable"]:
        yield "unreachable"


@st.composite
def _with_options(draw: DrawFn) -> tuple[oracle.P, frozenset[str], bool, oracle.Constraint | None]:
    whole = draw(plans(max_runners=5))
    models = draw(faults())
    constraint = None
    if oracle.runner_paths(whole) and draw(st.booleans()):
        constraint = draw(constraints(whole, faults=models))
    return whole, models, draw(st.booleans()), constraint


def judge_options(case: tuple[oracle.P, frozenset[str], bool, Any]) -> Iterator[str]:
    """The answers under fault models, consistency and assumptions."""
    whole, models, consistent, constraint = case
    wanted = oracle.facts(whole, faults=models, consistent=consistent, constraint=constraint)
    assumptions = [] if constraint is None else [str(constraint)]
    options = {"faults": models, "consistent": consistent, "assumptions": assumptions}
    assert _decided(whole, solver="z3", **options) == wanted, "z3 differs from brute force"
    assert _decided(whole, solver="auto", **options) == wanted, "auto differs from brute force"
    if constraint is None and not consistent and wanted is not None:
        for name, frequency in executed(whole, models).items():
            assert frequency == wanted[name], f"the executor differs in {name}"
        yield "executed"
    yield "contradictory" if wanted is None else f"stuck {wanted['stuck']}"


def _written(case: tuple[oracle.P, frozenset[str], bool, Any]) -> str:
    whole, models, consistent, constraint = case
    said = f"faults: {sorted(models)}, consistent: {consistent}, assume: {constraint}"
    return f"<!-- {said.replace('--', '- -')} -->\n{oracle.to_xml(whole)}"


PAIRS = [
    Pair(
        name="plans",
        about="random plans: structural pass, z3, brute force, executor",
        cases=lambda: plans(max_runners=6),
        judge=judge,
        text=oracle.to_xml,
        full=100_000,
        batch=50,
    ),
    Pair(
        name="options",
        about="random plans under fault models, consistency, assumptions: the same",
        cases=_with_options,
        judge=judge_options,
        text=_written,
    ),
]
