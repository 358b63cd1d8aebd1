"""What pyproject.toml cannot say: on an index, README.md is a page without a repository.

Links and pictures there are relative, for GitHub and clones. In the metadata of packages they lead
to the files of this version in the repository.
"""

from __future__ import annotations

import re
from pathlib import Path
from runpy import run_path

ROOT = Path(__file__).resolve().parent
_FENCED = re.compile(r"(^```.*?^```$)", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"(!?)(\[(?:[^][]|\[[^][]*\])*\]\()(?![a-z]+:|#)([^)\s]+)")


def long_description() -> str:
    """README.md with absolute links."""
    words = run_path(str(ROOT / "gpsfsm" / "version.py"))

    def absolute(link: re.Match[str]) -> str:
        kind = "raw" if link[1] else "blob"
        return f"{link[1]}{link[2]}{words['REPOSITORY']}/{kind}/v{words['VERSION']}/{link[3]}"

    parts = _FENCED.split((ROOT / "README.md").read_text(encoding="utf-8"))
    parts[::2] = [_LINK.sub(absolute, text) for text in parts[::2]]
    return "".join(parts)


if __name__ == "__main__":
    from setuptools import setup

    setup(long_description=long_description(), long_description_content_type="text/markdown")
