"""How long does a page of ``gpsfsm view`` take to open, and how fast is a run stepped in it?

Pages of plans of the scale families are opened in Chromium. Frames are compared with those of an
empty page in the same browser: on a machine that does other things as well, that page does not
reach 60 frames per second either.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import GPSFSM, circumstances, median, run, seconds, table, write_plan

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page, ViewportSize

CHROMIUM = Path(os.environ.get("GPSFSM_CHROMIUM", "/usr/bin/chromium"))
FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
SIZE: ViewportSize = {"width": 1440, "height": 900}
FAMILIES: tuple[tuple[str, tuple[int, ...]], ...] = (
    ("chain", (50,)),
    ("chain", (500,)),
    ("random", (1, 1000)),
    ("chain", (5000,)),
)
"""100 runners, twice 1,000, and 10,000."""

FRAMES = """(kind) => new Promise((done) => {
  const page = globalThis.gpsfsmPage;
  const work = {
    nothing() {},
    step() {
      const { player } = page.stages.plan.made;
      player.seek((player.position + 1) % player.length);
    },
    pan(count) {
      page.stages.plan.made.graph.camera.moveBy(count % 40 < 20 ? 6 : -6, 2);
    },
  }[kind];
  const times = [];
  const tick = (now) => {
    times.push(now);
    work(times.length);
    if (now - times[0] < 3000) requestAnimationFrame(tick);
    else done(times.slice(1).map((time, place) => time - times[place]));
  };
  requestAnimationFrame(tick);
})"""

ALL_RUN = """() => {
  const { store, stages } = globalThis.gpsfsmPage;
  const records = [];
  store.plan.automaton.nodes.forEach((node, number) => {
    if (node.kind !== "runner") return;
    for (const kind of ["TRIGGERED", "STARTED", "SUCCEEDED"]) {
      records.push({ kind, at_us: records.length, node: number });
    }
  });
  store.openPlay({ title: "all", ends: "COMPLETED", story: [], story_at: [], records });
  stages.plan.made.graph.fit();
}"""

OPENED = """() => performance.getEntriesByName("gpsfsm-open")[0].startTime"""
PAINTED = (
    """() => (performance.getEntriesByName("first-contentful-paint")[0] || {}).startTime || 0"""
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3, help="how often each page is opened")
    chosen = parser.parse_args()
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        print("Not measured: this needs the Python package playwright.")
        return
    if not CHROMIUM.exists():
        print("Not measured: there is no Chromium. Say where it is with `GPSFSM_CHROMIUM=program`.")
        return
    where = circumstances()
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=list(FLAGS))
        rows = [
            measured(browser, Path(folder), family, arguments, chosen.rounds)
            for family, arguments in FAMILIES
        ]
        browser.close()
    print(where)
    print()
    head = [
        "plan",
        "runners",
        "`gpsfsm view`, s",
        "page, kB",
        "opens, ms",
        "first painted, ms",
        "frames/s stepping",
        "frames/s moving",
        "frames/s of an empty page",
    ]
    print(table(head, rows))
    print()
    print(
        "A step is one record of a run in which every instance runs, shown with the whole plan in "
        "view. Medians; plans of more than some thousand nodes open folded."
    )


def measured(
    browser: Browser, folder: Path, family: str, arguments: tuple[int, ...], rounds: int
) -> list[str]:
    """One line of the table."""
    name = "_".join(map(str, (family, *arguments)))
    plan, file = folder / f"{name}.xml", folder / f"{name}.html"
    write_plan(plan, family, *arguments)
    made = run([*GPSFSM, "view", plan, "-o", file, "--force"])
    if not file.exists():
        raise SystemExit(f"no page was made of {name}: {made.err}")
    opened, painted = [], []
    for _ in range(rounds - 1):
        page = open_page(browser, file)
        opened.append(page.evaluate(OPENED))
        painted.append(page.evaluate(PAINTED))
        page.close()
    page = open_page(browser, file)
    opened.append(page.evaluate(OPENED))
    painted.append(page.evaluate(PAINTED))
    runners = page.evaluate("() => globalThis.gpsfsmPage.store.plan.facts.runners")
    page.evaluate(ALL_RUN)
    page.wait_for_timeout(500)
    stepping, moving = frames(page, "step"), frames(page, "pan")
    page.close()
    return [
        name,
        f"{runners:,}",
        seconds(made.seconds),
        f"{file.stat().st_size / 1000:,.0f}",
        f"{median(opened):,.0f}",
        f"{median(painted):,.0f}",
        f"{stepping:.0f}",
        f"{moving:.0f}",
        f"{empty(browser):.0f}",
    ]


def open_page(browser: Browser, file: Path) -> Page:
    """A page that is shown, in a context of its own, so that nothing is cached."""
    page = browser.new_context(viewport=SIZE).new_page()
    page.goto(file.as_uri())
    page.wait_for_function("() => performance.getEntriesByName('first-contentful-paint').length")
    return page


def empty(browser: Browser) -> float:
    """Frames per second of a page with nothing in it."""
    page = browser.new_context(viewport=SIZE).new_page()
    page.goto("about:blank")
    found = frames(page, "nothing")
    page.close()
    return found


def frames(page: Page, kind: str) -> float:
    """Frames per second while something is done in each: by the median of the times between."""
    times: list[Any] = page.evaluate(FRAMES, kind)
    return 1000 / median(map(float, times))


if __name__ == "__main__":
    main()
