"""Which documents are checked, and how: configuration, capabilities, baselines, other XML."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import unquote, urlparse

import pytest

import gpsfsm
from tests.lsp.test_answers import GO, complete, labels

if TYPE_CHECKING:
    from collections.abc import Iterator

    from tests.lsp.client import Editor

PLAN = f'<Plan>\n  <Control type="recovery">{GO}</Control>\n  {GO}\n</Plan>\n'
INTERFACE = """name: Grasp
spec_type: interface
spec_version: 1.1
description: Takes what stands before the robot.
default_provider: arm/Grasp
interface: {}
"""
PROVIDER = """name: Grasp
spec_type: provider
spec_version: 1.2
implements: arm/Grasp
description: Takes things with one hand.
runner: arm:Grasp
definition:
  configuration_parameters:
    - name: hand
      type: string
      choices: [left, right]
      description: Which hand.
"""


@pytest.fixture
def own(editor: Editor, tmp_path: Path) -> Iterator[Editor]:
    """The server with a folder of its own."""
    before, editor.root = editor.root, tmp_path
    editor.notices.clear()
    yield editor
    editor.root = before


def codes(editor: Editor, uri: str) -> list[str]:
    return [each.get("code", "") for each in editor.diagnostics(uri)]


def silent(editor: Editor, uri: str) -> bool:
    """Whether nothing is told of a document, although one that was opened later is."""
    last = editor.open("last.xml", PLAN)
    editor.diagnostics(last)
    return uri not in editor.published


def rechecked(editor: Editor, uri: str) -> list[str]:
    """The codes after a file beside the document was saved."""
    del editor.published[uri]
    editor.tell("workspace/didChangeWatchedFiles", {"changes": []})
    return codes(editor, uri)


def test_the_configuration_of_the_folder_holds(own: Editor) -> None:
    (own.root / "sub").mkdir()
    (own.root / ".git").mkdir()
    (own.root / "gpsfsm.toml").write_text('ignore = ["GP302"]\n')
    uri = own.open("sub/plan.xml", PLAN)
    assert "GP307" in codes(own, uri)
    assert "GP302" not in codes(own, uri)
    (own.root / "gpsfsm.toml").write_text('ignore = ["GP307"]\n')
    assert "GP302" in rechecked(own, uri)
    assert "GP307" not in codes(own, uri)
    (own.root / "sub" / "gpsfsm.toml").write_text('select = ["GP9"]\n')
    assert rechecked(own, uri) == []


def test_a_configuration_that_does_not_fit_is_told_and_nothing_is_checked(own: Editor) -> None:
    (own.root / "gpsfsm.toml").write_text("ignroe = []\n")
    uri = own.open("plan.xml", PLAN)
    (actual,) = own.diagnostics(uri)
    assert "there is no key 'ignroe'" in actual["message"]
    assert actual["severity"] == 1
    own.wait(lambda: own.notices)
    (notice,) = own.notices
    assert notice["method"] == "window/showMessage"
    (own.root / "gpsfsm.toml").unlink()
    assert rechecked(own, uri) == [each.rule for each in gpsfsm.check(PLAN).plans[0].findings]


def test_a_baseline_takes_its_findings_out(own: Editor) -> None:
    (own.root / "gpsfsm.toml").write_text('baseline = "known.json"\n')
    report = json.loads(gpsfsm.render(gpsfsm.check(PLAN), "json"))
    report["plans"][0]["path"] = "plan.xml"
    (own.root / "known.json").write_text(json.dumps(report))
    uri = own.open("plan.xml", PLAN)
    assert codes(own, uri) == []


def test_capabilities_of_the_robot(own: Editor) -> None:
    for kind, text in (("interfaces", INTERFACE), ("providers", PROVIDER)):
        folder = own.root / "robot" / "arm" / kind
        folder.mkdir(parents=True)
        (folder / "Grasp.yaml").write_text(text)
    (own.root / "gpsfsm.toml").write_text('capabilities = ["robot"]\n')
    begun = '<Plan><Runner interface="arm/Grasp" provider="arm/Grasp" hand="|"/></Plan>'
    uri, items = complete(own, "plan.xml", begun)
    assert labels(items) == ["left", "right"]
    text = own.texts[uri]
    at = text.index("hand")
    assert "Which hand." in own.at(uri, "textDocument/hover", at)["contents"]["value"]
    place = own.at(uri, "textDocument/definition", at)
    file = Path(unquote(urlparse(place["uri"]).path))
    assert file == own.root / "robot" / "arm" / "providers" / "Grasp.yaml"
    assert place["range"]["start"]["line"] == PROVIDER.split("\n").index("    - name: hand")
    assert "GP206" in codes(own, uri) or "GP205" in codes(own, uri)
    (own.root / "robot" / "arm" / "providers" / "Grasp.yaml").write_text(
        PROVIDER.replace("hand", "arm")
    )
    assert "GP203" in rechecked(own, uri)


@pytest.mark.parametrize(
    ("name", "text", "language"),
    [
        ("robot.urdf.xml", "<robot name='r2'><link/></robot>", "xml"),
        ("package.xml", "<?xml version='1.0'?>\n<package><name>n</name></package>", "xml"),
        ("answer.md", PLAN, "markdown"),
        ("empty.xml", "", "xml"),
    ],
)
def test_what_is_no_plan_is_left_alone(own: Editor, name: str, text: str, language: str) -> None:
    uri = own.open(name, text, language=language)
    assert silent(own, uri)
    assert own.at(uri, "textDocument/hover", 0) is None


def test_files_can_be_named_that_are_always_plans(own: Editor) -> None:
    uri = own.open("always/plan.xml", "There is no plan in this file.")
    assert codes(own, uri) == ["GP104"]


def test_a_plan_remains_one_while_it_is_edited(own: Editor) -> None:
    uri = own.open("plan.xml", "<!-- first -->\n<Plan></Plan>")
    own.diagnostics(uri)
    own.edit(uri, own.texts[uri].index("<Plan>") + 1, len(own.texts[uri]), "")
    text = own.texts[uri]
    assert codes(own, uri) == [each.rule for each in gpsfsm.check(text).plans[0].findings] != []


def test_a_document_becomes_a_plan_while_it_is_written(own: Editor) -> None:
    uri = own.open("plan.xml", "")
    own.edit(uri, 0, 0, "<Plan>")
    assert "GP101" in codes(own, uri)


def test_behaviour_trees_are_checked_too(own: Editor) -> None:
    tree = (
        '<root BTCPP_format="4"><BehaviorTree ID="Main"><SubTree ID="None"/></BehaviorTree></root>'
    )
    uri = own.open("tree.xml", tree)
    assert codes(own, uri) == [each.rule for each in gpsfsm.check(tree).plans[0].findings] != []


def test_closing_a_document_takes_its_findings_away(own: Editor) -> None:
    uri = own.open("plan.xml", PLAN)
    assert codes(own, uri)
    own.tell("textDocument/didClose", {"textDocument": {"uri": uri}})
    own.wait(lambda: own.published[uri]["diagnostics"] == [])
    assert own.at(uri, "textDocument/hover", 0) is None


def test_an_editor_that_counts_bytes(frugal: Editor) -> None:
    assert frugal.server["capabilities"]["positionEncoding"] == "utf-8"
    text = f"<Plan><!-- é🤖 -->{GO.replace('1.0', 'viel')}</Plan>"
    uri = frugal.open("bytes.xml", text)
    (actual,) = [each for each in frugal.diagnostics(uri) if each["code"] == "GP205"]
    assert actual["range"]["start"]["character"] == len(text[: text.index("x=")].encode())


def test_an_editor_without_markdown_and_places_for_the_cursor(frugal: Editor) -> None:
    uri = frugal.open("plain.xml", f"<Plan>{GO}</Plan>")
    shown = frugal.at(uri, "textDocument/hover", 2)["contents"]
    assert shown == {
        "kind": "plaintext",
        "value": "<Plan>\n\nThe whole plan. Its children run one after the other.",
    }
    items = frugal.at(uri, "textDocument/completion", len("<Plan>"))["items"]
    assert items[0]["textEdit"]["newText"] == '<Control type=""></Control>'
    assert items[0]["documentation"]["kind"] == "plaintext"
