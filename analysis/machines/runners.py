"""The rules about single runners, applied to those of a machine: names, parameters, types, needs.

An instance of a machine may have several triggers, so that what arrives at it is known only where
all of them hand over nothing, or where there is one (semantics, 8.2 and 9.4). Of what is not known
nothing is said.

    A SUCCEEDED → C, B SUCCEEDED → C     what arrives at C is unknown if A or B gives anything
    A STARTED → C, start → C             nothing arrives at C: its parameters are as written

The leaves of a behaviour tree are runners where a robot profile says which: these rules look at
what each stands for (``StandIn``). Leaves hand over nothing.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from gpsfsm.analysis.context import Context
from gpsfsm.analysis.decisions.data_flow import DataFlow, missing_needs, overwritten_attributes
from gpsfsm.analysis.flow import Values
from gpsfsm.analysis.rules import rule, rules_of_plans
from gpsfsm.analysis.rules.names import MAX_RELATED, quoted
from gpsfsm.analysis.words import listed
from gpsfsm.capabilities.library import bind, of_type, part_of, written_for
from gpsfsm.model.automaton import NodeKind
from gpsfsm.model.capability import OWN, Effects, Outcomes
from gpsfsm.model.event import Event
from gpsfsm.model.finding import Related
from gpsfsm.model.plan import Attribute
from gpsfsm.model.tree import builtin_of, is_reference

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.analysis.claims import Claim
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.capabilities.library import Capabilities, Library
    from gpsfsm.compile import Compiled
    from gpsfsm.model.capability import Binding, Filling, Input, Leaf, Parameter, Provider
    from gpsfsm.model.finding import Finding, Scenario
    from gpsfsm.model.plan import Element, Plan, Value
    from gpsfsm.model.story import Sentence, Statement
    from gpsfsm.model.tree import Forest

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


# --- the leaves of a behaviour tree on a robot ----------------------------------------------------


class StandIn(NamedTuple):
    """The runner that a leaf stands for, as a plan would write it, and what is known of it.

    ``open``: why nobody knows what the leaf does on the robot, "" if that is known.
    """

    runner: Element
    binding: Binding | None = None
    open: str = ""

    @property
    def acting(self) -> Binding | None:
        """The binding for the run of a tree, in which values and declared outcomes do not count."""
        if self.binding is None or self.runner.interface in OWN:
            return self.binding
        provider = self.binding.provider
        outcomes = Outcomes(may_hang=provider.outcomes.may_hang)
        return replace(self.binding, provider=replace(provider, inputs=(), outcomes=outcomes))


def stand_ins(plan: Plan, forest: Forest | None, capabilities: Capabilities) -> Sequence[StandIn]:
    """The runners that the leaves of a tree stand for, by their number; none if nothing says any.

    Leaves under the full name of a runner stand for it, with and without a profile.
    """
    library, robot = capabilities.library, capabilities.robot
    names = {each.interface for each in plan.runners}.difference(OWN)
    if robot is None and not any("/" in name for name in names):
        return ()
    leaves = {leaf.name: leaf for leaf in library.leaves}
    own = {
        (node.file, node.start): node.identity
        for node in (() if forest is None else forest.nodes)
        if node.children and builtin_of(node.identity, len(node.children)) is None
    }
    made = []
    for runner, bound in zip(plan.runners, bind(plan, library), strict=True):
        if runner.interface in OWN:
            name = own.get(runner.spot, "")
            why = f"nobody knows what the node {quoted(name)} with its children does"
            made.append(StandIn(runner, bound, open=why if name else ""))
        elif runner.interface in leaves:
            made.append(_by_profile(runner, leaves[runner.interface], library))
        elif "/" in runner.interface:
            made.append(_settled(runner, library))
        else:
            why = f"the leaf {quoted(runner.interface)} stands for no runner"
            made.append(StandIn(replace(runner, attributes=(), written=None), open=why))
    return made


def _by_profile(runner: Element, leaf: Leaf, library: Library) -> StandIn:
    """The runner of ``leaves``; what is read from the blackboard is unknown before the run."""
    provider = library.resolve(leaf.runner, "").provider
    assert provider is not None, "the profile was compared with the library"
    place = runner.line, runner.column
    names = (("interface", leaf.runner), ("provider", provider.name))
    attributes = [Attribute(name, text, text, *place) for name, text in names]
    for filling in leaf.fillings:
        text = written_for(filling, runner)
        if text is not None and not is_reference(text):
            text = part_of(text, filling, leaf, library)
        text = filling.text if text is None else text
        if text is None:
            continue  # GP204 tells what is missing
        value = _typed(text, provider.parameter(filling.parameter), filling)
        port = next((each for each in runner.attributes if each.name == filling.port), None)
        at = place if port is None else (port.line, port.column)
        shown = text if isinstance(value, str) else repr(value)
        attributes.append(Attribute(filling.parameter, shown, value, *at))
    return _settled(replace(runner, attributes=tuple(attributes), written=None), library)


def _typed(text: str, parameter: Parameter | None, filling: Filling) -> Value:
    """The value of a parameter; its text where that is none of its type, as GP205 tells."""
    assert parameter is not None, "the profile was compared with the library"
    try:
        return of_type(text, parameter, filling)
    except ValueError:
        return text


def _settled(runner: Element, library: Library) -> StandIn:
    """The stand-in for a runner, without what is read from the blackboard."""
    binding = library.bind(runner)
    if any(is_reference(each.text) for each in runner.attributes):
        kept = tuple(each for each in runner.attributes if not is_reference(each.text))
        runner = replace(runner, attributes=kept, written=None)
    if binding is None:
        return StandIn(runner)
    read = {name for name, each in binding.written.items() if is_reference(each.text)}
    provider = replace(
        binding.provider,
        configuration=tuple(_filled_in(binding.provider.configuration, read)),
        inputs=tuple(_filled_in(binding.provider.inputs, read)),
        outputs=(),
        effects=Effects(),
    )
    written = {name: each for name, each in binding.written.items() if name not in read}
    limited = [quoted(name) for name in sorted(read) if _is_limited(provider, name)]
    why = (
        f"the blackboard supplies {listed(limited)} of {quoted(runner.interface)}, and nothing "
        "keeps such values within what is accepted"
    )
    binding = replace(binding, provider=provider, written=written)
    return StandIn(runner, binding, open=why if limited else "")


_Declared = TypeVar("_Declared", "Parameter", "Input")


def _filled_in(declared: Iterable[_Declared], read: Collection[str]) -> Iterator[_Declared]:
    """The same, without a need for what is read from the blackboard."""
    for each in declared:
        yield replace(each, required=False) if each.name in read else each


def _is_limited(provider: Provider, name: str) -> bool:
    """True if a robot does not accept every value of a parameter."""
    parameter = provider.parameter(name)
    bounded = parameter is not None and (
        (parameter.minimum, parameter.maximum) != (None, None) or bool(parameter.choices)
    )
    return bounded or any(name == each for _, each in provider.reaches)


def leaf_findings(
    compiled: Compiled,
    leaves: Sequence[StandIn],
    capabilities: Capabilities,
    options: AnalysisOptions,
) -> Iterator[Finding]:
    """The findings about the leaves of a tree as runners of a robot, and those left open."""
    plan = compiled.automaton.plan
    elements = [*plan.elements]
    for each in leaves:
        elements[each.runner.index] = each.runner
    of_robot = replace(
        compiled,
        automaton=replace(compiled.automaton, plan=replace(plan, elements=tuple(elements))),
        bindings=tuple(each.binding for each in leaves),
    )
    reached = frozenset(range(len(leaves)))
    yield from runner_findings(RunnersContext(of_robot, capabilities, options, reached))
    robot = capabilities.robot
    groups: dict[str, list[Element]] = {}
    for each in leaves:
        if each.open and robot is not None:
            groups.setdefault(each.open, []).append(each.runner)
    for why, (first, *rest) in groups.items():
        assert robot is not None, "without a robot nothing is said of it"
        related = tuple(Related(plan.location(each)) for each in rest[:MAX_RELATED])
        message = f"{why} on the robot {quoted(robot.name)}"
        yield rule("GP214").finding(message, plan.location(first), related=related)
