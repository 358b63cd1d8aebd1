"""Configuration files: the user's own, and ``gpsfsm.toml`` or ``pyproject.toml`` of a project.

The file of a project is looked for in the current folder and then upwards, to the root of the
repository or to the home folder. A gpsfsm.toml counts even if it is empty; a pyproject.toml without
a ``[tool.gpsfsm]`` is passed over. Others may have written it, so it must belong to the user, it
writes no file, and no key goes where only it says (``gpsfsm.generation.providers``). The
user's own file lies where no project can put one; it alone says where keys may go.
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import field, replace
from pathlib import Path
from stat import S_IWOTH
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import ConfigError, InputError, UsageError
from gpsfsm.files import read_whole
from gpsfsm.late import dataclass
from gpsfsm.model.finding import Severity
from gpsfsm.model.report import Effect, SettingUsed
from gpsfsm.model.story import PAPER_ENGINE

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pydantic import ValidationError

    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import Report

_OWN_NAME = "gpsfsm.toml"
_USER_FOLDERS = {"XDG_CONFIG_HOME": ".config", "XDG_DATA_HOME": ".local/share"}
_PROJECT_NAME = "pyproject.toml"
_REPOSITORY = ".git"
_TABLE = "[tool.gpsfsm]"
_MAX_BYTES = 1 << 20
_SECRETS = frozenset({"api-key", "api_key", "key", "token"})
_HOSTS = 'hosts = ["api.openai.com", "gpu.example:8000", "http://robot.local:8000"]'
_OUTPUTS = frozenset({"output-file", "output_file", "output"})


@dataclass(frozen=True, slots=True)
class Config:
    """The settings of one file: names as in Python (``fail_on``), only those that it has.

    Relative paths in it have become relative to the file's folder. ``places`` says of keys of the
    table ``model`` where they stand, ``file:line``. ``keys`` are the hosts to which a key may go,
    by the variable that holds it; only the user's ``own`` file has any.
    """

    file: str = ""
    values: Mapping[str, Any] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)
    keys: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    own: bool = False


def find_config(start: Path | None = None) -> Config:
    """The settings of the project in a folder (default: the current one); empty if it has none.

    Raises ConfigError for a file that does not fit, and for one that others can write.
    """
    for folder in searched_folders(start):
        for name in config_names():
            file = folder / name
            if _is_file(file) and (content := _content(file)) is not None:
                _refuse_others(file, f"to use it anyway, name it: --config {file}")
                return _config(file, content)
    return Config()


def config_names() -> tuple[str, str]:
    """The names of the files that are looked for, in this order."""
    return _OWN_NAME, _PROJECT_NAME


def searched_folders(start: Path | None = None) -> list[Path]:
    """The folders of a project's file: from a folder up to its repository's root, or to home.

    Outside of both it is the folder alone: what lies above belongs to somebody else.
    """
    try:
        folder = (start or Path()).resolve()
    except OSError:  # the current folder has been deleted
        return []
    home = _home()
    folders: list[Path] = []
    for candidate in (folder, *folder.parents):
        folders.append(candidate)
        if candidate == home or _exists(candidate / _REPOSITORY):
            return folders
    return [folder]


def profile_settings(file: str) -> Config:
    """The options of a check that a robot profile sets, as a configuration file would.

    Raises ConfigError.
    """
    from gpsfsm.capabilities.robot import load_profile
    from gpsfsm.checking.option_table import BY_KEYWORD

    settings = load_profile(file).settings
    return Config(file, {BY_KEYWORD[name].name: value for name, value in settings.items()})


def load_config(file: str | Path) -> Config:
    """The settings of this file; raises ConfigError if it has none or does not fit.

    A file with the name pyproject.toml is read as one, any other as a gpsfsm.toml. To name a file
    is to trust its settings, whoever owns it; where keys go is said by the user's own file alone.
    """
    content = _content(Path(file))
    if content is None:
        raise ConfigError(f"{file}: there is no {_TABLE} in it")
    return _config(Path(file), content, own=_is_own(Path(file)))


def user_config_file() -> Path | None:
    """The path of the user's own configuration; None without a home folder."""
    folder = user_folder("XDG_CONFIG_HOME")
    return None if folder is None else folder / "gpsfsm" / "config.toml"


