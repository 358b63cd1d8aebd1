"""Queries: the answer is found, and no piece of the prompt passes for it."""

from __future__ import annotations

import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.grading.rewards import answer_in

EXAMPLE = "<Plan>an example</Plan>"
PROMPT = f"<s>[INST] Fahre zur Tür, dann zu ½ B .\n\n{EXAMPLE}\nWrite a plan for this.\n[/INST]"
ANSWER = "<Plan> an answer </Plan>"


@pytest.mark.parametrize(
    "there",
    [
        PROMPT,
        "<|begin_of_text|>" + PROMPT,
        PROMPT.replace("<s>", "<s> "),
        " " + PROMPT,
        PROMPT.replace(" B .", " B."),
        PROMPT.replace("\n\n", "\n"),
        unicodedata.normalize("NFC", PROMPT),
        unicodedata.normalize("NFD", PROMPT),
        unicodedata.normalize("NFKC", PROMPT),
        PROMPT[9:],
        PROMPT[len(PROMPT) - 40 :],
        " " + unicodedata.normalize("NFD", PROMPT[14:]),
    ],
)
@pytest.mark.parametrize("end", ["", "</s>", "<|im_end|>\n<|endoftext|>", " <pad><pad>\n"])
def test_the_answer_is_found(there: str, end: str) -> None:
    answer = answer_in(f"{there}\n{ANSWER}{end}", PROMPT)
    assert answer is not None
    assert answer.strip() == ANSWER


@pytest.mark.parametrize(
    "query",
    [
        "",
        ANSWER,
        f"Another prompt: {EXAMPLE} {ANSWER}",
        f"{PROMPT[:60]}{ANSWER}",
        f"[/INST]{ANSWER}",
        f"\ufffd{PROMPT[10:]}{ANSWER}",
        PROMPT[:-1],
    ],
)
def test_a_prompt_that_is_not_there(query: str) -> None:
    assert answer_in(query, PROMPT) is None


def test_an_answer_may_repeat_the_prompt() -> None:
    assert answer_in(f"{PROMPT}{PROMPT}{ANSWER}", PROMPT) == PROMPT + ANSWER
    assert answer_in(f"{PROMPT[20:]}{PROMPT[20:]}", PROMPT) == PROMPT[20:]


def test_of_a_cut_prompt_no_piece_is_left() -> None:
    """Where the prompt repeats itself, the answer rather loses its front."""
    prompt = "Go to A and then to B, to C. " * 10
    for cut in range(len(prompt) - 60):
        answer = answer_in(prompt[cut:] + ANSWER, prompt)
        assert answer is not None
        assert answer.strip() == ANSWER


@given(st.text(), st.text())
def test_what_stands_behind_a_prompt(prompt: str, answer: str) -> None:
    """Whatever they are; of an empty prompt all is the answer."""
    extracted = answer_in(prompt + answer, prompt)
    assert extracted is not None
    assert answer.startswith(extracted.rstrip())
    assert answer_in(answer, "") == extracted
