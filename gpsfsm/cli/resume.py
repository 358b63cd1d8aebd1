"""``gpsfsm resume``: go on with a journaled run whose process has ended."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._allowed import ALLOW, allow_options, permissions, recorded
from gpsfsm.cli._model import model_options
from gpsfsm.cli._options import config_options, format_option, library_options, settle_named
from gpsfsm.cli._prompting import model_left, settings_for
from gpsfsm.cli._streams import complain
from gpsfsm.errors import InputError, UsageError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.cli._drive import Interrupt
    from gpsfsm.cli._gate import PlanGate
    from gpsfsm.cli._keys import Keys
    from gpsfsm.cli._past import Past, StoredQueue
    from gpsfsm.cli._queue import PlanRuns
    from gpsfsm.cli._runs import Prepared, Shared
    from gpsfsm.execution.journal import Heading, Journal
    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.generation.service import ModelService
    from gpsfsm.watch.steps import StepTaker

__all__ = ["COMMAND"]

_NO_JOURNAL = """no journal is given; name the file of one. Example:
  gpsfsm resume run.db"""
_SETTINGS = frozenset({"capabilities", "builtin_capabilities"})


@click.command("resume", short_help="Go on with a run after a crash.")
@click.argument("journal", required=False, metavar="JOURNAL", type=click.Path())
@click.option(
    "--run",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    help="The number of the run in the journal. [default: the last one]",
)
@click.option("--real", is_flag=True, help="Go on with a run of real runners; needed for those.")
@allow_options
@click.option(
    "--force",
    is_flag=True,
    help="Go on for real in spite of errors in a plan, or of other capabilities.",
)
@click.option(
    "--durability",
    type=click.Choice(["power", "process", "none"]),
    default="power",
    show_default=True,
    help="What the journal outlives: a power failure, the end of the process, or nothing.",
)
@format_option("auto", "plain", "json", text="auto: a live tree on a terminal, else plain lines.")
@click.option("--verbose", is_flag=True, help="Tell every event.")
@model_options(timeout="--model-timeout")
@library_options
@config_options
@click.pass_context
def COMMAND(context: click.Context, /, **_: object) -> int:  # noqa: N802  (it is an object)
    """Go on with the run in JOURNAL that has no end there.

    What has an outcome is not done again. In real time, an action that was active when the process
    ended is asked again if its runner allows that; otherwise it has failed. Real runners act only
    with --real, and a journal allows them nothing: what was given to 'gpsfsm run' with --allow-…
    and --capabilities is given again, and the plan is checked again. A run that asks a language
    model goes on with the one that --model names. Then the plans run that waited behind it.

    \b
    Exit code: as for 'gpsfsm run'. A run that has ended already is not touched.

    \b
    Example:
      gpsfsm resume run.db
    """  # noqa: D301  (click wants the \b)
    values = settle_named(context, _SETTINGS)
    if not values["journal"]:
        raise click.UsageError(_NO_JOURNAL, context)
    for name in (*ALLOW, "force"):
        if values[name] and not values["real"]:
            raise UsageError(f"--{name.replace('_', '-')} needs --real")
    return _run({**values, "model": settings_for(context, real=values["real"])})


def _run(values: Mapping[str, Any]) -> int:
    from gpsfsm.cli._drive import Interrupt  # noqa: PLC0415  (loads the engine)
    from gpsfsm.cli._past import past_of  # noqa: PLC0415
    from gpsfsm.cli._real import real_maker  # noqa: PLC0415
    from gpsfsm.cli._runs import REAL, exit_code  # noqa: PLC0415
    from gpsfsm.cli._views import keyboard  # noqa: PLC0415
    from gpsfsm.execution.journal import Journal  # noqa: PLC0415
    from gpsfsm.execution.journal_read import JournalReader  # noqa: PLC0415

    _refuse_nothing(values["journal"])  # a journal that is not there is not to be made
    with ExitStack() as stack:
        interrupt = stack.enter_context(Interrupt())
        journal = stack.enter_context(Journal(values["journal"], values["durability"]))
        if journal.note:
            complain(journal.note)
        keys = keyboard(values["output_format"], interrupt, stack)
        with JournalReader(values["journal"]) as reader:
            queue = _open_queue(reader, values["number"])
            run = _run_of(reader, queue, values["number"])
            if queue is None and run.status.ended:
                complain(f"run {run.number} has ended already: {run.status.value}")
                return exit_code(run.status, interrupt)
            _refuse_surprise(run, values)
            this, earlier = past_of(reader, run)
            this = _permitted(this, values)
            model = model_left(reader, run, values["model"], (this.prepared, queue, stack))
            values = {**values, "model": model}
            base = _base(this, queue, run)
            gate = _gate(this, base, run, values)
            code, forced = _refused(gate, this, queue, run)
            if code:
                return code
            if base.mode == REAL and not run.status.ended:
                real_maker(this.prepared, model)
            found = run, this, earlier
            runs = None if queue is None else _left(reader, queue, found, (base, gate), values)
        if runs is not None:
            return runs(interrupt, journal, keys).run(())
        return _go_on(this, earlier, (journal, run, forced), (values, interrupt, keys))


def _refuse_nothing(path: str) -> None:
    """Raises InputError if no run is in the journal."""
    from gpsfsm.execution.journal_errors import EmptyJournalError  # noqa: PLC0415
    from gpsfsm.execution.journal_read import JournalReader  # noqa: PLC0415  (loads sqlite3)

    try:
        with JournalReader(path) as reader:
            if reader.has_runs():
                return
            reader.check()  # maybe there was one
    except EmptyJournalError:
        pass
    raise InputError(
        f"{path}: no run is in it. If it is a copy, copy {path}-wal and {path}-seen to it as well; "
        "else nothing of the plan has been run: run it again"
    )


def _open_queue(reader: JournalReader, number: int | None) -> StoredQueue | None:
    """The last queue of the journal, if something is left to do in it and it is asked for."""
    from gpsfsm.cli._past import queues  # noqa: PLC0415

    found = queues(reader)
    if not found:
        return None
    queue, runs = found[-1], found[-1].runs()
    left = [*queue.open(), *_owed(reader, queue)]
    if not left:
        return None
    last = reader.runs()[-1:]
    if runs and last and last[0].number not in runs.values():
        return None
    if number is not None and number not in [runs.get(plan) for plan in left]:
        return None
    return queue


def _owed(reader: JournalReader, queue: StoredQueue) -> tuple[int, ...]:
    """The plan that gave up, if another one is owed to it."""
    from gpsfsm.cli._regenerate import policy_of  # noqa: PLC0415
    from gpsfsm.execution.chain import Chains  # noqa: PLC0415

    last = [*queue.runs().values()][-1:]
    if not last or policy_of(reader.run(last[0]).options) is None:
        return ()
    chains = Chains()
    for _, row in queue.rows:
        chains.take(row)
    due = chains.due()
    return () if due is None else (due.gave_up,)


def _done(reader: JournalReader, queue: StoredQueue) -> dict[int, StepTaker]:
    """What the plans of the queue have done."""
    from gpsfsm.cli._runs import stored  # noqa: PLC0415
    from gpsfsm.watch.steps import StepTaker  # noqa: PLC0415  (few runs ask a model)

    found = {}
    for plan, number in queue.runs().items():
        prepared = stored(reader, reader.run(number))
        taker = StepTaker(prepared.kernel(), prepared.words())
        taker.take(reader.events(number))
        found[plan] = taker
    return found


def _run_of(reader: JournalReader, queue: StoredQueue | None, number: int | None) -> StoredRun:
    """The run to go on with; else the last one of the queue, which says how its runs are made."""
    if queue is None:
        return reader.run(number)
    runs = queue.runs()
    if not runs:
        raise UsageError(
            f"{reader.path}: no plan of the last queue had begun; run the plans once more"
        )
    last = [*runs.values()][-1]
    return reader.run(next((runs[plan] for plan in queue.open() if plan in runs), last))


def _left(
    reader: JournalReader,
    queue: StoredQueue,
    found: tuple[StoredRun, Past, list[Past]],
    made: tuple[Heading, PlanGate],
    values: Mapping[str, Any],
) -> Callable[[Interrupt, Journal, Keys | None], PlanRuns]:
    """The queue as it was left."""
    from gpsfsm.cli._opened import Begun  # noqa: PLC0415
    from gpsfsm.cli._queue import PlanRuns, Show  # noqa: PLC0415
    from gpsfsm.cli._regenerate import policy_of  # noqa: PLC0415
    from gpsfsm.cli._runs import WORLD  # noqa: PLC0415

    (run, this, earlier), (base, gate) = found, made
    heading, runs = this.prepared.heading, queue.runs()
    plan = _plan_of(queue, run)
    _refuse_other_worlds(reader.path, queue, plan)
    over = plan not in queue.open()
    ids = {each.number: each.id for each in reader.runs()}
    before = [*earlier, this] if over else earlier
    done = {} if policy_of(base.options) is None else _done(reader, queue)
    return lambda interrupt, journal, keys: PlanRuns(
        base,
        gate,
        Show(values["output_format"], verbose=values["verbose"], keys=keys),
        interrupt,
        journal,
        past=queue,
        begun={} if over else {plan: Begun(run, this.prepared, this.rows)},
        ids={plan: ids[number] for plan, number in runs.items()},
        shared=_shared(before if heading.mode == WORLD else (), values["model"]),
        done=done,
    )


def _refuse_other_worlds(path: str, queue: StoredQueue, plan: int) -> None:
    """Raises UsageError if plans wait that do not belong into the world of this one."""
    from gpsfsm.cli._served_start import Starts  # noqa: PLC0415

    starts, runs = Starts(), queue.runs()
    for _, row in queue.rows:
        starts.take(row)
    waiting = [each for each in queue.open() if each not in runs]
    if any(starts.root(each) != starts.root(plan) for each in waiting):
        raise UsageError(
            f"{path}: plans wait that clients of the service have put into several worlds; let "
            "'gpsfsm serve' go on with them"
        )


def _shared(before: list[Past] | tuple[()], model: ModelService | None) -> Shared:
    """What earlier runs leave behind, and the model that the next ones ask."""
    from gpsfsm.cli._past import world  # noqa: PLC0415

    shared = world(before)
    shared.model = model
    return shared


def _refuse_surprise(run: StoredRun, values: Mapping[str, Any]) -> None:
    """A file alone does not make real runners act, nor allow them anything: it may be forged."""
    from gpsfsm.cli._runs import REAL  # noqa: PLC0415
    from gpsfsm.model.printable import clip  # noqa: PLC0415

    if run.mode != REAL:
        return
    missing = [clip(each, 300) for each in recorded(run.options, permissions(values))]
    if not values["real"]:
        options = " ".join(("--real", *missing))
        raise UsageError(
            f"run {run.number} lets real runners act; if that is what you want, add {options}"
        )
    if missing:
        raise UsageError(
            f"run {run.number} needs what this command does not allow, and a journal allows "
            f"nothing by itself; the journal recorded: {' '.join(missing)}; if that is what you "
            "want, add it"
        )


def _permitted(this: Past, values: Mapping[str, Any]) -> Past:
    """The run with what this command allows, whatever the journal says."""
    heading = this.prepared.heading
    options: dict[str, Any] = {
        name: each for name, each in heading.options.items() if name not in ALLOW
    }
    heading = replace(heading, options=options | permissions(values))
    return replace(this, prepared=replace(this.prepared, heading=heading))


def _plan_of(queue: StoredQueue, run: StoredRun) -> int:
    """The plan of the queue that a run is about."""
    return next(plan for plan, number in queue.runs().items() if number == run.number)


def _base(this: Past, queue: StoredQueue | None, run: StoredRun) -> Heading:
    """What the headings of all runs have in common."""
    from gpsfsm.cli._past import OF_ONE_RUN  # noqa: PLC0415

    heading = this.prepared.heading
    if queue is None:
        return heading
    options = {name: value for name, value in heading.options.items() if name not in OF_ONE_RUN}
    seed = heading.seed - _plan_of(queue, run) + 1
    return replace(heading, seed=seed, options=options, parent="")


def _gate(this: Past, base: Heading, run: StoredRun, values: Mapping[str, Any]) -> PlanGate:
    """What the plans have to pass, those that are left as those that they submit.

    Raises UsageError if a real run was begun with other capabilities.
    """
    from gpsfsm.capabilities.library import Capabilities  # noqa: PLC0415
    from gpsfsm.cli._gate import PlanGate  # noqa: PLC0415
    from gpsfsm.cli._runs import REAL  # noqa: PLC0415
    from gpsfsm.syntax import Limits  # noqa: PLC0415

    capabilities = Capabilities(this.prepared.library)
    if base.mode == REAL:
        capabilities = _same_capabilities(this.prepared, run, values)
    return PlanGate(base, capabilities, Limits(), force=values["force"])


def _refused(
    gate: PlanGate, this: Past, queue: StoredQueue | None, run: StoredRun
) -> tuple[int, str]:
    """The exit code if real plans that are left may not run, which is reported then; else 0.

    And in spite of what the run goes on that no queue waits for, "" for nothing. The plans passed a
    gate when they were journaled, or so the file says. Raises GpsfsmError for what cannot be run.
    """
    from gpsfsm.cli._gate import as_text  # noqa: PLC0415
    from gpsfsm.cli._queue import worst  # noqa: PLC0415
    from gpsfsm.cli._runs import OF_A_JOURNAL, REAL  # noqa: PLC0415
    from gpsfsm.execution.journal_errors import DamagedJournalError  # noqa: PLC0415
    from gpsfsm.execution.queue import Refusal  # noqa: PLC0415

    heading = this.prepared.heading
    if heading.mode != REAL:
        return 0, ""
    text = as_text(heading.plan)
    if queue is None:
        found = gate.ahead(text, run.file, OF_A_JOURNAL)
        return (gate.code, "") if isinstance(found, Refusal) else (0, gate.take(found).forced)
    if text != queue.text(_plan_of(queue, run)):
        raise DamagedJournalError(f"run {run.number} is not that of the plan that was queued")
    codes = [
        gate.code
        for name, each in queue.left()
        if isinstance(gate.ahead(each, name, OF_A_JOURNAL), Refusal)
    ]
    return (worst(codes) if codes else 0), ""


def _same_capabilities(
    prepared: Prepared, run: StoredRun, values: Mapping[str, Any]
) -> Capabilities:
    """The capabilities of the journal, which are those of this command.

    Raises UsageError if they are not: the plan was checked with the journal's.
    """
    from gpsfsm.capabilities.choice import choose_capabilities  # noqa: PLC0415
    from gpsfsm.capabilities.library import Capabilities  # noqa: PLC0415

    chosen = choose_capabilities(values["capabilities"], builtin=values["builtin_capabilities"])
    if prepared.library.says_the_same(chosen.library) or values["force"]:
        return Capabilities(prepared.library)
    raise UsageError(
        f"run {run.number} was begun with other capabilities than this command has, and a journal "
        "alone does not say what runners do; give the --capabilities of 'gpsfsm run' again, or "
        "--force to go on with those of the journal"
    )


def _go_on(
    this: Past,
    earlier: list[Past],
    stored: tuple[Journal, StoredRun, str],
    asked: tuple[Mapping[str, Any], Interrupt, Keys | None],
) -> int:
    """Take a run to its end that no queue waits for, and tell how it ended."""
    from gpsfsm.cli._opened import News  # noqa: PLC0415
    from gpsfsm.cli._real import real  # noqa: PLC0415
    from gpsfsm.cli._runs import REAL, drive, exit_code, simulation  # noqa: PLC0415
    from gpsfsm.cli._views import View  # noqa: PLC0415
    from gpsfsm.execution.records import Input, Kind  # noqa: PLC0415
    from gpsfsm.execution.replay import Comparing  # noqa: PLC0415
    from gpsfsm.execution.resume import resume_into, simulate_again  # noqa: PLC0415

    prepared, rows = this.prepared, this.rows
    (journal, run, forced), (values, interrupt, keys) = stored, asked
    kernel = prepared.kernel()
    writer = journal.go_on(kernel, run.number)
    news = News(None if prepared.heading.mode == REAL else Comparing(kernel, rows, writer))
    view = View(
        values["output_format"],
        kernel,
        verbose=values["verbose"],
        at_once=prepared.heading.mode == REAL,
        is_new=lambda: news.is_new,
        keys=keys,
    )
    with view:
        if news.sink is None:
            driver = real(prepared, kernel, writer, interrupt, model=values["model"], rows=rows)
            view.recall(rows, kernel)
            driver.watchers.append(view)
            resume_into(driver, rows)
            if forced:
                driver.mark(Input(Kind.NOTE, message=forced))
            drive(driver, view.tick)
        else:
            again = simulation(
                *(prepared, kernel, news, interrupt),
                shared=_shared(earlier, values["model"]),
                plans=this.plans(),
                rows=rows,
            )
            again.watchers.append(view)
            again.in_past = lambda: news.sink is not None and news.sink.next is not None
            simulate_again(again, news.sink)
        view.say(view.tally.told)
    return exit_code(kernel.status, interrupt)
