"""XML Schema 1.0: any plan, whatever the capabilities."""

from __future__ import annotations

from gpsfsm.grammars.emit import Format, schema_path


def _text() -> str:
    return schema_path("xsd").read_text(encoding="utf-8")


FORMAT = Format("xsd", "gpsfsm-plan.xsd", fixed=_text)
