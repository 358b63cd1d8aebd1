"""A repository with plans in it, and programs that stand for those of a pipeline's machine."""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from runpy import run_path
from typing import TYPE_CHECKING

import gpsfsm
from gpsfsm.version import VERSION
from tests.cli.support import ACCEPTED, REJECTED
from tests.forked import write_program

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["BAD", "GOOD", "REPO", "Place", "Snippet"]
__all__ += ["clone", "git", "make_place", "snippets", "stand_in"]

REPO = Path(__file__).parents[2]
_STAMP = run_path(str(REPO / "packaging" / "stamp.py"))
_FENCE = re.compile(r"^```(?P<language>\w+)\n(?P<text>.*?)^```$", re.DOTALL | re.MULTILINE)
_OTHER_GIT = re.compile(r"GIT_(?!CONFIG|SSL)")
_TITLE = re.compile(r"^(?:#|//) (?P<file>\S+)\n")


@dataclass(frozen=True)
class Snippet:
    """A block of a page; ``file`` is what its first line says it is, "" for nothing."""

    language: str
    file: str
    text: str


def snippets(page: Path) -> list[Snippet]:
    """The blocks of a page that have a language."""
    results = []
    for match in _FENCE.finditer(page.read_text(encoding="utf-8")):
        title = _TITLE.match(match["text"])
        results.append(Snippet(match["language"], title["file"] if title else "", match["text"]))
    return results


@dataclass(frozen=True)
class Place:
    """A checked-out repository. Its ``python``, ``pip`` and ``gpsfsm`` come first on the path.

    They are those of this installation, but what ``pip`` is to install is only written down.
    """

    folder: Path
    programs: Path

    def bash(
        self, script: str, env: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run a script as a step of a pipeline does."""
        return subprocess.run(
            ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
            cwd=self.folder,
            env=self.environment() | dict(env or {}),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=120,
            check=False,
        )

    def environment(self) -> dict[str, str]:
        """Nothing of this machine but where its programs are."""
        return {
            "PATH": f"{self.programs}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(Path(gpsfsm.__file__).parents[1]),
            "HOME": str(self.folder),
            "LC_ALL": "C.UTF-8",
        }

    @property
    def installed(self) -> str:
        """What pip was told."""
        log = self.programs / "pip.log"
        return log.read_text(encoding="utf-8") if log.exists() else ""


def make_place(folder: Path, *, plans: Mapping[str, str]) -> Place:
    """A repository with these plans, by their paths."""
    place = Place(folder / "repository", folder / "bin")
    place.programs.mkdir(parents=True)
    for name, text in plans.items():
        file = place.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text, encoding="utf-8")
    log = f'printf "%s\\n" "$*" >> "{place.programs / "pip.log"}"'
    real = f'exec "{sys.executable}"'
    _program(place.programs / "pip", log)
    write_program(place.programs)
    _program(
        place.programs / "python",
        f'if [ "$1 $2" = "-m pip" ]; then shift 2; {log}; else {real} "$@"; fi',
    )
    return place


def git(folder: Path, *words: str | Path) -> str:
    """What a git command prints, by somebody without settings of their own."""
    person = [
        *("-c", "user.name=Somebody", "-c", "user.email=somebody@example.org"),
        *("-c", "init.defaultBranch=main", "-c", "commit.gpgsign=false"),
        *("-c", "safe.directory=*"),  # a checkout may belong to somebody else
    ]
    # in a hook, these name another repository
    kept = {name: text for name, text in os.environ.items() if not _OTHER_GIT.match(name)}
    done = subprocess.run(
        ["git", *person, *words], cwd=folder, env=kept, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def clone(folder: Path) -> Path:
    """A repository with all that this one tracks as it is now, in one commit with a tag."""
    for name in _STAMP["names"](REPO):
        source, target = REPO / name, folder / name
        if source.is_symlink() or source.is_file():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(source, target, follow_symlinks=False)
    git(folder, "init", "-q")
    git(folder, "add", "--all")
    git(folder, "commit", "-q", "-m", "All of it")
    git(folder, "tag", f"v{VERSION}")
    return folder


def stand_in(place: Place, name: str, script: str = "") -> Path:
    """A program that writes down how it was called, and then runs this script; its log."""
    log = place.programs / f"{name}.log"
    _program(place.programs / name, f'printf "%s\\n" "$*" >> "{log}"\n{script}')
    return log


def _program(file: Path, script: str) -> None:
    file.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    file.chmod(file.stat().st_mode | stat.S_IXUSR)


GOOD = {"plans/a.xml": ACCEPTED}
BAD = GOOD | {"plans/b.xml": REJECTED}
