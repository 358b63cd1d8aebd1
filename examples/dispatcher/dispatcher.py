"""A dispatcher without ROS: it runs the plans of a folder, but only those that the gate accepts.

    python examples/dispatcher/dispatcher.py FOLDER

It takes plans from FOLDER/incoming, in the order of their names. A plan is put there whole, by
renaming it. It is moved to FOLDER/working first, so that it never runs twice, read once, decided
about, and run from what was read: what is changed in the meantime cannot run. In the end it is in
FOLDER/refused, done or failed, beside the receipt of the gate, NAME.json.
"""

from __future__ import annotations

import argparse
import signal
import threading
from pathlib import Path

import gpsfsm
from gpsfsm import Gate, printable, write_receipt

STATES = ("incoming", "working", "refused", "done", "failed")
MOST_BYTES = 64 << 20
POLL_S = 0.1


class Dispatcher:
    """Takes plans from a folder until it is told to stop."""

    def __init__(self, folder: Path, gate: Gate) -> None:
        self._folder = folder
        self._gate = gate
        self.stopping = threading.Event()
        for state in STATES:
            (folder / state).mkdir(parents=True, exist_ok=True)

    def run(self, *, once: bool) -> None:
        """Dispatch what comes in; with ``once`` what is there now."""
        for left in sorted(self._place("working").iterdir()):
            say(
                f"{left.name}: was being run when the dispatcher ended; nobody knows how far it got"
            )
        while not self.stopping.is_set():
            waiting = sorted(self._place("incoming").glob("[!.]*.xml"))
            if waiting:
                self.dispatch(waiting[0])
            elif once:
                return
            else:
                self.stopping.wait(POLL_S)

    def dispatch(self, plan: Path) -> None:
        """Decide about a plan, and run it if it is accepted."""
        working = plan.rename(self._place("working") / plan.name)
        if working.is_symlink() or not working.is_file():
            self._finish(working, "refused", "is not a file")
            return
        with working.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
        verdict = self._gate(content, plan.name)
        receipt = self._place("working") / f"{plan.name}.json"
        receipt.write_text(write_receipt([verdict]), encoding="utf-8")
        if not verdict:
            self._finish(working, "refused", f"{verdict}: {verdict.message}")
            return
        say(f"{plan.name}: {verdict}")
        result = gpsfsm.run(content)
        self._finish(working, "done" if result else "failed", result.plans[0].summary)

    def _finish(self, working: Path, state: str, reason: str) -> None:
        for file in (working.with_name(f"{working.name}.json"), working):
            if file.exists() or file.is_symlink():
                file.rename(self._place(state) / file.name)
        say(f"{working.name}: {reason}")

    def _place(self, state: str) -> Path:
        return self._folder / state


def say(line: str) -> None:
    """Tell what happens. Names of files may hold anything."""
    print(printable(line), flush=True)


def main() -> None:
    """Dispatch until SIGTERM or Ctrl-C comes; a plan that is being run is run to its end."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("folder", type=Path, help="where plans come in")
    parser.add_argument("--once", action="store_true", help="end when no plan is left")
    parser.add_argument("--budget-ms", type=int, default=10_000, help="what deciding may take")
    chosen = parser.parse_args()
    with Gate(budget_ms=chosen.budget_ms) as gate:
        dispatcher = Dispatcher(chosen.folder, gate)
        for number in (signal.SIGTERM, signal.SIGINT):
            signal.signal(number, lambda *_: dispatcher.stopping.set())
        say("ready")
        dispatcher.run(once=chosen.once)
    say("stopped")


if __name__ == "__main__":
    main()
