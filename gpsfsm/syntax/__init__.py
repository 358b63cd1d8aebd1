"""The front end: text → plan. It never raises on bad input; it says what is wrong and where."""

from __future__ import annotations

from gpsfsm.syntax.frontend import Parsed, parse
from gpsfsm.syntax.source import DEFAULT_LIMITS, Limits
from gpsfsm.syntax.token_reader import Suppression

__all__ = ["DEFAULT_LIMITS", "Limits", "Parsed", "Suppression", "parse"]
