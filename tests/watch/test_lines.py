"""Plain lines and counts."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from gpsfsm.execution.records import Kind, Record, Status
from gpsfsm.watch.moments import seconds, status_of
from gpsfsm.watch.record_text import Detail, Lines
from tests.watch.support import Watched, runner, watch

if TYPE_CHECKING:
    from collections.abc import Callable

PLAN = f"""<Plan>
{runner(takes="2", line="hm")}
<Control type="parallel_any" name="both">
{runner("One", takes="1.5", message="no way")}
{runner("Two", takes="3")}
</Control>
<Control type="parallel_all">
{runner("Three")}
{runner("Four", takes="9", message="late")}
</Control>
<Control type="recovery">
{runner("Five")}
</Control>
</Plan>"""


def lines_of(text: str, detail: Detail = Detail.RUN) -> tuple[list[str], Watched]:
    results: list[str] = []

    def lines(run: Watched) -> Callable[..., None]:
        return Lines(run.words, results.append, detail=detail)

    return results, watch(text, lines)


def test_lines_tell_what_the_plan_does() -> None:
    lines, run = lines_of(PLAN)
    assert lines == [
        "     0.000 s  line  2  Go (takes=2, line=hm) started",
        "     0.000 s  line  2  Go (takes=2, line=hm) says: hm",
        "     2.000 s  line  2  Go (takes=2, line=hm) succeeded",
        "     2.000 s  line  4  One (takes=1.5, message=no way) started",
        "     2.000 s  line  5  Two (takes=3) started",
        "     3.500 s  line  4  One (takes=1.5, message=no way) failed: no way",
        "     5.000 s  line  5  Two (takes=3) succeeded",
        "     5.000 s  line  3  parallel_any 'both': one has succeeded",
        "     5.000 s  line  8  Three started",
        "     5.000 s  line  9  Four (takes=9, message=late) started",
        "     6.000 s  line  8  Three succeeded",
        "    14.000 s  line  9  Four (takes=9, message=late) failed: late",
        "    14.000 s  line  7  parallel_all: one has failed",
        "    14.000 s  line 12  Five started",
        "    15.000 s  line 12  Five succeeded",
    ]
    assert run.tally.status is Status.COMPLETED
    assert run.tally.summary == "COMPLETED after 15.000 s: 6 started, 4 succeeded, 2 failed"


def test_all_events_can_be_told() -> None:
    lines, run = lines_of(PLAN, Detail.ALL)
    assert len(lines) == len(run.moments)
    assert lines[0] == "     0.000 s  the run begins"
    assert "     0.000 s  runner a/Go is being loaded" in lines
    assert "     0.000 s  line  2  Go (takes=2, line=hm) triggered: takes=2, line='hm'" in lines
    assert lines[-1].endswith("the run has ended: COMPLETED")


def test_what_is_stopped_is_counted() -> None:
    pair = f"{runner('One')}{runner(takes='5')}"
    text = f'<Plan><Control type="parallel_any">{pair}</Control></Plan>'
    lines, run = lines_of(text)
    assert lines[-1] == "     1.000 s  line 1  Go (takes=5) stopped"
    assert run.tally.summary == (
        "COMPLETED after 1.000 s: 2 started, 1 succeeded, 0 failed, 1 stopped"
    )


def test_a_timeout_is_a_failure_and_not_a_stop() -> None:
    run = Watched(f"<Plan>{runner(takes='9')}</Plan>")
    run.driver._timeout_us = 1_000_000
    run.driver.run()
    assert run.tally.summary == "GAVE_UP after 1.000 s: 1 started, 0 succeeded, 1 failed"


def test_no_plan_writes_control_characters() -> None:
    text = f"<Plan>{runner(text='&#x202e;x', line='a&#10;b', message='&#x85;')}</Plan>"
    lines, _ = lines_of(text, Detail.ALL)
    assert all(line.isprintable() for line in lines)
    assert any(line.endswith("says: a b") for line in lines)
    assert any("\\u202e" in line for line in lines)


def test_every_kind_of_record_has_a_sentence() -> None:
    run = Watched(f"<Plan>{runner()}</Plan>")
    for kind in Kind:
        node = 0 if kind is Kind.JOINED else 1
        data = {"status": "STUCK"} if kind is Kind.ENDED else None
        assert run.words.sentence(Record(kind, node, data=data, message="why")).strip(), kind


@pytest.mark.parametrize(
    ("at_us", "message"),
    [(0, "0.000"), (499, "0.000"), (500, "0.001"), (3_600_000_000, "3600.000")],
)
def test_times(at_us: int, message: str) -> None:
    assert seconds(at_us) == message


def test_the_status_of_an_end() -> None:
    assert status_of(Record(Kind.ENDED, data={"status": "STUCK"})) is Status.STUCK


def test_long_values_are_clipped() -> None:
    run = Watched(f"<Plan>{runner()}</Plan>")
    data = {f"name{number}": "x" * 1000 for number in range(50)}
    message = run.words.sentence(Record(Kind.SUCCEEDED, 1, data=dict(data)))
    assert len(message) < 400
    assert message.endswith("…")
