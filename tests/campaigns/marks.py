"""Parts of docs/reliability.md that are generated stand between marks."""

from __future__ import annotations

import re
from pathlib import Path

__all__ = ["PAGE", "replaced"]

PAGE = Path(__file__).resolve().parents[2] / "docs" / "reliability.md"


def replaced(text: str, mark: str, new: str) -> str:
    """The text with what stands between the two marks replaced; an error if they are not there."""
    pattern = re.compile(rf"(<!-- {mark} -->\n).*?(<!-- /{mark} -->)", re.DOTALL)
    result, count = pattern.subn(lambda match: f"{match[1]}{new}\n{match[2]}", text)
    assert count == 1, mark
    return result
