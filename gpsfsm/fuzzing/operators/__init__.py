"""Mutations of plans: one module each, which defines ``OPERATOR``; found by their file names."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from gpsfsm.fuzzing.operators.base import Mutation, Operator

__all__ = ["Mutation", "Operator", "operators"]


@cache
def operators() -> tuple[Operator, ...]:
    """All operators, in the order of their names.

    >>> [operator.name for operator in operators()]
    ['control-type', 'drop', 'parameter', 'rename', 'renest', 'replace', 'swap']
    """
    names = sorted(module.name for module in pkgutil.iter_modules(__path__))
    modules = (importlib.import_module(f"{__name__}.{name}") for name in names if name != "base")
    return tuple(module.OPERATOR for module in modules)
