"""Makes the pictures of reports in docs/pictures: ``python docs/screenshots.py``.

Needs playwright and a Chromium. The reports are real ones, of a shipped plan, of one that
was mended, and of a machine; docs/screenshot_live.py makes the picture of the live page.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from playwright.sync_api import Page, ViewportSize

REPO = Path(__file__).parents[1]
PICTURES = REPO / "docs" / "pictures"
PLAN = REPO / "docs" / "examples" / "door_check.xml"
MACHINE = REPO / "docs" / "examples" / "door.json"
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
MOST_BYTES = 200_000


def view(folder: Path, *arguments: str) -> str:
    """The address of the report that ``gpsfsm view`` makes with these arguments."""
    command = [sys.executable, "-m", "gpsfsm", "view", "--isolated", *arguments]
    subprocess.run([*command, "-o", "page.html", "--force"], cwd=folder, check=True)  # noqa: S603
    return (folder / "page.html").as_uri()


def plans(folder: Path) -> None:
    """The plan that is shown, and one whose failures are handled."""
    text = PLAN.read_text(encoding="utf-8")
    guard = '<Control type="recovery"><Runner interface="{0}" provider="{0}" text="{1}"/></Control>'
    speech = guard.format("perception_capabilities/SpeechRunner", "I cannot see that.")
    end = text.index("</Control>", text.index("look_and_ask")) + len("</Control>")
    (folder / "door.xml").write_text(text, encoding="utf-8")
    (folder / "door.json").write_text(MACHINE.read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "guarded.xml").write_text(f"{text[:end]}\n    {speech}{text[end:]}", encoding="utf-8")


def scenario(page: Page) -> None:
    """A counterexample that is stepped to the sentence that matters."""
    page.locator(".finding", has_text="GP303").locator(".finding-play").click()
    page.get_by_label("To the start").click()
    for _ in range(3):
        page.keyboard.press(".")


def lasso(page: Page) -> None:
    """A loop, after somebody has stepped into the way and the robot asks."""
    page.locator(".finding", has_text="SpeechRunner").locator(".finding-play").first.click()
    page.get_by_label("To the start").click()
    for _ in range(5):
        page.keyboard.press(".")


def two(page: Page) -> None:
    """The same scenario on two plans, where they have gone apart."""
    for _ in range(4):
        page.keyboard.press(".")


def picture(page: Page, name: str) -> bool:
    """Write what is shown; whether it is small enough."""
    page.mouse.move(0, 0)
    page.evaluate("document.activeElement.blur()")
    page.wait_for_timeout(500)  # until the picture has moved to where it belongs
    target = PICTURES / name
    page.screenshot(path=str(target))
    size = target.stat().st_size
    print(f"{target.relative_to(REPO)}: {size:,} bytes")
    return size <= MOST_BYTES


def main() -> int:
    """Make the pictures; 1 if one has become too large."""
    from playwright.sync_api import sync_playwright

    browser_path = os.environ.get("GPSFSM_CHROMIUM") or shutil.which("chromium")
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        folder = Path(name)
        plans(folder)
        browser = playwright.chromium.launch(executable_path=browser_path, args=ARGUMENTS)
        size: ViewportSize = {"width": 1280, "height": 800}
        light = browser.new_page(viewport=size, color_scheme="light")
        light.goto(view(folder, "--select", "GP3", "door.xml"))
        scenario(light)
        small = [picture(light, "view-scenario.png")]
        machine = browser.new_page(viewport={"width": 1280, "height": 700}, color_scheme="light")
        machine.goto(view(folder, "door.json"))
        lasso(machine)
        small.append(picture(machine, "view-machine.png"))
        dark = browser.new_page(viewport=size, color_scheme="dark")
        dark.goto(view(folder, "--diff", "door.xml", "guarded.xml"))
        two(dark)
        small.append(picture(dark, "view-diff.png"))
        browser.close()
    return int(not all(small))


if __name__ == "__main__":
    sys.exit(main())
