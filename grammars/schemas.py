"""The schemas of all plans: RELAX NG (compact and XML syntax) and XSD."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from gpsfsm.errors import UsageError

__all__ = ["SCHEMAS", "relax_ng", "relax_ng_compact", "schema_path", "xsd"]

SCHEMAS: tuple[str, ...] = ("gpsfsm-plan.rnc", "gpsfsm-plan.rng", "gpsfsm-plan.xsd")
"""The file names of the schemas."""


def schema_path(name: str) -> Path:
    """The path of a schema, by file name or by its ending alone.

    Raises UsageError for any other name.

    >>> schema_path("rng").name
    'gpsfsm-plan.rng'
    """
    for known in SCHEMAS:
        if name in (known, known.rpartition(".")[2]):
            return Path(__file__).parent / known
    raise UsageError(f"there is no schema '{name}'; there are {', '.join(SCHEMAS)}")


@cache
def relax_ng() -> bytes:
    """The schema in the XML syntax of RELAX NG, encoded as an XML parser expects it.

    >>> relax_ng().startswith(b"<?xml")
    True
    """
    return schema_path("rng").read_bytes()


@cache
def relax_ng_compact() -> str:
    """The schema in the compact syntax of RELAX NG: the source, for people.

    >>> "start = plan" in relax_ng_compact()
    True
    """
    return schema_path("rnc").read_text(encoding="utf-8")


@cache
def xsd() -> bytes:
    """The schema in XML Schema 1.0, encoded as an XML parser expects it.

    >>> xsd().startswith(b"<?xml")
    True
    """
    return schema_path("xsd").read_bytes()
