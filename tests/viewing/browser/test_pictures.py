"""The pictures of docs/pictures: each shows the panes that it should, by structure, not by pixels.

Their pages fit their windows, and axe-core has no serious objection to any.
"""

from __future__ import annotations

import importlib.util
import re
import struct
import sys
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest

from tests.browser_audit import misfits, objections
from tests.browser_support import opened
from tests.conftest import REPO

if TYPE_CHECKING:
    from playwright.sync_api import Browser

_SCRIPT = REPO / "docs" / "screenshots.py"
_GIVEN_UP = (r"^failed: \S+/v1/(view|worlds/\S+|plans/\d+/events|queue/events|runs\S*)$",)

_REPORT = """
- banner:
  - heading "gpsfsm" [level=1]
  - text: /✗ rejected/
  - button /Theme/
  - button "Keys (?)"
- main:
  - region "Findings and tree":
    - tablist:
      - tab /Findings {findings}/ [selected]
      - tab /Tree/
    - tabpanel:
      - group "Show findings"
      - list "Findings"
  - region "Automaton":
    - application "Automaton":
      - toolbar "View of the automaton"
  - region "Text":
    - region "Text of the plan"
"""
_SELECTED = """
- list "Findings":
  - listitem:
    - button /GP303 join-deadlock/ [expanded]
    - button /Play the scenario of GP303/
    - list "Related places":
      - listitem:
        - button "line 7"
      - listitem:
        - button "line 8"
"""
_PLAYER = """
- region "Player":
  - strong: {title}
  - button "Close the player"
  - group "Steps":
    - button "To the start"
    - button "Step back"
    - button "Play"
    - button "Step forward"
    - button "To the end"
    - slider "Step"
    - text: {place}
    - combobox "Speed"
  - paragraph: {now}
"""
_TIMELINE = """
- group:
  - text: {title}
  - list "Who is active when":
"""
_SCENARIO = (
    _TIMELINE.format(title=r'"Timeline: 5 rows ✗ the plan gives up"')
    + """    - listitem /ImageAnalysisRunner.*running from step 1 to step 3, failed/
    - listitem /SpeechRunner.*triggered from step 1 to step 2; running.*, stopped/
    - listitem /any of parallel_all.*waits for inputs from step 3 to step 4, has fired/
    - listitem /any of plan/
    - listitem /give up/
"""
)
_OVERVIEW = """
- application "Automaton":
  - group /^Overview/
"""
_DRAFT = """
- tablist "Plan or runs":
  - tab "Plan" [selected]
  - tab "Runs"
- tabpanel "Plan":
  - textbox "Text of the plan"
  - status: ✓ accepted
  - combobox "World"
  - spinbutton "Random seed"
  - combobox "Speed of the run"
  - checkbox "start paused"
  - button "Run"
- tablist "Details of the plan":
  - tab "Findings" [selected]
- tabpanel "Findings":
  - list "Findings"
"""
_RUN = """
- tablist "Draft or run":
  - tab "Draft"
  - tab "Run 1" [selected]
- tabpanel "Run 1":
  - heading /Run 1/ [level=2]
  - text: /running paused world home/
  - button "Edit this plan"
  - region "Automaton of run 1":
    - application "Automaton"
  - group "Control the run":
    - button "Resume the run"
    - button /Step/
    - combobox "Speed of this run"
    - button "Cancel the run"
  - group "Replay":
    - button "To the start"
    - button "Previous event"
    - button "Replay the run"
    - button "Next event"
    - button /Live/ [pressed]
"""
_LIVE_TIMELINE = r"""
- group:
  - text: /Timeline. [45] rows/
  - slider "Time of the run"
  - list "Who is active when":
    - listitem /2. WaypointRunner.*running from 0.0 s to [\d.]+ s, succeeded/
    - listitem /3. any of recovery. has fired at/
    - listitem /7. SpeechRunner.*running from [\d.]+ s on/
    - listitem /8. ImageAnalysisRunner.*running from/
"""
_MAP = """
- region "Map":
  - heading "Map · home" [level=2]
  - img /Map of home/
- tablist "What happens in the run":
  - tab {running} [selected]
  - tab "Said and heard"
  - tab "Events"
"""
_RUNNING = """
- tabpanel /Running/:
  - list:
    - listitem:
      - text: /SpeechRunner/
      - button /Make it fail/
"""
_LIVE = (_DRAFT, _RUN, _LIVE_TIMELINE, _MAP.format(running=r"/Running \([12]\)/"), _RUNNING)
STRUCTURES = {
    "view.png": (_REPORT.format(findings=4), _SELECTED),
    "view-dark.png": (_REPORT.format(findings=4), _SELECTED),
    "view-phone.png": (_REPORT.format(findings=4),),
    "view-print.png": (
        """
- banner:
  - heading "gpsfsm" [level=1]
  - text: /door.xml ✗ rejected/
- main:
  - region "Findings and tree":
    - tabpanel:
      - list "Findings":
        - listitem:
          - button /GP307/
        - listitem:
          - button /GP402/
        - listitem:
          - button /GP303/
          - list "Related places"
          - list:
            - listitem:
              - button /fails/
        - listitem:
          - button /GP302/
    - tabpanel:
      - tree "Plan":
        - treeitem /door_check/
        - treeitem /I need help/
  - region "Automaton":
    - application "Automaton"
  - region "Text":
    - region "Text of the plan":
      - code: /door_check/
""",
    ),
    "view-scenario.png": (
        _REPORT.format(findings=3),
        _PLAYER.format(title=r"/GP303 at line 6/", place=r"/3 \/ 7/", now="/at line 7 fails/"),
        _SCENARIO,
    ),
    "view-machine.png": (
        _REPORT.format(findings=4),
        _PLAYER.format(title=r"/GP314 at line 4/", place=r"/5 \/ 8/", now="/“ask” at line 5/"),
        _TIMELINE.format(title="/Timeline. 3 rows/")
        + "    - listitem /3. WaypointRunner/\n    - listitem /4. ImageAnalysisRunner/\n",
    ),
    "view-diff.png": (
        """
- banner:
  - navigation "Views":
    - button "Compare" [pressed]
- main:
  - region "Two plans side by side":
    - text: ≠ the plans differ
    - list:
      - listitem: /first scenario/
    - region "door.xml":
      - button "door.xml"
      - application "Automaton":
        - group /Overview/
      - group:
        - text: /the plan gives up/
        - list "Who is active when"
      - paragraph: /the plan gives up/
    - region "guarded.xml":
      - button "guarded.xml"
      - application "Automaton"
      - group:
        - text: /the plan completes/
        - list "Who is active when"
      - paragraph: /at line 10 starts/
    - region "Player":
      - group "Steps":
        - slider "Step"
""",
    ),
    "view-large.png": (_REPORT.format(findings=92),),
    "view-overview.png": (_REPORT.format(findings=92), _OVERVIEW),
    "live-draft.png": (
        _DRAFT,
        '\n- tablist "Draft or run":\n  - tab "Draft" [selected]\n  - tab "Run" [disabled]\n',
        _MAP.format(running='"Running"'),
    ),
    "live.png": _LIVE,
    "live-phone.png": _LIVE,
}


