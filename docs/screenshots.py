"""The pictures of pages in docs/pictures: ``make screenshots`` takes all of them anew.

Needs the extra ``serve``, playwright and a Chromium. The pages are real ones: reports that
``gpsfsm view`` writes, and the page of a service of its own, on which a plan runs. The list of
pictures, docs/pictures/README.md, is written as well. ``python docs/screenshots.py live.png`` takes
one picture; ``--list`` writes only the list.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

    from playwright.sync_api import Browser, Page

REPO = Path(__file__).parents[1]
FOLDER = REPO / "docs" / "pictures"
EXAMPLES = REPO / "docs" / "examples"
WORLD = REPO / "corpus" / "worlds" / "home.yaml"
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
MOST_BYTES = 150_000
MOST_COLORS = 256
KEPT_COLORS = 48  # the most frequent ones, grounds and letters, are kept as they are
NEAR = 200  # of the others, those closer than this, as the sum of squares, share a place
WAIT_MS = 60_000
DESK, PHONE, SHEET = (1280, 800), (390, 844), (794, 1123)
"""Windows: of a desk, of a phone, and a sheet of A4 at 96 dots per inch."""

NAV, SPEECH, IMAGE = (
    f'interface="{name}" provider="{name}"'
    for name in (
        "nav2_capabilities/WaypointRunner",
        "perception_capabilities/SpeechRunner",
        "perception_capabilities/ImageAnalysisRunner",
    )
)
GREETING = f"""<Plan name="greet">
  <Runner {NAV} x="2.0" y="-0.5"/>
  <Control type="recovery">
    <Runner {SPEECH} text="I cannot get there."/>
  </Control>
  <Control type="parallel_all" name="arrive">
    <Runner {SPEECH} text="Here I am. What can I bring you from the kitchen?"/>
    <Runner {IMAGE} prompt="What do you see?"/>
  </Control>
  <Runner {NAV} x="0.0" y="0.0"/>
