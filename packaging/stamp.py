"""Write the version and the owner of gpsfsm into every file that cannot import gpsfsm.version.

python packaging/stamp.py               rewrites the files
python packaging/stamp.py --check       exits 1 if a file says something else
python packaging/stamp.py --tag v1.2.3  exits 1 unless this version may be released under this tag

The owner is recognised by the addresses in which it occurs, whatever file they are in, so that a
new page needs no entry here. Versions look alike everywhere: those of gpsfsm are recognised beside
its name, or in the few files of ``VERSIONED``.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path
from runpy import run_path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).resolve().parents[1]
PLACEHOLDER = "OWNER"
_ACCOUNT = r"[A-Za-z0-9][A-Za-z0-9-]*"
_NUMBER = r"[0-9]+\.[0-9]+\.[0-9]+"
_END = r"(?![\w-])"  # gpsfsm-2026 is another repository
OWNERS = (
    re.compile(rf"(github\.com[/:])({_ACCOUNT})(/gpsfsm{_END})"),
    re.compile(rf"(?<![\w/-])()({_ACCOUNT})(/gpsfsm@)"),
    re.compile(rf'(<maintainer email=")({_ACCOUNT})(@users\.noreply\.github\.com)'),
)
LOWER_OWNERS = (
    re.compile(rf"(ghcr\.io/)({_ACCOUNT})(/gpsfsm{_END})"),
    re.compile(rf"(https?://)({_ACCOUNT})(\.github\.io/gpsfsm{_END})"),
)
VERSIONS = (
    re.compile(rf"(/gpsfsm@v)({_NUMBER})()"),
    re.compile(rf"(/gpsfsm\n\s+rev: v)({_NUMBER})()"),
    re.compile(rf"(/gpsfsm/(?:blob|tree|releases/download)/v)({_NUMBER})(/)"),
    re.compile(rf"(ghcr\.io/{_ACCOUNT}/gpsfsm:)({_NUMBER})()"),
    re.compile(rf"(\bgpsfsm(?:\[[a-z,]+\])?==)({_NUMBER})()"),
    re.compile(rf"(\bgpsfsm-)({_NUMBER})(\.vsix|\.tar\.gz|-py3)"),
)
VERSIONED = {
    "docs/install.md": re.compile(rf"(^gpsfsm )({_NUMBER})($)", re.MULTILINE),
    "docs/service.md": re.compile(rf'(^  "version": ")({_NUMBER})(")', re.MULTILINE),
    "editors/vscode/package.json": re.compile(rf'(^  "version": ")({_NUMBER})(")', re.MULTILINE),
    "editors/vscode/package-lock.json": re.compile(
        rf'((?:^  |"": {{\s+"name": "gpsfsm",\s+)"version": ")({_NUMBER})(")', re.MULTILINE
    ),
    "ros/gpsfsm_ros/package.xml": re.compile(rf"(<version>)({_NUMBER})(</version>)"),
    "ros/gpsfsm_ros/setup.py": re.compile(rf'(\bversion=")({_NUMBER})(")'),
}
NOT_STAMPED = ("CHANGELOG.md",)
"""What tells of earlier versions; its owners are written all the same."""


@dataclass(frozen=True)
class Identity:
    """What is written: the words of ``gpsfsm/version.py``."""

    version: str
    owner: str


def identity(root: Path) -> Identity:
    """The version and the owner that a checkout has."""
    words = run_path(str(root / "gpsfsm" / "version.py"))
    return Identity(words["VERSION"], words["OWNER"])


def stamped(name: str, text: str, words: Identity) -> str:
    """The text of a file, by its name below the root, with these words in it."""
    pairs = [(pattern, words.owner) for pattern in OWNERS]
    pairs += [(pattern, words.owner.lower()) for pattern in LOWER_OWNERS]
    if name not in NOT_STAMPED:
        own = VERSIONED.get(name)
        pairs += [(pattern, words.version) for pattern in (*VERSIONS, *((own,) if own else ()))]
    for pattern, word in pairs:
        text = pattern.sub(rf"\g<1>{word}\g<3>", text)
    return text


def names(root: Path) -> list[str]:
    """The files that git tracks, or would track; in an unpacked archive, as .gitignore says."""
    try:
        listed = subprocess.run(
            ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],  # noqa: S607
            cwd=root,
            capture_output=True,
            check=True,
        )
    except (OSError, subprocess.CalledProcessError):
        return sorted(_walked(root, (root / ".gitignore").read_text("utf-8").split()))
    return sorted(filter(None, os.fsdecode(listed.stdout).split("\0")))


def _walked(root: Path, ignored: list[str]) -> Iterator[str]:
    """The names of all files but those that fit a line of .gitignore: there are only plain ones."""
    patterns = [".git", *(each.rstrip("/") for each in ignored)]
    for folder, inner, files in os.walk(root):
        inner[:] = [each for each in inner if not any(fnmatch(each, one) for one in patterns)]
        links = [each for each in inner if Path(folder, each).is_symlink()]
        for name in (*files, *links):
            if not any(fnmatch(name, one) for one in patterns):
                yield Path(folder, name).relative_to(root).as_posix()


def texts(root: Path) -> Iterator[tuple[Path, str]]:
    """The files that git tracks, or would track, and that are texts."""
    for name in names(root):
        file = root / name
        if file.is_symlink() or not file.is_file():
            continue
        try:
            yield file, file.read_bytes().decode("utf-8")
        except UnicodeDecodeError:
            continue


def differing(root: Path) -> dict[Path, str]:
    """What the files that say something else should say."""
    words = identity(root)
    wanted = (
        (file, text, stamped(file.relative_to(root).as_posix(), text, words))
        for file, text in texts(root)
    )
    return {file: right for file, text, right in wanted if right != text}


def refusal(words: Identity, tag: str) -> str:
    """The reason not to release this under the tag; empty if there is none."""
    if tag != f"v{words.version}":
        return f"the tag {tag} is not v{words.version}, the version in gpsfsm/version.py"
    if words.owner == PLACEHOLDER:
        return "OWNER in gpsfsm/version.py is still the placeholder: set it, and run this script"
    return ""


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Write version and owner where they occur.")
    parser.add_argument("--check", action="store_true", help="only compare; exit 1 if they differ")
    parser.add_argument("--tag", help="also exit 1 unless the version may be released as TAG")
    options = parser.parse_args()
    wanted = differing(ROOT)
    if not options.check and options.tag is None:
        for file, text in wanted.items():
            file.write_bytes(text.encode("utf-8"))
        return 0
    complaints = [
        f"{file.relative_to(ROOT)} has another version or owner: run python packaging/stamp.py"
        for file in wanted
    ]
    if options.tag is not None:
        complaints += filter(None, [refusal(identity(ROOT), options.tag)])
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    return int(bool(complaints))


if __name__ == "__main__":
    sys.exit(main())
