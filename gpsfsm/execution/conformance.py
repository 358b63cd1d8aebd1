"""A test kit for runners, to see whether one keeps to the contract (docs/runners.md).

>>> from gpsfsm.execution.runner import Runner
>>> class Count(Runner):
...     async def run(self, parameters, context):
...         await context.sleep(parameters["to"])
...         return {"counted": parameters["to"]}
>>> check_runner(Count, {"to": 3}).outputs
{'counted': 3}
>>> check_runner(Count, {"to": "three"}, expect="succeeds")
Traceback (most recent call last):
    ...
gpsfsm.execution.conformance.ConformanceError: Count should succeed with {'to': 'three'}, \
but it fails: TypeError: '>=' not supported between instances of 'str' and 'int'
"""

from __future__ import annotations

import asyncio
import copy
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, Protocol

from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.realtime import RealtimeDriver
from gpsfsm.execution.records import Input, Kind
from gpsfsm.execution.runner import Runner, said
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.model.capability import ValueType
from gpsfsm.model.event import Event

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from gpsfsm.compile import Compiled
    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.execution.runner import LoadContext, RunContext
    from gpsfsm.model.capability import Provider

_SECOND = 1_000_000
_ONE = '<Plan><Runner interface="tested/Runner" provider="tested/Runner"/></Plan>'
_TWO = f'<Plan><Control type="parallel_all">{_ONE[6:-7] * 2}</Control></Plan>'
_TYPES: dict[ValueType, tuple[type, ...]] = {
    ValueType.ANY: (bool, int, float, str, list),
    ValueType.STRING: (str,),
    ValueType.BOOL: (bool,),
    ValueType.INT: (int,),
    ValueType.DOUBLE: (int, float),
}
_LISTS = {
    ValueType.STRINGS: ValueType.STRING,
    ValueType.BOOLS: ValueType.BOOL,
    ValueType.INTS: ValueType.INT,
    ValueType.DOUBLES: ValueType.DOUBLE,
}


class ConformanceError(AssertionError):
    """A runner does not meet the contract; the message says how."""


@dataclass(frozen=True, slots=True)
class Observed:
    """The observed behaviour of a runner.

    ``duration_s`` is in the time of the run; ``logs`` are its lines.
    """

    succeeded: bool
    outputs: Mapping[str, RunValue]
    message: str
    duration_s: float
    logs: tuple[str, ...]


@dataclass(slots=True)
class _Case:
    """The runner that is tried, and what it is tried with."""

    make: Callable[[], Runner]
    parameters: Mapping[str, RunValue]
    services: Callable[[], Mapping[str, Any]]
    options: Mapping[str, Any]
    real: bool
    name: str = ""
    handed: list[dict[str, RunValue]] = field(default_factory=list)
    # of two instances: the parameters of each, None for one that does nothing; and how they ended
    each: tuple[Mapping[str, RunValue] | None, ...] = ()
    ends: dict[int, End] = field(default_factory=dict)

    def runner(self) -> Runner:
        """A runner that gets the parameters of this case."""
        made = self.make()
        if not isinstance(made, Runner):
            raise ConformanceError(f"{type(made).__name__} is not a subclass of Runner")
        self.name = type(made).__name__
        return _Prepared(made, self)


class _Prepared(Runner):
    """Hands the parameters of a case to a runner."""

    def __init__(self, inner: Runner, case: _Case) -> None:
        self.inner = inner
        self.case = case

    async def start(self, context: LoadContext) -> None:
        await self.inner.start(context)

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        del parameters  # those of the case instead
        case = self.case
        wanted = case.each[context.number] if case.each else case.parameters
        if wanted is None:
            return None
        values = copy.deepcopy(dict(wanted))
        case.handed.append(values)
        if not case.each:
            return await self.inner.run(values, context)
        try:  # one that fails would stop the other one
            outputs = await self.inner.run(values, context)
        except Exception as error:
            case.ends[context.number] = End(False, said(error))
        else:
            case.ends[context.number] = End(True, repr(outputs))
        return None

    async def stop(self) -> None:
        await self.inner.stop()


