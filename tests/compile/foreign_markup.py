"""Foreign elements and attributes in trees and plans, inserted at a random place of a valid one.

Nothing of it may be dropped in silence: a word is said of it (a finding, a note, a refusal), or it
is taken over, which shows in the runners, their parameters, their connections or the models of
nodes. ``harmless`` is what needs no word, each by a rule that is written down:

- ``name`` of a node, ``_uid`` of a node or tree (GP824): what people and tools note down.
- ``description``, ``default``, ``type`` and text of a port in a TreeNodesModel: they tell people
  of the port. A model of a node is not this: it is taken over.
- A port of a SubTree, or its ``_autoremap``: it gives keys of the tree inside their values, and no
  value is read. An empty TreeNodesModel beside another one: it describes nothing.
- A script that cannot throw and writes what nothing reads, and an AlwaysSuccess that changes
  nothing, as the first child of a Sequence (both *exact* in behaviour-trees.md).
- One more BehaviorTree, as only that runs which ``main_tree_to_execute`` names (*Several trees*).
- ``id`` of a runner, a label (grammar.md), and ``xmlns=""``, which is what there is without it.

Valid inputs hold no element of which a word is said as a whole (GP113, GP814, ``Metadata``): what
is inside one needs no word of its own. Comments and white space are not inserted.
"""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.analysis.rules import rule
from gpsfsm.checking.check import CheckOptions, check_text
from gpsfsm.compile import MachinePlan, compile_plan
from gpsfsm.compile.plan_text import read_plan_or_machine
from gpsfsm.model.finding import Severity
from tests.equivalence.pairs import seeded
from tests.oracle import ticks
from tests.oracle.random_trees import RandomTree

if TYPE_CHECKING:
    from collections.abc import Iterator
    from random import Random

    from gpsfsm.model.tree import Forest
    from gpsfsm.syntax import Parsed

ROOT = Path(__file__).parents[2]
_TAG = re.compile(r"<([\w:]+)((?:[^<>\"']|\"[^\"]*\"|'[^']*')*?)(/?)>")
_ELEMENTS = (
    *("Foo", "z:foo", "Sequence", "Inverter", "Control", "Runner", "Plan", "root", "BehaviorTree"),
    *("Metadata", "include", "TreeNodesModel", "Action", "SubTree", "input_port", "Root", "Region"),
    *("AlwaysSuccess", "Script", "SetBlackboard", "description", "sequence", "Parallel", "node"),
)
_ATTRIBUTES = (
    *(
        "foo",
        "z:foo",
        "_foo",
        "_uid",
        "_skipif",
        "_skipIf",
        "__autoremap",
        "_autoremap",
        "ID",
        "id",
    ),
    *("xmlns", "type", "timeout", "priority", "num_attempts", "num_cycles", "success_count"),
    *(
        "description",
        "default",
        "msec",
        "provider",
        "Name",
        "label",
        "BTCPP_format",
        "order",
        "path",
    ),
    *("main_tree_to_execute", "xml:lang", "xml:space", "class", "_onSuccess", "_while", "failure"),
)
_VALUES = ("1", "x", "true", "{key}", "", "a := 1", "a == 1")
_HARMLESS = (
    r"<(?!root|TreeNodesModel)\w+ _uid=",
    r"<(in|out|inout)(put)?_port (description|default|type)=",
    r"text in <(in|out|inout)(put)?_port>",
    r"<SubTree (?!_|ID)",
    r'<\w+ _on\w+="(true|1|a := 1)">',
    r"<SubTree _+(autoremap|shared_blackboard)=",
    r"<Runner id",
    r'<\w+ xmlns="">',
    r"<AlwaysSuccess\b.* in <(?!root|TreeNodesModel|\w*port\b)",
    r"<BehaviorTree\b.* in <root>",
    r"<TreeNodesModel[^<]*></TreeNodesModel> in <root>",
)
_INSIDE = ("", "<Go/>", "text", '<Runner interface="a/B" provider="a/B"/>', '<a b="1"/>')


def _files(*patterns: str) -> Iterator[str]:
    for pattern in patterns:
        for path in sorted(ROOT.glob(pattern)):
            yield path.read_text()


@cache
def trees() -> tuple[str, ...]:
    """Trees of both versions, those of Nav2 too."""
    texts = [*_files("corpus/trees/*.xml", "corpus/rules/GP8*/*.xml", "docs/examples/**/*.xml")]
    texts += [RandomTree(seeded(seed)).text for seed in range(25)]
    texts += [ticks.random_tree(seeded(seed)) for seed in range(25)]
    # What nothing enters, behind a RecoveryNode without retries, has no effect, as GP821 says.
    texts = [text for text in texts if "<BehaviorTree" in text and '_retries="0"' not in text]
    texts += [text.replace('BTCPP_format="4"', 'BTCPP_format="3"') for text in texts]
    return tuple(dict.fromkeys(texts))


