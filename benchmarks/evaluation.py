"""What comes out of grading a recorded experiment again: totals, and the agreement with people.

The experiment is the part of the paper's that the development material holds: three models and two
systems. Nothing here depends on the machine.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from benchmarks.common import ROOT
from gpsfsm.grading.experiment import read_experiment
from gpsfsm.grading.table_one import ALL, evaluate, table
from gpsfsm.grading.tables import confusion_lines, confusion_of, markdown, short_rows
from gpsfsm.progress import progress_bar

EXPERIMENT = Path(os.environ.get("GPSFSM_CORPUS", ROOT.parent / "shared/corpus")) / "experiment1"


def main() -> int:
    if not EXPERIMENT.is_dir():
        print(f"the experiment is not here: {EXPERIMENT} (GPSFSM_CORPUS)", file=sys.stderr)
        return 2
    with progress_bar("grading", None) as progress:
        answers = read_experiment(str(EXPERIMENT))
        evaluation = evaluate(answers, str(ROOT / "experiments/navigation"), progress=progress)
    totals = [row for row in table(evaluation) if row.names[-1] == ALL]
    columns = ("system", "model", "prompt", "task")
    print("\n".join(markdown(short_rows(columns, totals, labelled=True))))
    print()
    print("```text")
    for system in sorted({one.answer.key.cell.system for one in evaluation}):
        pairs = (
            (one.answer.human, one.graded.grade)
            for one in evaluation
            if one.answer.key.cell.system == system
        )
        print(f"{system}: " + "\n".join(confusion_lines(confusion_of(pairs))))
    print("```")
    return 0


if __name__ == "__main__":
    sys.exit(main())
