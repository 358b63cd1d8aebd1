"""The ledger of goals as a journal has it, without the process that wrote it.

A step of a runner of ROS 2 that has started may have sent its goal: that row is written before.
Lines of the runner say what has become of the goal since, and the end of the step that it has
ended, as long as nothing says that this is unknown (``gpsfsm.ros.ledger``). What was open when the
process ended, or fell silent, is unknown: nobody hears any more what the server says.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.errors import InputError, UsageError
from gpsfsm.execution.journal_file import silence_of
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.records import Kind
from gpsfsm.execution.runner import visited
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import OnResume, RosKind, RosSettings
from gpsfsm.ros.ledger import IN_DOUBT, LEDGER, MAY_ACT, GoalState, Word, goal_id
from gpsfsm.running.prepare import FABRIC, REAL, stored
from gpsfsm.streams import Form, to_stdout

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.execution.journal_read import StoredRun
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.running.prepare import Prepared

_ENDS: dict[str, str] = {
    Kind.SUCCEEDED: "succeeded",
    Kind.FAILED: "failed",
    Kind.STOPPED: "stopped",
}
_LONGEST, _SHORTEST = 500, 4


@dataclass(frozen=True, slots=True)
class StepGoal:
    """The goal or the request of a step, as the rows of its run have it.

    ``how`` is how its step has ended, "" if it has not; ``why`` is why the state is unknown.
    """

    goal: str
    run: int
    step: str
    server: str
    resources: tuple[str, ...]
    on_resume: OnResume = OnResume.ASK
    state: GoalState = GoalState.IN_FLIGHT
    how: str = ""
    why: str = ""

    @property
    def may_act(self) -> bool:
        """True if it may act on the robot, for all that the journal says."""
        return self.state in MAY_ACT


def ledger_of(reader: JournalReader, silence: str, number: int | None = None) -> list[StepGoal]:
    """The goals of a run, of the last one if none is named; ``silence`` as of ``silence_of``.

    Raises GpsfsmError, also for a run whose goals are not sent from here.
    """
    run = reader.run(number)
    if run.mode == FABRIC or RosSettings.of(run.options.get("ros")).via:
        raise InputError(f"the server that runs the steps of run {run.number} has their goals")
    if run.mode != REAL:
        raise InputError(f"run {run.number} is simulated: it has sent no goal to a robot")
    why = "the run has ended" if run.status.ended else silence
    goals = fold(stored(reader, run), run, reader.events(run.number))
    return [
        replace(each, state=GoalState.UNKNOWN, why=each.why or why)
        if why and each.may_act
        else each
        for each in goals
    ]


def fold(prepared: Prepared, run: StoredRun, rows: Iterable[Row]) -> list[StepGoal]:
    """The goals of a run by its rows alone."""
    goals: dict[str, StepGoal] = {}
    of_node: dict[int, str] = {}
    make = _Maker(prepared, run)
    for row in rows:
        if row.kind == Kind.STARTED and (made := make(row)) is not None:
            goals[made.goal] = made
            of_node[row.node] = made.goal
        elif (goal := of_node.get(row.node)) is not None:
            values = row.values if row.kind == Kind.LOG else {}
            goal = str(values.get("goal", goal))
            if goal in goals:
                goals[goal] = _after(goals[goal], row)
    return [*goals.values()]


def _after(goal: StepGoal, row: Row) -> StepGoal:
    if row.kind == Kind.LOG:
        values = row.values
        word = "UNKNOWN" if values.get("left") == "unknown" else str(values.get(LEDGER))
        if values.get("left") == "seen to":
            return replace(goal, state=GoalState.ENDED)
        if word not in [*GoalState]:
            return goal
        server = clip(str(values.get("server") or goal.server), _LONGEST)
        why = clip(row.message, _LONGEST) if word == GoalState.UNKNOWN else ""
        return replace(goal, state=GoalState(word), server=server, why=why)
    if row.kind == Kind.RESTARTED:
        return replace(goal, state=GoalState.IN_FLIGHT, how="", why="")
    how = _ENDS.get(row.kind)
    if how is None or not row.record:
        return goal
    if goal.state is GoalState.UNKNOWN and how != "succeeded":
        return replace(goal, how=how)
    return replace(goal, state=GoalState.ENDED, how=how)


class _Maker:
    """Makes the goals of steps that start, for those whose runners call an action or a service."""

    def __init__(self, prepared: Prepared, run: StoredRun) -> None:
        self._words, self._library = prepared.words(), prepared.library
        self._number = run.number
        self._run = str(run.options.get("nonce", "") or run.seed)

    def __call__(self, row: Row) -> StepGoal | None:
        described = self._library.resolve(row.interface, row.provider).provider
        call = None if described is None else described.ros
        if described is None or call is None:
            return None
        if call.kind not in (RosKind.ACTION, RosKind.SERVICE):
            return None
        visit = row.message.removeprefix("visit ").replace(",", "")
        key = f"{self._run}:{visited(row.element, int(visit) if visit.isdecimal() else 1)}"
        return StepGoal(
            goal_id(key).hex,
            self._number,
            f"{self._words.line(row.node)}  {self._words.node(row.node)}",
            f"the {call.kind.value} {call.name}",
            described.resources,
            call.on_resume,
        )


def taken_words(goals: Sequence[StepGoal], texts: Iterable[str]) -> dict[str, str]:
    """The words of a person about goals, ``ID=word`` each, by whole ids. Raises UsageError."""
    open_goals = [each.goal for each in goals if each.may_act]
    said: dict[str, str] = {}
    for text in texts:
        start, _, word = text.partition("=")
        meant = [each for each in open_goals if len(start) >= _SHORTEST and each.startswith(start)]
        if word not in [*Word]:
            raise UsageError(f"--goal {text}: write ID=succeeded, ID=ended or ID=never")
        if len(meant) != 1:
            shown = ", ".join(each[:8] for each in open_goals) or "none"
            raise UsageError(f"--goal {text}: the open goals of the run are {shown}")
        goal = next(each for each in goals if each.goal == meant[0])
        if goal.on_resume is not OnResume.ASK:
            why = f"its runner has on_resume: {goal.on_resume.value}"
            raise UsageError(f"--goal {text} has no effect: {why}")
        said[goal.goal] = word
    return said


def show_status(journal: str, number: int | None) -> int:
    """Write the goals of a run of a journal: exit code 3 if one may act. Raises GpsfsmError."""
    silence = silence_of(journal)  # first: it lets go of the locks of this process
    with JournalReader(journal) as reader:
        goals = ledger_of(reader, silence, number)
    to_stdout("".join(f"{line}\n" for line in status_lines(goals)), Form.TEXT)
    return IN_DOUBT if any(each.may_act for each in goals) else 0


def status_lines(goals: Iterable[StepGoal]) -> list[str]:
    """The goals as lines for people: id, state, step, server, resources, and why it is unknown."""
    lines = []
    for each in goals:
        used = f"; uses {', '.join(each.resources)}" if each.resources else ""
        lines.append(f"{each.goal}  {each.state:<9}  run {each.run}, {each.step}")
        how = f", its step has {each.how}" if each.how else ""
        lines.append(f"{'':32}  {each.server}{used}{how}")
        if each.state is GoalState.UNKNOWN and each.why:
            lines.append(f"{'':32}  {each.why}")
    return lines or ["no goal was sent"]
