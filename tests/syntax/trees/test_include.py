"""The same trees in one file and in several: the same facts, and the same runs of the engine."""

from __future__ import annotations

import os
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING

import pytest
from lxml import etree

import gpsfsm
from gpsfsm.checking.includes import joined_text
from gpsfsm.checking.inputs import Input
from gpsfsm.syntax import Limits
from tests.cases import many
from tests.checking.test_includes import check, facts_of, put, xml
from tests.oracle.btcpp import Answer, engine, play
from tests.oracle.random_trees import RandomTree

if TYPE_CHECKING:
    from collections.abc import Iterable


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def split(chance: Random) -> tuple[dict[str, str], tuple[str, ...]]:
    """A random tree in several files, the first being ``main.xml``; its leaves."""
    drawn = RandomTree(chance, most=8)
    root = etree.fromstring(drawn.text)
    trees, models = [root[0]], list(root[1])
    for number in range(chance.randint(1, 4)):
        nodes = [each for tree in trees for child in tree for each in child.iter()]
        node = chance.choice([each for each in nodes if each.tag != "SubTree"] or nodes)
        if node.tag == "SubTree":
            continue
        tree = etree.Element("BehaviorTree", ID=f"T{number}")
        node.getparent().replace(node, etree.Element("SubTree", ID=f"T{number}"))
        tree.append(node)
        trees.append(tree)
    names = ["main.xml", *chance.sample(["a.xml", "b/b.xml", "b/c.xml", "b/d/e.xml", "f.xml"], 4)]
    files = {name: etree.Element("root", BTCPP_format="4") for name in names}
    files["main.xml"].set("main_tree_to_execute", "Main")
    described = {name: etree.Element("TreeNodesModel") for name in names}
    for tree in trees:
        files[chance.choice(names)].append(tree)
    for model in models:
        described[chance.choice(names)].append(model)
    for number, name in enumerate(names[1:], start=1):
        for _ in range(1 + (chance.random() < 0.4)):  # a second time, perhaps
            other = chance.choice(names[:number])
            path = os.path.relpath(name, Path(other).parent)
            place = chance.randint(0, len(files[other]))
            files[other].insert(place, etree.Element("include", path=path))
    for name, element in described.items():
        if len(element):
            files[name].append(element)
    texts = {name: etree.tostring(each, encoding="unicode") for name, each in files.items()}
    return texts, drawn.leaves


def in_one(texts: Iterable[str]) -> str:
    """The trees and models of some files in one, in this order."""
    one = etree.Element("root", BTCPP_format="4", main_tree_to_execute="Main")
    models = etree.Element("TreeNodesModel")
    for text in texts:
        for each in list(etree.fromstring(text)):
            if each.tag == "BehaviorTree":
                one.append(each)
            elif each.tag == "TreeNodesModel":
                models.extend(list(each))
    one.append(models)
    return etree.tostring(one, encoding="unicode")


@pytest.mark.parametrize("seed", range(many(40)))
def test_the_same_facts_as_in_one_file(seed: int) -> None:
    files, _ = split(Random(seed))  # noqa: S311
    put(files)
    several = check()
    (whole,) = gpsfsm.check(in_one([files["main.xml"], *several.included.values()])).plans
    assert several.verdict is whole.verdict
    assert facts_of(several) == facts_of(whole)
    joined = joined_text(Input("main.xml"), files["main.xml"].encode(), Limits()).decode()
    (again,) = gpsfsm.check(joined).plans
    assert facts_of(again) == facts_of(whole)
    rules = [sorted(each.rule for each in plan.findings) for plan in (whole, several, again)]
    assert rules[0] == rules[1] == rules[2]


@pytest.mark.parametrize("seed", range(many(25)))
def test_the_engine_runs_both_alike(seed: int) -> None:
    engine()
    files, leaves = split(Random(seed))  # noqa: S311
    put(files)
    for number in range(3):

        def answer(name: str, visit: int, number: int = number) -> tuple[int, Answer]:
            chance = Random(f"{seed} {number} {name} {visit}")  # noqa: S311
            return chance.randint(0, 2), chance.choice(("SUCCESS", "FAILURE"))

        one = play(in_one(files.values()), leaves, answer)
        assert play(Path("main.xml").absolute(), leaves, answer) == one


@pytest.mark.parametrize(
    "order", ["a.xml b.xml", "b.xml a.xml", "a.xml b.xml a.xml", "b.xml a.xml b.xml", "c.xml b.xml"]
)
@pytest.mark.parametrize("own", [True, False])
def test_the_last_tree_of_a_name_counts_as_in_the_engine(order: str, own: bool) -> None:
    """In a.xml it succeeds, in b.xml it fails, and c.xml includes both in this order."""
    put({"a.xml": xml("Two: <AlwaysSuccess/>"), "b.xml": xml("Two: <AlwaysFailure/>")})
    put({"c.xml": xml(include="b.xml a.xml")})
    trees = ["Two: <AlwaysSuccess/>", 'Main: <SubTree ID="Two"/>']
    put({"main.xml": xml(*trees[0 if own else 1 :], include=order, main="Main")})
    plan = check()
    assert "GP806" in {each.rule for each in plan.findings}
    assert plan.facts is not None
    ends = play(Path("main.xml").absolute(), (), lambda *_: (0, "SUCCESS")).status
    assert plan.facts.completes.value == ("always" if ends == "SUCCESS" else "never")
    text = Path("main.xml").read_bytes()
    (again,) = gpsfsm.check(joined_text(Input("main.xml"), text, Limits())).plans
    assert again.facts is not None
    assert again.facts.completes is plan.facts.completes
