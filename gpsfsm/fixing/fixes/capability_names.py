"""Names of interfaces and providers: misspelt, in the wrong package, of another dialect."""

from __future__ import annotations

from difflib import SequenceMatcher
from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.names import Names, short
from gpsfsm.capabilities.library import namespace
from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import attribute_edit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.plan import Element


_NEAR = 0.8
_NEWEST = "fp_perception_capabilities"
"""The package of the newest published stack whose names differ from those of the library."""
_VERY_NEAR = 0.9


def _capability_names(draft: Draft) -> Iterator[Fix]:
    """Misspelt names, or of the wrong package: one fix for all runners that write the same."""
    names = Names(draft.library)
    for rule, propose in (("GP201", _interface), ("GP202", _provider), ("GP212", _foreign)):
        for finding, runner in draft.elements(rule):
            yield from propose(draft, names, finding, runner)


def _interface(draft: Draft, names: Names, finding: Finding, runner: Element) -> Iterator[Fix]:
    written = runner.interface
    implemented = names.implements(written)
    near = [implemented] if implemented else names.interfaces_near(written)
    if len(near) != 1:
        return
    safety = Safety.SAFE if _like(written, near[0]) else Safety.UNSAFE
    edits: list[Edit] = []
    for other in _same(draft, "interface", written):
        edits += _written(draft, other, "interface", near[0])
        # Where the provider has the same wrong name, it has it for the same reason.
        if other.provider == written:
            provider = draft.library.providers_of(near[0])
            edits += _written(draft, other, "provider", provider[0].name if provider else near[0])
    title = f"interface written {near[0]}"
    yield Fix("GP201", title, draft.offset(finding), tuple(edits), safety)


def _provider(draft: Draft, names: Names, finding: Finding, runner: Element) -> Iterator[Fix]:
    library, written = draft.library, runner.provider
    here = library.translation(runner.interface) or runner.interface
    described = library.providers_of(here)
    if not described:
        return
    wanted = described[0].name
    at = draft.offset(finding)
    if library.translation(runner.interface) and written == wanted:
        # The interface is the one that is spelt in another dialect.
        same = [each for each in _same(draft, "provider", written) if each.interface != here]
        edits = [e for each in same for e in _written(draft, each, "interface", here)]
        yield Fix("GP202", f"interface written {here}", at, tuple(edits))
        return
    alone = len(described) == 1
    other = names.implements(written)
    sure = alone and (_like(written, wanted) or other == here)
    same = [e for e in _same(draft, "provider", written) if e.interface == runner.interface]
    edits = [e for each in same for e in _written(draft, each, "provider", wanted)]
    safety = Safety.SAFE if sure else Safety.UNSAFE
    yield Fix("GP202", f"provider written {wanted}", at, tuple(edits), safety)


def _foreign(draft: Draft, names: Names, finding: Finding, runner: Element) -> Iterator[Fix]:
    """The interface of the provider, unless that of another one is nearer to what is written."""
    written, wanted = runner.interface, names.implements(runner.provider)
    near = names.interfaces_near(written)
    if near and wanted not in near:
        return
    safety = Safety.SAFE if _like(written, wanted) else Safety.UNSAFE
    same = [e for e in _same(draft, "interface", written) if e.provider == runner.provider]
    edits = [e for each in same for e in _written(draft, each, "interface", wanted)]
    title = f"interface written {wanted}"
    yield Fix("GP212", title, draft.offset(finding), tuple(edits), safety)


def _runners(draft: Draft) -> tuple[Element, ...]:
    assert draft.plan is not None, "the elements of findings are those of a plan"
    return draft.plan.runners


def _same(draft: Draft, name: str, written: str) -> list[Element]:
    return [runner for runner in _runners(draft) if runner.text(name) == written]


def _written(draft: Draft, runner: Element, name: str, wanted: str) -> Iterator[Edit]:
    node = draft.node(runner)
    raw = node.attribute(name) if node else None
    if raw is not None:
        yield attribute_edit(draft, raw, name, wanted)


def _like(written: str, wanted: str) -> bool:
    """True if two names differ in their package, in case, or by a few letters only."""
    mine, theirs = short(written).lower()[:80], short(wanted).lower()[:80]
    if SequenceMatcher(None, mine, theirs).ratio() >= _VERY_NEAR:
        return True
    # Most names end in Runner, which makes them more alike than they are.
    mine, theirs = mine.removesuffix("runner"), theirs.removesuffix("runner")
    return mine == theirs or SequenceMatcher(None, mine, theirs).ratio() >= _NEAR


def _old_names(draft: Draft) -> Iterator[Fix]:
    """The names of another dialect: one fix per pair of packages, as the rule has it."""
    library = draft.library
    for finding, first in draft.elements("GP208"):
        if draft.options.described.robot is None and namespace(first.interface) == _NEWEST:
            continue  # who has a robot of the newest stack must not be led back to an older one
        edits: list[Edit] = []
        packages = _packages(draft, first.interface)
        for runner in _runners(draft):
            here = library.translation(runner.interface)
            if here is None or _packages(draft, runner.interface) != packages:
                continue
            edits += _written(draft, runner, "interface", here)
            provider = library.translation(runner.provider)
            if provider is not None:
                edits += _written(draft, runner, "provider", provider)
        title = f"names of {packages[0] or 'another dialect'} translated"
        yield Fix("GP208", title, draft.offset(finding), tuple(edits), Safety.UNSAFE)


def _packages(draft: Draft, name: str) -> tuple[str, str]:
    return namespace(name), namespace(draft.library.translation(name) or name)


FIXERS = (
    Fixer(
        name="capability-names",
        rules=("GP201", "GP202", "GP212"),
        propose=_capability_names,
        safe=(
            "writes the name of the only interface or provider that is like the one written: "
            "the package, case or a few letters differ"
        ),
        unsafe="takes the only candidate where it is not that like: something else may be meant",
    ),
    Fixer(
        name="old-names",
        rules=("GP208",),
        propose=_old_names,
        unsafe=(
            "writes the names of the capability files: the plan means the same, but an "
            "executor of the older dialect does not know them"
        ),
    ),
)
