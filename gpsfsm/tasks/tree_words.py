"""What the words of a node of a behaviour tree mean: does it drive, and where (docs/tasks.md)."""

from __future__ import annotations

import re
from contextlib import contextmanager
from typing import TYPE_CHECKING

from gpsfsm.model.tree_nodes import BUILTINS, Meaning

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.tasks.loose import Element
    from gpsfsm.tasks.place_names import PlaceNames

__all__ = ["Words"]

_ASKS = re.compile(
    r"(?i:check|condition|reachable|reached|visited|available)"
    r"|^(?i:is|has|can|if|find|get|read|compute|calculate|plan|look|query|detect)(?![a-z])"
)
_TELLS = re.compile(
    r"^(?i:set|unset|clear|update|write|log|print|say|speak|report|notify|announce|wait|sleep"
    r"|delay|stop|cancel|script|always|init|initialize|start|end)(?![a-z])"
)
_MOVES = re.compile(
    r"^(?i:nav2?_?)?(?i:move|go|goto|drive|navigate|navigation|visit|travel)(?![a-z])"
)
_ELSE = re.compile(r"(?i:fallback|alternative|backup|otherwise|else|on_?fail|unreachable)")
_FOR_FAILURE = re.compile(r"(?i:on_?fail|if_?fail|else|otherwise|alternative|backup)")
_LABELS = ("name", "ID")
_NUMBER = r"[-+]?+(?:[0-9]++\.?+[0-9]*+|\.[0-9]++)"
_GAP = r"(?:\s*+[;,]\s*+|\s++)"
_NUMBERS = re.compile(rf"[\s(\[{{]*+({_NUMBER}){_GAP}({_NUMBER})(?:{_GAP}{_NUMBER})*+[\s)\]}}]*+")
_HOPS = 5


class Words:
    """Reads nodes in the order in which they run, since some of them say what others mean.

    ``values`` is what the blackboard is known to hold, ``defined`` where a place is by what the
    tree itself says; ``open`` are the places that were named and to which nothing has driven yet.
    """

    def __init__(self, places: PlaceNames) -> None:
        self.places = places
        self.values: dict[str, str] = {}
        self.open: list[str] = []
        self.defined: dict[tuple[float, float], str] = {}

    @contextmanager
    def inside(self, subtree: Element) -> Iterator[None]:
        """Inside of a SubTree its ports are known as well."""
        around = self.values
        ports = {
            name: self._value(value)
            for name, value in subtree.attributes.items()
            if name and name not in _LABELS
        }
        self.values = {**around, **ports}
        try:
            yield
        finally:
            self.values = around

    def is_else(self, element: Element) -> bool:
        """Whether an element says by its name that it is for a failure."""
        return _FOR_FAILURE.match(element.tag) is not None

    def is_control(self, element: Element) -> bool:
        """Whether it is a built-in node that says nothing but how others are run."""
        builtin = BUILTINS.get(element.identity)
        return builtin is not None and builtin.most != 0

    def named(self, element: Element) -> tuple[str, ...]:
        """The places that an element names: in its values, or else in its labels and its text."""
        return self._in_values(element) or self._in_labels(element)

    def moves(self, element: Element) -> bool:
        """Whether an element says by its name that it drives somewhere."""
        name = element.identity
        if element.tag in ("SubTree", "SubTreePlus"):
            name = element.attributes.get("ID", "")
        alike = (one.rpartition("/")[2].lower() for one in self.places.interfaces)
        return _MOVES.search(name) is not None or any(one in name.lower() for one in alike)

    def drives(self, element: Element) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Where a leaf drives, and where if that fails; "" is a place that is not known."""
        name = element.identity
        builtin = BUILTINS.get(name)
        if name.startswith("Set"):
            if not self._define(element):
                self._ask(element)
            return (), ()
        if builtin is not None and builtin.meaning is not Meaning.SUBTREE:
            return (), ()
        if builtin is None and (element.tag == "Condition" or _ASKS.search(name)):
            self._ask(element)
            return (), ()
        if builtin is None and _TELLS.search(name):
            return (), ()
        found = self._in_values(element) or self._by_numbers(element) or self._in_labels(element)
        if not found and self.moves(element):
            found = tuple(self.open[:1]) or ("",)
        self.open = [place for place in self.open if place not in found]
        return found, self._instead(element) if found else ()

    def _value(self, text: str) -> str:
        """A text, or what the blackboard holds below the key that it names."""
        for _ in range(_HOPS):
            name = _key(text) or text.strip()
            if name not in self.values or self.values[name] == text:
                break
            text = self.values[name]
        return text

    def _ports(self, element: Element) -> list[tuple[str, str]]:
        return [
            (name, value)
            for name, value in element.attributes.items()
            if name not in _LABELS and not name.startswith("_")
        ]

    def _in_values(self, element: Element) -> tuple[str, ...]:
        """The places of the first port that names some, by itself or by what its key holds."""
        ports = [(name, value) for name, value in self._ports(element) if not _ELSE.search(name)]
        broken = [(name, value) for name, value in ports if not name]
        for _, value in broken or ports:
            found = self.places.named(value) or self.places.named(self._value(value))
            if found:
                return found
        return ()

    def _in_labels(self, element: Element) -> tuple[str, ...]:
        labels = [element.text, *(element.attributes.get(name, "") for name in _LABELS)]
        for text in (*labels, element.tag):
            found = self.places.named(text)
            if found:
                return found
        return ()

    def _instead(self, element: Element) -> tuple[str, ...]:
        for name, value in self._ports(element):
            if _ELSE.search(name):
                return self.places.named(value)
        return ()

    def _by_numbers(self, element: Element) -> tuple[str, ...]:
        """The place with the coordinates of a leaf, as the tree or as the task has it."""
        ports = dict(self._ports(element))
        pairs = [(ports.get("x", ""), ports.get("y", "")), *map(_pair, ports.values())]
        for x, y in pairs:
            if re.fullmatch(_NUMBER, x.strip()) and re.fullmatch(_NUMBER, y.strip()):
                at = float(x), float(y)
                found = self.defined.get(at) or self.places.at(*at)
                if found:
                    return (found,)
        return ()

    def _ask(self, element: Element) -> None:
        """A question: what it answers, below its keys or not, is about the places it names."""
        named = self.named(element)
        self._name(named)
        for _, value in self._ports(element) if named else ():
            key = _key(value)
            if key and not self.places.named(value):
                self.values[key] = " ".join(named)

    def _define(self, element: Element) -> bool:
        """What a SetBlackboard says; False if it does not name a key."""
        given = element.attributes
        key = given.get("output_key", "") or given.get("key", "")
        key = _key(key) or key
        self.values[key] = given.get("value", "")
        named = self.places.named(key)
        x, y = _pair(self.values[key])
        if len(named) == 1 and x:
            self.defined[float(x), float(y)] = named[0]
        self._name(named)
        return bool(key)

    def _name(self, places: tuple[str, ...]) -> None:
        self.open += [place for place in places if place not in self.open]


def _key(text: str) -> str:
    """The key of the blackboard that ``{key}`` or ``${key}`` names; "" if it is no such text."""
    text = text.strip().removeprefix("$")
    inner = text[1:-1]
    braced = text[:1] == "{" and text[-1:] == "}" and "{" not in inner and "}" not in inner
    return inner.strip(" \t\r\n=") if braced else ""


def _pair(text: str) -> tuple[str, str]:
    """The first two of the numbers that a text consists of; two empty texts if it does not."""
    found = _NUMBERS.fullmatch(text[:200])
    return (found[1], found[2]) if found else ("", "")
