"""The analyses: each is one module of this package with an ``ANALYSIS``.

A new analysis is a new module; nothing else has to name it.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from typing import TYPE_CHECKING, Any

from gpsfsm.late import dataclass

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.analysis.proof.refutation import Refutation
    from gpsfsm.analysis.proof.witnesses import Witnesses
    from gpsfsm.analysis.solver import Solver
    from gpsfsm.analysis.structure import Structure
    from gpsfsm.compile import Compiled


@dataclass(frozen=True, slots=True)
class Analysis:
    """One question about a plan, with two independent ways to decide it.

    ``by_structure`` is exact where ``Constraints.independent`` holds, ``by_solver`` always; it may
    raise InconclusiveError. Their answers are equal or gpsfsm has a defect. ``facts`` turns the
    answer into fields of ``Facts``; it gets None where a limit was hit. ``questions`` are terms
    that ``by_solver`` is going to ask: all analyses' are put to z3 in one text, which saves time.

    A structural answer is proved by ``refute``, which says what never holds if it is right, and
    ``show``, which says what runs show; either may raise UnprovedError, and then ``by_solver``
    answers too. ``matters``: a verdict rests on the answer under these options. Without
    ``compared`` it never does, and the structural answer stands as it is.
    """

    name: str
    by_structure: Callable[[Structure], Any]
    by_solver: Callable[[Solver], Any]
    facts: Callable[[Any, Compiled], Mapping[str, Any]]
    questions: Callable[[Solver], Iterable[str]] = lambda _: ()
    refute: Callable[[Any, Refutation], None] | None = None
    show: Callable[[Any, Witnesses], None] | None = None
    matters: Callable[[AnalysisOptions], bool] = lambda _: True
    compared: bool = True


@cache
def analyses() -> tuple[Analysis, ...]:
    """All analyses by name: every module of this package."""
    modules = sorted(module.name for module in pkgutil.iter_modules(__path__))
    return tuple(importlib.import_module(f"{__name__}.{name}").ANALYSIS for name in modules)
