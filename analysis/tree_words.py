"""Findings about behaviour trees: in the words of those who write trees, and each place once."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterable

    from gpsfsm.model.finding import Finding

__all__ = ["NOT_FOR_TREES", "tree_findings"]

NOT_FOR_TREES = frozenset(
    {
        *("GP201", "GP202", "GP203", "GP204", "GP205", "GP206", "GP207", "GP208", "GP209", "GP210"),
        *("GP212", "GP303", "GP307", "GP308", "GP309", "GP310", "GP311", "GP312"),
    }
)
"""Rules that do not speak of trees.

GP2xx: capability files describe runners, a TreeNodesModel describes nodes. GP303 and GP311: a
Parallel halts what still runs when it ends. The others speak of recoveries, which trees do not
have; a Retry, for one, repeats an action on purpose.
"""

_WORDS = (
    (
        re.compile(r"add a <Control type=\"recovery\"> right after it, or accept .*"),
        "put it into a <Fallback> with another way to do it, or accept that the tree fails then",
    ),
    (
        re.compile(r"add a recovery right after (.*?), or accept .*"),
        r"put \1 into a <Fallback>, or accept that the tree fails then",
    ),
    (
        re.compile(r"add another step to the recovery if there is one worth trying"),
        "add another child to the Fallback if there is one worth trying",
    ),
    (re.compile(r"a recovery for it alone"), "a Fallback around it alone"),
    (re.compile(r"is the last step of its recovery"), "is the last child of its Fallback or Retry"),
    (re.compile(r"no further recovery is left"), "no other child is left to try"),
    (re.compile(r"(all \d+ units of this) parallel_any fail"), r"\1 Parallel fail"),
    (re.compile(r"\bparallel_(?:any|all)\b"), "Parallel"),
    (re.compile(r"\bthe plan gives up\b"), "the tree fails"),
    (re.compile(r"\bthe plan never completes\b"), "the tree never succeeds"),
    (re.compile(r"\bthis plan\b"), "this tree"),
    (re.compile(r"\bthe plan\b"), "the tree"),
)


def tree_findings(findings: Iterable[Finding]) -> list[Finding]:
    """The findings in the words of trees.

    A node that runs several times, in a Retry or a SubTree, has the same to say about each time;
    the first is kept.
    """
    seen: set[tuple[str, int, int, str]] = set()
    found: list[Finding] = []
    for finding in findings:
        key = (finding.rule, finding.location.line, finding.location.column, finding.message)
        if key in seen:
            continue
        seen.add(key)
        found.append(_told(finding))
    return found


def _told(finding: Finding) -> Finding:
    if finding.rule < "GP3" or finding.rule >= "GP8":
        return finding
    scenario = finding.scenario
    if scenario is not None:
        scenario = replace(scenario, story=tuple(map(_in_words, scenario.story)))
    return replace(
        finding,
        message=_in_words(finding.message),
        hint=_in_words(finding.hint),
        scenario=scenario,
    )


def _in_words(text: str) -> str:
    for pattern, words in _WORDS:
        text = pattern.sub(words, text)
    return text