@cache
def script() -> Any:
    """docs/screenshots.py as a module."""
    spec = importlib.util.spec_from_file_location("screenshots", _SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("file", sorted(STRUCTURES))
def test_a_picture_shows_what_it_is_kept_for(file: str, browser: Browser) -> None:
    from playwright.sync_api import expect

    (picture,) = [each for each in script().PICTURES if each.file == file]
    with (
        script().address(picture) as address,
        opened(browser, address, size=picture.size, theme=picture.theme, allowed=_GIVEN_UP) as page,
    ):
        script().pose(page, picture)
        for structure in STRUCTURES[file]:
            expect(page.locator("body")).to_match_aria_snapshot(structure, timeout=20_000)
        assert page.locator(".page-error, .toast").count() == 0
        if not picture.paper:
            assert misfits(page, least=24 if picture.size[0] < 600 else 18) == []
        assert objections(page) == []


def test_each_picture_is_listed_and_has_its_size() -> None:
    folder = script().FOLDER
    assert (folder / "README.md").read_text(encoding="utf-8") == script().listed()
    assert {each.file for each in script().PICTURES} == set(STRUCTURES)
    assert {file.name for file in folder.glob("*.png")} == set(STRUCTURES)
    for picture in script().PICTURES:
        content = (folder / picture.file).read_bytes()
        width, height = struct.unpack(">II", content[16:24])
        assert width == picture.size[0]
        assert height == picture.size[1] or (picture.paper and height > picture.size[1])
        assert len(content) <= script().MOST_BYTES


def test_a_small_file_has_the_colours_of_its_picture(browser: Browser) -> None:
    page = browser.new_page(viewport={"width": 30, "height": 20})
    page.set_content("<body style='margin:0;background:linear-gradient(90deg,#f00,#00f)'>")
    shot = page.screenshot()
    page.close()
    width, height, pixels = script().decoded(shot)
    assert (width, height, len(pixels)) == (30, 20, 30 * 20 * 3)
    assert pixels[0] > 240
    assert pixels[2] < 15
    assert pixels[-1] > 240
    small = script().smaller(shot)
    assert re.match(rb"\x89PNG\r\n\x1a\n.{8}\x00\x00\x00\x1e\x00\x00\x00\x14\x08\x03", small, re.S)
