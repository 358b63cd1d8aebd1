"""Our own workflows: their steps run as they stand, and nothing is released without all of them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import pytest
import yaml

from gpsfsm.version import IMAGE, OWNER, VERSION
from tests.pipelines.support import REPO, Place, clone, git, make_place, snippets, stand_in
from tests.pipelines.workflow import run_job

if TYPE_CHECKING:
    from pathlib import Path

WORKFLOWS = REPO / ".github" / "workflows"
ACTION = yaml.safe_load((REPO / "action.yml").read_text("utf-8"))
TAG = f"v{VERSION}"
NAMES = {
    "github.actor": "somebody",
    "github.repository": "robots/gpsfsm",
    "secrets.GITHUB_TOKEN": "hidden",
}
ENV = {"GITHUB_REF_NAME": TAG}
PAGES = [*REPO.glob("*.md"), *(REPO / "docs").rglob("*.md"), *(REPO / "editors").rglob("*.md")]


def jobs(name: str) -> dict[str, dict[str, Any]]:
    results: dict[str, dict[str, Any]] = yaml.safe_load((WORKFLOWS / name).read_text("utf-8"))[
        "jobs"
    ]
    return results


def all_steps() -> list[dict[str, Any]]:
    """The steps of our workflows, of our action, and of those that the pages show."""
    steps: list[dict[str, Any]] = list(ACTION["runs"]["steps"])
    for file in WORKFLOWS.iterdir():
        steps += [step for job in jobs(file.name).values() for step in job["steps"]]
    for page in PAGES:
        for each in snippets(page):
            if each.language in ("yaml", "yml") and "uses:" in each.text:
                steps += steps_in(yaml.safe_load(each.text))
    return steps


def steps_in(value: object) -> list[dict[str, Any]]:
    if isinstance(value, dict):
        own = [value] if "uses" in value else []
        return own + [step for each in value.values() for step in steps_in(each)]
    if isinstance(value, list):
        return [step for each in value for step in steps_in(each)]
    return []


def test_every_action_has_one_version() -> None:
    used = {step["uses"] for step in all_steps() if "uses" in step}
    names = [each.partition("@")[0] for each in used]
    assert len(names) == len(set(names)), sorted(used)
    for each in used:
        assert re.fullmatch(r"[\w.-]+(/[\w.-]+)+@(v\d+(\.\d+\.\d+)?|release/v\d+)", each), each
    assert f"{OWNER}/gpsfsm@{TAG}" in used


def test_uses_of_our_action_fit_it() -> None:
    ours = [each for each in all_steps() if each.get("uses", "").startswith(f"{OWNER}/gpsfsm@")]
    assert ours
    required = {name for name, about in ACTION["inputs"].items() if about.get("required")}
    for step in ours:
        assert required <= set(step.get("with", {})) <= set(ACTION["inputs"])


@pytest.mark.parametrize("file", ["ci.yml", "release.yml"])
def test_the_rights_are_few(file: str) -> None:
    workflow = yaml.safe_load((WORKFLOWS / file).read_text("utf-8"))
    assert workflow["permissions"] == {"contents": "read"}
    may_write = {
        name: {right for right, level in job.get("permissions", {}).items() if level == "write"}
        for name, job in workflow["jobs"].items()
    }
    publishing = {
        "pypi": {"id-token"},
        "image": {"packages"},
        "docs": {"contents"},
        "release": {"contents"},
    }
    expected = publishing if file == "release.yml" else {}
    assert {name: rights for name, rights in may_write.items() if rights} == expected
    for job in workflow["jobs"].values():
        for step in job["steps"]:
            assert "${{" not in step.get("run", ""), "an expression would be a part of the script"


def test_nothing_is_published_before_all_is_tested() -> None:
    release = jobs("release.yml")

    def before(name: str) -> set[str]:
        needed = release[name].get("needs", [])
        direct = {needed} if isinstance(needed, str) else set(needed)
        return direct.union(*map(before, direct))

    for name, job in release.items():
        if "permissions" in job:
            assert {"test", "build"} <= before(name)
    assert before("release") == set(release) - {"release"}
    for job in (release["test"], jobs("ci.yml")["everything"]):
        assert ".ci/run" in job["steps"][-1]["run"].split()
    assert all("continue-on-error" not in step for step in all_steps())


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A clone whose owner is decided."""
    folder = clone(tmp_path_factory.mktemp("published"))
    file = folder / "gpsfsm" / "version.py"
    text = file.read_text("utf-8").replace(f'OWNER = "{OWNER}"', 'OWNER = "Robots"')
    file.write_text(text, encoding="utf-8")
    subprocess.run([sys.executable, "packaging/stamp.py"], cwd=folder, check=True)
    return folder


def machine(tmp_path: Path, source: Path) -> Place:
    """A machine of the workflow, on which nothing reaches beyond it."""
    place = make_place(tmp_path, plans={})
    git(tmp_path, "clone", "-q", source, place.folder)
    for name in git(source, "ls-files", "--modified").splitlines():
        (place.folder / name).write_bytes((source / name).read_bytes())
    for name in ("docker", "gh", "mike"):
        stand_in(place, name)
    stand_in(place, "make", "mkdir -p build/vscode; echo vsix > build/vscode/gpsfsm.vsix")
    real = f'PYTHONPATH= exec "{sys.executable}" "$@"'
    built = "mkdir dist; echo sdist > dist/gpsfsm.tar.gz; echo wheel > dist/gpsfsm.whl"
    stand_in(
        place,
        "python",
        f'case "$1 $2" in "-m build") {built};; "-m pip") ;; *) {real};; esac',
    )
    return place


