"""Robot profiles (docs/robot.md): their shape, and the library of a robot.

A profile takes from a library what the robot lacks, gives the rest the names and the bounds of the
robot, and says what may run programs or call URLs. So all who look up runners in that library,
checks, runs and prompts alike, see the robot and nothing else:

    library  perception_capabilities/SpeechRunner, nav2_capabilities/WaypointRunner (x, y), …
    profile  runners: [fp_perception_capabilities/SpeechRunner, nav2_capabilities/WaypointRunner]
             bounds: {x: [-10, 10]}
    robot    fp_perception_capabilities/SpeechRunner, nav2_capabilities/WaypointRunner (x: -10…10)

Each section of a file has a function that reads it; a new section is a field and such a function.
"""

from __future__ import annotations

import json
import math
import os
import re
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field

from gpsfsm.capabilities.defects import Notes, Place, errors_text, quoted
from gpsfsm.capabilities.dialects import engine_names, selected, with_keys
from gpsfsm.capabilities.files import read_bytes
from gpsfsm.capabilities.library import Capabilities, Library, Match, choose_capabilities
from gpsfsm.capabilities.reading import (
    FileModel,
    Flag,
    Items,
    ListOf,
    MappingOf,
    Number,
    Scalar,
    Table,
    Text,
    Texts,
    number,
    read_table,
    validate,
    wrong,
)
from gpsfsm.errors import ConfigError, UsageError
from gpsfsm.model.capability import Filling, Leaf, Permission, Provider, Robot, ValueType
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import DEADLINE_S, DISCOVERY, DOUBT_S, VIA, RosSettings
from gpsfsm.model.story import ENGINES
from gpsfsm.streams import write_bytes

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence


_MOST_TOLERATED = 1_000
_MOST_CORNERS = 1_000
_MOST_NAME = 200
_MOST_PARTS = 1_000
_NUMBERS = (ValueType.INT, ValueType.DOUBLE)
_AXES = ("x", "y")
_LONGEST = 1e6  # seconds
_MOST_DOMAIN = 232  # 0 to 101 are safe on every system
_ROS_NAME = re.compile(r"[~/]?[A-Za-z_]\w*(?:/[A-Za-z_]\w*)*", re.ASCII)

Range = tuple[float, float]


def _pair(node: object) -> object:
    if isinstance(node, Items) and len(node) == 2:
        return [number(each) for each in node]
    raise wrong("two numbers in brackets, such as [-10, 10]", node)


Pair = Annotated[list[float], BeforeValidator(_pair)]


class AreaFile(FileModel):
    """``map``: a rectangle, or the corners of a polygon."""

    x: Pair | None = None
    y: Pair | None = None
    corners: ListOf[Pair] = Field(default_factory=list)


class AllowFile(FileModel):
    """``allow``: the programs, hosts and functions that plans may reach."""

    programs: Texts = Field(default_factory=list)
    hosts: Texts = Field(default_factory=list)
    functions: Texts = Field(default_factory=list)


class NetworkFile(FileModel):
    """``ros``: where on the network the robot is."""

    domain: Number | None = None
    namespace: Text = ""
    discovery: Text = ""
    remap: MappingOf[Text] = Field(default_factory=dict)
    via: Text = ""
    deadline: Number | None = None
    doubt: Number | None = None


def _alone(node: object) -> object:
    """A value alone stands for its text."""
    if not isinstance(node, Scalar) or node.value is None:
        return node
    table = Table(node.place)
    table["text"] = node
    table.places["text"] = node.place
    return table


def _parts(node: object) -> tuple[tuple[int, int], ...]:
    rows = [*node.items()] if isinstance(node, Table) else [("0", node)]
    try:
        parts = [(int(count), number(each)) for count, each in rows]
    except ValueError:
        parts = []
    if not parts or not all(each in range(1, (count or _MOST_PARTS) + 1) for count, each in parts):
        raise wrong("the number of a part, from 1 on, or 'how many parts: which of them'", node)
    return tuple((count, int(each)) for count, each in parts)


