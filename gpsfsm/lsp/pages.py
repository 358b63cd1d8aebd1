"""The page of each rule as a file, for the link that an editor shows beside a finding.

The pages are those of docs/rules; they are written when they are asked for, into a folder that is
gone when the server ends.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

__all__ = ["Pages"]


class Pages:
    """The pages that were asked for, by the code of the rule."""

    def __init__(self) -> None:
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._known: dict[str, str | None] = {}

    def address(self, code: str) -> str | None:
        """The address of the page; None if it cannot be written."""
        if code not in self._known:
            try:
                self._known[code] = self._write(code)
            except OSError:
                self._known[code] = None
        return self._known[code]

    def close(self) -> None:
        """Remove them."""
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None
        self._known.clear()

    def _write(self, code: str) -> str:
        from gpsfsm.analysis.rules import rule  # noqa: PLC0415  (once there is a finding)
        from gpsfsm.report._rule_docs import rule_markdown  # noqa: PLC0415

        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="gpsfsm-rules-")
        file = Path(self._folder.name, f"{code}.md")
        file.write_text(rule_markdown(rule(code)), encoding="utf-8")
        return file.as_uri()
