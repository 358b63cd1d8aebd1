"""Whether an engine does with a text what the paper says of it, outcome by outcome.

The paper's side is the oracle's, written from docs/semantics.md; the engine's side plays the
connections as tests/oracle/engine.py does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

from gpsfsm.compile.engine_text import read_connections
from gpsfsm.model.engine import EnginePlan
from tests.equivalence.brute import Observed
from tests.oracle import P, R
from tests.oracle.engine import Machine
from tests.oracle.model import C

if TYPE_CHECKING:
    from gpsfsm.model.engine import EngineNode

History = tuple[tuple[int, bool], ...]
Seen = tuple[frozenset[int], str]
"""What has been triggered by now, and how the run has ended by now."""

_NO_PARAMETERS = ("interface", "provider", "name", "id")


def abstract(text: str) -> P:
    """The plan of a well-formed text."""
    return P(tuple(map(_node, ET.fromstring(text))))  # noqa: S314  (made by the tests)


def _node(element: ET.Element) -> C | R:
    if element.tag == "Control":
        kind = element.get("type")
        assert kind in ("sequential", "recovery", "parallel_any", "parallel_all")
        return C(kind, tuple(map(_node, element)))
    attributes = [f"{n}={v}" for n, v in element.attrib.items() if n not in _NO_PARAMETERS]
    return R(" ".join([element.attrib["interface"], *attributes]))


class OnEngine:
    """A text as an engine runs it; instances are numbers in document order."""

    def __init__(self, text: str, engine: str) -> None:
        result = read_connections(text, engine).result
        assert isinstance(result, EnginePlan), result
        self.machine = machine = Machine(result)
        ordered = sorted(machine.leaves, key=lambda leaf: machine.of[leaf].source.element or 0)
        self.leaves = ordered
        self.number = {leaf: number for number, leaf in enumerate(ordered)}

    def seen(self, history: History) -> Seen:
        triggered: set[int] = set()
        arrived: dict[int, int] = {}
        end = ""

        def trigger(target: EngineNode | None) -> None:
            nonlocal end
            if target is None or not target.named or end:
                return
            of = self.machine.of[target.instance]
            if target.instance in self.machine.done:
                end = "completed"
            elif target.instance in self.number:
                triggered.add(self.number[target.instance])
                if self.machine._starts(target.instance):
                    trigger(of.on_start)
            else:
                count = arrived[target.instance] = arrived.get(target.instance, 0) + 1
                if count > 1 and not of.source.interface.endswith("AllRunner"):
                    end = "aborted"
                elif count == self.machine._expected(of):
                    trigger(of.on_success)

        begin = self.machine.begin
        trigger(None if begin is None else begin.source)
        for number, succeeds in history:
            of = self.machine.of[self.leaves[number]]
            trigger(of.on_success if succeeds else of.on_failure)
        if not end and triggered <= {number for number, _ in history}:
            end = "gave up"  # it hangs, which is all that it can do
        return frozenset(triggered), end


def unfaithful(text: str, engine: str) -> History | None:
    """A history after which the engine does something else than the paper says of the text."""
    paper, on_engine = Observed(abstract(text)), OnEngine(text, engine)
    pending: list[History] = [()]
    while pending:
        history = pending.pop()
        here, there = paper.seen(frozenset(history)), on_engine.seen(history)
        if here != there:
            return history
        triggered, end = here
        if not end:
            done = {number for number, _ in history}
            pending += [(*history, (n, good)) for n in triggered - done for good in (True, False)]
    return None
