"""Code actions: every edit is applied, and the result is checked again."""

from __future__ import annotations

from typing import TYPE_CHECKING

import gpsfsm
from tests.lsp.test_answers import BAD, GO

if TYPE_CHECKING:
    from tests.lsp.client import Editor

WRONG = f"""<Plan>
  <Control type="Sequential">
    {GO.replace("WaypointRunner", "WaypointRuner")}
  </Control>
</Plan>
"""


def rules(text: str) -> list[str]:
    return [finding.rule for finding in gpsfsm.check(text).plans[0].findings]


def test_a_safe_fix_takes_its_finding_away_and_no_other(editor: Editor) -> None:
    uri = editor.open("safe.xml", WRONG)
    assert [each["code"] for each in editor.diagnostics(uri)] == rules(WRONG)
    at = WRONG.index("Sequential")
    actions = editor.actions(uri, at, at, ["quickfix"])
    (fix,) = [action for action in actions if action.get("isPreferred")]
    assert fix["title"].startswith("GP106: ")
    assert fix["diagnostics"][0]["code"] == "GP106"
    after = editor.after(uri, fix["edit"])
    assert "GP106" not in rules(after)
    assert "WaypointRuner" in after


def test_an_unsafe_fix_says_so(editor: Editor) -> None:
    uri = editor.open("unsafe.xml", BAD)
    at = BAD.index("<Control")
    actions = editor.actions(uri, at, at, ["quickfix"])
    (fix,) = [action for action in actions if "unsafe" in action["title"]]
    assert "isPreferred" not in fix
    assert "GP307" in rules(BAD)
    assert "GP307" not in rules(editor.after(uri, fix["edit"]))


def test_a_comment_allows_a_finding(editor: Editor) -> None:
    uri = editor.open("allow.xml", BAD)
    at = BAD.index("<Control")
    actions = editor.actions(uri, at, at, ["quickfix"])
    (allow,) = [action for action in actions if "allow it here" in action["title"]]
    after = editor.after(uri, allow["edit"])
    assert "  <!-- gpsfsm: ignore GP307 because ... -->\n  <Control" in after
    assert {"GP307", "GP905"} <= set(rules(after))  # before a reason is there it allows nothing
    after = after.replace("because ...", "because the planner is known to write this")
    assert [rule for rule in rules(BAD) if rule != "GP307"] == rules(after)


def test_a_comment_at_an_attribute_stands_before_its_element(editor: Editor) -> None:
    uri = editor.open("inner.xml", BAD)
    at = BAD.index('x="viel')
    actions = editor.actions(uri, at, at, ["quickfix"])
    (allow,) = [action for action in actions if "allow it here" in action["title"]]
    after = editor.after(uri, allow["edit"]).replace("because ...", "because it is fine")
    assert "GP205" not in rules(after)


def test_no_comment_is_offered_that_would_allow_nothing(editor: Editor) -> None:
    shelf = GO.replace('y="2.0"', 'y="<half full>"')
    uri = editor.open("nothing.xml", f"<Plan>{shelf}</Plan>")
    text = editor.texts[uri]
    at = text.index("<half")
    assert "GP101" in [each["code"] for each in editor.diagnostics(uri)]
    for each in editor.actions(uri, at, at, ["quickfix"]):
        assert "allow it here" not in each["title"]


def test_all_that_is_safe_at_once(editor: Editor) -> None:
    uri = editor.open("all.xml", WRONG)
    (action,) = editor.actions(uri, 0, 0, ["source.fixAll"])
    assert action["kind"] == "source.fixAll.gpsfsm"
    assert "edit" not in action
    after = editor.after(uri, editor.ask("codeAction/resolve", action)["edit"])
    assert "GP106" not in rules(after)
    assert after.count("sequential") == 1


def test_an_action_for_an_older_version_is_not_resolved(editor: Editor) -> None:
    uri = editor.open("old.xml", WRONG)
    (action,) = editor.actions(uri, 0, 0, ["source.fixAll"])
    editor.edit(uri, 0, 0, "<!-- -->")
    assert "edit" not in editor.ask("codeAction/resolve", action)


def test_nothing_is_offered_where_nothing_is_wrong(editor: Editor) -> None:
    uri = editor.open("fine.xml", f"<Plan>{GO}</Plan>")
    diagnostics = editor.diagnostics(uri)
    assert all(each["severity"] > 1 for each in diagnostics)
    assert editor.actions(uri, 2, 2, ["quickfix"]) == []
    assert editor.actions(uri, 0, 0, ["refactor"]) == []


def test_an_editor_that_resolves_nothing_gets_the_edit_at_once(frugal: Editor) -> None:
    uri = frugal.open("plan.xml", WRONG)
    (action,) = frugal.actions(uri, 0, 0, ["source.fixAll.gpsfsm"])
    assert "GP106" not in rules(frugal.after(uri, action["edit"]))
