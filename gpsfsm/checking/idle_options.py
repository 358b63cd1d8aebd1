"""Options that have no effect on an input: each is refused by name (GP908)."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.checking.option_table import BY_NAME, IDLE_ON, Group, group
from gpsfsm.model.story import PAPER_ENGINE

if TYPE_CHECKING:
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.syntax import Limits, Parsed

GRAPH = "<graph>"
"""The name of a graph in reports, also where it is handed over as a text."""
_LIMITS = group(Group.LIMIT)


class Idle(NamedTuple):
    """An option without effect on an input."""

    option: str
    message: str


def idle_options(
    parsed: Parsed,
    analysis: AnalysisOptions,
    limits: Limits,
    *,
    task: bool,
    engine: str,
    from_response: bool,
) -> tuple[Idle, ...]:
    """The options that are set and have no effect on an input, by its kind."""
    kind = _kind(parsed)
    set_ = {
        "task": task,
        "engine": engine != PAPER_ENGINE,
        "deadline": analysis.deadline_s is not None,
        "energy_limit": analysis.energy_limit_j is not None,
        "faults": "no-start" in analysis.faults,
        "from_response": from_response,
        "solver": analysis.solver != "auto",
        **{each.name: getattr(limits, each.name) != each.effective for each in _LIMITS},
    }
    flags = {name: each.flag for name, each in BY_NAME.items()}
    flags |= {"task": "--task", "faults": "--faults no-start"}
    return tuple(
        Idle(name, f"{flags[name]} has no effect on a {kind}: {why}")
        for name, why in IDLE_ON.get(kind, {}).items()
        if set_[name]
    )


def _kind(parsed: Parsed) -> str:
    """The kind of an input, as ``IDLE_ON`` has it; "plan" for a plan."""
    from gpsfsm.compile import MachinePlan

    if parsed.trees:
        more = " that is no plan" if isinstance(parsed.plan, MachinePlan) else ""
        return f"behaviour tree{more}"
    if not parsed.machine:
        return "plan"
    if parsed.file == GRAPH:
        return "graph"
    begin = parsed.text.lstrip("\ufeff \t\r\n")[:1]
    if begin != "<":
        return f"machine in {'JSON' if begin == '{' else 'Python'}"
    return f"machine in {'GraphML' if '<graphml' in parsed.text else 'XML'}"
