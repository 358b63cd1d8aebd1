"""The judge of the analyses: brute force over every scenario and every order of events.

Written from the semantics page alone, sharing no code with the compiler or the analyses and
preferring what is plainly right to what is fast. ``facts`` answers all questions of a plan as the
JSON contract words them; ``canonical_scenario`` and ``holds_for_all_fillings`` judge
counterexamples. Plans are written with ``P``, ``C`` and ``R`` or the short forms ``plan``,
``seq``, ``rec``, ``par_any`` and ``par_all``.
"""

from .constraint import Both, Constraint, Either, Implies, Not, Says
from .facts import canonical_scenario, facts, holds_for_all_fillings
from .graph import Graph, compile_plan
from .model import (
    COMPLETION,
    C,
    P,
    R,
    action_key,
    control_paths,
    par_all,
    par_any,
    plan,
    rec,
    runner_paths,
    seq,
    to_xml,
)
from .runs import FAILED, HANG, NO_START, SUCCEEDED, Run, System

__all__ = [
    "COMPLETION",
    "FAILED",
    "HANG",
    "NO_START",
    "SUCCEEDED",
    "Both",
    "C",
    "Constraint",
    "Either",
    "Graph",
    "Implies",
    "Not",
    "P",
    "R",
    "Run",
    "Says",
    "System",
    "action_key",
    "canonical_scenario",
    "compile_plan",
    "control_paths",
    "facts",
    "holds_for_all_fillings",
    "par_all",
    "par_any",
    "plan",
    "rec",
    "runner_paths",
    "seq",
    "to_xml",
]
