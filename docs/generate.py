"""Write docs/rules from the catalogue of rules.

python docs/generate.py            writes the pages
python docs/generate.py --check    exits 1 if a page differs from the catalogue
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from gpsfsm.analysis.rules import all_rules
from gpsfsm.report._rule_docs import rule_markdown, rules_index_markdown

_RULES = Path(__file__).parent / "rules"


def pages() -> dict[str, str]:
    """The text of every page by its file name."""
    found = {f"{rule.code}.md": rule_markdown(rule) for rule in all_rules()}
    return {**found, "index.md": rules_index_markdown(all_rules())}


def differing(folder: Path) -> list[str]:
    """The names of pages that are missing, that differ, or that no rule has any more."""
    wanted = pages()
    there = {file.name: file.read_text(encoding="utf-8") for file in folder.glob("*.md")}
    return sorted(name for name in {*wanted, *there} if wanted.get(name) != there.get(name))


def write(folder: Path) -> None:
    """Write all pages and delete those of rules that are gone."""
    folder.mkdir(parents=True, exist_ok=True)
    wanted = pages()
    for name in differing(folder):
        if name in wanted:
            (folder / name).write_text(wanted[name], encoding="utf-8")
        else:
            (folder / name).unlink()


def main() -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description="Write docs/rules from the catalogue of rules.")
    parser.add_argument("--check", action="store_true", help="only compare; exit 1 if they differ")
    if not parser.parse_args().check:
        write(_RULES)
        return 0
    found = differing(_RULES)
    for name in found:
        print(f"docs/rules/{name} differs from the catalogue: run python docs/generate.py")
    return int(bool(found))


if __name__ == "__main__":
    sys.exit(main())
