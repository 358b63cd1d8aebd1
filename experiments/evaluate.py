"""Grade the answers of a recorded experiment and write a table like the paper's Table I.

    python experiments/evaluate.py ../gpsfsm-2026
    python experiments/evaluate.py ../gpsfsm-2026 --labels labels.csv --format csv -o table.csv
    python experiments/evaluate.py responses.jsonl --labels labels.csv
    python experiments/evaluate.py ../gpsfsm-2026 --totals --paper

PATH is a checkout of the paper's public repository, a folder of the flat layout, or a file of JSON
lines; docs/experiments.md describes them. Answers to task N are graded against taskN.yaml.

Exit code: 0 every answer has its grade, 2 one could not be read or decided, or there are none.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
PAPER = HERE / "table1"


def main() -> int:
    """Run the command; returns the exit code."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("path", metavar="PATH", help="the experiment")
    parser.add_argument("--field", metavar="NAME", help="the field of JSON lines with the answer")
    parser.add_argument("--format", choices=("md", "csv", "json"), default="md")
    parser.add_argument("--labels", metavar="FILE", help="grades that people gave (CSV)")
    parser.add_argument(
        "--corrupted", metavar="FILE", help="answers that count nowhere (CSV), apart from labels"
    )
    parser.add_argument(
        "--family",
        metavar="NAME=PATTERN,...",
        action="append",
        default=[],
        help="a row over these models in each system, such as 'GPT=gpt-*'; may be repeated",
    )
    parser.add_argument("--compare", metavar="FILE", help="a published table to show beside (CSV)")
    parser.add_argument(
        "--paper",
        action="store_true",
        help="compare with the paper's Table I: its corrupted answers, its families, its numbers",
    )
    parser.add_argument(
        "--tasks",
        metavar="FOLDER",
        default=str(HERE / "navigation"),
        help="task files task1.yaml, task2.yaml and so on (default: navigation, beside this file)",
    )
    parser.add_argument("--totals", action="store_true", help="only the rows over all tasks")
    parser.add_argument("-o", "--output", metavar="FILE", help="write to this file")
    parser.add_argument("--output-file", dest="output", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    sys.path.insert(0, str(HERE.parent))  # a checkout need not be installed
    try:
        return _run(chosen)
    except ModuleNotFoundError as error:
        print(f"error: {error.name} is not installed; run: pip install -e .", file=sys.stderr)
        return 2


def _run(chosen: argparse.Namespace) -> int:
    from gpsfsm.errors import GpsfsmError
    from gpsfsm.grading.experiment import mark_corrupted, read_experiment
    from gpsfsm.grading.grader import Grade
    from gpsfsm.grading.table_one import (
        Family,
        agreement_lines,
        evaluate,
        read_rows_of_table,
        written,
    )
    from gpsfsm.progress import MANY, progress_bar

    if chosen.paper:
        chosen.corrupted = chosen.corrupted or str(PAPER / "corrupted.csv")
        chosen.compare = chosen.compare or str(PAPER / "paper.csv")
        chosen.family = chosen.family or ["GPT=gpt-*", "local models=*"]
    if chosen.compare and chosen.format != "md":
        print("error: a published table is compared in Markdown: --format md", file=sys.stderr)
        return 2
    try:
        families = [Family.of(each) for each in chosen.family]
        published = read_rows_of_table(chosen.compare) if chosen.compare else []
        experiment = read_experiment(chosen.path, chosen.labels, chosen.field)
        if chosen.corrupted:
            experiment, unused = mark_corrupted(experiment, chosen.corrupted)
            for place in unused:
                print(f"note: {place}: names no answer of the experiment", file=sys.stderr)
        with progress_bar("grading", len(experiment), at_least=MANY) as progress:
            results = evaluate(experiment, chosen.tasks, progress=progress)
    except GpsfsmError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    text = written(
        results, chosen.format, totals=chosen.totals, families=families, published=published
    )
    if chosen.format == "csv" and any(one.answer.human is not None for one in results):
        print("\n".join(agreement_lines(results)), file=sys.stderr)
    if not _put(text, chosen.output):
        return 2
    return 2 if any(one.graded.grade is Grade.UNDECIDED for one in results) else 0


def _put(text: str, file: str | None) -> bool:
    """Write the table; False, with a message, if that is not possible."""
    data = text.encode("utf-8", "backslashreplace")
    try:
        if file is None:
            sys.stdout.buffer.write(data)
            sys.stdout.buffer.flush()
        else:
            Path(file).write_bytes(data)
    except OSError as error:
        print(f"error: {file or 'standard output'}: {error.strerror or error}", file=sys.stderr)
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
