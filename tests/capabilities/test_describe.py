"""Finding capabilities by name, and saying what they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.capabilities.describe import (
    find,
    least_files,
    list_lines,
    runner_line,
    show_data,
    show_lines,
)
from gpsfsm.capabilities.files import has_place
from gpsfsm.capabilities.library import Library, Match, builtin_capabilities
from gpsfsm.capabilities.table import builtin
from gpsfsm.errors import UsageError
from gpsfsm.model.capability import (
    Input,
    Interface,
    Parameter,
    Provider,
    SemanticInterface,
    Source,
    ValueType,
)
from gpsfsm.syntax import parse
from tests.capabilities.support import INTERFACE, describe, load
from tests.capabilities.test_load import FULL, PROVIDER

LIBRARY = Library(
    interfaces=(
        Interface("arm/Grasp", "Grasps.", formerly=("old/Grab",), origin="runners/arm/a/b/c.yaml"),
        Interface("arm/Lift", deprecated="it broke", origin="x/lift.yaml"),
        Interface("leg/Lift", origin="x/y.yaml"),
    ),
    providers=(
        Provider("arm/Fast", "arm/Grasp"),
        Provider("arm/Grasp", "arm/Grasp"),
        Provider("arm/Lone", "arm/Gone"),
    ),
    semantic=(SemanticInterface("home/Grasp2", "arm/Grasp", origin="z.yaml"),),
)


@pytest.mark.parametrize(
    ("wanted", "name"),
    [
        ("arm/Grasp", "arm/Grasp"),
        ("Grasp", "arm/Grasp"),
        ("old/Grab", "arm/Grasp"),
        ("Grasp2", "home/Grasp2"),
        ("Lone", "arm/Lone"),
    ],
)
def test_names_that_people_write(wanted: str, name: str) -> None:
    assert find(LIBRARY, wanted).name == name


def test_the_default_provider_comes_first() -> None:
    example = find(LIBRARY, "Grasp")
    assert [provider.name for provider in example.providers] == ["arm/Grasp", "arm/Fast"]
    assert [provider.name for provider in find(LIBRARY, "Lone").providers] == ["arm/Lone"]
    assert find(LIBRARY, "Lone").interface is None


@pytest.mark.parametrize(
    ("wanted", "message"),
    [
        ("Lift", "'Lift' is the name of several capabilities; write 'arm/Lift' or 'leg/Lift'"),
        (
            "arm/Grsp",
            "there is no capability 'arm/Grsp'; did you mean 'arm/Grasp' or 'home/Grasp2'?",
        ),
        ("Gra", "there is no capability 'Gra'; did you mean 'arm/Grasp' or 'home/Grasp2'?"),
        ("Xyz", "there is no capability 'Xyz'; 'gpsfsm capabilities list' lists them"),
        ("", "there is no capability ''; 'gpsfsm capabilities list' lists them"),
    ],
)
def test_names_that_mean_nothing(wanted: str, message: str) -> None:
    with pytest.raises(UsageError) as caught:
        find(LIBRARY, wanted)
    assert str(caught.value) == message


def test_the_list_is_aligned() -> None:
    assert list(list_lines(LIBRARY)) == [
        "arm/Grasp    arm          arm/Grasp, arm/Fast",
        "arm/Lift     x/lift.yaml  no provider (deprecated)",
        "home/Grasp2  z.yaml       arm/Grasp, arm/Fast (redefines arm/Grasp)",
        "leg/Lift     x/y.yaml     no provider",
    ]


def test_long_names_do_not_widen_the_list() -> None:
    library = Library(
        interfaces=(Interface("arm/" + "a" * 100), Interface("arm/B")),
        providers=(Provider("arm/" + "c" * 100, "arm/B"),),
    )
    assert [len(line.split()[0]) for line in list_lines(library)] == [5, 60]
    assert max(map(len, list_lines(library))) < 140


def test_a_provider_is_written_with_its_interface() -> None:
    line = '<Runner interface="arm/Grasp" provider="arm/Fast"/>'
    example = find(LIBRARY, "Fast")
    lines = [shown.strip() for shown in show_lines(example)]
    assert line in lines
    assert "implements arm/Grasp" in lines
    assert show_data(example)["providers"][0]["runner_line"] == line
    # a semantic interface is written as it is
    assert (
        'interface="home/Grasp2"'
        in show_data(find(LIBRARY, "Grasp2"))["providers"][0]["runner_line"]
    )


def test_everything_is_shown(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {
        "arm/interfaces/Grasp.yaml": INTERFACE + "formerly: [old/Grab]\n",
        "arm/providers/Grasp.yaml": PROVIDER + FULL,
    }
    library = load(tmp_path, files).library
    lines = [line.replace(f"{tmp_path}/", "") for line in show_lines(find(library, "Grasp"), 200)]
    assert lines == EXPECTED.splitlines()


EXPECTED = """\
arm/Grasp (interface)
File: arm/interfaces/Grasp.yaml
In other dialects: old/Grab

Provider arm/Grasp
  Closes the gripper.
  deprecated: too old
  parameters:
    uuid     string    required
    flush    bool      = false       Send it.
    timeout  double    = 5.0         From 0 to 9. Also called go.
    mode     string    = off         One of on, off.
    count    int       optional
    any                = 7
    names    string[]  = ["a", "b"]
  inputs:
    plan  string  required  Also called p. From upstream.
    x     double  optional  From upstream, external.
    uuid  string  required  From configuration.
  outputs:
    answer  string  on success
    code    int     on success, optional, status
    code    int     on failure, optional, status
    why     string  on failure
  never fails, unless flush is true
  may hang
  takes 0.5 s to timeout (a parameter)
  uses 0 J to 20 J
  holds arm, gripper
  depends on arm/Grasp (arm/Grasp)
  fills the prompt buffer of uuid, or flushes it if flush is true
  makes plan the next plan
  file: arm/providers/Grasp.yaml
  in a plan:
    <Runner interface="arm/Grasp" provider="arm/Grasp" uuid="…"/>
  with all parameters:
    <Runner interface="arm/Grasp" provider="arm/Grasp" uuid="…" flush="false" timeout="5.0" \
