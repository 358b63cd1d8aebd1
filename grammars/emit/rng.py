"""RELAX NG, XML syntax: any plan, whatever the capabilities."""

from __future__ import annotations

from gpsfsm.grammars.emit._format import Format
from gpsfsm.grammars.schemas import schema_path

__all__ = ["FORMAT"]


def _text() -> str:
    return schema_path("rng").read_text(encoding="utf-8")


FORMAT = Format("rng", "gpsfsm-plan.rng", fixed=_text)
