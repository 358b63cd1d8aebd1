"""The fixes of one finding: for every rule that has any, held against ``gpsfsm fix``."""

from __future__ import annotations

import pytest

pytest.importorskip("pygls", reason="gpsfsm lsp needs the extra lsp")

from gpsfsm.analysis.rules import Rule, all_rules
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.fixing import fix_text
from gpsfsm.fixing.fixer import apply_edits
from gpsfsm.fixing.suggest import fixable, proved

RULES = [rule for rule in all_rules() if fixable(rule.code) and rule.bad and not rule.options]


def count(text: str, rule: str) -> int:
    findings = check_text(text, "plan.xml", CheckOptions()).findings
    return sum(finding.rule == rule for finding in findings)


def test_there_are_such_rules() -> None:
    assert len(RULES) > 20


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.code)
def test_what_fix_can_mend_is_offered_and_takes_the_finding_away(rule: Rule) -> None:
    options = CheckOptions()
    report = check_text(rule.bad, "plan.xml", options)
    finding = next(one for one in report.findings if one.rule == rule.code)
    offered = proved(rule.bad, "plan.xml", finding, options)
    done = [each for each in fix_text(rule.bad, unsafe=True).applied if each.rule == rule.code]
    assert bool(offered) == bool(done)
    for each in offered:
        assert count(apply_edits(rule.bad, each.edits), rule.code) < count(rule.bad, rule.code)
    if done:
        assert offered[0].safe == (done[0].safety == "safe")


def test_behaviour_trees_are_mended_too() -> None:
    tree = '<root BTCPP_format="4"><BehaviorTree ID="A"><Go x="1" x="2"/></BehaviorTree></root>'
    report = check_text(tree, "tree.xml", CheckOptions())
    (finding,) = (each for each in report.findings if each.rule == "GP110")
    (offered,) = proved(tree, "tree.xml", finding, CheckOptions())
    assert not offered.safe
    assert apply_edits(tree, offered.edits) == tree.replace(' x="2"', "")
