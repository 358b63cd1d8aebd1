"""The part of a text that is shown: its plan, or as much of one as it holds."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import bind
from gpsfsm.compile import Compiled, TreePlan, compile_plan
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.compile.plan_text import holds_trees, read_plan
from gpsfsm.errors import InputError
from gpsfsm.model.engine_names import PAPER_ENGINE
from gpsfsm.model.plan import Element, Kind, Plan
from gpsfsm.syntax.frontend import read_partially

if TYPE_CHECKING:
    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.tree import TreeNode
    from gpsfsm.syntax import Parsed

_PARTIAL = (
    "the text is no plan: what is drawn is the part of it that could be read, and nothing follows "
    "from it"
)
_FOREIGN = "nothing in this text looks like a part of a plan, so it is not shown"
_BY_THE_PAPER = "what is drawn is what the paper makes of it"


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The part of a text that is shown; ``text`` is None for one that nobody is shown.

    ``plan`` is None where no element was recognised; ``compiled`` is None where there is nothing
    to run. ``engine`` is the engine whose automaton that is. ``whole``: it is the plan, and not
    what remains of a text with errors.
    """

    text: str | None
    plan: Plan | None
    compiled: Compiled | None
    engine: str = PAPER_ENGINE
    whole: bool = True
    notes: tuple[str, ...] = ()


def see(text: str | bytes, path: str, options: CheckOptions) -> Seen:
    """Read a text as the options say; never raises for what is in it."""
    parsed = read_plan(text, file=path, limits=options.limits, from_response=options.from_response)
    if parsed.foreign and parsed.text:  # the path may be a link to anything
        return Seen(None, None, None, whole=False, notes=(_FOREIGN,))
    refused: tuple[str, ...] = ()
    if options.engine != PAPER_ENGINE:
        on_engine = None if parsed.over_limit else _on_engine(text, path, parsed, options)
        if on_engine is not None:
            return on_engine
        refused = (f"{options.engine} makes no plan of this text: {_BY_THE_PAPER}",)
    if parsed.plan is not None:
        return Seen(parsed.text, parsed.plan, _compiled(parsed.plan, options), notes=refused)
    remains = _remains(parsed, path, options)
    return replace(remains, notes=(*refused, *remains.notes))


def _on_engine(text: str | bytes, path: str, parsed: Parsed, options: CheckOptions) -> Seen | None:
    """The plan as the engine sees it; None if it does not take the text."""
    source = parsed.body if options.from_response and parsed.body else text
    library = options.described.library
    try:
        reading = read_for_engine(source, options.engine, path, library, options.limits)
    except InputError:  # the check has reported that
        return None
    if not isinstance(reading, EngineReading):
        return None
    return Seen(parsed.text, reading.plan, reading.compiled, options.engine)


def _compiled(plan: Plan, options: CheckOptions) -> Compiled:
    bindings = None if isinstance(plan, TreePlan) else bind(plan, options.described.library)
    return compile_plan(plan, start_chain="no-start" in options.analysis.faults, bindings=bindings)


def _remains(parsed: Parsed, path: str, options: CheckOptions) -> Seen:
    """As much as can be shown of a text that holds no plan."""
    if not parsed.text:
        return Seen("", None, None, whole=False)
    if parsed.trees or holds_trees(parsed.text):
        plan: Plan | None = _tree_elements(parsed, path, options)
        return Seen(parsed.text, plan, None, whole=False)
    plan = read_partially(parsed.body or parsed.text, path, options.limits)
    if plan is None or len(plan.elements) == 1:
        return Seen(parsed.text, plan, None, whole=False)
    if any(each.kind is Kind.CONTROL and each.control_type is None for each in plan.elements):
        return Seen(parsed.text, plan, None, whole=False)
    return Seen(parsed.text, plan, _compiled(plan, options), whole=False, notes=(_PARTIAL,))


def _tree_elements(parsed: Parsed, path: str, options: CheckOptions) -> Plan | None:
    """The nodes of behaviour trees that cannot be unfolded, as they are written."""
    from gpsfsm.syntax.trees import read_trees

    forest = read_trees(parsed.text, path, options.limits).forest
    if forest is None or not forest.nodes:
        return None
    return TreePlan(
        path,
        tuple(_tree_element(node) for node in forest.nodes),
        paths=tuple(node.path for node in forest.nodes),
    )


def _tree_element(node: TreeNode) -> Element:
    kind = Kind.CONTROL if node.children else Kind.RUNNER
    return Element(
        index=node.index,
        kind=Kind.PLAN if node.parent < 0 else kind,
        parent=node.parent,
        ordinal=1,
        children=tuple(node.children),
        attributes=node.attributes,
        line=node.line,
        column=node.column,
        start=node.start,
        end=node.end,
        tag=node.tag,
    )
