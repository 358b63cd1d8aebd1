"""Stories of runs as data, and the vocabularies in which they and the messages are worded.

A story is a row of sentences, each a statement about runners. It becomes text only where somebody
reads it (``Scenario.story``), in the vocabulary of what was checked: a tree fails where a plan
gives up, and an engine that cannot give up hangs. Whoever asks which runner a sentence is about
asks its data:

    Sentence(Statement.SUCCEEDS, (go, say), count=2)    with go = Actor("/Plan/Runner[1]", "Go at…")
    text: Go at line 2 succeeds, and so do 2 more and Say at line 5
    data: the event SUCCEEDED of /Plan/Runner[4], the last of the row
"""

from __future__ import annotations

from enum import Enum, StrEnum
from typing import TYPE_CHECKING

from gpsfsm.late import dataclass
from gpsfsm.model.event import End, Event

if TYPE_CHECKING:
    from collections.abc import Mapping

PAPER_ENGINE = "paper"
"""The semantics of the paper, which is no engine."""

FABRIC_V1 = "fabric-v1"
"""The Fabric server of the first published experiment (2025)."""

FABRIC_V2 = "fabric-v2"
"""The Fabric server of the second published experiment (March 2026)."""

FABRIC_V3 = "fabric-v3"
"""The Fabric server that followed, v0.3 (2026): it checks where values come from."""

ENGINES = (PAPER_ENGINE, FABRIC_V1, FABRIC_V2, FABRIC_V3)
"""The names of all profiles."""


@dataclass(frozen=True, slots=True)
class Terms:
    """The terms of one vocabulary: what a plan is called, how it ends, what handles a failure."""

    whole: str = "plan"
    gives_up: str = "gives up"
    give_up: str = "give up"
    parallel_any: str = "parallel_any"
    parallel_all: str = "parallel_all"
    ends_it: tuple[str, str] = ("ends the plan", "end the plan")
    last_attempt: str = "last step of a recovery"
    unguarded: str = "nothing handles it"
    all_units: str = "all units of the parallel_any must fail"
    inverted: str = "an Inverter turns it into a failure"
    tolerate_hint: str = (
        "the plan then gives up and a new one is generated; use --tolerate N to require that no N "
        "failures end the plan"
    )
    tolerate_more: str = (
        "add a recovery that reaches the goal in another way after the runner that fails in the "
        "scenario; a step that only logs or waits would hide the failure"
    )


PLAN_TERMS = Terms()


class Vocabulary(StrEnum):
    """The vocabularies: of plans, behaviour trees, machines, and engines that cannot give up."""

    PLAN = "plan"
    TREE = "tree"
    ENGINE = "engine"
    MACHINE = "machine"

    @property
    def terms(self) -> Terms:
        """The terms of this vocabulary."""
        return _TERMS[self]

    def ending(self, end: End) -> str:
        """The end of a run in words: ``the plan gives up``."""
        verb = self.terms.gives_up if end is End.GAVE_UP else _VERBS[end]
        return verb if end is End.ABORT else f"the {self.terms.whole} {verb}"


_TERMS: Mapping[Vocabulary, Terms] = {
    Vocabulary.PLAN: PLAN_TERMS,
    Vocabulary.TREE: Terms(
        whole="tree",
        gives_up="fails",
        give_up="fail",
        parallel_any="Parallel",
        parallel_all="Parallel",
        ends_it=("makes the tree fail", "make the tree fail"),
        last_attempt="last child of a Fallback or Retry",
        all_units="too many children of the Parallel must fail",
        tolerate_hint="use --tolerate N to require that no N failures make the tree fail",
        tolerate_more=(
            "put the node that fails in the scenario into a <Fallback> with another way to do it"
        ),
    ),
    Vocabulary.ENGINE: Terms(
        gives_up="hangs",
        give_up="hang",
        ends_it=("hangs the plan", "hang the plan"),
        tolerate_hint=(
            "this engine cannot give up and waits for ever; use --tolerate N to require that no N "
            "failures hang the plan"
        ),
    ),
    Vocabulary.MACHINE: Terms(
        whole="machine",
        ends_it=("ends the machine", "end the machine"),
        last_attempt="nothing handles it",
        tolerate_hint=(
            "the machine then gives up; use --tolerate N to require that no N failures end it"
        ),
        tolerate_more="connect the failure in the scenario to another way to the goal",
    ),
}


_VERBS: Mapping[End, str] = {
    End.COMPLETED: "completes",
    End.STUCK: "gets stuck",
    End.HANG: "hangs",
    End.ABORT: "the engine crashes",
    End.ENDLESS: "runs for ever",
}


