"""The rule catalogue, found by the names of its modules.

A rule that turns verdicts into findings has a few lines that do it (``Rule.find``, of GP7xx
``Rule.find_on_engine``). A module holds one such ``RULE``, as ``gp302_dangling_failure.py`` does,
or the ``RULES`` of a family, as ``gp40x_values.py`` does: the ``x`` stand for any digit. What is
reported elsewhere needs only documentation: the front end reports GP1xx and GP8xx, ``tasks``
GP6xx, ``checking`` GP9xx and GP701 to GP703 (docs/adr/0007-documentation-rules-in-families.md).
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

from gpsfsm.analysis.rules.base import Rule
from gpsfsm.errors import UsageError

__all__ = [
    "Rule",
    "all_rules",
    "rule",
    "rules_of_engines",
    "rules_of_plans",
    "says_no_verdict",
    "select_rules",
]

NOT_FOR_TREES = frozenset(
    {
        *("GP201", "GP202", "GP203", "GP204", "GP205", "GP206", "GP207", "GP208", "GP209", "GP210"),
        *("GP212", "GP213", "GP303", "GP307", "GP308", "GP309", "GP310", "GP311", "GP312", "GP315"),
        *("GP316", "GP317"),
    }
)
"""Rules that do not speak of trees.

GP2xx: capability files describe runners, a TreeNodesModel describes nodes; under a robot profile,
they speak of the runners that leaves stand for (``machines/runners.py``). GP303 and GP311: a
Parallel halts what still runs when it ends. The others speak of recoveries, which trees do not
have; a Retry, for one, repeats an action on purpose.
"""

OPEN_IN_GATES = frozenset({"GP211", "GP214"})
"""Rules whose findings leave open what a plan does on the robot: a gate does not decide then."""

NO_VERDICT = frozenset({"GP103", "GP901", "GP902", "GP903", "GP904", "GP907", "GP908"})
"""Rules whose findings say why gpsfsm could not decide a plan."""


@cache
def all_rules() -> tuple[Rule, ...]:
    """All rules, by code."""
    return _rules_below("")


@cache
def rules_of_plans() -> tuple[Rule, ...]:
    """The rules with ``find``, by code; the documentation of others is not loaded for them."""
    return tuple(each for digit in "2345" for each in _rules_below(digit) if each.find is not None)


@cache
def rules_of_engines() -> tuple[Rule, ...]:
    """The rules with ``find_on_engine``, by code."""
    return tuple(each for each in _rules_below("7") if each.find_on_engine is not None)


def _rules_below(digits: str) -> tuple[Rule, ...]:
    """The rules whose codes begin so, by code."""
    rules = [
        rule
        for module in _modules()
        if module.startswith(f"gp{digits}")
        for rule in _rules_in(module)
    ]
    return tuple(sorted(rules, key=lambda each: each.code))


@cache
def _modules() -> tuple[str, ...]:
    """The names of the modules with rules, which begin with a code, or with that of a family."""
    names = (each.name for each in pkgutil.iter_modules(__path__))
    return tuple(name for name in names if name.startswith("gp"))


@cache
def _rules_in(name: str) -> tuple[Rule, ...]:
    module = importlib.import_module(f"{__name__}.{name}")
    return module.RULES if hasattr(module, "RULES") else (module.RULE,)


def rule(code_or_name: str) -> Rule:
    """The rule with this code or name; raises UsageError if there is none."""
    wanted = code_or_name.strip()
    code = wanted.upper()
    for module in _modules():  # by the names of the files, so that only one of them is loaded
        family = module.partition("_")[0].rstrip("x").upper()
        if code.startswith(family):
            for each in _rules_in(module):
                if each.code == code:
                    return each
    for each in all_rules():
        if each.name == wanted.lower():
            return each
    raise UsageError(f"there is no rule '{wanted}'; 'gpsfsm explain' lists all rules")


def says_no_verdict(code: str) -> bool:
    """True if findings of this rule say why gpsfsm could not decide a plan.

    They are always shown: hiding them would hide why the exit code is 2.
    """
    return code in NO_VERDICT


def select_rules(selectors: tuple[str, ...]) -> frozenset[str]:
    """The codes that ``selectors`` name: codes, names, prefixes (``GP3``) or ``ALL``.

    Raises UsageError for a selector that matches nothing.
    """
    codes: set[str] = set()
    for selector in selectors:
        wanted = selector.strip()
        matching = {
            each.code
            for each in all_rules()
            if wanted.upper() == "ALL"
            or each.code.startswith(wanted.upper())
            or each.name == wanted.lower()
        }
        if not wanted or not matching:
            raise UsageError(f"no rule matches '{selector}'; 'gpsfsm explain' lists all rules")
        codes |= matching
    return frozenset(codes)
