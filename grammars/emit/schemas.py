"""Schemas of all plans, whatever the capabilities: RELAX NG in compact and XML syntax, and XSD.

They are files that are shipped.
"""

from __future__ import annotations

from functools import cache, partial
from pathlib import Path

from gpsfsm.errors import UsageError
from gpsfsm.grammars.emit import Format

SCHEMAS: tuple[str, ...] = ("gpsfsm-plan.rnc", "gpsfsm-plan.rng", "gpsfsm-plan.xsd")
"""The file names of the schemas."""


def schema_path(name: str) -> Path:
    """Return the path of a schema, by its file name or just the extension.

    Raises UsageError for any other name.

    >>> schema_path("rng").name
    'gpsfsm-plan.rng'
    """
    for file in SCHEMAS:
        if name in (file, file.rpartition(".")[2]):
            return Path(__file__).parents[1] / file
    raise UsageError(f"there is no schema '{name}'; the schemas are {', '.join(SCHEMAS)}")


@cache
def relax_ng() -> bytes:
    """Return the schema in the XML syntax of RELAX NG, as bytes for an XML parser.

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
    return _text("rnc")


@cache
def xsd() -> bytes:
    """The schema in XML Schema 1.0, encoded as an XML parser expects it.

    >>> xsd().startswith(b"<?xml")
    True
    """
    return schema_path("xsd").read_bytes()


def _text(name: str) -> str:
    return schema_path(name).read_text(encoding="utf-8")


FORMATS = tuple(
    Format(name, f"gpsfsm-plan.{name}", fixed=partial(_text, name))
    for name in ("rnc", "rng", "xsd")
)