</Plan>
"""


@dataclass(frozen=True, slots=True)
class Picture:
    """A picture of a page. ``shows`` and ``look`` are for readers: its subject, and what to check.

    ``arguments`` are those of ``gpsfsm view``, whose report is shown; without any, it is the live
    page. ``prepare`` does what a person would do before the picture is taken.
    """

    file: str
    shows: str
    look: str
    arguments: tuple[str, ...] = ()
    prepare: Callable[[Page], None] = lambda _: None
    size: tuple[int, int] = DESK
    theme: Literal["light", "dark"] = "light"
    paper: bool = False


# ---- what a person does on the pages -------------------------------------------------------------


def select(page: Page) -> None:
    """Select the finding of the join."""
    page.locator(".finding-head", has_text="GP303").first.click()


def scenario(page: Page) -> None:
    """Step a counterexample to the sentence that matters."""
    page.locator(".finding", has_text="GP303").locator(".finding-play").first.click()
    steps(page, 3)


def lasso(page: Page) -> None:
    """Step a loop to where the robot asks, after somebody has stepped into its way."""
    loop = page.locator(".finding", has_text="GP314").filter(has_text="SpeechRunner")
    loop.locator(".finding-play").first.click()
    steps(page, 5)


def near(page: Page) -> None:
    """Go from the whole of a large plan to the control that a finding is about."""
    page.locator(".finding-head", has_text="GP501").nth(7).click()
    page.keyboard.press("s")


def steps(page: Page, number: int) -> None:
    """Step a scenario, from its start."""
    page.get_by_label("To the start").click()
    for _ in range(number):
        page.keyboard.press(".")


def run(page: Page) -> None:
    """Run a plan in the world of a home, and pause it while the robot speaks."""
    page.get_by_role("textbox", name="Text of the plan").fill(GREETING)
    page.locator(".draft-status.good").wait_for()
    page.keyboard.press("Control+Home")
    page.get_by_label("Speed of the run").select_option("1")
    page.get_by_role("button", name="Run", exact=True).click()
    page.locator(".map-bubble").first.wait_for(timeout=WAIT_MS)
    page.get_by_role("button", name="Pause the run").click()
    page.locator(".run-badge.held").wait_for()


def draft(page: Page) -> None:
    """Write a plan and select its finding."""
    page.get_by_role("textbox", name="Text of the plan").fill(GREETING)
    page.locator(".draft-status.good").wait_for()
    page.locator(".finding-head").first.click()


def run_on_phone(page: Page) -> None:
    """Run a plan; the page goes to the run by itself."""
    run(page)
    page.locator(".run-head").scroll_into_view_if_needed()


PICTURES = (
    Picture(
        "view.png",
        "The report of one plan: findings, automaton, text; a finding is selected",
        "the worst finding is first; the selected join is marked in all panes; x and y are seen",
        ("door.xml",),
        select,
    ),
    Picture(
        "view-dark.png",
        "The same in dark colours",
        "every word can be read; badges and edges keep their colours",
        ("door.xml",),
        select,
        theme="dark",
    ),
    Picture(
        "view-phone.png",
        "The same report on a phone, 390 pixels wide",
        "nothing is cut off at the right; the panes are stacked",
        ("door.xml",),
        size=PHONE,
    ),
    Picture(
        "view-print.png",
        "The same report on paper",
        "all findings with hints and scenarios, the whole tree, automaton and text; no buttons",
        ("door.xml",),
        select,
        size=SHEET,
        theme="dark",
        paper=True,
    ),
    Picture(
        "view-scenario.png",
        "A counterexample with its timeline, at the failure after which the join cannot fire",
        "the sentence that happens is marked; failed and stopped runners differ; the bar fits",
        ("--select", "GP3", "door.xml"),
        scenario,
    ),
    Picture(
        "view-machine.png",
        "A state machine; the loop of watching and asking is played",
        "edges with their events do not hide each other; stopped and failed look different",
        ("door.json",),
        lasso,
        size=(1280, 700),
    ),
    Picture(
        "view-diff.png",
        "Two plans at the step at which they part, as the page opens",
        "both automata have the same size of text; the sentence of the difference is marked",
        ("--diff", "door.xml", "guarded.xml"),
        theme="dark",
    ),
    Picture(
        "view-large.png",
        "A plan of 300 runners, as it opens",
        "the whole is seen; each block has its name, its runners and the worst finding in it",
        ("house.xml",),
    ),
    Picture(
        "view-overview.png",
        "A part of the same plan, with the overview of the whole",
        "names can be read; the frame in the overview is what is in view",
        ("house.xml",),
        near,
    ),
    Picture(
        "live-draft.png",
        "The live page: a plan is written; its finding is selected",
        "editor, findings, automaton and map fit beside each other; x and y are seen in the editor",
        prepare=draft,
    ),
    Picture(
        "live.png",
        "The live page: a run that is paused while the robot speaks",
        "the words are on the map and in the list; the timeline reaches to now; all buttons fit",
        prepare=run,
    ),
    Picture(
        "live-phone.png",
        "The same run on a phone, 390 pixels wide",
        "the page has gone to the run; all its buttons are there",
        prepare=run_on_phone,
        size=PHONE,
    ),
)


# ---- the pages -----------------------------------------------------------------------------------


def plans(folder: Path) -> None:
    """Plans to show: one, the same with a recovery, a machine, and one of 300 runners."""
    text = (EXAMPLES / "door_check.xml").read_text(encoding="utf-8")
    speech = f'<Control type="recovery"><Runner {SPEECH} text="I cannot see that."/></Control>'
    end = text.index("</Control>", text.index("look_and_ask")) + len("</Control>")
    machine = (EXAMPLES / "door.json").read_text(encoding="utf-8")
    texts = {
        "door.xml": text,
        "guarded.xml": f"{text[:end]}\n    {speech}{text[end:]}",
        "door.json": machine,
        "house.xml": house(),
    }
    for name, content in texts.items():
        (folder / name).write_text(content, encoding="utf-8")


def house(rooms: int = 30) -> str:
    """A plan with ten runners for each room."""
    room = """  <Control type="sequential" name="room_{number}">
    <Runner {nav} x="{x}" y="{y}"/>
    <Control type="recovery">
      <Runner {nav} x="{x}" y="{y}.5"/>
      <Runner {speech} text="Room {number} cannot be reached."/>
    </Control>
    <Control type="parallel_all" name="look_{number}">
      <Runner {image} prompt="Who is here?"/>
      <Runner {image} prompt="Is a window open?"/>
      <Runner {speech} text="Good morning, room {number}."/>
    </Control>
    <Control type="parallel_any" name="ask_{number}">
      <Runner {speech} text="Is there laundry?"/>
      <Runner {image} prompt="Is there laundry?"/>
    </Control>
    <Runner {nav} x="0.0" y="{y}"/>
    <Runner {speech} text="Room {number} is done."/>
  </Control>
