"""Bounds of what runs do by themselves: plans that they run, plans that a model writes for them."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.chain import Policy
    from gpsfsm.execution.records import RunValue

MAX_PLANS = 20
"""The plans that one queue runs, if nothing else is said."""

REGENERATIONS, REGENERATE_FOR_S, ATTEMPTS = 3, 600.0, 3
"""The plans that a model writes behind one that gave up, its seconds, its attempts for each."""

MOST_REGENERATIONS, MOST_S, MOST_ATTEMPTS = 100, 1e6, 100


def max_plans_of(options: Mapping[str, RunValue]) -> int:
    """The number of plans that run, by the heading of a run."""
    most = options.get("max_plans")
    return most if isinstance(most, int) else MAX_PLANS


def attempts_of(options: Mapping[str, RunValue]) -> int:
    """The requests to a model for each plan, by the heading of a run."""
    attempts = options.get("attempts")
    return attempts if type(attempts) is int and 1 <= attempts <= MOST_ATTEMPTS else ATTEMPTS


def policy_of(options: Mapping[str, RunValue]) -> Policy | None:
    """The bounds of continuation, by the heading of a run; None for not at all.

    Never further than the options allow, whatever a journal says.
    """
    continuations, total_s = options.get("regenerations"), options.get("regenerate_for_s")
    if type(continuations) is not int:
        return None
    from gpsfsm.execution.chain import Policy  # few runs ask a model

    wished = total_s if isinstance(total_s, int | float) else MOST_S
    bounded = MOST_S if wished > MOST_S else float(wished)  # no number is left for Policy to refuse
    return Policy(min(continuations, MOST_REGENERATIONS), bounded)