class FillingFile(FileModel):
    """A parameter of a leaf: where its value comes from."""

    port: Text = ""
    text: Text | None = None
    part: Annotated[tuple[tuple[int, int], ...], BeforeValidator(_parts)] = ()
    factor: Number = 1.0
    unsigned: Flag = False


class LeafFile(FileModel):
    """``leaves``: the runner that a leaf of behaviour trees stands for in a simulation."""

    runner: Text
    parameters: MappingOf[Annotated[FillingFile, BeforeValidator(_alone)]] = Field(
        default_factory=dict
    )
    words: MappingOf[Text] = Field(default_factory=dict)


class RobotFile(FileModel):
    """A robot profile."""

    name: Text
    capabilities: Texts = Field(default_factory=list)
    builtin_capabilities: Flag = Field(default=True, alias="builtin-capabilities")
    runners: Texts | None = None
    bounds: MappingOf[Any] = Field(default_factory=dict)
    area: AreaFile | None = Field(default=None, alias="map")
    resources: MappingOf[Texts] = Field(default_factory=dict)
    allow: AllowFile | None = None
    ros: NetworkFile | None = None
    leaves: MappingOf[LeafFile] = Field(default_factory=dict)
    blackboard: MappingOf[Text] = Field(default_factory=dict)
    engine: Text | None = None
    tolerate: Number | None = None
    deadline: Number | None = None


@dataclass(frozen=True)
class Profile:
    """A robot as its file describes it; names of runners are as the file writes them.

    ``places`` has the line and column of each: section and name.
    """

    robot: Robot
    folders: tuple[str, ...] = ()
    builtin: bool = True
    runners: tuple[str, ...] | None = None
    bounds: Mapping[tuple[str, str], Range] = field(default_factory=dict)  # runner or "", parameter
    resources: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    allow: tuple[tuple[Permission, str], ...] = ()
    leaves: tuple[Leaf, ...] = ()
    blackboard: tuple[tuple[str, str], ...] = ()
    places: Mapping[tuple[str, str], Place] = field(default_factory=dict)

    @property
    def settings(self) -> dict[str, Any]:
        """The options of a check that the profile sets, by their keywords in Python."""
        values = {
            "engine": self.robot.engine or None,
            "tolerate": self.robot.tolerate,
            "deadline_s": self.robot.deadline_s,
        }
        return {name: value for name, value in values.items() if value is not None}


# --- reading --------------------------------------------------------------------------------------


def load_profile(file: str | Path) -> Profile:
    """The profile in a file. Raises ConfigError with all that is wrong with it."""
    name = str(file)
    if not name:
        raise UsageError("the name of a robot profile is empty; write the path of a robot.yaml")
    notes = Notes(name, kind="robot")
    content = read_bytes(name, notes)
    table = None if content is None else read_table(content, notes)
    model = None if table is None else validate(RobotFile, table, notes)
    profile = None if model is None else _profile(model, name, notes)
    if notes.defects or profile is None:  # a misspelt key would be a permission or bound less
        raise ConfigError(errors_text(notes))
    return profile


