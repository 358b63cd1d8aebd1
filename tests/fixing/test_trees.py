"""Fixes of behaviour trees: damaged trees become what they were, and the real engine loads them."""

from __future__ import annotations

import json
import random
import re
from functools import cache
from itertools import islice
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.cli import main
from gpsfsm.compile.plan_text import read_plan
from gpsfsm.equivalence import compare
from gpsfsm.fixing import Safety, fix_text, sameness
from gpsfsm.fixing.suggest import Suggestions, proved
from gpsfsm.model.finding import Severity
from tests.cases import ALL
from tests.fixing.support import fixed
from tests.oracle.random_trees import RandomTree

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

Damage = "Callable[[str], str]"
_SEEDS = range(80)
_TREES = 3 if ALL else 1


def _first(pattern: str, replacement: str) -> Damage:
    return lambda text: re.sub(pattern, replacement, text, count=1)


def _all(pattern: str, replacement: str) -> Damage:
    return lambda text: re.sub(pattern, replacement, text)


def _in_small_letters(text: str) -> str:
    return re.sub(r"<(Action|Condition) (?=ID)", lambda match: match[0].lower(), text)


SAFE: Mapping[str, Damage] = {
    "sequence of version 3": _all("SequenceWithMemory", "SequenceStar"),
    "retry of version 3": _all("RetryUntilSuccessful", "RetryUntilSuccesful"),
    "ports of version 3": _all(r'(success|failure)_count="', r'\1_threshold="'),
    "letters of a port": _all("num_cycles", "Num_Cycles"),
    "blank before a number": _all(r'(num_\w+|max_failures)="', r'\1=" '),
    "plus before a number": _all(r'(num_\w+|\w+_count)="(\d)', r'\1="+\2'),
    "point behind a number": _all(r'(num_\w+)="(-?\d+)"', r'\1="\2.0"'),
    "underscore left out": _all(r"(?<=[a-z0-9\"]) _(skipIf|failureIf|while)=(?![^>]*/>)", r" \1="),
    "letters of the main tree": _first('execute="Main"', 'execute="main"'),
    "format with a point": _first('format="4"', 'format="4.0"'),
    "an ID that the tag repeats": _first(r"<(A\d+)(?=[ />])", r'<\1 ID="\1"'),
    "no root": _all("<root[^>]*>\n|\n</root>", ""),
    "quotes left out": _all(r'(num_\w+)="(-?\d+)"', r"\1=\2"),
    "an end tag in small letters": _first("</Sequence>", "</sequence>"),
    "a SubTree in small letters": _first('<SubTree ID="Part"', '<SubTree ID="part"'),
    "a tree as a node": _first('<SubTree ID="Part"', "<Part"),
    "no main tree": _first(' main_tree_to_execute="Main"(?=(?s:.)*"Part")', ""),
}
"""Damages that safe fixes undo."""

UNSAFE: Mapping[str, Damage] = {
    "letters of a leaf": _first(r"<A(\d)(?=[ />])", r"<a\1"),
    "letters in the model": _in_small_letters,
    "letters of a condition": _all("_(skip|failure|success)If", r"_\1if"),
    "a misspelt control": _first("(</?)SequenceWithMemory", r"\1SequenceWithMemry"),
    "a misspelt port": _all("num_attempts", "num_attemps"),
    "a misspelt tree": _first('<SubTree ID="Part"', '<SubTree ID="Pert"'),
    "another main tree": _first('execute="Main"', 'execute="Begin"'),
}
"""Damages that unsafe fixes undo."""


@cache
def drawn(seed: int) -> str:
    """A random tree; in every other one the nodes stand in a tree of their own."""
    text = RandomTree(random.Random(seed), most=5).text  # noqa: S311  (no secrets here)
    if seed % 2:
        body = text[text.index("<BehaviorTree") : text.index("</BehaviorTree>")]
        inside = body.split("\n", 1)[1]
        part = f'<BehaviorTree ID="Part">\n{inside}</BehaviorTree>'
        text = text.replace(inside, '    <SubTree ID="Part"/>\n  ')
        text = text.replace("</BehaviorTree>", f"</BehaviorTree>\n  {part}", 1)
    return text


@cache
def mended_text(text: str, *, unsafe: bool) -> str:
    """The text after all fixes."""
    return fixed(text, unsafe=unsafe).text


def same(text: str, other: str) -> bool:
    """True if two texts are one, or the trees in them do the same."""
    if text == other:
        return True
    plans = read_plan(text).plan, read_plan(other).plan
    assert plans[0] is not None
    assert plans[1] is not None
    return compare(*plans) is None


def loads(text: str) -> bool:
    """True if the real engine takes a text."""
    module = pytest.importorskip("behaviortreepy", reason="behaviortreepy is not installed")
    factory = module.BehaviorTreeFactory()
    for name in sorted(set(re.findall(r'<(?:Action|Condition) ID="(\w+)"/>', text))):
        factory.register_simple_condition(name, lambda _: module.NodeStatus.SUCCESS)
    try:
        factory.create_tree_from_text(text)
    except RuntimeError:
        return False
    return True


