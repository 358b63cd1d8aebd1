"""Plans in XML, as what other things are converted to."""

from __future__ import annotations

from gpsfsm.compile.formats import Format
from gpsfsm.compile.formats.nested import write_plan

FORMAT = Format("plan", "plans in XML", lambda _begin, _file: False, None, write_plan)