class _Rows:
    """A sink that keeps everything."""

    def __init__(self) -> None:
        self.rows: list[tuple[int, Input, tuple[Record, ...]]] = []
        self.cut_off: set[int] = set()

    def write(self, at_us: int, happened: Input, records: Sequence[Record]) -> None:
        """Keep an input and what follows from it."""
        self.rows.append((at_us, happened, tuple(records)))

    def first(self, *kinds: Kind) -> tuple[int, Record] | None:
        """The first record of one of these kinds, with its time."""
        for at_us, _, records in self.rows:
            for record in records:
                if record.kind in kinds:
                    return at_us, record
        return None

    def count(self, *kinds: Kind) -> int:
        """The number of records of these kinds."""
        return sum(record.kind in kinds for _, _, records in self.rows for record in records)

    @property
    def lines(self) -> list[str]:
        """The lines that runners and drivers have logged."""
        return [happened.message for _, happened, _ in self.rows if happened.kind is Kind.LOG]


def check_runner(
    make: Callable[[], Runner],
    parameters: Mapping[str, RunValue],
    *,
    other: Mapping[str, RunValue] | None = None,
    provider: Provider | None = None,
    services: Callable[[], Mapping[str, Any]] = dict,
    expect: Literal["succeeds", "fails"] = "succeeds",
    seed: int = 0,
    real: bool = False,
    timeout_s: float = 86_400.0,
    grace_s: float = 5.0,
) -> Observed:
    """Try out a runner and return what it did. Raises ConformanceError if it breaks the contract.

    - It loads and unloads without errors, and ends as expected within ``timeout_s`` seconds.
    - Its outputs are values. If there is a ``provider``, its outputs, outcomes and duration are
      those that the provider declares.
    - It does not change its parameters, and ends even if it gets none; it may then fail.
    - Two instances that act at the same time end as each does alone.
    - It stops within ``grace_s`` seconds at any time.
    - In virtual time it waits only through its context, and does the same for the same ``seed``.

    ``make`` returns a new runner and ``services`` new services for each try. ``other`` are the
    parameters of the second of two instances; by default they are made from ``parameters`` by
    changing numbers and texts, or are the same if ``real`` is set. If ``provider`` names resources,
    one of the two instances may fail. ``real`` is for runners that act outside the program: they
    run in real time, so choose a suitable ``timeout_s``.
    """
    options = {"seed": seed, "timeout_s": timeout_s, "grace_s": grace_s}
    case = _Case(make, parameters, services, options, real)
    rows = _try(case, _ONE)
    observed = _observed(case, rows)
    _check_end(case, observed, expect)
    if provider is not None:
        _check_declared(case, observed, provider)
    for handed in case.handed:
        if handed != case.parameters:
            raise ConformanceError(f"{case.name} changes the parameters that it is given")
    if not real and _try(case, _ONE).rows != rows.rows:
        raise ConformanceError(
            f"{case.name} does not do the same again with the same seed: "
            "draw from context.random only, and keep nothing from one run to the next"
        )
    _check_two(case, other, provider)
    _check_stop(case, observed, rows)
    _check_unprepared(case)
    return observed


@cache
def _compiled(text: str) -> Compiled:
    from gpsfsm.compile import compile_plan
    from gpsfsm.syntax import parse

    plan = parse(text).plan
    assert plan is not None
    return compile_plan(plan)


def _try(case: _Case, text: str, cancel_us: int | None = None) -> _Rows:
    """One run, perhaps cancelled at a time."""
    rows = _Rows()
    kernel = Kernel(_compiled(text))
    services = case.services()
    if case.real:
        real = RealtimeDriver(
            kernel,
            rows,
            lambda _interface, _provider: case.runner(),
            services=services,
            **case.options,
        )
        if cancel_us is not None:
            real.at(cancel_us, lambda: real.cancel("the test wants it"))
        asyncio.run(real.run())
        driver: RealtimeDriver | VirtualDriver = real
    else:
        virtual = VirtualDriver(
            kernel,
            rows,
            lambda _interface, _provider: case.runner(),
            services=services,
            **case.options,
        )
        if cancel_us is not None:
            virtual.at(cancel_us, lambda: virtual.cancel("the test wants it"))
        virtual.run()
        driver = virtual
    failed = rows.first(Kind.NOT_LOADED)
    if failed is not None:
        raise ConformanceError(f"{case.name or 'the runner'} is not loaded: {failed[1].message}")
    if driver.unload_failures:
        line = driver.unload_failures[0]
        raise ConformanceError(f"{case.name} is not unloaded properly: {line}")
    rows.cut_off = driver.cut_off
    return rows


