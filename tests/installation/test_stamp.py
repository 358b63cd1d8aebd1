"""The version and the owner stand in gpsfsm/version.py, and nowhere else in another form."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from runpy import run_path
from typing import Any

import pytest
import yaml

import gpsfsm
from gpsfsm.version import IMAGE, OWNER, REPOSITORY, VERSION
from tests.pipelines.support import clone

REPO = Path(__file__).parents[2]
STAMP = "packaging/stamp.py"
OTHERS = ("CollaborativeRoboticsLab/gpsfsm-2026",)
"""Repositories of others whose names begin like ours."""


@pytest.fixture(scope="module")
def stamp() -> dict[str, Any]:
    return run_path(str(REPO / STAMP))


@pytest.fixture(scope="module")
def texts(stamp: dict[str, Any]) -> dict[str, str]:
    """The text of every file of the repository, by its name."""
    return {file.relative_to(REPO).as_posix(): text for file, text in stamp["texts"](REPO)}


def words(stamp: dict[str, Any], version: str, owner: str) -> object:
    return stamp["Identity"](version, owner)


def test_every_file_has_this_version_and_this_owner() -> None:
    done = subprocess.run(
        [sys.executable, STAMP, "--check"], cwd=REPO, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_the_version_is_stated_once(texts: dict[str, str]) -> None:
    project = tomllib.loads(texts["pyproject.toml"])
    assert "version" not in project["project"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "gpsfsm.version.VERSION"}
    assert gpsfsm.__version__ == VERSION
    assert json.loads(texts["editors/vscode/package.json"])["version"] == VERSION
    assert f"<version>{VERSION}</version>" in texts["ros/gpsfsm_ros/package.xml"]
    assert f'version="{VERSION}"' in texts["ros/gpsfsm_ros/setup.py"]
    assert f"rev: v{VERSION}" in texts["docs/gate.md"]


def test_no_other_owner_is_named(texts: dict[str, str]) -> None:
    """All that looks like an address of a repository, an action or an image of this name."""
    hosts = r"(?:github\.com[/:]|ghcr\.io/|https?://)"
    owners = {
        (name, each[1])
        for name, text in texts.items()
        for pattern in (
            rf"{hosts}([\w-]+)/gpsfsm(?![\w-])",
            r"(?<![\w/.-])([\w-]+)/gpsfsm@",
            r"([\w-]+)\.github\.io/gpsfsm(?![\w-])",
        )
        for each in re.finditer(pattern, text)
    }
    assert {owner for _, owner in owners} == {OWNER, OWNER.lower()}
    assert {"pyproject.toml", "docs/gate.md"} <= {name for name, _ in owners}


@pytest.mark.packages
def test_everything_follows_the_owner_and_the_version(
    tmp_path: Path, stamp: dict[str, Any], texts: dict[str, str]
) -> None:
    """In a copy of the repository, by the script of the copy."""
    new = {"owner": "Robots-R-Us", "version": "3.14.15"}
    for name, text in texts.items():
        file = tmp_path / name
        if any(word in text for word in ("gpsfsm", VERSION)):
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(text.encode("utf-8"))
    module = tmp_path / "gpsfsm" / "version.py"
    changed = texts["gpsfsm/version.py"].replace(f'"{VERSION}"', f'"{new["version"]}"')
    module.write_text(changed.replace(f'= "{OWNER}"', f'= "{new["owner"]}"'), encoding="utf-8")
    subprocess.run(["git", "init", "-q", tmp_path], check=True)

    def call(*arguments: str) -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, STAMP, *arguments],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stderr

    code, complaints = call("--check")
    assert code == 1
    assert "docs/gate.md has another version or owner" in complaints
    assert call() == (0, "")
    assert call("--check") == (0, "")
    assert call("--tag", f"v{new['version']}") == (0, "")
    copied = {
        file.relative_to(tmp_path).as_posix(): text for file, text in stamp["texts"](tmp_path)
    }
    left = {
        name: line
        for name, text in copied.items()
        for line in text.splitlines()
        if re.search(rf"\b({OWNER}|{OWNER.lower()})(/gpsfsm|\.github)", line)
        and f'"{OWNER}"' not in line
    }
    assert left == {}
    written = run_path(str(module))
    project = tomllib.loads(copied["pyproject.toml"])["project"]
    assert project["urls"]["Source"] == written["REPOSITORY"] != REPOSITORY
    assert f"- uses: {new['owner']}/gpsfsm@v{new['version']}" in copied["docs/gate.md"]
    assert f"{written['IMAGE']}:{new['version']}" in copied["compose.yaml"]
    assert written["IMAGE"] != IMAGE
    assert json.loads(copied["editors/vscode/package.json"])["version"] == new["version"]
    assert f"v{VERSION}" not in copied["docs/gate.md"]


@pytest.mark.packages
def test_tests_follow_the_owner(tmp_path: Path) -> None:
    """Those of blocks, the site and the packages, in a clone that somebody else publishes."""
    copy = clone(tmp_path / "copy")
    module = copy / "gpsfsm" / "version.py"
    text = module.read_text("utf-8").replace(f'OWNER = "{OWNER}"', 'OWNER = "Robots-R-Us"')
    module.write_text(text, encoding="utf-8")
    subprocess.run([sys.executable, STAMP], cwd=copy, check=True)
    done = subprocess.run(
        [
            *(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"),
            *("-m", "not packages", "-k", "not blocks_are or tutorial/index or README"),
            *("--deselect", "tests/test_blocks.py::test_a_wrong_block_is_noticed"),
            *("tests/test_blocks.py", "tests/test_site.py", "tests/installation"),
        ],
        cwd=copy,
        env={**os.environ, "PYTHONPATH": str(copy)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-4000:]


def test_an_unpacked_archive_has_the_same_files(stamp: dict[str, Any], tmp_path: Path) -> None:
    """Of which git knows nothing; what is built or installed there does not count."""
    copy = clone(tmp_path / "copy")
    tracked = stamp["names"](copy)
    assert len(tracked) > 1_000
    shutil.rmtree(copy / ".git")
    for name in (".venv/lib/a.py", "build/site/a.html", "tests/__pycache__/a.pyc"):
        (copy / name).parent.mkdir(parents=True, exist_ok=True)
        (copy / name).touch()
    assert stamp["names"](copy) == tracked


@pytest.mark.parametrize(
    "address",
    [
        "git@github.com:{0}/gpsfsm.git",
        "https://github.com/{0}/gpsfsm.",
        "uses: {0}/gpsfsm@v{1}",
        "  - repo: https://github.com/{0}/gpsfsm\n    rev: v{1}",
        "https://github.com/{0}/gpsfsm/blob/v{1}/docs",
        "ghcr.io/{0}/gpsfsm:{1}",
        "pip install 'gpsfsm[serve]=={1}'",
        "https://{0}.github.io/gpsfsm/x",
        "dist/gpsfsm-{1}-py3-none-any.whl gpsfsm-{1}.vsix",
    ],
)
def test_addresses_are_recognised(stamp: dict[str, Any], address: str) -> None:
    old, new = address.format("old", "0.0.1"), address.format("new", "9.9.9")
    assert stamp["stamped"]("a.md", old, words(stamp, "9.9.9", "new")) == new


@pytest.mark.parametrize(
    "text", [f"https://github.com/{OTHERS[0]}", "import gpsfsm", "gpsfsm 0.0.1", "x/gpsfsm/y"]
)
def test_addresses_of_others_stay(stamp: dict[str, Any], text: str) -> None:
    assert stamp["stamped"]("a.md", text, words(stamp, "9.9.9", "new")) == text


def test_a_release_needs_the_tag_of_the_version_and_an_owner(stamp: dict[str, Any]) -> None:
    refusal = stamp["refusal"]
    assert refusal(words(stamp, "1.2.3", "somebody"), "v1.2.3") == ""
    assert "is not v1.2.3" in refusal(words(stamp, "1.2.3", "somebody"), "v1.2.4")
    assert "is not v1.2.3" in refusal(words(stamp, "1.2.3", "somebody"), "1.2.3")
    assert "placeholder" in refusal(words(stamp, "1.2.3", stamp["PLACEHOLDER"]), "v1.2.3")


def test_the_names_of_images_have_no_capitals() -> None:
    assert IMAGE.islower()
    assert yaml.safe_load((REPO / "compose.yaml").read_text("utf-8"))["services"]["gpsfsm"][
        "image"
    ].startswith(f"{IMAGE}:{VERSION}")
