"""How long does an editor wait after a keystroke, in a plan of 100 runners?

A small editor types into the plan, a character at a time, and asks the server as editors do. The
diagnostics are counted from the keystroke on, with the time for which the server waits for the next
keystroke; they are for the text as it is after this keystroke.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.common import circumstances, percentile, table
from gpsfsm.lsp.checking import DELAY_S
from tests.lsp.client import Editor

GO = (
    '<Runner interface="nav2_capabilities/WaypointRunner" '
    'provider="nav2_capabilities/WaypointRunner" x="{x}.0" y="2.0"/>'
)
SAY = (
    '<Runner interface="perception_capabilities/SpeechRunner" '
    'provider="perception_capabilities/SpeechRunner" text="This is place {x}."/>'
)
TYPED = "The quick brown fox is at the door; "


def plan(runners: int) -> str:
    """Places to go to, each with another one to go to instead, and words there."""
    lines = ["<Plan>"]
    for x in range(runners // 4):
        lines += [
            '  <Control type="sequential">',
            f"    {GO.format(x=x)}",
            f'    <Control type="recovery">{GO.format(x=x + 1)}{SAY.format(x=x)}</Control>',
            f"    {SAY.format(x=x)}",
            "  </Control>",
        ]
    return "\n".join([*lines, "</Plan>\n"])


def milliseconds(work: Any) -> float:
    """What it takes."""
    began = time.perf_counter()
    work()
    return 1000 * (time.perf_counter() - began)


def measured(runners: int, keystrokes: int) -> dict[str, list[float]]:
    """Milliseconds of each kind, once for each keystroke."""
    seconds: dict[str, list[float]] = {}
    with tempfile.TemporaryDirectory() as folder, Editor(Path(folder)) as editor:
        text = plan(runners)
        uri = editor.open("plan.xml", text)
        editor.diagnostics(uri)
        at = text.index("This is place", len(text) // 2)
        ask = "textDocument/completion", "textDocument/hover"
        for number in range(keystrokes + 5):
            typed = TYPED[number % len(TYPED)]
            began = time.perf_counter()
            editor.edit(uri, at, at, typed)
            at += 1
            times = {
                "completion of a parameter": milliseconds(partial(editor.at, uri, ask[0], at)),
                "hover": milliseconds(partial(editor.at, uri, ask[1], at)),
            }
            editor.diagnostics(uri)
            times["diagnostics"] = 1000 * (time.perf_counter() - began)
            inside = editor.texts[uri].index("nav2_", at) + 3
            durations = milliseconds(partial(editor.at, uri, ask[0], inside))
            times["completion of an interface"] = durations
            for name, each in times.items():
                if number >= 5:  # the first ones load what it takes
                    seconds.setdefault(name, []).append(each)
        editor.end()
    return seconds


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runners", type=int, default=100)
    parser.add_argument("--keystrokes", type=int, default=100)
    chosen = parser.parse_args()
    where = circumstances()
    rows = []
    for name, each in measured(chosen.runners, chosen.keystrokes).items():
        figures = (percentile(each, 0.5), percentile(each, 0.99), max(each))
        rows.append([name, str(len(each)), *(f"{figure:,.0f}" for figure in figures)])
    print(f"{where} A plan of {chosen.runners} runners.")
    print()
    print(table(["after a keystroke", "keystrokes", "p50, ms", "p99, ms", "greatest, ms"], rows))
    print()
    print(f"Of the diagnostics {1000 * DELAY_S:g} ms are the wait for the next keystroke.")


if __name__ == "__main__":
    main()