def _profile(model: RobotFile, file: str, notes: Notes) -> Profile:
    if not model.name.strip() or len(model.name) > _MOST_NAME or not model.name.isprintable():
        notes.error(
            model.at("name"), f"{quoted(model.name)} is not a robot name", "write a short name"
        )
    if model.engine is not None and model.engine not in ENGINES:
        hint = notes.near(model.engine, ENGINES) or f"the engines are {', '.join(ENGINES)}"
        notes.error(model.at("engine"), f"there is no engine {quoted(model.engine)}", hint)
    tolerate = model.tolerate
    if tolerate is not None and not (tolerate.is_integer() and 0 <= tolerate <= _MOST_TOLERATED):
        message = f"'tolerate' must be a whole number from 0 to {_MOST_TOLERATED}"
        notes.error(model.at("tolerate"), message, "write how many failures no plan may end by")
    if model.deadline is not None and model.deadline <= 0:
        notes.error(model.at("deadline"), "'deadline' must be more than 0", "write seconds")
    bounds, places = _bounds(model, notes)
    x, y, corners = _area(model.area, notes)
    for axis, span in (("x", x), ("y", y)):
        if span is not None:
            bounds[_MAP, axis] = span
    robot = Robot(
        name=model.name.strip(),
        file=file,
        engine=model.engine or "",
        tolerate=None if tolerate is None else int(tolerate),
        deadline_s=model.deadline,
        corners=corners,
        ros=_network(model.ros, notes),
    )
    places |= {("resources", key): model.below("resources", key) for key in model.resources}
    return Profile(
        robot=robot,
        folders=_folders(model, file, notes),
        builtin=model.builtin_capabilities,
        runners=_runners(model, places, notes),
        bounds=bounds,
        resources={key: tuple(dict.fromkeys(names)) for key, names in model.resources.items()},
        allow=_allowed(model.allow, notes),
        leaves=_leaves(model, places, notes),
        blackboard=tuple(model.blackboard.items()),
        places=places,
    )


_MAP = "map"
"""In place of a runner: all that take an x and a y."""


def _folders(model: RobotFile, file: str, notes: Notes) -> tuple[str, ...]:
    """The folders of capability files: below that of the profile, as a robot's files travel."""
    base = Path(file).parent
    folders = []
    for each in model.capabilities:
        path = Path(each)
        if not each.strip() or path.is_absolute() or ".." in path.parts or "\0" in each:
            notes.error(
                model.at("capabilities"),
                f"{quoted(each)} is not a folder beside or below this file",
                "write a path that starts at the folder of this file, without '..'; name any other "
                "with --capabilities",
            )
        else:
            folders.append(str(base / path))
    return tuple(folders)


def _runners(
    model: RobotFile, places: dict[tuple[str, str], Place], notes: Notes
) -> tuple[str, ...] | None:
    if model.runners is None:
        return None
    items = model._table["runners"]
    assert isinstance(items, Items)
    if not items:
        notes.error(model.at("runners"), "'runners' is empty", "list the runners of the robot")
    for name, node in zip(model.runners, items, strict=True):
        assert isinstance(node, Scalar)
        if ("runners", name) in places:
            notes.error(node.place, f"{quoted(name)} is here twice", "remove one of them")
        places["runners", name] = node.place
    return tuple(model.runners)


def _bounds(
    model: RobotFile, notes: Notes
) -> tuple[dict[tuple[str, str], Range], dict[tuple[str, str], Place]]:
    bounds: dict[tuple[str, str], Range] = {}
    places: dict[tuple[str, str], Place] = {}
    for key, node in model.bounds.items():
        inner = node.items() if isinstance(node, Table) else [(key, node)]
        runner = key if isinstance(node, Table) else ""
        places["bounds", runner or key] = model.below("bounds", key)
        for name, value in inner:
            place = node.places[name] if isinstance(node, Table) else model.below("bounds", key)
            span = _range(value, place, name, notes)
            if span is not None:
                bounds[runner, name] = span
                places[f"bounds {runner}", name] = place
    return bounds, places


def _range(node: object, place: Place, name: str, notes: Notes) -> Range | None:
    from pydantic_core import PydanticCustomError

    try:
        pair = _pair(node)
    except PydanticCustomError as error:
        notes.error(place, f"the bounds of {quoted(name)} {error.message()}")
        return None
    assert isinstance(pair, list)
    return _ordered(pair, place, name, notes)


def _ordered(pair: list[float], place: Place, name: str, notes: Notes) -> Range | None:
    if pair[0] > pair[1]:
        message = f"the least {quoted(name)} is greater than the greatest: {pair[0]:g}, {pair[1]:g}"
        notes.error(place, message, "write the smaller number first")
        return None
    return pair[0], pair[1]


