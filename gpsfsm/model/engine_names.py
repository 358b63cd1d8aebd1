"""The names of the engines, apart from what they make of plans: every check takes the names."""

from __future__ import annotations

PAPER_ENGINE = "paper"
"""The semantics of the paper, which is no engine."""

FABRIC_V1 = "fabric-v1"
"""The Fabric server of the first published experiment (2025)."""

FABRIC_V2 = "fabric-v2"
"""The Fabric server of the second published experiment (March 2026)."""

ENGINES = (PAPER_ENGINE, FABRIC_V1, FABRIC_V2)
"""The names of all profiles."""
