"""Each block of README.md and docs/ has a fate: run, compiled, read, or listed with a reason."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from typing import Any

import pytest

from gpsfsm.version import REPOSITORY

REPO = Path(__file__).parents[1]


def _blocks() -> Any:
    spec = importlib.util.spec_from_file_location("docs_blocks", REPO / "docs" / "blocks.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


BLOCKS = _blocks()
PAGES = [file for file in BLOCKS.documents(REPO) if file.parent.name != "rules"]
RULES = [file for file in BLOCKS.documents(REPO) if file.parent.name == "rules"]


def complaints(files: list[Path]) -> list[str]:
    return [
        f"{fence.page}:{fence.line}: {problem}"
        for file in files
        for fence in BLOCKS.fences(file)
        for problem in BLOCKS.problems(fence)
    ]


@pytest.mark.commands
@pytest.mark.parametrize("page", PAGES, ids=lambda file: file.relative_to(REPO).as_posix())
def test_blocks_are_as_they_should_be(page: Path) -> None:
    assert complaints([page]) == []


def test_blocks_of_rules_can_be_read() -> None:
    assert complaints(RULES) == []


def test_every_exception_is_needed() -> None:
    """No reason stands in a table for what is not there any more."""
    fences = [fence for file in BLOCKS.documents(REPO) for fence in BLOCKS.fences(file)]
    assert {fence.language for fence in fences} >= set(BLOCKS.ELSEWHERE)
    scripts = [each for f in fences if f.language == "sh" for each in BLOCKS.commands(f.text)]
    used = {BLOCKS.reason_not_run(command) for command in scripts}
    assert used - {""} == set(BLOCKS.NOT_RUN)
    python = {(fence.page, fence.number) for fence in fences if fence.language == "python"}
    assert set(BLOCKS.FRAGMENTS) <= python
    assert {(fence.page, fence.language) for fence in fences} >= set(BLOCKS.WHOLE)
    assert all(
        [
            *BLOCKS.NOT_RUN.values(),
            *BLOCKS.FRAGMENTS.values(),
            *BLOCKS.ELSEWHERE.values(),
            *BLOCKS.WHOLE.values(),
        ]
    )


def test_most_commands_are_run() -> None:
    scripts = [
        command
        for file in PAGES
        for fence in BLOCKS.fences(file)
        if fence.language == "sh"
        for command in BLOCKS.commands(fence.text)
    ]
    run = [command for command in scripts if not BLOCKS.reason_not_run(command)]
    assert len(run) > 80
    assert any(each.startswith(f"git clone {REPOSITORY}") for each in run)


@pytest.mark.commands
@pytest.mark.parametrize(
    ("language", "text", "complaint"),
    [
        ("sh", "gpsfsm check nowhere.xml", "exit code"),
        ("sh", "false", "exit code 1"),
        ("sh", "gpsfsm serve --no-such-option", "No such option"),
        ("sh", "gpsfsm serve --journal /nowhere/q.db", "/nowhere/q.db: the journal cannot be"),
        ("sh", "gpsfsm generate 'go' --model ollama:nobody", "there is no model 'nobody'"),
        ("sh", "gpsfsm resume run.db --run 7", "run 7"),
        ("sh", "curl localhost:8321/v1/nowhere", "there is nothing here"),
        ("sh", 'TOKEN=x\ncurl -H "Authorization: Bearer $TOKEN" localhost:8321/v1/runs', "Unautho"),
        ("sh", "gpsfsm run plan.xml --real --nope", "No such option"),
        ("sh", "pip install 'gpsfsm[nothing]'", "no extra 'nothing'"),
        ("python", "import gpsfsm\ngpsfsm.nothing()", "AttributeError"),
        ("python", "if", "SyntaxError"),
        ("pycon", ">>> 1 + 1\n3", "Expected"),
        ("xml", "<Plan>", "XMLSyntaxError"),
        ("xml", "<Plan><Control/></Plan>", "GP107"),
        ("json", "{", "JSONDecodeError"),
        ("yaml", "a: [", "ParserError"),
        ("yaml", "name: lab\nmap: {x: [1, 0], y: [0, 1]}", "error"),
        ("toml", "ignore = 3", "ignore"),
        ("cobol", "", "nothing checks blocks"),
    ],
)
def test_a_wrong_block_is_noticed(tmp_path: Path, language: str, text: str, complaint: str) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# Page\n\n```{language}\n{text}\n```\n", encoding="utf-8")
    assert complaint in "\n".join(complaints([page]))


@pytest.mark.commands
@pytest.mark.parametrize(
    ("language", "text"),
    [
        ("sh", "gpsfsm check plan.xml  # a comment\ngpsfsm serve --journal queue.db"),
        ("sh", "gpsfsm check \\\n  plan.xml"),
        ("sh", "gpsfsm resume run.db > out.txt\ngrep -q COMPLETED out.txt"),
        ("sh", "gpsfsm generate 'go' --model openai:gpt-5 -o new.xml\ntest -s new.xml"),
        ("sh", "curl localhost:8321/v1/rules > rules.json\ngrep -q GP303 rules.json"),
        ("sh", f"git clone --quiet --depth 1 {REPOSITORY} && test -d gpsfsm"),
        ("python", "import gpsfsm\nassert gpsfsm.check('plan.xml').ok"),
        ("toml", 'ignore = ["GP302"]'),
        ("json", '{"a": 1}\n{"b": 2}'),
        ("lua", "anything"),
    ],
)
def test_a_right_block_passes(tmp_path: Path, language: str, text: str) -> None:
    page = tmp_path / "page.md"
    page.write_text(f"# Page\n\n  ```{language}\n{text}\n  ```\n", encoding="utf-8")
    assert complaints([page]) == []