def _area(
    area: AreaFile | None, notes: Notes
) -> tuple[Range | None, Range | None, tuple[tuple[float, float], ...]]:
    """The extent of the map along x and y, and the corners of a polygon."""
    if area is None:
        return None, None, ()
    if not area.corners:
        if area.x is None or area.y is None:
            notes.error(area.place, "the map has no area", "write x and y, or corners")
            return None, None, ()
        x = _ordered(area.x, area.at("x"), "x", notes)
        return x, _ordered(area.y, area.at("y"), "y", notes), ()
    if area.x is not None or area.y is not None:
        message = "the map has both an extent and corners"
        notes.error(area.at("corners"), message, "keep x and y, or the corners")
    if not 3 <= len(area.corners) <= _MOST_CORNERS:
        message = f"a polygon has from 3 to {_MOST_CORNERS} corners, not {len(area.corners)}"
        notes.error(area.at("corners"), message, "list its corners one after the other")
    corners = tuple((x, y) for x, y in area.corners)
    xs, ys = zip(*corners, strict=True)
    return (min(xs), max(xs)), (min(ys), max(ys)), corners


def _allowed(model: AllowFile | None, notes: Notes) -> tuple[tuple[Permission, str], ...]:
    if model is None:
        return ()
    allowed: list[tuple[Permission, str]] = []
    for permission in Permission:
        key = f"{permission.value}s"
        for text in getattr(model, key):
            if not text.strip() or not text.isprintable():
                message = f"{quoted(text)} is not a {permission.value}"
                notes.error(model.at(key), message, f"write what --allow-{permission.value} takes")
            else:
                allowed.append((permission, text))
    return tuple(allowed)


def _leaves(
    model: RobotFile, places: dict[tuple[str, str], Place], notes: Notes
) -> tuple[Leaf, ...]:
    leaves = []
    for name, leaf in model.leaves.items():
        places["leaves", name] = model.below("leaves", name)
        fillings = []
        for key, each in leaf.parameters.items():
            place = places[f"leaves {name}", key] = leaf.below("parameters", key)
            if not each.port and each.text is None:
                hint = "write 'port: NAME', or the value alone"
                notes.error(place, f"nothing says where {quoted(key)} comes from", hint)
            filling = Filling(key, each.port, each.text, each.part, each.factor, each.unsigned)
            fillings.append(filling)
        leaves.append(Leaf(name, leaf.runner, tuple(fillings), tuple(leaf.words.items())))
    return tuple(leaves)


def _network(model: NetworkFile | None, notes: Notes) -> RosSettings:
    if model is None:
        return RosSettings()
    domain = model.domain
    if domain is not None and not (domain.is_integer() and 0 <= domain <= _MOST_DOMAIN):
        message = f"'domain' must be a whole number from 0 to {_MOST_DOMAIN}"
        notes.error(model.at("domain"), message, "write what ROS_DOMAIN_ID is on the robot")
        domain = None
    if model.discovery and model.discovery not in DISCOVERY:
        hint = notes.near(model.discovery, DISCOVERY) or f"the ranges are {', '.join(DISCOVERY)}"
        notes.error(model.at("discovery"), f"{quoted(model.discovery)} is not a range", hint)
    names = [(model.at("namespace"), model.namespace)] if model.namespace else []
    names += [(model.below("remap", row[0]), each) for row in model.remap.items() for each in row]
    for place, name in names:
        if not _ROS_NAME.fullmatch(name):
            hint = "write letters, digits and underscores, with a slash between parts"
            notes.error(place, f"{quoted(name)} is not a valid ROS name", hint)
    if model.via and model.via not in VIA:
        hint = notes.near(model.via, VIA) or f"there is {', '.join(VIA)}"
        notes.error(model.at("via"), f"{quoted(model.via)} is not a server for runners", hint)
    for name, default in (("deadline", DEADLINE_S), ("doubt", DOUBT_S)):
        if (value := getattr(model, name)) is not None and not 0 < value <= _LONGEST:
            hint = f"leave it out for {default:g}"
            notes.error(model.at(name), f"'{name}' must be more than 0 seconds", hint)
    return RosSettings(
        domain=None if domain is None else int(domain),
        namespace=model.namespace,
        discovery=model.discovery,
        remap=tuple(model.remap.items()),
        via=model.via,
        deadline_s=model.deadline or DEADLINE_S,
        doubt_s=model.doubt or DOUBT_S,
    )


