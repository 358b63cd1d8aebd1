"""Files that behaviour trees include: which are read, and what is said of those that are not."""

from __future__ import annotations

import json
import os
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar
from xml.sax.saxutils import quoteattr

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import gpsfsm
from gpsfsm.analysis.rules import rule
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.checking.includes import MOST_INCLUDED, MOST_INCLUDES, joined_text
from gpsfsm.checking.inputs import Input, parse_named
from gpsfsm.cli import main
from gpsfsm.files import read
from gpsfsm.gating.gate_call import gate
from gpsfsm.model.finding import Problem, Severity
from gpsfsm.model.report import PlanReport, Verdict
from gpsfsm.report import format_names, render
from gpsfsm.syntax import Limits
from tests.cases import many
from tests.cli.support import run

if TYPE_CHECKING:
    from collections.abc import Mapping

needs_links = pytest.mark.skipif(os.name == "nt", reason="links need a privilege on Windows")
needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")


def xml(*trees: str, include: str = "", main: str = "", models: str = "") -> str:
    """A file of trees: each ``ID: body``; ``include`` are paths with blanks between them."""
    attribute = f' main_tree_to_execute="{main}"' if main else ""
    lines = [f'<root BTCPP_format="4"{attribute}>']
    lines += [f'  <include path="{path}"/>' for path in include.split()]
    for tree in trees:
        name, _, body = tree.partition(": ")
        lines += [f'  <BehaviorTree ID="{name}">', f"    {body}", "  </BehaviorTree>"]
    lines += [f"  <TreeNodesModel>{models}</TreeNodesModel>"] if models else []
    return "\n".join([*lines, "</root>", ""])


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")


def put(files: Mapping[str, str]) -> None:
    """Write files; parts of their paths are made."""
    for name, text in files.items():
        Path(name).parent.mkdir(parents=True, exist_ok=True)
        Path(name).write_text(text, encoding="utf-8")


def check(path: str = "main.xml", **options: Any) -> PlanReport:
    (plan,) = gpsfsm.check(Path(path), **options).plans
    return plan


def places(plan: PlanReport, rule: str = "") -> list[tuple[str, str, int]]:
    return [
        (each.rule, each.location.file, each.location.line)
        for each in plan.findings
        if each.rule == rule or (not rule and each.severity is not gpsfsm.Severity.INFO)
    ]


def refused(plan: PlanReport) -> str:
    """The message about the only include element that was not read."""
    assert plan.verdict is Verdict.UNDECIDED
    (message,) = (each.message for each in plan.findings if each.rule == "GP813")
    return message


ARM = {
    "main.xml": xml(
        'Main: <Sequence><SubTree ID="Arm"/><Drive/></Sequence>', include="arm/arm.xml", main="Main"
    ),
    "arm/arm.xml": xml(
        'Arm: <Fallback><SubTree ID="Grip"/><Home/></Fallback>', include="../grip/grip.xml"
    ),
    "grip/grip.xml": xml("Grip: <Sequence><Open/><Close/></Sequence>"),
}
ALL_ARM = xml(
    'Main: <Sequence><SubTree ID="Arm"/><Drive/></Sequence>',
    'Arm: <Fallback><SubTree ID="Grip"/><Home/></Fallback>',
    "Grip: <Sequence><Open/><Close/></Sequence>",
    main="Main",
)


def facts_of(plan: PlanReport) -> Any:
    """The facts, with elements named by their place in their tree."""

    def inner(value: object) -> object:
        if isinstance(value, str):
            return value.rpartition("/BehaviorTree[")[2].partition("]/")[2] or value
        if isinstance(value, dict):
            return {key: inner(each) for key, each in value.items()}
        if isinstance(value, list | tuple):
            return sorted((inner(each) for each in value), key=str)
        return value

    return None if plan.facts is None else inner(asdict(plan.facts))


