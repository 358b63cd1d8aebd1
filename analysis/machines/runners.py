"""The rules about single runners, applied to those of a machine: names, parameters, types, needs.

An instance of a machine may have several triggers, so that what arrives at it is known only where
all of them hand over nothing, or where there is one (semantics, 8.2 and 9.4). Of what is not known
nothing is said.

    A SUCCEEDED → C, B SUCCEEDED → C     what arrives at C is unknown if A or B gives anything
    A STARTED → C, start → C             nothing arrives at C: its parameters are as written
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decisions.data_flow import DataFlow, missing_needs, overwritten_attributes
from gpsfsm.analysis.flow import Values
from gpsfsm.analysis.rules import rules_of_plans
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.claims import Claim
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.compile import Compiled
    from gpsfsm.model.finding import Finding, Scenario
    from gpsfsm.model.story import Sentence, Statement

_FURTHER = frozenset({"GP401"})
"""Rules beside GP2xx that look at one instance alone."""
_OUTCOMES = (Event.SUCCEEDED, Event.FAILED)


class _MachineValues(Values):
    """The values that arrive, where all triggers agree; else anything may arrive."""

    def __init__(self, compiled: Compiled) -> None:
        super().__init__(compiled)
        automaton = compiled.automaton
        for number, node in enumerate(automaton.runners):
            signals = automaton.inputs[node.index]
            givers = [
                signal
                for signal in signals
                if automaton.nodes[signal.node].kind is NodeKind.RUNNER
                and signal.event in _OUTCOMES
                and self._handed_over(automaton.runner_number(signal.node), signal.event) != {}
            ]
            if len(signals) == 1 and givers:
                continue  # as in a plan
            self.source[number], self.event[number] = -1, None
            self.arriving[number] = None if givers else {}


class RunnersContext(Context):
    """A machine as the rules about single runners see it.

    ``reached``: the numbers of the instances that some run triggers; None if that is not known.
    """

    def __init__(
        self,
        compiled: Compiled,
        capabilities: Capabilities,
        options: AnalysisOptions,
        reached: frozenset[int] | None,
    ) -> None:
        self.compiled = compiled
        self.options = options
        self.bindings = compiled.bindings
        self.capabilities = capabilities
        self.automaton = compiled.automaton
        self.plan = self.automaton.plan
        self.terms = self.plan.vocabulary.terms
        self.engine = None
        numbers = range(len(self.plan.runners))
        self.reached = [reached is not None and number in reached for number in numbers]
        self.unit_of_runner = numbers
        self.values = _MachineValues(compiled)
        self.answers: Mapping[str, Any] = {"data_flow": None if reached is None else self._flow()}

    def _flow(self) -> DataFlow:
        missing, overwritten = missing_needs(self.values), overwritten_attributes(self.values)
        return DataFlow(
            missing=tuple(each for each in missing if self.reached[each.runner]),
            overwritten=tuple(each for each in overwritten if self.reached[each.runner]),
        )

    def scenario(self, rule: str, claim: Claim, *closing: Statement | Sentence) -> Scenario | None:
        """No scenario: these rules speak of every visit."""
        del rule, claim, closing
        return None

    def triggering(self, rule: str, number: int) -> Scenario | None:
        """No scenario either."""
        del rule, number
        return None


def runner_findings(context: RunnersContext) -> Iterator[Finding]:
    """The findings about single runners of a machine, by rule."""
    for each in rules_of_plans():
        if each.code.startswith("GP2") or each.code in _FURTHER:
            assert each.find is not None
            yield from each.find(context)
