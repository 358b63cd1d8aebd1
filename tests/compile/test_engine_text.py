"""``read_connections``: a text, an engine, and the plan's elements behind connections."""

from __future__ import annotations

import pytest

from gpsfsm.compile.engine_text import read_connections
from gpsfsm.errors import InputError, UsageError
from gpsfsm.model.engine import Crashed, EnginePlan, Rejected
from gpsfsm.syntax import Limits

GO = '<Runner interface="A" provider="A"/>'


@pytest.mark.parametrize("engine", ["fabric-v1", "fabric-v2"])
def test_connections_lead_back_to_the_plan(engine: str) -> None:
    text = (
        f'said: <!-- c --><Plan>\n{GO}<Control type="sequential"/>t\n'
        f'<Control type="parallel_all">{GO}<!-- c -->{GO}</Control></Plan>'
    )
    reading = read_connections(text, engine)
    assert isinstance(reading.result, EnginePlan)
    plan = reading.plan
    assert plan is not None
    behind = [reading.element(each) for each in reading.result.connections]
    # The empty control leaves a gap, of which the entry without a source is made.
    runners = [element.index for element in plan.runners]
    join = plan.elements[0].children[2]
    assert behind == [runners[0], None, runners[1], runners[2], join, None]
    assert plan.location(join).line == 3


def test_bytes_are_read_as_the_engine_reads_them() -> None:
    text = (
        b'<?xml version="1.0" encoding="latin-1"?><Plan><Runner interface="\xc3\xa9" provider=""/>'
    )
    reading = read_connections(text + b"</Plan>", "fabric-v2")
    assert isinstance(reading.result, EnginePlan)
    assert reading.result.connections[0].source.interface == "é"
    for marked in ("utf-8-sig", "utf-16"):
        reading = read_connections(f"<Plan>{GO}</Plan>".encode(marked), "fabric-v2")
        assert isinstance(reading.result, EnginePlan if marked == "utf-8-sig" else Rejected)


def test_places_of_refusals() -> None:
    reading = read_connections("\ufeff<Plan>\n <Bad/></Plan>", "fabric-v2")
    assert isinstance(reading.result, Rejected)
    assert (reading.plan, reading.line, reading.column) == (None, 2, 2)
    reading = read_connections("\ufeff<Bad/>", "fabric-v2")
    assert isinstance(reading.result, Crashed)
    assert (reading.line, reading.column) == (1, 1)


def test_misuse() -> None:
    with pytest.raises(UsageError, match="fabric-v1, fabric-v2"):
        read_connections("<Plan/>", "fabric")
    with pytest.raises(InputError, match=r"^file: .*--max-bytes"):
        read_connections("<Plan/>", "fabric-v2", file="file", limits=Limits(max_bytes=3))
    with pytest.raises(InputError, match=r"^file: line 1: .*--max-elements"):
        read_connections("<a/>" * 1100, "fabric-v2", file="file", limits=Limits(max_elements=9))
