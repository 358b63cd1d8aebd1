"""RELAX NG, compact syntax: any plan, whatever the capabilities."""

from __future__ import annotations

from gpsfsm.grammars.emit import Format, schema_path


def _text() -> str:
    return schema_path("rnc").read_text(encoding="utf-8")


FORMAT = Format("rnc", "gpsfsm-plan.rnc", fixed=_text)
