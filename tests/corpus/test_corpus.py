"""The corpus: every plan is judged as its sidecar says, and every rule has plans for and against.

A sidecar ``<plan>.expected.json``, or ``<plan>.<variant>.expected.json`` where one plan is checked
in several ways, holds the options, the exit code, the verdict, the facts and the findings as
(rule, line, severity). They were worked out by hand and by brute force, never copied from what
gpsfsm prints. How it is said stands in files of its own (``tests.corpus.messages``).
"""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree as ET  # our own files, so no defence is needed

import pytest

from gpsfsm.analysis.rules import Rule, all_rules
from gpsfsm.cli import main
from tests.corpus import messages
from tests.corpus.convert import MAX_RUNNERS, OracleOptions, instances, oracle_facts, oracle_plan
from tests.corpus.engines import engine_facts, engine_of

if TYPE_CHECKING:
    from collections.abc import Sequence

CORPUS = Path(__file__).parents[2] / "corpus"
README = CORPUS / "README.md"
SUFFIX = ".expected.json"
TASKS = CORPUS / "generation"
"""Tasks for models, and their answers: no plans."""


def is_machine(path: Path) -> bool:
    """True for the file of a machine, which is JSON as sidecars are."""
    return path.suffix == ".json" and path.parent.parent.name == "rules" and SUFFIX not in path.name


PLANS = sorted(
    path
    for path in CORPUS.rglob("*")
    if (path.suffix in (".xml", ".txt") or is_machine(path)) and TASKS not in path.parents
)
WITHOUT_PLANS = {"GP211", "GP214", "GP405", "GP901", "GP903", "GP908"}
"""Rules that no text of a plan can trigger: they need an unreadable file, capability files of one's
own, a behaviour tree, or a defect of gpsfsm itself."""


@dataclass(frozen=True)
class Sidecar:
    file: Path
    plan: Path
    variant: str
    expected: dict[str, Any]

    @property
    def options(self) -> list[str]:
        options: list[str] = self.expected["options"]
        return options

    @property
    def rules(self) -> set[str]:
        return {code for code, _, _ in self.expected["findings"]}

    @property
    def undecided(self) -> bool:
        """Whether a limit is hit on purpose, so that the facts are those that were found."""
        return "GP904" in self.rules

    def __str__(self) -> str:
        return f"{self.plan.relative_to(CORPUS)}{self.variant and f' [{self.variant}]'}"


def sidecars_of(plan: Path) -> list[Sidecar]:
    sidecars = []
    for file in sorted(plan.parent.glob(f"{plan.stem}.*{SUFFIX[1:]}")):
        variant = file.name.removeprefix(plan.stem).removesuffix(SUFFIX).removeprefix(".")
        sidecars.append(Sidecar(file, plan, variant, json.loads(file.read_text("utf-8"))))
    return sidecars


SIDECARS = [sidecar for plan in PLANS for sidecar in sidecars_of(plan)]


def check(paths: Sequence[Path], options: Sequence[str], report: Path) -> tuple[int, Any]:
    """Exit code and JSON report of ``gpsfsm check``."""
    fixed = ["--isolated", "--format", "json", "--output-file", str(report)]
    code = main(["check", *map(str, paths), *fixed, *options])
    return code, json.loads(report.read_text("utf-8"))


def for_oracle(sidecar: Sidecar) -> str | None:
    """The plan's text, if there are facts and an ordinary XML parser reads the text as a plan."""
    on_engine = engine_of(sidecar.options) is not None
    if sidecar.expected["facts"] is None or sidecar.undecided or on_engine:
        return None
    try:
        text = sidecar.plan.read_text("utf-8")
        oracle_plan(text)
    except (ET.ParseError, UnicodeDecodeError, ValueError):
        return None
    return text


COMPARED = [(sidecar, text) for sidecar in SIDECARS if (text := for_oracle(sidecar)) is not None]
ON_ENGINES = [
    sidecar
    for sidecar in SIDECARS
    if sidecar.expected["facts"] is not None and engine_of(sidecar.options) is not None
]
EXAMPLES = [each for each in all_rules() if each.code not in WITHOUT_PLANS]


@pytest.mark.parametrize("sidecar", SIDECARS, ids=str)
def test_a_plan_is_judged_as_its_sidecar_says(sidecar: Sidecar, tmp_path: Path) -> None:
    code, report = check([sidecar.plan], sidecar.options, tmp_path / "report.json")

    (entry,) = report["plans"]
    actual = [
        [finding["rule"], finding["location"]["line"], finding["severity"]]
        for finding in entry["findings"]
    ]
    assert actual == sidecar.expected["findings"]
    assert entry["facts"] == sidecar.expected["facts"]
    assert entry["verdict"] == sidecar.expected["verdict"]
    assert code == sidecar.expected["exit"]
    assert messages.words(entry) == messages.expected(sidecar)


@pytest.mark.parametrize(("sidecar", "text"), COMPARED, ids=str)
def test_the_facts_of_a_sidecar_are_those_of_brute_force(sidecar: Sidecar, text: str) -> None:
    assert oracle_facts(text, OracleOptions.of(sidecar.options)) == sidecar.expected["facts"]


