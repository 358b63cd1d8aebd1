"""Plans that language models really wrote: each is ported, or it is said what is lost."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.porting import UnclearError, port

if TYPE_CHECKING:
    from pathlib import Path


def test_every_plan_is_ported_or_told(shared_corpus: Path) -> None:
    folders = (shared_corpus / "experiment2", shared_corpus / "plans")
    files = sorted(file for folder in folders for file in folder.rglob("*.xml"))
    assert len(files) > 20
    actual = {"right": 0, "ported": 0, "lost": 0, "unclear": 0}
    for file in files:
        data = file.read_bytes()
        try:
            safe = port(data, "fabric-v2", file=file.name)
        except UnclearError:
            actual["unclear"] += 1
            continue
        if safe.text is None:
            actual["lost"] += 1
            unsafe = port(data, "fabric-v2", file=file.name, unsafe=True)
            offered = all(loss.instead for loss in safe.losses)
            assert (unsafe.text is not None) == offered
        else:
            actual["ported" if safe.changed else "right"] += 1
    assert actual["right"] > 10
    assert actual["unclear"] < len(files) / 4
