"""Run the benchmarks and write their tables into docs/performance.md and other pages.

``python benchmarks/run.py`` runs all of them, ``python benchmarks/run.py --only scale`` one. Each
is a process of its own, and its table replaces the one between its two markers in the document.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PERFORMANCE = ROOT / "docs" / "performance.md"
DOCUMENTS = {
    "answers": ROOT / "docs" / "generation.md",
    "editor": ROOT / "docs" / "editors.md",
    "evaluation": ROOT / "docs" / "experiments.md",
    "findings": ROOT / "docs" / "findings.md",
    "rival": ROOT / "docs" / "rival.md",
    "ros": ROOT / "docs" / "ros.md",
    "table one": ROOT / "docs" / "experiments.md",
}
"""Where the parts stand that do not stand in the first one."""
PARTS = {
    "cold": "benchmarks.cold",
    "plans": "benchmarks.plans",
    "loading": "benchmarks.loading",
    "gate": "benchmarks.gate",
    "editor": "benchmarks.editor",
    "proofs": "benchmarks.proofs",
    "grading": "benchmarks.grading",
    "task proofs": "benchmarks.task_proofs",
    "reading": "benchmarks.reading",
    "replays": "benchmarks.replays",
    "scale": "benchmarks.scale",
    "graph": "benchmarks.graph",
    "workers": "benchmarks.workers",
    "fuzz": "benchmarks.fuzz",
    "trees": "benchmarks.trees",
    "explorations": "benchmarks.explorations",
    "engine": "benchmarks.engine",
    "pictures": "benchmarks.pictures",
    "view": "benchmarks.view",
    "other": "benchmarks.other_tools.run",
    "rival": "benchmarks.rival",
    "answers": "benchmarks.answers",
    "evaluation": "benchmarks.evaluation",
    "table one": "benchmarks.table_one",
    "findings": "benchmarks.findings",
    "ros": "benchmarks.ros",
}


def replaced(document: str, part: str, result: str) -> str:
    """The document with ``result`` between the markers of ``part``."""
    marker = re.compile(f"(<!-- bench:{part} -->\n).*?(<!-- /bench:{part} -->)", re.DOTALL)
    if not marker.search(document):
        raise SystemExit(f"there are no markers <!-- bench:{part} -->")
    return marker.sub(lambda match: f"{match[1]}{result}\n{match[2]}", document, count=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", action="append", choices=sorted(PARTS), help="run this part")
    parser.add_argument("--dry-run", action="store_true", help="print, but write nothing")
    chosen = parser.parse_args()
    path = os.pathsep.join(filter(None, (str(ROOT), os.environ.get("PYTHONPATH"))))
    for part, module in PARTS.items():
        if chosen.only and part not in chosen.only:
            continue
        done = subprocess.run(
            [sys.executable, "-m", module],
            cwd=ROOT,
            env={**os.environ, "PYTHONPATH": path},
            stdout=subprocess.PIPE,
            text=True,
            check=False,
        )
        print(f"== {part} ==\n{done.stdout}", flush=True)
        if done.returncode != 0:
            raise SystemExit(f"the part '{part}' failed; its table was left as it is")
        if not chosen.dry_run:
            document = DOCUMENTS.get(part, PERFORMANCE)
            text = document.read_text(encoding="utf-8")
            document.write_text(replaced(text, part, done.stdout.strip()), encoding="utf-8")


if __name__ == "__main__":
    main()
