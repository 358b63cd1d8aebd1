"""The rule catalogue: one module per rule, found by its file name ``gp302_dangling_failure.py``.

Each module holds one ``RULE``. Those of GP2xx to GP5xx also hold the few lines that turn verdicts
into findings (``RULE.find``). All others hold only documentation: the front end reports GP1xx, and
``checking``, ``selection`` and ``parallel`` report GP9xx.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from functools import cache

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.errors import UsageError

__all__ = ["Rule", "all_rules", "rule", "select_rules"]

_MODULE = re.compile(r"gp\d{3}_[a-z0-9_]+")


@cache
def all_rules() -> tuple[Rule, ...]:
    """All rules, by code."""
    names = (module.name for module in pkgutil.iter_modules(__path__))
    found = [
        importlib.import_module(f"{__name__}.{name}").RULE
        for name in names
        if _MODULE.fullmatch(name)
    ]
    return tuple(sorted(found, key=lambda rule: rule.code))


def rule(code_or_name: str) -> Rule:
    """The rule with this code or name; raises UsageError if there is none."""
    wanted = code_or_name.strip()
    for found in all_rules():
        if wanted.upper() == found.code or wanted.lower() == found.name:
            return found
    raise UsageError(f"there is no rule '{wanted}'; 'gpsfsm rule' lists them")


def select_rules(selectors: tuple[str, ...]) -> frozenset[str]:
    """The codes that ``selectors`` name: codes, names, prefixes (``GP3``) or ``ALL``.

    Raises UsageError for a selector that matches nothing.
    """
    codes: set[str] = set()
    for selector in selectors:
        wanted = selector.strip()
        matching = {
            found.code
            for found in all_rules()
            if wanted.upper() == "ALL"
            or found.code.startswith(wanted.upper())
            or found.name == wanted.lower()
        }
        if not wanted or not matching:
            raise UsageError(f"no rule matches '{selector}'; 'gpsfsm rule' lists them")
        codes |= matching
    return frozenset(codes)
