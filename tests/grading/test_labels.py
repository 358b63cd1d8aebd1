"""Labels files: what is read, and what is said about mistakes."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.errors import InputError
from gpsfsm.grading.grader import Grade
from gpsfsm.grading.labels import load_labels


def write(path: Path, content: str | bytes) -> str:
    file = path / "labels.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return str(file)


def test_grades_times_and_other_columns(tmp_path: Path) -> None:
    text = "path,model,label,seconds\na.xml,m 1,s,2.5\nb/c.xml,m 2,Partial,\nd.xml,,?,0\n"
    labels = load_labels(write(tmp_path, "\ufeff" + text))
    assert labels.columns == ("path", "model", "label", "seconds")
    actual = [labels.of(str(tmp_path / name)) for name in ("a.xml", "b/../b/c.xml", "d.xml")]
    assert [(one.human, one.seconds, one.line) for one in actual if one] == [
        (Grade.SUCCESS, 2.5, 2),
        (Grade.PARTIAL, None, 3),
        (None, 0.0, 4),
    ]
    assert actual[0] is not None
    assert actual[0].cells["model"] == "m 1"
    assert labels.of(str(tmp_path / "other.xml")) is None


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", ":1: the first line must name the columns 'path' and one of human, label, grade"),
        ("path,model\n", ":1: the first line must name the columns 'path' and"),
        ("path,human\na,S\nb,good\n", ":3: 'good' is not a grade; write S, P or F"),
        ("path,human\na,S\n./a,S\n", ":3: the path './a' is already in line 2"),
        ("path,human,seconds\na,S,fast\n", ":2: 'fast' is not a time; write seconds, such as 2.5"),
        ("path,human,latency_s\na,S,nan\n", ":2: 'nan' is not a time"),
        ("path,human,seconds\na,S,-1\n", ":2: '-1' is not a time"),
        ("path,human,seconds\na,S,1e300\n", ":2: '1e300' is not a time"),
        ('path,human\n"a,S\n', ": this is not CSV: "),
        (b"path,human\n\xff,S\n", ": this is not UTF-8 text"),
    ],
)
def test_mistakes_are_told_with_their_line(
    tmp_path: Path, content: str | bytes, message: str
) -> None:
    file = write(tmp_path, content)
    with pytest.raises(InputError) as caught:
        load_labels(file)
    assert str(caught.value).startswith(file)
    assert message in str(caught.value)


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: cannot be read"):
        load_labels(str(tmp_path / "none.csv"))


@given(content=st.binary(max_size=200) | st.text("path,human\nSPF\x00\r\"'", max_size=60))
def test_no_file_breaks_it(tmp_path_factory: pytest.TempPathFactory, content: bytes | str) -> None:
    head = b"path,human\n"
    raw = content if isinstance(content, bytes) else content.encode()
    for text in (raw, head + raw):
        file = write(tmp_path_factory.getbasetemp(), text)
        with suppress(InputError):
            assert "path" in load_labels(file).columns
