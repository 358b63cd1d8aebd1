"""What the commands about runs share: from texts and journals to plans that can run."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.library import bind
from gpsfsm.capabilities.table import load
from gpsfsm.cli._drive import Interrupt, SimulationDriver
from gpsfsm.cli._engines import engine_of, on_engine
from gpsfsm.compile import compile_plan
from gpsfsm.errors import GpsfsmError, InternalError
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.journal_errors import DamagedJournalError, JournalError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.records import Status
from gpsfsm.execution.runner import RunContext, Runner
from gpsfsm.model.engine import PAPER_ENGINE
from gpsfsm.model.event import Outcome
from gpsfsm.syntax import Limits, parse
from gpsfsm.watch.words import Words

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import LoadContext
    from gpsfsm.generation.service import ModelService
    from gpsfsm.simulation.state import WorldState

__all__ = [
    "DRAWN",
    "OF_A_JOURNAL",
    "REAL",
    "SCENARIO",
    "TOLD",
    "WORLD",
    "Prepared",
    "Shared",
    "drive",
    "exit_code",
    "prepare",
    "simulation",
    "stored",
    "texts",
    "ticking",
]

DRAWN, SCENARIO, WORLD, REAL = "drawn", "scenario", "world", "real"
"""How the runners of a run are made."""

TOLD = "told"
"""The option of a run in a world whose journal has what a map of the run shows."""

FAILURE = 0.1
"""With which probability an action fails whose outcome is drawn."""

_TICK_S = 0.2
_FOR_EVER_S = 1e9
"""Whoever sleeps so long hangs."""

_NO_LIMIT = 2**62
OF_A_JOURNAL = Limits(**{each.name: _NO_LIMIT for each in fields(Limits)})
"""What is in a journal has passed the limits of its run."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A plan that can run, or ran: its heading in the journal, and what it is compiled to."""

    heading: Heading
    compiled: Compiled
    library: Library

    def kernel(self) -> Kernel:
        """A fresh kernel of the plan."""
        return Kernel(self.compiled, apart=self.heading.options.get("no_start") is True)

    def words(self) -> Words:
        """The names of its nodes and runners."""
        return Words(self.compiled.automaton, self.kernel().runners)


def prepare(heading: Heading, library: Library, limits: Limits = OF_A_JOURNAL) -> Prepared:
    """Compile the plan of a heading. Raises GpsfsmError if there is none in its text."""
    engine = engine_of(heading)
    from_response = heading.options.get("from_response") is True
    parsed = None
    if engine == PAPER_ENGINE or from_response:
        parsed = parse(heading.plan, file=heading.file, limits=limits, from_response=from_response)
    if engine != PAPER_ENGINE:
        text = parsed.body if parsed is not None else heading.plan
        return Prepared(heading, on_engine(heading, engine, text, library, limits), library)
    if parsed is None or parsed.plan is None:
        raise GpsfsmError(f"{heading.file}: there is no plan that could be run")
    compiled = compile_plan(
        parsed.plan,
        bindings=bind(parsed.plan, library),
        start_chain=heading.options.get("no_start") is True,
    )
    return Prepared(heading, compiled, library)


def stored(reader: JournalReader, run: StoredRun) -> Prepared:
    """The plan of a journaled run, with the library that it ran with. Raises GpsfsmError."""
    try:
        table = reader.content(run, "capabilities").decode()
        library = load(table)
    except (InternalError, UnicodeDecodeError):
        raise JournalError(
            f"{reader.path}: run {run.number} has no table of capabilities, so no command of "
            "gpsfsm has begun it; 'gpsfsm events --format jsonl' shows its events"
        ) from None
    heading = Heading(
        plan=reader.content(run, "plan"),
        file=run.file,
        capabilities=table,
        world=reader.content(run, "world"),
        seed=run.seed,
        mode=run.mode,
        options=run.options,
        parent=str(run.header.get("parent", "")),
    )
    return prepare(heading, library)


def simulation(
    prepared: Prepared,
    kernel: Kernel,
    sink: Sink,
    interrupt: Interrupt,
    *,
    speed: float | None = None,
    shared: Shared | None = None,
    plans: PlanService | None = None,
    rows: Iterable[Row] = (),
    kind: type[SimulationDriver] = SimulationDriver,
) -> SimulationDriver:
    """A driver in virtual time, with runners as the heading says. Raises GpsfsmError.

    ``shared`` is what the runs of a queue share, ``plans`` what the runners submit plans to,
    ``rows`` are what has happened, if the run is simulated once more.
    """
    shared = shared or Shared()
    make, services = _runners(prepared, kernel, shared)
    if plans is not None:
        services = {**services, "plans": plans}
    if prepared.heading.mode == WORLD and "model" in prepared.heading.options:
        from gpsfsm.cli._prompting import answers_of  # noqa: PLC0415

        services = {**services, "answers": answers_of(shared.model, rows, interrupt)}
    heading = prepared.heading
    timeout_s = heading.options.get("timeout_s")
    driver = kind(
        kernel,
        sink,
        make,
        seed=heading.seed,
        services=services,
        timeout_s=timeout_s if isinstance(timeout_s, int | float) else None,
        interrupt=interrupt,
        speed=speed,
        no_start=_no_start(prepared),
    )
    if shared.state is not None and heading.options.get(TOLD) is True:
        shared.state.tell = driver.tell
    return driver


@dataclass(slots=True)
class Shared:
    """What the runs of a queue share: the world, for how long it has been there, and the model."""

    state: WorldState | None = None
    model: ModelService | None = None
    past_us: int = 0
    told: set[str] = field(default_factory=set)  # notes


