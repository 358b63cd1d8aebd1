"""GP709: an attribute of which the engine makes another value."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, plan, runner
from gpsfsm.model.engine import OptionType
from gpsfsm.model.finding import Finding, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import printable

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.on_engine import OnEngine
    from gpsfsm.model.engine import Parameter
    from gpsfsm.model.plan import Attribute


def find(engine: OnEngine) -> Iterator[Finding]:
    """One finding per attribute that is another number on the engine."""
    context = engine.context
    for number, parameters in enumerate(engine.parameters):
        element = context.runner(number)
        written = {attribute.name: attribute for attribute in element.attributes}
        for parameter in parameters:
            attribute = written.get(parameter.name)
            if attribute is None or not _altered(attribute, parameter):
                continue
            yield RULE.finding(
                f"{engine.name} makes {printable(parameter.text) or 'nothing'} of "
                f'{parameter.name}="{printable(attribute.text)}" of {context.place(element)}',
                Location(attribute.line, attribute.column, context.plan.path(element)),
                length=len(parameter.name),
            )


def _altered(attribute: Attribute, parameter: Parameter) -> bool:
    """True if the text that the engine passes on is another value than the plan means."""
    if parameter.type not in (OptionType.DOUBLE, OptionType.INT):
        return False
    try:
        passed = float(parameter.text)
    except ValueError:
        return True
    meant = attribute.value
    if isinstance(meant, bool | str):  # the engine sees a number where the plan has none
        return True
    if isinstance(meant, int) and abs(meant) > 1 << 53:
        return int(parameter.value) != meant
    return float(meant) != passed and not (math.isnan(float(meant)) and math.isnan(passed))


RULE = Rule(
    code="GP709",
    name="altered-by-engine",
    severity=Severity.WARNING,
    summary="The engine makes another value of an attribute.",
    why=(
        "fabric-v2 keeps six decimals of a number, takes integers modulo 2 to the 32nd, reads an "
        "empty text as 0, and takes hexadecimal numbers and the like for numbers."
    ),
    fix="write the value so that it survives: at most six decimals, no integers beyond 32 bit",
    bad=plan(runner("nav2_capabilities/WaypointRunner", x="0.1234567", y="2.0")),
    good=plan(runner("nav2_capabilities/WaypointRunner", x="0.123457", y="2.0")),
    options=("--engine", "fabric-v2"),
    find_on_engine=find,
)
