"""``fuzz``, ``resume`` and ``replay`` from Python, beside the commands."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from tests.cli.support import run

if TYPE_CHECKING:
    from pathlib import Path

GO = '<Runner interface="a/Go" provider="a/Go"/>'
PLAN = f"<Plan>{GO}{GO}</Plan>"


def quick(played: gpsfsm.Run) -> bool:
    """Nothing takes a second."""
    return played.at_s < 1


def test_fuzz_is_what_the_command_prints(tmp_path: Path) -> None:
    file = tmp_path / "plan.xml"
    file.write_text(PLAN)
    campaign = gpsfsm.fuzz(file, runs=50, seed=3)
    printed = run("fuzz", str(file), "--runs", "50", "--seed", "3", "--format", "json").stdout
    assert campaign.to_dict() == json.loads(printed)
    assert campaign.ok


def test_fuzz_takes_functions_and_keeps_cases(tmp_path: Path) -> None:
    corpus = tmp_path / "cases"
    campaign = gpsfsm.fuzz(PLAN, runs=5, properties=[quick], corpus=corpus)
    assert not campaign.ok
    assert [each.rule for each in campaign.findings]
    assert list(corpus.iterdir())
    again = gpsfsm.fuzz(PLAN, runs=1, properties=[quick], corpus=corpus)
    assert again.replayed == (len(list(corpus.iterdir())), 0)


def test_a_plan_without_its_text_has_no_corpus(tmp_path: Path) -> None:
    plan = gpsfsm.parse(PLAN).plan
    assert plan is not None
    assert gpsfsm.fuzz(plan, runs=2).ok
    with pytest.raises(gpsfsm.UsageError, match="contain the text of their plan"):
        gpsfsm.fuzz(plan, runs=2, corpus=tmp_path)


def test_a_journal_is_replayed_and_gone_on_with(tmp_path: Path) -> None:
    journal = tmp_path / "run.db"
    done = gpsfsm.run(PLAN, journal=journal, failure=0.0)
    assert done
    replayed = gpsfsm.replay(journal)
    assert replayed
    assert replayed.difference == ""
    assert [(each.run, each.again) for each in replayed.runs] == [(1, True)]
    assert replayed.runs[0].events == len(done.plans[0].events)
    assert json.loads(json.dumps(replayed.to_dict()))["same"] is True
    assert gpsfsm.resume(journal).status is done.status
    with pytest.raises(gpsfsm.GpsfsmError, match="run 7"):
        gpsfsm.replay(journal, run=7)
