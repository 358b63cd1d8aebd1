"""Compilers: a plan, a behaviour tree or an engine's connections → automaton."""

from __future__ import annotations

from gpsfsm.compile.paper import Compiled, compile_plan
from gpsfsm.compile.units import MachinePlan, TreePlan, UnitKind, Units, group_units

__all__ = [
    "Compiled",
    "MachinePlan",
    "TreePlan",
    "UnitKind",
    "Units",
    "compile_plan",
    "group_units",
]
