"""``--baseline``: known findings do not fail."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from gpsfsm.cli import main
from tests.cli.support import ACCEPTED, REJECTED, run, write

if TYPE_CHECKING:
    from pathlib import Path


def make(path: str, file: str = "known.json") -> None:
    main(["check", path, "--format", "json", "--output-file", file])


def test_known_findings_do_not_fail(tmp_path: Path) -> None:
    write(tmp_path / "plans", a=REJECTED, b=ACCEPTED)
    make("plans")
    write(tmp_path / "plans", a="<!-- moved\n\n -->\n" + REJECTED)
    done = run("check", "plans", "--baseline", "known.json", "--fail-on", "warning", cwd=tmp_path)
    assert done.returncode == 0
    assert b"GP307" not in done.stdout
    done = run("check", "./plans/a.xml", "--baseline", "known.json", cwd=tmp_path)
    assert done.returncode == 0


def test_new_findings_fail(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=ACCEPTED)
    make("a.xml")
    write(tmp_path, a=REJECTED)
    assert main(["check", "a.xml", "--baseline", "known.json", "--quiet"]) == 1
    assert "GP307" in capsys.readouterr().out


def test_the_verdict_stays(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write(tmp_path, a=REJECTED)
    make("a.xml")
    assert main(["check", "a.xml", "--baseline", "known.json", "--format", "json"]) == 0
    (plan,) = json.loads(capsys.readouterr().out)["plans"]
    assert plan["verdict"] == "rejected"
    assert plan["findings"] == []
    assert plan["suppressed"] > 0


def test_what_was_not_decided_stays_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    make("missing.xml")
    assert main(["check", "missing.xml", "--baseline", "known.json", "--quiet"]) == 2
    assert "GP901" in capsys.readouterr().out


def test_a_baseline_can_be_renewed_in_place(tmp_path: Path) -> None:
    write(tmp_path, a=REJECTED)
    make("a.xml")
    before = (tmp_path / "known.json").read_bytes()
    make("a.xml")
    assert (tmp_path / "known.json").read_bytes() == before


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "cannot be read: No such file"),
        ("", "it is not JSON"),
        ("{}", "a field 'version' is missing"),
        ('{"version": 4, "plans": []}', "its version is 4"),
    ],
)
def test_a_baseline_that_is_none(content: str | None, words: str, tmp_path: Path) -> None:
    write(tmp_path, a=ACCEPTED)
    if content is not None:
        (tmp_path / "known.json").write_text(content, encoding="utf-8")
    done = run("check", "a.xml", "--baseline", "known.json", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, b"")
    assert done.stderr.startswith(b"gpsfsm: baseline known.json ")
    assert words.encode() in done.stderr
