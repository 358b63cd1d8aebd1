"""Edits that remove findings, without any language model: the model is ruff's ``--fix``."""

from __future__ import annotations

from gpsfsm.fixing.edit import Edit, Fix, Safety
from gpsfsm.fixing.engine import Fixed, fix_text

__all__ = ["Edit", "Fix", "Fixed", "Safety", "fix_text"]
