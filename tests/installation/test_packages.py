"""The sdist and the wheel are complete, and docs/install.md installs them as it says."""

from __future__ import annotations

import re
import sys
import tarfile
import tomllib
import zipfile
from email.parser import Parser
from pathlib import Path
from runpy import run_path
from typing import Any

import pytest

from gpsfsm.version import REPOSITORY, VERSION
from tests.installation.support import PAGE, Released, run, section
from tests.pipelines.support import REPO, snippets

PROJECT: dict[str, Any] = tomllib.loads((REPO / "pyproject.toml").read_text("utf-8"))
PLAN = REPO / "corpus" / "plans" / "patrol.xml"
IN_SDIST = ("CHANGELOG.md", "LICENSE", "README.md", "pyproject.toml", "setup.py")
NOT_FOR_USERS = {"dev", "docs"}
RUN = {"pipx", "uv", "pip", "Offline", "Source", "Releases"}
"""The sections whose commands are run here."""
RUN_ELSEWHERE = {"Container", "systemd"}
"""Those that need an engine or root: by test_container.py and test_unit.py, line by line."""


def test_every_command_of_the_page_is_run_somewhere() -> None:
    text = PAGE.read_text("utf-8")
    headings = re.findall(r"^## (.+)$", text, re.MULTILINE)
    shown = {
        each
        for each in headings
        if "```sh" in text.partition(f"\n## {each}\n")[2].partition("\n## ")[0]
    }
    assert shown == RUN | RUN_ELSEWHERE
    languages = {each.language for each in snippets(PAGE)}
    assert languages == {"sh", "console", "ini"}


def test_every_extra_is_explained() -> None:
    rows = set(re.findall(r"^\| `(\w+)` \|", section_of("Extras"), re.MULTILINE))
    assert rows == set(PROJECT["project"]["optional-dependencies"]) - NOT_FOR_USERS


def long_description() -> str:
    made: str = run_path(str(REPO / "setup.py"))["long_description"]()
    return made


def section_of(heading: str) -> str:
    return PAGE.read_text("utf-8").partition(f"\n## {heading}\n")[2].partition("\n## ")[0]


def packaged() -> dict[str, str]:
    """Every file that is to be installed: its place in the tree → its place in the wheel."""
    setup = PROJECT["tool"]["setuptools"]
    files = {}
    for package in setup["packages"]:
        inner = package.replace(".", "/")
        folder = setup["package-dir"].get(package, inner)
        for pattern in ("*.py", *setup["package-data"].get(package, ())):
            for file in (REPO / folder).glob(pattern):
                name = file.relative_to(REPO / folder).as_posix()
                files[f"{folder}/{name}"] = f"{inner}/{name}"
    return files


@pytest.mark.packages
def test_both_packages_hold_every_file(released: Released) -> None:
    """And the sdist no tests, which would lack their helpers."""
    files = packaged()
    with tarfile.open(released.sdist) as archive:
        within = {member.name.partition("/")[2] for member in archive if member.isfile()}
    assert {*files, *IN_SDIST} - within == set()
    assert {name for name in within if name.startswith("tests/")} == set()
    with zipfile.ZipFile(released.wheel) as archive:
        names = archive.namelist()
        (metadata,) = (name for name in names if name.endswith(".dist-info/METADATA"))
        about = Parser().parsestr(archive.read(metadata).decode("utf-8"))
    data = f"gpsfsm-{VERSION}.data/data/share/man/man1/"
    pages = {f"{data}{file.name}" for file in (REPO / "man").iterdir()}
    assert {name for name in names if ".dist-info/" not in name} == {*files.values(), *pages}
    assert any(name.endswith("/LICENSE") for name in names)
    assert about["Version"] == VERSION
    assert f"Source, {REPOSITORY}" in about.get_all("Project-URL", [])
    assert about["License-Expression"] == "Apache-2.0"
    assert about["Description-Content-Type"] == "text/markdown"
    assert about.get_payload() == long_description()


def test_the_page_on_an_index_has_no_relative_links() -> None:
    """Its links and pictures are files of the repository, in this version."""
    text = re.sub(r"^```.*?^```$", "", long_description(), flags=re.MULTILINE | re.DOTALL)
    targets = re.findall(r"\]\(([^)\s]+)|(?:src|href)=\"?([^\s\">]+)", text)
    actual = [one or other for one, other in targets]
    assert [each for each in actual if not re.match("https://", each)] == []
    ours = [
        re.fullmatch(rf"{REPOSITORY}/(raw|blob)/v{re.escape(VERSION)}/([^#]+)(#.*)?", each)
        for each in actual
        if each.startswith(f"{REPOSITORY}/")
    ]
    assert len(ours) > 5
    assert all(each and (REPO / each[2]).is_file() for each in ours)
    pictures = [each[2] for each in ours if each and each[1] == "raw"]
    assert pictures == re.findall(r"!\[[^]]*\]\(([^)]+)\)", (REPO / "README.md").read_text("utf-8"))


