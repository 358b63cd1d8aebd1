"""Labels of nodes and controls in pictures, and names of runners in messages.

Labels are printable, clipped, and never more than text.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import CHOICE, TICK
from gpsfsm.model.event import Event
from gpsfsm.model.plan import line_words
from gpsfsm.model.printable import clip
from gpsfsm.model.story import Vocabulary

if TYPE_CHECKING:
    from gpsfsm.model.automaton import Automaton, Node
    from gpsfsm.model.plan import Attribute, Element

MAX_LABEL = 60
"""The longest label line, in code points."""
_LABEL_PARAMETERS = 2
_NOT_SHOWN = frozenset({"interface", "provider"})


def is_machine(automaton: Automaton) -> bool:
    """True for a machine: it has connections only, and no controls."""
    return not automaton.plan.nested


def node_name(automaton: Automaton, node: Node) -> str:
    """The name of a node of a machine: its author's, or in a tree the end of its path."""
    path = automaton.plan.path(node.origin)
    if automaton.plan.vocabulary is not Vocabulary.TREE:
        return path.removeprefix("/machine/")
    if node.kind not in (NodeKind.RUNNER, NodeKind.JOIN):
        return node.kind.value
    return path.rpartition("/")[2].replace("[1]", "")


def drawn_nodes(automaton: Automaton) -> list[Node]:
    """The nodes of a machine that are drawn: all but ends that nothing leads to."""
    ends = (automaton.complete, automaton.give_up)
    inputs = automaton.inputs
    return [node for node in automaton.nodes if node.index not in ends or inputs[node.index]]


def node_label(automaton: Automaton, node: Node) -> tuple[str, ...]:
    """The lines of a node's label: a runner's name, its first parameters and its line.

    Nodes of machines have names, which stand above. A node of a tree has the name of its action,
    with the number of its use, as in ``MoveBase@2``.
    """
    lines = _label(automaton, node)
    if not is_machine(automaton) or node.kind not in (NodeKind.RUNNER, NodeKind.START):
        return lines
    name = clip(node_name(automaton, node), MAX_LABEL)
    element = automaton.plan.elements[node.origin]
    if _is_action(automaton, node) and element.interface not in (CHOICE, TICK):
        _, at, use = name.partition("@")
        return f"{lines[0]}{at}{use}", *lines[1:]
    return lines if name == lines[0] else (name, *lines)


def _is_action(automaton: Automaton, node: Node) -> bool:
    """True for a leaf of a behaviour tree."""
    return automaton.plan.vocabulary is Vocabulary.TREE and node.kind is NodeKind.RUNNER


def _label(automaton: Automaton, node: Node) -> tuple[str, ...]:
    if node.kind is NodeKind.JOIN:
        inputs = len(automaton.inputs[node.index])
        if automaton.traits.gives_up:
            return (_join_label(node.need, inputs),)
        never = "never" if node.need > inputs else ""
        breaks = "2nd: ABORT" if node.index in automaton.traits.breaking and inputs > 1 else ""
        return tuple(filter(None, (f"{node.need} of {inputs}", never, breaks)))
    if node.kind is NodeKind.RUNNER:
        element = automaton.plan.elements[node.origin]
        name = element.interface.rpartition("/")[2] or element.interface or "(no interface)"
        most = MAX_LABEL // _LABEL_PARAMETERS
        parameters = parameters_label(
            element,
            most,
            _LABEL_PARAMETERS,
            named=not is_machine(automaton) or _is_action(automaton, node),
        )
        if element.interface == CHOICE:
            name, parameters = "choice", [brief(element.text("of") or "", MAX_LABEL)]
        elif element.interface == TICK:
            name = "tick"
        lines = [clip(name, MAX_LABEL), ", ".join(parameters), _place(element)]
        return tuple(line for line in lines if line)
    return (node.kind.value.replace("_", " "),)


def _join_label(need: int, inputs: int) -> str:
    if need == 1:
        return "any"
    return f"all {need}" if need >= inputs else f"{need} of {inputs}"


def parameters_label(
    element: Element, max_length: int, max_count: int | None = None, *, named: bool = True
) -> list[str]:
    """``name=value`` of the parameters and labels of a runner, clipped; "…" for what is left.

    Unless ``named``, its name stands elsewhere.
    """
    hidden = _NOT_SHOWN if named else _NOT_SHOWN | {"name"}
    shown = [each for each in element.attributes if each.name not in hidden]
    texts = [clip(f"{each.name}={each.text}", max_length) for each in shown[:max_count]]
    return [*texts, "…"] if len(texts) < len(shown) else texts


def _place(element: Element) -> str:
    """Its place: ``line 5``, or ``line 5:9`` if it is not alone there; or the name of a node."""
    if element.lineless:
        return element.where
    column = f":{element.column}" if element.shares_line else ""
    return line_words(f"line {element.line}{column}", element.file)


def control_label(element: Element) -> str:
    """The label above a control: its type, its name and its line."""
    words = [element.words or "control"]
    name = element.text("name")
    if name:
        words.append(f"“{clip(name, MAX_LABEL)}”")
    words.append(f"({_place(element)})")
    return " ".join(words)


_MAX_PARAMETERS = 3
_MAX_TEXT = 28
_TELLING = ("x", "y", "text", "prompt", "task", "target")


def action(runner: Element) -> str:
    """The action of a runner: ``WaypointRunner (x=1.0, y=3.0)``."""
    if runner.interface == CHOICE:
        return f"the choice '{brief(runner.text('of') or '', MAX_LABEL)}'"
    if runner.interface == TICK:
        return "a tick"
    name = runner.interface.rsplit("/", 1)[-1] or "a runner without interface"
    attributes = sorted(runner.attributes, key=_interest)  # stable: else in document order
    parameters = runner.parameters
    shown = [
        f"{attribute.name}={brief(attribute.text)}"
        for attribute in attributes
        if attribute.name in parameters
    ]
    more = ["…"] if len(shown) > _MAX_PARAMETERS else []
    return f"{name} ({', '.join([*shown[:_MAX_PARAMETERS], *more])})" if shown else name


def verb(runner: Element, event: Event) -> str:
    """The end of a runner in a sentence; a choice neither succeeds nor fails."""
    words = ("holds", "does not hold") if runner.interface == CHOICE else ("succeeds", "fails")
    return words[event is Event.FAILED]


def _interest(attribute: Attribute) -> int:
    """A rank: parameters that tell runners apart come first, switches come last."""
    if attribute.name in _TELLING:
        return 0
    return 2 if isinstance(attribute.value, bool) else 1


def brief(text: str, most: int = _MAX_TEXT) -> str:
    """The beginning of a text, in one line."""
    text = " ".join(text.split())
    return text if len(text) <= most else text[: most - 1] + "…"
