"""Recorded answers of a language model: what fixes make of them."""

from __future__ import annotations

import pytest

from benchmarks import answers as recorded
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.fixing import fix_text
from gpsfsm.model.report import Verdict

OPTIONS = CheckOptions(from_response=True)

pytestmark = pytest.mark.skipif(
    not recorded.CORPUS.is_dir(), reason="the recorded answers are not here"
)


def test_fixes_make_plans_right_and_none_wrong() -> None:
    """As people judged plans of the same automaton."""
    right = recorded.successes()
    counts = {"once": 0, "safe": 0, "unsafe": 0, "right once": 0, "right unsafe": 0}
    for row in recorded.answers():
        if row["model"] != "gpt":
            continue
        text, wanted = row["response"], right[str(row["task"])]
        once = check_text(text, "a", OPTIONS).verdict is Verdict.ACCEPT
        safe = fix_text(text, OPTIONS)
        unsafe = fix_text(text, OPTIONS, unsafe=True)
        was_right = once and recorded.meaning(text) in wanted
        is_right = recorded.meaning(unsafe.text) in wanted
        assert is_right or not was_right, row["id"]
        counts["once"] += once
        counts["safe"] += safe.report.verdict is Verdict.ACCEPT
        counts["unsafe"] += unsafe.report.verdict is Verdict.ACCEPT
        counts["right once"] += was_right
        counts["right unsafe"] += is_right
    assert counts == {"once": 93, "safe": 93, "unsafe": 100, "right once": 80, "right unsafe": 97}
