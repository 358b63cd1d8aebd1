"""Capability files and a profile of a robot, out of what its capability server says.

V3 lists what can be run, with what it takes and gives. Older ones copy their files out of a
database that has lost just that, so of a runner that gpsfsm describes itself their copy is of no
use, and only its name is taken. Texts come from the robot and are not trusted: they are read within
the bounds of any capability file, and a name that is none, or leads elsewhere, is left out.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from gpsfsm.capabilities.defects import Notes
from gpsfsm.capabilities.files import MAX_BYTES, has_place
from gpsfsm.capabilities.library import builtin_capabilities
from gpsfsm.capabilities.load import load_directories
from gpsfsm.capabilities.reading import Items, Scalar, Table, read_table
from gpsfsm.capabilities.robot import write_profile
from gpsfsm.errors import ConfigError, UsageError
from gpsfsm.execution.registry import ours
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import CAPABILITIES2, RosSettings
from gpsfsm.ros.capabilities2 import Server
from gpsfsm.ros.node import RosError, choose, process_node, refuse_malformed, waited
from gpsfsm.streams import write_bytes

if TYPE_CHECKING:
    from collections.abc import Iterable, Mapping, Sequence

    from gpsfsm.ros.node import RosNode

_NAME = re.compile(r"[A-Za-z_]\w*/[A-Za-z_]\w*", re.ASCII)
_MOST = 2_000
_MOST_BYTES = 16 * MAX_BYTES
_INTERFACE, _PROVIDER, _SEMANTIC = "interface", "provider", "semantic_interface"
_FOLDERS = {_INTERFACE: "interfaces", _PROVIDER: "providers", _SEMANTIC: "semantic_interfaces"}
_KEYS = {
    _INTERFACE: ("description", "interface", "relations"),
    _PROVIDER: (
        *("description", "implements", "runner", "depends_on", "remappings"),
        *("relations", "definition"),
    ),
    _SEMANTIC: ("description", "redefines", "global_namespace", "remappings", "relations"),
}
"""What the files of the stack consist of; what else a robot may send is not for it to say."""


@dataclass
class Pulled:
    """The files of a robot by their paths, its runners, and what was left out and why.

    ``built_in`` are the runners of which gpsfsm has a description of its own.
    """

    version: int
    files: dict[str, str] = field(default_factory=dict)
    runners: list[str] = field(default_factory=list)
    built_in: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)


@dataclass
class _Said:
    """The capabilities by the words of a server: kind and name, and the keys of the file."""

    entries: dict[tuple[str, str], dict[str, Any]] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)

    def add(self, kind: str, name: str, keys: Mapping[str, Any]) -> bool:
        if not (_NAME.fullmatch(name) and has_place(name)):
            self.leave_out(name, "it is not package/Name with letters, digits and underscores")
            return False
        self.entries[kind, name] = {key: keys[key] for key in _KEYS[kind] if key in keys}
        return True

    def leave_out(self, name: str, why: str) -> None:
        if len(self.problems) < _MOST:
            self.problems.append(f"{clip(name, 200)!r} is left out: {why}")

    def read(self, name: str, content: str) -> dict[str, Any] | None:
        """A text as data; None, and a problem, if it is no mapping or breaks the bounds."""
        notes = Notes(clip(name, 200))
        table = read_table(content.encode("utf-8", "replace"), notes)
        if table is None:
            first = notes.defects[0] if notes.defects else None
            place = "" if first is None else f"line {first.line}, column {first.column}: "
            self.leave_out(name, place + ("" if first is None else first.message))
            return None
        return {key: _plain(value) for key, value in table.items()}


def _plain(node: Table | Items | Scalar) -> Any:
    if isinstance(node, Table):
        return {key: _plain(value) for key, value in node.items()}
    if isinstance(node, Items):
        return [_plain(each) for each in node]
    return node.value


async def pull(node: RosNode) -> Pulled:
    """All that the server of a robot offers. Raises RosError without a server."""
    server = await Server.find(node)
    if server.runnable:
        said = await _runnable(server)
    elif server.version > 1:
        said = await _specs(server)
    else:
        said = await _names(server)
    return _written(server.version, said)


async def _runnable(server: Server) -> _Said:
    response = await server.request(server.runnable, "GetRunnableSpecs", {})
    pairs = list(zip(response.index_of_specs, response.runnable_specs, strict=False))
    _bounded(spec.spec for _, spec in pairs)
    said = _Said()
    for index, spec in pairs:
        data = said.read(index, spec.spec)
        if data is None:
            continue
        inner, outer = data.get("interface"), data.get("provider")
        if not isinstance(inner, dict) or not isinstance(outer, dict):
            said.leave_out(index, "it has no interface and provider")
            continue
        interface, provider = str(inner.get("name", "")), str(outer.get("name", ""))
        keys = {**outer, "implements": interface, "relations": data.get("relations") or []}
        definition = _definition(data.get("definition"))
        if definition is not None:
            keys["definition"] = definition
        if said.add(_INTERFACE, interface, inner) and said.add(_PROVIDER, provider, keys):
            said.names.append(interface)
    return said


def _definition(data: Any) -> Any:
    """V3 writes it once more inside of itself."""
    if isinstance(data, dict) and isinstance(data.get("definition"), dict):
        data = data["definition"]
    if not isinstance(data, dict):
        return None
    parts = {
        "configuration_parameters": data.get("configuration_parameters") or [],
        "runtime_parameters": data.get("runtime_parameters") or {},
    }
    runtime = parts["runtime_parameters"]
    if isinstance(runtime, dict):
        runtime = {key: runtime.get(key) or [] for key in ("input", "output")}
    return {"command": data.get("command") or "", **parts, "runtime_parameters": runtime}


async def _specs(server: Server) -> _Said:
    said = _Said(names=await server.interfaces())
    response = await server.request("get_capability_specs", "GetCapabilitySpecs", {})
    _bounded(each.content for each in response.capability_specs)
    kinds = {
        "capability_interface": _INTERFACE,
        "capability_provider": _PROVIDER,
        "semantic_capability_interface": _SEMANTIC,
    }
    for spec in response.capability_specs:
        where = f"{spec.package}: {spec.type}"
        data = said.read(where, spec.content)
        if data is None:
            continue
        kind = kinds.get(spec.type, spec.type)
        if kind not in _FOLDERS:
            said.leave_out(where, f"{clip(spec.type, 100)!r} is not a kind of capability")
            continue
        name = str(data.get("name", ""))
        said.add(kind, name if "/" in name else f"{spec.package}/{name}", data)
    return said


async def _names(server: Server) -> _Said:
    """V1 tells no more than names."""
    said = _Said(names=await server.interfaces())
    for interface in said.names:
        for provider in await server.providers(interface):
            if said.add(_INTERFACE, interface, {}):
                said.add(_PROVIDER, provider, {"implements": interface})
    return said


def _bounded(texts: Iterable[str]) -> None:
    sizes = list(map(len, texts))
    if len(sizes) > _MOST or sum(sizes) > _MOST_BYTES:
        raise RosError(
            f"the capability server describes more than {_MOST} capabilities or "
            f"{_MOST_BYTES >> 20} MB: nothing of it is taken"
        )


# --- files ----------------------------------------------------------------------------------------


def _written(version: int, said: _Said) -> Pulled:
    """The files, without those of which gpsfsm has a better description."""
    library = builtin_capabilities().library
    pulled = Pulled(version, problems=said.problems)
    built_in = set()
    for kind, name in said.entries:
        here = library.translation(name) or name
        defined = (kind, name) if kind == _PROVIDER else (_PROVIDER, name)
        defines = "definition" in said.entries.get(defined, {})
        if here in library.interface_names and (ours(here) is not None or not defines):
            built_in.add(name)
    for (kind, name), keys in said.entries.items():
        if name in built_in:
            continue
        package, _, short = name.partition("/")
        spec_version = "1.2" if "definition" in keys else "1.1"
        header = {"name": name, "spec_type": kind, "spec_version": spec_version}
        content = {**header, **{key: value for key, value in keys.items() if value}}
        text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=100)
        pulled.files[f"{package}/{_FOLDERS[kind]}/{short}.yaml"] = text
    described = {name for kind, name in said.entries if kind == _INTERFACE} | built_in
    semantic = [name for kind, name in said.entries if kind == _SEMANTIC]
    for name in dict.fromkeys([*said.names, *semantic]):
        if name in built_in:
            pulled.built_in.append(name)
        if name in described or name in semantic:
            pulled.runners.append(name)
        elif library.translation(name) or name in library.interface_names:
            pulled.built_in.append(name)
            pulled.runners.append(name)
    pulled.runners = _once(pulled.runners)
    return pulled


def _once(names: Iterable[str]) -> list[str]:
    """Names that mean one runner, in two dialects, are one."""
    library = builtin_capabilities().library
    kept: dict[str, str] = {}
    for name in names:
        kept.setdefault(library.translation(name) or name, name)
    return list(kept.values())


def pull_into(
    output: str, name: str, arguments: Sequence[str], *, force: bool
) -> tuple[str, list[str]]:
    """Write what a robot offers into a folder: what was written, and what is wrong with it.

    Raises UsageError for a folder that is not to be overwritten, and RosError without a server.
    """
    folder = Path(output)
    if not output:
        raise UsageError("--output needs the name of a folder, not an empty one")
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"{output} is not a folder; name a new one with --output")
    if folder.is_dir() and any(folder.iterdir()) and not force:
        raise UsageError(f"{output} is not empty; name a new folder, or overwrite with --force")
    refuse_malformed(arguments)
    choose(RosSettings(arguments=tuple(arguments)))
    node = process_node()
    pulled = waited(pull(node))
    settings = RosSettings(
        domain=int(node.context.get_domain_id()),
        namespace=node.handle.get_namespace().strip("/"),
        via=CAPABILITIES2,
    )
    return _write(folder, name or folder.resolve().name or "robot", pulled, settings)


def _write(folder: Path, name: str, pulled: Pulled, settings: RosSettings) -> tuple[str, list[str]]:
    folder.mkdir(parents=True, exist_ok=True)
    for path, text in pulled.files.items():
        write_bytes(text.encode(), str(folder / path), parents=True, within=str(folder))
    problems = list(pulled.problems)
    if pulled.files:
        problems += _defects(folder)
    if not pulled.runners:
        problems.append("the capability server offers nothing usable: no profile is written")
        return "", problems
    packages = sorted({path.partition("/")[0] for path in pulled.files})
    profile = folder / "robot.yaml"
    try:
        write_profile(profile, name, packages, pulled.runners, ros=settings)
    except ConfigError as error:
        return "", [*problems, f"{profile} is not written, because it would be invalid:\n{error}"]
    written = (
        f"{profile}: {len(pulled.runners)} runners by a server of V{pulled.version}, "
        f"{len(pulled.built_in)} of them as gpsfsm describes them; "
        f"{len(pulled.files)} capability files"
    )
    return written, problems


def _defects(folder: Path) -> list[str]:
    """The errors of the files, as a check shows them."""
    loaded = load_directories([str(folder)], base=builtin_capabilities().library)
    return [str(each) for each in loaded.defects if each.severity == "error"]
