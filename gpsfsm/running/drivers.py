"""Drivers of runs: in virtual time with simulated runners, in real time with real ones."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import GpsfsmError
from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.execution.records import Kind
from gpsfsm.execution.registry import PERMIT
from gpsfsm.execution.runner import RunContext, Runner
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.model.capability import CHOICE, OWN
from gpsfsm.model.event import Outcome
from gpsfsm.model.labels import action
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import CAPABILITIES2, GOALS, RosSettings
from gpsfsm.model.story import Vocabulary
from gpsfsm.running.interruption import Interruption
from gpsfsm.running.prepare import DRAWN, SCENARIO, WORLD, texts

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

    from gpsfsm.capabilities.describe import LeastFile
    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.host import Sink
    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.execution.queue import PlanService
    from gpsfsm.execution.realtime import RealtimeDriver
    from gpsfsm.execution.records import Record, RunValue
    from gpsfsm.execution.registry import Maker
    from gpsfsm.execution.runner import LoadContext
    from gpsfsm.generation.service import ModelService
    from gpsfsm.model.capability import Provider
    from gpsfsm.running.pace import Pace
    from gpsfsm.running.prepare import Prepared
    from gpsfsm.simulation.base import WorldState

MAPPED = "told"
"""The option of a run in a world whose journal has what a map of the run shows."""

FAILURE = 0.1
"""With which probability an action fails whose outcome is drawn."""

_FOR_EVER_S = 1e9
"""Whoever sleeps so long hangs."""


@dataclass(slots=True)
class Shared:
    """The state that the runs of a queue share: the world, its time until now, and the model.

    ``notify`` gets notes for people about the runners, each of them once.
    """

    state: WorldState | None = None
    model: ModelService | None = None
    past_us: int = 0
    notify: Callable[[str], object] = lambda _: None
    notes: set[str] = field(default_factory=set)


def simulated_driver(
    prepared: Prepared,
    kernel: Kernel,
    sink: Sink,
    pace: Pace,
    *,
    interruption: Interruption | None = None,
    shared: Shared | None = None,
    plans: PlanService | None = None,
    rows: Iterable[Row] = (),
) -> VirtualDriver:
    """A driver in virtual time, with runners as the heading says. Raises GpsfsmError.

    ``shared`` is what the runs of a queue share, ``plans`` what the runners submit plans to,
    ``rows`` are what has happened, if the run is simulated once more. ``interruption`` ends
    requests to a model.
    """
    shared = shared or Shared()
    make, services = _runners(prepared, kernel, shared)
    if plans is not None:
        services = {**services, "plans": plans}
    heading = prepared.heading
    if heading.mode == WORLD and "model" in heading.options:
        from gpsfsm.running.model_access import answers_of

        services = {
            **services,
            "answers": answers_of(shared.model, rows, interruption or Interruption()),
        }
    timeout_s = heading.options.get("timeout_s")
    driver = VirtualDriver(
        kernel,
        sink,
        make,
        seed=heading.seed,
        services=services,
        timeout_s=timeout_s if isinstance(timeout_s, int | float) else None,
        pace=pace,
        no_start=_no_start(prepared),
    )
    pace.driver = driver
    if shared.state is not None and heading.options.get(MAPPED) is True:
        shared.state.tell = driver.tell
    return driver


def _runners(
    prepared: Prepared, kernel: Kernel, shared: Shared
) -> tuple[Callable[[str, str], Runner], Mapping[str, Any]]:
    from gpsfsm.simulation import makers

    heading, library = prepared.heading, prepared.library
    if heading.mode == WORLD:
        from gpsfsm.simulation.load import read_world

        world = read_world(heading.world)
        _note_wrong_runners(kernel, shared)
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


def _note_wrong_runners(kernel: Kernel, shared: Shared) -> None:
    """Installed runners that cannot be used are left out of a simulation, but not silently."""
    from gpsfsm.execution.registry import wrong_registrations

    for problem in wrong_registrations(kernel.bound.values()):
        if problem not in shared.notes:
            shared.notes.add(problem)
            shared.notify(f"note: {problem}; the simulation continues without it")


def _outcomes(heading: Heading) -> dict[str, Outcome]:
    """The outcomes of a scenario, which the heading holds as ``element=OUTCOME``."""
    written = heading.options.get("outcomes", [])
    try:
        pairs = [str(text).rpartition("=") for text in written] if isinstance(written, list) else []
        return {element: Outcome(outcome) for element, _, outcome in pairs}
    except ValueError:
        raise DamagedJournalError("the outcomes of the scenario are damaged") from None


def _ends_s(heading: Heading) -> dict[str, float]:
    """When the outcomes of a scenario come that its claim needs; the others come after them."""
    return {
        element: float(place) for place, element in enumerate(texts(heading.options, "order"), 1)
    }


def _no_start(prepared: Prepared) -> dict[int, int]:
    """The instances that do not start, with the time in microseconds at which they fail."""
    outcomes = _outcomes(prepared.heading)
    if Outcome.NO_START not in outcomes.values():
        return {}
    automaton, ends_s = prepared.compiled.automaton, _ends_s(prepared.heading)
    return {
        automaton.runner_number(node.index): round(ends_s.get(element, 0.0) * 1_000_000)
        for node in automaton.runners
        if outcomes.get(element := automaton.name(node.index)) is Outcome.NO_START
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


_SERVICES = {
    "allow_host": "allow_hosts",
    "allow_program": "allow_programs",
    "allow_function": "allow_functions",
}
"""The options about what real runners may reach, and the services in which they find them."""


@dataclass(frozen=True, slots=True)
class Advice:
    """The advice in messages: options of the command line, unless others are named."""

    force: str = "--force"
    model: str = "name one with --model"
    capabilities: str = "name the folder with --capabilities"
    allow: str = PERMIT


FROM_COMMAND = Advice()
FROM_PYTHON = Advice(
    *("force=True", "name one with model=", "name the folder in capabilities="),
    allow="pass its class in runners=",
)
"""The advice for commands, and for callers of ``gpsfsm.run``."""

_MOST_FILES = 8


def real_maker(
    prepared: Prepared,
    model: ModelService | None = None,
    runners: Mapping[str, type[Runner]] | None = None,
    advice: Advice = FROM_COMMAND,
    missing: Sequence[str] = (),
) -> Maker:
    """The maker of the real runners of a plan; ``runners`` come before those installed.

    Raises GpsfsmError if one is not described or not installed, or wants to ask a model and there
    is none, or if something is ``missing`` on the robot.
    """
    maker, names = maker_of(prepared, runners, advice)
    problems = _undecided(prepared) or maker.problems(names)
    if not problems and model is None:
        asking = [each for each in names if hasattr(maker.runner_class(*each), "asks_model")]
        problems = [f"{name} asks a language model; {advice.model}" for name, _ in asking]
    problems = [each for each in problems if not any(each in miss for miss in missing)]
    problems += missing
    if problems:
        lines = _to_write(prepared, maker, names, advice)
        raise GpsfsmError("\n".join((_not_real(prepared), *problems, *lines)))
    return maker


def ending_maker(
    prepared: Prepared,
    library: Library,
    runners: Mapping[str, type[Runner]] | None = None,
    advice: Advice = FROM_COMMAND,
) -> Maker:
    """The maker of the real runners of a run in which nothing acts any more.

    Names mean what they mean now, in ``library``, whatever the journal says. A runner that cannot
    be made shows in the run when it is loaded.
    """
    from gpsfsm.execution.registry import Maker

    allow = texts(prepared.heading.options, "allow_module")
    return Maker(library, allow=allow, own=runners, permit=advice.allow)


def refuse_unbound(prepared: Prepared, advice: Advice = FROM_COMMAND) -> None:
    """Raises GpsfsmError if names of a plan stand for no runner that a check knows.

    A check lets most of such plans pass: it finds nothing in what no file describes.
    """
    maker, runners = maker_of(prepared, act=False)
    problems = maker.unbound(runners) + _undecided(prepared)
    if problems:
        lines = _to_write(prepared, maker, runners, advice)
        raise GpsfsmError("\n".join((_not_real(prepared), *problems, *lines)))


def _not_real(prepared: Prepared) -> str:
    terms = prepared.compiled.automaton.plan.vocabulary.terms
    return f"the {terms.whole} cannot be run for real:"


def _undecided(prepared: Prepared) -> list[str]:
    """The reasons why nobody could say how a tree or a machine goes on while it acts."""
    plan, reasons = prepared.compiled.automaton.plan, dict[str, None]()
    for element in plan.runners:
        if element.interface in OWN:
            verb = "decides" if element.interface == CHOICE else "makes"
            reasons[f"line {element.line}: no runner {verb} {action(element)}"] = None
    return [*reasons]


def maker_of(
    prepared: Prepared,
    runners: Mapping[str, type[Runner]] | None = None,
    advice: Advice = FROM_COMMAND,
    *,
    act: bool = True,
) -> tuple[Maker, tuple[tuple[str, str], ...]]:
    """The maker, and the runners of the plan; ``act``: what it makes is to act."""
    from gpsfsm.execution.registry import Maker

    kernel = prepared.kernel()
    allow = texts(prepared.heading.options, "allow_module")
    via: Callable[[Provider], type[Runner] | None] | None = None
    settings = RosSettings.of(prepared.heading.options.get("ros"))
    if act and settings.via == CAPABILITIES2:
        from gpsfsm.ros.capabilities2_runner import Via

        via = Via(settings, prepared.library)
    maker = Maker(
        prepared.library,
        allow=allow,
        bound=kernel.bound,
        own=runners,
        via=via,
        permit=advice.allow,
    )
    return maker, kernel.runners


def _to_write(
    prepared: Prepared, maker: Maker, runners: Iterable[tuple[str, str]], advice: Advice
) -> Iterator[str]:
    """The files to write so that runners are described that are not."""
    from gpsfsm.capabilities.describe import least_files

    files: dict[LeastFile, None] = {}
    nameless: dict[str, None] = {}
    for key in maker.undescribed(runners):
        missing = least_files(prepared.library, *key)
        files |= dict.fromkeys(missing)
        if not missing:
            nameless[key[1] or key[0]] = None
    if nameless and prepared.compiled.automaton.plan.vocabulary is Vocabulary.TREE:
        yield (
            "a leaf acts for real under the full name of a runner alone, package/Name; what a "
            "robot profile says of 'leaves' is for simulations"
        )
        nameless.clear()
    for name in nameless:
        yield (
            f"no file can describe '{clip(name, 100)}': write the names as package/Name, "
            "in letters, digits and underscores"
        )
    if not files:
        return
    yield (
        "describe what is missing: write these files into a folder, add to them what the runners "
        f"take, output and hold, and {advice.capabilities}:"
    )
    for file in [*files][:_MOST_FILES]:
        yield f"  add to {file.path}:" if file.exists else f"  {file.path}:"
        yield from (f"    {line}" for line in file.lines)
    if len(files) > _MOST_FILES:
        yield f"  and {len(files) - _MOST_FILES} more files like these"


def real_driver(
    prepared: Prepared,
    kernel: Kernel,
    sink: Sink,
    maker: Maker,
    *,
    plans: PlanService | None = None,
    model: ModelService | None = None,
    rows: Iterable[Row] = (),
) -> RealtimeDriver:
    """A driver in real time, with runners that really act; ``rows`` are what has happened."""
    from gpsfsm.capabilities.describe import specs
    from gpsfsm.execution.prompts import FillsWritten, PromptBuffers
    from gpsfsm.execution.realtime import RealtimeDriver  # loads asyncio
    from gpsfsm.ros.runner import Listening, Services
    from gpsfsm.ros.telemetry import Rosout, Telemetry

    options, prompts = prepared.heading.options, PromptBuffers()
    services: dict[str, Any] = {name: texts(options, key) for key, name in _SERVICES.items()}
    services |= {"prompts": prompts, "specs": specs(prepared.library)}
    robot = RosSettings.of(options.get("ros"))
    spoken: Any = options.get(GOALS, {})
    services["ros"] = ros = Services(robot, prepared.library, spoken)
    if plans is not None:
        services["plans"] = plans
    if model is not None:
        services["model"] = model
    timeout_s = options.get("timeout_s")
    driver = RealtimeDriver(
        kernel,
        sink,
        maker,
        seed=prepared.heading.seed,
        run_id=str(options.get("nonce", "")),
        services=services,
        depends_on=maker.depends_on,
        timeout_s=timeout_s if isinstance(timeout_s, int | float) else None,
        doubt_s=robot.doubt_s,
    )
    fills = FillsWritten(kernel, prompts, maker.runner_class)
    fills.take(rows)
    file, lines = prepared.heading.file, _lines(kernel)
    driver.watchers += [
        fills,
        Telemetry(kernel, file, driver.now_us),
        Rosout(lines, file),
        Listening(ros, kernel, maker.runner_class),
    ]
    return driver


def _lines(kernel: Kernel) -> Callable[[Record], str]:
    """The lines of a run for its robot: those that a terminal shows, its beginning and its end."""
    from gpsfsm.watch.record_text import Detail, Words

    words = Words(kernel.automaton, kernel.runners)

    def line(record: Record) -> str:
        is_line = record.kind in (Kind.BEGIN, Kind.ENDED) or words.shown(record, Detail.RUN)
        return words.sentence(record) if is_line else ""

    return line
