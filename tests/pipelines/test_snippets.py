"""Every snippet of docs/gate.md is run: what it says is what happens."""

from __future__ import annotations

import json
import re
import shlex
from typing import TYPE_CHECKING, Any

import pytest
import yaml
from lxml import etree

from gpsfsm.version import OWNER, VERSION
from tests.cli.support import ACCEPTED, REJECTED
from tests.forked import run_forked
from tests.pipelines.support import BAD, GOOD, REPO, Place, Snippet, git, make_place, snippets
from tests.pipelines.workflow import run_action

if TYPE_CHECKING:
    import subprocess
    from pathlib import Path

PAGE = REPO / "docs" / "gate.md"
SNIPPETS = snippets(PAGE)
HOOKS_FILE = REPO / ".pre-commit-hooks.yaml"
HOOKS = {each["id"]: each for each in yaml.safe_load(HOOKS_FILE.read_text("utf-8"))}


def snippet(file: str) -> Snippet:
    (result,) = (each for each in SNIPPETS if each.file == file)
    return result


def test_no_snippet_is_left_out() -> None:
    """Blocks with commands are run by tests/test_docs.py."""
    others = [each for each in SNIPPETS if each.language not in ("console", "python")]
    files = {".pre-commit-config.yaml", ".github/workflows/plans.yml", ".gitlab-ci.yml"}
    assert {each.file for each in others} == {*files, "Jenkinsfile", ""}
    assert [each.language for each in others if not each.file] == ["sh"]
    assert len(others) == 5
    assert sum(each.language == "python" for each in SNIPPETS) == len(PRINTED)
    fences = re.findall(r"^```\w*$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert len(fences) == 2 * len(SNIPPETS)


PRINTED = [
    (
        {"plans/patrol.xml": ACCEPTED},
        {"plans/patrol.xml": REJECTED},
        r"dispatch \d+ bytes\n",
        r"rejected: findings 1 finding of level error or worse\n",
    ),
    (
        {"plans/patrol.xml": ACCEPTED, "plans/rounds.xml": REJECTED},
        {"plans/patrol.xml": "<Plan>", "plans/rounds.xml": ACCEPTED},
        r"plans/patrol.xml accepted \(.*\)\nplans/rounds.xml rejected: findings\n",
        r"plans/patrol.xml rejected: findings\nplans/rounds.xml accepted \(.*\)\n",
    ),
]


@pytest.mark.parametrize("number", range(len(PRINTED)))
def test_python(tmp_path: Path, number: int) -> None:
    text = [each.text for each in SNIPPETS if each.language == "python"][number]
    first, second, message, messages = PRINTED[number]
    for name, plans, notice in (("one", first, message), ("two", second, messages)):
        place = make_place(tmp_path / name, plans=plans)
        (place.folder / "shown.py").write_text(text, encoding="utf-8")
        done = run_forked(
            [],
            cwd=place.folder,
            stdin=b"",
            environment=place.environment(),
            timeout_s=60,
            module="shown",
        )
        assert (done.returncode, done.stderr) == (0, b"")
        assert re.fullmatch(notice, done.stdout.decode())


def pre_commit(place: Place, config: dict[str, Any]) -> subprocess.CompletedProcess[str]:
    """Call a hook as pre-commit does: its entry, the arguments, then the files that fit."""
    ((wanted,),) = (repo["hooks"] for repo in config["repos"])
    hook = HOOKS[wanted["id"]] | wanted
    assert hook["language"] == "python"
    assert hook["types"] == ["xml"]
    names = sorted(
        str(file.relative_to(place.folder))
        for file in place.folder.rglob("*.xml")
        if file.is_file()
    )
    files = [name for name in names if re.search(hook.get("files", ""), name)]
    words = [*shlex.split(hook["entry"]), *hook.get("args", []), *files]
    return place.bash(shlex.join(words))


@pytest.mark.parametrize(("plans", "code"), [(GOOD, 0), (BAD, 1), (GOOD | {"plans/c.xml": ""}, 1)])
def test_pre_commit(tmp_path: Path, plans: dict[str, str], code: int) -> None:
    other = {"pom.xml": "<project/>"}  # is no plan, and `files` leaves it out
    place = make_place(tmp_path, plans=dict(plans) | other)
    config = yaml.safe_load(snippet(".pre-commit-config.yaml").text)
    done = pre_commit(place, config)
    assert done.returncode == code, done.stdout + done.stderr
    assert "pom.xml" not in done.stdout
    config["repos"][0]["hooks"] = [{"id": "gpsfsm-check", "files": "^plans/"}]
    assert pre_commit(place, config).returncode == code


def test_a_git_hook(tmp_path: Path) -> None:
    """Git calls it, and what it judges is what would be committed."""
    place = make_place(tmp_path, plans=GOOD)
    (script,) = (each.text for each in SNIPPETS if each.language == "sh")
    git(place.folder, "init", "-q")
    hook = place.folder / ".git" / "hooks" / "pre-commit"
    hook.parent.mkdir(exist_ok=True)
    hook.write_text(script, encoding="utf-8")
    hook.chmod(0o755)
    person = "-c user.name=Somebody -c user.email=somebody@example.org"

    def commit(plan: str, staged: str) -> subprocess.CompletedProcess[str]:
        file = place.folder / "plans" / "a b.xml"
        file.write_text(staged, encoding="utf-8")
        git(place.folder, "add", "--all")
        file.write_text(plan, encoding="utf-8")
        return place.bash(f"git {person} commit -q -m 'A plan'")

    refused = commit(ACCEPTED, staged=REJECTED)
    assert refused.returncode == 1
    assert "plans/a b.xml: rejected: findings" in refused.stdout + refused.stderr
    accepted = commit(REJECTED, staged=ACCEPTED)
    assert accepted.returncode == 0, accepted.stderr
    git(place.folder, "rm", "-q", "--cached", "plans/a.xml")
    done = place.bash(f"git {person} commit -q -m 'No plan'")
    assert done.returncode == 0, done.stderr


def test_the_hooks_have_what_pre_commit_asks_for() -> None:
    for hook in HOOKS.values():
        assert {"id", "name", "entry", "language"} <= set(hook)
        assert hook["entry"].split()[0] == "gpsfsm"


@pytest.mark.parametrize(("plans", "failed"), [(GOOD, False), (BAD, True)])
def test_github(tmp_path: Path, plans: dict[str, str], failed: bool) -> None:
    workflow = yaml.safe_load(snippet(".github/workflows/plans.yml").text)
    assert workflow["permissions"]["security-events"] == "write"
    (job,) = workflow["jobs"].values()
    checkout, ours = job["steps"]
    assert checkout["uses"].startswith("actions/checkout@")
    assert ours["uses"] == f"{OWNER}/gpsfsm@v{VERSION}"
    ran = run_action(REPO / "action.yml", make_place(tmp_path, plans=plans), ours["with"])
    assert ran.failed is failed, ran.log
    assert ran.outputs["accepted"] == str(not failed).lower()


@pytest.mark.parametrize(("plans", "code"), [(GOOD, 0), (BAD, 1)])
def test_gitlab(tmp_path: Path, plans: dict[str, str], code: int) -> None:
    place = make_place(tmp_path, plans=plans)
    (job,) = yaml.safe_load(snippet(".gitlab-ci.yml").text).values()
    done = place.bash("\n".join(job["script"]))
    assert done.returncode == code, done.stdout + done.stderr
    assert place.installed == "install gpsfsm\n"
    reports = job["artifacts"]["reports"]
    suite = etree.parse(str(place.folder / reports["junit"])).getroot()
    assert (suite.get("tests"), suite.get("failures")) == (str(len(plans)), str(code))
    quality = json.loads((place.folder / reports["codequality"]).read_text(encoding="utf-8"))
    assert any(each["severity"] == "critical" for each in quality) is (code != 0)
    assert all((place.folder / each["location"]["path"]).is_file() for each in quality)


@pytest.mark.parametrize(("plans", "code"), [(GOOD, 0), (BAD, 1)])
def test_jenkins(tmp_path: Path, plans: dict[str, str], code: int) -> None:
    text = snippet("Jenkinsfile").text
    (script,), (report,) = re.findall(r"sh '(.*)'", text), re.findall(r"junit '(.*)'", text)
    place = make_place(tmp_path, plans=plans)
    assert place.bash(script).returncode == code
    assert etree.parse(str(place.folder / report)).getroot().get("tests") == str(len(plans))
    assert text.count("{") == text.count("}")
