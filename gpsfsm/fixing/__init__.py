"""Edits that remove findings, without any language model: the model is ruff's ``--fix``."""

from __future__ import annotations

from gpsfsm.fixing.edit import Edit, Fix, Safety
from gpsfsm.fixing.engine import Fixed, fix_text
from gpsfsm.fixing.sameness import Sameness, sameness

__all__ = ["Edit", "Fix", "Fixed", "Safety", "Sameness", "fix_text", "sameness"]