"""
    names = {"nav": NAV, "speech": SPEECH, "image": IMAGE}
    each = (room.format(number=n + 1, x=n % 6, y=n // 6, **names) for n in range(rooms))
    return f'<Plan name="morning_round">\n{"".join(each)}</Plan>\n'


def around() -> dict[str, str]:
    """The environment of a command: it runs the code of this repository."""
    return {**os.environ, "PYTHONPATH": str(REPO)}


@contextmanager
def service(folder: Path) -> Iterator[str]:
    """A service with a journal in this folder; its address."""
    command = [sys.executable, "-m", "gpsfsm", "serve", "--port", "0", "--workers", "1"]
    command += ["--journal", str(folder / "queue.db"), "--world", str(WORLD), "--isolated"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=around())  # noqa: S603
    assert process.stderr is not None
    try:
        said = []
        for line in process.stderr:
            said.append(line)
            if (match := re.search(r"serving at (http://\S+)", line)) is not None:
                yield match[1]
                return
        raise SystemExit("the service did not begin:\n" + "".join(said))
    finally:
        process.terminate()
        process.wait(60)
        process.stderr.close()


@contextmanager
def address(picture: Picture) -> Iterator[str]:
    """Where the page of a picture is."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if not picture.arguments:
            with service(folder) as running:
                yield running
            return
        plans(folder)
        command = [sys.executable, "-m", "gpsfsm", "view", "--isolated", *picture.arguments]
        subprocess.run(  # noqa: S603
            [*command, "-o", "page.html", "--force"],
            cwd=folder,
            env=around(),
            check=True,
            capture_output=True,
        )
        yield (folder / "page.html").as_uri()


def pose(page: Page, picture: Picture) -> None:
    """Bring an open page to the moment of the picture."""
    picture.prepare(page)
    page.mouse.move(0, 0)
    page.evaluate("document.activeElement.blur()")
    if picture.paper:
        page.evaluate("dispatchEvent(new Event('beforeprint'))")
        page.emulate_media(media="print")
        page.evaluate("document.body.style.padding = '14mm'")  # as a sheet has margins
    page.wait_for_timeout(500)  # until the picture has moved to where it belongs


def take(browser: Browser, picture: Picture) -> None:
    """Write the picture of a page."""
    width, height = picture.size
    page = browser.new_page(
        viewport={"width": width, "height": height}, color_scheme=picture.theme, locale="en-GB"
    )
    with address(picture) as place:
        page.goto(place)
        pose(page, picture)
        raw = page.screenshot(full_page=picture.paper)
        page.close()
    (FOLDER / picture.file).write_bytes(smaller(raw))


# ---- small files ---------------------------------------------------------------------------------


def smaller(png: bytes) -> bytes:
    """The picture with a palette of its most frequent colours; others become the nearest ones."""
    width, height, pixels = decoded(png)
    counts = Counter(pixels[at : at + 3] for at in range(0, len(pixels), 3))
    frequent = [color for color, _ in counts.most_common()]
    palette = frequent[:KEPT_COLORS]
    for color in frequent[KEPT_COLORS:]:
        if len(palette) < MOST_COLORS and all(distance(color, one) > NEAR for one in palette):
            palette.append(color)
    number = {color: place for place, color in enumerate(palette)}
    for color in counts.keys() - number.keys():
        number[color] = min(range(len(palette)), key=lambda n: distance(palette[n], color))
    rows = bytearray()
    for row in range(height):
        start = 3 * row * width
        rows.append(0)
        rows += bytes(number[pixels[at : at + 3]] for at in range(start, start + 3 * width, 3))
    head = struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    parts = (b"IHDR", head), (b"PLTE", b"".join(palette)), (b"IDAT", zlib.compress(rows, 9))
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunk(*part) for part in (*parts, (b"IEND", b"")))