mode="off" count="0" any="7" names='["a", "b"]' x="0.0"/>
"""


def test_hostile_texts_are_escaped() -> None:
    library = Library(
        (Interface("a/B", "red \x1b[31m", origin="\x07.yaml"),), (Provider("a/B", "a/B"),)
    )
    for lines in (list_lines(library), show_lines(find(library, "B"))):
        assert all(line.isprintable() for line in lines)


@pytest.mark.parametrize(
    ("parameter", "written"),
    [
        (Parameter("a", ValueType.DOUBLE, True), "0.0"),
        (Parameter("a", ValueType.DOUBLE, True, minimum=2.0), "2.0"),
        (Parameter("a", ValueType.INT, True, minimum=2.0), "2"),
        (Parameter("a", ValueType.DOUBLE, True, maximum=-2.0), "-2.0"),
        (Parameter("a", ValueType.BOOL, True), "false"),
        (Parameter("a", ValueType.STRING, True, choices=("x<", "y")), "x&lt;"),
        (Parameter("a", ValueType.STRING, True), "…"),
    ],
)
def test_the_runner_line_has_values_of_the_right_type(parameter: Parameter, written: str) -> None:
    provider = Provider("p/Q", "i/J", configuration=(parameter,))
    assert runner_line("i/J", provider) == f'<Runner interface="i/J" provider="p/Q" a="{written}"/>'


def test_the_runner_line_has_no_values_that_must_arrive() -> None:
    provider = Provider(
        "p/Q",
        "p/Q",
        configuration=(Parameter("a", required=True), Parameter("b", required=True)),
        inputs=(
            Input("a", required=True),
            Input("b", required=True, satisfiable_from=(Source.CONFIGURATION,)),
            Input("c", required=True, satisfiable_from=(Source.UPSTREAM, Source.EXTERNAL)),
            Input("d", satisfiable_from=(Source.EXTERNAL,)),
            Input("e", required=True),
        ),
    )
    assert runner_line("p/Q", provider).endswith('provider="p/Q" b="…" c="…"/>')


def test_every_builtin_runner_line_is_a_plan() -> None:
    library = builtin()
    after = runner_line("demo/Go", Provider("demo/Go", "demo/Go"))
    for name in library.interface_names:
        for provider in find(library, name).providers:
            for everything in (False, True):
                line = runner_line(name, provider, everything=everything)
                parsed = parse(f"<Plan>{line}{after}</Plan>")
                assert parsed.plan is not None
                assert parsed.problems == ()
                assert library.bind(parsed.plan.runners[0]) is not None


def test_data_has_every_field() -> None:
    data = show_data(find(LIBRARY, "Grasp"))
    assert data["interface"]["formerly"] == ("old/Grab",)
    assert [each["name"] for each in data["providers"]] == ["arm/Grasp", "arm/Fast"]
    assert data["providers"][0]["runner_line"].startswith("<Runner interface=")
    assert show_data(find(LIBRARY, "Lone"))["interface"] is None


# -- what is missing ------------------------------------------------------------------------

_LETTERS = "ab\u0430\u00e9\u4e00:#'\"&*{}%@,?!|>-0\\._"
_NAMES = st.builds(
    "{}/{}".format,
    st.text(_LETTERS, min_size=1, max_size=6),
    st.text(_LETTERS, min_size=1, max_size=6),
)


@given(_NAMES | st.text(max_size=5), _NAMES | st.just("") | st.text(max_size=5))
def test_the_least_files_describe_a_runner(interface: str, provider: str) -> None:
    builtin = builtin_capabilities().library
    before = builtin.resolve(interface, provider)
    files = least_files(builtin, interface, provider)
    if not files:
        names = (interface, provider or interface)
        assert before.match is not Match.UNDESCRIBED or not all(map(has_place, names))
        return
    assert describe(builtin, files, provider).resolve(interface, provider).match is Match.DESCRIBED


@pytest.mark.parametrize(
    "name",
    [
        *(
            "../Evil",
            "./Evil",
            ".hid/X",
            "a/.X",
            "a/..",
            "../..",
            "C:/Evil",
            "a\\..\\..\\b/X",
            "a/b:c",
        ),
        *("a/" + "\u4e00" * 90, "\u4e00" * 90 + "/a"),
    ],
)
def test_no_file_is_asked_for_that_lies_elsewhere_or_is_not_read(name: str) -> None:
    """A plan names them; what it names must not lead out of the folder that somebody chooses."""
    builtin = builtin_capabilities().library
    for pair in ((name, name), ("a/Say", name), (name, "a/Say"), (name, "")):
        assert least_files(builtin, *pair) == []


def test_nothing_is_missing_of_what_is_described_or_does_not_fit() -> None:
    builtin = builtin_capabilities().library
    drive = "nav2_capabilities/WaypointRunner"
    assert least_files(builtin, drive, drive) == []
    assert least_files(builtin, "a/Say", drive) == []
    assert [file.path for file in least_files(builtin, "a/Say", "a/Voice")] == [
        "a/interfaces/Say.yaml",
        "a/providers/Voice.yaml",
    ]
    assert [file.path for file in least_files(builtin, drive, "a/Drive")] == [
        "a/providers/Drive.yaml"
    ]
