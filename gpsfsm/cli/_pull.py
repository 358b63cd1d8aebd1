"""``gpsfsm capabilities pull``: capability files and a robot profile of what a robot offers."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.errors import ConfigError, UsageError
from gpsfsm.model.ros import CAPABILITIES2, RosSettings
from gpsfsm.streams import complain, write_text

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.ros.pull import Pulled

_PROFILE = "robot.yaml"


def pull_into(output: str, name: str, arguments: Sequence[str], *, force: bool) -> int:
    """Write what the robot offers into a folder; the exit code. Raises GpsfsmError."""
    from gpsfsm.ros.node import choose, process_node, waited
    from gpsfsm.ros.pull import pull

    folder = Path(output)
    if not output:
        raise UsageError("--output needs the name of a folder, not an empty one")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{output} is no folder; name a new one with --output")
    if folder.is_dir() and any(folder.iterdir()) and not force:
        raise UsageError(f"{output} is not empty; name a new folder, or overwrite with --force")
    choose(RosSettings(arguments=tuple(arguments)))
    node = process_node()
    pulled = waited(pull(node))
    settings = RosSettings(
        domain=int(node.context.get_domain_id()),
        namespace=node.handle.get_namespace().strip("/"),
        via=CAPABILITIES2,
    )
    return _write(folder, name or folder.resolve().name or "robot", pulled, settings)


def _write(folder: Path, name: str, pulled: Pulled, settings: RosSettings) -> int:
    from gpsfsm.capabilities.robot import write_profile

    folder.mkdir(parents=True, exist_ok=True)
    for path, text in pulled.files.items():
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        _replace(file, text)
    failed = bool(pulled.problems)
    for problem in pulled.problems:
        complain(problem)
    failed |= bool(pulled.files) and not _fits(folder)
    if not pulled.runners:
        complain("the capability server offers nothing that can be used: there is no profile")
        return 1
    packages = sorted({path.partition("/")[0] for path in pulled.files})
    profile = folder / _PROFILE
    try:
        write_profile(profile, name, packages, pulled.runners, ros=settings)
    except ConfigError as error:
        complain(f"{profile} is not written, since it would not fit:\n{error}")
        return 1
    count, known = len(pulled.runners), len(pulled.known)
    write_text(
        f"{profile}: {count} runners by a server of V{pulled.version}, {known} of them as gpsfsm "
        f"describes them; {len(pulled.files)} files written\n"
    )
    return 1 if failed else 0


def _replace(file: Path, text: str) -> None:
    """Write a file beside its place first; a link there is replaced, not followed."""
    draft = file.with_name(f".{file.name}.draft")
    draft.unlink(missing_ok=True)
    try:
        draft.write_text(text, encoding="utf-8")
        draft.replace(file)
    finally:
        draft.unlink(missing_ok=True)


def _fits(folder: Path) -> bool:
    """Whether the files have no errors; those that they have are told."""
    from gpsfsm.capabilities.load import load_directories
    from gpsfsm.capabilities.table import builtin

    loaded = load_directories([str(folder)], base=builtin())
    errors = [each for each in loaded.defects if each.severity == "error"]
    for each in errors:
        complain(str(each))
    return not errors