def _runners(
    prepared: Prepared, kernel: Kernel, shared: Shared
) -> tuple[Callable[[str, str], Runner], Mapping[str, Any]]:
    from gpsfsm.simulation import makers  # noqa: PLC0415

    heading, library = prepared.heading, prepared.library
    if heading.mode == WORLD:
        from gpsfsm.simulation.load import read_world  # noqa: PLC0415  (YAML and pydantic)

        world = read_world(heading.world)
        _tell_of_wrong_runners(kernel, shared)
        if shared.state is None:
            shared.state = makers.world_services(world, library)["world"]
        else:
            shared.state.next_plan(shared.past_us / 1_000_000)
        return makers.world_maker(world, library, bound=kernel.bound), {"world": shared.state}
    if heading.mode == SCENARIO:
        scripted = makers.scripted_maker(_outcomes(heading), library, bound=kernel.bound)
        ends_s = _ends_s(heading)
        return lambda *names: _InOrder(scripted(*names), ends_s), {}
    if heading.mode != DRAWN:
        raise GpsfsmError(f"runners of the kind '{heading.mode:.40}' cannot be made")
    failure = heading.options.get("failure")
    if not isinstance(failure, float):
        failure = FAILURE
    return makers.drawn_maker(library, failure=failure, bound=kernel.bound), {}


def _tell_of_wrong_runners(kernel: Kernel, shared: Shared) -> None:
    """Installed runners that cannot be used are left out of a simulation, but not silently."""
    from gpsfsm.cli._streams import complain  # noqa: PLC0415
    from gpsfsm.execution.registry import wrong_registrations  # noqa: PLC0415

    for problem in wrong_registrations(kernel.bound.values()):
        if problem not in shared.told:
            shared.told.add(problem)
            complain(f"note: {problem}; the simulation goes on without it")


def _outcomes(heading: Heading) -> dict[str, Outcome]:
    """The outcomes of a scenario, which the heading holds as ``element=OUTCOME``."""
    found = heading.options.get("outcomes", [])
    try:
        pairs = [str(text).rpartition("=") for text in found] if isinstance(found, list) else []
        return {element: Outcome(outcome) for element, _, outcome in pairs}
    except ValueError:
        raise DamagedJournalError("the outcomes of the scenario are damaged") from None


def texts(options: Mapping[str, Any], name: str) -> tuple[str, ...]:
    """The texts of an option of a heading; none if it holds anything else."""
    found = options.get(name, [])
    return tuple(map(str, found)) if isinstance(found, list) else ()


def drive(driver: SimulationDriver | RealtimeDriver, tick: Callable[[int], object]) -> None:
    """Run a plan to its end; ``tick`` is told the time while nothing happens."""
    if isinstance(driver, SimulationDriver):
        driver.tick = tick
        driver.run()
        return
    import asyncio  # noqa: PLC0415  (slow to import)

    async def run() -> None:
        ticker = asyncio.create_task(ticking(driver, tick))
        try:
            await driver.run()
        finally:
            ticker.cancel()

    asyncio.run(run())


async def ticking(driver: RealtimeDriver, tick: Callable[[int], object]) -> None:
    """Tell the time of the run now and then, for ever."""
    import asyncio  # noqa: PLC0415

    while True:
        await asyncio.sleep(_TICK_S)
        tick(driver.now_us())


def _ends_s(heading: Heading) -> dict[str, float]:
    """When the outcomes of a scenario come that its claim needs; the others come after them."""
    return {
        element: float(place) for place, element in enumerate(texts(heading.options, "order"), 1)
    }


def _no_start(prepared: Prepared) -> dict[int, int]:
    """The instances that do not start, with the time in microseconds at which they fail."""
    found = _outcomes(prepared.heading)
    if Outcome.NO_START not in found.values():
        return {}
    automaton, ends_s = prepared.compiled.automaton, _ends_s(prepared.heading)
    return {
        automaton.runner_number(node.index): round(ends_s.get(element, 0.0) * 1_000_000)
        for node in automaton.runners
        if found.get(element := automaton.name(node.index)) is Outcome.NO_START
    }


class _InOrder(Runner):
    """A runner of a scenario: what its claim needs comes a second apart, in the causal order.

    So what happens is what the finding tells, whatever the actions would take.
    """

    idempotent = True

    def __init__(self, runner: Runner, ends_s: Mapping[str, float]) -> None:
        self._runner = runner
        self._ends_s = ends_s

    async def start(self, context: LoadContext) -> None:
        """Load the runner."""
        await self._runner.start(context)

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Act as it does, but end in time."""
        end_s = self._ends_s.get(context.element)

        async def sleep(seconds: float) -> None:
            if seconds < _FOR_EVER_S and end_s is not None:
                seconds = max(0.0, end_s - context.now_s)
            elif seconds < _FOR_EVER_S:
                seconds += len(self._ends_s)
            await context.sleep(seconds)

        in_order = RunContext(
            number=context.number,
            element=context.element,
            key=context.key,
            random=context.random,
            sleeper=sleep,
            clock=lambda: context.now_s,
            logger=context.log,
        )
        return await self._runner.run(parameters, in_order)


def exit_code(status: Status, interrupt: Interrupt) -> int:
    """0 completed, 1 anything else, 130 cancelled with Ctrl-C."""
    if status is Status.CANCELLED and interrupt.asked:
        return 130
    return 0 if status is Status.COMPLETED else 1
