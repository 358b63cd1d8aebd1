"""The runners of a simulation (``make`` of ``VirtualDriver``): of a world, drawn, or scripted."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.describe import specs
from gpsfsm.execution.registry import Mode, runner_class
from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.model.capability import CHOICE, Provider, ValueType
from gpsfsm.model.event import Event, Outcome
from gpsfsm.model.plan import value_key
from gpsfsm.simulation.base import WorldState, said_true

if TYPE_CHECKING:
    import random
    from collections.abc import Callable

    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.capability import Output, Span
    from gpsfsm.simulation.world import World

Bound = Mapping[tuple[str, str], Provider]
"""The providers that a plan's bindings mean, by interface and provider (``Kernel.bound``)."""
_USUAL_S = (1.0, 10.0)
_FOR_EVER_S = 1e12
_HANG = 0.05
_HOLDS_NOT = 0.5
_BASES = {
    ValueType.BOOLS: ValueType.BOOL,
    ValueType.INTS: ValueType.INT,
    ValueType.DOUBLES: ValueType.DOUBLE,
    ValueType.STRINGS: ValueType.STRING,
}


def world_services(world: World, library: Library, **others: Any) -> dict[str, Any]:
    """The services that the runners of one run share: ``world``, as it is at the beginning.

    Others, such as ``plans``, can be given along. Make new services for each run.
    """
    return {"world": WorldState(world, specs=specs(library)), **others}


def world_maker(
    world: World, library: Library, *, bound: Bound | None = None
) -> Callable[[str, str], Runner]:
    """Runners that act in a world (they find it in ``world_services``).

    A runner that has no simulated form of its own is drawn by chance, with the probability to fail
    that the world file gives for its interface.
    """

    def make(interface: str, provider: str) -> Runner:
        described = _provider(library, bound, (interface, provider))
        simulated = None if described is None else simulated_class(described)
        if simulated is not None:
            return simulated()
        return Drawn(described, failure=world.settings_of(interface).fails)

    return make


def drawn_maker(
    library: Library, *, failure: float = 0.1, bound: Bound | None = None
) -> Callable[[str, str], Runner]:
    """Runners whose outcomes are drawn; ``failure`` is the probability to fail."""
    return lambda *key: Drawn(_provider(library, bound, key), failure=failure)


def scripted_maker(
    outcomes: Mapping[str, Outcome],
    library: Library,
    *,
    otherwise: Outcome = Outcome.SUCCEEDED,
    bound: Bound | None = None,
) -> Callable[[str, str], Runner]:
    """Runners whose outcomes are given, by element path; ``otherwise`` holds for the others."""
    return lambda *key: Scripted(_provider(library, bound, key), outcomes, otherwise=otherwise)


def simulated_class(provider: Provider) -> type[Runner] | None:
    """The simulated form of a runner; None if it has none.

    It is looked for as ``gpsfsm.execution.registry`` says: installed packages may have one, and
    the built-in families do. Other modules that capability files name are never imported.
    """
    try:
        return runner_class(provider, mode=Mode.SIMULATED)
    except RunnerError:
        return None


def _provider(library: Library, bound: Bound | None, key: tuple[str, str]) -> Provider | None:
    """The description of a runner; None if there is none: then it is only drawn."""
    provider = (bound or {}).get(key)
    return provider if provider is not None else library.resolve(*key).provider


class _Described(Runner):
    """An action of a provider as it looks from outside; None: nothing is known of it."""

    idempotent = True

    def __init__(self, provider: Provider | None) -> None:
        self._provider = provider if provider is not None and provider.described else None
        self._interface = "" if provider is None else provider.implements

    async def start(self, context: LoadContext) -> None:
        """Take note of the name."""
        self._interface = context.interface

    async def perform(
        self, parameters: Mapping[str, RunValue], context: RunContext, outcome: Outcome
    ) -> Mapping[str, RunValue]:
        """Take the time, then end like this, with outputs as they are declared."""
        seconds = _duration(self._provider, parameters, context.random)
        outputs = {
            event: self._outputs(event, parameters, context.random)
            for event in (Event.SUCCEEDED, Event.FAILED)
        }
        if outcome is Outcome.HANG:
            await context.sleep(_FOR_EVER_S)
        if outcome is Outcome.NO_START:
            raise _error("it did not start", outputs[Event.FAILED])
        await context.sleep(seconds)
        if outcome is Outcome.FAILED:
            raise _error(self.reason, outputs[Event.FAILED])
        return outputs[Event.SUCCEEDED]

    reason = "it failed"

    def _outputs(
        self, event: Event, parameters: Mapping[str, RunValue], source: random.Random
    ) -> dict[str, RunValue]:
        if self._provider is None:
            return {}
        outputs: dict[str, RunValue] = {}
        for output in self._provider.outputs:
            if output.event is not event:
                continue
            value, missing = _sample(output, source), source.random() < 0.5
            if not (output.optional and missing):
                outputs[output.name] = value
        buffer = self._provider.effects.prompt_buffer
        fills = buffer is not None and not said_true(parameters.get(buffer.flush))
        if buffer is not None and fills and buffer.answer in outputs:
            outputs[buffer.answer] = ""
        return outputs


