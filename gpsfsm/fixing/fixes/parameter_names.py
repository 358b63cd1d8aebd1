"""GP203: names of parameters that are misspelt."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.names import near
from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.syntax.nesting import similar

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.capability import Binding


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per attribute that means a parameter which the runner does not have yet."""
    for at, raw, _, binding in draft.attributes("GP203"):
        if binding.provider.parameter(raw.name) is not None:
            continue
        meant = near(raw.name, _open(binding))
        if not meant:
            continue
        # A word among several (speech_text) is weaker evidence than a few wrong letters.
        sure = len(meant) > 1 and similar(raw.name, meant)
        sure |= raw.name.lower() == meant.lower()
        safety = Safety.SAFE if sure else Safety.UNSAFE
        edit = Edit(raw.start, raw.start + len(raw.name), meant)
        yield Fix("GP203", f"'{raw.name[:40]}' written '{meant}'", at, (edit,), safety)


def _open(binding: Binding) -> list[str]:
    """The parameters that the plan does not write, those that are needed first."""
    unwritten = [
        each for each in binding.provider.configuration if each.name not in binding.written
    ]
    return [each.name for each in sorted(unwritten, key=lambda each: not each.required)]


FIXER = Fixer(
    name="parameter-names",
    rules=("GP203",),
    propose=propose,
    safe=(
        "writes `Text` or `promt` as the capability file spells it, where the runner has no such "
        "parameter yet: otherwise the value is ignored"
    ),
    unsafe="takes `speech_text` for `text`, of which only a part is alike",
)