def user_folder(variable: str) -> Path | None:
    """The folder of the user that a variable names (XDG base directories), or its default.

    None if that is below the home folder, and there is none.
    """
    folder = Path(os.environ.get(variable, ""))
    if folder.is_absolute():  # a relative one is to be ignored, says the standard
        return folder
    home = _home()
    return None if home is None else home / _USER_FOLDERS[variable]


def load_user_config() -> Config:
    """The user's own settings; empty if there are none. Raises ConfigError."""
    file = user_config_file()
    if file is None or not _is_file(file):
        return Config(own=True)
    _refuse_others(file, f"remove it, or correct the permissions of {file.parent}")
    content = _content(file)
    assert content is not None
    return _config(file, content, own=True)


def _home() -> Path | None:
    try:
        return Path.home().resolve()
    except (OSError, RuntimeError):
        return None


def _is_file(file: Path) -> bool:
    try:
        return file.is_file()
    except OSError:  # a folder that we may not look into
        return False


def _exists(path: Path) -> bool:
    try:
        path.lstat()
    except (OSError, ValueError):
        return False
    return True


def _is_own(file: Path) -> bool:
    own = user_config_file()
    try:
        return own is not None and file.samefile(own)
    except OSError:
        return False


def _refuse_others(file: Path, remedy: str) -> None:
    """Raise ConfigError for a file that somebody else has written, or could write.

    Root owns what belongs to the system. Under sudo the files of whoever called it count as well.
    """
    if not hasattr(os, "geteuid"):  # Windows
        return
    mine = {0, os.geteuid()}
    if os.geteuid() == 0 and os.environ.get("SUDO_UID", "").isdecimal():
        mine.add(int(os.environ["SUDO_UID"]))
    wrong = ""
    try:
        real = file.resolve()
        if any(status.st_uid not in mine for status in (file.lstat(), real.stat())):
            wrong = "it belongs to another user"
        elif real.stat().st_mode & S_IWOTH:
            wrong = "every user can write to it"
        elif any(folder.stat().st_mode & S_IWOTH for folder in {file.parent, real.parent}):
            wrong = "it is in a folder that every user can write to"
    except OSError as error:
        wrong = f"its owner cannot be determined ({error.strerror or error})"
    if wrong:
        raise ConfigError(f"{file}: this configuration is not read, since {wrong}; {remedy}")


def _content(file: Path) -> tuple[dict[str, Any], str] | None:
    """The settings as they stand in the file, and its text; None for a project without any."""
    content = _read(file)
    if file.name == _PROJECT_NAME and b"gpsfsm" not in content:  # spares most the parser
        return None
    table, text = _parse(file, content)
    if file.name != _PROJECT_NAME:
        return table, text
    tool = table.get("tool")
    if not isinstance(tool, dict) or "gpsfsm" not in tool:
        return None
    if not isinstance(tool["gpsfsm"], dict):
        raise ConfigError(f"{file}: tool.gpsfsm must be a table, {_TABLE}")
    return tool["gpsfsm"], text


def _read(file: Path) -> bytes:
    try:
        return read_whole(file, _MAX_BYTES)
    except InputError as error:
        raise ConfigError(f"{file}: {error}") from error


def _parse(file: Path, content: bytes) -> tuple[dict[str, Any], str]:
    import tomllib

    try:
        text = content.decode("utf-8")
        return tomllib.loads(text), text
    except UnicodeDecodeError as error:
        raise ConfigError(f"{file}: is not UTF-8 text (byte {error.start + 1})") from error
    except RecursionError as error:
        raise ConfigError(f"{file}: is nested too deeply") from error
    except ValueError as error:  # tomllib's own error, and a number of too many digits
        raise ConfigError(f"{file}: is not TOML: {error}") from error


