from __future__ import annotations

import hashlib
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import InputError
from gpsfsm.execution.queue_rows import QueueKind, QueueRow
from gpsfsm.generation.attempt_log import Keeper, KeptSession, Session, sessions
from gpsfsm.generation.language_model import Answer
from gpsfsm.generation.loop import Attempt, Generated, Judgement

SESSION = Session("go", "m", "plan.1", "a", "b", "c", rounds=3)
GOOD = Attempt(1, 1, "go", Answer("<Plan/>", "m"), Judgement(True, "<Plan/>", "fine"))
BAD = Attempt(
    1, 1, "go", Answer("x", "m"), Judgement(False, "", "none", 1, findings=(("GP104", "none"),))
)
LOST = Attempt(2, 1, "go", problem="no one answers", note="asked without its earlier answer")


class Rows(list[tuple[int, QueueRow]]):
    """A log that is a list."""

    def write_queue(self, at_us: int, row: QueueRow) -> None:
        self.append((at_us, row))

    @property
    def rows(self) -> list[QueueRow]:
        return [row for _, row in self]


def written(
    log: Rows, attempts: list[Attempt], *, plan: int = 0, ended: bool = True
) -> KeptSession:
    keeper = Keeper(log, plan, now_us=lambda: len(log))
    keeper.session(SESSION)
    for attempt in attempts:
        keeper.attempt(attempt)
    if not ended:
        return KeptSession(plan, SESSION, attempts)
    best = next((each for each in attempts if each.accepted), None)
    reason = "" if best else "no plan was accepted in 3 attempts"
    keeper.generated(Generated(tuple(attempts), best, reason))
    result = dict(log.rows[-1].data or {})
    return KeptSession(plan, SESSION, attempts, result, reason)


ATTEMPTS = st.lists(st.sampled_from([GOOD, BAD, LOST]), max_size=4)


@given(st.lists(st.tuples(ATTEMPTS, st.integers(0, 3), st.booleans()), max_size=4))
def test_what_was_kept_is_found_again(message: list[tuple[list[Attempt], int, bool]]) -> None:
    log = Rows()
    expected = [written(log, attempts, plan=plan, ended=ended) for attempts, plan, ended in message]
    # rows of the plan queue stand in between
    rows = [row for each in log.rows for row in (each, QueueRow(QueueKind.BOND_LOST))]
    assert sessions(rows) == expected
    assert [at_us for at_us, _ in log] == list(range(len(log)))


def test_a_result_names_its_plan() -> None:
    kept = written(log := Rows(), [BAD, replace(GOOD, round=2)])
    assert kept.accepted
    digest = hashlib.sha256(b"<Plan/>").hexdigest()
    assert log.rows[-1].data == {"accepted": True, "round": 2, "candidate": 1, "sha256": digest}


def test_without_an_answer_there_is_nothing_to_name() -> None:
    kept = written(log := Rows(), [LOST])
    assert not kept.accepted
    assert (log.rows[-1].data, kept.reason) == ({"accepted": False}, log.rows[-1].message)


@pytest.mark.parametrize("kinds", [[2], [3], [1, 3, 3], [1, 3, 2], [1, 2, 3, 2]])
def test_rows_that_belong_to_nothing_are_refused(kinds: list[int]) -> None:
    log = Rows()
    written(log, [BAD])
    rows = [log.rows[kind - 1] for kind in kinds]
    with pytest.raises(InputError, match="belongs to no session"):
        sessions(rows)


def test_an_attempt_of_another_plan_is_refused() -> None:
    log = Rows()
    written(log, [BAD], plan=1, ended=False)
    with pytest.raises(InputError, match="a row ATTEMPT belongs to no session"):
        sessions([log.rows[0], log.rows[1]._replace(plan=2)])
