"""Makes docs/pictures/live.png, the picture of the live page: ``python docs/screenshot_live.py``.

Needs the extra ``serve``, playwright and a Chromium. The page is a real one: a service of its own
runs a plan in the world ``home``, which is stopped in the middle, while the robot speaks.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator

REPO = Path(__file__).parents[1]
TARGET = REPO / "docs" / "pictures" / "live.png"
WORLD = REPO / "corpus" / "worlds" / "home.yaml"
ARGUMENTS = ["--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
MOST_BYTES = 200_000

NAV, SPEECH, IMAGE = (
    f'interface="{name}" provider="{name}"'
    for name in (
        "nav2_capabilities/WaypointRunner",
        "perception_capabilities/SpeechRunner",
        "perception_capabilities/ImageAnalysisRunner",
    )
)
PLAN = f"""<Plan name="greet">
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


@contextmanager
def service(folder: str) -> Iterator[str]:
    """A service with a journal in this folder; its address."""
    command = [sys.executable, "-m", "gpsfsm", "serve", "--port", "0", "--workers", "1"]
    command += ["--journal", f"{folder}/queue.db", "--world", str(WORLD), "--isolated"]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)  # noqa: S603
    assert process.stderr is not None
    try:
        said = []
        for line in process.stderr:
            said.append(line)
            if (found := re.search(r"serving at (http://\S+)", line)) is not None:
                yield found[1]
                return
        raise SystemExit("the service did not begin:\n" + "".join(said))
    finally:
        process.terminate()
        process.wait(60)


def main() -> int:
    """Make the picture; 1 if it has become too large."""
    from playwright.sync_api import sync_playwright

    browser_path = os.environ.get("GPSFSM_CHROMIUM") or shutil.which("chromium")
    with (
        tempfile.TemporaryDirectory() as folder,
        service(folder) as address,
        sync_playwright() as playwright,
    ):
        browser = playwright.chromium.launch(executable_path=browser_path, args=ARGUMENTS)
        page = browser.new_page(viewport={"width": 1280, "height": 800})
        page.goto(address)
        page.get_by_label("Text of the plan").fill(PLAN)
        page.locator(".draft-status.good").wait_for()
        page.get_by_label("Speed of the run").select_option("2")
        page.get_by_role("button", name="Run", exact=True).click()
        page.locator(".map-bubble").first.wait_for(timeout=60_000)
        page.get_by_role("button", name="Pause the run").click()
        page.locator(".run-badge.held").wait_for()
        page.mouse.move(0, 0)
        page.wait_for_timeout(500)
        page.screenshot(path=str(TARGET))
        browser.close()
    size = TARGET.stat().st_size
    print(f"{TARGET.relative_to(REPO)}: {size:,} bytes")
    return int(size > MOST_BYTES)


if __name__ == "__main__":
    sys.exit(main())
