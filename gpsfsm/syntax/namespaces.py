"""XML namespaces: plans use none, but what stands in a text must be understood to say so."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.model.plan import Kind
from gpsfsm.syntax.chars import NAME, clip

if TYPE_CHECKING:
    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.tokens import RawAttribute, StartTag

__all__ = ["NamespaceResult", "Namespaces", "is_declaration"]

_ELEMENTS = frozenset(Kind)


def is_declaration(name: str) -> bool:
    """True for ``xmlns`` and ``xmlns:prefix``."""
    return name.startswith("xmlns") and (len(name) == 5 or name[5] == ":")


class NamespaceResult(NamedTuple):
    """What the names of an element mean for the whole: see ``TreeBuilder``."""

    broken: bool
    fatal: bool


class Namespaces:
    """The prefixes in force at the element being read, and the rules about them.

    ``reported`` is the offset of the last element whose own name was reported.
    """

    def __init__(self, collector: Collector) -> None:
        self.reported = -1
        self._collector = collector
        self._frames: list[tuple[int, frozenset[str]]] = []

    def check(self, tag: StartTag, depth: int, path: str) -> NamespaceResult:
        """Check the names of an element at ``depth``."""
        self._enter(tag.attributes, depth)
        broken = fatal = False
        wrong = self._fault(tag.name)
        if wrong:
            broken = True
            self.reported = tag.start
            self._report_name(tag.name, tag.start, wrong, path)
        for raw in tag.attributes:
            wrong = self._fault(raw.name)
            if wrong:
                broken = True
                self._report_name(raw.name, raw.start, wrong, path)
            if not is_declaration(raw.name):
                continue
            empty = raw.value_end == raw.value_start
            if empty and raw.name != "xmlns":
                broken = True
                message = f"'{clip(raw.name)}' declares a prefix for nothing"
                self._report(raw, "GP101", message, path)
            if not empty and raw.name == "xmlns" and tag.name in _ELEMENTS:
                fatal = True
                message = f"'xmlns' moves <{tag.name}> into an XML namespace, where no plan is"
                self._report(raw, "GP105", message, path)
        return NamespaceResult(broken, fatal)

    def _enter(self, attributes: list[RawAttribute], depth: int) -> None:
        """Take in the declarations of an element at ``depth``; those as deep or deeper end."""
        while self._frames and self._frames[-1][0] >= depth:
            self._frames.pop()
        declared = {raw.name[6:] for raw in attributes if raw.name.startswith("xmlns:")}
        if declared:
            known = self._frames[-1][1] if self._frames else frozenset[str]()
            self._frames.append((depth, known | declared))

    def _fault(self, name: str) -> str:
        """What is wrong with a name; "" if nothing."""
        prefix, colon, local = name.partition(":")
        if not colon:
            return ""
        if not prefix or ":" in local or not NAME.match(local):
            return "has a colon where none may be"
        if prefix == "xml" or is_declaration(name):
            return ""
        known = bool(self._frames) and prefix in self._frames[-1][1]
        return "" if known else "has a prefix that is not declared"

    def _report_name(self, name: str, start: int, wrong: str, path: str) -> None:
        message = f"'{clip(name)}' {wrong}"
        hint = f"write '{clip(name.rpartition(':')[2])}': a plan has no namespaces"
        # The name of an element follows its '<'.
        length = len(name) + (start == self.reported)
        self._collector.add("GP101", start, length, message=message, hint=hint, element=path)

    def _report(self, raw: RawAttribute, rule: str, message: str, path: str) -> None:
        length = raw.value_end + 1 - raw.start
        hint = "remove it: a plan has no namespaces"
        self._collector.add(rule, raw.start, length, message=message, hint=hint, element=path)