# --- the library of a robot -----------------------------------------------------------------------


def capabilities_of_robot(profile: Profile, described: Capabilities) -> Capabilities:
    """The part of all that is described that the robot has. Raises ConfigError."""
    notes = Notes(profile.robot.file, kind="robot")
    names = _names(profile, described.library, notes)
    library = with_keys(selected(described.library, names), profile.robot.engine)
    library = replace(library, providers=tuple(_bounded(profile, library, notes)), complete=True)
    _check_names(profile, library, notes)
    _check_leaves(profile, library, notes)
    library = replace(library, leaves=profile.leaves, blackboard=profile.blackboard)
    if notes.defects:
        raise ConfigError(errors_text(notes))
    return replace(described, library=library, robot=profile.robot, allow=profile.allow)


def _names(profile: Profile, library: Library, notes: Notes) -> dict[str, str]:
    """The names of the runners on the robot, by those in the library."""
    if profile.runners is None:
        return engine_names(library, profile.robot.engine)
    names: dict[str, str] = {}
    for name in profile.runners:
        here = library.translation(name) or name
        place = profile.places["runners", name]
        if here not in library.interface_names:
            hint = notes.near(name, library.interface_names)
            message = f"no file describes the runner {quoted(name)}"
            notes.error(place, message, hint or "describe it, and list its folder in capabilities")
        elif here in names:
            message = f"{quoted(name)} is the same runner as {quoted(names[here])}"
            notes.error(place, message, "keep the name that plans for this robot write")
        else:
            names[here] = name
    for here, name in names.items():
        for wanted in _dependencies(library, here):
            if wanted not in names:
                message = f"{quoted(name)} depends on {quoted(wanted)}, which is not listed"
                notes.error(profile.places["runners", name], message, "add it to 'runners'")
    return names


def _dependencies(library: Library, name: str) -> Iterator[str]:
    for provider in library.providers_of(name):
        for interface, _ in provider.depends_on:
            yield library.translation(interface) or interface


def _bounded(profile: Profile, library: Library, notes: Notes) -> Iterator[Provider]:
    """The providers with the bounds and the resources of the robot."""
    used: set[tuple[str, str]] = {(_MAP, axis) for axis in _AXES}
    for provider in library.providers:
        moves = all(_number(provider, axis) for axis in _AXES)
        configuration = []
        for parameter in provider.configuration:
            low, high = parameter.minimum, parameter.maximum
            for runner in ("", provider.implements, *([_MAP] if moves else [])):
                span = profile.bounds.get((runner, parameter.name))
                if span is not None and parameter.type in _NUMBERS:
                    used.add((runner, parameter.name))
                    low = span[0] if low is None else max(low, span[0])
                    high = span[1] if high is None else min(high, span[1])
                    if low > high:
                        message = f"with its file, no value of {quoted(parameter.name)} is left"
                        place = profile.places.get((f"bounds {runner}", parameter.name), (1, 1))
                        notes.error(place, message, "'gpsfsm capabilities show' lists its bounds")
            limited = moves and parameter.name == "frame" and (_MAP, "x") in profile.bounds
            choices = (_MAP,) if limited else parameter.choices  # in another frame it says nothing
            configuration.append(replace(parameter, minimum=low, maximum=high, choices=choices))
        added = (*provider.resources, *profile.resources.get(provider.implements, ()))
        held = tuple(dict.fromkeys(added))
        yield replace(provider, configuration=tuple(configuration), resources=held)
    for runner, name in profile.bounds.keys() - used:
        place = profile.places[f"bounds {runner}", name]
        whose = quoted(runner) if runner else "runner of this robot"
        message = f"no {whose} has a parameter {quoted(name)} that is a number"
        if runner:
            message = f"{whose} has no parameter {quoted(name)} that is a number"
        notes.error(place, message, "'gpsfsm capabilities show' lists the parameters of a runner")