class TestReading:
    def test_files_within_files(self) -> None:
        put(ARM)
        plan = check()
        assert plan.verdict is Verdict.ACCEPTED
        assert [*plan.included] == ["arm/arm.xml", "grip/grip.xml"]
        assert facts_of(plan) == facts_of(gpsfsm.check(ALL_ARM).plans[0])

    def test_a_file_is_read_once_however_often_it_is_included(self) -> None:
        more = '  <include path="./arm/arm.xml"/>\n  <include path="grip/grip.xml"/>\n  <include'
        put(ARM | {"main.xml": ARM["main.xml"].replace("  <include", more)})
        plan = check()
        assert plan.verdict is Verdict.ACCEPTED
        assert [*plan.included] == ["arm/arm.xml", "grip/grip.xml"]

    def test_the_only_tree_may_be_in_another_file(self) -> None:
        put({"main.xml": xml(include="a.xml"), "a.xml": xml("A: <Go/>")})
        plan = check()
        assert plan.verdict is Verdict.ACCEPTED
        assert plan.facts is not None
        assert plan.facts.runners == 1

    def test_a_path_begins_at_the_folder_of_its_file(self) -> None:
        put({"t/main.xml": xml(include="a.xml"), "t/a.xml": xml("A: <Go/>"), "a.xml": "<root"})
        assert [*check("t/main.xml").included] == ["t/a.xml"]

    def test_a_folder_that_was_named_is_the_root(self) -> None:
        put({"t/main.xml": xml(include="../common/a.xml"), "common/a.xml": xml("A: <Go/>")})
        assert "is outside of the folder t" in refused(check("t/main.xml"))
        plans = {each.path: each for each in gpsfsm.check(Path()).plans}
        assert [*plans["t/main.xml"].included] == ["common/a.xml"]

    def test_a_package_is_a_folder_of_its_name(self) -> None:
        text = xml(include="x").replace('path="x"', 'ros_pkg="arm_trees" path="trees/a.xml"')
        put({"main.xml": text, "arm_trees/trees/a.xml": xml("A: <Go/>")})
        plan = check()
        assert plan.verdict is Verdict.ACCEPTED
        (note,) = plan.notes
        assert note.endswith("for 'trees/a.xml' of the ROS package arm_trees")
        put({"arm_trees/trees/main.xml": text})
        assert len(check("arm_trees/trees/main.xml").included) == 0  # the root is trees/
        assert refused(check("arm_trees/trees/main.xml")).startswith("the ROS package 'arm_trees'")

    @pytest.mark.parametrize("package", ["..", "/", "no_such", "a/b", ""])
    def test_a_package_that_is_no_folder(self, package: str) -> None:
        include = f'<include ros_pkg="{package}" path="a.xml"/>'
        put({"main.xml": f'<root BTCPP_format="4">{include}</root>'})
        assert refused(check())

    def test_encodings(self) -> None:
        put({"main.xml": xml(include="a.xml"), "a.xml": ""})
        Path("a.xml").write_bytes(xml('A: <Say text="é"/>').encode("utf-16"))
        assert check().verdict is Verdict.ACCEPTED
        Path("main.xml").write_bytes(xml(include="a.xml").encode("utf-16"))
        assert [*check().included] == ["a.xml"]
        Path("a.xml").write_bytes(xml('A: <Say text="é"/>').encode("latin-1"))
        assert "is not valid UTF-8" in refused(check())

    def test_in_other_processes(self) -> None:
        put(ARM)
        from gpsfsm.checking.parallel import check_inputs

        (plan,) = check_inputs([Input("main.xml")], CheckOptions(), time_limit_s=100)
        assert plan == check()


