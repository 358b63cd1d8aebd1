"""GP208: the names of another dialect."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import namespace
from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_edit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per pair of packages, as the rule has it."""
    plan, library = draft.plan, draft.library
    if plan is None:
        return
    for finding in draft.findings("GP208"):
        first = draft.element(finding)
        if first is None:
            continue
        edits: list[Edit] = []
        packages = _packages(draft, first.interface)
        for runner in plan.runners:
            here = library.translation(runner.interface)
            node = draft.node(runner)
            if here is None or node is None or _packages(draft, runner.interface) != packages:
                continue
            provider = library.translation(runner.provider)
            for name, wanted in (("interface", here), ("provider", provider)):
                raw = node.attribute(name)
                if raw is not None and wanted is not None:
                    edits.append(attribute_edit(draft, raw, name, wanted))
        title = f"names of {packages[0] or 'another dialect'} translated"
        yield Fix("GP208", title, draft.offset(finding), tuple(edits), Safety.UNSAFE)


def _packages(draft: Draft, name: str) -> tuple[str, str]:
    return namespace(name), namespace(draft.library.translation(name) or name)


FIXER = Fixer(
    name="old-names",
    rules=("GP208",),
    propose=propose,
    unsafe=(
        "writes the names of the capability files: the plan means the same, but an executor of "
        "the older dialect does not know them"
    ),
)
