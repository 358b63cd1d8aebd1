"""Plans that are damaged as language models damage them get their meaning back."""

from __future__ import annotations

import re
from collections import Counter

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.model.report import Verdict
from gpsfsm.syntax import parse
from tests.fixing.support import DAMAGES, STEPS, damaged, fixed, meaning
from tests.oracle import to_xml
from tests.strategies import plans

_VERDICTS = (Verdict.ACCEPTED, Verdict.REJECTED, Verdict.UNDECIDED)
_SEEDS = st.integers(0, 10_000)
_HALF = settings(max_examples=max(1, settings.default.max_examples // 2))
_FEW = settings(max_examples=max(1, settings.default.max_examples // 3))
"""Of what tests/campaigns/pairs/answers.py asks of tens of thousands of texts as well."""


def _comments(text: str) -> list[str]:
    return re.findall(r"<!--.*?-->", text, re.DOTALL)


@pytest.mark.parametrize("name", DAMAGES)
def test_safe_fixes_give_a_damaged_plan_its_meaning_back(name: str) -> None:
    """And its comments stay as they are."""
    for text in dict.fromkeys(damaged(name, STEPS, seed) for seed in range(4)):
        assert text != STEPS
        result = fixed(text)
        assert result.report.verdict is Verdict.ACCEPTED, (text, result)
        assert meaning(result.text) == meaning(STEPS), (text, result.text)
        again = fixed(result.text)
        assert (again.text, again.applied) == (result.text, ())
        if name != "dashes in a comment":
            kept = [comment.replace("\r\n", "\n") for comment in _comments(result.text)]
            assert [comment for comment in kept if "text:" not in comment] == _comments(STEPS)


@given(st.sampled_from(sorted(DAMAGES)), st.sampled_from(sorted(DAMAGES)), _SEEDS, st.booleans())
@_FEW
def test_two_damages_are_never_made_worse(first: str, second: str, seed: int, unsafe: bool) -> None:
    text = damaged(second, damaged(first, STEPS, seed), seed + 1)
    before = check_text(text, "a", CheckOptions())
    result = fixed(text, unsafe=unsafe)
    assert _VERDICTS.index(result.report.verdict) <= _VERDICTS.index(before.verdict)
    assert fixed(result.text, unsafe=unsafe).applied == ()
    assert fixed(text, unsafe=unsafe) == result


@given(plans(), st.sampled_from(sorted(DAMAGES)), _SEEDS)
@_FEW
def test_random_plans_with_a_damage_are_never_made_worse(
    whole: object, name: str, seed: int
) -> None:
    text = to_xml(whole).replace("<Plan>", "<Plan>\n  <!-- a comment -->", 1)  # type: ignore[arg-type]
    text = damaged(name, text, seed)
    result = fixed(text)
    if not result.applied:
        assert result.text == text
    assert "<!-- a comment -->" in result.text
    assert fixed(result.text).applied == ()


@given(plans())
def test_safe_fixes_of_readable_plans_leave_the_automaton_as_it_is(whole: object) -> None:
    text = to_xml(whole)  # type: ignore[arg-type]
    result = fixed(text)
    assert meaning(result.text) == meaning(text)
    if not result.applied:
        assert result.text == text


@given(plans())
@_HALF
def test_unsafe_fixes_lose_no_runner_that_some_run_needs(whole: object) -> None:
    text = to_xml(whole)  # type: ignore[arg-type]
    result = fixed(text, unsafe=True)
    before, after = parse(text).plan, parse(result.text).plan
    assert before is not None
    assert after is not None
    lost = Counter(runner.action for runner in before.runners)
    lost.subtract(runner.action for runner in after.runners)
    facts = check_text(text, "a", CheckOptions()).facts
    assert facts is not None
    never = Counter(
        runner.action for runner in before.runners if before.path(runner) in facts.unreachable
    )
    assert all(0 <= count <= never[action] for action, count in lost.items())
    assert fixed(result.text, unsafe=True).applied == ()
