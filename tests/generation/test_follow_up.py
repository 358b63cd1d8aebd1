from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.generation.language_model import Answer, Finish, Message, Role, conversation_tokens
from gpsfsm.generation.loop import Attempt, Judgement, follow_up

PROMPT = (Message(Role.SYSTEM, "You plan."), Message(Role.USER, "Task: go"))
WORDS = " and many words" * 20
MESSAGE = (
    f"Your plan was rejected: 2 errors.\n\n1. Error: the worst{WORDS}\n\n2. Error: the other{WORDS}"
)
PLAN = f"<Plan>bad{WORDS * 2}</Plan>"


def rejected(problem: str = "") -> Attempt:
    judged = Judgement(False, PLAN, MESSAGE, errors=2)
    return Attempt(1, 1, "go", Answer(PLAN, "m"), judged, problem)


def tokens(messages: tuple[Message, ...]) -> int:
    return conversation_tokens(each.text for each in messages)


def test_with_room_everything_is_told() -> None:
    message = follow_up(PROMPT, rejected())
    assert message.note == ""
    assert message.messages[:3] == (*PROMPT, Message(Role.ASSISTANT, PLAN))
    assert message.messages[3].text.startswith(MESSAGE)


def test_first_the_lesser_findings_go_then_the_answer_then_all() -> None:
    attempt = rejected()
    notes = {}
    for room in range(tokens(follow_up(PROMPT, attempt).messages), 0, -1):
        message = follow_up(PROMPT, attempt, room)
        notes.setdefault(message.note, message.messages)
    some = "asked without some of what was wrong"
    assert list(notes) == [
        "",
        f"{some}, for want of room",
        "asked without its earlier answer, for want of room",
        f"asked without its earlier answer and {some}, for want of room",
        "asked as if for the first time, for want of room",
    ]
    shorter = notes[f"{some}, for want of room"][-1].text
    assert "the worst" in shorter
    assert "the other" not in shorter
    assert "There is more, which is left out here." in shorter
    assert notes["asked as if for the first time, for want of room"] == PROMPT


@given(
    st.sampled_from(["", "<Plan/>", "prose " * 50]),
    st.lists(st.sampled_from(["one", "two words", "three " * 30]), max_size=5).map("\n\n".join),
    st.sampled_from(["", "this is an example"]),
    st.sampled_from(Finish),
    st.integers(0, 400),
)
def test_it_fits_and_speakers_take_turns(
    answer: str, message: str, problem: str, finish: Finish, room: int
) -> None:
    judged = Judgement(False, "<Plan/>", message, errors=1)
    attempt = Attempt(1, 1, "go", Answer(answer, "m", finish), judged, problem)
    prompt = follow_up(PROMPT, attempt, room)
    assert tokens(prompt.messages) <= room or prompt.messages == PROMPT
    roles = [each.role for each in prompt.messages]
    assert roles in (
        [Role.SYSTEM, Role.USER],
        [Role.SYSTEM, Role.USER, Role.ASSISTANT, Role.USER],
    )
    assert prompt.messages[1].text.startswith("Task: go")
    if finish is Finish.LENGTH and answer:
        assert len(prompt.messages) == 2  # what was cut off is long, and to be written anew


def test_a_plan_that_comes_again_is_refused_with_what_is_wrong_about_it() -> None:
    message = follow_up(PROMPT, rejected(problem="this plan was rejected in attempt 1"))
    text = message.messages[-1].text
    assert text.startswith("Your plan was refused: this plan was rejected in attempt 1.")
    assert "the worst" in text


def test_after_repairs_the_plan_is_shown_as_it_is_now() -> None:
    judged = Judgement(False, "<Plan>mended</Plan>", MESSAGE, errors=1, repairs=("GP101: a",))
    message = follow_up(PROMPT, Attempt(1, 1, "go", Answer("Hi <Plan>mended<", "m"), judged))
    assert message.messages[2].text == "<Plan>mended</Plan>"
