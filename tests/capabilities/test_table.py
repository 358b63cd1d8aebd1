"""The compiled table: nothing is lost, and it is up to date."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.capabilities.library import Library
from gpsfsm.capabilities.load import load_directories
from gpsfsm.capabilities.table import FILE, builtin, dump, load, main, relative
from gpsfsm.errors import InternalError
from gpsfsm.model.capability import (
    Effects,
    Filling,
    Input,
    Interface,
    Leaf,
    Outcomes,
    Output,
    Parameter,
    Permission,
    PromptBuffer,
    Provider,
    SemanticInterface,
    Source,
    Span,
    ValueType,
)
from gpsfsm.model.event import Event
from gpsfsm.model.ros import (
    Comparison,
    Condition,
    Durability,
    OnResume,
    Quality,
    Reliability,
    RosCall,
    RosKind,
)
from gpsfsm.workers.codec import decode, encode
from tests.capabilities.support import INTERFACE, PROVIDER, write

RUNNERS = Path(gpsfsm.__file__).parents[1] / "runners"

texts = st.text(max_size=4)
many = st.lists(texts, max_size=2).map(tuple)
numbers = st.floats(allow_nan=False) | st.integers()
values = st.booleans() | numbers | texts
defaults = st.none() | values
triples = st.lists(st.tuples(texts, texts, texts), max_size=2).map(tuple)
limits = st.none() | st.floats(allow_nan=False)
parameters = st.builds(
    Parameter, texts, st.sampled_from(ValueType), st.booleans(), defaults, texts, many,
    limits, limits, many, texts,
)  # fmt: skip
inputs = st.builds(
    Input, texts, st.sampled_from(ValueType), st.booleans(), defaults, texts, many,
    st.lists(st.sampled_from(Source), max_size=2).map(tuple), texts, texts, st.booleans(), texts,
)  # fmt: skip
outputs = st.builds(
    Output, texts, st.sampled_from(ValueType), st.sampled_from(Event), st.booleans(),
    st.booleans(), texts, many, texts, texts,
)  # fmt: skip
spans = st.none() | st.builds(Span, numbers | texts, st.none() | numbers | texts)
outcomes = st.builds(
    Outcomes, st.booleans(), st.booleans(), st.booleans(),
    st.lists(st.tuples(texts, values), max_size=2).map(tuple),
)  # fmt: skip
effects = st.builds(Effects, st.none() | st.builds(PromptBuffer, texts, texts, texts), texts)
pairs = st.lists(st.tuples(texts, texts), max_size=2).map(tuple)
listed = st.recursive(values, lambda inner: st.lists(inner, max_size=2).map(tuple), max_leaves=4)
requests = st.lists(st.tuples(texts, listed), max_size=2).map(tuple)
conditions = st.builds(Condition, texts, st.sampled_from(Comparison), values)
successes = st.lists(st.lists(conditions, max_size=2).map(tuple), max_size=2).map(tuple)
seconds = st.floats(0, 100)
qualities = st.builds(
    Quality, st.none() | st.sampled_from(Reliability), st.none() | st.sampled_from(Durability),
    st.integers(1, 1_000),
)  # fmt: skip
calls = st.none() | st.builds(
    RosCall, st.sampled_from(RosKind), texts, many, requests, many, pairs, pairs, texts, successes,
    texts, pairs, successes, qualities, seconds, st.booleans(), seconds, seconds,
    seconds, seconds, st.sampled_from(OnResume),
)  # fmt: skip
providers = st.builds(
    Provider, texts, texts, texts, texts, texts, texts, st.booleans(),
    st.lists(parameters, max_size=2).map(tuple), st.lists(inputs, max_size=2).map(tuple),
    st.lists(outputs, max_size=2).map(tuple),
    st.lists(st.tuples(texts, texts), max_size=2).map(tuple), triples,
    outcomes, spans, spans, many, effects,
    st.lists(st.tuples(st.sampled_from(Permission), texts), max_size=2).map(tuple), st.booleans(),
    calls, texts, texts, st.booleans(),
)  # fmt: skip
interfaces = st.builds(Interface, texts, texts, texts, texts, texts, many, texts)
semantics = st.builds(SemanticInterface, texts, texts, texts, triples, texts, texts)
fillings = st.builds(
    Filling, texts, texts, st.none() | texts,
    st.lists(st.tuples(st.integers(), st.integers()), max_size=2).map(tuple),
    st.floats(allow_nan=False), st.booleans(),
)  # fmt: skip
leaves = st.builds(Leaf, texts, texts, st.lists(fillings, max_size=2).map(tuple), pairs)
libraries = st.builds(
    Library,
    st.lists(interfaces, max_size=2).map(tuple),
    st.lists(providers, max_size=2).map(tuple),
    st.lists(semantics, max_size=2).map(tuple),
    st.booleans(),
    st.lists(leaves, max_size=2).map(tuple),
    pairs,
)


@given(libraries)
def test_nothing_is_lost(library: Library) -> None:
    text = dump(library)
    loaded = load(text)
    assert loaded == library
    assert repr(loaded) == repr(library), "types of values are kept as well"
    assert dump(loaded) == text
    assert text.isascii()


@given(libraries)
def test_it_is_the_same_in_another_process(library: Library) -> None:
    assert repr(decode(Library, encode(library))) == repr(library)


def test_a_default_of_zero_is_not_false() -> None:
    library = Library(
        providers=(
            Provider(
                "a/B",
                "a/B",
                configuration=tuple(Parameter(name, default=0) for name in "ab"),
                outcomes=Outcomes(unless=(("a", False), ("b", 0))),
                duration=Span(0, 1),
            ),
        )
    )
    assert repr(load(dump(library))) == repr(library)


def test_one_entry_is_one_line_without_defaults() -> None:
    library = Library(
        (Interface("a/B"), Interface("a/C", deprecated="why")), (Provider("a/B", "a/B"),)
    )
    assert dump(library) == (
        '{"version":1,\n"complete":false,\n"interfaces":[\n{"name":"a/B"},\n'
        '{"name":"a/C","deprecated":"why"}],\n"providers":[\n'
        '{"name":"a/B","implements":"a/B"}],\n"semantic":[]}\n'
    )


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        '{"version":2}',
        '{"version":1,"complete":false,"interfaces":[{"nam":1}],"providers":[],"semantic":[]}',
        '{"version":1,"complete":false,"interfaces":[],"providers":[{}],"semantic":[]}',
        '{"version":1,"complete":false,"interfaces":[],"providers":[],"semantic":[7]}',
    ],
)
def test_a_damaged_table_is_no_traceback(text: str) -> None:
    with pytest.raises(InternalError, match="the table of capabilities"):
        load(text)


def test_the_builtin_table_is_that_of_the_files() -> None:
    loaded = load_directories([RUNNERS])
    assert loaded.defects == ()
    assert len(loaded.library.interfaces) > 20
    assert builtin() == relative(loaded.library, RUNNERS)
    assert main([str(RUNNERS), "--check"]) == 0


def test_reading_the_table_needs_neither_yaml_nor_pydantic() -> None:
    program = (
        "import sys; from gpsfsm.capabilities.table import builtin; assert builtin().interfaces; "
        "print([name for name in ('yaml', 'pydantic', 'networkx', 'z3') if name in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, check=True, timeout=60
    )
    assert done.stdout.strip() == b"[]"


def test_the_table_is_written_and_compared(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "mine"
    files: dict[str, str | bytes] = {
        "x/arm/interfaces/Grasp.yaml": INTERFACE,
        "x/arm/providers/Grasp.yaml": PROVIDER,
    }
    write(folder, files)
    assert main([str(folder), "--check"]) == 1
    assert "is not up to date" in capsys.readouterr().err
    assert main([str(folder)]) == 0
    assert main([str(folder), "--check"]) == 0
    table = json.loads((folder / FILE).read_text())
    assert table["interfaces"][0]["origin"] == "mine/x/arm/interfaces/Grasp.yaml"
    write(folder, {"x/arm/providers/Grasp.yaml": PROVIDER + "runner: new\n"})
    assert main([str(folder), "--check"]) == 1


def test_no_table_is_made_of_files_with_defects(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path, {"x/arm/providers/Grasp.yaml": PROVIDER})
    assert main([str(tmp_path)]) == 1
    assert "Grasp.yaml:4:1: warning: it implements 'arm/Grasp'" in capsys.readouterr().err
    assert not (tmp_path / FILE).exists()
    assert main([str(tmp_path / "nowhere")]) == 2
