"""What executable content of a statechart may raise, from sections 4 to 6 of the W3C's SCXML alone.

Data is not read: whatever evaluates an expression may fail, which raises ``error.execution`` and
ends its block; a branch of ``<if>`` may be any, as far as ``true``, ``false`` and ``In('id')`` do
not say which; a body of ``<foreach>`` runs up to twice. By section 5.9.1 a condition that cannot be
evaluated is false, by section 4.9 an error ends the block: after a failed condition of ``<if>``
both are looked at.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET  # what is read here was written by tests
from collections.abc import Callable, Iterable
from dataclasses import dataclass

SCXML = "{http://www.w3.org/2005/07/scxml}"
EXECUTION = "error.execution"
COMMUNICATION = "error.communication"
INTERNAL = "#_internal"
MOST_WAYS = 300
_OWN_TYPES = ("scxml", "http://www.w3.org/TR/scxml/#SCXMLEventProcessor")
_LOCATIONS = ("namelist", "location", "idlocation")
_IN = re.compile(r"In\(\s*(?:'([^'\"]*)'|\"([^'\"]*)\")\s*\)")
_LITERALS = {"true": True, "True": True, "false": False, "False": False}
_MODELS = {"true": "ecmascript", "false": "ecmascript", "True": "python", "False": "python"}
Queue = tuple[str, ...]
Outcome = tuple[Queue, bool]  # what is raised, and whether an error has ended the block
Outcomes = frozenset[Outcome]
QUIET: Outcomes = frozenset([((), False)])


class TooManyError(Exception):
    """The chart has more configurations than this looks at."""


def holds(cond: str | None, active: frozenset[str]) -> bool | None:
    """What a condition says where states of these names are active. None: data decides."""
    if cond is None:
        return True
    words = cond.strip()
    match = _IN.fullmatch(words)
    if match:
        return (match[1] or match[2]) in active
    return _LITERALS.get(words)


def is_foreign(cond: str | None, model: str) -> bool:
    """True for a literal of another data model than that of the chart: it may fail, and is false.

    A chart that names no model may run in any.
    """
    word = (cond or "").strip()
    return word in _MODELS and _MODELS[word] != model


def then(before: Outcomes, after: Outcomes) -> Outcomes:
    """The one and then, unless it has ended the block, the other."""
    rows = {
        (queue + other, ended)
        for queue, done in before
        if not done
        for other, ended in after
    } | {row for row in before if row[1]}  # fmt: skip
    if len(rows) > MOST_WAYS:
        raise TooManyError
    return frozenset(rows)


_CONSTANT = re.compile(r"[0-9.]+|'[^'\\]*'")  # an expression that cannot fail


def is_evaluated(element: ET.Element) -> bool:
    """True if there is an expression or a location in its attributes, or in what is in it."""
    inner = (f"{SCXML}param", f"{SCXML}content")
    return (
        any(
            (name.endswith("expr") and not _CONSTANT.fullmatch(text)) or name in _LOCATIONS
            for name, text in element.attrib.items()
        )
        or element.tag in (f"{SCXML}assign", f"{SCXML}script", f"{SCXML}param")
        or any(is_evaluated(each) for each in element if each.tag in inner)
    )


@dataclass(frozen=True)
class Content:
    """The executable content of a chart."""

    is_heard: Callable[[str], bool]  # what no transition waits for is not kept
    known: tuple[str, ...]  # the names that an expression for a name may give
    fails: bool = True  # False: nothing that is evaluated or sent fails
    model: str = ""  # the data model of the chart

    def block(self, elements: Iterable[ET.Element], active: frozenset[str]) -> Outcomes:
        """What a block may do where these states are active."""
        rows = QUIET
        for element in elements:
            rows = then(rows, self._element(element, active))
        return rows

    def queues(self, elements: Iterable[ET.Element], active: frozenset[str]) -> frozenset[Queue]:
        """What a block may raise."""
        return frozenset(queue for queue, _ in self.block(elements, active))

    def errors(self, count: int) -> frozenset[Queue]:
        """What so many expressions may raise that are no elements of a block."""
        most = count if self.fails else 0
        return frozenset(self._raised(EXECUTION) * times for times in range(most + 1))

    def _raised(self, event: str) -> Queue:
        return (event,) if self.is_heard(event) else ()

    def _fault(self, event: str = EXECUTION, *, ended: bool = True) -> Outcomes:
        return frozenset([(self._raised(event), ended)] if self.fails else [])

    def _element(self, element: ET.Element, active: frozenset[str]) -> Outcomes:
        tag = element.tag.removeprefix(SCXML)
        if tag == "raise":
            return frozenset([(self._raised(element.get("event", "")), False)])
        if tag == "send":
            return self._send(element)
        if tag == "if":
            return self._branches(element, active)
        if tag == "foreach":
            once = self.block(element, active)
            return QUIET | self._fault() | once | then(once, once)
        if tag in ("assign", "script", "log", "cancel") and is_evaluated(element):
            return QUIET | self._fault()
        return QUIET

    def _send(self, element: ET.Element) -> Outcomes:
        rows: set[Outcome] = set()
        own = element.get("type", "scxml") in _OWN_TYPES
        inside = element.get("target") == INTERNAL and own
        if inside or "targetexpr" in element.attrib:
            names = [element.get("event", "")] if "event" in element.attrib else self.known
            rows |= {(self._raised(name), False) for name in names}
        if is_evaluated(element):
            rows |= self._fault()
        if not inside or "typeexpr" in element.attrib:
            late = self._fault(COMMUNICATION, ended=False)
            abroad = {"target", "targetexpr", "typeexpr"} & {*element.attrib} or not own
            # Its own external queue is always there.
            failing = self._fault() | self._fault(COMMUNICATION) | late
            rows |= QUIET | failing if abroad else QUIET
        return frozenset(rows)

    def _branches(self, element: ET.Element, active: frozenset[str]) -> Outcomes:
        parts: list[tuple[str | None, list[ET.Element]]] = [(element.get("cond", ""), [])]
        for child in element:
            if child.tag in (f"{SCXML}elseif", f"{SCXML}else"):
                cond = child.get("cond", "") if child.tag == f"{SCXML}elseif" else None
                parts.append((cond, []))
            else:
                parts[-1][1].append(child)
        rows, before = frozenset[Outcome](), QUIET  # before: no condition has held so far
        for cond, children in parts:
            value = holds(cond, active)
            if value is not False:
                rows |= then(before, self.block(children, active))
            if value is None or (self.fails and is_foreign(cond, self.model)):
                rows |= then(before, self._fault())
                before = then(before, QUIET | self._fault(ended=False))
            elif value:
                before = frozenset()
        return rows | before