def _damaged(damage: Any) -> list[tuple[str, str]]:
    """The first trees in which there is something to damage, each with its damaged text."""
    pairs = ((drawn(seed), damage(drawn(seed))) for seed in _SEEDS)
    return list(islice(((text, other) for text, other in pairs if text != other), _TREES))


@pytest.mark.parametrize("name", SAFE)
def test_safe_fixes_give_a_tree_back(name: str) -> None:
    pairs = _damaged(SAFE[name])
    assert pairs
    for text, damaged in pairs:
        mended = fixed(damaged)
        assert {fix.safety for fix in mended.applied} == {Safety.SAFE}, damaged
        assert same(text, mended.text), f"{damaged}\n{mended.text}"
        assert mended_text(mended.text, unsafe=False) == mended.text


@pytest.mark.parametrize("name", UNSAFE)
def test_unsafe_fixes_give_a_tree_back(name: str) -> None:
    pairs = _damaged(UNSAFE[name])
    assert pairs
    for text, damaged in pairs:
        assert fixed(damaged).unsafe_left > 0, damaged
        mended = mended_text(damaged, unsafe=True)
        assert same(text, mended), f"{damaged}\n{mended}"
        assert mended_text(mended, unsafe=True) == mended


@pytest.mark.parametrize("name", [*SAFE, *UNSAFE])
def test_the_engine_loads_what_was_fixed(name: str) -> None:
    for text, damaged in _damaged({**SAFE, **UNSAFE}[name]):
        if not loads(text):
            continue  # a part of a tree that the engine refuses for another reason
        mended = mended_text(damaged, unsafe=name in UNSAFE)
        assert loads(mended), mended


@pytest.mark.parametrize("seed", range(6))
def test_many_damages_at_once(seed: int) -> None:
    chance = random.Random(seed)  # noqa: S311
    text = drawn(seed)
    damaged: Any = text
    for name in chance.sample(sorted(SAFE), 6):
        if name != "no root":  # with it goes what else is said in the root
            damaged = SAFE[name](damaged)
    assert same(text, fixed(damaged).text), damaged


TREE = (
    '<root BTCPP_format="4" main_tree_to_execute="M"><BehaviorTree ID="M">{}</BehaviorTree></root>'
)
STAR = TREE.format("<SequenceStar><A/><B/></SequenceStar>")
MODEL = (
    '<root BTCPP_format="4"><BehaviorTree ID="M">{}</BehaviorTree><TreeNodesModel>'
    '<Action ID="Find"><output_port name="where"/></Action>'
    '<Action ID="Drive"><input_port name="to"/></Action></TreeNodesModel></root>'
)


@pytest.mark.parametrize(
    ("body", "after"),
    [
        ('<Sequence><Find where="spot"/><Drive to="{spot}"/></Sequence>', 'where="{spot}"'),
        ('<Sequence><Find where="{spot}"/><Drive to="{sopt}"/></Sequence>', 'to="{spot}"'),
    ],
)
def test_keys_of_the_blackboard(body: str, after: str) -> None:
    text = MODEL.format(body)
    assert fixed(text).text == text
    mended = fixed(text, unsafe=True)
    assert after in mended.text
    assert not {"GP820", "GP823"} & {finding.rule for finding in mended.report.findings}


def test_children_go_into_a_sequence() -> None:
    text = TREE.format("\n  <A/>\n  <B/>\n")
    assert fixed(text).text == text
    mended = fixed(text, unsafe=True).text
    assert mended == TREE.format("\n  <Sequence>\n      <A/>\n      <B/>\n  </Sequence>\n")


def test_a_version_that_a_node_tells_is_added() -> None:
    text = '<root><BehaviorTree ID="M"><{0}><A/><B/></{0}></BehaviorTree></root>'
    for node, version in (("SequenceWithMemory", 4), ("SequenceStar", 3)):
        assert f'<root BTCPP_format="{version}">' in fixed(text.format(node)).text
    assert fixed(text.format("Sequence")).text == text.format("Sequence")
    assert '<root BTCPP_format="4">' in fixed(text.format("Sequence"), unsafe=True).text
    wrong = TREE.format("<A/>").replace('format="4"', 'format="v3.8"')
    assert fixed(wrong).text == wrong.replace("v3.8", "3")


