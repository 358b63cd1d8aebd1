"""What a worker has: the capabilities and limits of the service, and how it makes options."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.analysis.options import DEFAULT_TOTAL_RLIMIT, AnalysisOptions
from gpsfsm.api import check_options

if TYPE_CHECKING:
    from gpsfsm.capabilities.library import Capabilities
    from gpsfsm.checking import CheckOptions
    from gpsfsm.model.finding import Finding
    from gpsfsm.service.shapes import ShownFinding, Wishes
    from gpsfsm.syntax import Limits
    from gpsfsm.tasks.task import Task

__all__ = ["Kitchen", "sent_task", "shown"]


@dataclass(frozen=True, slots=True)
class Kitchen:
    """What all requests have in common."""

    capabilities: Capabilities
    limits: Limits

    def options(self, wishes: Wishes, total_rlimit: int = DEFAULT_TOTAL_RLIMIT) -> CheckOptions:
        """The options that a client wishes. Raises UsageError for what makes no sense.

        ``total_rlimit`` holds where the client does not wish another one.
        """
        analysis = AnalysisOptions(
            faults=tuple(wishes.faults),
            consistent=wishes.consistent,
            assumptions=tuple(wishes.assume),
            solver=wishes.solver,
            rlimit=wishes.rlimit,
            total_rlimit=wishes.total_rlimit or total_rlimit,
            max_scenarios=wishes.max_scenarios,
            deadline_s=wishes.deadline_s,
            energy_limit_j=wishes.energy_limit_j,
        )
        return check_options(
            analysis,
            select=wishes.select,
            ignore=wishes.ignore,
            from_response=wishes.from_response,
            limits=self.limits,
            capabilities=self.capabilities,
            engine=wishes.engine,
        )


def sent_task(text: str) -> Task:
    """A task that was sent; a client has no business with files of this machine.

    Raises UsageError for one that names files, ConfigError for one that is wrong.
    """
    from gpsfsm.capabilities.defects import Notes  # noqa: PLC0415
    from gpsfsm.capabilities.reading import read_table  # noqa: PLC0415
    from gpsfsm.errors import UsageError  # noqa: PLC0415
    from gpsfsm.tasks.load import read_task  # noqa: PLC0415  (loads pydantic)

    content = text.encode("utf-8", "replace")
    table = read_table(content, Notes("<task>", kind="task"))
    if table is not None and "not_answers" in table:
        raise UsageError("a task that is sent names no files: leave out not_answers")
    return read_task(content)


def shown(finding: Finding) -> ShownFinding:
    """A finding as answers have it."""
    from gpsfsm.service.shapes import Place, ShownFinding  # noqa: PLC0415  (loads pydantic)

    place = finding.location
    return ShownFinding(
        rule=finding.rule,
        name=finding.name,
        severity=finding.severity.value,
        message=finding.message,
        hint=finding.hint,
        location=Place(line=place.line, column=place.column, element=place.element),
    )
