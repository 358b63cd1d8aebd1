"""Every rule has fixes, or a reason to have none; the documentation says so."""

from __future__ import annotations

from pathlib import Path

import pytest

from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.analysis.rules import all_rules, rule
from gpsfsm.checking import CheckOptions
from gpsfsm.checking.selection import Selection
from gpsfsm.fixing import Safety, fix_text
from gpsfsm.fixing.fixer import WITHOUT, all_fixers, table_markdown
from gpsfsm.model.story import PAPER_ENGINE

ROOT = Path(__file__).parents[2]

# Rules whose example is not what their fix is for: a speed that no runner has, a value that is
# no number, a second try that may well help, words of other languages that fit nothing here; in
# trees, names that are like no other, a number in words, and a node outside of the tree.
_OTHER_EXAMPLES = {
    *("GP104", "GP105", "GP106", "GP203", "GP205", "GP309"),
    *("GP801", "GP803", "GP811", "GP812", "GP814", "GP820"),
}


def _fixable() -> list[str]:
    return sorted({code for fixer in all_fixers() for code in fixer.rules})


def test_every_rule_has_a_fix_or_a_reason() -> None:
    codes = {each.code for each in all_rules()}
    assert set(_fixable()) | set(WITHOUT) == codes
    assert set(_fixable()) & set(WITHOUT) == set()


def test_every_fixer_says_what_it_does() -> None:
    names = [fixer.name for fixer in all_fixers()]
    assert len(set(names)) == len(names)
    for fixer in all_fixers():
        assert fixer.safe or fixer.unsafe
        assert all(not words.endswith(".") for words in (fixer.safe, fixer.unsafe))


def test_the_tables_of_the_documentation_are_those_of_the_registry() -> None:
    assert table_markdown() in (ROOT / "docs/fix.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("code", [code for code in _fixable() if code not in _OTHER_EXAMPLES])
def test_the_example_of_a_rule_is_fixed(code: str) -> None:
    example = rule(code)
    words = example.options
    assumptions = words[1::2] if words[:1] == ("--assume",) else ()
    options = CheckOptions(
        analysis=AnalysisOptions(assumptions=assumptions),
        from_response="--from-response" in words,
        selection=Selection.of([code]),
        engine=words[1] if words[:1] == ("--engine",) else PAPER_ENGINE,
    )
    repaired = fix_text(example.bad, options, unsafe=True)
    assert code in {fix.rule for fix in repaired.applied}
    assert code not in {finding.rule for finding in repaired.report.findings}
    safeties = {fix.safety for fix in repaired.applied}
    mine = [fixer for fixer in all_fixers() if code in fixer.rules]
    assert Safety.SAFE not in safeties or any(fixer.safe for fixer in mine)
    assert Safety.UNSAFE not in safeties or any(fixer.unsafe for fixer in mine)
