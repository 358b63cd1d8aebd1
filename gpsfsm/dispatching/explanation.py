"""The explanation of an end: where a run left the plan, by the automaton of its engine.

A server only says RUNNING, for ever, when a plan has come to nothing. The automaton says which
event led nowhere: a failure that nothing takes, a join that waits for an input that cannot come, or
one that got an input too many.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.records import Kind, Status
from gpsfsm.model.automaton import NodeKind, Signal
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from gpsfsm.dispatching.mirror import Trace
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.watch.record_text import Words

_WAITS = "the server keeps waiting (HANG)"
_EVENTS = {Kind.SUCCEEDED: Event.SUCCEEDED, Kind.FAILED: Event.FAILED}
_MOST = 20


def explained(
    status: Status, trace: Trace, words: Words, now_us: int, *, has_events: bool
) -> list[str]:
    """Sentences about where a run stands, or has ended.

    ``has_events``: the events of its runners were followed; without them nothing is said of these.
    """
    where = _Where(trace, words)
    if status is Status.HANG:
        return where.hangs()
    if status is Status.ABORT:
        return where.aborts()
    if status is Status.COMPLETED:
        return where.recovered()
    if not has_events:
        return ["it is unknown which runners acted: no events from them were received"]
    return where.active(now_us)


def quiet(trace: Trace, words: Words, *, has_events: bool) -> list[str]:
    """Sentences about the instances that act while no event comes; none if events cannot come."""
    return _Where(trace, words).quiet() if has_events else []


class _Where:
    def __init__(self, trace: Trace, words: Words) -> None:
        self._trace, self._words = trace, words
        self._automaton: Automaton = words.automaton

    def _name(self, node: int) -> str:
        return f"line {self._words.element(node).line}: {self._words.node(node)}"

    def _leads(self, node: int, kind: Kind) -> tuple[int, ...]:
        return tuple(self._automaton.outputs.get(Signal(node, _EVENTS[kind]), ()))

    def hangs(self) -> list[str]:
        ended = self._trace.ended.items()
        dead = [node for node, kind in ended if kind is Kind.FAILED and not self._leads(node, kind)]
        sentences = [
            f"the plan left its specified part at {self._name(node)}: it failed, and nothing "
            f"follows that; {_WAITS}"
            for node in dead
        ]
        sentences += self._waiting_joins()
        if not sentences:
            last = [node for node, kind in ended if not self._leads(node, kind)]
            sentences = [
                f"the plan left its specified part at {self._name(node)}: it succeeded, and "
                f"nothing follows that; {_WAITS}"
                for node in last[-1:]
            ]
        return sentences[:_MOST] or [f"nothing more can happen; {_WAITS}"]

    def _arrived(self) -> dict[int, int]:
        """The number of inputs that each join got."""
        arrived: dict[int, int] = {}
        events = [Signal(node, _EVENTS[kind]) for node, kind in self._trace.ended.items()]
        events += [Signal(node, Event.SUCCEEDED) for node in sorted(self._trace.joined)]
        for signal in events:
            for target in self._automaton.outputs.get(signal, ()):
                if self._automaton.nodes[target].kind is NodeKind.JOIN:
                    arrived[target] = arrived.get(target, 0) + 1
        return arrived

    def _waiting_joins(self) -> list[str]:
        return [
            f"the join of {self._name(node)} has {inputs} of {self._automaton.nodes[node].need} "
            f"inputs, and no more can come; {_WAITS}"
            for node, inputs in self._arrived().items()
            if node not in self._trace.joined
        ]

    def aborts(self) -> list[str]:
        many = [
            node
            for node, inputs in self._arrived().items()
            if inputs > 1 or node in self._automaton.traits.looping
        ]
        return [
            f"the plan left its specified part at {self._name(node)}: its join got an input after "
            "it had fired, so the Capabilities2 server aborts; restart it"
            for node in many
            if node in self._automaton.traits.breaking
        ] or ["the Capabilities2 server aborts at one input too many; restart it"]

    def recovered(self) -> list[str]:
        """The failures that something took, and what acts on."""
        failed = [
            f"{self._name(node)} failed, and the plan continued"
            for node, kind in self._trace.ended.items()
            if kind is Kind.FAILED
        ]
        acting = [
            f"{self._name(node)} was still active, and may continue to act until the next plan"
            for node in self._trace.active
        ]
        return [*failed[:_MOST], *acting[:_MOST]]

    def quiet(self) -> list[str]:
        """The instances that act."""
        acting = [*self._trace.active][:_MOST]
        return [f"{self._name(node)} is active, but no event comes from it" for node in acting]

    def active(self, now_us: int) -> list[str]:
        """The instances that act, as far as events say so."""
        engine = self._automaton.traits.engine
        return [
            f"{self._name(node)} was active for {(now_us - since) / 1e6:.1f} s without an event; "
            f"if it has failed or its goal was rejected, the server waits for ever: on {engine} "
            "not every failure is an event"
            for node, since in self._trace.active.items()
        ][:_MOST]
