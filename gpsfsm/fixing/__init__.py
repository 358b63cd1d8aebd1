"""Edits that remove findings without a language model, after the example of ruff's ``--fix``."""

from __future__ import annotations

from gpsfsm.fixing.compare import Sameness, sameness
from gpsfsm.fixing.engine import Fixed, fix_text
from gpsfsm.fixing.fixer import Applied, Edit, Fix, Safety

__all__ = ["Applied", "Edit", "Fix", "Fixed", "Safety", "Sameness", "fix_text", "sameness"]
