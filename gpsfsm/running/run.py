"""Runs of plans from Python: ``gpsfsm.run`` and ``gpsfsm.run_async``."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass, replace
from numbers import Integral, Real
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from gpsfsm.capabilities.library import choose_capabilities
from gpsfsm.capabilities.table import dump
from gpsfsm.checking.includes import joined_text
from gpsfsm.checking.inputs import Input
from gpsfsm.errors import ConfigError, InputError, UsageError, misused
from gpsfsm.execution.journal import Heading, Journal
from gpsfsm.execution.journal_file import DURABILITY
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.lane import in_thread
from gpsfsm.execution.records import Status
from gpsfsm.execution.registry import check_class
from gpsfsm.execution.runner import RunnerError
from gpsfsm.files import read_whole
from gpsfsm.running.admission import Admission, Refused, as_text
from gpsfsm.running.bounds import ATTEMPTS, MAX_PLANS, REGENERATE_FOR_S, REGENERATIONS
from gpsfsm.running.drivers import FROM_PYTHON, Shared
from gpsfsm.running.interruption import Interruption
from gpsfsm.running.prepare import DRAWN, REAL, WORLD
from gpsfsm.running.resumption import Resumption, refuse_empty
from gpsfsm.running.run_result import Collector, PlanEnding, RunResult
from gpsfsm.running.session import OneWorld, Session, Submission
from gpsfsm.syntax import Limits

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.execution.records import RunValue
    from gpsfsm.execution.runner import Runner
    from gpsfsm.generation.language_model import LanguageModel
    from gpsfsm.generation.providers import ModelSettings
    from gpsfsm.generation.service import ModelService

_MOST_BYTES = 1 << 26
_MOST_S = 1e9
_PATH = (str, Path, type(None))
_KINDS: tuple[tuple[str, tuple[type, ...], str], ...] = (
    ("plan", (*_PATH, bytes, Sequence), "the text of a plan, a path, or a list of them"),
    ("world journal", _PATH, "the path of a file"),
    ("durability", (str,), "a text"),
    ("task", (str, type(None)), "a text"),
    ("runners", (Mapping, type(None)), "classes by names"),
    ("real builtin_capabilities force", (bool,), "True or False"),
    ("seed max_plans", (Integral,), "a whole number"),
    ("failure timeout_s", (Real, type(None)), "a number"),
    ("capabilities", (Sequence,), "a list of paths"),
    ("interruption", (Interruption, type(None)), "a gpsfsm.running.interruption.Interruption"),
)
"""The types that arguments may have, and how that is said."""
_OF_NEW_RUNS: Mapping[str, object] = {
    "world": None,
    "task": None,
    "seed": 0,
    "failure": None,
    "timeout_s": None,
    "max_plans": MAX_PLANS,
}
"""The arguments that the heading of a run keeps, with their defaults."""


@dataclass(frozen=True, kw_only=True)
class _Request:
    """The arguments of ``run``, and what is done for them."""

    plan: str | bytes | Path | Sequence[str | bytes | Path] | None
    world: str | Path | None
    runners: Mapping[str, type[Runner]] | None
    real: bool
    journal: str | Path | None
    durability: str
    model: str | LanguageModel | None
    task: str | None
    seed: int
    failure: float | None
    timeout_s: float | None
    max_plans: int
    capabilities: Sequence[str | Path]
    builtin_capabilities: bool
    force: bool
    interruption: Interruption | None

    def __post_init__(self) -> None:
        self._refuse_kinds()
        self._refuse_values()
        if self.world is not None and self.is_real:
            raise UsageError("world and real runners cannot be used together")
        if self.failure is not None and (self.world is not None or self.is_real):
            raise UsageError("failure cannot be used with a world or real runners")
        if self.plan is None:
            self._refuse_of_new_runs()
        if self.model is not None and self.plan is not None and self.mode == DRAWN:
            raise UsageError("a model needs a world or real runners")
        if self.task is not None and self.model is None:
            raise UsageError("a task needs a model")

    def _refuse_kinds(self) -> None:
        """Raise UsageError for values of other types than the arguments take."""
        for names, kinds, expected in _KINDS:
            for name in names.split():
                value = getattr(self, name)
                if not isinstance(value, kinds) or (isinstance(value, bool) and bool not in kinds):
                    raise misused(name, expected, value)
        if isinstance(self.capabilities, str | bytes):  # else it is taken letter by letter
            shown = f"capabilities=[{self.capabilities!r}]"
            raise UsageError(f"capabilities takes a list of paths, such as {shown}")
        for path in self.capabilities:
            if not isinstance(path, str | Path):
                raise misused("capabilities", "paths in a list", path)
        if not (self.model is None or isinstance(self.model, str) or hasattr(self.model, "answer")):
            raise misused("model", "a language model, or the name of one", self.model)
        for plan in self._listed:
            if not isinstance(plan, str | bytes | Path):
                raise misused("plan", "texts and paths in a list", plan)
        for name, runner in (self.runners or {}).items():
            if not isinstance(name, str):
                raise misused("runners", "classes by names", name)
            try:
                check_class(runner, f"runners[{name!r}]")
            except RunnerError as error:
                raise UsageError(str(error)) from None

    def _refuse_values(self) -> None:
        """Raise UsageError for values that are out of bounds."""
        if self.durability not in DURABILITY:
            raise UsageError(f"the durability is one of {', '.join(DURABILITY)}")
        for name in ("world", "journal", "model"):
            if getattr(self, name) == "":
                raise UsageError(f"{name} needs a name, not an empty one")
        if self.failure is not None and not 0 <= self.failure <= 1:
            raise misused("failure", "a probability, from 0 to 1", self.failure)
        if self.timeout_s is not None and not 0 < self.timeout_s <= _MOST_S:
            raise misused(
                "timeout_s", f"seconds, more than 0 and at most {_MOST_S:g}", self.timeout_s
            )
        if self.max_plans < 1:
            raise misused("max_plans", "a whole number of at least 1", self.max_plans)

    def _refuse_of_new_runs(self) -> None:
        """Raise UsageError for what only a new run can take: one in a journal has its own."""
        if self.journal is None:
            raise UsageError("there is neither a plan nor a journal to continue")
        for name, default in _OF_NEW_RUNS.items():
            if getattr(self, name) != default:
                raise UsageError(
                    f"{name} needs a plan: without one, the journal's run continues as it began"
                )

    def _refuse_event_loop(self) -> None:
        """Raise UsageError where an event loop runs that this would hold up, and cannot use."""
        import asyncio

        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        raise UsageError(
            "gpsfsm.run cannot use real runners or a model while an event loop runs in "
            "this thread: await gpsfsm.run_async instead"
        )

    @property
    def is_real(self) -> bool:
        """True if runners really act."""
        return self.real or self.runners is not None

    @property
    def mode(self) -> str:
        """The kind of the runners."""
        return REAL if self.is_real else WORLD if self.world is not None else DRAWN

    def drive(self, check: Callable[..., Any] | None = None) -> RunResult:
        """Run to the end, in this thread."""
        if self.is_real or self.model is not None:
            self._refuse_event_loop()
        with ExitStack() as stack:
            work = self._work(stack, check)
            return work if isinstance(work, RunResult) else work.drive()

    async def drive_live(self) -> RunResult:
        """Run real runners to the end, on this event loop."""
        with ExitStack() as stack:
            work = self._work(stack, None)
            return work if isinstance(work, RunResult) else await work.drive_live()

    def _work(self, stack: ExitStack, check: Callable[..., Any] | None) -> RunResult | _Work:
        return self._resumed(stack, check) if self.plan is None else self._new(stack, check)

    # -- a new run ------------------------------------------------------------------------------

    def _new(self, stack: ExitStack, check: Callable[..., Any] | None) -> RunResult | _Work:
        chosen = self._chosen()
        base = self._heading(chosen)
        admission = Admission(
            base, chosen, Limits(), force=self.force, trees=True, advice=FROM_PYTHON
        )
        admission.check = check or admission.check
        collector, plans = Collector(), []
        for name, text in self._plans():
            plans.append(Submission(name, text, admission.decide(text, name)))
        decision = plans[0].decision if len(plans) == 1 else None
        if isinstance(decision, Refused):  # no journal is made for a plan that is not run
            findings = decision.findings
            refused = PlanEnding(
                *(1, plans[0].name, Status.REFUSED),
                findings=findings,
                summary=decision.message,
            )
            return RunResult((refused,))
        journal = self._journal(stack, collector)
        shared = Shared(model=self._model(base, chosen, stack))
        session = Session(
            *(base, admission, collector),
            journal=journal,
            setting=OneWorld(shared),
            interruption=self.interruption,
            runners=self.runners,
            most_plans=self.max_plans,
        )
        return _Work(
            lambda: session.run(plans), lambda: session.serve(plans), session, collector, self
        )

    def _chosen(self) -> Capabilities:
        chosen = choose_capabilities(self.capabilities, builtin=self.builtin_capabilities)
        if chosen.defects:
            raise ConfigError("\n".join(map(str, chosen.defects)))
        for name in self.runners or ():  # another one would act in its place, for real
            if chosen.library.provider(name) is None and chosen.library.interface(name) is None:
                raise UsageError(f"runners: no capability file describes {name}")
        return chosen

    @property
    def _listed(self) -> list[str | bytes | Path]:
        return [self.plan] if isinstance(self.plan, str | bytes | Path) else [*(self.plan or ())]

    def _plans(self) -> list[tuple[str, str]]:
        """The names and texts of the plans."""
        plans = self._listed
        if not plans:
            raise UsageError("there is no plan")
        if len(plans) > self.max_plans:
            raise UsageError("these are more plans than max_plans allows")
        return [_named(plan) for plan in plans]

    def _heading(self, chosen: Capabilities) -> Heading:
        options: dict[str, RunValue] = {}
        if self.max_plans != MAX_PLANS:
            options["max_plans"] = self.max_plans
        if self.timeout_s is not None:
            options["timeout_s"] = self.timeout_s
        if self.failure is not None:
            options["failure"] = float(self.failure)
        if self.mode == REAL:
            options["nonce"] = os.urandom(8).hex()
        if self.model is not None:
            options["model"] = self.model if isinstance(self.model, str) else self.model.name
            options |= {"regenerations": REGENERATIONS, "regenerate_for_s": REGENERATE_FOR_S}
            options |= {"attempts": ATTEMPTS}
        if self.task is not None:
            options["task"] = self.task
        world = b""
        if self.world is not None:
            from gpsfsm.simulation.load import read_world

            world = _content(self.world)
            read_world(world, file=str(self.world), library=chosen.library)
        return Heading(
            plan=b"",
            capabilities=dump(chosen.library),
            world=world,
            seed=self.seed,
            mode=self.mode,
            options=options,
        )

    def _journal(self, stack: ExitStack, collector: Collector) -> Journal | None:
        if self.journal is None:
            return None
        journal = stack.enter_context(Journal(str(self.journal), self.durability))
        if journal.note:
            collector.notice(journal.note)
        return journal

    def _settings(self) -> ModelSettings:
        from gpsfsm.generation.providers import Configured, ModelSettings, settings_of

        if isinstance(self.model, str):
            return settings_of({"name": self.model}, configured=Configured())
        context = None if self.model is None else self.model.context_tokens
        return ModelSettings(context_tokens=context)

    def _model(self, base: Heading, chosen: Capabilities, stack: ExitStack) -> ModelService | None:
        if self.model is None:
            return None
        from gpsfsm.running.model_access import model_of_run

        own = None if isinstance(self.model, str) else self.model
        return model_of_run(base, self._settings(), chosen, stack, model=own)

    # -- a run of another process -------------------------------------------------------------

    def _resumed(self, stack: ExitStack, check: Callable[..., Any] | None) -> RunResult | _Work:
        from gpsfsm.capabilities.library import Capabilities
        from gpsfsm.running.model_access import model_left

        path, collector = str(self.journal), Collector()
        refuse_empty(path)
        journal = self._journal(stack, collector)
        assert journal is not None
        with JournalReader(path) as reader:
            left = Resumption(reader, None, collector.notice)
            number = left.run.number
            if left.ended:
                ending = PlanEnding(0, left.run.file, left.run.status, left.run.number)
                return RunResult((ending,), path, tuple(collector.notices))
            if (left.run.mode == REAL) is not self.is_real:
                raise UsageError(
                    f"run {number} of {path} "
                    + ("lets real runners act" if left.run.mode == REAL else "is simulated")
                )
            if self.model is None and "model" in left.run.options:
                raise UsageError(f"run {number} asks a language model: name it with model=")
            left.load(_allowing_nothing)
            settings = None if self.model is None else self._settings()
            own = None if isinstance(self.model, str) else self.model
            of_run = left.this.prepared, left.queue, stack
            model = model_left(reader, left.run, settings, of_run, model=own)
            library = left.this.prepared.library
            if self.is_real and not library.says_the_same(self._chosen().library):
                raise UsageError(f"run {number} was begun with other capabilities")
            admission = Admission(
                *(left.base, Capabilities(library), Limits()),
                force=self.force,
                trees=True,
                advice=FROM_PYTHON,
            )
            admission.check = check or admission.check
            if refused := left.refused(admission, collector):
                raise UsageError("\n".join(each.message for each in refused))
            session = left.session(
                *(admission, collector, model),
                journal=journal,
                interruption=self.interruption or Interruption(),
                runners=self.runners,
            )
        return _Work(
            lambda: left.go_on(session), lambda: left.go_on_live(session), session, collector, self
        )


@dataclass(frozen=True, slots=True)
class _Work:
    """A session that is ready to run, and what collects its result."""

    run: Callable[[], None]
    serve: Callable[[], Any]
    session: Session
    collector: Collector
    request: _Request

    def drive(self) -> RunResult:
        """Run to the end."""
        self.run()
        return self._result()

    async def drive_live(self) -> RunResult:
        """The same on the event loop of the caller."""
        await self.serve()
        return self._result()

    def _result(self) -> RunResult:
        queue = getattr(self.session, "queue", None)
        journal = "" if self.request.journal is None else str(self.request.journal)
        return self.collector.result(() if queue is None else queue.states(), journal)


def _named(plan: str | bytes | Path) -> tuple[str, str]:
    """The name and the text of a plan; as for ``check``, what holds a ``<`` is no path."""
    if isinstance(plan, bytes):
        return "<text>", as_text(plan)
    if isinstance(plan, str) and (not plan or "<" in plan or "\n" in plan):
        return "<text>", plan
    content = _content(plan)
    try:  # the journal keeps one text, which needs no other file to be run again
        joined = joined_text(Input(str(plan)), content, Limits())
    except InputError as error:
        raise InputError(f"{plan}: {error}") from error
    return str(plan), as_text(joined)


def _content(path: str | Path) -> bytes:
    """The content of a file. Raises InputError, which names it."""
    try:
        return read_whole(path, _MOST_BYTES)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def _allowing_nothing(heading: Heading) -> Heading:
    """The heading without its permissions: a journal allows nothing."""
    options = {name: each for name, each in heading.options.items() if "allow_" not in name}
    return replace(heading, options=options)


def run(
    plan: str | bytes | Path | Sequence[str | bytes | Path] | None = None,
    *,
    world: str | Path | None = None,
    runners: Mapping[str, type[Runner]] | None = None,
    real: bool = False,
    journal: str | Path | None = None,
    durability: str = "power",
    model: str | LanguageModel | None = None,
    task: str | None = None,
    seed: int = 0,
    failure: float | None = None,
    timeout_s: float | None = None,
    max_plans: int = MAX_PLANS,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    force: bool = False,
    interruption: Interruption | None = None,
) -> RunResult:
    """Check one or more plans and run them, as ``gpsfsm run`` does.

    ``plan`` is the text of a plan, the path of its file, or a list of these.

    - By default outcomes are drawn at random, from ``seed``. With ``world``, a world file, the plan
      is simulated in that world.
    - With ``real``, installed runners act; so do the classes in ``runners``, whose keys are names
      of providers or interfaces that a capability file describes.
    - ``model`` answers the prompts of runners, and writes a new plan after a plan gives up.
    - ``failure`` is the probability that an action fails, ``timeout_s`` the time limit of an action
      in seconds.
    - ``interruption`` lets another thread cancel or pause the run.

    The other arguments are options of ``gpsfsm run``.

    A plan that the gate refuses is not run: its status is REFUSED. Without ``plan``, the unfinished
    runs of ``journal`` continue with the world, seed and limits that they began with; you cannot
    pass these again.

    Raises GpsfsmError if nothing can be run.

    >>> result = run('<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>', failure=0.0)
    >>> result.status.value, [event.kind for event in result.plans[0].events][-1]
    ('COMPLETED', 'ENDED')
    """
    return _Request(**locals()).drive()


async def run_async(
    plan: str | bytes | Path | Sequence[str | bytes | Path] | None = None,
    *,
    world: str | Path | None = None,
    runners: Mapping[str, type[Runner]] | None = None,
    real: bool = False,
    journal: str | Path | None = None,
    durability: str = "power",
    model: str | LanguageModel | None = None,
    task: str | None = None,
    seed: int = 0,
    failure: float | None = None,
    timeout_s: float | None = None,
    max_plans: int = MAX_PLANS,
    capabilities: Sequence[str | Path] = (),
    builtin_capabilities: bool = True,
    force: bool = False,
    interruption: Interruption | None = None,
) -> RunResult:
    """``run`` without blocking the event loop. Cancelling the task cancels the run."""
    request = _Request(**locals())
    import asyncio

    if request.is_real:
        return await request.drive_live()
    from gpsfsm.checking.parallel import CheckApart

    stop = request.interruption or Interruption()
    request = replace(request, interruption=stop)
    with CheckApart() as apart:  # z3 is used by one thread of a process only
        work = asyncio.ensure_future(in_thread(request.drive, apart.check))
        try:
            return cast("RunResult", await asyncio.shield(work))
        except asyncio.CancelledError:
            stop.request()
            with suppress(Exception):
                await work  # it lets go of its journal
            raise
