"""How much faster ``gpsfsm fuzz`` is with several processes: whole commands, and the same bytes.

The plan is a chain of waypoints with a recovery for each. Many runs of it that break nothing are
the longest way; a plan that is changed, the checks of its mutants.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

from benchmarks.common import GPSFSM, ROOT, circumstances, run, seconds, table

WAYPOINTS = 5
ENGINES = ("1", "2", "ray")
WORK = {
    "4,000 runs": ("--runs", "4000", "--faults", "late"),
    "200 mutants": ("--mutate", "--runs", "200"),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--engines", default=",".join(ENGINES))
    chosen = parser.parse_args().engines.split(",")
    if "ray" in chosen and importlib.util.find_spec("ray") is None:
        raise SystemExit("this needs the extra 'ray'")
    where = circumstances()
    script = str(ROOT / "corpus" / "generate.py")
    command = [sys.executable, script, "chain", str(WAYPOINTS)]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        plan = Path(folder) / "plan.xml"
        plan.write_text(text, encoding="utf-8")
        for name, words in WORK.items():
            alone, reference = 0.0, ""
            for jobs in chosen:
                done = run([*GPSFSM, "fuzz", plan, "--format", "json", *words, "--jobs", jobs])
                if done.code not in (0, 1):
                    raise SystemExit(done.err)
                reference = reference or done.out
                if done.out != reference:
                    raise SystemExit(f"--jobs {jobs} prints something else")
                alone = alone or done.seconds
                factor = f"{alone / done.seconds:.2f}x"
                rows.append([name, f"`--jobs {jobs}`", seconds(done.seconds), factor])
    print(where)
    print()
    print(table(["what is done", "engine", "time, s", "speed"], rows))
    print("\nThe outputs are the same, byte for byte.")


if __name__ == "__main__":
    main()
