"""``gpsfsm view``."""

from __future__ import annotations

import json
import re
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.viewing.page import unpacked
from tests.cli.support import ACCEPTED, BROKEN, REJECTED, run

if TYPE_CHECKING:
    from pathlib import Path


def _shown(page: bytes) -> Any:
    (block,) = re.findall(rb'<script type="application/json"[^>]*>(.*?)</script>', page, re.DOTALL)
    return unpacked(json.loads(block))


def test_the_page_is_named_after_the_plan(tmp_path: Path) -> None:
    (tmp_path / "my_plan.xml").write_text(REJECTED)
    done = run("view", "my_plan.xml", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (0, b"")
    assert b"my_plan.html: 1 plan, " in done.stderr
    (plan,) = _shown((tmp_path / "my_plan.html").read_bytes())["plans"]
    assert (plan["name"], plan["verdict"]) == ("my_plan.xml", "rejected")


def test_standard_input_and_output_give_the_same_bytes(tmp_path: Path) -> None:
    first, second = (run("view", "-", "-o", "-", stdin=ACCEPTED.encode()) for _ in range(2))
    assert (first.returncode, first.stderr) == (0, b"")
    assert first.stdout == second.stdout
    assert first.stdout.startswith(b"<!doctype html>")


def test_several_plans_of_which_one_is_broken(tmp_path: Path) -> None:
    for name, text in (("a.xml", ACCEPTED), ("b.xml", BROKEN)):
        (tmp_path / name).write_text(text)
    done = run("view", ".", cwd=tmp_path)
    assert done.returncode == 1
    assert done.stderr.endswith(b" kB; 1 with errors in the text\n")
    shown = _shown((tmp_path / "plans.html").read_bytes())
    assert [plan["name"] for plan in shown["plans"]] == ["a.xml", "b.xml"]
    assert shown["title"] == "2 plans"


def test_a_file_that_cannot_be_read_does_not_keep_the_others_from_being_shown(
    tmp_path: Path,
) -> None:
    (tmp_path / "a.xml").write_text(ACCEPTED)
    done = run("view", "a.xml", "gone.xml", "-o", "page.html", cwd=tmp_path)
    assert done.returncode == 2
    assert b"gone.xml: cannot be read" in done.stderr
    plans = _shown((tmp_path / "page.html").read_bytes())["plans"]
    assert [plan["source"] is None for plan in plans] == [False, True]


def test_nothing_is_written_if_nothing_could_be_read(tmp_path: Path) -> None:
    done = run("view", "gone.xml", cwd=tmp_path)
    assert done.returncode == 2
    assert list(tmp_path.iterdir()) == []


def test_only_pages_are_overwritten(tmp_path: Path) -> None:
    plan = tmp_path / "a.xml"
    plan.write_text(ACCEPTED)
    page = tmp_path / "page.html"
    page.write_text("<p>precious")
    refused = run("view", plan, "-o", page)
    assert refused.returncode == 2
    assert b"--force" in refused.stderr
    assert page.read_text() == "<p>precious"
    assert run("view", plan, "-o", page, "--force").returncode == 0
    assert run("view", plan, "-o", page).returncode == 0


def test_a_plan_is_never_overwritten(tmp_path: Path) -> None:
    plan = tmp_path / "a.xml"
    plan.write_text(ACCEPTED)
    done = run("view", plan, "-o", plan, "--force")
    assert done.returncode == 2
    assert plan.read_text() == ACCEPTED


def test_two_plans_side_by_side(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(ACCEPTED)
    (tmp_path / "b.xml").write_text(ACCEPTED.replace('x="1"', 'x="3"'))
    done = run("view", "--diff", "a.xml", "b.xml", "-o", "-", cwd=tmp_path)
    assert done.returncode == 0
    assert _shown(done.stdout)["diff"]["verdict"] == "different"


def test_options_of_the_check(tmp_path: Path) -> None:
    plan = tmp_path / "a.xml"
    plan.write_text(ACCEPTED)
    words = ("--faults", "hang", "--engine", "fabric-v2", "--select", "GP3")
    (shown,) = _shown(run("view", plan, *words, "-o", "-").stdout)["plans"]
    assert shown["engine"] == "fabric-v2"
    rules = {each["rule"] for each in shown["findings"] if not each["suppressed"]}
    assert rules == {"GP302", "GP306"}  # the second because it may hang


def test_the_page_is_opened(tmp_path: Path) -> None:
    (tmp_path / "a plan.xml").write_text(ACCEPTED)
    browser = tmp_path / "browser"
    browser.write_text('#!/bin/sh\nprintf %s "$1" > "$(dirname "$0")/opened"\n')
    browser.chmod(0o755)
    done = run("view", "a plan.xml", "--open", cwd=tmp_path, env={"BROWSER": f"{browser} %s"})
    assert done.returncode == 0, done.stderr
    address = (tmp_path / "opened").read_text()
    assert address == (tmp_path.resolve() / "a plan.html").as_uri()


def test_without_a_browser_the_page_is_there_all_the_same(tmp_path: Path) -> None:
    (tmp_path / "a.xml").write_text(ACCEPTED)
    done = run("view", "a.xml", "--open", cwd=tmp_path, env={"BROWSER": "false %s"})
    assert done.returncode == 0
    assert b"no browser was found" in done.stderr
    assert (tmp_path / "a.html").is_file()


WRONG = {
    "no plan": [],
    "three to compare": ["--diff", "a.xml", "b.xml", "c.xml"],
    "standard output to open": ["a.xml", "--open", "-o", "-"],
    "a task that is not there": ["a.xml", "--task", "gone.yaml"],
    "a folder to write to": ["a.xml", "-o", "."],
    "an engine that is not known": ["a.xml", "--engine", "mine"],
}


@pytest.mark.parametrize("words", WRONG.values(), ids=WRONG)
def test_what_makes_no_sense(words: list[str], tmp_path: Path) -> None:
    for name in ("a.xml", "b.xml", "c.xml"):
        (tmp_path / name).write_text(ACCEPTED)
    done = run("view", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr
    assert not list(tmp_path.glob("*.html"))


def test_a_task(tmp_path: Path) -> None:
    plan = tmp_path / "a.xml"
    plan.write_text(ACCEPTED)
    task = tmp_path / "task.yaml"
    task.write_text("task: go\nsteps:\n  - do: {interface: SpeechRunner}\n")
    done = run("view", plan, "--task", task, "-o", "-")
    assert done.returncode == 0, done.stderr
    (shown,) = _shown(done.stdout)["plans"]
    assert shown["task"]["grade"] == "partial"
