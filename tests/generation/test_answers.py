"""A model that is asked in virtual time: answers come once, and then from the journal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.execution.journal_rows import Row, RowMaker, endings, line
from gpsfsm.execution.records import Status
from gpsfsm.execution.replay import Comparing, simulate_again
from gpsfsm.execution.virtual import VirtualDriver
from gpsfsm.generation.language_model import ModelError
from gpsfsm.generation.service import Answers, AskingInterruptedError
from gpsfsm.simulation.makers import world_maker, world_services
from gpsfsm.simulation.world import Answer as Said
from gpsfsm.simulation.world import Settings
from tests.generation.scripted import Scripted
from tests.runners.prompting import LIBRARY, kernel_of, service, timed
from tests.simulation.support import control, field_of, plan, run, runner

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from gpsfsm.execution.kernel import Kernel
    from gpsfsm.generation.service import ModelService

GOOD = "<Plan></Plan>"
PLAN = plan(
    runner("PromptText", text="Ada is here.", uuid="u"),
    control(
        "parallel_all",
        runner("PromptText", text="Who is there?", uuid="u", flush="true"),
        runner("Wait", seconds="3.0"),
        runner("PromptSpeech", task="greet her", uuid="u", flush="true"),
    ),
    control("recovery", runner("PromptPlan", task="go on", uuid="u", flush="true")),
    runner("PromptText", text="the end", flush="true"),
    control("recovery", runner("Log", text="it failed")),
)


class _Writer:
    """Keeps rows, as a journal does: whole transactions."""

    def __init__(self, kernel: Kernel, rows: Iterable[Row] = ()) -> None:
        self.rows = list(rows)
        self.maker = RowMaker(kernel, len(self.rows))

    def write(self, at_us, happened, records) -> None:
        self.rows += self.maker.make(at_us, happened, records)


def simulate(
    text: str,
    past: Sequence[Row],
    asking: ModelService | None,
    *,
    timeout_s: float | None = None,
) -> list[Row]:
    """Simulate a run whose first events are known; all its rows."""
    kernel = kernel_of(text)
    writer = _Writer(kernel, past)
    sink = Comparing(kernel, past, writer)  # type: ignore[arg-type]
    last_us = past[-1].at_us if past else -1
    world = field_of()
    services = world_services(world, LIBRARY, answers=Answers(asking, endings(past), last_us))
    driver = VirtualDriver(
        *(kernel, sink, world_maker(world, LIBRARY)),
        seed=3,
        services=services,
        timeout_s=timeout_s,
    )
    simulate_again(driver, sink)
    assert kernel.status is Status.COMPLETED
    return writer.rows


def lines(rows: Iterable[Row]) -> list[str]:
    return [line(row) for row in rows]


class ByTask(Scripted):
    """Answers by the words of the task, whenever it is asked."""

    async def answer(self, request):
        await super().answer(request)
        result = self.answers[0][request.task]
        if isinstance(result, ModelError):
            raise result
        return result


def model(**changes: object) -> ByTask:
    results = {
        "Who is there?": timed("Ada.", 5.0),
        "greet her": timed("Hello!", 1.25),
        "go on": timed(f"{GOOD}", 2.0),
        "the end": ModelError("the server is away"),
    }
    return ByTask([{**results, **changes}])  # type: ignore[list-item]


def cuts(rows: Sequence[Row]) -> list[int]:
    """Where a journal can end: between two inputs."""
    return [place for place, row in enumerate(rows) if row.input] + [len(rows)]


WHOLE = simulate(PLAN, (), service(model()))


def test_answers_take_the_time_that_they_took() -> None:
    ended = {row.element: row for row in WHOLE if row.kind in ("SUCCEEDED", "FAILED")}
    times = {row.kind + row.element: row.at_us for row in WHOLE}
    for place, seconds in ((1, 5.0), (3, 1.25)):
        element = f"/Plan/Control[1]/Runner[{place}]"
        taken_us = ended[element].at_us - times[f"STARTED{element}"]
        assert taken_us / 1e6 == pytest.approx(seconds, abs=1e-5)
    assert ended["/Plan/Runner[2]"].message == "the server is away"


@pytest.mark.parametrize("place", range(len(cuts(WHOLE))))
def test_a_run_that_goes_on_is_the_run_that_was_not_interrupted(place: int) -> None:
    """Only what has no outcome in the journal is asked for again."""
    past, again = WHOLE[: cuts(WHOLE)[place]], model()
    assert lines(simulate(PLAN, past, service(again))) == lines(WHOLE)
    over = {row.element for row in past if row.kind in ("SUCCEEDED", "FAILED")}
    prompts = {
        "/Plan/Control[1]/Runner[1]": "Who is there?",
        "/Plan/Control[1]/Runner[3]": "greet her",
        "/Plan/Runner[2]": "the end",
    }
    expected = {task for element, task in prompts.items() if element not in over}
    assert {request.task for request in again.requests} == expected


@given(st.integers(0, 10_000), st.floats(0, 9), st.booleans())
def test_another_answer_than_before_contradicts_nothing(
    place: int, latency_s: float, fails: bool
) -> None:
    """A live model answers otherwise, and sooner or later, when it is asked once more."""
    places = cuts(WHOLE)
    past = WHOLE[: places[place % len(places)]]
    other = ModelError("no") if fails else timed("Ben.", latency_s)
    changed = model(**{"Who is there?": other, "greet her": other, "the end": other})
    if fails:
        text = PLAN.replace("parallel_all", "parallel_any")
        past = ()
    else:
        text = PLAN
    rows = simulate(text, past, service(changed))
    assert lines(rows)[: len(past)] == lines(past)
    assert lines(simulate(text, rows, None)) == lines(rows)


def test_an_answer_that_comes_too_late_is_not_asked_for_again() -> None:
    text = plan(
        runner("PromptText", text="Who is there?", flush="true"),
        control("recovery", runner("Log", text="it took too long")),
    )
    whole = simulate(text, (), service(model()), timeout_s=2.0)
    assert "TIMEOUT" in [row.kind for row in whole]
    for place in cuts(whole):
        again = model()
        rows = simulate(text, whole[:place], service(again), timeout_s=2.0)
        assert lines(rows) == lines(whole)
        over = "TIMEOUT" in [row.kind for row in whole[:place]]
        assert len(again.requests) == (not over)


def test_a_run_that_has_ended_needs_no_model() -> None:
    assert lines(simulate(PLAN, WHOLE, None)) == lines(WHOLE)


def test_a_plan_that_was_written_in_vain_is_not_asked_for_again() -> None:
    text = plan(runner("PromptPlan", task="go on", flush="true"))
    failing = text.replace(
        "</Plan>", control("recovery", runner("Log", text="it failed")) + "</Plan>"
    )
    whole = simulate(failing, (), service(Scripted(["no"])))
    assert [row.kind for row in whole].count("LOG") == 7  # three times two, and that it failed
    for place in cuts(whole):
        again = Scripted(["no"])
        assert lines(simulate(failing, whole[:place], service(again))) == lines(whole)


# -- in a world -----------------------------------------------------------------------------------


def test_the_model_answers_and_not_the_world_file() -> None:
    world = field_of(
        answers=(Said("PromptSpeechRunner", (), "from the file"),),
        settings={"PromptSpeechRunner": Settings(fails=1.0, duration_s=(7.0, 7.0))},
    )
    text = plan(runner("PromptSpeech", task="greet", flush="true"))
    completed = run(text, world, answers=Answers(service(Scripted(["from the model"]))))
    assert completed.outputs[0] == {"text": "from the model"}
    assert completed.seconds == pytest.approx(7.0, abs=1e-3)  # nothing is known of its time


def test_an_interrupted_request_waits_to_be_stopped() -> None:
    def interrupted(asking):
        asking.close()
        raise AskingInterruptedError

    answers = Answers(service(Scripted(["late"])), wait=interrupted)
    text = plan(runner("PromptText", text="a", flush="true"))
    ran = run(
        text,
        field_of(),
        answers=answers,
        prepare=lambda driver: driver.at(5_000_000, driver.cancel, "interrupted"),
    )
    assert ran.status is Status.CANCELLED
    assert ran.outputs == {}


def test_a_generated_plan_is_queued_once() -> None:
    class Queue:
        plans: list[str] = []  # noqa: RUF012

        def submit(self, text, name=""):
            self.plans.append(text)
            return len(self.plans)

        def status(self, plan):
            return "QUEUED"

    text = plan(runner("FabricGeneratePlan", task="go on", flush="true"))
    ran = run(text, field_of(), answers=Answers(service(Scripted([GOOD]))), plans=Queue())
    assert (ran.status, Queue.plans) == (Status.COMPLETED, [GOOD])
    texts = [text for _, _, text in ran.driver.logs]
    assert texts == [
        "asked scripted:test: 0.0 s",
        "accepted the plan of attempt 1",
        "queued as plan 1",
    ]
