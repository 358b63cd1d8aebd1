"""Configuration files: ``gpsfsm.toml``, or ``[tool.gpsfsm]`` in a ``pyproject.toml``.

The file is looked for in the current folder and then upwards. A gpsfsm.toml counts even if it is
empty; a pyproject.toml without a ``[tool.gpsfsm]`` is passed over.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import ConfigError, InputError, UsageError
from gpsfsm.inputs import read_file

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pydantic import ValidationError

__all__ = ["Config", "find_config", "load_config"]

_OWN_NAME = "gpsfsm.toml"
_PROJECT_NAME = "pyproject.toml"
_TABLE = "[tool.gpsfsm]"
_MAX_BYTES = 1 << 20
_PATHS = ("output_file", "baseline")
_SECRETS = frozenset({"api-key", "api_key", "key", "token"})


@dataclass(frozen=True, slots=True)
class Config:
    """The settings of one file: names as in Python (``fail_on``), only those that it gives.

    Relative paths in it have become relative to the file's folder.
    """

    file: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)


def find_config(start: Path | None = None) -> Config:
    """The settings that hold in a folder (default: the current one); empty if there are none.

    Raises ConfigError for a file that does not fit.
    """
    try:
        folder = (start or Path()).resolve()
    except OSError:  # the current folder has been deleted
        return Config()
    for candidate in (folder, *folder.parents):
        for name in (_OWN_NAME, _PROJECT_NAME):
            file = candidate / name
            if _is_file(file) and (table := _table(file)) is not None:
                return _config(file, table)
    return Config()


def load_config(file: str | Path) -> Config:
    """The settings of this file; raises ConfigError if it has none or does not fit.

    A file with the name pyproject.toml is read as one, any other as a gpsfsm.toml.
    """
    table = _table(Path(file))
    if table is None:
        raise ConfigError(f"{file}: there is no {_TABLE} in it")
    return _config(Path(file), table)


def _is_file(file: Path) -> bool:
    try:
        return file.is_file()
    except OSError:  # a folder that we may not look into
        return False


def _table(file: Path) -> dict[str, Any] | None:
    """The settings as they stand in the file; None for a pyproject.toml without any."""
    text = _read(file)
    if file.name != _PROJECT_NAME:
        return _parse(file, text)
    if b"gpsfsm" not in text:  # spares most projects the parser
        return None
    tool = _parse(file, text).get("tool")
    if not isinstance(tool, dict) or "gpsfsm" not in tool:
        return None
    table = tool["gpsfsm"]
    if not isinstance(table, dict):
        raise ConfigError(f"{file}: tool.gpsfsm must be a table, {_TABLE}")
    return table


def _read(file: Path) -> bytes:
    try:
        return read_file(file, _MAX_BYTES)
    except InputError as error:
        raise ConfigError(f"{file}: {error}") from error


def _parse(file: Path, content: bytes) -> dict[str, Any]:
    import tomllib  # noqa: PLC0415  (only for a file with settings)

    try:
        return tomllib.loads(content.decode("utf-8"))
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: is not UTF-8 text (byte {error.start + 1})") from error
    except RecursionError as error:
        raise ConfigError(f"{file}: is nested too deeply") from error
    except ValueError as error:  # tomllib's own error, and a number of too many digits
        raise ConfigError(f"{file}: is not TOML: {error}") from error


def _config(file: Path, table: dict[str, Any]) -> Config:
    from pydantic import ValidationError  # noqa: PLC0415  (slow; only with settings)

    from gpsfsm.settings import Settings  # noqa: PLC0415  (imports pydantic)

    try:
        settings = Settings.model_validate(table)
    except ValidationError as error:
        raise ConfigError(_explain(file, error)) from error
    values = settings.model_dump(exclude_none=True)
    _check_meaning(file, values)
    for name in _PATHS:
        if values.get(name, "-") != "-":
            values[name] = str(file.parent / values[name])
    if "capabilities" in values:
        values["capabilities"] = [str(file.parent / path) for path in values["capabilities"]]
    return Config(str(file), values)


def _explain(file: Path, error: ValidationError) -> str:
    """One line per problem, each with the file and the key."""
    lines = []
    for found in error.errors(include_url=False):
        key = _key(found["loc"])
        if found["type"] == "extra_forbidden":
            lines.append(f"{file}: {_unknown_key(file, key)}")
        elif key.endswith("api-key-env"):  # somebody may have put the key itself there
            lines.append(f"{file}: '{key}' must be the name of an environment variable, not a key")
        else:
            said = found["msg"].removeprefix("Input should be ")
            lines.append(f"{file}: '{key}' must be {said}, not {_short(found['input'])}")
    return "\n".join(lines)


def _key(location: tuple[int | str, ...]) -> str:
    """``faults[1]``: the key, then places in lists; the rest is how pydantic tried to read it."""
    if location[0] == "model" and len(location) > 1:
        return f"model.{location[1]}"
    return str(location[0]) + "".join(f"[{part}]" for part in location if isinstance(part, int))


def _unknown_key(file: Path, key: str) -> str:
    from gpsfsm.settings import ModelTable, Settings  # noqa: PLC0415  (imports pydantic)

    if key == "tool" and file.name != _PROJECT_NAME:
        return f"keys stand at the top of a {_OWN_NAME}, not below {_TABLE}"
    if key.removeprefix("model.") in _SECRETS:
        return (
            f"there is no key '{key}', and no key of a model belongs into a file: put it into an "
            "environment variable, and the name of that into 'model.api-key-env'"
        )
    table = "model." if key.startswith("model.") else ""
    fields = (ModelTable if table else Settings).model_fields
    known = [name.replace("_", "-") for name in fields]
    import difflib  # noqa: PLC0415

    meant = key.removeprefix(table).replace("_", "-")
    near = difflib.get_close_matches(meant, known, n=1)
    names = ", ".join(f"{table}{name}" for name in known)
    hint = f"did you mean '{table}{near[0]}'?" if near else f"known are {names}"
    return f"there is no key '{key}'; {hint}"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:59] + "…"


def _check_meaning(file: Path, values: Mapping[str, Any]) -> None:
    """Check what types do not tell here, where the message can name the file and the key."""
    from gpsfsm.analysis.options import check_assumptions  # noqa: PLC0415  (only with settings)
    from gpsfsm.analysis.rules import select_rules  # noqa: PLC0415
    from gpsfsm.report import find_format  # noqa: PLC0415

    try:
        key = "format"
        if key in values:
            find_format(values[key])
        for key in ("select", "ignore"):
            select_rules(tuple(values.get(key, ())))
        key = "assume"
        check_assumptions(values.get(key, ()))
    except UsageError as error:
        raise ConfigError(f"{file}: '{key}': {error}") from error