def _observed(case: _Case, rows: _Rows) -> Observed:
    started, ended = rows.first(Kind.STARTED), rows.first(Kind.SUCCEEDED, Kind.FAILED)
    if started is None or ended is None:
        raise ConformanceError(f"{case.name} never ends")
    at_us, record = ended
    message = record.message
    if rows.count(Kind.TIMEOUT):
        message = f"it has not ended after {case.options['timeout_s']:g} s"
    return Observed(
        succeeded=record.kind is Kind.SUCCEEDED,
        outputs=dict(record.data or {}),
        message=message,
        duration_s=(at_us - started[0]) / _SECOND,
        logs=tuple(rows.lines),
    )


def _check_end(case: _Case, observed: Observed, expect: str) -> None:
    parameters = dict(case.parameters)
    if expect == "succeeds" and not observed.succeeded:
        raise ConformanceError(
            f"{case.name} should succeed with {parameters}, but it fails: {observed.message}"
        )
    if expect == "fails" and observed.succeeded:
        raise ConformanceError(f"{case.name} should fail with {parameters}, but it succeeds")
    if not observed.succeeded and observed.message in ("", "RunnerError"):
        raise ConformanceError(f"{case.name} fails and does not say why")


def _check_declared(case: _Case, observed: Observed, provider: Provider) -> None:
    """Outcomes, outputs and the duration are as the capability file declares them."""
    outcomes = provider.outcomes
    if outcomes.never_fails and not outcomes.unless and not observed.succeeded:
        raise ConformanceError(f"{case.name} is declared never to fail: {observed.message}")
    if outcomes.never_succeeds and observed.succeeded:
        raise ConformanceError(f"{case.name} is declared never to succeed")
    event = Event.SUCCEEDED if observed.succeeded else Event.FAILED
    declared = {output.name: output for output in provider.outputs if output.event is event}
    for name, value in observed.outputs.items():
        if name not in declared:
            raise ConformanceError(f"{case.name} returns {name!r}, which is not declared")
        if not _fits(value, declared[name].type):
            wanted = declared[name].type
            raise ConformanceError(
                f"{case.name} returns {type(value).__name__} as {name!r}, declared is {wanted}"
            )
    for name, output in declared.items():
        if observed.succeeded and not output.optional and name not in observed.outputs:
            raise ConformanceError(f"{case.name} does not return {name!r}, which is declared")
    _check_duration(case, observed, provider)


def _check_duration(case: _Case, observed: Observed, provider: Provider) -> None:
    if provider.duration is None:
        return
    slack_s = 1.0 if case.real else 0.000_1  # starting and ending take time too
    least = _seconds(provider.duration.minimum, case, provider)
    greatest = _seconds(provider.duration.maximum, case, provider)
    too_short = least is not None and observed.duration_s < least - slack_s
    if too_short or (greatest is not None and observed.duration_s > greatest + slack_s):
        raise ConformanceError(
            f"{case.name} takes {observed.duration_s:g} s, declared are from "
            f"{0 if least is None else least:g} to {'any' if greatest is None else f'{greatest:g}'}"
        )


def _seconds(amount: float | str | None, case: _Case, provider: Provider) -> float | None:
    """A bound; None if there is none, or if it is a parameter that is no number here."""
    if isinstance(amount, str):
        parameter = provider.parameter(amount)
        default = None if parameter is None else parameter.default
        bound: object = case.parameters.get(amount, default)
    else:
        bound = amount
    return float(bound) if isinstance(bound, int | float) else None


def _fits(value: object, wanted: ValueType) -> bool:
    if wanted in _LISTS:
        return isinstance(value, list) and all(_fits(item, _LISTS[wanted]) for item in value)
    if isinstance(value, bool) and wanted not in (ValueType.BOOL, ValueType.ANY):
        return False
    return isinstance(value, _TYPES[wanted])


