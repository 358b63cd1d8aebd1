from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import UsageError
from gpsfsm.generation.language_model import Answer, Finish, Message, ModelError, Request, Role
from gpsfsm.generation.loop import Attempt, Generated, LoopOptions, generate, plan_key
from tests.generation.scripted import Scripted, judge

PROMPT = (Message(Role.SYSTEM, "You plan."), Message(Role.USER, "Task: go"))


def run(model: Scripted, options: LoopOptions | None = None, **more: object) -> Generated:
    loop = generate(model, Request(PROMPT, "go"), judge, options, **more)  # type: ignore[arg-type]
    return asyncio.run(loop)


def test_the_first_good_plan_ends_the_search() -> None:
    model = Scripted(["good"])
    completed = run(model)
    assert completed.accepted
    assert completed.plan == "good"
    assert completed.reason == ""
    assert [request.messages for request in model.requests] == [PROMPT]


def test_the_model_is_told_what_is_wrong() -> None:
    model = Scripted(["bad 3", "bad 1", "good"])
    completed = run(model)
    assert completed.accepted
    assert [attempt.round for attempt in completed.attempts] == [1, 2, 3]
    system, user, answer, correction = model.requests[1].messages
    assert (system, user) == PROMPT
    assert answer == Message(Role.ASSISTANT, "bad 3")
    assert correction.role is Role.USER
    assert correction.text.startswith("3 wrong\n")
    # an old answer costs room and misleads
    assert [each.text for each in model.requests[2].messages[2:3]] == ["bad 1"]
    assert len(model.requests[2].messages) == 4


def test_a_failure_is_clear_and_has_the_best_candidate() -> None:
    completed = run(Scripted(["bad 3", "bad 1", "nothing"]))
    assert not completed.accepted
    assert completed.plan == "bad 1"
    assert completed.reason == "no plan was accepted in 3 attempts"


@pytest.mark.parametrize(
    ("first", "text"),
    [
        ("", "Your answer was empty."),
        (Answer("good", "m", Finish.LENGTH), "Your answer was cut off"),
    ],
)
def test_what_is_no_answer_is_asked_for_again(first: str | Answer, text: str) -> None:
    model = Scripted([first, "good"])
    completed = run(model)
    assert completed.accepted
    assert completed.attempts[0].accepted is False
    assert [message.role for message in model.requests[1].messages] == [Role.SYSTEM, Role.USER]
    assert model.requests[1].messages[-1].text.startswith(f"Task: go\n\n{text}")


def test_a_plan_that_was_seen_is_refused_whatever_its_white_space() -> None:
    seen = ((plan_key("good 1"), "it was an example"),)
    model = Scripted([" go od 1\n", "good"])
    completed = run(model, LoopOptions(seen=seen))
    assert completed.plan == "good"
    assert completed.attempts[0].problem == "it was an example"
    assert "it was an example" in model.requests[1].messages[-1].text


def test_a_model_that_repeats_itself_is_asked_with_more_temperature() -> None:
    model = Scripted(["bad 1"])
    completed = run(model, LoopOptions(rounds=5))
    assert [request.temperature for request in model.requests] == pytest.approx(
        [0, 0, 0.3, 0.6, 0.9]
    )
    assert completed.attempts[1].problem == "this plan was rejected in attempt 1"


def test_a_model_that_cannot_be_reached_ends_the_search() -> None:
    model = Scripted(["bad 1", ModelError("the server is gone")])
    completed = run(model)
    assert completed.reason == "the server is gone"
    assert completed.plan == "bad 1"
    assert len(model.requests) == 2


def test_of_several_candidates_the_best_is_kept() -> None:
    model = Scripted(["good 2", "bad 1", "good 1", "nothing"])
    completed = run(model, LoopOptions(candidates=4, seed=10))
    assert completed.plan == "good 1"
    assert [attempt.candidate for attempt in completed.attempts] == [1, 2, 3, 4]
    assert [request.seed for request in model.requests] == [10, 11, 12, 13]
    assert [request.temperature > 0 for request in model.requests] == [False, True, True, True]


def test_the_best_candidate_is_the_one_that_is_corrected() -> None:
    model = Scripted(["bad 5", "bad 2", "good", "good"])
    run(model, LoopOptions(candidates=2))
    assert model.requests[2].messages[2].text == "bad 2"


def test_candidates_are_in_order_whichever_answers_first() -> None:
    model = Scripted(["bad 1", "bad 2", "bad 3"], delays_s=[0.03, 0.02, 0.0])
    completed = run(model, LoopOptions(rounds=1, candidates=3))
    assert [attempt.judgement.plan for attempt in completed.attempts if attempt.judgement] == [
        "bad 1",
        "bad 2",
        "bad 3",
    ]