def _number(provider: Provider, name: str) -> bool:
    parameter = provider.parameter(name)
    return parameter is not None and parameter.type in _NUMBERS


def _check_names(profile: Profile, library: Library, notes: Notes) -> None:
    """Note the runners that bounds and resources name and that are not there."""
    runners = {("bounds", runner) for runner, _ in profile.bounds if runner not in ("", _MAP)}
    runners |= {("resources", runner) for runner in profile.resources}
    for section, name in sorted(runners):
        if name not in library.interface_names:
            hint = notes.near(name, library.interface_names)
            message = f"the robot has no runner {quoted(name)}"
            notes.error(profile.places[section, name], message, hint or "list it in 'runners'")


def _check_leaves(profile: Profile, library: Library, notes: Notes) -> None:
    """Note the leaves that stand for no runner of the robot, or lack what it needs."""
    for leaf in profile.leaves:
        place = profile.places["leaves", leaf.name]
        resolution = library.resolve(leaf.runner, "")
        provider = resolution.provider
        if resolution.match is not Match.DESCRIBED or provider is None:
            hint = notes.near(leaf.runner, library.interface_names)
            message = f"{quoted(leaf.name)} stands for {quoted(leaf.runner)}, which is not a runner"
            notes.error(place, f"{message} of this robot", hint or "describe it, or list it")
            continue
        filled = {filling.parameter for filling in leaf.fillings}
        names = {each.name for each in provider.configuration}
        for key in sorted(filled - names):
            message = f"{quoted(leaf.runner)} has no parameter {quoted(key)}"
            notes.error(profile.places[f"leaves {leaf.name}", key], message, notes.near(key, names))
        for each in provider.configuration:
            if each.required and each.name not in filled:
                message = f"{quoted(leaf.runner)} needs a value for {quoted(each.name)}"
                notes.error(place, message, f"say in 'parameters' where {each.name} comes from")


# --- writing --------------------------------------------------------------------------------------


def area_of(text: str) -> tuple[float, float, float, float] | None:
    """The extent of a map from four numbers, x1 x2 y1 y2; None for a blank text.

    Raises UsageError for anything else.
    """
    try:
        numbers = [float(each) for each in text.replace(",", " ").split()]
    except ValueError:
        numbers = [math.nan]
    if not numbers:
        return None
    if len(numbers) != 4 or not all(map(math.isfinite, numbers)):
        raise UsageError(f"a map is four numbers, x1 x2 y1 y2, not {clip(text, 100)!r}")
    x1, x2, y1, y2 = numbers
    return x1, x2, y1, y2


def write_profile(
    file: Path,
    name: str,
    folders: Sequence[str],
    runners: Sequence[str],
    *,
    area: tuple[float, float, float, float] | None = None,
    engine: str | None = None,
    ros: RosSettings | None = None,
) -> None:
    """Write a profile that fits at once. Raises GpsfsmError for one that would not, or cannot.

    It is written beside its place first, and read: nothing that does not fit gets there.
    """
    lines = [f"name: {json.dumps(name)}"]
    for key, items in (("capabilities", folders), ("runners", runners)):
        if items:
            lines += [f"{key}:", *(f"  - {json.dumps(each)}" for each in items)]
    if area is not None:
        x1, x2, y1, y2 = area
        lines.append(f"map: {{x: [{x1:g}, {x2:g}], y: [{y1:g}, {y2:g}]}}")
    if engine is not None:
        lines.append(f"engine: {engine}")
    if ros is not None:
        lines += ["ros:", *(f"  {key}: {json.dumps(row)}" for key, row in ros.data().items())]
    draft = file.with_name(f".{file.name}.{os.urandom(8).hex()}.draft")
    content = ("\n".join(lines) + "\n").encode()
    try:
        write_bytes(content, str(draft))
        choose_capabilities((), robot=draft)
        write_bytes(content, str(file), within=str(file.parent))
    finally:
        with suppress(OSError):
            draft.unlink(missing_ok=True)