def _check_two(
    case: _Case, other: Mapping[str, RunValue] | None, provider: Provider | None
) -> None:
    """Of two instances that act at once, each ends as it does while the other one does nothing."""
    if other is None:
        other = case.parameters if case.real else changed(case.parameters)
    problem = breach(
        lambda *each: _two(case, *each),
        (case.parameters, other),
        exact=not case.real,
        exclusive=provider is not None and bool(provider.resources),
    )
    if problem:
        raise ConformanceError(f"of two instances of {case.name} that act at once {problem}")


def _two(case: _Case, *each: Mapping[str, RunValue] | None) -> Mapping[int, End]:
    this = _Case(case.make, {}, case.services, case.options, case.real, each=each)
    _try(this, _TWO)
    return this.ends


def _check_stop(case: _Case, observed: Observed, rows: _Rows) -> None:
    """Asked to stop at several instants, it stops in time."""
    started = rows.first(Kind.STARTED)
    assert started is not None
    lasted = round(observed.duration_s * _SECOND)
    for part in dict.fromkeys((1, lasted // 2, lasted - 1)):
        if not 0 < part < lasted:
            continue
        stopped = _try(case, _ONE, started[0] + part)
        if stopped.cut_off:
            raise ConformanceError(
                f"{case.name} does not stop within {case.options['grace_s']:g} s when it is asked "
                f"to {part / _SECOND:g} s after its start: let StopRequested pass"
            )


def _check_unprepared(case: _Case) -> None:
    """Without parameters it ends."""
    empty = _Case(case.make, {}, case.services, case.options, case.real)
    rows = _try(empty, _ONE)
    if rows.count(Kind.TIMEOUT):
        raise ConformanceError(f"{case.name} never ends if it is given no parameters: let it fail")


# -- two instances of one runner at once ------------------------------------------------------


class End(NamedTuple):
    """The end of an instance: ``what`` it has returned, or why it has failed, in words."""

    succeeded: bool
    what: str


class Attempt(Protocol):
    """Lets two instances act at once, with these parameters; None for one that does nothing."""

    def __call__(self, *each: Mapping[str, RunValue] | None) -> Mapping[int, End]:
        """Their ends, by their numbers."""


def breach(
    attempt: Attempt,
    parameters: tuple[Mapping[str, RunValue], Mapping[str, RunValue]],
    *,
    exact: bool,
    exclusive: bool,
) -> str:
    """The difference to what each does alone, in words; "" for none.

    Not ``exact``: only whether it succeeds counts, not with what. ``exclusive``: one may fail
    because of the other.
    """
    first, second = parameters
    alone = [attempt(first, None).get(0), attempt(None, second).get(1)]
    if alone[1] is None:  # with what was made from the first ones it has no end
        second, alone[1] = first, attempt(None, first).get(1)
    both = attempt(first, second)
    for number, own in enumerate((first, second)):
        expected, end = alone[number], both.get(number)
        if end == expected:
            continue
        if end is None:
            return "one never ends"
        if exclusive and not end.succeeded:
            continue
        same = expected is not None and end.succeeded == expected.succeeded
        if same and not (exact and end.succeeded):
            continue
        return (
            f"the one with {dict(own)} ends otherwise than alone: it {_described(end)}, alone "
            f"it {_described(expected)}. What belongs to one step must not be kept in self; a "
            "runner that can do one thing at a time waits, or its provider names a resource"
        )
    return ""


def changed(parameters: Mapping[str, RunValue]) -> dict[str, RunValue]:
    """Other parameters of the same types.

    >>> changed({"x": 1, "names": ["a"], "fast": True})
    {'x': 2, 'names': ['a 2'], 'fast': True}
    """
    return {name: _changed(value) for name, value in parameters.items()}


def _changed(value: RunValue) -> RunValue:
    if isinstance(value, list):
        return [_changed(item) for item in value]
    if isinstance(value, str):
        return f"{value} 2"
    return value if isinstance(value, bool) else value + 1


def _described(end: End | None) -> str:
    if end is None:
        return "has no end"
    return f"returns {end.what}" if end.succeeded else f"fails: {end.what}"
