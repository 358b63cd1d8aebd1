"""The worked notebook: it runs from its first cell to its last, and shows what its file shows.

``GPSFSM_UPDATE_GOLDEN=1`` writes what it shows now.
"""

from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parents[1] / "docs/notebooks/tour.ipynb"
TIMEOUT_S = 120


def executed(content: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The notebook after a run in a kernel of its own, without the times of its cells."""
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    client = pytest.importorskip("nbclient", reason="nbclient is not installed")
    pytest.importorskip("ipykernel", reason="ipykernel is not installed")
    notebook = nbformat.reads(json.dumps(content), as_version=4)
    runner = client.NotebookClient(
        notebook,
        timeout=TIMEOUT_S,
        kernel_name="python3",
        record_timing=False,
        resources={"metadata": {"path": str(folder)}},
    )
    runner.execute()
    done: dict[str, Any] = json.loads(nbformat.writes(notebook))
    done["metadata"] = content["metadata"]  # the version of Python is no part of what is shown
    return done


def outputs(content: dict[str, Any]) -> list[str]:
    """The text, HTML and SVG below each cell; a kernel may send a text in several parts."""
    shown = []
    for cell in content["cells"]:
        text = ""
        for output in (*cell.get("outputs", ()), None):
            if output is not None and "text" in output:
                text += "".join(output["text"])
                continue
            shown += [json.dumps(text.splitlines(keepends=True), ensure_ascii=False)] * bool(text)
            text = ""
            if output is not None:
                shown.append(json.dumps(output["data"], ensure_ascii=False))
    return shown


def test_a_text_that_comes_in_parts_is_one() -> None:
    parts = [{"text": ["the same:"]}, {"text": [" yes\n", "so\n"]}, {"data": {"text/html": "x"}}]
    whole = [{"text": ["the same: yes\n", "so\n"]}, {"data": {"text/html": "x"}}]
    shown = outputs({"cells": [{"outputs": whole}]})
    assert outputs({"cells": [{"outputs": parts}]}) == shown
    assert len(shown) == 2


@pytest.mark.filterwarnings("default")  # of other people's event loops
@pytest.mark.usefixtures("_quiet_home")
def test_the_notebook_shows_what_its_file_shows(tmp_path: Path) -> None:
    content = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    done = executed(content, tmp_path)
    if "GPSFSM_UPDATE_GOLDEN" in os.environ:
        text = json.dumps(done, indent=1, ensure_ascii=False) + "\n"
        NOTEBOOK.write_text(text, encoding="utf-8")
        return
    assert outputs(done) == outputs(content)
    assert len(outputs(done)) > 12


@pytest.fixture
def _quiet_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """IPython keeps a history and a profile in the home of its user."""
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    monkeypatch.setenv("JUPYTER_PLATFORM_DIRS", "1")
    monkeypatch.setenv("PYDEVD_DISABLE_FILE_VALIDATION", "1")


def test_each_cell_of_the_file_was_run_and_none_failed() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert [cell["execution_count"] for cell in code] == list(range(1, len(code) + 1))
    kinds = {output["output_type"] for cell in code for output in cell["outputs"]}
    assert "error" not in kinds


def test_the_bars_of_the_file_are_full_and_there_is_one_for_each_long_job() -> None:
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    long_jobs = sum(
        "progress=True" in "".join(cell["source"]) for cell in cells if "outputs" in cell
    )
    text = json.dumps(cells)
    bars = re.findall(r'<progress value=\\"(\d+)\\" max=\\"(\d+)\\">', text)
    assert len(bars) == long_jobs > 2
    assert all(done == total for done, total in bars)
