"""Assumptions: constraints between outcomes, written as a person would say them.

``parse_assumption`` reads the text, ``Assumption.bind`` finds the runner instances that its
selectors mean in one plan, and the functions answer questions about the resulting formula.
docs/assumptions.md defines the language. The parser is loaded with the first text to parse.
"""

from gpsfsm.analysis.assumptions.assumption import Assumption, Bound, Instances, parse_assumption
from gpsfsm.analysis.assumptions.formula import (
    Deviations,
    Formula,
    by_deviations,
    holds,
    runners,
    to_smt,
    unary,
)

__all__ = [
    "Assumption",
    "Bound",
    "Deviations",
    "Formula",
    "Instances",
    "by_deviations",
    "holds",
    "parse_assumption",
    "runners",
    "to_smt",
    "unary",
]
