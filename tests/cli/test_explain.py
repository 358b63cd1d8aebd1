"""``gpsfsm explain`` and the pages made of the catalogue."""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.analysis.rules import Rule, all_rules, rule, rules_of_engines, rules_of_plans
from gpsfsm.cli import main
from gpsfsm.model.finding import Confidence, Severity
from gpsfsm.report._rule_docs import rule_markdown, rules_index_markdown
from tests.cli.support import TIMEOUT_S, environment

if TYPE_CHECKING:
    from types import ModuleType

GENERATOR = Path(__file__).parents[2] / "docs" / "generate.py"


def shown(*arguments: str, capsys: pytest.CaptureFixture[str]) -> str:
    assert main(["explain", *arguments]) == 0
    return capsys.readouterr().out


def test_the_table_has_every_rule(capsys: pytest.CaptureFixture[str]) -> None:
    lines = shown(capsys=capsys).splitlines()
    assert [line.split()[:3] for line in lines] == [
        [each.code, each.name, each.severity.value] for each in all_rules()
    ]
    assert all(line.endswith(each.summary) for line, each in zip(lines, all_rules(), strict=True))


def test_a_prefix_lists_its_family(capsys: pytest.CaptureFixture[str]) -> None:
    for prefix in ("GP4", "gp3"):
        codes = [line.split()[0] for line in shown(prefix, capsys=capsys).splitlines()]
        family = [each.code for each in all_rules() if each.code.startswith(prefix.upper())]
        assert codes == family
        assert len(family) > 1


@pytest.mark.parametrize("one_rule", all_rules(), ids=lambda one_rule: one_rule.code)
def test_a_rule_is_explained(one_rule: Rule, capsys: pytest.CaptureFixture[str]) -> None:
    by_code = shown(one_rule.code.lower(), capsys=capsys)
    assert shown(one_rule.name.upper(), capsys=capsys) == by_code
    assert by_code.startswith(f"{one_rule.code} {one_rule.name} ({one_rule.severity.value}, ")
    flat = " ".join(by_code.split())
    for part in (one_rule.summary, one_rule.why, one_rule.fix, one_rule.severities):
        assert " ".join(part.split()) in flat
    assert all(line.isprintable() for line in by_code.splitlines())
    assert max(map(len, by_code.splitlines())) < 4100


def test_json(capsys: pytest.CaptureFixture[str]) -> None:
    several = json.loads(shown("--format", "json", capsys=capsys))
    assert [each["code"] for each in several] == [each.code for each in all_rules()]
    one = json.loads(shown("GP302", "--format", "json", capsys=capsys))
    assert one == next(each for each in several if each["code"] == "GP302")
    assert one["bad"] == rule("GP302").bad


def test_markdown(capsys: pytest.CaptureFixture[str]) -> None:
    assert shown("--format", "markdown", capsys=capsys) == rules_index_markdown(all_rules())
    page = shown("dangling-failure", "--format", "markdown", capsys=capsys)
    assert page == rule_markdown(rule("GP302"))