class Statement(Enum):
    """The statements of which stories are made: what a runner does, or what a run comes to.

    The value is the text: ``{0}`` and ``{1}`` are the names of actors or other arguments, ``terms``
    is the vocabulary.
    """

    # events of runners
    SUCCEEDS = "{0} succeeds"
    FAILS = "{0} fails"
    HOLDS = "{0} holds"
    DOES_NOT_HOLD = "{0} does not hold"
    DOES_NOT_START = "{0} does not start and therefore fails"
    NEVER_ENDS = "{0} starts and never ends"
    IS_RUNNING = "{0} is running"
    # what is left out
    STEPS_LEFT_OUT = "… {count} more steps …"
    OUTCOMES_BEFORE = "… {count} outcomes before …"
    # what a run comes to
    UNHANDLED_FAILURE = "nothing handles this failure: the {terms.whole} {terms.gives_up}"
    UNHANDLED_SUCCESS = "nothing handles this success: the {terms.whole} {terms.gives_up}"
    WAITS_FOR_EVER = "{0} waits for ever"
    CANNOT_SUCCEED = "{0} can no longer succeed"
    STUCK = "nothing more can happen: the {terms.whole} is stuck"
    UNHANDLED = "nothing handles that: the {terms.whole} {terms.gives_up}"
    GOES_ON = "the rest of the {terms.whole} continues without it"
    RECOVERED = "the recovery takes over"
    NOT_COMPLETED = "the {terms.whole} does not complete"
    SWALLOWED = "the {terms.whole} completes anyway"
    LEFT_RUNNING = "the {terms.whole} completes while {0} is still running"
    UNFLUSHED = "the {terms.whole} completes, possibly without flushing '{0}' after this prompt"
    EMPTY_FLUSH = "the buffer '{0}' may be empty when it is sent"
    HELD_TWICE = "both use the {0} at the same time"
    COMPLETES_BY = "the {terms.whole} completes after up to {0} s"
    COMPLETES_SOMETIME = "the {terms.whole} completes, but nothing limits how long that takes"
    GIVES_UP_BY = "the {terms.whole} {terms.gives_up} after up to {0} s"
    GIVES_UP_SOMETIME = "the {terms.whole} {terms.gives_up}, but nothing limits how long that takes"
    TAKES_ENERGY = "this run takes up to {0} J"
    TAKES_ANY_ENERGY = "nothing limits the energy that this run takes"
    JOIN_LOOPS = "the join triggers itself: the engine crashes"
    SECOND_INPUT = "the join receives a second input: the engine crashes"
    BEGINS_LOOP = "from here on, this repeats for ever:"
    FOR_EVER = "and so on: the {terms.whole} neither completes nor {terms.gives_up}"
    REMARK = "{0}"

    @property
    def event(self) -> Event | None:
        """The event of a runner that is stated; None for all others."""
        return _EVENTS.get(self)

    @property
    def at_once(self) -> bool:
        """True if it holds as soon as the events before it; else it shows at the end of the run."""
        return self in _AT_ONCE

    @property
    def arity(self) -> int:
        """The number of arguments in the text."""
        return sum(f"{{{number}}}" in self.value for number in range(2))


_EVENTS: Mapping[Statement, Event] = {
    Statement.SUCCEEDS: Event.SUCCEEDED,
    Statement.FAILS: Event.FAILED,
    Statement.HOLDS: Event.SUCCEEDED,
    Statement.DOES_NOT_HOLD: Event.FAILED,
    Statement.DOES_NOT_START: Event.FAILED,
    Statement.NEVER_ENDS: Event.STARTED,
    Statement.IS_RUNNING: Event.STARTED,
}
_AT_ONCE = frozenset(
    {
        *(Statement.CANNOT_SUCCEED, Statement.HELD_TWICE, Statement.EMPTY_FLUSH),
        *(Statement.STEPS_LEFT_OUT, Statement.OUTCOMES_BEFORE, Statement.BEGINS_LOOP),
    }
)


@dataclass(frozen=True, slots=True)
class Actor:
    """A runner in a story: its element path, and its name with its place as messages show it."""

    element: str
    name: str


@dataclass(frozen=True, slots=True)
class Sentence:
    """One statement of a story.

    ``actors`` are the runner whose event is stated, or the first and the last of a row of runners
    of which the same is stated; ``count`` are those between them, or what is left out.
    ``arguments`` are those of other statements; ``element`` is the path of the control that one of
    these is about. Raises ValueError where these do not fit the statement, since stories also come
    from processes that have read hostile text.
    """

    statement: Statement
    actors: tuple[Actor, ...] = ()
    count: int = 0
    arguments: tuple[str, ...] = ()
    element: str = ""

    def __post_init__(self) -> None:
        fits = (
            len(self.actors) in (1, 2) and not self.arguments
            if self.statement.event
            else not self.actors and len(self.arguments) == self.statement.arity
        )
        if not fits:
            raise ValueError(f"a sentence lacks or exceeds the arguments of {self.statement.name}")

    def text(self, vocabulary: Vocabulary) -> str:
        """The sentence in the words of a vocabulary."""
        names = tuple(actor.name for actor in self.actors[:1]) or self.arguments
        text = self.statement.value.format(*names, count=self.count, terms=vocabulary.terms)
        if len(self.actors) > 1:
            text += f", and so do {self.count} more and {self.actors[1].name}"
        return text


def remark(text: str) -> Sentence:
    """A sentence of somebody who has words of his own."""
    return Sentence(Statement.REMARK, arguments=(text,))