@pytest.mark.parametrize("sidecar", ON_ENGINES, ids=str)
def test_the_facts_on_an_engine_are_those_of_brute_force(sidecar: Sidecar) -> None:
    engine = engine_of(sidecar.options)
    assert engine is not None
    facts = engine_facts(sidecar.plan.read_text("utf-8"), engine)
    expected = dict(sidecar.expected["facts"])
    expected.pop("join_deadlocks")
    assert facts == expected


def test_brute_force_judges_every_plan_of_a_task() -> None:
    judged = {sidecar.plan for sidecar, _ in COMPARED}
    assert judged >= {plan for plan in PLANS if plan.parent.name == "plans"}
    assert len(COMPARED) > len(SIDECARS) / 2


def test_brute_force_sees_contradictory_assumptions() -> None:
    contradictory = [sidecar for sidecar in SIDECARS if "GP902" in sidecar.rules]
    assert contradictory
    for sidecar in contradictory:
        text = sidecar.plan.read_text("utf-8")
        assert oracle_facts(text, OracleOptions.of(sidecar.options)) is None, sidecar


@pytest.mark.parametrize("plan", PLANS, ids=lambda plan: str(plan.relative_to(CORPUS)))
def test_a_plan_has_a_sidecar(plan: Path) -> None:
    assert sidecars_of(plan)


def test_a_sidecar_has_a_plan() -> None:
    files = set(CORPUS.rglob(f"*{SUFFIX}"))
    assert files == {sidecar.file for sidecar in SIDECARS}


@pytest.mark.parametrize("rule", EXAMPLES, ids=lambda rule: rule.code)
def test_a_rule_has_plans_for_and_against(rule: Rule) -> None:
    here = [sidecar for sidecar in SIDECARS if sidecar.plan.parent == CORPUS / "rules" / rule.code]
    failing = [sidecar for sidecar in here if sidecar.plan.name.startswith("fail-")]
    passing = [sidecar for sidecar in here if sidecar.plan.name.startswith("pass-")]
    assert failing
    assert passing
    assert len(failing) + len(passing) == len(here)
    assert all(rule.code in sidecar.rules for sidecar in failing)
    assert not any(rule.code in sidecar.rules for sidecar in passing)


def test_there_are_plans_for_rules_only() -> None:
    folders = {folder.name for folder in (CORPUS / "rules").iterdir()}
    assert folders == {rule.code for rule in EXAMPLES}


@pytest.mark.parametrize("rule", EXAMPLES, ids=lambda rule: rule.code)
def test_a_rule_finds_its_bad_example_and_not_its_good_one(rule: Rule, tmp_path: Path) -> None:
    actual = {}
    for name, text in (("bad", rule.bad), ("good", rule.good)):
        plan = tmp_path / f"{name}.xml"
        plan.write_bytes(text.encode())
        _, report = check([plan], rule.options, tmp_path / "report.json")
        actual[name] = [finding["rule"] for finding in report["plans"][0]["findings"]]
    assert rule.code in actual["bad"]
    assert rule.code not in actual["good"]


@pytest.mark.parametrize("code", sorted(WITHOUT_PLANS))
def test_a_rule_without_a_bad_example_accepts_its_good_one(code: str, tmp_path: Path) -> None:
    (rule,) = (rule for rule in all_rules() if rule.code == code)
    assert rule.bad == ""
    plan = tmp_path / "good.xml"
    plan.write_text(rule.good, "utf-8")
    _, report = check([plan], rule.options, tmp_path / "report.json")
    assert report["plans"][0]["verdict"] == "accepted"


def test_a_missing_file_is_unreadable_and_keeps_no_other_plan_from_being_checked(
    tmp_path: Path,
) -> None:
    readable = CORPUS / "plans" / "patrol.xml"
    code, report = check([tmp_path / "missing.xml", readable], [], tmp_path / "report.json")

    missing, patrol = report["plans"]
    assert (missing["verdict"], missing["facts"]) == ("undecided", None)
    assert [finding["rule"] for finding in missing["findings"]] == ["GP901"]
    assert patrol["verdict"] == "accepted"
    assert code == 2


def test_the_whole_corpus_can_be_checked_at_once(tmp_path: Path) -> None:
    plans = sorted((CORPUS / "plans").glob("*.xml"))
    code, report = check([CORPUS / "plans"], [], tmp_path / "report.json")
    assert [entry["path"] for entry in report["plans"]] == [str(plan) for plan in plans]
    assert code == 1


def test_the_readme_lists_every_plan_and_nothing_else() -> None:
    listed = re.findall(r"^\| \[`([^`]+)`\]\(([^)]+)\)", README.read_text("utf-8"), re.MULTILINE)
    assert [name for name, _ in listed] == sorted(str(plan.relative_to(CORPUS)) for plan in PLANS)
    assert all(name == link for name, link in listed)


def test_no_plan_is_too_large_for_brute_force() -> None:
    assert all(len(instances(text)) <= MAX_RUNNERS for _, text in COMPARED)
