"""``gpsfsm fix`` and ``gpsfsm check --fix``."""

from __future__ import annotations

import os
import shutil
import stat
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.support import ACCEPTED, REJECTED, environment, run, runner, write

_DAMAGED = ACCEPTED.replace('"2"', "2").replace("<Plan>", '<Plan speed="3">')
_FIXES = (
    "a.xml:1: GP112 ineffective 'speed' removed\n"
    "a.xml:2: GP101 syntax of <Runner> corrected\n"
    "2 fixes in 1 plan; findings: 3 before, 1 after\n"
)


def _read(name: str) -> str:
    return Path(name).read_text(encoding="utf-8")


def test_a_file_is_fixed_in_place(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED)
    Path("a.xml").chmod(0o640)
    done = run("fix", "a.xml", cwd=tmp_path)
    assert (done.returncode, done.stdout.decode(), done.stderr) == (0, _FIXES, b"")
    assert _read("a.xml") == ACCEPTED
    assert stat.S_IMODE(Path("a.xml").stat().st_mode) == 0o640
    assert [file.name for file in tmp_path.iterdir()] == ["a.xml"]


def test_nothing_to_fix_touches_nothing(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    before = Path("a.xml").stat()
    done = run("fix", "a.xml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, b"nothing to fix; 1 finding remains\n")
    after = Path("a.xml").stat()
    assert (after.st_mtime_ns, after.st_ino) == (before.st_mtime_ns, before.st_ino)


def test_what_remains_is_told(tmp_path: Path) -> None:
    write(tmp_path, a=REJECTED)
    done = run("fix", "a.xml", cwd=tmp_path)
    assert done.returncode == 1
    decoded = done.stdout.decode()
    assert decoded.startswith(
        "a.xml: 1 more fix is possible with --unsafe-fixes\na.xml:2:3: error GP307"
    )
    assert decoded.endswith("nothing to fix; 1 finding remains\n")
    assert _read("a.xml") == REJECTED
    done = run("fix", "a.xml", "--unsafe-fixes", cwd=tmp_path)
    assert done.returncode == 0
    assert (
        b"a.xml:2: GP307 goal moved out of a recovery that guards nothing (unsafe)" in done.stdout
    )
    assert _read("a.xml") == ACCEPTED


def test_the_difference_can_be_applied(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED.rstrip("\n"))
    done = run("fix", "--diff", "a.xml", cwd=tmp_path)
    assert done.returncode == 1
    assert _read("a.xml") == _DAMAGED.rstrip("\n")
    assert done.stderr.decode() == _FIXES.replace("plan;", "plan would be made;")
    lines = done.stdout.decode().splitlines()
    assert lines[:2] == ["--- a.xml", "+++ a.xml"]
    subprocess.run(["git", "init", "-q"], check=True, cwd=tmp_path)
    subprocess.run(["git", "apply", "-p0", "-"], input=done.stdout, check=True, cwd=tmp_path)
    assert _read("a.xml") == ACCEPTED.rstrip("\n")
    done = run("fix", "--diff", "a.xml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, b"")


def test_standard_input_goes_to_standard_output(tmp_path: Path) -> None:
    answer = f"Sure!\n```xml\n{_DAMAGED}```\n"
    for more in ((), ("--from-response",)):
        done = run("fix", "-", *more, cwd=tmp_path, stdin=answer.encode())
        assert (done.returncode, done.stdout.decode()) == (0, ACCEPTED)
        assert b"plan extracted from the text around it" in done.stderr
    latin = '<?xml version="1.0" encoding="latin1"?>\n' + _DAMAGED.replace(
        "<Plan", "<!-- \xe9 --><Plan"
    )
    done = run("fix", "-", "-q", cwd=tmp_path, stdin=latin.encode("latin-1"))
    assert done.stdout.startswith(b'<?xml version="1.0" encoding="latin1"?>\n<!-- \xe9 --><Plan>')
    assert done.stderr == b""


def test_another_file_gets_the_result(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED)
    assert run("fix", "a.xml", "-o", "b.xml", cwd=tmp_path).returncode == 0
    assert (_read("a.xml"), _read("b.xml")) == (_DAMAGED, ACCEPTED)
    done = run("fix", "a.xml", "-o", "-", cwd=tmp_path)
    assert done.stdout.decode() == ACCEPTED
    assert run("fix", "b.xml", "-o", "c.xml", cwd=tmp_path).returncode == 0
    assert _read("c.xml") == ACCEPTED


def test_folders_and_links(tmp_path: Path) -> None:
    write(tmp_path / "plans", a=_DAMAGED, b=ACCEPTED, c=REJECTED)
    Path("link.xml").symlink_to("plans/a.xml")
    done = run("fix", "link.xml", "plans", cwd=tmp_path)
    assert done.returncode == 1
    assert Path("link.xml").is_symlink()
    assert _read("plans/a.xml") == ACCEPTED
    assert done.stdout.decode().splitlines()[-1] == "2 fixes in 1 plan; findings: 6 before, 4 after"


@pytest.mark.parametrize("words", [("fix",), ("check", "--fix")])
def test_links_out_of_a_folder_are_not_followed(tmp_path: Path, words: tuple[str, ...]) -> None:
    write(tmp_path / "plans", a=_DAMAGED)
    write(tmp_path / "elsewhere", b=_DAMAGED)
    Path("plans/link.xml").symlink_to("../elsewhere/b.xml")
    Path("plans/same.xml").symlink_to("a.xml")
    done = run(*words, "plans", cwd=tmp_path)
    assert done.returncode == 2
    target = Path("elsewhere/b.xml").resolve()
    assert f"cannot write plans/link.xml: a link leads out of the folder plans, to {target}" in (
        done.stderr.decode()
    )
    assert _read("elsewhere/b.xml") == _DAMAGED
    assert _read("plans/a.xml") == ACCEPTED
    assert Path("plans/link.xml").is_symlink()
    assert Path("plans/same.xml").is_symlink()
    assert run("fix", "plans/link.xml", cwd=tmp_path).returncode == 0  # this one was named
    assert _read("elsewhere/b.xml") == ACCEPTED


def test_files_that_cannot_be_read_or_written(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED)
    os.mkfifo("pipe.xml")
    Path("empty").mkdir()
    done = run("fix", "none.xml", "pipe.xml", "empty", "a.xml", cwd=tmp_path)
    assert done.returncode == 2
    assert b"empty: error GP901 unreadable-input: is a folder without any *.xml" in done.stdout
    assert b"none.xml" in done.stdout
    assert b"is not a regular file" in done.stdout
    assert _read("a.xml") == ACCEPTED
    assert stat.S_ISFIFO(Path("pipe.xml").stat().st_mode)


def test_a_file_that_is_read_only_stays(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED)
    Path("a.xml").chmod(0o444)
    done = run("fix", "a.xml", cwd=tmp_path)
    assert done.returncode == 2
    assert b"gpsfsm: a.xml: cannot write: the file is read-only" in done.stderr
    assert done.stdout.endswith(b" after; not written: 1 plan\n")
    assert _read("a.xml") == _DAMAGED
    assert run("fix", "a.xml", "-o", "b.xml", cwd=tmp_path).returncode == 0
    assert _read("b.xml") == ACCEPTED


@pytest.mark.skipif(shutil.which("patch") is None, reason="patch is not installed")
@pytest.mark.parametrize(
    ("text", "mark"),
    [
        (_DAMAGED, ""),
        (_DAMAGED, "\ufeff"),
        (_DAMAGED.rstrip("\n"), ""),
        (_DAMAGED.replace("\n", "\r\n"), ""),
        (_DAMAGED.replace("\n", "\r"), ""),
        (_DAMAGED.replace("</Plan>", "<!-- a\u2028b\x85c -->\n</Plan>"), ""),
        (_DAMAGED.replace("</Plan>", "<!-- a\x0cb\x1cc -->\r</Plan>"), ""),
    ],
)
def test_patch_makes_of_a_difference_what_fix_does(tmp_path: Path, text: str, mark: str) -> None:
    write(tmp_path, a="")
    Path("a.xml").write_bytes((mark + text).encode())
    assert run("fix", "-q", "a.xml", "-o", "wanted.xml", cwd=tmp_path).returncode in (0, 1)
    difference = run("fix", "--diff", "a.xml", cwd=tmp_path).stdout
    subprocess.run(
        ["patch", "--binary", "-p0", "-F0"],
        input=difference,
        check=True,
        capture_output=True,
        cwd=tmp_path,
    )
    assert Path("a.xml").read_bytes() == Path("wanted.xml").read_bytes()
    assert Path("a.xml").read_bytes() != (mark + text).encode()


def test_what_cannot_be_written_stays_as_it_was(tmp_path: Path) -> None:
    """A limit on the size of files stands for a full disk; it holds for root as well."""
    write(tmp_path / "plans", a=_DAMAGED)
    code = (
        "import resource, runpy, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)); "
        "sys.argv = ['gpsfsm', 'fix', 'plans/a.xml']; "
        "runpy.run_module('gpsfsm', run_name='__main__')"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2
    assert b"gpsfsm: plans/a.xml: cannot write" in done.stderr
    assert _read("plans/a.xml") == _DAMAGED


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "no plan is given"),
        (("a.xml", "b.xml", "-o", "c.xml"), "--output accepts only one plan"),
        (("a.xml", "--diff", "-o", "c.xml"), "--diff, which writes no plan"),
        (("a.xml", "-"), "standard input is fixed to standard output"),
        (("a.xml", "--select", "GP999"), "no rule matches 'GP999'"),
        (("a.xml", "-o", "no/such/folder.xml"), "its folder does not exist"),
    ],
)
def test_calls_that_make_no_sense(tmp_path: Path, words: tuple[str, ...], message: str) -> None:
    write(tmp_path, a=_DAMAGED, b=_DAMAGED)
    done = run("fix", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert message in done.stderr.decode()
    assert _read("a.xml") == _DAMAGED


def test_settings_of_a_file_hold(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED)
    Path("gpsfsm.toml").write_text('ignore = ["GP112"]\n', encoding="utf-8")
    run("fix", "a.xml", cwd=tmp_path)
    assert _read("a.xml") == ACCEPTED.replace("<Plan>", '<Plan speed="3">')
    run("fix", "a.xml", "--isolated", cwd=tmp_path)
    assert _read("a.xml") == ACCEPTED


def test_control_characters_of_a_plan_do_not_reach_the_messages(tmp_path: Path) -> None:
    text = ACCEPTED.replace("<Plan>", "<Plan>\x1b[31m")
    write(tmp_path, a=text.replace("Runner ", 'Runner a\u202eb="1" '))
    done = run("fix", "a.xml", cwd=tmp_path)
    assert b"\x1b" not in done.stdout + done.stderr
    assert "\u202e" not in (done.stdout + done.stderr).decode()


# -- check --fix ------------------------------------------------------------------------------


def test_check_fixes_and_reports_the_rest(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED, b=REJECTED)
    done = run("check", "--fix", "-q", "a.xml", "b.xml", cwd=tmp_path)
    assert done.returncode == 1
    assert _read("a.xml") == ACCEPTED
    assert [line.split()[2] for line in done.stdout.decode().splitlines()] == ["GP302", "GP307"]
    done = run("check", "--fix", "--unsafe-fixes", "--format", "json", "b.xml", cwd=tmp_path)
    assert done.returncode == 0
    assert b'"GP307"' not in done.stdout
    assert b"b.xml:2: GP307 goal moved out" in done.stderr
    assert _read("b.xml") == ACCEPTED


def test_check_shows_the_difference_and_what_it_leaves(tmp_path: Path) -> None:
    write(tmp_path, a=_DAMAGED)
    done = run("check", "--diff", "a.xml", cwd=tmp_path)
    assert done.returncode == 1
    assert _read("a.xml") == _DAMAGED
    assert done.stdout.startswith(b"--- a.xml\n+++ a.xml\n")
    assert b"GP302" in done.stdout
    assert b"GP112" not in done.stdout


@pytest.mark.parametrize(
    "words", [("--diff", "--format", "json"), ("--diff", "--fix"), ("--fix", "-")]
)
def test_checks_that_make_no_sense(tmp_path: Path, words: tuple[str, ...]) -> None:
    write(tmp_path, a=_DAMAGED)
    done = run("check", "a.xml", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == b""
    assert _read("a.xml") == _DAMAGED


def test_a_plain_check_loads_no_fixes(tmp_path: Path) -> None:
    write(tmp_path, a=f"<Plan>{runner()}</Plan>")
    script = (
        "import sys\nfrom gpsfsm.cli import main\nmain(['check', '-q', 'a.xml'])\n"
        "print([name for name in sys.modules if name.startswith('gpsfsm.fixing')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, cwd=tmp_path, check=True
    )
    assert done.stdout.splitlines()[-1] == b"[]"


def test_it_is_told_whether_the_plan_does_the_same(tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED.replace("<Plan>", '<Plan speed="3">'), b=REJECTED)
    done = run("fix", "a.xml", cwd=tmp_path)
    assert done.stdout.decode().splitlines()[:2] == [
        "a.xml:1: GP112 ineffective 'speed' removed",
        "a.xml: behaviour unchanged in every scenario",
    ]
    done = run("fix", "--unsafe-fixes", "b.xml", cwd=tmp_path)
    assert (
        b"b.xml: behaviour changed; 'gpsfsm diff' shows where the old and the new plan differ"
        in done.stdout
    )


def test_unsafe_fixes_alone_are_refused(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text("<Plan/>")
    done = run("check", "a.xml", "--unsafe-fixes", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert b"--unsafe-fixes needs --fix or --diff" in done.stderr
