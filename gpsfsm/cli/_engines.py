"""As which engine a run runs a plan."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.engines import EngineReading, read_for_engine
from gpsfsm.errors import GpsfsmError, UsageError
from gpsfsm.execution.journal_errors import DamagedJournalError
from gpsfsm.model.engine import ENGINES, PAPER_ENGINE, EnginePlan
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.capabilities.library import Library
    from gpsfsm.cli._scenario import FromFile
    from gpsfsm.compile import Compiled
    from gpsfsm.execution.journal import Heading
    from gpsfsm.syntax import Limits

__all__ = ["chosen_engine", "engine_of", "on_engine"]


def chosen_engine(values: Mapping[str, Any], scenario: FromFile | None) -> str:
    """The engine whose way of running plans is wanted: that of a scenario if none is named."""
    if values["engine"] == PAPER_ENGINE and scenario is not None and scenario.engine:
        if scenario.engine not in ENGINES:
            raise UsageError(
                f"{values['scenario']}: there is no engine '{clip(scenario.engine, 40)}'"
            )
        return scenario.engine
    engine: str = values["engine"]
    return engine


def engine_of(heading: Heading) -> str:
    """The name of the profile of the engine as which plans run. Raises DamagedJournalError."""
    engine = heading.options.get("engine", PAPER_ENGINE)
    if engine not in ENGINES:
        raise DamagedJournalError(f"there is no engine '{engine!s:.40}'")
    return str(engine)


def on_engine(
    heading: Heading, engine: str, text: str | bytes, library: Library, limits: Limits
) -> Compiled:
    """What an engine makes of a text. Raises GpsfsmError if it refuses it."""
    reading = read_for_engine(text, engine, heading.file, library, limits)
    if not isinstance(reading, EngineReading):
        assert not isinstance(reading.result, EnginePlan)
        where = f"{heading.file}:{reading.line}:{reading.column}"
        raise GpsfsmError(f"{where}: {engine} does not run this: {reading.result.reason}")
    return reading.compiled