class Drawn(_Described):
    """Succeeds or fails by chance, as far as the provider leaves it open.

    ``failure`` is the probability that it fails; of a choice, which is no action, it is 0.5. If the
    provider may hang, it does so with a probability of 0.05. Durations are drawn between the
    declared bounds, else from 1 to 10 seconds. Outputs are samples of the declared types.
    """

    reason = "it failed by chance"

    def __init__(self, provider: Provider | None, *, failure: float = 0.1) -> None:
        super().__init__(provider)
        if not 0 <= failure <= 1:
            raise ValueError("failure must be a probability, from 0 to 1")
        self._failure = failure

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Draw, then act."""
        failure = _HOLDS_NOT if self._interface == CHOICE else self._failure
        hangs, fails = context.random.random() < _HANG, context.random.random() < failure
        outcome = Outcome.FAILED if fails else Outcome.SUCCEEDED
        if self._provider is not None:
            declared = self._provider.outcomes
            if declared.never_succeeds:
                outcome = Outcome.FAILED
            elif declared.never_fails and not _excepted(self._provider, parameters):
                outcome = Outcome.SUCCEEDED
            if declared.may_hang and hangs:
                outcome = Outcome.HANG
        return await self.perform(parameters, context, outcome)


class Scripted(_Described):
    """Ends as a scenario says: by element path, else with ``otherwise``.

    NO_START fails at once. That it has emitted STARTED nevertheless, it cannot help: whoever runs
    the plan has to hold that back.
    """

    reason = "it failed, as the scenario says"

    def __init__(
        self,
        provider: Provider | None,
        outcomes: Mapping[str, Outcome],
        *,
        otherwise: Outcome = Outcome.SUCCEEDED,
    ) -> None:
        super().__init__(provider)
        self._outcomes = outcomes
        self._otherwise = otherwise

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Look it up, then act."""
        outcome = self._outcomes.get(context.element, self._otherwise)
        return await self.perform(parameters, context, outcome)


def _error(message: str, outputs: Mapping[str, RunValue]) -> RunnerError:
    error = RunnerError(message)
    error.outputs = outputs  # not as arguments: an output may be called message
    return error


def _excepted(provider: Provider, parameters: Mapping[str, RunValue]) -> bool:
    """True if a parameter has a value with which it may fail in spite of ``never_fails``."""
    for name, value in provider.outcomes.unless:
        actual = parameters.get(name)
        if actual is None or isinstance(actual, list):
            continue
        if actual == value if isinstance(value, str) else value_key(actual) == value_key(value):
            return True
    return False


def _duration(
    provider: Provider | None, parameters: Mapping[str, RunValue], source: random.Random
) -> float:
    """Seconds between the declared bounds; where there is none, about as long as usual."""
    part = source.random()
    least, greatest = _bounds(None if provider is None else provider.duration, parameters)
    return least + (greatest - least) * part


def _bounds(span: Span | None, parameters: Mapping[str, RunValue]) -> tuple[float, float]:
    if span is None:
        return _USUAL_S
    least = _seconds(span.minimum, parameters, 0.0)
    greatest = math.inf if span.maximum is None else _seconds(span.maximum, parameters, math.inf)
    if greatest == math.inf:
        return max(least, _USUAL_S[0]), least + _USUAL_S[1]
    if least == 0.0 and greatest > _USUAL_S[0]:  # an upper bound is a timeout, hardly ever reached
        return _USUAL_S[0], min(greatest, _USUAL_S[1])
    return least, max(least, greatest)


def _seconds(amount: float | str, parameters: Mapping[str, RunValue], unknown: float) -> float:
    value = parameters.get(amount) if isinstance(amount, str) else amount
    if isinstance(value, bool) or not isinstance(value, int | float):
        return unknown
    return float(value) if 0 <= value < math.inf else unknown


def _sample(output: Output, source: random.Random) -> RunValue:
    """A value of the declared type; a text names the output."""
    base = _BASES.get(output.type)
    if base is not None:
        return [_one(base, output.name, source) for _ in range(1 + int(source.random() * 3))]
    return _one(output.type, output.name, source)


def _one(kind: ValueType, name: str, source: random.Random) -> RunValue:
    drawn = source.random()
    if kind is ValueType.BOOL:
        return drawn < 0.5
    if kind is ValueType.INT:
        return int(drawn * 10)
    if kind is ValueType.DOUBLE:
        return round(drawn * 10 - 5, 3)
    return f"sample {name} {int(drawn * 1000)}"
