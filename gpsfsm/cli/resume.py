"""``gpsfsm resume``: go on with a journaled run whose process has ended."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import click

from gpsfsm.cli._help import ANY_PATH, Command, Section, declare
from gpsfsm.cli._model import ModelValues, model_options, run_model_settings
from gpsfsm.cli._options import (
    LibraryValues,
    config_options,
    format_option,
    library_options,
    read_values,
)
from gpsfsm.cli._running import AllowValues, allow_options, permissions
from gpsfsm.errors import UsageError
from gpsfsm.model.ros import GOALS
from gpsfsm.running.bounds import PERMISSIONS, not_permitted
from gpsfsm.streams import complain

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.generation.providers import ModelSettings
    from gpsfsm.running.admission import Admission
    from gpsfsm.running.prepare import Prepared
    from gpsfsm.running.resumption import Resumption

_NO_JOURNAL = """no journal is given; name the file of one. Example:
  gpsfsm resume run.db"""
_SETTINGS = frozenset({"capabilities", "builtin_capabilities", "robot"})


@dataclass(frozen=True, kw_only=True)
class ResumeCommand(AllowValues, ModelValues, LibraryValues):
    """The options of ``gpsfsm resume``; ``model`` are the settings of the one that is asked."""

    journal: str
    number: int | None
    real: bool
    force: bool
    goals: tuple[str, ...]
    durability: str
    output_format: str
    verbose: bool
    model: ModelSettings | None = None


@click.command("resume", cls=Command, section=Section.RUN, short_help="Resume a run after a crash.")
@click.argument("journal", required=False, metavar="JOURNAL", type=ANY_PATH)
@declare(
    "--run",
    "number",
    type=click.IntRange(min=1),
    metavar="N",
    common=True,
    help="Run number in the journal. [default: the last]",
)
@declare("--real", is_flag=True, common=True, help="Required to resume a run of real runners.")
@allow_options
@declare(
    "--force",
    is_flag=True,
    common=True,
    help="With --real: resume despite errors or changed capabilities.",
)
@declare(
    "--goal",
    "goals",
    multiple=True,
    metavar="ID=WORD",
    help="With --real: what became of a goal that its server does not know: succeeded, ended or "
    "never (which sends it again); may be repeated.",
)
@declare(
    "--durability",
    type=click.Choice(["power", "process", "none"]),
    default="power",
    show_default=True,
    help="What the journal survives: a power failure, the end of the process, or nothing.",
)
@format_option("auto", "plain", "json", text="auto: a live tree on a terminal, else lines.")
@declare("--verbose", is_flag=True, help="Show every event.")
@model_options(timeout="--model-timeout")
@library_options
@config_options
@click.pass_context
def command(context: click.Context, /, **_: object) -> int:
    r"""Resume the run in JOURNAL that has not ended.

    Actions with an outcome are not repeated. An action that was active is retried if its runner
    allows it, and has failed otherwise. A journal grants no permissions: --real, --allow-…,
    --capabilities and --model must be given again. Then the plans that were waiting run.

    Exit code: as for 'gpsfsm run'. A run that has ended is left alone.

    \b
    Example:
      gpsfsm resume run.db
    """
    if not context.params["journal"]:
        raise click.UsageError(_NO_JOURNAL, context)
    values = read_values(context, ResumeCommand, _SETTINGS, named=True)
    for name in (*PERMISSIONS, "force", "goals"):
        if getattr(values, name) and not values.real:
            raise UsageError(f"--{name.replace('_', '-').removesuffix('s')} needs --real")
    return _run(replace(values, model=run_model_settings(context, real=values.real)))


def _run(values: ResumeCommand) -> int:
    from gpsfsm.execution.journal import Journal
    from gpsfsm.execution.journal_read import JournalReader
    from gpsfsm.running.goals import ledger_of, taken_words
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.model_access import model_left
    from gpsfsm.running.resumption import Resumption, refuse_empty
    from gpsfsm.running.terminal import Show, Terminal, exit_code, worst
    from gpsfsm.watch.console import keyboard

    refuse_empty(values.journal)  # a journal that is not there is not to be made
    with ExitStack() as stack:
        interruption = stack.enter_context(Interruption())
        journal = stack.enter_context(Journal(values.journal, values.durability))
        if journal.note:
            complain(journal.note)
        terminal = Terminal(Show(values.output_format, values.verbose), interruption)
        terminal.keys = keyboard(values.output_format, interruption, stack)
        with JournalReader(values.journal) as reader:
            left = Resumption(reader, values.number, complain)
            run = left.run
            if left.ended:
                complain(f"run {run.number} has ended already: {run.status.value}")
                return exit_code(run.status, interruption)
            _refuse_surprise(run, values)
            ledger = ledger_of(reader, "", run.number) if values.goals else ()
            said = taken_words(ledger, values.goals)
            left.load(lambda heading: _permitted(heading, values, said))
            of_run = left.this.prepared, left.queue, stack
            model = model_left(reader, run, values.model, of_run)
            admission = _admission(left, values)
            if refused := left.refused(admission, terminal):
                return worst(each.code for each in refused)
            session = left.session(
                *(admission, terminal, model), journal=journal, interruption=interruption
            )
        left.go_on(session)
        return terminal.exit_code()


def _refuse_surprise(run: StoredRun, values: ResumeCommand) -> None:
    """A file alone does not make real runners act, nor allow them anything: it may be forged."""
    from gpsfsm.model.printable import clip
    from gpsfsm.running.prepare import REAL

    if run.mode != REAL:
        return
    missing = [
        clip(each, 300)
        for each in not_permitted(run.options, permissions(values, values.library.allow or ()))
    ]
    if not values.real:
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


def _permitted(heading: Heading, values: ResumeCommand, said: dict[str, str]) -> Heading:
    """The heading with what this command allows and says of goals, whatever the journal says."""
    options: dict[str, Any] = {
        name: each for name, each in heading.options.items() if name not in PERMISSIONS
    }
    options |= permissions(values, values.library.allow or ())
    return replace(heading, options=options | {GOALS: said})


def _admission(left: Resumption, values: ResumeCommand) -> Admission:
    """The admission that plans have to pass, those that are left as those that they submit.

    Raises UsageError if a real run was begun with other capabilities.
    """
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.running.admission import Admission
    from gpsfsm.running.prepare import REAL
    from gpsfsm.syntax import Limits

    prepared = left.this.prepared
    capabilities = Capabilities(prepared.library)
    if left.base.mode == REAL:
        capabilities = _same_capabilities(prepared, left.run, values)
    return Admission(left.base, capabilities, Limits(), force=values.force, trees=True)


def _same_capabilities(prepared: Prepared, run: StoredRun, values: ResumeCommand) -> Capabilities:
    """The capabilities of the journal, which are those of this command.

    Raises UsageError if they are not: the plan was checked with the journal's.
    """
    chosen = values.library
    if prepared.library.says_the_same(chosen.library) or values.force:
        return replace(chosen, library=prepared.library)
    raise UsageError(
        f"run {run.number} was begun with other capabilities than this command has. A journal "
        "alone does not say what runners do; repeat the --capabilities of 'gpsfsm run' or add "
        "--force to continue with those of the journal"
    )