def _config(file: Path, content: tuple[dict[str, Any], str], *, own: bool = False) -> Config:
    """The settings of a file; the user's ``own`` may say where keys go."""
    from pydantic import ValidationError

    from gpsfsm.checking.settings import Settings, UserSettings

    table, text = content
    try:
        settings = (UserSettings if own else Settings).model_validate(table)
    except ValidationError as error:
        raise ConfigError(_explain(file, error)) from error
    values = settings.model_dump(exclude_none=True)
    hosts = {name: tuple(each["hosts"]) for name, each in values.pop("keys", {}).items()}
    _check_meaning(file, values)
    if "baseline" in values:
        values["baseline"] = str(file.parent / values["baseline"])
    if "robot" in values:
        values["robot"] = str(file.parent / values["robot"])
    if "capabilities" in values:
        values["capabilities"] = [str(file.parent / path) for path in values["capabilities"]]
    places = {name: _place(file, name, text) for name in values.get("model", {})}
    return Config(str(file), values, places, hosts, own)


def _place(file: Path, name: str, text: str) -> str:
    """``file:line`` of a key, as far as the line can be told without a parser that keeps it."""
    key = re.escape(name.replace("_", "-"))
    pattern = re.compile(rf"(?<![\w-])[\"']?{key}[\"']?\s*=")
    lines = [
        number for number, line in enumerate(text.splitlines(), start=1) if pattern.search(line)
    ]
    return f"{file}:{lines[0]}" if len(lines) == 1 else str(file)


def _explain(file: Path, error: ValidationError) -> str:
    """One line per problem, each with the file and the key."""
    lines = []
    for defect in error.errors(include_url=False):
        key = _key(defect["loc"])
        if defect["type"] == "extra_forbidden":
            lines.append(f"{file}: {_unknown_key(file, key)}")
        elif key.startswith("keys."):
            lines.append(f"{file}: '{key}' must be a table with a list of hosts, such as {_HOSTS}")
        elif key.endswith("api-key-env"):  # somebody may have put the key itself there
            lines.append(f"{file}: '{key}' must be the name of an environment variable, not a key")
        else:
            said = defect["msg"].removeprefix("Input should be ")
            lines.append(f"{file}: '{key}' must be {said}, not {_short(defect['input'])}")
    return "\n".join(lines)


def _key(location: tuple[int | str, ...]) -> str:
    """``faults[1]``: the key, then places in lists; the rest is how pydantic tried to read it."""
    if location[0] in ("model", "keys") and len(location) > 1:
        return f"{location[0]}.{location[1]}"
    return str(location[0]) + "".join(f"[{part}]" for part in location if isinstance(part, int))


def _unknown_key(file: Path, key: str) -> str:
    from gpsfsm.checking.settings import ModelTable, Settings

    if key == "tool" and file.name != _PROJECT_NAME:
        return f"in a {_OWN_NAME}, keys are at the top level, not below {_TABLE}"
    if key in _OUTPUTS:
        return (
            f"there is no key '{key}': a project file must not decide where output is written; "
            "give -o FILE on the command line"
        )
    if key.startswith("keys."):  # in the user's own file
        return f"'{key}' must be a table with a list of hosts, such as {_HOSTS}"
    if key == "keys":
        return (
            "a project file must not decide where keys are sent; put the table 'keys' into "
            f"your own configuration, {user_config_file() or 'which needs a home folder'}"
        )
    if key.removeprefix("model.") in _SECRETS:
        return (
            f"there is no key '{key}', and model keys do not belong in a file: put the key in an "
            "environment variable, and the variable's name in 'model.api-key-env'"
        )
    table = "model." if key.startswith("model.") else ""
    fields = (ModelTable if table else Settings).model_fields
    keys = [name.replace("_", "-") for name in fields]
    import difflib

    meant = key.removeprefix(table).replace("_", "-")
    near = difflib.get_close_matches(meant, keys, n=1)
    names = ", ".join(f"{table}{name}" for name in keys)
    hint = f"did you mean '{table}{near[0]}'?" if near else f"the keys are {names}"
    return f"there is no key '{key}'; {hint}"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:59] + "…"


