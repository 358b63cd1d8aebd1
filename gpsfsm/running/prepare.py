"""Prepared runs: from the heading of a run, new or journaled, to a plan that can run."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

from gpsfsm.capabilities.dialects import library_in_dialect
from gpsfsm.capabilities.library import bind, bind_leaves
from gpsfsm.capabilities.table import load
from gpsfsm.compile import MachinePlan, compile_plan, plan_text
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.errors import GpsfsmError, InternalError
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.journal_errors import DamagedJournalError, JournalError
from gpsfsm.execution.kernel import Kernel
from gpsfsm.model.engine import EnginePlan
from gpsfsm.model.story import ENGINES, PAPER_ENGINE
from gpsfsm.running.bounds import MAX_VISITS
from gpsfsm.syntax import Limits
from gpsfsm.watch.record_text import Words

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.journal_read import JournalReader, StoredRun
    from gpsfsm.syntax import Parsed

DRAWN, SCENARIO, WORLD, REAL = "drawn", "scenario", "world", "real"
"""The kinds of runners of a run: the mode of its heading."""

FABRIC = "fabric"
"""The mode of a run that a Fabric server drives: its runners are none of ours."""

_NO_LIMIT = 2**62
OF_A_JOURNAL = Limits(**{each.name: _NO_LIMIT for each in fields(Limits)})
"""The contents of a journal have passed the limits of its run."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """A plan that can run, or ran: its heading in the journal, and what it is compiled to."""

    heading: Heading
    compiled: Compiled
    library: Library

    def kernel(self) -> Kernel:
        """A fresh kernel of the plan."""
        options, compiled = self.heading.options, self.compiled
        if not isinstance(compiled.automaton.plan, MachinePlan):
            return Kernel(compiled, apart=options.get("no_start") is True)
        from gpsfsm.execution.machine_kernel import MachineKernel  # loads networkx

        most = options.get("max_visits")
        if not isinstance(most, int):
            most = None if self.heading.mode == REAL else MAX_VISITS
        return MachineKernel(compiled, most_visits=most)

    def words(self) -> Words:
        """The names of its nodes and runners."""
        return Words(self.compiled.automaton, self.kernel().runners)


def prepare(heading: Heading, library: Library, limits: Limits = OF_A_JOURNAL) -> Prepared:
    """Compile the plan of a heading. Raises GpsfsmError if there is none in its text."""
    engine = engine_of(heading)
    library = library_in_dialect(library, engine)
    from_response = heading.options.get("from_response") is True
    parsed = None
    machine = machine_in(heading, limits)
    if machine is not None:
        if machine.plan is None:
            raise GpsfsmError(f"{heading.file}: there is no machine that could be run")
        compiled = compile_plan(machine.plan, bindings=bind(machine.plan, library))
        return Prepared(heading, compiled, library)
    if engine == PAPER_ENGINE or from_response:
        parsed = plan_text.read_plan(
            heading.plan, file=heading.file, limits=limits, from_response=from_response
        )
    if engine != PAPER_ENGINE:
        text = parsed.body if parsed is not None else heading.plan
        return Prepared(heading, _on_engine(heading, engine, text, library, limits), library)
    if parsed is None or parsed.plan is None:
        raise GpsfsmError(f"{heading.file}: there is no plan that could be run")
    compiled = compile_plan(
        parsed.plan,
        bindings=bind_leaves(parsed.plan, library, real=heading.mode == REAL),
        start_chain=heading.options.get("no_start") is True,
    )
    return Prepared(heading, compiled, library)


def machine_in(heading: Heading, limits: Limits = OF_A_JOURNAL) -> Parsed | None:
    """The machine in the text of a heading; None if it is another text."""
    if heading.options.get("from_response") is True:
        return None
    return plan_text.machine_in(heading.plan, file=heading.file, limits=limits)


def engine_of(heading: Heading) -> str:
    """The name of the profile of the engine as which plans run. Raises DamagedJournalError."""
    engine = heading.options.get("engine", PAPER_ENGINE)
    if engine not in ENGINES:
        raise DamagedJournalError(f"there is no engine '{engine!s:.40}'")
    return str(engine)


def _on_engine(
    heading: Heading, engine: str, text: str | bytes, library: Library, limits: Limits
) -> Compiled:
    """The plan that an engine makes of a text. Raises GpsfsmError if it refuses it."""
    reading = read_for_engine(text, engine, heading.file, library, limits)
    if not isinstance(reading, EngineReading):
        assert not isinstance(reading.result, EnginePlan)
        where = f"{heading.file}:{reading.line}:{reading.column}"
        raise GpsfsmError(f"{where}: {engine} does not run this: {reading.result.reason}")
    return reading.compiled


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


def texts(options: Mapping[str, Any], name: str) -> tuple[str, ...]:
    """The texts of an option of a heading; none if it holds anything else."""
    values = options.get(name, [])
    return tuple(map(str, values)) if isinstance(values, list) else ()
