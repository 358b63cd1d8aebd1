"""GP107: a runner without interface or provider, and the name it may have for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_end, escaped
from gpsfsm.syntax.hints import nearest_attribute
from gpsfsm.syntax.text import strip
from gpsfsm.syntax.values import decode_value

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node

_BOTH = ("interface", "provider")


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per runner and missing attribute."""
    for node in draft.outline.nodes.values():
        if node.name != "Runner":
            continue
        for name in _BOTH:
            if node.attribute(name) is None:
                yield from _missing(draft, node, name)


def _missing(draft: Draft, node: Node, name: str) -> Iterator[Fix]:
    others = [raw.name for raw in node.tag.attributes if raw.name not in _BOTH]
    near = nearest_attribute(name, others)
    attribute = node.attribute(near) if near else None
    if attribute is not None:
        edit = Edit(attribute.start, attribute.start + len(near), name)
        yield Fix("GP107", f"'{near[:40]}' written '{name}'", node.start, (edit,))
        return
    beside = node.attribute(_BOTH[1 - _BOTH.index(name)])
    if beside is None:
        return
    twin = strip(decode_value(draft.text[beside.value_start : beside.value_end], 0, []))
    wanted, sure = _other(draft, name, twin)
    if not wanted:
        return
    place = attribute_end(draft.text, beside)
    edit = Edit(place, place, f' {name}="{escaped(wanted)}"')
    if name == "interface":
        edit = Edit(beside.start, beside.start, f'{name}="{escaped(wanted)}" ')
    safety = Safety.SAFE if sure else Safety.UNSAFE
    yield Fix("GP107", f"{name} added", node.start, (edit,), safety)


def _other(draft: Draft, name: str, twin: str) -> tuple[str, bool]:
    """The provider of an interface, or the interface of a provider; whether it is the only one."""
    library = draft.library
    if name == "interface":
        provider = library.provider(twin)
        return (provider.implements, True) if provider else ("", False)
    here = library.translation(twin)
    providers = library.providers_of(here or twin)
    if not providers:
        return "", False
    return (twin if here else providers[0].name), len(providers) == 1


FIXER = Fixer(
    name="attribute-names",
    rules=("GP107",),
    propose=propose,
    safe=(
        "writes `Interface` or `provder` as it is spelt, and adds the provider or interface where "
        "the capability files know only one that fits"
    ),
    unsafe="adds the default provider where several would fit: another one may be meant",
)
