"""The engines' algorithm again, plainly: recursion over first children and next siblings.

Written from the description of the algorithm, on trees of its own, sharing no code with the
package. Numbers are compared by what they are, so typing of parameters has tests of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

__all__ = ["CONTROL", "RUNNER", "Node", "StoppedError", "comment", "engine", "text", "to_xml"]

CONTROL, RUNNER = "Control", "Runner"


@dataclass(frozen=True, slots=True)
class Node:
    """An element, or a text or comment (``tag`` is "#text" or "#comment")."""

    tag: str
    attributes: tuple[tuple[str, str], ...] = ()
    children: tuple[Node, ...] = ()
    content: str = ""

    @property
    def is_element(self) -> bool:
        return not self.tag.startswith("#")

    def get(self, name: str) -> str | None:
        return dict(self.attributes).get(name)


def text(content: str) -> Node:
    return Node("#text", content=content)


def comment(content: str) -> Node:
    return Node("#comment", content=content)


def _escaped(value: str) -> str:
    for character, name in (("&", "amp"), ("<", "lt"), (">", "gt"), ('"', "quot"), ("'", "apos")):
        value = value.replace(character, f"&{name};")
    return value


def to_xml(node: Node) -> str:
    """On one line."""
    if node.tag == "#text":
        return node.content
    if node.tag == "#comment":
        return f"<!--{node.content}-->"
    attributes = "".join(f' {name}="{_escaped(value)}"' for name, value in node.attributes)
    if not node.children:
        return f"<{node.tag}{attributes}/>"
    return f"<{node.tag}{attributes}>{''.join(map(to_xml, node.children))}</{node.tag}>"


def pretty(node: Node, depth: int = 0) -> str:
    """As the engines write elements without text into messages, but for the last line end."""
    indent = "    " * depth
    if node.tag == "#comment":
        return f"{indent}<!--{node.content}-->"
    assert node.is_element, "the layout around text is compared with the library itself"
    attributes = "".join(f' {name}="{_escaped(value)}"' for name, value in node.attributes)
    if not node.children:
        return f"{indent}<{node.tag}{attributes}/>"
    inside = "\n".join(pretty(child, depth + 1) for child in node.children)
    return f"{indent}<{node.tag}{attributes}>\n{inside}\n{indent}</{node.tag}>"


class StoppedError(Exception):
    """The engine refuses the plan, or crashes; the argument is what it lists."""


@dataclass
class Entry:
    interface: str = ""
    instance: int = -1
    count: int | None = None
    description: str = ""
    start: Entry | None = None
    success: Entry | None = None
    failure: Entry | None = None


@dataclass
class Engine:
    version: int
    entries: dict[int, Entry] = field(default_factory=dict)
    instances: int = 0

    # ---- check -----------------------------------------------------------------------------

    def check(self, node: Node, after: list[Node], rejected: list[Node]) -> str:
        """The message for ``node`` and those after it; "" if all is well."""
        said = ""
        if node.tag == CONTROL:
            kind = node.get("type")
            if kind is None:
                rejected.append(node)
                return f"Control tag missing 'type' attribute: {pretty(node)}\n"
            if kind not in ("sequential", "parallel_any", "parallel_all", "recovery"):
                rejected.append(node)
                return f"Control tag '{kind}' not available in the valid list"
            if node.children:
                inside = [child for child in node.children if child.is_element]
                if not inside:
                    raise StoppedError({"crash": "signal 11"})
                said = self.check(inside[0], inside[1:], rejected)
        elif node.tag == RUNNER:
            for name in ("interface", "provider"):
                if node.get(name) is None:
                    rejected.append(node)
                    return f"Runner tag missing '{name}' attribute: {pretty(node)}\n"
        else:
            rejected.append(node)
            return f"XML element is not valid :{pretty(node)}\n"
        return (self.check(after[0], after[1:], rejected) if after else "") or said

    # ---- walk ------------------------------------------------------------------------------

    def walk(self, node: Node, after: list[Node], number: int, event: str, name: str) -> int:
        last = number
        if node.tag == CONTROL:
            inside = [child for child in node.children if child.is_element]
            kind, own = node.get("type"), node.get("name") or ""
            events = {"parallel_any": "start", "parallel_all": "start", "recovery": "failure"}
            if inside and kind == "sequential":
                last = self.walk(inside[0], inside[1:], number, "success", own)
            elif inside and kind in events:
                last = self.walk(inside[0], inside[1:], number, events[kind], own)
                last = self.mux(last + 1, kind)
            return self.walk(after[0], after[1:], last + 1, event, name) if after else last
        if node.tag == RUNNER:
            entry = Entry(node.get("interface") or "", self.instances, description=name)
            self.instances += 1
            self.entries[number] = entry
            if number:
                setattr(self.entries.setdefault(number - 1, Entry()), event, entry)
            return self.walk(after[0], after[1:], number + 1, event, "") if after else number
        return last

    def mux(self, number: int, kind: str) -> int:
        def is_open(entry: Entry) -> bool:
            return entry.success is None or entry.success.interface == ""

        count = sum(is_open(entry) for entry in self.entries.values())
        all_of = kind == "parallel_all"
        if self.version == 1:
            name = f"capabilities2_runner_system/InputMultiplex{'All' if all_of else 'Any'}Runner"
        else:
            name = "capabilities2_runner/InputMultiplexRunner"
            count = count if all_of else 1
        verb = "collecting" if self.version == 1 else "muxing"
        what = "recovery" if kind == "recovery" else "outputs"
        first = "parallel_all" if all_of else "parallel_any"
        entry = Entry(name, self.instances, count, f"{first}_for_{verb}_{what}")
        self.instances += 1
        self.entries[number] = entry
        for each in self.entries.values():
            if is_open(each):
                each.success = entry
        return number


def engine(version: int, children: tuple[Node, ...]) -> Any:
    """What an engine makes of a plan with these children, in the form of its listing."""
    if version == 1:
        name = "capabilities2_runner_fabric/FabricCompletionRunner"
    else:
        name = "fabric_capabilities/FabricCompletionRunner"
    completion = Node(RUNNER, (("interface", name), ("provider", name)))
    wrapped = (("type", "sequential"), ("name", "fabric_completion_control"))
    control = Node(CONTROL, wrapped, (*children, completion))
    made = Engine(version)
    if version == 2:
        rejected: list[Node] = []
        try:
            said = made.check(control, [], rejected)
        except StoppedError as stopped:
            return stopped.args[0]
        if said:
            return {"error": f"XML plan parsing failed: {said}", "rejected": len(rejected)}
    made.walk(control, [], 0, "success", "")
    return [_row(number, entry, version, name) for number, entry in sorted(made.entries.items())]


def _row(number: int, entry: Entry, version: int, completion: str) -> dict[str, Any]:
    def target(of: Entry | None) -> int | None:
        return of.instance if of is not None and of.interface else None

    parameters: dict[str, Any] = {}
    if entry.count is not None:
        parameters["input_count"] = [entry.count if version == 1 else str(entry.count), 2]
    if version == 2 and entry.interface == completion:
        parameters["plan_id"] = ["PLAN-ID", 3]
    return {
        "id": number,
        "interface": entry.interface,
        "inst": entry.instance,
        "start": target(entry.start),
        "success": target(entry.success),
        "failure": target(entry.failure),
        "desc": entry.description,
        "params": parameters,
    }
