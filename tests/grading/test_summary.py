"""Groups in numbers: what is put together is what was counted one by one."""

from __future__ import annotations

from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.grading.grader import Grade
from gpsfsm.grading.tables import (
    GRADES,
    Entry,
    Group,
    aligned,
    as_csv,
    long_rows,
    markdown,
    over,
    short_rows,
    summarize,
)

ENTRIES = st.builds(
    Entry,
    st.sampled_from(list(Grade)),
    st.sampled_from([*GRADES, None]),
    st.none() | st.floats(0, 1000),
)


@given(st.lists(st.lists(ENTRIES, max_size=6), max_size=5))
def test_groups_together_count_like_all_answers(groups: list[list[Entry]]) -> None:
    spans = over([summarize(group) for group in groups])
    direct = summarize(entry for group in groups for entry in group)
    assert (spans.grades, spans.people) == (direct.grades, direct.people)
    assert spans.confusion == direct.confusion
    assert spans.answers == sum(map(len, groups))
    assert direct.pooled is None
    if direct.times is None:
        assert spans.times is None
    else:
        assert spans.times is not None
        assert spans.times.mean == pytest.approx(direct.times.mean)
        assert spans.times.deviation == pytest.approx(direct.times.deviation, abs=1e-4)


def test_tables_by_hand() -> None:
    first = summarize([Entry(Grade.SUCCESS, Grade.SUCCESS, 1.0), Entry(Grade.PARTIAL, None, 3.0)])
    second = summarize([Entry(Grade.UNDECIDED, Grade.FAILED)])
    groups = [Group(("a|b",), first), Group(("c",), second), Group(("all",), over([first, second]))]
    short = short_rows(("model",), groups, labelled=True)
    assert short[0] == [
        *("model", "answers", "S/P/F", "people S/P/F", "equal"),
        *("mean, s", "deviation, s", "pooled, s"),
    ]
    assert short[1] == ["a|b", "2", "1/1/0", "1/0/0", "1 of 1", "2.00", "1.41", ""]
    assert short[2] == ["c", "1", "0/0/0 (1 undecided)", "0/0/1", "0 of 1", "", "", ""]
    assert short[3][-3:] == ["2.00", "1.41", "1.41"]
    assert markdown(short)[1:3] == [
        "| " + " | ".join(["---"] * 8) + " |",
        "| a\\|b | 2 | 1/1/0 | 1/0/0 | 1 of 1 | 2.00 | 1.41 |  |",
    ]
    assert [line[:14] for line in aligned(short)] == [
        "model  answers",
        "a|b    2      ",
        "c      1      ",
        "all    3      ",
    ]
    long = long_rows(("model",), groups, labelled=False)
    assert as_csv(long[:3]) == (
        "model,answers,success,partial,failed,undecided,timed,mean_s,deviation_s,pooled_s\n"
        "a|b,2,1,1,0,0,2,2,1.41421,\n"
        "c,1,0,0,0,1,0,,,\n"
    )


def test_without_times_and_labels_their_columns_are_left_out() -> None:
    groups = [Group(("x\x1b[31m",), summarize([Entry(Grade.FAILED)]))]
    rows = short_rows(("folder",), groups, labelled=False)
    assert rows == [["folder", "answers", "S/P/F"], ["x\\x1b[31m", "1", "0/0/1"]]
    assert Counter(map(len, long_rows(("folder",), groups, labelled=True))) == {15: 2}
