"""Foreign keys in the files beside a plan, inserted at a random place of a valid one.

Capability files, robot profiles, worlds and tasks are YAML. A key that nothing reads is named, or
the file is refused; a key that changes what the file says is read.
"""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.capabilities.load import load_directories
from gpsfsm.capabilities.robot import load_profile
from gpsfsm.errors import GpsfsmError
from gpsfsm.simulation.load import read_world
from gpsfsm.tasks.load import read_task

if TYPE_CHECKING:
    from collections.abc import Iterator
    from random import Random

ROOT = Path(__file__).parents[2]
_KINDS = {
    "capability": ("runners/*/*/providers/*.yaml", "runners/*/*/interfaces/*.yaml"),
    "robot": ("docs/examples/**/robot.yaml",),
    "world": ("corpus/worlds/**/*.yaml", "docs/examples/nav2/depot.yaml"),
    "task": ("docs/examples/dinner.yaml", "docs/examples/rounds.yaml"),
}
_NAMES = (
    *(
        "foo",
        "resource",
        "Resources",
        "minimun",
        "minimum",
        "maximum",
        "type",
        "idempotent",
        "runner",
    ),
    *("timeout", "defaults", "outcome", "outcomes", "allows", "programs", "bound", "bounds", "x"),
    *(
        "spec_types",
        "unit",
        "units",
        "Name",
        "id",
        "duration",
        "energy",
        "enum",
        "optional",
        "label",
    ),
    *("require", "never", "tolerated", "engines", "radius", "speed", "places", "zones", "answers"),
)
_VALUES: tuple[Any, ...] = (1, "x", True, None, [], ["x"], {"a": 1}, 1.5, {})


@cache
def files() -> tuple[tuple[str, Path, str], ...]:
    """Kinds, places and texts of files in which nothing is wrong."""
    found = [
        (kind, Path(*path.parts[-3:]), path.read_text())
        for kind, patterns in _KINDS.items()
        for pattern in patterns
        for path in sorted(ROOT.glob(pattern))
    ]
    clean = tuple(each for each in found if _read(*each)[0] == ())
    assert {kind for kind, _, _ in clean} == {*_KINDS}
    return clean


@lru_cache(256)
def _read(kind: str, path: Path, text: str) -> tuple[tuple[str, ...], Any]:
    """What is said of a file, and what it says itself."""
    try:
        if kind == "task":
            return (), read_task(text.encode())
        if kind == "world":
            return (), read_world(text.encode(), library=builtin_capabilities().library)
        with tempfile.TemporaryDirectory() as folder:
            place = Path(folder) / path
            place.parent.mkdir(parents=True)
            place.write_text(text)
            if kind == "robot":
                return (), replace(load_profile(place), places={})
            loaded = load_directories([folder], base=builtin_capabilities().library)
            return tuple(sorted(each.message for each in loaded.defects)), loaded.library
    except GpsfsmError as error:
        return (str(error),), None


def _tables(node: Any) -> Iterator[dict[str, Any]]:
    if isinstance(node, dict):
        yield node
    for each in node.values() if isinstance(node, dict) else node if isinstance(node, list) else ():
        yield from _tables(each)


def inserted(chance: Random) -> tuple[tuple[str, Path], str, str]:
    """What a file is, its text, and the same with a key that it did not have."""
    kind = chance.choice([*_KINDS])
    _, path, text = chance.choice([each for each in files() if each[0] == kind])
    whole = yaml.safe_load(text)
    table = chance.choice([*_tables(whole)])
    table[chance.choice([each for each in _NAMES if each not in table])] = chance.choice(_VALUES)
    return (kind, path), text, yaml.safe_dump(whole, sort_keys=False, width=10**6)


def judged(of: tuple[str, Path], before: str, after: str) -> str:
    """What became of the key: ``refused``, ``told``, ``read`` or ``silent``."""
    plain = yaml.safe_dump(yaml.safe_load(before), sort_keys=False, width=10**6)
    (said, read), (words, content) = _read(*of, plain), _read(*of, after)
    if words != said:
        return "refused" if content is None else "told"
    return "read" if content != read else "silent"
