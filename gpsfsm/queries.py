"""Queries: a prompt and what a model answered, in one text, as some trainers hand them over.

They are put together from tokens, so the prompt in a query may differ from the prompt. Tokenizers
change spaces and Unicode forms, trainers cut off the front of what is too long. What must not
happen is that a piece of the prompt passes for the answer: it may hold an example.
"""

from __future__ import annotations

import re
import unicodedata
from itertools import accumulate

__all__ = ["answer_in"]

_SPECIAL = re.compile(
    r"(?:<[|\uff5c][^<>|\uff5c]{1,40}[|\uff5c]>|</s>|<eos>|<pad>|<end_of_turn>)\Z"
)
"""What tokenizers put behind an answer."""
_LONGEST_SPECIAL = 44
_LEAST_TAIL = 32
"""What is shorter could stand at the front of a query by chance."""


def answer_in(query: str, prompt: str) -> str | None:
    """What follows the prompt, without the tokens that end an answer; None: it is not there."""
    begin = query.find(prompt)
    end = begin + len(prompt) if begin >= 0 else _end_of_letters(query, prompt)
    if end is None:
        return None
    answer = query[end:].rstrip()
    while special := _SPECIAL.search(answer, max(0, len(answer) - _LONGEST_SPECIAL)):
        answer = answer[: special.start()].rstrip()
    return answer


def _end_of_letters(query: str, prompt: str) -> int | None:
    """Where the prompt ends in the query if only its letters are compared, or its last letters."""
    letters = _letters(query)
    there, wanted = "".join(letters), "".join(_letters(prompt))
    begin = there.find(wanted)
    end = begin + len(wanted) if begin >= 0 else _tail(wanted, there)
    if end is None:
        return None
    lengths = accumulate(map(len, letters), initial=0)
    return next(place for place, length in enumerate(lengths) if length >= end)


def _letters(text: str) -> list[str]:
    """For each character what is left of it without spaces and ligatures, accents by themselves."""
    return ["".join(unicodedata.normalize("NFKD", char).split()) for char in text]


def _tail(wanted: str, there: str) -> int | None:
    """How much of the end of ``wanted`` is the front of ``there``: the most that is possible.

    Less would leave a piece of the prompt in front of the answer.
    """
    last = re.compile(f"(?={re.escape(wanted[-_LEAST_TAIL:])})")
    ends = (found.start() + _LEAST_TAIL for found in last.finditer(there[: len(wanted)]))
    return max((end for end in ends if wanted.endswith(there[:end])), default=None)