def log(place: Place, name: str) -> list[str]:
    file = place.programs / f"{name}.log"
    return file.read_text("utf-8").splitlines() if file.exists() else []


@pytest.mark.packages
def test_what_is_built(tmp_path: Path, published: Path) -> None:
    place = machine(tmp_path, published)
    ran = run_job(jobs("release.yml")["build"], place, NAMES, ENV)
    assert not ran.failed, ran.log
    assets = place.folder / "assets"
    names = {"gpsfsm.whl", "gpsfsm.tar.gz", "gpsfsm.vsix", "compose.yaml", "gpsfsm.service"}
    names |= {"constraints.txt", "SHA256SUMS"}
    assert {file.name for file in assets.iterdir()} == names
    sums = subprocess.run(["sha256sum", "-c", "SHA256SUMS"], cwd=assets, check=False)
    assert sums.returncode == 0
    assert len((assets / "SHA256SUMS").read_text("utf-8").splitlines()) == len(names) - 1
    uploaded = [value for name, value in ran.used if name.startswith("actions/upload-artifact@")]
    assert [each["path"] for each in uploaded] == ["dist", "assets"]
    assert log(place, "make") == ["extension"]


@pytest.mark.packages
@pytest.mark.parametrize("tag", ["v0.0.1", VERSION, ""])
def test_another_tag_builds_nothing(tmp_path: Path, published: Path, tag: str) -> None:
    place = machine(tmp_path, published)
    ran = run_job(jobs("release.yml")["build"], place, NAMES, {"GITHUB_REF_NAME": tag})
    assert ran.failed
    assert f"is not {TAG}" in ran.log
    assert not (place.folder / "dist").exists()


@pytest.mark.packages
def test_nothing_is_released_while_nobody_owns_it(tmp_path: Path) -> None:
    place = machine(tmp_path, clone(tmp_path / "source"))
    ran = run_job(jobs("release.yml")["build"], place, NAMES, ENV)
    assert ran.failed
    assert "placeholder" in ran.log


def test_the_image_is_tried_and_published(tmp_path: Path, published: Path) -> None:
    place = machine(tmp_path, published)
    ran = run_job(jobs("release.yml")["image"], place, NAMES, ENV)
    assert not ran.failed, ran.log
    name = IMAGE.replace(OWNER.lower(), "robots")
    assert log(place, "docker") == [
        f"build --tag {name}:{VERSION} --tag {name}:latest .",
        f"run --rm {name}:{VERSION} --version",
        "login ghcr.io --username somebody --password-stdin",
        f"push {name}:{VERSION}",
        f"push {name}:latest",
    ]


def test_the_site_and_the_release(tmp_path: Path, published: Path) -> None:
    place = machine(tmp_path, published)
    assert not run_job(jobs("release.yml")["docs"], place, NAMES, ENV).failed
    assert log(place, "mike") == [
        f"deploy --push --update-aliases {VERSION} latest",
        "set-default --push latest",
    ]
    (place.folder / "assets").mkdir()
    (place.folder / "assets" / "gpsfsm.whl").touch()
    assert not run_job(jobs("release.yml")["release"], place, NAMES, ENV).failed
    (call,) = log(place, "gh")
    assert call == f"release create {TAG} --verify-tag --generate-notes assets/gpsfsm.whl"


def test_every_python_that_is_promised_is_tried() -> None:
    text = (REPO / "pyproject.toml").read_text("utf-8")
    promised = re.findall(r'"Programming Language :: Python :: (3\.\d+)"', text)
    everything, quick = jobs("ci.yml")["everything"], jobs("ci.yml")["pythons"]
    assert everything["container"] == f"python:{promised[0]}-bookworm"
    assert quick["strategy"]["matrix"]["python"] == promised[1:]
    assert f'requires-python = ">={promised[0]}"' in text
    first = " ".join((REPO / "docs" / "install.md").read_text("utf-8").split())
    assert f"with Python {', '.join(promised[:-1])} and {promised[-1]}: all of them with" in first


@pytest.mark.parametrize(("newer", "taken"), [(0, "python3.12"), (127, "")])
def test_make_takes_a_python_that_starts(tmp_path: Path, newer: int, taken: str) -> None:
    """None that is too old, and none that is only a name, as pyenv has them."""
    codes = {"python3.11": 127, "python3": 1, "python3.12": newer, "python3.13": 127}
    for name, code in (codes | {"python3.14": 127}).items():
        (tmp_path / name).write_text(f"#!/bin/sh\nexit {code}\n", encoding="utf-8")
        (tmp_path / name).chmod(0o755)
    environment = {"PATH": f"{tmp_path}:{os.environ['PATH']}"}
    command = ["make", "--dry-run", "newest"]
    done = subprocess.run(command, cwd=REPO, env=environment, capture_output=True, check=False)
    if taken:
        assert done.stdout.decode().startswith(f"{taken} -m venv ")
    else:
        assert "gpsfsm needs Python 3.11 or newer" in done.stderr.decode()


def test_continuous_integration_calls_what_is_there() -> None:
    makefile = (REPO / "Makefile").read_text("utf-8")
    for job in jobs("ci.yml").values():
        for step in job["steps"]:
            for target in re.findall(r"^make (\S+)$", step.get("run", ""), re.MULTILINE):
                assert f"\n{target.replace('.venv', '$(VENV)')}:" in makefile
            for file in re.findall(r"tests/\S+\.py|\.ci/run", step.get("run", "")):
                assert (REPO / file).is_file()
