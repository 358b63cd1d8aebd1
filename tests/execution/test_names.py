"""What ``run --real`` would load is what a check has described, and gate and run agree."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hypothesis import given

from gpsfsm.capabilities.library import Match
from tests.attacks.names import Case, cases, judge, libraries, pairs
from tests.support import plan_of

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Library


@given(cases())
def test_what_is_loaded_is_what_was_checked(case: Case) -> None:
    list(judge(case))


@given(libraries(), pairs())
def test_names_mean_one_thing(library: Library, pair: tuple[str, str]) -> None:
    """The parts of a resolution fit together, whatever the names are."""
    resolution = library.resolve(*pair)
    assert resolution == library.resolve(*pair)
    assert (resolution.provider is None) == (
        resolution.match in (Match.MISMATCH, Match.UNDESCRIBED)
    )
    if resolution.provider is not None:
        assert resolution.interface is not None
        assert resolution.provider.described == (resolution.match is Match.DESCRIBED)
    if resolution.match is Match.MISMATCH:
        assert resolution.implements
        assert resolution.implements != getattr(resolution.interface, "name", None)
        assert library.provider(pair[1]) or library.translation(pair[1])


def test_there_is_one_of_each_match() -> None:
    seen = {
        Match.DESCRIBED: ("nav2_capabilities/WaypointRunner", "nav2_capabilities/WaypointRunner"),
        Match.MISMATCH: ("a/Say", "nav2_capabilities/WaypointRunner"),
        Match.UNDESCRIBED: ("a/Say", "a/Say"),
    }
    from gpsfsm.capabilities.library import builtin_capabilities

    library = builtin_capabilities().library
    for match, pair in seen.items():
        assert library.resolve(*pair).match is match
        (runner,) = plan_of(
            f'<Plan><Runner interface="{pair[0]}" provider="{pair[1]}"/></Plan>'
        ).runners
        assert (library.bind(runner) is not None) == (match is Match.DESCRIBED)
