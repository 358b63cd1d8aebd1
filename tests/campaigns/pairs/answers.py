"""Answers of language models, real ones where they are here, damaged further: check and fix.

Neither ever raises; fixing once more changes nothing; a fixed text is never worse than before, and
gets the same verdict as if it were checked by itself.
"""

from __future__ import annotations

import random
from functools import cache
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from benchmarks import answers as recorded
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.fixing import fix_text
from gpsfsm.model.report import Verdict
from tests.campaigns.base import Pair
from tests.fixing.support import DAMAGES, STEPS
from tests.oracle import to_xml
from tests.strategies import plans

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hypothesis.strategies import DrawFn

_VERDICTS = (Verdict.ACCEPTED, Verdict.REJECTED, Verdict.UNDECIDED)
_OPTIONS = CheckOptions(from_response=True)
_PIECES = (
    *("```xml\n", "```", "<", ">", "/>", "&", '"', "\n", "=", "</Plan>", "<Plan>", "<!--", "-->"),
    *(
        "</Control>",
        '<Control type="recovery">',
        "<think>",
        "Here is the plan:\n",
        "\x00",
        "\ufeff",
    ),
    *(
        "<root>",
        "<![CDATA[",
        "]]>",
        "\u201c",
        "\\",
        "<?xml version='1.0'?>",
        " type=",
        "é",
        "\udc80",
    ),
)


@cache
def _real() -> tuple[str, ...]:
    """The recorded answers; none where they are not here."""
    if not recorded.CORPUS.is_dir():
        return ()
    texts = {row["response"] for row in recorded.answers()}
    return tuple(sorted(text for text in texts if text.strip() and len(text) < 10_000))


@st.composite
def _answers(draw: DrawFn) -> str:
    real = _real()
    if real and draw(st.booleans()):
        text = draw(st.sampled_from(real))
    else:
        text = draw(st.one_of(st.just(STEPS), plans(max_runners=6).map(to_xml)))
    for name in draw(st.lists(st.sampled_from(sorted(DAMAGES)), max_size=2)):
        source = random.Random(draw(st.integers(0, 999)))  # noqa: S311  (chooses places)
        text = DAMAGES[name](text, source)
    for _ in range(draw(st.integers(0, 3))):
        start = draw(st.integers(0, len(text)))
        stop = min(len(text), start + draw(st.sampled_from([0, 0, 1, 1, 2, 7, 40, 400])))
        text = text[:start] + draw(st.sampled_from(("", *_PIECES))) + text[stop:]
    return text


def judge(text: str) -> Iterator[str]:
    """Checked and fixed, safely and unsafely."""
    before = check_text(text, "answer", _OPTIONS)
    for unsafe in (False, True):
        fixed = fix_text(text, _OPTIONS, unsafe=unsafe)
        after = fixed.report.verdict
        assert _VERDICTS.index(after) <= _VERDICTS.index(before.verdict), "the fix made it worse"
        # a byte order mark is no part of a text
        assert fixed.original == text.removeprefix("\ufeff"), "not the text that was given"
        assert fixed.applied or fixed.text == fixed.original, "changed without a fix"
        again = fix_text(fixed.text, _OPTIONS, unsafe=unsafe)
        assert (again.text, again.applied) == (fixed.text, ()), "fixing again changes something"
        alone = check_text(fixed.text, "answer", _OPTIONS)
        assert alone.verdict is after, "the verdict is not that of the fixed text"
        yield f"{'unsafe' if unsafe else 'safe'}: {before.verdict.value} to {after.value}"


PAIR = Pair(
    name="answers",
    about="damaged answers of models: check and fix never raise, a fix is final and never worse",
    cases=_answers,
    judge=judge,
    text=str,
    few=2,
)
