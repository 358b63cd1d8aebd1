"""From paths to plans."""

from __future__ import annotations

import inspect
import io
import os
import sys
import threading
from pathlib import Path

import pytest

from gpsfsm.checking import CheckOptions, check_input
from gpsfsm.checking.inputs import STDIN, Input, find_inputs, read_bytes
from gpsfsm.errors import InputError
from gpsfsm.model.report import Verdict
from gpsfsm.syntax import Limits

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")


@pytest.fixture(autouse=True)
def _there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def put(*names: str) -> None:
    for name in names:
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text("<Plan/>", encoding="utf-8")


def paths(*root: str) -> list[str]:
    inputs = list(find_inputs(root))
    assert not any(each.problem for each in inputs)
    return [each.path for each in inputs]


class TestFinding:
    def test_files_as_they_are_given(self) -> None:
        put("b.xml", "a.txt")
        assert paths("b.xml", "missing.xml", "a.txt") == ["b.xml", "missing.xml", "a.txt"]

    def test_folders_in_the_order_of_paths(self) -> None:
        put("d/b.xml", "d/a.xml", "d/c/z.xml", "d/x.txt", "d/y.xmlx", "d/.hidden.xml", "d/B.XML")
        assert paths("d") == ["d/.hidden.xml", "d/a.xml", "d/b.xml", "d/c/z.xml"]

    def test_each_once(self) -> None:
        put("a.xml", "d/b.xml")
        assert paths("a.xml", ".", "./a.xml", "d", "d/../a.xml") == ["a.xml", "d/b.xml"]
        assert paths("-", "-") == [STDIN]

    def test_a_file_may_be_called_like_standard_input(self) -> None:
        put(STDIN)
        assert list(find_inputs(["-", STDIN, "./-"])) == [
            Input(STDIN, stdin=True),
            Input(STDIN),
            Input("./-"),
        ]

    def test_an_empty_folder_is_told(self) -> None:
        put("d/a.txt")
        (entry,) = find_inputs(["d"])
        assert entry == Input("d", "is a folder without any *.xml file")

    def test_an_empty_path_is_not_the_current_folder(self) -> None:
        put("a.xml")
        assert list(find_inputs([""])) == [Input("")]

    def test_a_folder_may_be_called_like_a_plan(self) -> None:
        put("d.xml/a.xml")
        assert paths(".") == ["d.xml/a.xml"]

    def test_links(self) -> None:
        put("d/a.xml", "e/b.xml")
        Path("d/file.xml").symlink_to("../e/b.xml")
        Path("d/folder").symlink_to("../e")
        Path("d/loop").symlink_to(".")
        Path("d/folder.xml").symlink_to("../e")
        assert paths("d") == ["d/a.xml", "d/file.xml"]

    def test_a_link_to_nothing_or_itself_is_told(self) -> None:
        put("d/a.xml")
        Path("d/gone.xml").symlink_to("nothing")
        Path("d/self.xml").symlink_to("self.xml")
        actual = {each.path: each.problem for each in find_inputs(["d"])}
        assert list(actual) == ["d/a.xml", "d/gone.xml", "d/self.xml"]
        assert actual["d/gone.xml"].startswith("cannot be read: No such file")
        assert actual["d/self.xml"].startswith("cannot be read: ")

    @needs_pipes
    def test_a_pipe_in_a_folder_is_told(self) -> None:
        os.mkfifo("pipe.xml")
        assert list(find_inputs(["."])) == [Input("pipe.xml", "is not a regular file")]

    def test_a_folder_that_cannot_be_read_is_told(self, monkeypatch: pytest.MonkeyPatch) -> None:
        def refuse(path: str) -> object:
            if path.endswith("secret"):
                raise PermissionError(13, "Permission denied")
            return real(path)

        real = os.scandir
        put("d/a.xml", "d/secret/b.xml")
        monkeypatch.setattr(os, "scandir", refuse)
        assert list(find_inputs(["d"])) == [
            Input("d/a.xml", root="d"),
            Input("d/secret", "cannot be read: Permission denied"),
        ]

    def test_folders_nested_deeper_than_the_stack(self) -> None:
        name = "d/" * 150 + "a.xml"
        put(name)
        limit = sys.getrecursionlimit()
        sys.setrecursionlimit(len(inspect.stack(0)) + 50)
        try:
            inputs = list(find_inputs(["d"]))
        finally:
            sys.setrecursionlimit(limit)
        assert inputs == [Input(name, root="d")]


class TestReading:
    def options(self, **limits: int) -> CheckOptions:
        return CheckOptions(limits=Limits(**limits))

    def test_a_file(self) -> None:
        put("a.xml")
        assert read_bytes(Input("a.xml"), 100) == b"<Plan/>"
        assert check_input(Input("a.xml"), self.options()).verdict is Verdict.ACCEPTED

    @pytest.mark.parametrize("size", [0, 1, 10, 1 << 18, (1 << 18) + 1, 1 << 20])
    def test_at_most_one_byte_more_than_is_allowed(self, size: int) -> None:
        Path("a.xml").write_bytes(b"x" * (1 << 20))
        assert len(read_bytes(Input("a.xml"), size)) == min(size + 1, 1 << 20)

    def test_an_absurd_limit_costs_nothing(self) -> None:
        put("a.xml")
        assert read_bytes(Input("a.xml"), 10**30) == b"<Plan/>"

    def test_standard_input(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stream = io.TextIOWrapper(io.BytesIO(b"<Plan/>\xff"))
        monkeypatch.setattr(sys, "stdin", stream)
        assert read_bytes(Input(STDIN, stdin=True), 7) == b"<Plan/>\xff"
        stream.close()
        with pytest.raises(InputError, match="cannot be read: "):
            read_bytes(Input(STDIN, stdin=True), 7)
        monkeypatch.setattr(sys, "stdin", None)
        with pytest.raises(InputError, match="cannot be read: standard input is closed"):
            read_bytes(Input(STDIN, stdin=True), 7)

    @needs_pipes
    def test_a_pipe_that_was_named(self) -> None:
        os.mkfifo("pipe")
        writer = threading.Thread(target=lambda: Path("pipe").write_bytes(b"<Plan/>"))
        writer.start()
        assert read_bytes(Input("pipe"), 100) == b"<Plan/>"
        writer.join()

    @pytest.mark.parametrize(
        ("path", "problem"),
        [
            ("missing.xml", "cannot be read: No such file or directory"),
            (".", "is a folder"),
            ("", "cannot be read: the path is empty"),
            ("a\0b", "cannot be read: a NUL character is not allowed"),
            ("x" * 5000, "cannot be read: File name too long"),
            (os.devnull, "is not a regular file"),
        ],
    )
    def test_what_cannot_be_read(self, path: str, problem: str) -> None:
        with pytest.raises(InputError, match=f"^{problem}"):
            read_bytes(Input(path), 100)
        report = check_input(Input(path), self.options())
        assert report.verdict is Verdict.UNDECIDED
        assert [finding.rule for finding in report.findings] == ["GP901"]

    def test_a_problem_is_passed_on(self) -> None:
        report = check_input(Input("d", "is a folder of nothing"), self.options())
        assert report.findings[0].message == "is a folder of nothing"

    def test_a_text_that_is_too_long(self) -> None:
        put("a.xml")
        report = check_input(Input("a.xml"), self.options(max_bytes=3))
        assert report.verdict is Verdict.UNDECIDED
        assert [finding.rule for finding in report.findings] == ["GP103"]
