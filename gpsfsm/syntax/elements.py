"""The rules of single elements: which attributes they need, and which look wrong."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.model.finding import Related
from gpsfsm.model.plan import Attribute, ControlType
from gpsfsm.syntax.chars import clip, strip
from gpsfsm.syntax.namespaces import is_declaration
from gpsfsm.syntax.words import control_type_hint, missing_type_hint, nearest_attribute

if TYPE_CHECKING:
    from gpsfsm.syntax.collector import Collector
    from gpsfsm.syntax.tokens import RawAttribute, StartTag

__all__ = ["ElementRules", "is_completion"]

_NUMBER = r"[+-]?+(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+"
_PACKED = re.compile(
    rf"[ ]*+[(\[{{]?+[ ]*+{_NUMBER}(?:(?:[ ]*+[,;][ ]*+|[ ]++){_NUMBER}){{1,2}}+"
    r"[ ]*+[,;]?+[ ]*+[)\]}]?+[ ]*+"
)
_LONGEST_PACKED = 200
# Parameters in which people write sentences: numbers in them are meant as text.
_FREE_TEXT = frozenset(
    [
        *("interface", "provider", "name", "id", "uuid", "text"),
        *("task", "prompt", "plan", "message", "msg", "say"),
        *("speech", "question", "answer", "query", "description", "instruction"),
        *("instructions", "comment", "label", "title", "command"),
    ]
)
_COMPLETION = ("FabricCompletionRunner", "CompletionRunner")
_MAX_RELATED = 20


def is_completion(interface: str) -> bool:
    """True if ``interface`` is that of a completion runner."""
    return interface.rpartition("/")[2] in _COMPLETION


class ElementRules:
    """Checks one element at a time and reports to ``collector``."""

    def __init__(self, collector: Collector) -> None:
        self._collector = collector

    def plan(self, tag: StartTag, path: str) -> None:
        """``<Plan name?>``."""
        self._foreign(tag, path, known=("name",))

    def runner(self, tag: StartTag, attributes: tuple[Attribute, ...], path: str) -> None:
        """``<Runner interface provider …>``."""
        interface = provider = None
        for attribute in attributes:
            name, text = attribute.name, attribute.text
            if name == "interface":
                interface = text
            elif name == "provider":
                provider = text
            elif isinstance(attribute.value, str) and text[:1] in "0123456789+-.([{ ":
                # Only text can be packed: one number alone is typed as a number.
                self._packed(tag, attribute, path)
        if interface is None or provider is None or not (strip(interface) and strip(provider)):
            self._needs(tag, attributes, path, "interface", interface)
            self._needs(tag, attributes, path, "provider", provider)

    def control(
        self, tag: StartTag, attributes: tuple[Attribute, ...], path: str
    ) -> ControlType | None:
        """``<Control type name?>``; None where the type is missing or unknown."""
        found = {attribute.name: attribute.text for attribute in attributes}
        written = found.get("type")
        if written is None or not strip(written):
            self._no_type(tag, found, path)
            return None
        self._foreign(tag, path, known=("type", "name"))
        if written in _TYPES:
            return _TYPES[written]
        start, length = _span(tag, "type")
        message = f"'{clip(written)}' is not a type of control"
        hint = control_type_hint(written)
        self._collector.add("GP106", start, length, message=message, hint=hint, element=path)
        return None

    def _no_type(self, tag: StartTag, found: dict[str, str], path: str) -> None:
        if self._collector.full("GP107"):
            self._collector.count("GP107")
            return
        names = [name for name in found if name not in ("type", "name")]
        near = nearest_attribute("type", names)
        self._foreign(tag, path, known=("type", "name", near))
        if "type" in found:
            start, length = _span(tag, "type")
            message = "the type of this control is empty"
        else:
            start, length = tag.start, 1 + len(tag.name)
            message = "this control has no type, so nobody knows how it runs its children"
        hint = missing_type_hint(found.get("name"))
        if near:
            hint = f"write 'type' instead of '{near}': names are case-sensitive"
        self._collector.add("GP107", start, length, message=message, hint=hint, element=path)

    def _needs(
        self,
        tag: StartTag,
        attributes: tuple[Attribute, ...],
        path: str,
        name: str,
        text: str | None,
    ) -> None:
        """Report ``name`` where it is missing or blank."""
        if text is not None and strip(text):
            return
        if self._collector.full("GP107"):
            self._collector.count("GP107")
            return
        if text is not None:
            start, length = _span(tag, name)
            message = f"the {name} of this runner is empty"
        else:
            start, length = tag.start, 1 + len(tag.name)
            message = f"this runner has no {name}"
        others = [a.name for a in attributes if a.name not in ("interface", "provider")]
        near = nearest_attribute(name, others) if text is None else ""
        other = "provider" if name == "interface" else "interface"
        same = next((strip(a.text) for a in attributes if a.name == other), "")
        if near:
            hint = f"write '{name}' instead of '{near}': names are case-sensitive"
        elif same:
            hint = f'add {name}="{clip(same, 80)}", if it is the same as the {other}'
        else:
            hint = f'add {name}="package/SomeRunner" with the capability that shall run'
        self._collector.add("GP107", start, length, message=message, hint=hint, element=path)

    def _packed(self, tag: StartTag, attribute: Attribute, path: str) -> None:
        text = attribute.text
        if attribute.name in _FREE_TEXT or len(text) > _LONGEST_PACKED or not text:
            return
        if not _PACKED.fullmatch(text):
            return
        start, length = _span(tag, attribute.name)
        message = (
            f'{attribute.name}="{clip(text)}" packs several numbers into one attribute; '
            "the runner gets it as one text, not as numbers"
        )
        hint = 'write one attribute per number, as in x="2.0" y="-0.5"'
        self._collector.add("GP111", start, length, message=message, hint=hint, element=path)

    def _foreign(self, tag: StartTag, path: str, *, known: tuple[str, ...]) -> None:
        """Report the attributes that mean nothing on a plan or control, all at once."""
        foreign = [raw for raw in tag.attributes if raw.name not in known and raw.name != "xmlns"]
        if not foreign:
            return
        names = ", ".join(f"'{clip(raw.name)}'" for raw in foreign[:5])
        more = f" and {len(foreign) - 5} more" if len(foreign) > 5 else ""
        verb = "has" if len(foreign) == 1 else "have"
        plural = "" if len(foreign) == 1 else "s"
        message = f"the attribute{plural} {names}{more} {verb} no effect on <{tag.name}>"
        first = foreign[0]
        self._collector.add(
            "GP112",
            first.start,
            _length(first),
            message=message,
            hint="only runners take parameters: move it to the runner that needs it, or remove it",
            element=path,
            related=(
                Related(self._collector.location(raw.start, path), f"'{clip(raw.name)}'")
                for raw in foreign[1:_MAX_RELATED]
            ),
        )

    def namespaced(self, tag: StartTag, path: str) -> None:
        """Report the attributes of a runner that belong to XML namespaces."""
        for raw in tag.attributes:
            if ":" not in raw.name:
                continue
            what = "declares" if is_declaration(raw.name) else "belongs to"
            message = f"'{clip(raw.name)}' {what} an XML namespace, and plans have none"
            hint = "write the parameter without a prefix, or remove it"
            length = _length(raw)
            self._collector.add(
                "GP112", raw.start, length, message=message, hint=hint, element=path
            )


_TYPES = {kind.value: kind for kind in ControlType}


def _length(raw: RawAttribute) -> int:
    return raw.value_end + 1 - raw.start


def _span(tag: StartTag, name: str) -> tuple[int, int]:
    """Offset and length of an attribute, for underlining."""
    for raw in tag.attributes:
        if raw.name == name:
            return raw.start, _length(raw)
    return tag.start, 1 + len(tag.name)