@pytest.mark.parametrize(
    "text",
    [
        TREE.format('<SubTree ID="Elsewhere"/>'),
        TREE.format('<Repeat num_cycles="twice"><A/></Repeat>'),
        TREE.format('<Parallel success_count="3"><A/><B/></Parallel>'),
        TREE.format("<ReactiveSequence><Sleep/><Sleep/></ReactiveSequence>"),
        STAR.replace("Star", "")
        .replace('execute="M"', 'execute="Other"')
        .replace("</root>", '<BehaviorTree ID="N"><A/></BehaviorTree></root>'),
        TREE.format('<A _colour="green"/>'),
        MODEL.format(
            '<Sequence><Find where="{base_finished}"/><Drive to="{base_idle}"/></Sequence>'
        ),
        TREE.format("<BB_Precondition><A/></BB_Precondition>"),
        MODEL.format("<Sequence><Fine/><Drive1/></Sequence>").replace("Drive", "Drive2"),
        TREE.format('<Sequence num_cycles="3" name="x"><A/></Sequence>'),
    ],
)
def test_what_has_no_obvious_answer_stays(text: str) -> None:
    assert fixed(text, unsafe=True).text == text


def test_a_safe_fix_of_a_name_must_keep_what_is_done() -> None:
    """FallbackStar begins where it was, Fallback at its first child: unsafe, and said to be so."""
    body = (
        "<KeepRunningUntilFailure><FallbackStar><A/><B/></FallbackStar></KeepRunningUntilFailure>"
    )
    text = TREE.format(body)
    assert fixed(text).text == text
    assert fixed(text, unsafe=True).text == text.replace("FallbackStar", "Fallback")


def test_machines_of_trees_are_compared() -> None:
    options = CheckOptions()
    one = TREE.format("<KeepRunningUntilFailure><A/></KeepRunningUntilFailure>")
    assert sameness(one, one.replace("><A", ">\n<A"), options) == "same"
    assert sameness(one, one.replace("A/", "B/"), options) == "renamed"
    other = one.replace("<A/>", "<Inverter><A/></Inverter>")
    assert sameness(one, other, options) == "different"


def test_plans_and_trees_have_their_own_fixes() -> None:
    """Nothing makes a plan of a tree, or the other way round."""
    for text in (STAR.replace("B/", "Runner/"), STAR.replace("SequenceStar", "Control")):
        mended = fixed(text, unsafe=True).text
        assert mended.startswith("<root")
        assert "<Plan" not in mended


def test_an_answer_with_a_tree() -> None:
    text = f"Here it is:\n```xml\n{STAR}\n```\n"
    mended = fixed(text, from_response=True)
    assert mended.text == STAR.replace("Star", "WithMemory") + "\n"
    assert [fix.rule for fix in mended.applied] == ["GP115", "GP817"]


def test_the_command_writes_shows_and_is_done(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "tree.xml"
    file.write_text(STAR, encoding="utf-8")
    assert main(["fix", "--isolated", "--diff", str(file)]) == 1
    assert "+" + STAR.replace("Star", "WithMemory") in capfd.readouterr().out
    assert file.read_text(encoding="utf-8") == STAR
    assert main(["fix", "--isolated", str(file)]) == 0
    assert file.read_text(encoding="utf-8") == STAR.replace("Star", "WithMemory")
    capfd.readouterr()
    assert main(["fix", "--isolated", "--diff", str(file)]) == 0
    assert capfd.readouterr().out == ""


def test_answers_with_trees(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "answers.jsonl"
    file.write_text(json.dumps({"response": f"So: {STAR}"}) + "\n", encoding="utf-8")
    main(["fix", "--isolated", str(file)])
    (line,) = capfd.readouterr().out.splitlines()
    assert json.loads(line) == {"response": STAR.replace("Star", "WithMemory")}


def test_an_editor_and_a_model_are_offered_them() -> None:
    report = check_text(STAR, "tree.xml", CheckOptions())
    (finding,) = (each for each in report.findings if each.severity is Severity.ERROR)
    (offered,) = proved(STAR, "tree.xml", finding, CheckOptions())
    assert (offered.title, offered.safe) == ("'SequenceStar' changed to 'SequenceWithMemory'", True)
    lines = (
        TREE.replace(">", ">\n")
        .replace("</B", "\n</B")
        .format("<SequenceStar>\n<A/>\n<B/>\n</SequenceStar>")
    )
    report = check_text(lines, "tree.xml", CheckOptions())
    (finding,) = (each for each in report.findings if each.severity is Severity.ERROR)
    assert Suggestions()(report, finding)[0] == "<SequenceWithMemory>"


def test_hostile_trees_end() -> None:
    for text in (
        "<BehaviorTree/>" * 3_000,
        "<root><BehaviorTree>" + "<SubTree ID='x'/>" * 2_000 + "</BehaviorTree></root>",
        TREE.format("<Sequence>" * 150 + "</Sequence>" * 150),
        TREE.format("<A _skipif='" + "x" * 20_000 + "'/>"),
        '<root BTCPP_format="' + "4." * 5_000 + '"><BehaviorTree/></root>',
    ):
        assert len(fix_text(text, unsafe=True).text) <= 3 * len(text)
