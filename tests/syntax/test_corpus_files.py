"""Published plans and models' answers are read without an exception."""

from __future__ import annotations

import json

import pytest

from gpsfsm.syntax import parse

FOLDERS = ["plans", "experiment1/fabric", "experiment2"]


@pytest.mark.parametrize("folder", FOLDERS)
def test_published_plans(folder, shared_corpus):
    files = sorted((shared_corpus / folder).rglob("*.xml"))
    assert files
    read = 0
    for file in files:
        parsed = parse(file.read_bytes(), file=str(file))
        assert parsed.plan is not None or parsed.problems, file
        read += parsed.plan is not None
    assert read > len(files) / 2


def test_behaviour_trees_are_no_plans(shared_corpus):
    files = sorted((shared_corpus / "experiment1/btgenbot").rglob("*.xml"))
    assert files
    for file in files:
        parsed = parse(file.read_bytes(), file=str(file))
        assert parsed.plan is None
        assert "GP104" in {problem.rule for problem in parsed.problems}, file


def test_models_answers(shared_corpus):
    text = (shared_corpus / "experiment1/responses.jsonl").read_text(encoding="utf-8")
    answers = [json.loads(line)["response"] for line in text.splitlines()]
    parsed = [parse(answer, from_response=True) for answer in answers]
    assert sum(one.plan is not None for one in parsed) >= 150
    for answer, one in zip(answers, parsed, strict=True):
        assert one.plan is not None or one.problems
        assert one.text == answer
        if "</Plan>" not in answer and "<Plan" not in answer:
            assert one.plan is None
