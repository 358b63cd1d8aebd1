"""Answers of language models, with the defects that real ones have."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from gpsfsm.strategies._defects_of_plans import OF_PLANS
from gpsfsm.strategies._defects_of_texts import AROUND, INSTEAD, OF_MARKUP
from gpsfsm.strategies._plans import plans

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hypothesis.strategies import DrawFn, SearchStrategy

__all__ = ["DEFECTS", "Answer", "answers"]

_DEFECTS = {defect.name: defect for defect in (*OF_PLANS, *OF_MARKUP, *AROUND, *INSTEAD)}

DEFECTS: dict[str, str] = {name: defect.told for name, defect in _DEFECTS.items()}
"""What can be wrong with an answer, by name."""


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer: its text, the plan that was meant, and the names of its defects."""

    text: str
    plan: str
    defects: tuple[str, ...]


def answers(
    plan: SearchStrategy[str] | None = None,
    *,
    defects: Sequence[str] = tuple(DEFECTS),
    min_defects: int = 0,
    max_defects: int = 3,
) -> SearchStrategy[Answer]:
    r"""Draw an answer that was to be a plan, with some of these defects (names of ``DEFECTS``).

    ``plan`` draws the text of the plan that is meant. Every defect that ``Answer.defects`` names
    changes the text. Shrinks to an answer that is a plan and nothing else. Raises ValueError for a
    defect that does not exist.

    >>> from hypothesis import find, settings, strategies as st
    >>> simple = st.just("<Plan>\n  <Runner/>\n</Plan>\n")
    >>> fenced = answers(simple, defects=("fence", "plan-attributes"), min_defects=2)
    >>> print(find(fenced, lambda answer: True, settings=settings(database=None)).text)
    ```xml
    <Plan ID="MainTree">
      <Runner/>
    </Plan>
    ```
    <BLANKLINE>
    """
    for name in defects:
        if name not in _DEFECTS:
            raise ValueError(f"there is no defect '{name}'; there are {', '.join(DEFECTS)}")
    meant = plans(max_runners=5) if plan is None else plan
    return _answers(meant, tuple(defects), min_defects, max_defects)


@st.composite
def _answers(
    draw: DrawFn,
    plan: SearchStrategy[str],
    defects: tuple[str, ...],
    min_defects: int,
    max_defects: int,
) -> Answer:
    meant = text = draw(plan)
    names = st.lists(
        st.sampled_from(defects), unique=True, min_size=min_defects, max_size=max_defects
    )
    # a stable order: what is wrong with the plan first, what is around it last
    wanted = sorted(draw(names) if defects else [], key=[*_DEFECTS].index)
    found: list[str] = []
    for name in wanted:
        changed = _DEFECTS[name].put(draw, text)
        if changed != text:
            text = changed
            found.append(name)
    return Answer(text, meant, tuple(found))
