"""GP208: names of another dialect."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import at, quoted
from gpsfsm.capabilities.library import namespace
from gpsfsm.model.finding import Related, Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.analysis.context import Context
    from gpsfsm.model.finding import Finding

_LENGTH = len("interface")
_MAX_RELATED = 5


def find(context: Context) -> Iterator[Finding]:
    """One finding per pair of packages, at the first runner that is written so."""
    library = context.capabilities.library
    translations: dict[str, str | None] = {}
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for number, runner in enumerate(context.plan.runners):
        name = runner.interface
        if name in translations:
            continue
        here = translations[name] = library.translation(name)
        if here is not None:
            groups.setdefault((namespace(name), namespace(here)), {})[name] = number
    for names in groups.values():
        (first, number), *rest = names.items()
        more = f" ({len(rest)} more of this package likewise)" if rest else ""
        yield RULE.finding(
            f"{quoted(first)} is called {quoted(translations[first] or first)} here{more}",
            at(context, context.runner(number), "interface"),
            related=tuple(
                Related(
                    at(context, context.runner(number), "interface"),
                    f"{quoted(name)} is called {quoted(translations[name] or name)}",
                )
                for name, number in rest[:_MAX_RELATED]
            ),
            length=_LENGTH,
        )


RULE = Rule(
    code="GP208",
    name="other-dialect",
    severity=Severity.INFO,
    summary="A runner has the name that another dialect of the plan language uses.",
    why=(
        "The packages of the capabilities were renamed more than once. gpsfsm knows the older "
        "names and checks such plans; an executor of today does not know them."
    ),
    fix="write the names that the capability files of the robot have",
    bad=plan(go(2.0, -0.5).replace("nav2_capabilities", "capabilities2_runner_nav2")),
    good=plan(go(2.0, -0.5)),
    find=find,
)
