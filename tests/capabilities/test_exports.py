"""ROS packages among the folders of capability files: what package.xml exports is read."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gpsfsm.capabilities.defects import Notes
from gpsfsm.capabilities.exports import read_package
from gpsfsm.capabilities.load import load_directories
from gpsfsm.errors import UsageError
from tests.capabilities.support import INTERFACE, PROVIDER, load, write
from tests.cases import many

if TYPE_CHECKING:
    from pathlib import Path

FILES: dict[str, str | bytes] = {
    "interfaces/Grasp.yaml": INTERFACE,
    "providers/Grasp.yaml": PROVIDER,
}


def manifest(*exports: str, name: str = "arm") -> str:
    lines = "\n".join(exports)
    return f"<package>\n<name>{name}</name>\n<export>\n{lines}\n</export>\n</package>\n"


INTERFACES = "<capability_interface>interfaces/Grasp.yaml</capability_interface>"
PROVIDERS = "<capability_provider>providers/Grasp.yaml</capability_provider>"


def package(folder: Path, *exports: str, **files: str) -> list[str]:
    """The defects of a folder with one package, whose files are those of FILES and more."""
    more = {name.replace("__", "/") + ".yaml": text for name, text in files.items()}
    loaded = load(folder / "arm", {**FILES, **more, "package.xml": manifest(*exports)})
    return [str(defect).replace(f"{folder}/", "") for defect in loaded.defects]


def test_what_is_exported_is_read(tmp_path: Path) -> None:
    assert package(tmp_path, INTERFACES, PROVIDERS) == []
    library = load_directories([tmp_path]).library
    assert [each.name for each in library.providers] == ["arm/Grasp"]


def test_a_path_is_read_as_the_server_reads_it(tmp_path: Path) -> None:
    """Without blanks, wherever they are, and without a slash before it."""
    exports = "<capability_interface>\n  /interfaces/Gra sp.yaml\n</capability_interface>"
    assert package(tmp_path, exports, PROVIDERS) == []


def test_a_file_that_is_missing_is_told_at_its_place(tmp_path: Path) -> None:
    exports = "<capability_provider>\n   providers/Grap.yaml </capability_provider>"
    assert package(tmp_path, INTERFACES, PROVIDERS, exports) == [
        "arm/package.xml:7:4: error: it exports 'providers/Grap.yaml', but there is no such file\n"
        "    did you mean 'Grasp.yaml'?"
    ]


def test_a_file_that_is_not_exported_is_left_out(tmp_path: Path) -> None:
    let_go = INTERFACE.replace("Grasp", "LetGo")
    loaded = package(tmp_path, INTERFACES, PROVIDERS, interfaces__LetGo=let_go, notes="a: 1\n")
    assert len(loaded) == 1, "other YAML files are nobody's business"
    assert loaded[0].startswith("arm/interfaces/LetGo.yaml:1:1: warning: ")
    assert (
        "does not export this file, so the robot does not see it, and it is left out" in loaded[0]
    )
    names = load_directories([tmp_path]).library.interface_names
    assert names == ("arm/Grasp",)


def test_files_around_a_package_are_read_as_ever(tmp_path: Path) -> None:
    package(tmp_path, INTERFACES, PROVIDERS)
    write(tmp_path, {"leg/interfaces/Step.yaml": INTERFACE.replace("Grasp", "Step")})
    assert load_directories([tmp_path]).library.interface_names == ("arm/Grasp", "leg/Step")


def test_a_file_that_lies_elsewhere_gets_kind_and_package_of_its_export(tmp_path: Path) -> None:
    bare = "name: Talk\nspec_version: 1.1\n"
    exports = "<capability_interface>talk.yaml</capability_interface>"
    loaded = load(
        tmp_path / "src", {"talk.yaml": bare, "package.xml": manifest(exports, name="hello")}
    )
    assert loaded.library.interface_names == ("hello/Talk",)


def test_a_package_inside_another_one_has_its_own_exports(tmp_path: Path) -> None:
    outer = "<capability_interface>inner/interfaces/Grasp.yaml</capability_interface>"
    inner = {f"inner/{name}": text for name, text in FILES.items()}
    loaded = load(
        tmp_path,
        {
            **inner,
            "inner/package.xml": manifest(PROVIDERS),
            "package.xml": manifest(outer, name="o"),
        },
    )
    assert loaded.library.interface_names == ("o/Grasp",)
    assert [each.name for each in loaded.library.providers] == ["arm/Grasp"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "1:1: error: this is not well-formed XML: no element found"),
        ("<package>", "1:10: error: this is not well-formed XML"),
        ("<robot/>", "1:1: error: this cannot be read: its outermost element is <robot>"),
        (
            '<!DOCTYPE a [<!ENTITY b "c">]>\n<package>&b;</package>',
            "a document type is not allowed",
        ),
        ('<?xml version="1.0" encoding="klingon"?><package/>', "error: this "),
        (b"\xff\xfe\x00", "error: this "),
        ("<package>" + " " * (1 << 20) + "</package>", "1:1: error: the file is larger than"),
        (manifest("<capability_provider/>"), "4:1: error: <capability_provider> names no file"),
        (
            manifest(PROVIDERS.replace(">prov", ">../arm/prov")),
            "'../arm/providers/Grasp.yaml' is outside",
        ),
        (
            manifest(PROVIDERS.replace(">prov", ">//prov")),
            "'/providers/Grasp.yaml' is not a file of this",
        ),
        (manifest(PROVIDERS.replace("Grasp", "a" * 300)), "there is no such file"),
        (manifest(PROVIDERS, PROVIDERS), "5:22: warning: it exports 'providers/Grasp.yaml' twice"),
        (
            manifest().replace("</package>", f"<export>{PROVIDERS}</export></package>"),
            "is in a second <export>, which the robot does not read",
        ),
        (
            manifest("<capability_interface>providers/Grasp.yaml</capability_interface>"),
            "spec_type is provider, but its package.xml says interface",
        ),
    ],
)
def test_what_is_wrong_with_a_package_is_told(
    tmp_path: Path, text: str | bytes, expected: str
) -> None:
    other = {"leg/interfaces/Step.yaml": INTERFACE.replace("Grasp", "Step")}
    arm = {f"arm/{name}": content for name, content in FILES.items()}
    loaded = load(tmp_path, {**arm, **other, "arm/package.xml": text})
    assert "leg/Step" in loaded.library.interface_names
    assert any(expected in str(defect) for defect in loaded.defects), loaded.defects


def test_a_folder_of_which_nothing_is_exported_says_so(tmp_path: Path) -> None:
    with pytest.raises(UsageError) as raised:
        package(tmp_path)
    assert "no capability file in it can be used, by what package.xml says" in str(raised.value)
    assert "does not export this file (1 more of this package likewise)" in str(raised.value)


def test_a_package_that_cannot_be_read_says_why(tmp_path: Path) -> None:
    write(tmp_path, {**FILES, "package.xml": "<package>"})
    with pytest.raises(UsageError) as raised:
        load_directories([tmp_path])
    assert "package.xml:1:10: error: this is not well-formed XML" in str(raised.value)


TAGS = [
    f"<{end}{tag}>"
    for tag in ("package", "export", "name", "capability_provider")
    for end in ("", "/")
]
PIECES = [
    *TAGS,
    INTERFACES,
    "a/b",
    "&amp;",
    "&x;",
    "<!DOCTYPE a>",
    "]]>",
    "<![CDATA[",
    "<!--",
    "-->",
]
PIECES += ["\n", "é", "\x00", "<?xml version='1.0'?>", "..", "/"]


@settings(max_examples=many(300))
@given(st.lists(st.sampled_from(PIECES) | st.text(max_size=3), max_size=12))
def test_no_text_of_a_package_does_harm(
    tmp_path_factory: pytest.TempPathFactory, pieces: list[str]
) -> None:
    folder = tmp_path_factory.getbasetemp() / "hostile"
    text = "".join(pieces).encode("utf-8", "surrogatepass")
    write(folder, {"package.xml": text})
    notes = Notes("package.xml")
    read = read_package(str(folder / "package.xml"), str(folder), notes)
    assert (read.exports is None) <= bool(notes.defects)
    lines = text.count(b"\n") + 2
    assert all(0 < each.line <= lines and each.column > 0 for each in notes.defects)