class TestRefusing:
    @pytest.mark.parametrize(
        ("path", "message"),
        [
            ("/etc/passwd", "the included file '/etc/passwd' is outside of the folder"),
            ("../secret.xml", "the included file '../secret.xml' is outside of the folder"),
            ("sub/../../secret.xml", "is outside of the folder"),
            ("gone.xml", "the included file 'gone.xml' cannot be read: No such file"),
            ("sub", "the included file 'sub' cannot be read: it is a folder"),
            ("sub/", "cannot be read: it is a folder"),
            ("notes.txt", "holds no behaviour trees"),
            ("plan.xml", "holds no behaviour trees"),
            ("empty.xml", "holds no behaviour trees"),
            ("http://localhost/a.xml", "cannot be read: No such file"),
            ("file:///etc/passwd", "cannot be read: No such file"),
            ("  ", "this include names no file"),
            ("a" * 5000, "that leads to a file|cannot be read: File name too long"),
            ("x/" * 3000, "that leads to a file|cannot be read: File name too long"),
        ],
    )
    def test_paths(self, path: str, message: str) -> None:
        put({"../secret.xml": xml("S: <Go/>"), "sub/a.xml": xml("A: <Go/>"), "empty.xml": ""})
        put({"notes.txt": "PASSWORD=secret", "plan.xml": "<Plan><Secret/></Plan>"})
        put({"main.xml": xml("M: <Go/>").replace("  <Beh", f'<include path="{path}"/>\n<Beh', 1)})
        plan = check()
        assert any(each in refused(plan) for each in message.split("|")), refused(plan)
        assert "ecret/" not in json.dumps(plan.to_dict())  # nothing of what was read is shown
        assert "PASSWORD" not in json.dumps(plan.to_dict())

    def test_an_include_without_a_path(self) -> None:
        put({"main.xml": xml("M: <Go/>").replace("  <Beh", "<include/>\n<Beh", 1)})
        assert refused(check()) == "this include names no file"

    @needs_links
    def test_links(self) -> None:
        put({"../secret.xml": xml("S: <Go/>"), "t/a.xml": xml("A: <Go/>")})
        Path("t/out.xml").symlink_to("../../secret.xml")
        Path("t/folder").symlink_to("../..")
        Path("t/in.xml").symlink_to("a.xml")
        Path("t/loop.xml").symlink_to("loop.xml")
        for path, message in {
            "out.xml": "is outside of the folder t",
            "folder/secret.xml": "is outside of the folder t",
            "loop.xml": "cannot be read: Too many levels of symbolic links",
        }.items():
            put({"t/main.xml": xml(include=path)})
            assert message in refused(check("t/main.xml"))
        put({"t/main.xml": xml(include="in.xml a.xml")})
        assert [*check("t/main.xml").included] == ["t/in.xml"]

    @needs_pipes
    def test_a_pipe(self) -> None:
        os.mkfifo("pipe.xml")
        put({"main.xml": xml("M: <Go/>", include="pipe.xml")})
        assert "is not a regular file" in refused(check())

    def test_what_is_too_long(self) -> None:
        put({"main.xml": xml("M: <Go/>", include="a.xml b.xml")})
        put({"a.xml": xml("A: <Go/>"), "b.xml": xml("B: <Go/>") + " " * 1000})
        limits = Limits(max_bytes=1000)
        message = refused(check(limits=limits))
        assert message == (
            "the included file 'b.xml' is too long: all files together may have 1,000 bytes"
        )

    def test_too_many_elements_in_all(self) -> None:
        put({"main.xml": xml("M: <Go/>", include="a.xml"), "a.xml": xml("A: <Go/>")})
        plan = check(limits=Limits(max_elements=5))
        assert plan.verdict is Verdict.UNDECIDED
        assert places(plan) == [("GP103", "a.xml", 2)]

    def test_too_many_files(self) -> None:
        names = [f"f{number}.xml" for number in range(MOST_INCLUDED + 1)]
        put({name: xml(f"T{name}: <Go/>") for name in names})
        put({"main.xml": xml("M: <Go/>", include=" ".join(names), main="M")})
        plan = check()
        assert refused(plan) == "more than 100 files are included; this one is not read"
        assert len(plan.included) == MOST_INCLUDED

    def test_a_row_of_files(self) -> None:
        for number in range(MOST_INCLUDED):
            put({f"f{number}.xml": xml(f"T{number}: <Go/>", include=f"f{number + 1}.xml")})
        put({f"f{MOST_INCLUDED}.xml": xml("Last: <Go/>")})
        plan = check("f0.xml")
        assert len(plan.included) == MOST_INCLUDED
        assert places(plan) == [("GP802", "", 1)]

    def test_too_many_includes(self) -> None:
        put({"main.xml": xml("M: <Go/>", include=" ".join(f"{n}.xml" for n in range(2_000)))})
        plan = check(limits=Limits(max_problems=5_000))
        messages = Counter(each.message[-14:] for each in plan.findings)
        assert messages == {
            "file or directory"[-14:]: MOST_INCLUDES,
            "one is not read"[-14:]: 1_000,
        }

    @given(st.text("./\\ab~$%é\x00:*?#&@ \n", max_size=30), st.text("./abé-", max_size=8))
    @settings(max_examples=many(200), suppress_health_check=[HealthCheck.function_scoped_fixture])
    def test_no_path_leads_out(self, path: str, package: str) -> None:
        root = Path("root").absolute()
        put({"a": xml("A: <Go/>"), "root/b/a.xml": xml("A: <Go/>"), "root/a": "<root/>"})
        include = f"<include path={quoteattr(path)} ros_pkg={quoteattr(package)}/>"
        text = xml("M: <Go/>").replace("  <Beh", f"{include}\n<Beh", 1)
        opened: list[Path] = []

        def spy(file: Path, most: int, **options: Any) -> bytes:
            opened.append(file)
            return read(file, most, **options)

        put({"root/main.xml": text})
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr("gpsfsm.checking.includes.read", spy)
            plan = check("root/main.xml")
        assert all(Path(os.path.realpath(each)).is_relative_to(root) for each in opened)
        assert plan.verdict is Verdict.UNDECIDED or plan.included

    def test_files_that_include_all_others_take_no_longer(self) -> None:
        names = [f"f{number}.xml" for number in range(30)]
        for number, name in enumerate(names):
            rest = " ".join(names[number + 1 :])
            put({name: xml(f"T{number}: <Go/>", include=f"{rest} {rest}", main="T0")})
        assert check("f0.xml").verdict is Verdict.ACCEPTED

    @pytest.mark.parametrize(
        ("files", "chain"),
        [
            ({"main.xml": "main.xml"}, "main.xml → main.xml"),
            ({"main.xml": "a.xml", "a.xml": "a.xml"}, "a.xml → a.xml"),
            (
                {"main.xml": "a.xml", "a.xml": "b.xml", "b.xml": "./a.xml"},
                "a.xml → b.xml → a.xml",
            ),
            ({"main.xml": "a.xml", "a.xml": "main.xml"}, "main.xml → a.xml → main.xml"),
        ],
    )
    def test_circles(self, files: dict[str, str], chain: str) -> None:
        put({name: xml(f"T{name[0]}: <Go/>", include=path) for name, path in files.items()})
        plan = check()
        assert plan.verdict is Verdict.REJECTED
        (finding,) = (each for each in plan.findings if each.rule == "GP809")
        assert f": {chain}; " in finding.message
        assert plan.file_of(finding.location) == [*files][-1]

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            ("<root><BehaviorTree ID='A'>", [("GP101", "a.xml", 1)]),
            ("<root><!DOCTYPE a [<!ENTITY b SYSTEM 'main.xml'>]></root>", [("GP102", "a.xml", 1)]),
            ("<root><BehaviorTree ID='A'>&b;</BehaviorTree></root>", [("GP101", "a.xml", 1)]),
            ("<BehaviorTree ID='A'><Go/></BehaviorTree>", [("GP815", "a.xml", 1)]),
        ],
    )
    def test_what_is_wrong_in_it(self, text: str, expected: list[tuple[str, str, int]]) -> None:
        put({"main.xml": xml("M: <Go/>", include="a.xml", main="M"), "a.xml": text})
        plan = check()
        assert plan.verdict is not Verdict.ACCEPTED
        assert set(expected) <= set(places(plan))

    def test_texts_include_nothing(self) -> None:
        put(ARM)
        text = Path("main.xml").read_bytes()
        why = "this includes another file, which is read only for a tree that is itself a file"
        assert refused(check_text(text, "main.xml", CheckOptions())) == why
        assert refused(gpsfsm.check(text.decode()).plans[0]) == why
        options = CheckOptions(from_response=True)
        assert refused(check_text(text, "main.xml", options)) == why
        assert refused(check(from_response=True)) == why

    def test_the_gate_lets_none_pass(self) -> None:
        put(ARM)
        assert not gate(Path("main.xml").read_bytes(), allow_trees=True)
        assert not gate(Path("main.xml"), allow_trees=True)
        assert gate(ALL_ARM, allow_trees=True)

    def test_commands(self) -> None:
        put(ARM)
        why = "this includes another file, which is read only for a tree that is itself a file"
        text = Path("main.xml").read_bytes()
        for command in (["check", "-"], ["gate", "-", "--allow-trees"], ["show", "-"]):
            refusal = run(*command, stdin=text)
            assert refusal.returncode in (1, 2)
            assert why.encode() in refusal.stdout + refusal.stderr
        for command in (["gate", "--allow-trees"], ["fix"]):
            refusal = run(*command, "main.xml")
            assert refusal.returncode in (1, 2)
            assert why.encode() in refusal.stdout + refusal.stderr
        for words in (["check"], ["show"], ["run"], ["fuzz", "--runs", "9"]):
            answer = run(*words, "main.xml")
            assert answer.returncode == 0, answer.stderr

    @pytest.mark.skipif(not Path("/dev/stdin").exists(), reason="no /dev/stdin here")
    def test_devices_are_no_files(self) -> None:
        from gpsfsm.checking.includes import includes_of

        put(ARM)
        text = Path("main.xml").read_bytes()
        assert includes_of(Input("main.xml"), text, Limits()) is not None
        for item in (
            Input("<stdin>", stdin=True),
            Input("answers.jsonl:1", answers="answers.jsonl", text=text),
            Input("/dev/stdin"),
            Input("no such file"),
            Input(""),
        ):
            assert includes_of(item, text, Limits()) is None


