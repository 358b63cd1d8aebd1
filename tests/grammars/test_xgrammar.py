"""The grammars in xgrammar, the engine of vLLM and SGLang.

It comes with several gigabytes, so these tests run by ``make engines`` alone.
"""

from __future__ import annotations

import json
from functools import cache
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.capabilities.library import Capabilities, builtin_capabilities
from gpsfsm.grammars import grammars_for
from tests.grammars.engines import Engines, sentence
from tests.grammars.libraries import canonical_plans, capabilities

pytestmark = pytest.mark.slow

LIBRARY = builtin_capabilities().library


@cache
def builtin() -> Engines:
    return Engines.of(builtin_capabilities())


def xgrammar() -> Any:
    if find_spec("xgrammar") is None:
        pytest.skip("xgrammar is not installed: make engines")
    return import_module("xgrammar")


@cache
def compiled(kind: str) -> Any:
    text = dict(grammars_for(builtin_capabilities()))
    if kind == "gbnf":
        return xgrammar().Grammar.from_ebnf(text[kind])
    return xgrammar().Grammar.from_json_schema(text[kind], any_whitespace=False)


def is_sentence(grammar: Any, text: str) -> bool:
    return bool(import_module("xgrammar.testing")._is_grammar_accept_string(grammar, text))


def accepts(kind: str, text: str) -> bool:
    return is_sentence(compiled(kind), text)


@given(canonical_plans(LIBRARY))
def test_canonical_plans_are_accepted(text: str) -> None:
    assert accepts("gbnf", text)


@given(st.randoms(use_true_random=True))
def test_sentences_are_accepted(random: Any) -> None:
    assert accepts("gbnf", sentence("gbnf", builtin().gbnf, random))


@given(capabilities(), st.randoms(use_true_random=True))
def test_sentences_over_any_library_are_accepted(library: Capabilities, random: Any) -> None:
    (gbnf,) = (text for kind, text in grammars_for(library, depth=2) if kind == "gbnf")
    assert is_sentence(xgrammar().Grammar.from_ebnf(gbnf), sentence("gbnf", gbnf, random))


@given(canonical_plans(LIBRARY, depth=2), st.data())
def test_mutants_are_judged_alike(text: str, data: st.DataObject) -> None:
    place = data.draw(st.integers(0, len(text) - 1))
    wild = data.draw(st.sampled_from([*'<>"/= &;$\n\t{x0.-', "\x01", "é", "\ufffe", ""]))
    mutant = text[:place] + wild + text[place + 1 :]
    assert accepts("gbnf", mutant) == builtin().verdicts(mutant)["llguidance gbnf"]


@pytest.mark.parametrize(
    ("step", "accepted"),
    [
        ({"interface": "generic_capabilities/WaitRunner", "parameters": {"seconds": 2}}, True),
        ({"interface": "generic_capabilities/WaitRunner", "parameters": {"seconds": "2"}}, False),
        ({"interface": "generic_capabilities/WaitRunner", "parameters": {}}, False),
        ({"interface": "generic_capabilities/WaitRunner"}, False),
        ({"interface": "generic_capabilities/FlyRunner"}, False),
        ({"control": "recovery", "steps": []}, False),
    ],
)
def test_trees(step: dict[str, Any], accepted: bool) -> None:
    assert accepts("json-schema", json.dumps({"plan": [step]})) is accepted
