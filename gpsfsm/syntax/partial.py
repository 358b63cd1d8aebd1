"""What can be read of a text that is no plan: for those who want to see where they are."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.syntax.chars import ILLEGAL
from gpsfsm.syntax.collector import Collector
from gpsfsm.syntax.lines import Lines
from gpsfsm.syntax.scan import scan
from gpsfsm.syntax.tree import TreeBuilder

if TYPE_CHECKING:
    from gpsfsm.model.plan import Plan
    from gpsfsm.syntax.limits import Limits

__all__ = ["read_partially"]


def read_partially(text: str, file: str, limits: Limits) -> Plan | None:
    """The elements that the front end recognises, whatever is wrong; None if there are none.

    Nothing follows from them: what was not understood is left out. A control without a known type
    has the type None.

    >>> from gpsfsm.syntax import Limits
    >>> found = read_partially('<Plan><Control type="often"><Runner', "plan.xml", Limits())
    >>> [str(element.kind) for element in found.elements]
    ['Plan', 'Control', 'Runner']
    """
    builder = TreeBuilder(
        ILLEGAL.sub(" ", text), file, limits, Collector(Lines(text), limits.max_problems)
    )
    builder.build(scan(builder.text, limits))
    return builder.partial()
