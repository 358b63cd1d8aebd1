"""Dialogues: what the server says to an editor about a document."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlparse

import pytest

import gpsfsm
from gpsfsm.lsp.words import CONTROLS
from tests.lsp.client import offset

if TYPE_CHECKING:
    from tests.lsp.client import Editor

WAYPOINT = "nav2_capabilities/WaypointRunner"
GO = f'<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="1.0" y="2.0"/>'
BAD = f"""<Plan name="réunion 🤖">
  <Control type="recovery">
    {GO}
  </Control>
  <Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="viel 🤖" y="2.0"/>
</Plan>
"""


def labels(items: Any) -> list[str]:
    return [item["label"] for item in items["items"]]


def complete(editor: Editor, name: str, marked: str) -> tuple[str, Any]:
    """The address of a document, and what can be written where ``|`` stands in it."""
    uri = editor.open(name, marked.replace("|", "", 1))
    return uri, editor.at(uri, "textDocument/completion", marked.index("|"))


def written(editor: Editor, uri: str, item: Any) -> str:
    """The text after a completion was chosen."""
    text, edit = editor.texts[uri], item["textEdit"]
    start = offset(text, edit["range"]["start"])
    return text[:start] + edit["newText"] + text[offset(text, edit["range"]["end"]) :]


def file_of(location: Any) -> Path:
    return Path(unquote(urlparse(location["uri"]).path))


def test_what_the_editor_is_told_at_first(editor: Editor) -> None:
    capabilities = editor.server["capabilities"]
    assert capabilities["positionEncoding"] == "utf-16"
    assert capabilities["textDocumentSync"]["change"] == 2
    assert {"hoverProvider", "definitionProvider", "documentSymbolProvider"} <= capabilities.keys()


def test_diagnostics_are_the_findings_of_check(editor: Editor) -> None:
    uri = editor.open("findings.xml", BAD)
    diagnostics = editor.diagnostics(uri)
    findings = gpsfsm.check(BAD).plans[0].findings
    assert [each["code"] for each in diagnostics] == [finding.rule for finding in findings] != []
    for each, finding in zip(diagnostics, findings, strict=True):
        assert each["message"].startswith(finding.message)
        assert each["severity"] == {"error": 1, "warning": 2, "info": 3}[finding.severity]
        start = offset(BAD, each["range"]["start"])
        lines = BAD.splitlines(keepends=True)
        before = sum(map(len, lines[: finding.location.line - 1]))
        assert start == before + finding.location.column - 1
        end = offset(BAD, each["range"]["end"])
        assert end - start == finding.length
        places = [
            (other["location"]["range"]["start"]["line"] + 1, other["message"])
            for other in each.get("relatedInformation", [])
        ]
        assert places == [(other.location.line, other.message) for other in finding.related]


def test_columns_count_utf_16_units(editor: Editor) -> None:
    text = f"<Plan><!-- é 🤖🤖 -->{GO.replace('1.0', 'viel')}</Plan>"
    uri = editor.open("units.xml", text)
    (actual,) = [each for each in editor.diagnostics(uri) if each["code"] == "GP205"]
    column = text.index("x=") + 2  # two of the characters before it are two units each
    assert actual["range"]["start"] == {"line": 0, "character": column}


def test_what_never_runs_is_faded_and_a_finding_leads_to_its_page(editor: Editor) -> None:
    uri = editor.open("tags.xml", BAD)
    (dead,) = [each for each in editor.diagnostics(uri) if each["code"] == "GP307"]
    assert dead["tags"] == [1]
    page = Path(unquote(urlparse(dead["codeDescription"]["href"]).path))
    assert page.read_text().startswith("# GP307 recovery-without-predecessor")


def test_hover_tells_the_finding_and_why(editor: Editor) -> None:
    uri = editor.open("hover.xml", BAD)
    editor.diagnostics(uri)
    contents = editor.at(uri, "textDocument/hover", BAD.index("<Control") + 2)["contents"]
    assert contents["kind"] == "markdown"
    assert "**GP307 recovery-without-predecessor**" in contents["value"]
    assert "What to do: put the goal before the recovery" in contents["value"]
    assert "take a recovery for a list of alternatives" in contents["value"]
    assert CONTROLS["recovery"] in contents["value"]


def test_hover_tells_a_scenario(editor: Editor) -> None:
    text = f'<Plan><Control type="parallel_all">{GO}{GO}</Control></Plan>'
    uri = editor.open("scenario.xml", text)
    scenario = next(
        finding.scenario
        for finding in gpsfsm.check(text).plans[0].findings
        if finding.rule == "GP303"
    )
    assert scenario is not None
    editor.diagnostics(uri)
    value = editor.at(uri, "textDocument/hover", text.index("<Control"))["contents"]["value"]
    assert f"Scenario in which {scenario.ending}:" in value
    assert f"1. {scenario.story[0]}" in value.replace("\\", "")


def test_hover_describes_capabilities_and_parameters(editor: Editor) -> None:
    uri = editor.open("describes.xml", f"<Plan>\n{GO}\n</Plan>")
    text = editor.texts[uri]
    for where, words in (
        (text.index(WAYPOINT), "Drives the robot to a place on the map"),
        (text.rindex(WAYPOINT), f"(provider of {WAYPOINT})"),
        (text.index("x="), "metres along the x axis of the map"),
        (text.index("interface"), "Drives the robot to a place on the map"),
        (text.index("Plan"), "The whole plan."),
    ):
        assert words in editor.at(uri, "textDocument/hover", where)["contents"]["value"]
    assert editor.at(uri, "textDocument/hover", text.index("\n")) is None


@pytest.mark.parametrize(
    ("text", "mark"),
    [
        ("[x](command:evil)", "]("),
        ("![p](a.png)", "!["),
        ("&lt;img src=x>", "<img"),
        ("**b**", "**b"),
        ("`c`", "`"),
        ("http://h.org", "http://h"),
        ("WWW.h.org", "WWW.h"),
        ("a@h.org", "a@h"),
    ],
)
def test_text_of_plans_is_no_markup(editor: Editor, text: str, mark: str) -> None:
    speech = "perception_capabilities/SpeechRunner"
    says = f'<Runner interface="{speech}" provider="{speech}" text="{text}"/>'
    plan = f'<Plan><Control type="recovery">{says}</Control>{GO}</Plan>'
    uri = editor.open("markup.xml", plan)
    shown = text.replace("&lt;", "<")
    assert any(shown in each["message"] for each in editor.diagnostics(uri))
    value = editor.at(uri, "textDocument/hover", plan.index("<Control"))["contents"]["value"]
    assert shown in value.replace("\\", "")
    bare = re.sub(r"\\.", "", value)  # what no backslash makes plain
    assert mark not in bare


def test_elements_and_whole_runners_are_offered(editor: Editor) -> None:
    uri, items = complete(editor, "elements.xml", "<Plan>\n  |\n</Plan>")
    names = labels(items)
    assert names[:3] == ["Control", "Runner", "/Plan"]
    assert "Runner WaypointRunner" in names
    item = items["items"][names.index("Runner WaypointRunner")]
    assert gpsfsm.check(written(editor, uri, item)).plans[0].facts is not None
    assert f'<Runner interface="{WAYPOINT}"' in written(editor, uri, item)


def test_a_tag_that_is_begun_is_completed_once(editor: Editor) -> None:
    uri, items = complete(editor, "begun.xml", "<Plan>\n  <Ru|\n</Plan>")
    item = items["items"][labels(items).index("Runner")]
    assert item["insertTextFormat"] == 2
    assert "<<" not in written(editor, uri, item)
    assert '  <Runner interface="$1" provider="$2"$0/>\n' in written(editor, uri, item)


def test_a_tag_that_goes_on_gets_a_name_only(editor: Editor) -> None:
    for number, (marked, wanted) in enumerate(
        (
            ("<Plan>\n  <C|></Plan>", "<Plan>\n  <Control></Plan>"),
            ('<Plan><Con| type="recovery">', '<Plan><Control type="recovery">'),
            ("<Plan></P|>", "<Plan></Plan>"),
        )
    ):
        uri, items = complete(editor, f"goes-on-{number}.xml", marked)
        assert written(editor, uri, items["items"][0]) == wanted
        assert not [each for each in labels(items) if each.startswith("Runner ")]


def test_a_missing_quotation_mark_loses_nothing_behind_it(editor: Editor) -> None:
    for number, (marked, wanted) in enumerate(
        (
            ('<Plan><Control type="|\n</Plan>', '<Plan><Control type="sequential\n</Plan>'),
            (
                '<Plan><Control type="| name="a"></Control></Plan>',
                '<Plan><Control type="sequential name="a"></Control></Plan>',
            ),
        )
    ):
        uri, items = complete(editor, f"quotes-{number}.xml", marked)
        assert written(editor, uri, items["items"][0]) == wanted


def test_there_is_one_plan_in_a_document(editor: Editor) -> None:
    _, items = complete(editor, "second.xml", "<Plan></Plan>\n|")
    assert labels(items) == []
    _, items = complete(editor, "first.xml", "<Plan|")
    assert labels(items) == ["Plan"]


def test_an_end_tag_closes_what_is_open(editor: Editor) -> None:
    uri, items = complete(editor, "end.xml", '<Plan><Control type="sequential"></|')
    assert labels(items) == ["Control"]
    assert written(editor, uri, items["items"][0]).endswith("</Control>")


def test_control_types_and_interfaces_in_broken_text(editor: Editor) -> None:
    _, items = complete(editor, "types.xml", '<Plan>\n<Control type="|\n<Runner ')
    assert labels(items) == list(CONTROLS)
    _, items = complete(editor, "interfaces.xml", '<Plan>\n<Runner interface="nav2|\n<Con')
    assert WAYPOINT in labels(items)
    assert all("documentation" in item for item in items["items"])


def test_providers_are_those_of_the_interface(editor: Editor) -> None:
    _, items = complete(editor, "of.xml", f'<Plan><Runner interface="{WAYPOINT}" provider="|"/>')
    assert labels(items) == [WAYPOINT]


def test_parameters_are_offered_the_required_ones_first(editor: Editor) -> None:
    begun = f'<Plan><Runner interface="{WAYPOINT}" provider="{WAYPOINT}" y="1.0" |/></Plan>'
    uri, items = complete(editor, "parameters.xml", begun)
    names = labels(items)
    assert names[0] == "x"
    assert "y" not in names
    assert "interface" not in names
    assert items["items"][0]["detail"] == "double, required"
    assert ' x="$1"/>' in written(editor, uri, items["items"][0])
    order = [item["sortText"] for item in items["items"]]
    assert order == sorted(order)


def test_values_of_booleans_are_offered(editor: Editor) -> None:
    speech = "perception_capabilities/SpeechRunner"
    begun = f'<Plan><Runner interface="{speech}" provider="{speech}" use_device="|'
    _, items = complete(editor, "booleans.xml", begun)
    assert labels(items) == ["true", "false"]


def test_nothing_is_offered_in_a_comment(editor: Editor) -> None:
    _, items = complete(editor, "comment.xml", "<Plan><!-- <Runner | --></Plan>")
    assert items is None


def test_definition_leads_to_the_built_in_file(editor: Editor) -> None:
    uri = editor.open("definition.xml", f"<Plan>{GO}</Plan>")
    text = editor.texts[uri]
    for where, folder, words in (
        (text.index(WAYPOINT), "interfaces", "name: WaypointRunner"),
        (text.rindex(WAYPOINT), "providers", "name: WaypointRunner"),
        (text.index("y="), "providers", "name: y"),
    ):
        answer = editor.at(uri, "textDocument/definition", where)
        file = file_of(answer)
        assert (file.parent.name, file.name) == (folder, "WaypointRunner.yaml")
        assert words in file.read_text().splitlines()[answer["range"]["start"]["line"]]
    assert editor.at(uri, "textDocument/definition", 2) is None


def test_the_outline_is_a_tree(editor: Editor) -> None:
    uri = editor.open("outline.xml", BAD)
    (plan,) = editor.ask("textDocument/documentSymbol", {"textDocument": {"uri": uri}})
    assert (plan["name"], plan["detail"]) == ("Plan", "réunion 🤖")
    recovery, runner = plan["children"]
    assert recovery["name"] == "recovery"
    assert [child["name"] for child in recovery["children"]] == ["WaypointRunner"]
    assert runner["detail"] == "x=viel 🤖, y=2.0"
    start, end = (offset(BAD, recovery["range"][each]) for each in ("start", "end"))
    assert BAD[start:end] == BAD[BAD.index("<Control") : BAD.index("</Control>") + 10]
    folds = editor.ask("textDocument/foldingRange", {"textDocument": {"uri": uri}})
    assert {"startLine": 0, "endLine": 4} in folds


def test_an_outline_of_great_depth_is_cut(editor: Editor) -> None:
    uri = editor.open("deep.xml", "<Plan>" + '<Control type="sequential">' * 5_000)
    response = editor.ask("textDocument/documentSymbol", {"textDocument": {"uri": uri}})
    depth = 0
    while response:
        depth, response = depth + 1, response[0].get("children")
    assert depth == 100