@pytest.mark.packages
def test_the_wheel_works_where_nothing_else_is(released: Released, tmp_path: Path) -> None:
    assert run(sys.executable, "-m", "venv", tmp_path / "env", cwd=tmp_path).returncode == 0
    python, gpsfsm = tmp_path / "env" / "bin" / "python", tmp_path / "env" / "bin" / "gpsfsm"

    def call(*words: str | Path, expect: int = 0) -> str:
        done = run(*words, cwd=tmp_path)
        assert done.returncode == expect, done.stdout + done.stderr
        return done.stdout

    call(python, "-m", "pip", "install", "-q", released.wheel)
    call(python, "-c", "import gpsfsm.analysis, gpsfsm.grammars, gpsfsm.runners")
    call(python, "-c", "import analysis", expect=1)
    report = call(gpsfsm, "check", PLAN, "--format", "json")
    assert re.search(r'"version": ?3', report)
    assert '"GP210"' not in report, "it knows none of the runners that it comes with"
    call(gpsfsm, "capabilities", "show", "WaypointRunner")
    call(python, "-c", "from gpsfsm.grammars import relax_ng; relax_ng()")
    call(gpsfsm, "check", PLAN, "--assume", "never fails: SpeechRunner")


@pytest.mark.packages
@pytest.mark.parametrize("heading", ["pipx", "uv"])
def test_tools(released: Released, tools: Path, tmp_path: Path, heading: str) -> None:
    done = released.shell(section(heading), tmp_path, programs=[tools])
    assert done.returncode == 0, done.stdout + done.stderr
    assert (f"gpsfsm {VERSION}\n" in done.stdout) is (heading == "uv")  # uvx --version
    left = "gpsfsm --version\ngpsfsm serve --help > /dev/null\ngpsfsm lsp < /dev/null\n"
    used = released.shell(left, tmp_path)
    assert used.returncode == 0, used.stdout + used.stderr
    assert used.stdout.splitlines()[0] == f"gpsfsm {VERSION}"
    (removal,) = re.findall(rf"^\| {heading} \| `(.+?)` \|$", PAGE.read_text("utf-8"), re.MULTILINE)
    assert released.shell(removal, tmp_path, programs=[tools]).returncode == 0
    assert not (tmp_path / ".local" / "bin" / "gpsfsm").exists()


@pytest.mark.packages
def test_pip(released: Released, tmp_path: Path) -> None:
    script = section("pip") + "gpsfsm --version\npip list --format freeze\npip check\n"
    done = released.shell(script, tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    assert {f"gpsfsm {VERSION}", f"gpsfsm=={VERSION}"} <= set(lines)
    pinned = {
        line.lower().replace("_", "-")
        for line in (REPO / "constraints.txt").read_text("utf-8").splitlines()
    }
    listed = [line for line in lines if re.fullmatch(r"[\w.-]+==\S+", line)]
    installed = {line.lower().replace("_", "-") for line in listed}
    apart = ("gpsfsm==", "pip==", "setuptools==")
    assert {each for each in installed if not each.startswith(apart)} <= pinned


@pytest.mark.packages
def test_offline(released: Released, tmp_path: Path) -> None:
    """The second part without any index, in a folder that has the wheels only."""
    before, _, after = section("Offline").partition("python3 -m venv")
    done = released.shell(before, tmp_path / "online")
    assert done.returncode == 0, done.stdout + done.stderr
    target = tmp_path / "offline"
    target.mkdir()
    (tmp_path / "online" / "wheelhouse").rename(target / "wheelhouse")
    nowhere = "export PIP_CONFIG_FILE=/dev/null PIP_INDEX_URL=http://127.0.0.1:9 PIP_FIND_LINKS=\n"
    script = f"{nowhere}python3 -m venv{after}.venv/bin/gpsfsm serve --help\n"
    done = released.shell(script, target)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.packages
def test_source(released: Released, tools: Path, tmp_path: Path) -> None:
    done = released.shell(section("Source"), tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "tour_guide.xml: rejected" in done.stdout
    assert (tmp_path / "gpsfsm" / ".venv" / "bin" / "gpsfsm").exists()
    text = section_of("Source")
    for command in re.findall(r"`((?:pipx|uv tool) install \.)`", text):
        done = released.shell(f"cd gpsfsm\n{command}\ngpsfsm --version", tmp_path, programs=[tools])
        assert done.stdout.splitlines()[-1] == f"gpsfsm {VERSION}", done.stdout + done.stderr
        released.shell("pipx uninstall gpsfsm || true", tmp_path, programs=[tools])


@pytest.mark.packages
def test_sums(released: Released, tmp_path: Path) -> None:
    (tmp_path / "constraints.txt").write_bytes((released.assets / "constraints.txt").read_bytes())
    done = released.shell(section("Releases"), tmp_path)
    assert (done.returncode, done.stdout) == (0, "constraints.txt: OK\n")
    (tmp_path / "constraints.txt").write_text("something-else==1.0\n")
    assert released.shell(section("Releases"), tmp_path).returncode == 1