def test_one_candidate_that_fails_does_not_spoil_the_others() -> None:
    completed = run(Scripted([ModelError("busy"), "good"]), LoopOptions(candidates=2))
    assert completed.accepted
    assert completed.attempts[0].problem == "busy"


def test_the_time_is_bounded() -> None:
    model = Scripted(["bad 1"], delays_s=[60])
    completed = run(model, LoopOptions(total_s=0.05))
    assert completed.reason == "scripted:test did not answer in the time that was left"
    assert completed.plan == ""


@pytest.mark.parametrize(("latency_s", "left"), [(2.0, 0), (1.9, 1)])
def test_the_time_before_a_loop_died_counts(latency_s: float, left: int) -> None:
    past = run(Scripted([Answer("bad", "m", latency_s=latency_s)]), LoopOptions(rounds=1)).attempts
    model, options = Scripted(["good"]), LoopOptions(rounds=2, total_s=2.0)
    completed = run(model, options, past=past, clock=lambda: 0.0)
    assert len(model.requests) == left
    assert completed.reason == ("" if left else "the time of 2 s is over")


def test_what_has_come_when_a_search_is_stopped_is_kept() -> None:
    kept: list[Attempt] = []

    async def stopped() -> None:
        model = Scripted(["bad 1", "good"], delays_s=[0.0, 1000.0])
        options = LoopOptions(candidates=2)
        search = asyncio.ensure_future(
            generate(model, Request(PROMPT, "go"), judge, options, keep=kept.append)
        )
        async with asyncio.timeout(10):
            while len(model.requests) < 2:
                await asyncio.sleep(0)
            for _ in range(5):
                await asyncio.sleep(0)
        search.cancel()
        with pytest.raises(asyncio.CancelledError):
            await search

    asyncio.run(stopped())
    (attempt,) = kept
    assert (attempt.candidate, attempt.message) == (1, "Task: go")
    assert attempt.answer is not None
    assert attempt.answer.text == "bad 1"
    assert attempt.problem == "the search was stopped before this answer was judged"


@pytest.mark.parametrize(
    ("answer", "latency_s"),
    [
        (Answer("bad", "m", latency_s=0.5, requests=4), 7.0),  # three were refused before
        (Answer("bad", "m", latency_s=7.5, requests=4), 7.5),
        (Answer("bad", "m", latency_s=0.5), 0.5),
        (ModelError("nothing in it", empty=True), 7.0),
    ],
)
def test_the_time_of_an_answer_is_that_of_all_its_requests(
    answer: Answer | ModelError, latency_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    times_s = iter([1.25, 9.0])
    monkeypatch.setattr("gpsfsm.generation.loop._now_s", lambda: next(times_s, 9.0))
    (attempt,) = run(Scripted([answer]), LoopOptions(rounds=1)).attempts
    assert attempt.answer is not None
    assert attempt.answer.latency_s == latency_s


def test_time_that_is_over_asks_no_more() -> None:
    times = iter([0.0, 1.0, 11.0])
    model = Scripted(["bad 1"])
    completed = run(model, LoopOptions(total_s=10), clock=lambda: next(times))
    assert completed.reason == "the time of 10 s is over"
    assert len(model.requests) == 1


@pytest.mark.parametrize(
    "options", [LoopOptions(rounds=0), LoopOptions(rounds=101), LoopOptions(candidates=17)]
)
def test_options_that_make_no_sense(options: LoopOptions) -> None:
    with pytest.raises(UsageError, match="must be from 1 to"):
        run(Scripted(["good"]), options)


def test_what_cannot_be_kept_ends_the_loop() -> None:
    def full(_: Attempt) -> None:
        raise OSError("the disk is full")

    with pytest.raises(OSError, match="the disk is full"):
        run(Scripted(["bad 1", "good"]), keep=full)


ANSWERS = st.sampled_from(["good", "good 1", "bad 1", "bad 2", "", "prose"])


@given(st.lists(ANSWERS, min_size=1, max_size=8), st.integers(1, 2), st.data())
def test_a_loop_that_died_goes_on_as_if_it_had_not(
    answers: list[str], candidates: int, data: st.DataObject
) -> None:
    options = LoopOptions(rounds=4, candidates=candidates)
    kept: list[Attempt] = []
    model = Scripted(answers)
    whole = run(model, options, keep=kept.append)
    assert tuple(kept) == whole.attempts
    cut = data.draw(st.integers(0, len(kept)))
    rest = Scripted(answers[min(cut, len(answers) - 1) :])
    again: list[Attempt] = []
    resumed = run(rest, options, keep=again.append, past=kept[:cut])
    assert [_summary(each) for each in resumed.attempts] == [
        _summary(each) for each in whole.attempts
    ]
    assert resumed.plan == whole.plan
    assert len(again) == len(kept) - cut  # nothing is asked twice


def _summary(attempt: Attempt) -> tuple[object, ...]:
    return replace(attempt, answer=None), attempt.answer and attempt.answer.text