def _check_meaning(file: Path, values: Mapping[str, Any]) -> None:
    """Check what types do not tell here, where the message can name the file and the key."""
    from gpsfsm.analysis.options import check_assumptions
    from gpsfsm.analysis.rules import select_rules
    from gpsfsm.report import find_format

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


# --- what settings take away ----------------------------------------------------------------------

_NARROWING: Mapping[str, object] = {
    "assume": [],
    "consistent": False,
    "capabilities": [],
    "builtin_capabilities": True,
    "engine": PAPER_ENGINE,
    "from_response": False,
}
"""Settings under which less is decided than everything, or of another text; and what does not."""


def settings_used(values: Any, report: Report) -> Report:
    """The report with the settings that take something away from it, or from the exit code.

    Of options on the command line those that hide findings; of a configuration file also those
    under which less is decided, and those that let errors pass: its author may be somebody else.
    """
    used = (*_hiding(values, report), *narrowing(values), *_excusing(values, report))
    return replace(report, settings=used)


def _hiding(values: Any, report: Report) -> Iterator[SettingUsed]:
    from gpsfsm.analysis.rules import select_rules

    ignored = select_rules(
        tuple(w.strip() for each in getattr(values, "ignore", ()) for w in each.split(","))
    )
    groups: dict[str, list[Finding]] = {"select": [], "ignore": [], "baseline": []}
    for plan in report.plans:
        for finding in plan.suppressed:
            if finding.suppressed_by == "option":
                groups["ignore" if finding.rule in ignored else "select"].append(finding)
            elif finding.suppressed_by == "baseline":
                groups["baseline"].append(finding)
    for name, hidden in groups.items():
        if hidden:
            yield _used(values, name, Effect.HIDES, hidden)


def narrowing(values: Any) -> Iterator[SettingUsed]:
    """The settings of files under which less is decided than everything, and the robot."""
    if getattr(values, "robot", None) is not None:  # also of the command line: whose robot it is
        yield _used(values, "robot", Effect.NARROWS, ())
    for name, harmless in _NARROWING.items():
        if name in values.configured and getattr(values, name) != harmless:
            yield _used(values, name, Effect.NARROWS, ())


def _excusing(values: Any, report: Report) -> Iterator[SettingUsed]:
    """The settings under which errors do not fail, as far as there are any."""
    if not hasattr(values, "fail_on"):  # a command whose exit code says something else
        return
    counting = [*report.excused, *(each for plan in report.plans for each in plan.findings)]
    errors = [each for each in counting if each.severity is Severity.ERROR]
    if errors and values.fail_on == "never" and "fail_on" in values.configured:
        yield _used(values, "fail_on", Effect.EXCUSES, errors)
    least = None if values.fail_on == "never" else Severity(values.fail_on)
    excused = [each for each in report.excused if least and each.severity.rank >= least.rank]
    if excused and values.allow_suppressions:
        yield _used(values, "allow_suppressions", Effect.EXCUSES, excused)


def _used(values: Any, name: str, effect: Effect, findings: Sequence[Finding]) -> SettingUsed:
    file, value, key = (
        values.configured.get(name, ""),
        getattr(values, name),
        name.replace("_", "-"),
    )
    if file:
        text = json.dumps(list(value) if isinstance(value, tuple) else value, ensure_ascii=False)
        setting = f"{key} = {text}"
    elif value is True:
        setting = f"--{key}"
    else:
        setting = f"--{key} {value if isinstance(value, str) else ','.join(value)}"
    errors = sum(finding.severity is Severity.ERROR for finding in findings)
    return SettingUsed(setting, effect, _nearer(file), len(findings), errors)


def _nearer(file: str) -> str:
    """A file below the current folder by its path from there."""
    try:
        return str(Path(file).relative_to(Path.cwd())) if file else ""
    except (OSError, ValueError):
        return file
