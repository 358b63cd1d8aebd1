"""What gpsfsm says about the plans of the corpus, word for word, in files to be read by people.

``python -m tests.corpus.messages`` writes them anew; read the difference before you commit it.
"""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

    from tests.corpus.test_corpus import Sidecar

__all__ = ["expected", "words"]

FOLDER = Path(__file__).parent / "messages"


def words(entry: Mapping[str, Any]) -> str:
    """All findings of a plan of a JSON report, as people read them."""
    return "\n".join(line for finding in entry["findings"] for line in _lines(finding))


def expected(sidecar: Sidecar) -> str:
    """What the file says for a plan."""
    return _sections(_file(sidecar))[_title(sidecar)]


def _lines(finding: Mapping[str, Any]) -> list[str]:
    where = "{line}:{column}".format(**finding["location"])
    lines = [f"{where} {finding['severity']} {finding['rule']}: {finding['message']}"]
    lines += ["    {line}:{column} {message}".format(**each) for each in finding["related"]]
    lines += [f"    {step}" for step in (finding["scenario"] or {}).get("story", ())]
    return [*lines, f"    hint: {finding['hint']}"]


def _title(sidecar: Sidecar) -> str:
    return f"{sidecar.plan.name} {sidecar.variant}".rstrip()


def _file(sidecar: Sidecar) -> Path:
    corpus = FOLDER.parents[2] / "corpus"
    place = sidecar.plan.parent.relative_to(corpus)
    return FOLDER / f"{'-'.join(place.parts)}.txt"


@cache
def _sections(file: Path) -> dict[str, str]:
    sections: dict[str, str] = {}
    for section in file.read_text(encoding="utf-8").split("== ")[1:]:
        title, _, text = section.partition("\n")
        sections[title] = text.rstrip("\n")
    return sections


def main() -> None:
    """Write all files."""
    from tests.corpus.test_corpus import SIDECARS, check

    texts: dict[Path, list[str]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for sidecar in SIDECARS:
            report = Path(folder) / "report.json"
            (entry,) = check([sidecar.plan], sidecar.options, report)[1]["plans"]
            section = f"== {_title(sidecar)}\n{words(entry)}".rstrip("\n")
            texts.setdefault(_file(sidecar), []).append(section)
    FOLDER.mkdir(exist_ok=True)
    for old in FOLDER.glob("*.txt"):
        old.unlink()
    for file, sections in texts.items():
        file.write_text("\n\n".join(sections) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
