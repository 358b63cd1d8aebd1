"""What the tests of the analyses share: from an abstract plan to verdicts."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.constraints import constraints_of
from gpsfsm.analysis.decide import Decided, decide
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.compile import compile_plan
from gpsfsm.syntax import parse
from tests.oracle import P, to_xml

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence

    from gpsfsm.analysis.options import SolverChoice
    from gpsfsm.model.plan import Plan
    from gpsfsm.model.report import Facts


def plan_of(whole: P | str) -> Plan:
    """The plan tree, through the real front end."""
    parsed = parse(whole if isinstance(whole, str) else to_xml(whole))
    assert parsed.plan is not None, parsed.problems
    return parsed.plan


def decided(
    whole: P | str,
    *,
    faults: Collection[str] = (),
    consistent: bool = False,
    assumptions: Sequence[str] = (),
    solver: SolverChoice = "auto",
    **more: Any,
) -> Decided:
    """The verdicts on a plan."""
    plan = plan_of(whole)
    constraints = constraints_of(
        plan, faults=faults, consistent=consistent, assumptions=assumptions
    )
    options = AnalysisOptions(
        faults=tuple(sorted(faults)),
        consistent=consistent,
        assumptions=tuple(assumptions),
        solver=solver,
        **more,
    )
    return decide(compile_plan(plan, start_chain=constraints.no_start), constraints, options)


def facts_as_dict(facts: Facts | None) -> dict[str, Any] | None:
    """Facts in the form of the JSON contract."""
    if facts is None:
        return None
    fields = asdict(facts)
    assert fields.pop("engine") is fields.pop("machine") is None
    assert fields.pop("precision") == {}, "plans are read exactly"
    for name in ("completes", "gives_up", "stuck"):
        fields[name] = str(fields[name])
    for name in ("unreachable", "orphans", "join_deadlocks"):
        fields[name] = list(fields[name])
    assert not fields.pop("swallowed"), "these runners achieve nothing, so no goal is missed"
    fields["dangling"] = [{**event, "event": str(event["event"])} for event in fields["dangling"]]
    return fields
