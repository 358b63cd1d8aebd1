"""How long do pages of ``gpsfsm view`` take to write and to open, and how fast is a run stepped?

Pages of a plan of 12 runners and of plans of the scale families are opened in Chromium. Writing is
compared with a check of the same plan, in turn; frames are compared with those of an empty page in
the same browser: on a machine that does other things as well, that page does not reach 60 frames
per second either.
"""

from __future__ import annotations

import argparse
import gzip
import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

from benchmarks.common import GPSFSM, ROOT, circumstances, median, run, seconds, table, write_plan

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
    ("tour_guide", ()),
    ("chain", (50,)),
    ("chain", (500,)),
    ("random", (1, 1000)),
    ("chain", (5000,)),
)
"""A plan of the corpus with 12 runners; 100 runners, twice 1,000, and 10,000."""
HEAD = (
    "plan",
    "runners",
    "`gpsfsm view`, s",
    "times a check",
    "page, kB",
    "compressed, kB",
    "first painted, ms",
    "interactive, ms",
    "blocked, ms",
    "elements of the page",
)
STEPS_HEAD = (
    "plan",
    "runners",
    "frames/s stepping",
    "frames/s moving",
    "frames/s of an empty page",
)

WATCH = """() => {
  globalThis.longTasks = [];
  new PerformanceObserver((list) => {
    for (const { startTime, duration } of list.getEntries()) {
      globalThis.longTasks.push([startTime, duration]);
    }
  }).observe({ type: "longtask", buffered: true });
}"""
LOADED = """() => {
  const [painted] = performance.getEntriesByName("first-contentful-paint");
  const [opened] = performance.getEntriesByName("gpsfsm-open");
  const ends = globalThis.longTasks.map(([start, duration]) => start + duration);
  return {
    painted: painted.startTime,
    interactive: Math.max(painted.startTime, opened.startTime, ...ends),
    blocked: globalThis.longTasks.reduce((sum, [, time]) => sum + Math.max(0, time - 50), 0),
    elements: document.querySelectorAll("*").length,
  };
}"""
"""As Lighthouse has it: interactive from the end of the last task of more than 50 ms; blocked by
what such tasks take beyond that."""

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
    print(table(HEAD, [loading for loading, _ in rows]))
    print()
    print(table(STEPS_HEAD, [stepping for _, stepping in rows]))
    print()
    print(
        "The page is read from disk, uncompressed; a server would send the compressed size. A "
        "step is one record of a run in which every instance runs, shown with the whole plan in "
        "view. Medians; plans of more than 2,500 nodes open folded."
    )


def measured(
    browser: Browser, folder: Path, family: str, arguments: tuple[int, ...], rounds: int
) -> tuple[list[str], list[str]]:
    """One line of each table."""
    name = "_".join(map(str, (family, *arguments)))
    plan, file = folder / f"{name}.xml", folder / f"{name}.html"
    if arguments:
        write_plan(plan, family, *arguments)
    else:
        plan = ROOT / "corpus" / "plans" / f"{family}.xml"
    writing, checking = [], []
    for _ in range(rounds):
        made = run([*GPSFSM, "view", plan, "-o", file, "--force"])
        writing.append(made.seconds)
        checking.append(run([*GPSFSM, "check", plan]).seconds)
        if not file.exists():
            raise SystemExit(f"no page was made of {name}: {made.err}")
    opened = []
    for _ in range(rounds - 1):
        page = open_page(browser, file)
        opened.append(page.evaluate(LOADED))
        page.close()
    page = open_page(browser, file)
    opened.append(page.evaluate(LOADED))
    runners = page.evaluate("() => globalThis.gpsfsmPage.store.plan.facts.runners")
    page.evaluate(ALL_RUN)
    page.wait_for_timeout(500)
    stepping, moving = frames(page, "step"), frames(page, "pan")
    page.close()
    loaded = [
        f"{median(each[figure] for each in opened):,.0f}"
        for figure in ("painted", "interactive", "blocked", "elements")
    ]
    data = file.read_bytes()
    loading = [
        name,
        f"{runners:,}",
        seconds(median(writing)),
        f"{median(writing) / median(checking):.1f}",
        f"{len(data) / 1000:,.0f}",
        f"{len(gzip.compress(data)) / 1000:,.0f}",
        *loaded,
    ]
    frames_s = (stepping, moving, empty(browser))
    return loading, [name, f"{runners:,}", *(f"{each:.0f}" for each in frames_s)]


def open_page(browser: Browser, file: Path) -> Page:
    """A page that is shown, in a context of its own, so that nothing is cached."""
    page = browser.new_context(viewport=SIZE).new_page()
    page.add_init_script(f"({WATCH})()")
    page.goto(file.as_uri())
    page.wait_for_function("() => performance.getEntriesByName('first-contentful-paint').length")
    page.wait_for_timeout(500)  # what is still to be done after the first picture
    return page


def empty(browser: Browser) -> float:
    """Frames per second of a page with nothing in it."""
    page = browser.new_context(viewport=SIZE).new_page()
    page.goto("about:blank")
    painted = frames(page, "nothing")
    page.close()
    return painted


def frames(page: Page, kind: str) -> float:
    """Frames per second while something is done in each: by the median of the times between."""
    times: list[Any] = page.evaluate(FRAMES, kind)
    return 1000 / median(map(float, times))


if __name__ == "__main__":
    main()
