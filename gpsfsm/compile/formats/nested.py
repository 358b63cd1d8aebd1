"""Plans and behaviour trees, written from the units of the other (semantics, 3.1).

A plan and a tree of BehaviorTree.CPP nest in the same way: what one calls a recovery is the second
child of a Fallback in the other. Each can say a little that the other cannot, which is refused.

    GUARD(A, B)      <Fallback><A/><B/></Fallback>      A, then a Control of type recovery with B
    NOT(A)           <Inverter><A/></Inverter>          no plan says that
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.sax.saxutils import quoteattr

from gpsfsm.compile.formats import CannotSayError, Format
from gpsfsm.compile.machines import written
from gpsfsm.compile.units import MachinePlan, TreePlan, UnitKind, Units, group_units
from gpsfsm.model.plan import NOT_PARAMETERS
from gpsfsm.model.tree import is_reference

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.plan import Element, Plan

_LOOPS = "it is a machine, with loops or nodes that halt others"
_CONTROLS = {
    UnitKind.SEQUENCE: "sequential",
    UnitKind.ALL: "parallel_all",
    UnitKind.ANY: "parallel_any",
}
_NODES = {
    UnitKind.SEQUENCE: ("Sequence", ""),
    UnitKind.GUARD: ("Fallback", ""),
    UnitKind.ALL: ("Parallel", ' success_count="-1" failure_count="1"'),
    UnitKind.ANY: ("Parallel", ' success_count="1" failure_count="-1"'),
    UnitKind.NOT: ("Inverter", ""),
    UnitKind.BRANCH: ("IfThenElse", ""),
}
_NOT_IN_PLANS = {
    UnitKind.NOT: "a plan cannot turn a success into a failure",
    UnitKind.COUNT: "a plan cannot wait for only some of several units",
    UnitKind.BRANCH: "a plan cannot choose between two units by an outcome",
    UnitKind.WAIT: "a plan cannot wait for all units regardless of their outcomes",
}


def write_plan(automaton: Automaton) -> str:
    """The plan that does the same, as XML. Raises CannotSayError."""
    return _written(automaton, "<Plan>", "</Plan>", _as_plan)


def write_tree(automaton: Automaton) -> str:
    """The behaviour tree that does the same, in the format of version 4. Raises CannotSayError."""
    begin = '<root BTCPP_format="4" main_tree_to_execute="Main">\n  <BehaviorTree ID="Main">'
    models = "\n".join(
        ["  <TreeNodesModel>", *_models(automaton.plan), "  </TreeNodesModel>", "</root>"]
    )
    return _written(automaton, begin, f"  </BehaviorTree>\n{models}", _as_tree)


_Lines = tuple[list[str], list[str]]
"""The lines before and behind the children of a unit."""


def _written(
    automaton: Automaton,
    begin: str,
    end: str,
    unit_lines: Callable[[Plan, Units, int], _Lines],
) -> str:
    plan = automaton.plan
    if isinstance(plan, MachinePlan):
        raise CannotSayError(plan.path(0), _LOOPS)
    units = group_units(plan)
    lines = [begin]
    depth = begin.count("\n") + 1
    pending: list[tuple[int, int, list[str] | None]] = [(0, depth, None)]
    while pending:
        unit, depth, behind = pending.pop()
        if behind is not None:
            first = depth + len(behind) - 1
            lines += ("  " * (first - number) + line for number, line in enumerate(behind))
            continue
        before, after = unit_lines(plan, units, unit)
        lines += ("  " * (depth + number) + line for number, line in enumerate(before))
        pending.append((unit, depth, after))
        inner = depth + len(before)
        pending += ((child, inner, None) for child in reversed(units.children[unit]))
    return "\n".join((*lines, end)) + "\n"


def _as_plan(plan: Plan, units: Units, unit: int) -> _Lines:
    """The lines of a unit in a plan; a recovery stands behind what it guards."""
    kind, element = units.kinds[unit], plan.elements[units.elements[unit]]
    if kind in _NOT_IN_PLANS:
        raise CannotSayError(plan.path(element), _NOT_IN_PLANS[kind])
    before, after = _plan_lines(plan, units, unit, element)
    parent = units.parents[unit]
    guarded = parent >= 0 and units.kinds[parent] is UnitKind.GUARD and units.positions[unit] > 0
    if kind is UnitKind.EMPTY and parent >= 0 and units.kinds[parent] is not UnitKind.SEQUENCE:
        raise CannotSayError(plan.path(element), "a plan cannot have a step that succeeds at once")
    if not guarded:
        return before, after
    return ['<Control type="recovery">', *before], [*after, "</Control>"]


def _plan_lines(plan: Plan, units: Units, unit: int, element: Element) -> _Lines:
    kind = units.kinds[unit]
    if kind is UnitKind.EMPTY or unit == 0:
        return [], []
    if kind is UnitKind.RUNNER:
        for name in element.parameters:
            if name.startswith("port."):
                raise CannotSayError(plan.path(element), f"a plan cannot have a parameter {name!r}")
        _refuse_references(plan, element)
        names = (("interface", element.interface), ("provider", element.provider))
        return [f"<Runner {_attributes(element, names)}/>"], []
    name = _CONTROLS.get(kind, "sequential")
    return [f'<Control type="{name}">'], ["</Control>"]


def _as_tree(plan: Plan, units: Units, unit: int) -> _Lines:
    """The lines of a unit in a tree."""
    kind, element = units.kinds[unit], plan.elements[units.elements[unit]]
    if kind is UnitKind.RUNNER:
        if element.provider not in ("", element.interface):
            why = f"a tree has one name for it, not {element.interface} and {element.provider}"
            raise CannotSayError(plan.path(element), why)
        _refuse_references(plan, element)
        for name, value in element.parameters.items():
            if name.startswith("_") or name == "ID" or is_reference(written(value)):
                why = f"{name}={written(value)!r} means something else in a tree"
                raise CannotSayError(plan.path(element), why)
        return [f"<Action {_attributes(element, (('ID', element.interface),))}/>"], []
    if kind is UnitKind.EMPTY or (kind is UnitKind.SEQUENCE and not units.children[unit]):
        return ["<AlwaysSuccess/>"], []
    if kind is UnitKind.COUNT:
        size, need = len(units.children[unit]), units.needs[unit]
        ports = f' success_count="{need}" failure_count="{size - need + 1}"'
        return [f"<Parallel{ports}>"], ["</Parallel>"]
    if kind is UnitKind.WAIT:
        fails = len(units.children[unit]) - units.needs[unit] + 1
        return [f'<ParallelAll max_failures="{fails}">'], ["</ParallelAll>"]
    if kind not in _NODES:
        raise CannotSayError(plan.path(element), "nothing ever triggers it")
    tag, ports = _NODES[kind]
    return [f"<{tag}{ports}>"], [f"</{tag}>"]


def _refuse_references(plan: Plan, element: Element) -> None:
    """Raise CannotSayError for a leaf of a tree that reads the blackboard."""
    for attribute in element.attributes:
        if isinstance(plan, TreePlan) and is_reference(attribute.text):
            why = f"its port {attribute.name} reads {attribute.text} from the blackboard"
            raise CannotSayError(plan.path(element), why)


def _attributes(element: Element, names: tuple[tuple[str, str], ...]) -> str:
    rows = [*names]
    rows += ((name, written(value)) for name, value in element.parameters.items())
    return " ".join(f"{name}={quoteattr(text)}" for name, text in rows)


def _models(plan: Plan) -> Iterator[str]:
    """A model for each action, with the ports that it has somewhere."""
    ports: dict[str, dict[str, None]] = {}
    for runner in plan.runners:
        ports.setdefault(runner.interface, {}).update(
            dict.fromkeys(name for name in runner.parameters if name not in NOT_PARAMETERS)
        )
    for name, inside in sorted(ports.items()):
        inner = "".join(f"<input_port name={quoteattr(port)}/>" for port in sorted(inside))
        model = f"<Action ID={quoteattr(name)}>{inner}</Action>" if inner else ""
        yield f"    {model or f'<Action ID={quoteattr(name)}/>'}"


FORMATS = (
    Format("plan", "plans in XML", lambda _begin, _file: False, None, write_plan),
    Format("tree", "trees of BehaviorTree.CPP", lambda _begin, _file: False, None, write_tree),
)
