"""Real plans: what fuzzing finds in them, the exact analyses know of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.fuzzing import run_campaign, subject_of
from gpsfsm.fuzzing.properties import default_properties, find_property
from gpsfsm.syntax import parse
from tests.conftest import REPO

if TYPE_CHECKING:
    from pathlib import Path

RUNS = 25
MOST = 25
"""Plans that are tried: every n-th one."""


@pytest.mark.parametrize("name", ["night_guard", "warehouse_count"])
def test_all_orphans_that_there_can_be_are_found(name: str) -> None:
    """Also those that only a race of one slow and one failing instance shows."""
    text = (REPO / "corpus" / "plans" / f"{name}.xml").read_bytes()
    facts = gpsfsm.check(text).plans[0].facts
    assert facts is not None
    wanted = [find_property("no-orphan"), find_property("completes")]
    campaign = run_campaign(subject_of(text, faults=("failed",)), wanted, runs=1_000)
    orphans = [failure for failure in campaign.failures if failure.broken.name == "no-orphan"]
    assert sorted(orphan.breach.about[0] for orphan in orphans) == sorted(facts.orphans)
    assert all(len(orphan.run.scenario.faults) <= 1 for orphan in orphans)
    (gives_up,) = campaign.failures[len(orphans) :]
    assert len(gives_up.run.scenario.faults) == facts.fewest_failures_to_give_up


def test_what_is_found_in_real_plans_is_among_the_facts(shared_corpus: Path) -> None:
    files = sorted((shared_corpus / "experiment1").rglob("*.xml"))
    files += sorted((shared_corpus / "plans").glob("*.xml"))
    tried = 0
    for file in files[:: max(1, len(files) // MOST)]:
        parsed = parse(file.read_bytes())
        if parsed.plan is None or not parsed.plan.runners:
            continue
        tried += 1
        subject = subject_of(parsed.plan, faults=("failed", "no-start"))
        (report,) = gpsfsm.check(file.read_bytes(), faults=["no-start"]).plans
        campaign = run_campaign(subject, default_properties(), runs=RUNS)
        assert report.facts is not None
        for failure in campaign.failures:
            if failure.broken.name == "ends":
                assert report.facts.stuck != "never", file
            elif failure.broken.name == "no-orphan":
                assert set(failure.breach.about) <= set(report.facts.orphans), file
            else:
                assert failure.broken.name == "no-overlap", (file, failure.breach)
                rules = {rule.rule for rule in (*report.findings, *report.suppressed)}
                assert "GP501" in rules, file
    assert tried > 5