@pytest.mark.parametrize(
    ("wanted", "hint"),
    [
        ("gp30", "did you mean GP301 or GP302 or GP303?"),
        ("GP999", "did you mean GP9"),
        ("dangling-failures", "did you mean dangling-failure?"),
        ("dangling", "did you mean dangling-failure?"),
        ("", "'gpsfsm explain' lists all rules"),
        ("quux", "'gpsfsm explain' lists all rules"),
    ],
)
def test_an_unknown_rule(wanted: str, hint: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", wanted]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith(f"gpsfsm: there is no rule '{wanted}'; {hint}")


def test_several_rules(capsys: pytest.CaptureFixture[str]) -> None:
    both = shown("GP302", "GP303", capsys=capsys)
    assert both == f"{shown('gp302', capsys=capsys)}\n{shown('join-deadlock', capsys=capsys)}"
    assert shown("gp302,GP303", capsys=capsys) == both
    listed = json.loads(shown("GP302", "GP303", "--format", "json", capsys=capsys))
    assert [each["code"] for each in listed] == ["GP302", "GP303"]


def test_rule_is_a_hidden_alias(capsys: pytest.CaptureFixture[str]) -> None:
    explained = shown("GP303", capsys=capsys)
    assert main(["rule", "GP303"]) == 0
    assert capsys.readouterr().out == explained
    assert main(["--help"]) == 0
    assert "\n  rule " not in capsys.readouterr().out


class TestMarkdown:
    def rule(self, **parts: Any) -> Rule:
        texts = {"summary": "s", "why": "w", "fix": "f", "bad": "<Plan/>", "good": "<Plan/>"}
        heuristic = {"severity": Severity.INFO, "confidence": Confidence.HEURISTIC}
        return Rule(code="GP399", name="example", **(heuristic | texts | parts))

    def test_sentences(self) -> None:
        page = rule_markdown(self.rule(why="a <Control> holds *.xml, `<Runner>`", fix="do it!"))
        assert "\nA \\<Control> holds \\*.xml, `<Runner>`.\n" in page
        assert "\nDo it!\n" in page
        assert "heuristic" in page

    def test_examples_stay_in_their_block(self) -> None:
        page = rule_markdown(self.rule(bad="````\n# no title\n\x1b[31m\x00\tend"))
        assert "`````xml\n````\n# no title\n\\x1b[31m\\x00    end\n`````\n" in page

    def test_examples_may_be_empty_or_huge(self) -> None:
        assert "\nNo plan triggers it by itself." in rule_markdown(self.rule(bad=""))
        assert len(rule_markdown(self.rule(bad="x" * 10**6))) < 10_000

    def test_options_are_quoted(self) -> None:
        one_rule = Rule("GP399", "x", Severity.INFO, "s", "w", "f", "b", "g", ("--assume", "a b"))
        assert "`gpsfsm check --assume 'a b' plan.xml` finds it here" in rule_markdown(one_rule)

    @pytest.mark.parametrize(
        ("code", "file"), [("GP307", "plan.xml"), ("GP808", "tree.xml"), ("GP313", "machine.json")]
    )
    def test_the_file_of_an_example_is_named_after_its_kind(self, code: str, file: str) -> None:
        assert f"{file}` finds it here" in rule_markdown(rule(code))

    def test_how_to_allow(self) -> None:
        assert "<!-- gpsfsm: ignore GP302 because … -->" in rule_markdown(rule("GP302"))
        assert "cannot be ignored" in rule_markdown(rule("GP903"))

    def test_the_index(self) -> None:
        index = rules_index_markdown([self.rule(summary="a | b")])
        assert "## GP3xx: Control flow" in index
        assert "| [GP399](GP399.md) | example | info | a \\| b |" in index


def load_generator() -> ModuleType:
    spec = importlib.util.spec_from_file_location("docs_generate", GENERATOR)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


class TestPages:
    def test_are_written_compared_and_deleted(self, tmp_path: Path) -> None:
        generator = load_generator()
        generator.write(tmp_path / "rules")
        assert generator.differing(tmp_path / "rules") == []
        (tmp_path / "rules" / "GP302.md").write_text("old", encoding="utf-8")
        (tmp_path / "rules" / "GP000.md").write_text("gone", encoding="utf-8")
        (tmp_path / "rules" / "index.md").unlink()
        assert generator.differing(tmp_path / "rules") == ["GP000.md", "GP302.md", "index.md"]
        generator.write(tmp_path / "rules")
        assert generator.differing(tmp_path / "rules") == []

    def test_of_the_repository_are_current(self) -> None:
        done = subprocess.run(
            [sys.executable, str(GENERATOR), "--check"],
            env=environment(),
            capture_output=True,
            timeout=TIMEOUT_S,
            check=False,
        )
        assert (done.returncode, done.stdout) == (0, b"")


def test_rules_are_looked_up_by_the_names_of_their_files() -> None:
    assert rules_of_plans() == tuple(each for each in all_rules() if each.find is not None)
    assert rules_of_engines() == tuple(each for each in all_rules() if each.find_on_engine)
    for each in all_rules():
        assert rule(each.code.lower()) is rule(each.name) is each
