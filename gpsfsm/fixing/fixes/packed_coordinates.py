"""GP111: several numbers in one attribute."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_end
from gpsfsm.model.capability import ValueType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.capability import Binding

_NUMBER = re.compile(r"[+-]?[0-9.]+(?:[eE][+-]?[0-9]+)?")
_NUMBERS = (ValueType.DOUBLE, ValueType.INT)


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per attribute, where the provider says which parameters are meant."""
    for at, raw, value, binding in draft.attributes("GP111"):
        numbers = _NUMBER.findall(value)
        names = _parameters(binding, raw.name, len(numbers))
        if names is None:
            continue
        written = " ".join(f'{n}="{v}"' for n, v in zip(names, numbers, strict=True))
        edit = Edit(raw.start, attribute_end(draft.text, raw), written)
        safety = Safety.SAFE if len(numbers) == 2 else Safety.UNSAFE
        yield Fix("GP111", f"'{raw.name[:40]}' split into {', '.join(names)}", at, (edit,), safety)


def _parameters(binding: Binding, written: str, count: int) -> list[str] | None:
    """The parameters that take the numbers: those that are needed, then the next ones.

    None if the plan gives one of them already, or the attribute is a number of its own.
    """
    provider = binding.provider
    numbers = [each for each in provider.configuration if each.type in _NUMBERS]
    needed = [each.name for each in numbers if each.required]
    if len(needed) != 2 or provider.input(written) is not None:
        return None
    same = provider.parameter(written)
    if same is not None and same.name not in needed:
        return None
    others = [each.name for each in numbers if not each.required]
    names = [*needed, *others][:count]
    taken = {name for name in binding.written if same is None or name != same.name}
    return None if len(names) < count or taken & set(names) else names


FIXER = Fixer(
    name="packed-coordinates",
    rules=("GP111",),
    propose=propose,
    safe=(
        'writes `position="1, 3"` as `x="1" y="3"` where the provider needs exactly two numbers '
        "and the plan gives neither"
    ),
    unsafe="does so with three numbers, of which the third may be a height or an angle",
)