def distance(one: bytes, other: bytes) -> int:
    """How far two colours are from each other."""
    return sum((a - b) ** 2 for a, b in zip(one, other, strict=True))


def chunk(kind: bytes, data: bytes) -> bytes:
    """A part of a PNG."""
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def decoded(png: bytes) -> tuple[int, int, bytes]:
    """Width, height and the red, green and blue of all pixels of a screenshot."""
    at, data, shape = 8, b"", (0, 0, 0, 0)
    while at < len(png):
        length, kind = struct.unpack(">I4s", png[at : at + 8])
        body = png[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            shape = struct.unpack(">IIBB", body[:10])
        elif kind == b"IDAT":
            data += body
        at += length + 12
    width, height, depth, color = shape
    assert (depth, color) in ((8, 2), (8, 6)), "this is no screenshot"
    size = 3 if color == 2 else 4
    rows, above, stride = zlib.decompress(data), bytes(width * size), width * size
    pixels = bytearray()
    for row in range(height):
        start = row * (stride + 1)
        above = unfiltered(rows[start], rows[start + 1 : start + 1 + stride], above, size)
        pixels += above if size == 3 else b"".join(above[n : n + 3] for n in range(0, stride, 4))
    return width, height, bytes(pixels)


def unfiltered(kind: int, row: bytes, above: bytes, size: int) -> bytes:
    """A row of a PNG as it was before it was filtered; see section 9 of the standard."""
    filtered = bytearray(row)
    for at in range(len(row)):
        left = filtered[at - size] if at >= size else 0
        corner = above[at - size] if at >= size else 0
        if kind == 1:
            guess = left
        elif kind == 2:
            guess = above[at]
        elif kind == 3:
            guess = (left + above[at]) // 2
        elif kind == 4:
            guess = min((left, above[at], corner), key=lambda n: abs(left + above[at] - corner - n))
        else:
            return row
        filtered[at] = (row[at] + guess) & 255
    return bytes(filtered)


# ---- the list ------------------------------------------------------------------------------------


def listed() -> str:
    """The text of docs/pictures/README.md."""
    rows = [f"| [{each.file}]({each.file}) | {each.shows} | {each.look} |" for each in PICTURES]
    return (
        "# Pictures of pages\n\n"
        "`make screenshots` takes these pictures of real pages anew. Then open each at full\n"
        "size and check what the last column says. The browser tests compare the pages of the\n"
        "pictures by their structure, not by pixels: `tests/viewing/browser/test_pictures.py`.\n"
        "`docs/pictures.py` draws the SVG files beside them.\n\n"
        "| picture | shows | look at |\n|---|---|---|\n" + "\n".join(rows) + "\n"
    )


def main(words: Sequence[str]) -> int:
    """Take the pictures; 1 if one has become too large."""
    arguments = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    arguments.add_argument("files", nargs="*", help="only these pictures")
    arguments.add_argument("--list", action="store_true", help="write only the list of pictures")
    wanted = arguments.parse_args(words)
    (FOLDER / "README.md").write_text(listed(), encoding="utf-8")
    if wanted.list:
        return 0
    from playwright.sync_api import sync_playwright

    path = os.environ.get("GPSFSM_CHROMIUM") or shutil.which("chromium")
    sizes = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=ARGUMENTS)
        for picture in PICTURES:
            if wanted.files and picture.file not in wanted.files:
                continue
            take(browser, picture)
            sizes.append((FOLDER / picture.file).stat().st_size)
            print(f"docs/pictures/{picture.file}: {sizes[-1]:,} bytes", flush=True)
        browser.close()
    return int(any(size > MOST_BYTES for size in sizes))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