class TestReporting:
    FILES: ClassVar = {
        "main.xml": xml(
            'Main: <Sequence><Drive/><SubTree ID="Arm"/></Sequence>',
            include="arm/arm.xml",
            main="Main",
            models='<Action ID="Drive"/><Action ID="Grip"/>',
        ),
        "arm/arm.xml": "\n" * 20 + xml('Arm: <Grip  force="3"/>'),
    }

    @pytest.mark.parametrize("form", format_names())
    def test_every_format_names_the_file(self, form: str) -> None:
        put(self.FILES)
        report = gpsfsm.check(Path("main.xml"))
        text = render(report, form)
        expected = {
            "text": "arm/arm.xml:23:12: error GP803",
            "json": '"location": {"line": 23, "column": 12, "element": '
            '"/root/include[1]/root/BehaviorTree[1]/Grip[1]", "file": "arm/arm.xml"}',
            "jsonl": '"column": 12, "element": "/root/include[1]/root/BehaviorTree[1]/Grip[1]", '
            '"file": "arm/arm.xml"',
            "sarif": '{"uri": "arm/arm.xml"}, "region": {"startLine": 23, "startColumn": 12',
            "github": "::error file=arm/arm.xml,line=23,col=12",
            "gitlab": '"path": "arm/arm.xml"',
            "junit": "arm/arm.xml:23:12: error GP803",
            "llm": "Error GP803 at line 23 of arm/arm.xml",
            "markdown": "(arm/arm.xml, line 23)",
        }
        assert expected[form] in text
        if form in ("text", "llm"):
            assert '<Grip  force="3"/>' in text
        if form == "gitlab":
            (entry,) = (each for each in json.loads(text) if each["check_name"] == "GP803")
            assert entry["location"] == {"path": "arm/arm.xml", "lines": {"begin": 23}}

    def test_a_notebook_shows_the_line(self) -> None:
        put(self.FILES)
        page = gpsfsm.check(Path("main.xml"))._repr_html_()
        assert page is not None
        assert "line 23 of arm/arm.xml" in page
        assert "&lt;Grip  force=" in page

    def test_a_story_names_the_file(self) -> None:
        put(
            {
                "main.xml": xml(include="a.xml"),
                "a.xml": xml("A: <ForceFailure><Go/></ForceFailure>"),
            }
        )
        (finding,) = (each for each in check().findings if each.rule == "GP305")
        assert finding.scenario is not None
        assert {step.file for step in finding.scenario.trace} == {"a.xml"}
        assert any("line 3 of a.xml" in sentence for sentence in finding.scenario.story)

    def test_what_cannot_be_converted_is_in_its_file(
        self, capsys: pytest.CaptureFixture[str]
    ) -> None:
        put({"main.xml": xml(include="a.xml"), "a.xml": xml("A: <Inverter><Go/></Inverter>")})
        assert main(["convert", "main.xml", "--to", "plan"]) == 1
        assert capsys.readouterr().err.startswith(
            "gpsfsm: a.xml:3: plan cannot express /root/include"
        )

    def test_a_model_in_another_file(self) -> None:
        put({"main.xml": xml('M: <Go to="here" x="1"/>', include="models.xml")})
        put({"models.xml": xml(models='<Action ID="Go"><input_port name="to"/></Action>')})
        plan = check()
        assert places(plan) == [("GP803", "", 4)]
        (finding,) = (each for each in plan.findings if each.rule == "GP803")
        assert finding.hint == "use the port to (line 2 of models.xml)"

    def test_trees_of_nav2_fit_its_description_of_nodes(self, shared_corpus: Path) -> None:
        def wrong(problem: Problem) -> bool:
            return rule(problem.rule).severity is Severity.ERROR

        put({"nodes.xml": (shared_corpus / "trees" / "nav2_tree_nodes.xml").read_text()})
        include, tree = '<include path="nodes.xml"/>', "<BehaviorTree "
        for file in sorted((shared_corpus / "trees" / "nav2").glob("*.xml")):
            text = file.read_text().replace(tree, include + tree, 1)
            put({"main.xml": text.replace("number_of_retries", "retries", 1)})
            rules = [
                each.rule for each in parse_named("main.xml", Limits()).problems if wrong(each)
            ]
            assert rules == (["GP803"] if "number_of_retries" in text else []), file.name
            put({"main.xml": text})
            assert not [each for each in parse_named("main.xml", Limits()).problems if wrong(each)]

    def test_the_same_model_in_two_files(self) -> None:
        one, other = '<Action ID="Go"/>', '<Condition ID="Go"/>'
        put({"main.xml": xml("M: <Go/>", include="a.xml", models=one)})
        put({"a.xml": xml(models=one)})
        assert check().verdict is Verdict.ACCEPTED
        put({"a.xml": xml(models=other)})
        assert places(check()) == [("GP806", "a.xml", 2)]

    def test_comments_suppress_in_both_files(self) -> None:
        comment = "<!-- gpsfsm: ignore GP803 because the port is new -->"
        text = self.FILES["arm/arm.xml"]
        put(self.FILES | {"arm/arm.xml": text.replace("<Grip", f"{comment}<Grip")})
        assert [each.location.file for each in check().excused] == ["arm/arm.xml"]
        main = self.FILES["main.xml"].replace("  <include", f"{comment}<include")
        put(self.FILES | {"main.xml": main})
        assert [each.location.file for each in check().excused] == ["arm/arm.xml"]
        put(self.FILES | {"main.xml": self.FILES["main.xml"].replace("<Drive", f"{comment}<Drive")})
        assert check().excused == []

    def test_lines_of_assumptions_are_those_of_the_file_itself(self) -> None:
        put(ARM)
        plan = check(assume=["line 4 fails"])
        assert plan.facts is not None
        assert plan.facts.completes.value == "never"
        assert "GP907" in {each.rule for each in check(assume=["line 3 fails"]).findings}


