"""The legend of a picture says of every mark what it means, and of nothing that is not there."""

from __future__ import annotations

import shutil
from typing import Any

import pytest

from gpsfsm.checking import CheckOptions
from gpsfsm.viewing.picture import automaton_data
from gpsfsm.viewing.plans import see
from tests.conftest import REPO
from tests.viewing.support import in_node

pytestmark = pytest.mark.skipif(shutil.which("node") is None, reason="there is no node")

FILES = [
    *sorted((REPO / "corpus" / "plans").glob("*.xml")),
    *sorted((REPO / "corpus" / "trees").glob("*.xml")),
]
STATES = ["triggered", "running", "succeeded", "failed", "timeout", "stopped", "never"]
_RUNNER = '<Runner interface="a/A" provider="a/A"/>'
_SMALL = f"<Plan>{_RUNNER}</Plan>"
_ALL = f'<Plan><Control type="parallel_all">{_RUNNER * 2}</Control></Plan>'


def legends(*cases: tuple[str, bool]) -> list[dict[str, Any]]:
    """What a pen draws of pictures, unfolded or folded, and of their legends."""
    pictures = []
    for text, folded in cases:
        seen = see(text, "plan.xml", CheckOptions())
        if seen.compiled is None:
            continue
        data = automaton_data(seen.compiled.automaton)
        collapsed = list(range(len(data["groups"]))) if folded else []
        severities = ["error", "warning", "info"] if len(data["nodes"]) > 5 else []
        pictures.append(
            {"automaton": data, "collapsed": collapsed, "findings": severities, "states": STATES}
        )
    made: list[dict[str, Any]] = in_node("legend.mjs", pictures)
    return made


def test_every_mark_of_a_picture_is_in_its_legend() -> None:
    texts = [file.read_text(encoding="utf-8") for file in FILES]
    drawn = legends(*[(text, folded) for text in texts for folded in (False, True)])
    assert len(drawn) > 20
    for each in drawn:
        assert set(each["still"]) <= set(each["legend"])
        assert set(each["run"]) <= set(each["all"])


def test_what_a_picture_does_not_have_is_not_in_its_legend() -> None:
    small, parallel, folded = legends((_SMALL, False), (_ALL, False), (_ALL, True))
    assert "any" not in small["keys"] or "group" not in small["keys"]
    assert not {"all", "folded", "group", "error"} & set(small["keys"])
    assert {"all", "any", "group", "complete", "give_up"} <= set(parallel["keys"])
    assert "folded" in folded["keys"]
    assert "all" not in folded["keys"]
    for each in (small, parallel, folded):
        assert set(each["legend"]) <= set(each["still"])
