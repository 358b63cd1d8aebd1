"""``gpsfsm fix`` on JSON lines: the plan in an answer is repaired, and no other byte changes."""

from __future__ import annotations

import codecs
import json
import os
import stat
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.checking import inputs as module
from gpsfsm.checking.inputs import Input, find_inputs, with_answer
from gpsfsm.cli import main
from gpsfsm.errors import InputError
from tests.cli.support import ACCEPTED, REJECTED, run

DAMAGED = ACCEPTED.replace('"2"', "2")
PROSE = f"Sure:\n```xml\n{DAMAGED}```\n"
RESPONSES = Path(__file__).parents[3] / "shared" / "corpus" / "experiment1" / "responses.jsonl"

values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=9),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner, max_size=3)
    ),
    max_leaves=6,
)


def lines(folder: Path, *records: object, name: str = "answers.jsonl") -> Path:
    path = folder / name
    texts = (each if isinstance(each, str) else json.dumps(each) for each in records)
    path.write_bytes("".join(f"{each}\n" for each in texts).encode())
    return path


def test_the_field_holds_the_repaired_plan(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    good = '{"n": 1.50, "plan": ' + json.dumps(ACCEPTED) + "}"
    file = lines(tmp_path, {"id": 1, "response": PROSE, "z": [1e3]}, good, {"plan": DAMAGED})
    before = file.read_bytes()
    assert main(["fix", file.name]) == 0
    out, err = capsys.readouterr()
    first, second, third = out.splitlines()
    assert list(json.loads(first).items()) == [("id", 1), ("response", ACCEPTED), ("z", [1000.0])]
    assert first.endswith(', "z": [1000.0]}')
    assert second == good
    assert json.loads(third) == {"plan": ACCEPTED}
    message = err.splitlines()
    assert message[0] == "answers.jsonl:1:3: GP115 plan extracted from the text around it"
    assert "answers.jsonl:3:2: GP101 syntax of <Runner> corrected" in message
    assert file.read_bytes() == before


def test_another_file_or_the_same_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = lines(tmp_path, {"plan": DAMAGED})
    target = tmp_path / "out.jsonl"
    assert main(["fix", str(file), "-q", "-o", str(target)]) == 0
    assert json.loads(target.read_bytes()) == {"plan": ACCEPTED}
    assert json.loads(file.read_bytes()) == {"plan": DAMAGED}
    assert main(["fix", str(file), "-q", "-o", str(file)]) == 0
    assert file.read_bytes() == target.read_bytes()
    assert capsys.readouterr() == ("", "")


def test_check_repairs_in_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = lines(tmp_path, {"plan": DAMAGED}, {"plan": REJECTED})
    second = lines(tmp_path, {"plan": ACCEPTED}, name="b.ndjson")
    first.chmod(0o640)
    before = second.stat()
    assert main(["check", str(first), str(second), "--fix", "--quiet"]) == 1
    assert f"{first}:2:2:3: error GP307" in capsys.readouterr().out
    assert (
        first.read_bytes()
        == lines(
            tmp_path, {"plan": ACCEPTED}, {"plan": REJECTED}, name="expected.jsonl"
        ).read_bytes()
    )
    assert stat.S_IMODE(first.stat().st_mode) == 0o640
    after = second.stat()
    assert (after.st_mtime_ns, after.st_ino) == (before.st_mtime_ns, before.st_ino)
    assert main(["check", str(first), "--fix", "--unsafe-fixes", "--quiet"]) == 0
    assert json.loads(first.read_bytes().splitlines()[1]) == {"plan": ACCEPTED}


def test_what_cannot_be_written_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = lines(tmp_path, {"plan": DAMAGED})
    before = file.read_bytes()
    file.chmod(0o444)
    assert main(["check", str(file), "--fix"]) == 2
    assert "the file is read-only" in capsys.readouterr().err
    assert main(["fix", str(file), "-o", str(file)]) == 2
    assert "the file is read-only" in capsys.readouterr().err
    assert main(["fix", str(file), "-o", str(tmp_path / "none" / "a.jsonl")]) == 2
    assert "its folder does not exist" in capsys.readouterr().err
    assert file.read_bytes() == before


def test_differences_have_the_names_of_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    file = lines(tmp_path, {"plan": ACCEPTED}, {"plan": DAMAGED})
    before = file.read_bytes()
    assert main(["fix", "answers.jsonl", "--diff"]) == 1
    out = capsys.readouterr().out
    assert out.startswith("--- answers.jsonl:2\n+++ answers.jsonl:2\n@@ -1,3 +1,3 @@\n")
    assert main(["check", "answers.jsonl", "--diff", "--quiet"]) == 1
    assert capsys.readouterr().out.startswith(out)
    assert file.read_bytes() == before


def test_lines_that_cannot_be_read_pass_unchanged(tmp_path: Path) -> None:
    bad = [b"", b"{", b'{"plan": "\xff"}', b'{"a": 1}', b'{"plan": "a", "plan": "b"}', b"[" * 9999]
    damaged = json.dumps({"plan": DAMAGED}).encode()
    content = codecs.BOM_UTF8 + b"\r\n".join([damaged, *bad, damaged])
    file = tmp_path / "a.jsonl"
    file.write_bytes(content)
    done = run("fix", str(file))
    assert done.returncode == 2
    assert done.stdout == content.replace(damaged, json.dumps({"plan": ACCEPTED}).encode())
    assert done.stderr.count(b"error GP901 unreadable") == len(bad)


def test_what_is_no_file_of_answers(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty = lines(tmp_path, name="empty.jsonl")
    target = tmp_path / "out.jsonl"
    for name in (empty, tmp_path / "none.jsonl"):
        assert main(["fix", str(name), "-o", str(target)]) == 2
        assert capsys.readouterr().out == ""
        assert not target.exists()


def test_a_pipe_of_answers_cannot_be_repaired_in_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pipe = tmp_path / "pipe.jsonl"
    os.mkfifo(pipe)
    for command, code in ((["check", "--fix"], 2), (["fix", "-q"], 0)):
        writer = Thread(target=pipe.write_bytes, args=(json.dumps({"plan": DAMAGED}).encode(),))
        writer.start()
        assert main([*command, str(pipe)]) == code
        writer.join()
    out, err = capsys.readouterr()
    assert "pipe.jsonl: is not a regular file: it cannot be changed" in err
    assert out == json.dumps({"plan": ACCEPTED})


def test_more_lines_than_are_read_pass_unchanged(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "MOST_LINES", 1)
    file = lines(tmp_path, *[{"plan": DAMAGED}] * 3)
    assert main(["fix", str(file)]) == 2
    first, *rest = capsys.readouterr().out.splitlines()
    assert json.loads(first) == {"plan": ACCEPTED}
    assert rest == file.read_text().splitlines()[1:]


def test_answers_go_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = lines(tmp_path, {"plan": DAMAGED})
    other = lines(tmp_path, {"plan": DAMAGED}, name="b.jsonl")
    (tmp_path / "a.xml").write_text(DAMAGED)
    assert main(["fix", str(file), str(other)]) == 2
    assert "holds answers, which are fixed to standard output, so it must be the only" in (
        capsys.readouterr().err
    )
    assert main(["fix", str(file), str(tmp_path / "a.xml"), "--from-response"]) == 2
    assert main(["fix", str(file), str(tmp_path / "a.xml"), "--diff"]) == 2
    assert main(["fix", str(file), str(other), "-o", str(tmp_path / "o.jsonl")]) == 2
    assert main(["fix", str(file), str(other), "--diff"]) == 1
    assert (tmp_path / "a.xml").read_text() == DAMAGED


def test_standard_input_has_a_field(tmp_path: Path) -> None:
    line = json.dumps({"plan": "no", "a": {"b": DAMAGED}}).encode()
    done = run("fix", "-", "-q", "--field", "a.b", stdin=line)
    assert (done.returncode, done.stderr) == (0, b"")
    assert json.loads(done.stdout) == {"plan": "no", "a": {"b": ACCEPTED}}
    done = run("check", "-", "--fix", "--field", "a.b", stdin=line)
    assert done.returncode == 2
    assert b"--fix changes files" in done.stderr


@given(
    before=st.dictionaries(st.text(max_size=4), values, max_size=4),
    steps=st.lists(
        st.text(max_size=3).filter(lambda name: "." not in name), min_size=1, max_size=3
    ),
    after=st.dictionaries(st.text(max_size=4), values, max_size=4),
    texts=st.tuples(st.text(max_size=30), st.text(max_size=30)),
    layout=st.tuples(st.booleans(), st.sampled_from([None, 0, "\t"])),
)
def test_only_the_answer_changes(
    before: dict[str, Any],
    steps: list[str],
    after: dict[str, Any],
    texts: tuple[str, str],
    layout: tuple[bool, str | int | None],
) -> None:
    (old, new), (escaped, indent) = texts, layout
    inner: object = old
    for step in reversed(steps):
        inner = {**before, step: inner, **{key: after[key] for key in after if key != step}}
    record: Any = inner
    field = ".".join(steps)
    if field in record and len(steps) > 1:
        return  # a field of this very name comes first
    text = json.dumps(record, ensure_ascii=escaped, indent=indent).replace("\n", " ") + "\r\n"
    line = text.encode()
    changed = with_answer(Input("a.jsonl:1", line=line, field=field), new)
    shown = [json.dumps(new, ensure_ascii=each) for each in (True, False)]
    place = json.dumps(old, ensure_ascii=escaped)
    assert any(
        changed == (text[:at] + each + text[at + len(place) :]).encode()
        for at in range(len(text))
        if text.startswith(place, at)
        for each in shown
    )
    expected = record
    for step in steps[:-1]:
        expected = expected[step]
    expected[steps[-1]] = new
    assert json.loads(changed) == record
    assert list(json.loads(changed)) == list(record)
    assert changed.isascii() or not line.isascii()


def test_an_answer_of_half_a_character_stays_json() -> None:
    line = '{"plan": "é"}'.encode()
    changed = with_answer(Input("a", line=line), "é\ud800")
    assert json.loads(changed) == {"plan": "é\ud800"}


def test_a_line_that_is_nested_too_deep_is_not_edited() -> None:
    line = b'{"plan": "a", "b": ' + b"[" * 100_000
    with pytest.raises(InputError, match="nested too deep"):
        with_answer(Input("a", line=line), "b")


@pytest.mark.skipif(not RESPONSES.is_file(), reason="the shared answers are not here")
def test_real_answers(tmp_path: Path) -> None:
    """The other keys are untouched byte for byte; a second repair changes nothing."""
    file = tmp_path / "answers.jsonl"
    real = RESPONSES.read_bytes().splitlines(keepends=True)[5::40]
    file.write_bytes(b"".join(real))
    done = run("fix", str(file), "-o", str(file))
    assert b"cannot" not in done.stderr
    assert file.read_bytes() != b"".join(real)
    for old, item in zip(real, find_inputs([str(file)]), strict=True):
        record, was = json.loads(item.line), json.loads(old)
        assert list(record) == list(was)
        assert with_answer(item, was["response"]) == old
    fixed = file.read_bytes()
    assert b"nothing to fix" in run("fix", str(file), "-o", str(file)).stderr
    assert file.read_bytes() == fixed
