"""What differs between the versions of the Fabric server, as data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from gpsfsm.model.engine import FABRIC_V1, FABRIC_V2
from gpsfsm.model.plan import ControlType

__all__ = ["PROFILES", "Join", "Profile"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Join:
    """The runner that closes a control.

    ``description`` is that of its connection. ``counts`` says whether it waits for every open end
    of the plan; else it waits for one.
    """

    interface: str
    description: str
    counts: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Profile:
    """One version of the server.

    ``completion`` is the interface of the runner that it appends, ``has_plan_id`` whether that is
    given the id of the plan. ``joins`` maps types of controls to their joins; sequential ones have
    none. ``checked`` says whether elements are checked before they are compiled, ``typed`` whether
    parameters are. ``unreadable`` is its word for a text that its parser refuses.
    """

    name: str
    completion: str
    has_plan_id: bool
    joins: Mapping[ControlType, Join]
    checked: bool
    typed: bool
    unreadable: str


_V1_ANY = "capabilities2_runner_system/InputMultiplexAnyRunner"
_V1_ALL = "capabilities2_runner_system/InputMultiplexAllRunner"
_V2_JOIN = "capabilities2_runner/InputMultiplexRunner"


def _joins(
    *, any_join: str, all_join: str, any_counts: bool, verb: str
) -> Mapping[ControlType, Join]:
    return {
        ControlType.PARALLEL_ANY: Join(
            interface=any_join, description=f"parallel_any_for_{verb}_outputs", counts=any_counts
        ),
        ControlType.PARALLEL_ALL: Join(
            interface=all_join, description=f"parallel_all_for_{verb}_outputs", counts=True
        ),
        ControlType.RECOVERY: Join(
            interface=any_join, description=f"parallel_any_for_{verb}_recovery", counts=any_counts
        ),
    }


PROFILES: Mapping[str, Profile] = {
    profile.name: profile
    for profile in (
        Profile(
            name=FABRIC_V1,
            completion="capabilities2_runner_fabric/FabricCompletionRunner",
            has_plan_id=False,
            joins=_joins(any_join=_V1_ANY, all_join=_V1_ALL, any_counts=True, verb="collecting"),
            # It checks names against what is installed on the robot, and goes on whatever it finds.
            checked=False,
            typed=False,
            unreadable="parse",
        ),
        Profile(
            name=FABRIC_V2,
            completion="fabric_capabilities/FabricCompletionRunner",
            has_plan_id=True,
            joins=_joins(any_join=_V2_JOIN, all_join=_V2_JOIN, any_counts=False, verb="muxing"),
            checked=True,
            typed=True,
            unreadable="check_compatibility failed",
        ),
    )
}
"""By name."""
