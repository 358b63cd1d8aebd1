"""``python experiments/evaluate.py``: the table of an experiment, in both layouts."""

from __future__ import annotations

import csv
import importlib.util
import io
import json
import os
import shutil
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import NamedTuple
from unittest.mock import patch

from tests.cli.support import environment

REPO = Path(__file__).parents[2]
COMMAND = REPO / "experiments/evaluate.py"
FLAT = REPO / "experiments/sample/flat"
LINES = REPO / "experiments/sample/answers.jsonl"
PUBLISHED = REPO / "experiments/sample/published"


class Done(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


def evaluate(*arguments: str | Path) -> Done:
    """``python experiments/evaluate.py ARGUMENTS…``, in this process."""
    spec = importlib.util.spec_from_file_location("evaluate", COMMAND)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    out, err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8"), io.StringIO()
    words = [str(COMMAND), *map(str, arguments)]
    with (
        redirect_stdout(out),
        redirect_stderr(err),
        patch.object(sys, "argv", words),
        patch.object(sys, "path", list(sys.path)),
    ):
        code = module.main()
    out.seek(0)
    return Done(code, out.read(), err.getvalue())


def started(*arguments: str | Path, **changes: str) -> subprocess.CompletedProcess[str]:
    """The same in a process of its own."""
    done = subprocess.run(
        [sys.executable, str(COMMAND), *map(str, arguments)],
        capture_output=True,
        text=True,
        encoding="utf-8",
        env=environment(**changes),
        timeout=300,
        check=False,
    )
    assert "Traceback" not in done.stderr
    return done


def rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_the_table_has_the_grades_beside_those_of_people() -> None:
    done = evaluate(FLAT, "--format", "csv")
    assert done.returncode == 0
    table = {
        (row["system"], row["model"], row["prompt"], row["task"]): row for row in rows(done.stdout)
    }
    grades = ("answers", "success", "partial", "failed")
    human = ("human_success", "human_partial", "human_failed", "known", "equal")
    times = ("timed", "mean_s", "deviation_s", "pooled_s")
    row = table["fabric", "small", "zeroshot", "3"]
    assert [row[name] for name in grades] == ["2", "1", "1", "0"]
    assert [row[name] for name in human] == ["1", "1", "0", "2", "2"]
    assert [row[name] for name in times] == ["2", "3", "0.707107", ""]
    row = table["fabric", "large-base", "zeroshot", "3"]  # one answer without a plan
    assert [row[name] for name in grades] == ["2", "0", "1", "1"]
    row = table["fabric", "small", "zeroshot", "all"]
    assert [row[name] for name in grades] == ["4", "3", "1", "0"]
    assert [row[name] for name in times] == ["4", "2.25", "0.978945", "0.559017"]
    row = table["all", "all", "all", "all"]
    numbers = [int(row[name]) for name in (*grades, *human)]
    assert numbers == [10, 5, 3, 2, 5, 2, 2, 9, 8]
    assert done.stderr.startswith("agreement with the labels: 8 of 9 (88.9 %, kappa 0.824)\n")


def test_both_layouts_give_the_same_table() -> None:
    flat = started(FLAT, "--format", "csv")
    other = evaluate(PUBLISHED, "--format", "csv", "--labels", FLAT / "labels.csv")
    assert flat.stdout == other.stdout


def test_json_lines_give_the_same_table() -> None:
    flat = evaluate(FLAT, "--format", "csv")
    lines = evaluate(LINES, "--format", "csv", "--labels", FLAT / "labels.csv")
    assert (lines.returncode, lines.stdout) == (0, flat.stdout)
    assert lines.stderr.endswith(f"{LINES}:2: people say success, gpsfsm partial\n")
    alone = json.loads(evaluate(LINES, "--format", "json").stdout)["answers"]
    assert {each["human"] for each in alone} == {None}
    assert {each["path"] for each in alone} == {f"{LINES}:{number}" for number in range(1, 11)}


def test_a_field_of_json_lines(tmp_path: Path) -> None:
    file = tmp_path / "answers.txt"
    records = [json.loads(line) for line in LINES.read_text().splitlines()]
    moved = [{**each, "response": "no", "a": {"b": each["response"]}} for each in records]
    (tmp_path / "a.jsonl").write_text("".join(f"{json.dumps(each)}\n" for each in moved))
    whole, done = evaluate(LINES), evaluate(tmp_path / "a.jsonl", "--field", "a.b")
    assert (done.returncode, done.stdout) == (0, whole.stdout)
    assert evaluate(tmp_path / "a.jsonl").stdout != whole.stdout
    done = evaluate(file, "--field", "a.b")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("error: --field needs JSON lines")
    done = evaluate(FLAT / "responses.jsonl", "--totals")  # it holds times and no answers
    assert done.returncode == 2
    assert "| all | all | all | all | 10 | 0/0/0 (10 undecided) |" in done.stdout


def test_totals_are_the_rows_over_all_tasks() -> None:
    whole, totals = evaluate(FLAT, "--format", "csv"), evaluate(FLAT, "--format", "csv", "--totals")
    wanted = [row for row in rows(whole.stdout) if row["task"] == "all"]
    assert rows(totals.stdout) == wanted
    assert 0 < len(wanted) < len(rows(whole.stdout))


def test_corrupted_answers_count_nowhere(tmp_path: Path) -> None:
    """Named by a file or by a column of the labels: both give the same table."""
    listed = tmp_path / "corrupted.csv"
    listed.write_text(
        "system,model,version,prompt,task,iteration\n"
        "Fabric,small,,zeroshot,3,2\nfabric,large,base,oneshot,,\n,nobody,,,,\n"
    )
    done = evaluate(FLAT, "--totals", "--format", "csv", "--corrupted", listed)
    assert done.returncode == 0
    assert done.stderr.startswith(f"note: {listed}:4: names no answer of the experiment\n")
    table = {(row["system"], row["model"], row["prompt"]): row for row in rows(done.stdout)}
    row = table["fabric", "small", "zeroshot"]
    names = ("answers", "corrupted", "success", "partial", "failed", "known", "timed")
    assert [row[name] for name in names] == ["3", "1", "3", "0", "0", "3", "3"]
    row = table["fabric", "large-base", "oneshot"]
    assert [row[name] for name in names] == ["0", "2", "0", "0", "0", "0", "0"]
    assert (row["mean_s"], row["deviation_s"]) == ("", "")
    row = table["all", "all", "all"]
    assert [row[name] for name in names] == ["7", "3", "4", "2", "1", "7", "7"]
    labels = rows((FLAT / "labels.csv").read_text())
    for each in labels:
        corrupted = each["model"] == "large" and each["prompt"] == "oneshot"
        corrupted |= each["path"] == "fabric/small/zeroshot/task3/02.xml"
        each["corrupted"] = "yes" if corrupted else ""
    out = io.StringIO()
    writer = csv.DictWriter(out, labels[0].keys())
    writer.writeheader()
    writer.writerows(labels)
    (tmp_path / "labels.csv").write_text(out.getvalue())
    again = evaluate(FLAT, "--totals", "--format", "csv", "--labels", tmp_path / "labels.csv")
    assert again.stdout == done.stdout
    lines = evaluate(LINES, "--totals", "--format", "csv", "--labels", tmp_path / "labels.csv")
    assert lines.stdout == done.stdout
    (tmp_path / "labels.csv").write_text(out.getvalue().replace(",yes", ",perhaps"))
    done = evaluate(FLAT, "--labels", tmp_path / "labels.csv")
    assert done.returncode == 2
    assert "'perhaps' in the column 'corrupted' is neither yes nor no" in done.stderr


def test_families_have_rows_in_each_system_with_shares() -> None:
    families = ("--family", "big=large*", "--family", "the rest=*")
    lines = evaluate(FLAT, "--totals", *families).stdout.splitlines()
    assert lines[0].startswith("| system | model | prompt | task | answers | S/P/F | S/P/F, % |")
    shown = [line for line in lines if "| big |" in line or "| the rest |" in line]
    assert shown[0].startswith("| btgenbot | the rest | all | all | 2 | 1/1/0 | 50.0/50.0/0.0 |")
    assert shown[1].startswith("| fabric | big | all | all | 4 | 1/1/2 | 25.0/25.0/50.0 |")
    assert shown[2].startswith("| fabric | the rest | all | all | 4 | 3/1/0 | 75.0/25.0/0.0 |")
    assert len(shown) == 3
    plain = evaluate(FLAT, "--totals", "--format", "csv")
    with_rows = evaluate(FLAT, "--totals", "--format", "csv", *families)
    assert set(plain.stdout.splitlines()) < set(with_rows.stdout.splitlines())
    for wrong, message in (
        ("big", "a family is NAME=PATTERN,..., such as GPT=gpt-*, not big"),
        ("big= ,", "a family is NAME=PATTERN,..."),
        ("all=*", "a family cannot be called all"),
    ):
        done = evaluate(FLAT, "--family", wrong)
        assert (done.returncode, done.stdout) == (2, "")
        assert message in done.stderr


def test_a_published_table_stands_beside_ours(tmp_path: Path) -> None:
    published = tmp_path / "published.csv"
    head = "system,model,version,prompt,success,partial,failed,mean_s,deviation_s\n"
    published.write_text(
        f"{head}fabric,small,,zeroshot,3,1,0,2.25,0.97\nfabric,large,base,zeroshot,1,0,1,26.25,18\n"
        "fabric,none,,zeroshot,0,0,0,,\n"
    )
    text = evaluate(FLAT, "--compare", published).stdout
    columns = "published S/P/F (N) | time, s | here S/P/F (N) | time, s | counts | times |"
    _, _, compared = text.rpartition(f"| system | model | prompt | {columns}\n")
    lines = compared.splitlines()[1:]
    assert lines[:3] == [
        "| fabric | small | zeroshot | 3/1/0 (4) | 2.25 ± 0.97 | 3/1/0 (4) | 2.25 ± 0.98 "
        "| equal | equal |",
        "| fabric | large-base | zeroshot | 1/0/1 (2) | 26.25 ± 18.00 | 0/1/1 (2) | 26.25 ± 19.45 "
        "| differ | differ |",
        "| fabric | none | zeroshot | 0/0/0 (0) | - | no answers here |  |  |  |",
    ]
    assert lines[-1] == (
        "2 of 3 published rows have answers here: 1 with equal counts, 1 with times that are equal "
        "to 0.01 s"
    )
    done = evaluate(FLAT, "--compare", published, "--format", "csv")
    assert (done.returncode, done.stdout) == (2, "")
    assert "a published table is compared in Markdown: --format md" in done.stderr
    for line, message in (
        ("fabric,small,,zeroshot,3,1,-1,,", ":2: '-1' is not a number of answers"),
        ("fabric,small,,zeroshot,3,1,0,soon,", ":2: 'soon' is not a time"),
        ("f,m,,p,1,1,1,,\nF,m,,p,1,1,1,,", ":3: there is a line of f/m/p already"),
    ):
        published.write_text(f"{head}{line}\n")
        done = evaluate(FLAT, "--compare", published)
        assert (done.returncode, done.stdout) == (2, "")
        assert f"{published}{message}" in done.stderr
    published.write_text("system,model\n")
    assert "the column 'prompt' is missing" in evaluate(FLAT, "--compare", published).stderr


def test_the_papers_table_for_an_experiment_of_other_models() -> None:
    done = evaluate(FLAT, "--paper")
    assert done.returncode == 0
    assert "| fabric | local models | all | all | 8 | 4/2/2 | 50.0/25.0/25.0 |" in done.stdout
    assert (
        "| fabric | gpt-4o | oneshot | 49/1/0 (50) | 2.51 ± 0.88 | no answers here |" in done.stdout
    )
    assert done.stdout.rstrip().splitlines()[-1].startswith("0 of 28 published rows have answers")
    assert done.stderr.count("names no answer of the experiment") == 4


def test_markdown_and_json(tmp_path: Path) -> None:
    file = tmp_path / "table.md"
    assert evaluate(PUBLISHED, "-o", file).returncode == 0
    lines = file.read_text().splitlines()
    assert lines[0] == (
        "| system | model | prompt | task | answers | S/P/F | mean, s | deviation, s | pooled, s |"
    )
    assert lines[-1] == "| all | all | all | all | 10 | 5/3/2 | 7.25 | 12.06 | 8.94 |"
    content = json.loads(evaluate(FLAT, "--format", "json").stdout)
    assert len(content["answers"]) == 10
    missing = [one for one in content["answers"] if one["path"] is None]
    assert [(one["grade"], one["human"], one["seconds"]) for one in missing] == [
        ("failed", "failed", 40.0)
    ]
    assert content["groups"][0]["group"] == {
        **{"system": "btgenbot", "model": "small", "prompt": "zeroshot", "task": "3"}
    }
    assert content["agreement"]["matrix"]["success"]["partial"] == 1


def test_what_cannot_be_done_ends_in_a_message(tmp_path: Path) -> None:
    done = evaluate(tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"error: {tmp_path}: there is no experiment in it")
    done = evaluate(FLAT, "--tasks", tmp_path)
    assert done.returncode == 2
    assert "task3.yaml: there is no such file: what did task 3 ask for?" in done.stderr
    done = evaluate(FLAT, "-o", tmp_path / "none/table.md")
    assert done.returncode == 2
    assert "No such file or directory" in done.stderr


def test_a_library_that_is_missing_is_named(tmp_path: Path) -> None:
    (tmp_path / "lxml.py").write_text("raise ModuleNotFoundError(name='lxml')")
    done = started(FLAT, PYTHONPATH=str(tmp_path))
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: lxml is not installed; run: pip install -e .\n"


def test_an_answer_that_is_not_decided_is_told(tmp_path: Path) -> None:
    root = tmp_path / "flat"
    shutil.copytree(FLAT, root)
    os.truncate(root / "fabric/small/zeroshot/task1/01.xml", (64 << 20) + 1)  # over the limit
    done = evaluate(root)
    assert done.returncode == 2
    assert "| fabric | small | zeroshot | 1 | 2 | 1/0/0 (1 undecided) |" in done.stdout


def test_the_real_experiment(shared_corpus: Path, tmp_path: Path) -> None:
    """One model of it; of the others only the times are there, as if no plan had been found."""
    real = shared_corpus / "experiment1"
    (tmp_path / "fabric").mkdir()
    for name in ("labels.csv", "responses.jsonl", "fabric/gpt-4o"):
        (tmp_path / name).symlink_to(real / name)
    done = evaluate(tmp_path, "--format", "json")
    assert done.returncode == 0
    groups = {tuple(one["group"].values()): one for one in json.loads(done.stdout)["groups"]}
    assert groups["all", "all", "all", "all"]["answers"] == 600
    assert groups["fabric", "codellama-base", "zeroshot", "all"]["grades"]["failed"] == 50
    for prompt, wanted in (("zeroshot", (31, 19)), ("oneshot", (49, 1))):
        row = groups["fabric", "gpt-4o", prompt, "all"]
        assert (row["grades"]["success"], row["grades"]["partial"]) == wanted
        assert (row["agreement"]["known"], row["agreement"]["equal"]) == (50, 50)
    cell = groups["fabric", "gpt-4o", "zeroshot", "5"]
    assert cell["grades"] == {"success": 3, "partial": 7, "failed": 0, "undecided": 0}
    assert round(cell["seconds"]["mean"], 2) == 4.25


def test_the_answers_of_the_real_experiment(shared_corpus: Path) -> None:
    """Each answer as the model wrote it has the grade of the plan that was taken from it."""
    real = shared_corpus / "experiment1"
    folder, lines = (
        json.loads(evaluate(each, "--labels", real / "labels.csv", "--format", "json").stdout)
        for each in (real, real / "responses.jsonl")
    )
    assert len(lines["answers"]) == 600
    names = ("system", "model", "prompt", "task", "iteration", "grade", "theory", "human")
    for one, other in zip(folder["answers"], lines["answers"], strict=True):
        assert [one[name] for name in names] == [other[name] for name in names]
    assert folder["groups"] == lines["groups"]
    differ = [
        (one, other)
        for one, other in zip(folder["answers"], lines["answers"], strict=True)
        if one["syntax"] != other["syntax"]
    ]
    assert len(differ) == 111  # the experiment put the example of the prompt in their place
    for one, other in differ:
        assert one["reason"].startswith("example returned")
        assert not other["syntax"]