class TestOneText:
    """What keeps a text keeps one, in which everything is."""

    def test_run_and_replay(self) -> None:
        put(ARM)
        result = gpsfsm.run(Path("main.xml"), journal="runs.db")
        assert result.status.value == "COMPLETED"
        for name in ARM:
            Path(name).unlink()
        assert gpsfsm.replay("runs.db")

    def test_a_file_that_cannot_be_read_keeps_it_from_running(self) -> None:
        put({"main.xml": xml("M: <Go/>", include="gone.xml")})
        with pytest.raises(gpsfsm.InputError, match=r"main.xml: the included file 'gone.xml'"):
            gpsfsm.run(Path("main.xml"))
        put({"gone.xml": "<root><BehaviorTree>"})
        with pytest.raises(gpsfsm.InputError, match="has errors; 'gpsfsm check' lists them"):
            gpsfsm.run(Path("main.xml"))

    def test_show_diff_view_fuzz(self) -> None:
        put(ARM | {"all.xml": ALL_ARM})
        assert gpsfsm.diff(Path("main.xml"), Path("all.xml")).equal
        assert "Grip" in gpsfsm.view(Path("main.xml"))
        assert gpsfsm.fuzz(Path("main.xml"), runs=20).ok

    @pytest.mark.parametrize("main_first", [True, False])
    def test_what_it_keeps(self, main_first: bool) -> None:
        declared = '<?xml version="1.0" encoding="iso-8859-1"?>\n'
        put(ARM)
        text = Path("main.xml").read_text(encoding="utf-8").replace("<Drive/>", '<Say text="é"/>')
        if main_first:
            text = text.replace("<Beh", "<!-- </root> <include/> -->\n  <Beh")
        data = (declared + text + "<!-- </root> -->").encode("latin-1")
        Path("main.xml").write_bytes(data)
        joined = joined_text(Input("main.xml"), data, Limits()).decode("utf-8")
        assert "é" in joined
        lines = joined.splitlines()
        before = text.splitlines()
        assert next(line for line in lines if "Say" in line) in before
        assert lines.index("  </BehaviorTree>") == before.index("  </BehaviorTree>") + 1
        (one,) = gpsfsm.check(joined).plans
        assert facts_of(one) == facts_of(check())
