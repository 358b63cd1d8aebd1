"""Where output goes: files, pipes, terminals, colours, the progress bar."""

from __future__ import annotations

import io
import json
import os
import stat
import sys
import threading
import time
from pathlib import Path

import pytest

import gpsfsm.progress
from gpsfsm.cli import main
from gpsfsm.progress import MANY, progress_bar
from gpsfsm.streams import wants_color
from tests.cli.support import ACCEPTED, REJECTED, TIMEOUT_S, environment, run, shell, start, write
from tests.forked import Forked

ESCAPE = b"\x1b["


class TestOutputFile:
    def test_holds_what_would_be_printed(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=REJECTED)
        assert main(["check", "a.xml", "--format", "json"]) == 1
        printed = capsys.readouterr().out
        assert main(["check", "a.xml", "--format", "json", "--output-file", "r.json"]) == 1
        assert capsys.readouterr() == ("", "")
        assert (tmp_path / "r.json").read_text(encoding="utf-8") == printed

    def test_is_replaced_and_keeps_its_rights(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        file = tmp_path / "r.txt"
        file.write_text("old", encoding="utf-8")
        file.chmod(0o640)
        assert main(["check", "a.xml", "--output-file", "r.txt"]) == 0
        assert stat.S_IMODE(file.stat().st_mode) == 0o640
        assert file.read_text(encoding="utf-8").startswith("a.xml:2:3: info GP302")
        assert sorted(each.name for each in tmp_path.iterdir()) == ["a.xml", "r.txt"]

    def test_new_files_follow_the_umask(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        before = os.umask(0o027)
        try:
            main(["check", "a.xml", "--output-file", "r.txt"])
        finally:
            os.umask(before)
        assert stat.S_IMODE((tmp_path / "r.txt").stat().st_mode) == 0o640

    def test_files_with_prompts_and_outputs_are_for_their_owner_alone(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        for words in (
            ("gate", "a.xml", "--format", "json", "-o", "receipt.json", "--report", "junit=r.xml"),
            ("prompt", "go", "-o", "prompt.txt"),
            ("run", "a.xml", "--journal", "j.db"),
            ("events", "j.db", "-o", "events.txt"),
        ):
            assert main([*words]) in (0, 1)
        kept = {each.name: stat.S_IMODE(each.stat().st_mode) for each in tmp_path.iterdir()}
        del kept["a.xml"]
        assert {"receipt.json", "r.xml", "prompt.txt", "j.db", "events.txt"} <= kept.keys()
        assert set(kept.values()) == {0o600}, kept

    def test_a_link_stays_a_link(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        (tmp_path / "link").symlink_to("real.txt")
        main(["check", "a.xml", "--output-file", "link"])
        assert (tmp_path / "link").is_symlink()
        assert (tmp_path / "real.txt").stat().st_size > 0

    def test_a_device(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        assert main(["check", "a.xml", "--output-file", os.devnull]) == 0
        assert not Path(os.devnull).is_file()

    @pytest.mark.parametrize(
        ("name", "reason"),
        [
            ("folder", "it is a folder"),
            ("missing/r.txt", "its folder does not exist"),
            ("a.xml/r.txt", "its folder does not exist"),
            ("x" * 300, "File name too long"),
        ],
    )
    def test_that_cannot_be_written(
        self, name: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=REJECTED)
        (tmp_path / "folder").mkdir()
        for command in ("check", "show"):
            assert main([command, "a.xml", "--output-file", name]) == 2
            captured = capsys.readouterr()
            assert captured.out == ""
            assert captured.err.startswith("gpsfsm: cannot write ")
            assert reason in captured.err

    def test_a_disk_that_fails_leaves_the_old_file(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def fail(_: int) -> None:
            raise OSError(28, "No space left on device")

        write(tmp_path, a=ACCEPTED)
        (tmp_path / "r.txt").write_text("old", encoding="utf-8")
        monkeypatch.setattr(os, "fsync", fail)
        assert main(["check", "a.xml", "--output-file", "r.txt"]) == 2
        assert capsys.readouterr().err == "gpsfsm: cannot write r.txt: No space left on device\n"
        assert (tmp_path / "r.txt").read_text(encoding="utf-8") == "old"
        assert sorted(each.name for each in tmp_path.iterdir()) == ["a.xml", "r.txt"]

    def test_a_plan_is_never_overwritten(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        write(tmp_path, a=ACCEPTED)
        (tmp_path / "link").symlink_to("a.xml")
        for name in ("a.xml", "./a.xml", "link"):
            assert main(["check", ".", "--output-file", name]) == 2
            assert "would overwrite a plan" in capsys.readouterr().err
            assert main(["show", "a.xml", "--output-file", name]) == 2
            assert "would overwrite a plan" in capsys.readouterr().err
        assert (tmp_path / "a.xml").read_text(encoding="utf-8") == ACCEPTED


class TestStandardOutput:
    def test_a_reader_that_stops_reading(self, tmp_path: Path) -> None:
        write(tmp_path, a=REJECTED)
        for arguments, code in ((["check", "a.xml"], 1), (["rule"], 0), (["--help"], 0)):
            process = start(*arguments, cwd=tmp_path)
            assert process.stdout is not None
            assert process.stderr is not None
            process.stdout.close()
            with process.stderr:
                assert process.stderr.read() == b""
            assert process.wait(TIMEOUT_S) == code

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
    @pytest.mark.parametrize("arguments", ["check a.xml", "show a.xml", "rule", "--help"])
    def test_a_full_disk(self, arguments: str, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        done = shell(f"$GPSFSM {arguments} > /dev/full", tmp_path)
        assert done.returncode == 2
        assert done.stderr.startswith(b"gpsfsm: ")
        assert b"No space left on device" in done.stderr
        assert done.stderr.count(b"\n") == 1

    def test_closed(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        done = shell("$NEW_GPSFSM check a.xml >&-", tmp_path)
        assert done.returncode == 2
        assert done.stderr == b"gpsfsm: cannot write to standard output: it is closed\n"

    def test_closed_standard_error(self, tmp_path: Path) -> None:
        assert shell("$NEW_GPSFSM check missing.xml 2>&-", tmp_path).returncode == 2
        assert shell("$NEW_GPSFSM chek 2>&-", tmp_path).returncode == 2

    def test_is_utf8_in_any_locale(self, tmp_path: Path) -> None:
        write(tmp_path, é=ACCEPTED)
        for locale in ("C", "POSIX"):
            env = {"LC_ALL": locale, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
            done = run("check", ".", cwd=tmp_path, env=env)
            assert done.returncode == 0, done
            assert done.stdout.count(b"\r") == 0


class TestColors:
    @pytest.mark.parametrize(
        ("choice", "environ", "colored"),
        [
            ("auto", {}, False),
            ("always", {}, True),
            ("never", {"FORCE_COLOR": "1"}, False),
            ("auto", {"FORCE_COLOR": "1"}, True),
            ("auto", {"FORCE_COLOR": ""}, False),
            ("auto", {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
            ("always", {"NO_COLOR": "1"}, True),
        ],
    )
    def test_in_a_pipe(
        self, choice: str, environ: dict[str, str], colored: bool, tmp_path: Path
    ) -> None:
        write(tmp_path, a=ACCEPTED)
        done = run("check", "a.xml", "--color", choice, cwd=tmp_path, env=environ)
        assert (ESCAPE in done.stdout) is colored

    def test_in_a_file(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("FORCE_COLOR", "1")
        assert wants_color("auto") is True
        assert wants_color("auto", "report.txt") is False
        assert wants_color("always", "report.txt") is True


@pytest.mark.skipif(sys.platform == "win32", reason="needs pseudo-terminals")
class TestTerminal:
    def run(self, folder: Path, *arguments: str, **env: str) -> tuple[bytes, bytes]:
        """(standard output, standard error), each a terminal of its own."""
        terminals = [os.openpty() for _ in range(2)]
        process = Forked(
            arguments,
            cwd=folder,
            environment=environment(TERM="xterm", **env),
            stdout=terminals[0][1],
            stderr=terminals[1][1],
        )
        collected = (bytearray(), bytearray())
        readers = []
        for (ours, theirs), into in zip(terminals, collected, strict=True):
            os.close(theirs)
            readers.append(threading.Thread(target=_drain, args=(ours, into)))
            readers[-1].start()
        process.wait(TIMEOUT_S)
        for reader in readers:
            reader.join(TIMEOUT_S)
        return bytes(collected[0]), bytes(collected[1])

    def test_colors(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        assert ESCAPE in self.run(tmp_path, "check", "a.xml")[0]
        assert ESCAPE not in self.run(tmp_path, "check", "a.xml", NO_COLOR="1")[0]
        assert ESCAPE not in self.run(tmp_path, "check", "a.xml", "--color", "never")[0]
        (plan,) = json.loads(self.run(tmp_path, "check", "a.xml", "--format", "json")[0])["plans"]
        assert plan["path"] == "a.xml"

    def test_a_progress_bar_for_many_plans_only(self, tmp_path: Path) -> None:
        write(tmp_path / "few", **{f"p{number}": ACCEPTED for number in range(20)})
        write(tmp_path / "many", **{f"p{number}": ACCEPTED for number in range(21)})
        assert self.run(tmp_path, "check", "few")[1] == b""
        out, err = self.run(tmp_path, "check", "many")
        assert b"21/21" in err
        assert b"checking" not in out
        assert self.run(tmp_path, "check", "many", "--quiet")[1] == b""
        assert run("check", "many", cwd=tmp_path).stderr == b""


@pytest.mark.parametrize(("soon_s", "shown"), [(600.0, False), (0.1, True)])
def test_few_plans_that_take_long_have_a_progress_bar(
    monkeypatch: pytest.MonkeyPatch, soon_s: float, *, shown: bool
) -> None:
    terminal = io.StringIO()
    monkeypatch.setattr(terminal, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(sys, "stderr", terminal)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(gpsfsm.progress, "_SOON_S", soon_s)
    until_s = time.monotonic() + (TIMEOUT_S if shown else 0.5)
    with progress_bar("checking", 2, at_least=MANY) as tick:
        tick(1, 2)
        while "1/2" not in terminal.getvalue() and time.monotonic() < until_s:
            time.sleep(0.05)
    assert ("1/2" in terminal.getvalue()) == shown


def _drain(terminal: int, into: bytearray) -> None:
    while True:
        try:
            chunk = os.read(terminal, 65536)
        except OSError:  # Linux' way to say that the other side is closed
            break
        if not chunk:
            break
        into += chunk
    os.close(terminal)
