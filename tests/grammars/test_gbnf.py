"""Our GBNF is read by llama.cpp's rules and says there what it says elsewhere."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.grammars import grammars_for
from gpsfsm.grammars.emit.json_schema import schema
from gpsfsm.grammars.writable import alphabet
from tests.grammars.engines import Engines, errors, sentence
from tests.grammars.gbnf import Gbnf
from tests.grammars.libraries import canonical_plans, capabilities

if TYPE_CHECKING:
    from random import Random

    from gpsfsm.capabilities.library import Capabilities

LIBRARY = builtin_capabilities().library
RANDOM = st.randoms(use_true_random=False)
WILD = (
    *'<>"/= &;$\n\t{x0.-\\[]^',
    "\x00",
    "\x01",
    "\x7f",
    "\u00e9",
    "\ufffe",
    "\u2003",
    "\U0001f600",
)


@cache
def builtin() -> tuple[Engines, Gbnf]:
    engines = Engines.of(builtin_capabilities())
    return engines, Gbnf(engines.gbnf)


def mutants(text: str) -> st.SearchStrategy[str]:
    def mutant(place: int, wild: str, removed: int) -> str:
        return text[:place] + wild + text[place + removed :]

    places = st.integers(0, len(text))
    return st.builds(mutant, places, st.sampled_from(("", *WILD)), st.integers(0, 2))


@pytest.mark.parametrize(
    ("grammar", "inside", "outside"),
    [
        ('root ::= "ab"{2,3}\n', ["abab", "ababab"], ["ab", "abb", "abababab", ""]),
        ('root ::= "a"? [^b-d\\]]+ # end\n', ["a", "ax", "xyz"], ["", "ab", "]"]),
        (
            'root ::= (x | "\\x41" |\n "\\\\")*\nx ::= "\\"-"\n',
            ["", '"-A\\"-'],
            ["-", '"', "\\\\x"],
        ),
        ("root ::= [a-]{2}", ["a-", "--"], ["a", "ab"]),
    ],
)
def test_the_recogniser(grammar: str, inside: list[str], outside: list[str]) -> None:
    read = Gbnf(grammar)
    assert [text for text in [*inside, *outside] if read.accepts(text)] == inside


@pytest.mark.parametrize(
    "grammar",
    [
        *(
            'root ::= "a',
            'root ::= "\\d"',
            "root ::= [a",
            "root ::= x",
            'root ::= x_y\nx_y ::= "a"',
        ),
        *('root = "a"', 'root ::= ("a"', 'root ::= "a"{2000}', 'root ::= root "a"', 'x ::= "a"'),
        *('root ::= "\\u00g0"', 'root ::= "a" ]', 'root ::= "a"\nroot ::= "b"'),
    ],
)
def test_what_llama_cpp_does_not_read(grammar: str) -> None:
    with pytest.raises(ValueError, match=r"."):
        Gbnf(grammar)


@given(canonical_plans(LIBRARY), st.data())
def test_plans_and_mutants(text: str, data: st.DataObject) -> None:
    engines, read = builtin()
    assert read.accepts(text)
    mutant = data.draw(mutants(text))
    assert read.accepts(mutant) is engines.verdicts(mutant)["lark"]


@given(capabilities(), RANDOM, st.data())
def test_sentences_over_any_library_are_plans_without_errors(
    library: Capabilities, random: Random, data: st.DataObject
) -> None:
    engines = Engines.of(library, depth=2)
    read = Gbnf(engines.gbnf)
    text = sentence("gbnf", engines.gbnf, random)
    assert read.accepts(text)
    assert set(engines.verdicts(text).values()) == {True}
    assert errors(text, library) == []
    mutant = data.draw(mutants(text))
    assert read.accepts(mutant) is engines.verdicts(mutant)["llguidance gbnf"]


@pytest.mark.parametrize("depth", [1, 32])
def test_grammars_of_any_depth(depth: int) -> None:
    for constraint, text in grammars_for(builtin_capabilities(), depth=depth):
        if constraint == "gbnf":
            assert not Gbnf(text).accepts("<Plan>\n</Plan>")


_KEYWORDS = {
    *("type", "properties", "required", "additionalProperties", "enum", "anyOf", "items"),
    *("minItems", "maxItems", "minimum", "maximum"),
}


@given(capabilities())
def test_schemas_have_only_what_ollama_turns_into_a_grammar(library: Capabilities) -> None:
    """Its converter reads these; what it does not know it may ignore without a word."""

    def visit(part: dict[str, object]) -> None:
        assert set(part) <= _KEYWORDS, part
        if part.get("type") != "integer":  # bounds of other numbers are ignored: check finds them
            assert part.get("type") == "number" or not {"minimum", "maximum"} & set(part)
        assert part.get("maxItems", 0) < 2000  # type: ignore[operator]
        inner = [*part.get("anyOf", ()), *part.get("properties", {}).values()]  # type: ignore[attr-defined,misc]
        inner += [part["items"]] if "items" in part else []
        for each in inner:
            visit(each)

    generated = schema(alphabet(library.library), 2)
    Draft202012Validator.check_schema(generated)
    visit(generated)
