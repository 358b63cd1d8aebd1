"""Too little memory, too little time, pipes at which nobody writes: no verdict, and no defect."""

from __future__ import annotations

import os
import select
import signal
import stat
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import pytest

from gpsfsm import files, streams
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.cli import main
from gpsfsm.errors import GpsfsmError, InputError, is_out_of_memory
from gpsfsm.model.report import PlanReport, Verdict
from tests.cli.hurried_run import hurried
from tests.cli.support import ACCEPTED, environment, run, write
from tests.service.support import slow_plan

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")


def wide(size: int) -> str:
    """A plan that takes z3 longer than anybody waits, under assumptions."""
    steps = "".join(
        f'<Control type="sequential"><Runner interface="a/A{n}" provider="a/A"/>'
        f'<Runner interface="a/B{n % 7}" provider="a/A"/></Control>'
        for n in range(size)
    )
    return f'<Plan><Control type="parallel_any">{steps}</Control></Plan>'


class TestMemory:
    @pytest.mark.parametrize("megabytes", [70, 110, 220])
    def test_too_little_of_it_is_no_defect(self, tmp_path: Path, megabytes: int) -> None:
        """As under ``ulimit -v``: z3 cannot be loaded, or cannot begin, or cannot go on."""
        write(tmp_path, a=wide(400))
        code = (
            f"import resource, runpy, sys; m = {megabytes} << 20; "
            "resource.setrlimit(resource.RLIMIT_AS, (m, m)); "
            "sys.argv = ['gpsfsm', 'check', 'a.xml', '--solver', 'z3', '--rlimit', '2000000', "
            "'--total-rlimit', '4000000', '--assume', 'any A1 fails implies any A2 fails']; "
            "runpy.run_module('gpsfsm', run_name='__main__')"
        )
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            env=environment(),
            capture_output=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 2, done.stderr
        assert b"GP904 inconclusive" in done.stdout
        if megabytes < 200:  # above, the steps may have run out before the memory
            assert b"memory ran out before the plan was decided" in done.stdout
            assert b"hint: allow more memory" in done.stdout
        assert b"defect" not in done.stdout + done.stderr

    @pytest.mark.parametrize("megabytes", [150, 154, 158])
    def test_the_parser_of_z3_ends_nothing(self, tmp_path: Path, megabytes: int) -> None:
        """It would leave with its own exit code, 101, and not a word."""
        write(tmp_path, a=slow_plan(depth=5))
        code = (
            f"import resource, runpy, sys; m = {megabytes} << 20; "
            "resource.setrlimit(resource.RLIMIT_AS, (m, m)); "
            "sys.argv = ['gpsfsm', 'check', 'a.xml', '--consistent']; "
            "runpy.run_module('gpsfsm', run_name='__main__')"
        )
        done = subprocess.run(
            [sys.executable, "-c", code],
            cwd=tmp_path,
            env=environment(),
            capture_output=True,
            timeout=120,
            check=False,
        )
        assert done.returncode == 2, done.stderr
        assert b"memory ran out before the plan was decided" in done.stdout

    def test_errors_that_say_so(self) -> None:
        class Z3Exception(Exception):  # noqa: N818
            __module__ = "z3.z3types"

        assert is_out_of_memory(MemoryError())
        assert is_out_of_memory(Z3Exception(b"out of memory"))
        assert is_out_of_memory(Z3Exception("libz3.so not found."))
        assert not is_out_of_memory(Z3Exception(b"invalid argument"))
        assert not is_out_of_memory(ValueError("out of memory"))

    @pytest.mark.parametrize("error", [MemoryError, RecursionError])
    def test_wherever_it_runs_out(
        self, error: type[Exception], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        def fail(*_: object, **__: object) -> None:
            raise error

        for place in (
            "gpsfsm.checking.check.read_plan_or_machine",
            "gpsfsm.analysis.decide.decide",
        ):
            with monkeypatch.context() as patched:
                patched.setattr(place, fail)
                report = check_text(ACCEPTED, "a.xml", CheckOptions())
            assert report.verdict is Verdict.UNDECIDED
            assert [each.rule for each in report.findings] == ["GP904"]
            assert report.findings[0].hint


class TestTime:
    def test_what_takes_longer_is_undecided_and_others_are_not(self, tmp_path: Path) -> None:
        write(tmp_path, a=wide(900), b=ACCEPTED)
        words = ("check", "a.xml", "b.xml", "--consistent", "--solver", "z3")
        began = time.monotonic()
        done = run(*words, "--time-limit", "3", cwd=tmp_path)
        assert time.monotonic() - began < 50
        assert done.returncode == 2
        assert b"a.xml: error GP904 inconclusive: the plan is undecided after 3 s" in done.stdout
        assert b"hint: allow more time" in done.stdout
        assert b"b.xml: accepted" in done.stdout

    def test_it_strikes_before_anything_is_decided(self, tmp_path: Path) -> None:
        """200 assumptions about 2,000 runners: binding them is no work of z3."""
        runners = "".join(f'<Runner interface="a/A{n % 200}" provider="a/A"/>' for n in range(2000))
        write(tmp_path, a=f'<Plan><Control type="sequential">{runners}</Control></Plan>')
        words = [
            word
            for n in range(200)
            for word in ("--assume", f"any A{n} fails implies any A{(n + 1) % 200} succeeds")
        ]
        began = time.monotonic()
        done = run("check", "a.xml", *words, "--time-limit", "2", cwd=tmp_path)
        assert time.monotonic() - began < 50
        assert done.returncode == 2
        assert b"GP904" in done.stdout

    def test_what_is_decided_in_time_is_as_without(self, tmp_path: Path) -> None:
        write(tmp_path, a=ACCEPTED)
        without = run("check", "a.xml", "--format", "json", cwd=tmp_path)
        within = run("check", "a.xml", "--format", "json", "--time-limit", "50", cwd=tmp_path)
        assert within.stdout == without.stdout

    def test_there_is_a_limit_by_default(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def endless(text: bytes, path: str, *_: object) -> PlanReport:
            while path == "a.xml":
                pass
            return PlanReport(path, Verdict.ACCEPTED, None, ())

        write(tmp_path, a=ACCEPTED, b=ACCEPTED)
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr("gpsfsm.checking.check.check_text", endless)
        monkeypatch.setattr("gpsfsm.checking.check.TIME_LIMIT_S", 0.5)
        before = signal.getsignal(signal.SIGALRM)
        assert main(["check", "a.xml", "b.xml"]) == 2
        said = capsys.readouterr().out
        assert "a.xml: error GP904 inconclusive: the plan is undecided after 0.5 s" in said
        assert "b.xml: accepted" in said
        assert signal.getsignal(signal.SIGALRM) is before
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)

    @needs_pipes
    @pytest.mark.parametrize("name", ["pipe", "pipe.jsonl", "/dev/stdin"])
    @pytest.mark.parametrize("jobs", ["1", "2"])
    def test_reading_is_limited_too(self, tmp_path: Path, name: str, jobs: str) -> None:
        """Somebody writes, and does not end."""
        pipe = tmp_path / name.replace("/dev/stdin", "input")
        os.mkfifo(pipe)
        number = os.open(pipe, os.O_RDWR)
        os.write(number, b"<Plan>")
        done = subprocess.run(
            [sys.executable, "-m", "gpsfsm", "check", name, "--time-limit", "0.5", "--jobs", jobs],
            cwd=tmp_path,
            env=environment(),
            stdin=number,
            capture_output=True,
            timeout=120,
            check=False,
        )
        os.close(number)
        assert done.returncode == 2
        assert b"cannot be read: this pipe did not end within 0.5 s" in done.stdout

    @pytest.mark.parametrize(
        ("words", "message"),
        [
            (("--fix",), b"--time-limit cannot be used with --fix"),
            (("--jobs", "ray"), b"there is no time limit with --jobs ray"),
        ],
    )
    def test_where_it_makes_no_sense(
        self, tmp_path: Path, words: tuple[str, ...], message: bytes
    ) -> None:
        write(tmp_path, a=ACCEPTED)
        done = run("check", "a.xml", "--time-limit", "5", *words, cwd=tmp_path)
        assert done.returncode == 2
        assert message in done.stderr


@needs_pipes
class TestPipes:
    @pytest.fixture(autouse=True)
    def soon(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(files, "WRITER_S", 0.5)
        monkeypatch.setattr(files, "WHOLE_S", 1.0)
        os.mkfifo("pipe")

    def writer(self, *pauses_s: float) -> threading.Thread:
        def work() -> None:
            with suppress(OSError), open("pipe", "wb", 0) as pipe:  # noqa: PTH123
                for pause_s in pauses_s:
                    time.sleep(pause_s)
                    pipe.write(b"ab")

        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        return thread

    def test_nobody_writes(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(files, "WRITER_S", 3_600.0)
        monkeypatch.setattr(files, "OPENED_S", 0.1)
        with pytest.raises(InputError, match=r"nothing was written to this pipe within 0\.1 s"):
            files.read("pipe", 100)

    def test_somebody_does_not_end(self) -> None:
        self.writer(0.1, 5.0)
        with pytest.raises(InputError, match="this pipe did not end within"):
            files.read("pipe", 100)

    def test_somebody_is_silent(self) -> None:
        """It has been opened, and stays so: that alone does not make anybody wait for long."""
        self.writer(60.0)
        began = time.monotonic()
        with pytest.raises(InputError, match=r"nothing was written to this pipe within 0\.5 s"):
            files.read("pipe", 100)
        assert time.monotonic() - began < 50

    def test_standard_input_may_be_silent(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(files, "WHOLE_S", 30.0)
        number, other = os.pipe()

        def write() -> None:
            os.write(other, b"ab")
            os.close(other)

        threading.Timer(0.8, write).start()
        assert files.read_from(number, 100) == b"ab"
        os.close(number)

    def test_where_nothing_can_poll(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """As on Windows, where the flags of POSIX are missing as well."""
        monkeypatch.delattr(select, "poll")
        monkeypatch.delattr(os, "O_CLOEXEC")
        monkeypatch.delattr(os, "O_NONBLOCK")
        Path("a.xml").write_bytes(b"a\r\nb")
        assert files.read("a.xml", 100) == b"a\r\nb"
        self.writer(0.1, 0.1)
        assert files.read("pipe", 100) == b"abab"
        self.writer(0.1, 1.2, 0.1)
        with pytest.raises(InputError, match=r"this pipe did not end within 1 s"):
            files.read("pipe", 100)

    def test_text_and_bytes_are_told_apart(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """On Windows a file is opened as text, unless this flag says otherwise."""
        monkeypatch.setattr(os, "O_BINARY", 1 << 30, raising=False)
        opened: list[int] = []

        def refuse(_: str, flags: int) -> int:
            opened.append(flags)
            raise OSError(5, "no")

        monkeypatch.setattr(os, "open", refuse)
        with pytest.raises(InputError, match="cannot be read: no"):
            files.read("a.xml", 100)
        assert [flags & (1 << 30) for flags in opened] == [1 << 30]

    def test_somebody_takes_time(self) -> None:
        self.writer(0.2, 0.3)
        assert files.read("pipe", 100) == b"abab"

    def test_no_more_than_is_allowed(self) -> None:
        self.writer(0.0, 0.0, 0.0)
        assert files.read("pipe", 2) == b"aba"

    def test_nobody_reads(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(streams, "READER_S", 0.1)
        for write_to in (streams.write_text, streams.append_text):
            with pytest.raises(GpsfsmError, match=r"cannot write pipe: nobody has read this pipe"):
                write_to("a", "pipe")
        assert stat.S_ISFIFO(Path("pipe").stat().st_mode)

    @pytest.mark.parametrize("name", ["pipe", "/dev/fd/{}"])
    def test_somebody_reads(self, name: str) -> None:
        reading = os.open("pipe", os.O_RDONLY | os.O_NONBLOCK)
        number = os.open("pipe", os.O_WRONLY)  # as a shell opens it for >(…)
        streams.write_text("ab", name.format(number))
        streams.append_text("c", name.format(number))
        assert os.read(reading, 100) == b"abc"
        os.close(number)
        os.close(reading)

    def test_where_none_may_be(self) -> None:
        with pytest.raises(InputError, match="is not a regular file"):
            files.read("pipe", 100, pipes=False)

    def test_a_pipe_that_was_closed_unwritten(self) -> None:
        number, other = os.pipe()
        os.close(other)
        assert files.read(f"/dev/fd/{number}", 100) == b""
        os.close(number)


@pytest.mark.parametrize(
    ("path", "why"),
    [
        ("/dev/zero", "is not a regular file"),
        (".", "cannot be read: it is a folder"),
        ("none", "cannot be read: No such file or directory"),
        ("a\0b", "cannot be read: a NUL character is not allowed"),
        ("", "cannot be read: the path is empty"),
    ],
)
def test_what_is_no_file(path: str, why: str) -> None:
    with pytest.raises(InputError) as caught:
        files.read(path, 100)
    assert str(caught.value) == why


@needs_pipes
def test_no_command_waits_for_ever(tmp_path: Path) -> None:
    """All at once, since each waits for a while, if no longer than the tests have them wait."""
    write(tmp_path, a=ACCEPTED)
    os.mkfifo(tmp_path / "pipe")
    commands = (
        *(("check", "pipe"), ("gate", "pipe"), ("show", "pipe")),
        ("check", "a.xml", "--config", "pipe"),
        ("check", "a.xml", "--baseline", "pipe"),
        ("check", "a.xml", "--capabilities", "pipe"),
        ("check", "a.xml", "--task", "pipe"),
        ("run", "a.xml", "--scenario", "pipe"),
        ("run", "a.xml", "--world", "pipe"),
        ("gate", "a.xml", "--verify", "pipe"),
        ("generate", "x", "--model", "replay:pipe"),
    )
    processes = [(words, hurried(*words, cwd=tmp_path)) for words in commands]
    for words, process in processes:
        out, err = process.communicate(timeout=60)
        message = out + err
        assert b"pipe" in message, words
        assert b"Traceback" not in message, words
        if "--capabilities" not in words:  # a defective file is a finding
            assert process.returncode == 2, words


SECRET = "S3CR3T"  # noqa: S105


@pytest.mark.parametrize(
    "content",
    [
        f"{SECRET}\n",
        f"root:{SECRET}:0\nuser:{SECRET}\n",
        f'{{"a": "{SECRET}"}}',
        f"<conf><a pass='{SECRET}'>{SECRET}</a>{SECRET} & <b {SECRET}</conf>",
        f"<root><a pass='{SECRET}'>{SECRET}</a></root>",
        f"<html>{SECRET}<br>",
        f"<{SECRET}-is-a-password><a/>",
        f"-----BEGIN KEY-----\n{SECRET} &{SECRET}; <",
    ],
)
def test_what_is_no_plan_is_not_shown(
    tmp_path: Path,
    content: str,
    monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """A path may be a link, and whoever reads the log need not be allowed to read what it is to."""
    (tmp_path / "secret").write_text(content, encoding="utf-8")
    (tmp_path / "plan.xml").symlink_to("secret")
    write(tmp_path, a=ACCEPTED)
    formats = ("text", "json", "sarif", "gitlab", "junit", "markdown", "github", "llm")
    commands = [
        *(("check", "plan.xml", "--format", each) for each in formats),
        ("check", "plan.xml", "--engine", "fabric-v2"),
        ("check", "plan.xml", "--from-response"),
        ("view", "plan.xml", "-o", "-"),
        *((word, "plan.xml") for word in ("gate", "show", "run", "fuzz")),
        ("diff", "plan.xml", "a.xml"),
        ("fix", "plan.xml", "--diff"),
        ("port", "plan.xml", "--to", "fabric-v1"),
        ("check", "a.xml", "--baseline", "plan.xml"),
        ("gate", "a.xml", "--verify", "plan.xml"),
        ("run", "a.xml", "--scenario", "plan.xml"),
        ("run", "a.xml", "--world", "plan.xml"),
        ("check", "a.xml", "--task", "plan.xml"),
        ("check", "a.xml", "--capabilities", "plan.xml"),
    ]
    monkeypatch.chdir(tmp_path)
    for words in commands:
        main(words)
        out, err = capfd.readouterr()
        assert out + err, words
        assert SECRET.lower() not in (out + err).lower(), words
