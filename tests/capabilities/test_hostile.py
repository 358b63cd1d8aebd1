"""Whatever a capability file holds, reading it ends with defects and not with a traceback."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import yaml
from hypothesis import example, given
from hypothesis import strategies as st

from gpsfsm.capabilities import entries as shapes
from gpsfsm.capabilities.describe import find, list_lines, show_lines
from gpsfsm.capabilities.load import Loaded, load_directories
from gpsfsm.capabilities.reading import FileModel
from gpsfsm.capabilities.table import dump, load
from gpsfsm.model.printable import printable

MODELS = [each for each in vars(shapes).values() if isinstance(each, type)]
KEYS = sorted(
    {key for model in MODELS if issubclass(model, FileModel) for key in model.model_fields}
)
SCALARS: list[Any] = [
    None, True, False, 0, 1, -1, 2.5, float("inf"), float("nan"), 10**400, "", "a", "x/Y",
    "string", "double", "int[]", "bool", "both", "failure", "interface", "provider",
    "semantic_interface", "1.2", "9", "name", "\x1b", "é", " ", "a/b/c", "<Runner a='$a'/>",
]  # fmt: skip
scalars = st.sampled_from(SCALARS)
keys = st.sampled_from(KEYS) | st.sampled_from(["a", "x/Y", "on", "", "1"])
nodes: st.SearchStrategy[Any] = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=5),
    max_leaves=20,
)
names = st.sampled_from(["a", "b", "c"])
OPTIONAL = (
    "type", "default", "aliases", "minimum", "maximum", "choices", "required", "optional",
    "fallback_parameter", "satisfiable_from", "on",
)  # fmt: skip
entries = st.lists(
    st.fixed_dictionaries(
        {"name": names | scalars}, optional=dict.fromkeys(OPTIONAL, nodes | scalars)
    ),
    max_size=3,
)
files = st.fixed_dictionaries(
    {"name": st.just("Grasp") | scalars, "implements": st.just("arm/Grasp") | nodes},
    optional={
        "spec_type": scalars,
        "spec_version": nodes,
        "definition": nodes
        | st.fixed_dictionaries(
            {
                "configuration_parameters": entries,
                "runtime_parameters": st.fixed_dictionaries({"input": entries, "output": entries}),
            }
        ),
        "outcomes": nodes,
        "duration": nodes | st.fixed_dictionaries({"min": scalars | names, "max": names | scalars}),
        "effects": nodes,
        "depends_on": nodes,
        "remappings": nodes,
        "redefines": nodes,
        "formerly": nodes,
        "default_provider": nodes,
    },
)


def is_safe(text: str) -> bool:
    return printable(text) == text


def read(content: bytes) -> Loaded:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "arm" / "providers" / "Grasp.yaml"
        file.parent.mkdir(parents=True)
        file.write_bytes(content)
        loaded = load_directories([folder])
    assert loaded.files == 1
    library = loaded.library
    entries = (*library.interfaces, *library.providers, *library.semantic)
    assert len(entries) == 1 or [each for each in loaded.defects if each.severity == "error"]
    for defect in loaded.defects:
        assert defect.line >= 1
        assert defect.column >= 1
        assert is_safe(str(defect).replace("\n    ", ""))
    assert load(dump(library)) == library
    for entry in entries:
        assert all(map(is_safe, show_lines(find(library, entry.name))))
    assert all(map(is_safe, list_lines(library)))
    return loaded


@given(files)
def test_files_that_are_nearly_right(data: Any) -> None:
    read(yaml.safe_dump(data, allow_unicode=True).encode())


@given(nodes)
def test_files_that_are_yaml(data: Any) -> None:
    read(yaml.safe_dump(data).encode())


@given(
    st.binary(max_size=200)
    | st.text(max_size=200).map(lambda text: text.encode("utf-8", "replace"))
)
@example(b"a: !!int ''")
@example(b"a: !!float ''")
@example(b"!!map x")
@example(b"- !!seq {}")
@example(b"a: !!bool maybe")
@example(b"<<: {a: 1}")
@example(b"%TAG !e! tag:e,2000:\n---\na: !e!x 1")
@example(b"a: 1\n...\nb")
@example(b"? \n: 1")
@example(b"a: 08")
@example(b"=: =")
def test_files_that_are_anything(content: bytes) -> None:
    read(content)


@given(st.text(alphabet="a:-[]{}&*!|>'\"%@#? \n\t,", max_size=60))
def test_files_that_look_like_yaml(text: str) -> None:
    read(text.encode())
