"""The hooks, installed by the real pre-commit from a clone, refuse a plan that is wrong."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import yaml

from tests.cli.support import ACCEPTED, REJECTED
from tests.pipelines.support import REPO, git, snippets

if TYPE_CHECKING:
    from pathlib import Path

    from tests.installation.support import Released

(CONFIG,) = (
    each.text for each in snippets(REPO / "docs" / "gate.md") if each.file.startswith(".pre-commit")
)


@pytest.mark.packages
@pytest.mark.parametrize("hook", ["gpsfsm-gate", "gpsfsm-check"])
def test_pre_commit(released: Released, tools: Path, tmp_path: Path, hook: str) -> None:
    config = yaml.safe_load(CONFIG)
    (ours,) = config["repos"]
    ours["hooks"][0]["id"] = hook
    place = tmp_path / "plans-of-a-robot"
    (place / "plans").mkdir(parents=True)
    text = CONFIG if hook == "gpsfsm-gate" else yaml.safe_dump(config)
    (place / ".pre-commit-config.yaml").write_text(text, encoding="utf-8")
    (place / "pom.xml").write_text("<project/>", encoding="utf-8")
    git(place, "init", "-q")
    person = "git -c user.name=Somebody -c user.email=somebody@example.org commit -q -m Plans"
    cache = f"export PRE_COMMIT_HOME='{tools.parent}/cache'\n"

    def commit(plan: str, before: str = "") -> tuple[int, str]:
        (place / "plans" / "a.xml").write_text(plan, encoding="utf-8")
        script = f"{cache}cd '{place}'\n{before}git add --all\n{person}"
        done = released.shell(script, tmp_path / "home", programs=[tools])
        return done.returncode, done.stdout + done.stderr

    code, output = commit(REJECTED, before="pre-commit install\n")
    assert code == 1, output
    assert "GP307" in output
    assert "pom.xml" not in output
    code, output = commit(ACCEPTED)
    assert code == 0, output
    assert "gpsfsm" in output
    assert "Passed" in output
