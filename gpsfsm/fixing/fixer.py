"""What a fixer is: documentation, and a function that proposes fixes."""

from __future__ import annotations

import os
from dataclasses import dataclass
from itertools import islice
from typing import TYPE_CHECKING

from gpsfsm.errors import DEBUG_VARIABLE, is_out_of_memory
from gpsfsm.fixing.edit import Fix, Safety

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from gpsfsm.fixing.draft import Draft

__all__ = ["Fixer", "Safety", "proposals_of"]


@dataclass(frozen=True, slots=True)
class Fixer:
    """One kind of repair.

    ``rules`` are those whose findings it removes. ``safe`` and ``unsafe`` say in one sentence
    what it does of each kind, and why it is of that kind ("": it proposes none of that kind).
    ``reveals`` are rules whose findings may come to light by it, which were hidden before.
    ``first``: it comes before all others, whatever its rule. ``asked``: it only acts where a user
    names one of its rules in the selection.
    """

    name: str
    rules: tuple[str, ...]
    propose: Callable[[Draft], Iterable[Fix]]
    safe: str = ""
    unsafe: str = ""
    reveals: frozenset[str] = frozenset()
    first: bool = False
    asked: bool = False


def proposals_of(
    fixer: Fixer, draft: Draft, *, most: int, failed: dict[str, str] | None = None
) -> list[Fix]:
    """The first ``most`` proposals; those before the defect, should the fixer have one.

    The defect goes into ``failed`` by the name of the fixer. It is raised if the environment says
    that defects are to be shown.
    """
    found: list[Fix] = []
    try:
        found.extend(islice(fixer.propose(draft), most))
    except Exception as error:
        if is_out_of_memory(error):
            raise MemoryError from error
        if os.environ.get(DEBUG_VARIABLE):
            raise
        if failed is not None:
            failed[fixer.name] = f"{type(error).__name__}: {error}"
    return found
