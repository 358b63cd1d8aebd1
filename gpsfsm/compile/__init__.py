"""Compilers: plan → automaton, one module per engine profile."""

from __future__ import annotations

from gpsfsm.compile.collecting import collecting_rarely
from gpsfsm.compile.paper import Compiled, compile_plan
from gpsfsm.compile.same_runs import same_runs
from gpsfsm.compile.trees import Unfolded, unfold
from gpsfsm.compile.units import TreePlan, UnitKind, Units, group_units

__all__ = [
    "Compiled",
    "TreePlan",
    "Unfolded",
    "UnitKind",
    "Units",
    "collecting_rarely",
    "compile_plan",
    "group_units",
    "same_runs",
    "unfold",
]