@cache
def plans() -> tuple[str, ...]:
    """Plans."""
    texts = _files("corpus/plans/*.xml", "corpus/missions/*.xml", "docs/examples/**/*.xml")
    return tuple(text for text in texts if "<Plan" in text)


@cache
def _valid(text: str) -> bool:
    """True for a text without an error in which nothing is ignored as a whole."""
    parsed = read_plan_or_machine(text, file="x.xml")
    found = [rule(each.rule).finding_of(each) for each in parsed.problems]
    ignored = {"GP113", "GP814"} & {each.rule for each in found}
    wrong = [each for each in found if each.severity is Severity.ERROR]
    return parsed.plan is not None and not (ignored or wrong)


def _report(text: str) -> tuple[Any, ...]:
    report = check_text(text, "x.xml", CheckOptions())
    found = (*report.findings, *report.suppressed)
    return (
        report.verdict,
        report.facts and (report.facts.completes, report.facts.gives_up, report.facts.runners),
        sorted((each.rule, each.message) for each in found),
        [(each.reading, each.construct, each.cause) for each in report.approximations],
        report.notes,
    )


def _shape(parsed: Parsed) -> tuple[Any, ...]:
    """The runners, what they are handed, and the connections."""
    plan = parsed.plan
    if plan is None:
        return ()
    automaton = plan.automaton if isinstance(plan, MachinePlan) else compile_plan(plan).automaton
    runners = [plan.elements[each.origin] for each in automaton.runners]
    return (
        [(each.interface, each.provider, [*each.parameters.items()]) for each in runners],
        [(each.kind, each.need) for each in automaton.nodes],
        automaton.edges,
        automaton.stops,
        None if parsed.forest is None else repr(_models(parsed.forest)),
    )


def _models(forest: Forest) -> list[tuple[str, str, list[str]]]:
    rows = (forest.models or {}).items()
    return [(name, each.category, sorted(each.ports)) for name, each in rows]


def _words(parsed: Parsed) -> tuple[Any, ...]:
    return (
        sorted((each.rule, each.message) for each in parsed.problems),
        [(each.reading, each.construct, each.cause) for each in parsed.approximations],
        parsed.notes,
    )


@cache
def _before(text: str) -> tuple[Any, ...]:
    parsed = read_plan_or_machine(text, file="x.xml")
    return _words(parsed), _shape(parsed)


def inserted(texts: tuple[str, ...], chance: Random) -> tuple[str, str, str]:
    """A text, the same with something foreign, and what that is."""
    text = chance.choice(texts)
    while not _valid(text):
        text = chance.choice(texts)
    tag = chance.choice([*_TAG.finditer(text)])
    declared = ' xmlns:z="urn:other"'
    if chance.random() < 0.5:
        name = chance.choice(_ATTRIBUTES)
        if not re.search(rf"\s{re.escape(name)}\s*=", tag[2]):
            what = f'{name}="{chance.choice(_VALUES)}"' + declared * name.startswith("z:")
            at = tag.end(2)
            return text, f"{text[:at].rstrip()} {what}{text[at:]}", f"<{tag[1]} {what}>"
    name = chance.choice(_ELEMENTS)
    attributes = chance.choice(("", "", ' ID="Go"', ' name="x"', ' type="sequential"'))
    attributes += declared * name.startswith("z:")
    element = f"<{name}{attributes}>{chance.choice(_INSIDE)}</{name}>"
    if chance.random() < 0.1:
        element = "text"
    what = f"{element} in <{tag[1]}>"
    if tag[3]:
        return text, f"{text[: tag.start(3)]}>{element}</{tag[1]}>{text[tag.end() :]}", what
    return text, text[: tag.end()] + element + text[tag.end() :], what


def harmless(what: str) -> bool:
    """True if an insertion needs no word."""
    return any(re.match(each, what) for each in _HARMLESS)


def judged(before: str, after: str) -> str:
    """What became of it: ``refused``, ``told``, ``read``, ``judged`` or ``silent``."""
    words, shape = _before(before)
    parsed = read_plan_or_machine(after, file="x.xml")
    if parsed.plan is None:
        assert parsed.problems, after
        return "refused"
    if _words(parsed) != words:
        return "told"
    if _shape(parsed) != shape:
        return "read"
    return "silent" if _report(after) == _report(before) else "judged"
