"""Every format on every sample, compared with files. GPSFSM_UPDATE_GOLDEN=1 writes them anew."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from gpsfsm.report import RenderOptions, format_names, render
from tests.report.samples import SAMPLES

GOLDEN = Path(__file__).parent / "golden"
VARIANTS = {
    "": RenderOptions(version="1.2.3"),
    "-color": RenderOptions(color=True, statistics=True),
    "-narrow": RenderOptions(width=60),
    "-verbose": RenderOptions(verbose=True),
    "-quiet": RenderOptions(quiet=True),
    "-quiet-statistics": RenderOptions(quiet=True, statistics=True),
}
CASES = [
    (name, sample, variant)
    for name in format_names()
    for sample in SAMPLES
    for variant in (VARIANTS if name == "text" and sample == "mixed" else ("",))
]


@pytest.mark.parametrize(("name", "sample", "variant"), CASES)
def test_output_is_as_recorded(name: str, sample: str, variant: str) -> None:
    output = render(SAMPLES[sample], name, options=VARIANTS[variant])
    if name == "sarif":
        output = _without_catalogue(output)
    recorded = GOLDEN / f"{sample}{variant}.{name}.txt"
    if os.environ.get("GPSFSM_UPDATE_GOLDEN") == "1":
        recorded.write_bytes(output.encode())
    assert output.encode() == recorded.read_bytes()


def test_no_recorded_file_is_left_over() -> None:
    expected = {f"{sample}{variant}.{name}.txt" for name, sample, variant in CASES}
    assert {path.name for path in GOLDEN.iterdir()} == expected


def _without_catalogue(output: str) -> str:
    """The texts of the rules change for other reasons than the format."""
    log = json.loads(output)
    for run in log["runs"]:
        assert run["tool"]["driver"].pop("rules")
        for result in run["results"]:
            result.pop("ruleIndex", None)
    return json.dumps(log, indent=1) + "\n"
