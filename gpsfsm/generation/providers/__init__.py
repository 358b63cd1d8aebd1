"""Providers of models: their registry, and the settings with which a model is made.

Built-in providers are the modules of ``builtin``. One that speaks HTTP is a ``Dialect``, a
builder of requests and a reader of replies; ``http_model`` and ``transport`` do the rest. Another
package adds providers through the entry point group ``gpsfsm.models``: the name of an entry is the
one that users write before the colon, the object is a ``Provider``. It cannot replace a built-in.

The settings say which model, where, with which key and how patiently. ``settings_of`` joins flags,
environment and configuration files; a flag comes before a variable, a variable before the file of
the project, and that before the user's own. The file of a project may be written by others, so what
it says decides about no key. A key goes where a list of hosts permits it: the provider's own host,
and what the user's own file names. Other hosts get it only if address and key are both chosen by
the user: flag, variable or own file.
"""

from __future__ import annotations

import importlib
import math
import os
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum, StrEnum
from functools import cache
from typing import TYPE_CHECKING, Any, TypeAlias

from gpsfsm.errors import UsageError
from gpsfsm.generation.providers import builtin
from gpsfsm.generation.providers.address import Permission, Secret, address, permission, server_of
from gpsfsm.model.printable import clip
from gpsfsm.plugins import find_plugin

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.generation.language_model import LanguageModel

GROUP = "gpsfsm.models"
"""The group of entry points."""

Rendered: TypeAlias = Callable[[str], str]
"""Writes a plan that came as JSON (``Constraint.JSON_SCHEMA``) as XML; raises if it is none."""

_EXAMPLE = "such as ollama:qwen3:8b or openai:gpt-5"


@dataclass(frozen=True, slots=True)
class Provider:
    """A provider of language models.

    - ``make(model, settings, rendered)`` returns a model; the server need not be reachable yet.
    - ``default_model``: "" means that a model must be named.
    - ``url_variable``, ``key_variables``: environment variables for this provider, in addition to
      those of gpsfsm.
    - ``default_url``: the provider's own server, to which the keys in ``key_variables`` may be
      sent.
    """

    name: str
    make: Callable[[str, ModelSettings, Rendered | None], LanguageModel]
    default_model: str = ""
    url_variable: str = ""
    key_variables: tuple[str, ...] = ()
    default_url: str = ""


@cache
def provider_names() -> tuple[str, ...]:
    """The names of the built-in providers; imports none of them."""
    modules = (module.name for module in pkgutil.iter_modules(builtin.__path__))
    return tuple(sorted(_called(name) for name in modules if not name.startswith("_")))


def find_provider(spec: str) -> tuple[Provider, str]:
    """The provider of ``provider:model``, and the model. Raises UsageError."""
    name, _, model = spec.strip().partition(":")
    if not name:
        raise UsageError(f"no model is named; write provider:model, {_EXAMPLE}")
    if name in provider_names():
        module = importlib.import_module(f"{builtin.__name__}.{name.replace('-', '_')}")
        provider: Provider = module.PROVIDER
    else:
        provider = _foreign(name)
    model = model or provider.default_model
    if not model:
        raise UsageError(f"'{clip(spec, 80)}' names no model; write {name}:MODEL")
    if not model.isprintable() or len(model) > 4096:
        raise UsageError(f"'{clip(spec, 80)}' cannot be the name of a model")
    return provider, model


def find_model(
    spec: str, settings: ModelSettings | None = None, *, rendered: Rendered | None = None
) -> LanguageModel:
    """The model that ``provider:model`` names.

    ``settings`` of None are those of the environment; their own ``spec`` does not count here.
    Without ``rendered`` no JSON schema is sent, since nobody could read the answer. Raises
    GpsfsmError for a model that cannot be asked, whoever answers; nothing is sent yet.
    """
    provider, model = find_provider(spec)
    if settings is None:
        settings = settings_of({"name": spec})
    return provider.make(model, replace(settings, spec=spec), rendered)


def _called(module: str) -> str:
    return module.replace("_", "-")


def _foreign(name: str) -> Provider:
    """A provider of another package; only looked for here, because that is slow."""
    provider, offered = find_plugin(
        GROUP, name, Provider, noun="provider", expected=Provider.__name__
    )
    if provider is not None:
        return provider
    import difflib

    names = (*provider_names(), *offered)
    near = difflib.get_close_matches(name[:60], names, n=1)
    hint = f"did you mean '{near[0]}'?" if near else f"write provider:model, {_EXAMPLE}."
    raise UsageError(
        f"there is no provider '{clip(name, 60)}'; {hint} Providers are: {', '.join(names)}"
    )


MODEL_VARIABLE = "GPSFSM_MODEL"
URL_VARIABLE = "GPSFSM_BASE_URL"
KEY_VARIABLE = "GPSFSM_API_KEY"

_NO_HOME = "the user's own configuration, which needs a home folder"
_KEY_NAMES = "API_KEY"  # so a file cannot ask for any other secret of the environment
_OF_MODEL = ("context", "prompt_price", "answer_price")
_OF_PROVIDER = ("base_url", "api_key_env", "dialect")
_VARIABLES = {
    "temperature": "GPSFSM_TEMPERATURE",
    "max_tokens": "GPSFSM_MAX_TOKENS",
    "timeout": "GPSFSM_TIMEOUT",
    "retries": "GPSFSM_RETRIES",
    "context": "GPSFSM_CONTEXT",
}
_NUMBERS: Mapping[str, tuple[str, float, float, bool]] = {
    # key: attribute, least, most, whether it is a whole number
    "temperature": ("temperature", 0, 2, False),
    "max_tokens": ("max_tokens", 1, 1_000_000, True),
    "timeout": ("timeout_s", 0.001, 86_400, False),
    "retries": ("retries", 0, 20, True),
    "max_wait": ("max_wait_s", 0, 3_600, False),
    "context": ("context_tokens", 256, 100_000_000, True),
    "max_answer_bytes": ("max_answer_bytes", 1_024, 1 << 30, True),
    "prompt_price": ("prompt_price", 0, 1e9, False),
    "answer_price": ("answer_price", 0, 1e9, False),
}


class Constrain(StrEnum):
    """The rule for sending grammars: when a probe has shown that they are heeded, or always."""

    PROBE = "probe"
    ALWAYS = "always"
    NEVER = "never"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSettings:
    """Settings of one model.

    ``spec`` is ``provider:model``. ``base_url`` "" is the provider's own address. ``timeout_s``
    bounds one request, ``retries`` how often it is sent again, ``max_wait_s`` the pause before.
    ``context_tokens`` is what prompt and answer may have together. ``prompt_price`` and
    ``answer_price`` are per million tokens. ``dialect`` names one of several ways in which a
    server may take grammars, "" is the first that it heeds. ``thinking`` leaves it to the model
    whether to think aloud first. ``temperature`` and ``max_tokens`` are for the ``Request``.
    """

    spec: str = ""
    base_url: str = ""
    key: Secret = field(default_factory=Secret)
    temperature: float = 0.0
    max_tokens: int = 4096
    timeout_s: float = 300.0
    connect_timeout_s: float = 10.0
    retries: int = 3
    max_wait_s: float = 60.0
    context_tokens: int | None = None
    max_answer_bytes: int = 8 << 20
    prompt_price: float | None = None
    answer_price: float | None = None
    constrain: Constrain = Constrain.PROBE
    dialect: str = ""
    thinking: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Configured:
    """The settings of models in configuration files.

    ``project`` is the table ``[tool.gpsfsm.model]`` of the file of a project, ``user`` that of the
    user's own. ``keys`` are the hosts to which a key may go, by its variable; only the user's own
    file has them, ``user_file``. ``places`` says where keys of ``project`` stand, ``file:line``.
    """

    project: Mapping[str, Any] = field(default_factory=dict)
    user: Mapping[str, Any] = field(default_factory=dict)
    keys: Mapping[str, Sequence[str]] = field(default_factory=dict)
    places: Mapping[str, str] = field(default_factory=dict)
    user_file: str = ""

    def place(self, key: str) -> str:
        """The place of a key of ``project``."""
        return self.places.get(key, "the configuration of the project")


def settings_of(
    flags: Mapping[str, Any] | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    configured: Configured | None = None,
) -> ModelSettings:
    """The settings that hold.

    ``flags`` and the tables of ``configured`` have the same keys: ``name``, ``base_url``,
    ``temperature``, ``max_tokens``, ``timeout``, ``retries``, ``max_wait``, ``context``,
    ``max_answer_bytes``, ``prompt_price``, ``answer_price``, ``constrain``, ``dialect``,
    ``thinking``, and only in a file ``api_key_env``; None is as good as absent. ``environment`` is
    that of the process if it is None. Without a model ``spec`` is "". Raises UsageError, also for a
    key that may not go where the file of a project would have it sent.
    """
    overrides = {key: value for key, value in (flags or {}).items() if value is not None}
    files = configured or Configured()
    environ = os.environ if environment is None else environment
    chosen = overrides.get("name") or environ.get(MODEL_VARIABLE)
    spec = str(chosen or files.project.get("name") or files.user.get("name") or "")
    project, user = _fitting(files.project, spec), _fitting(files.user, spec)
    table = {**user, **project}
    numbers = _numbers(overrides, environ, table)
    for key in ("dialect", "thinking"):
        if (value := overrides.get(key, table.get(key))) is not None:
            numbers[key] = value
    numbers["constrain"] = Constrain(
        overrides.get("constrain") or table.get("constrain") or "probe"
    )
    settings = ModelSettings(spec=spec, **numbers)
    if not spec:
        return settings

    provider, _ = find_provider(spec)
    url, by = _address(overrides, environ, project, user, provider)
    choice = _Choice(
        provider=provider,
        url=_whole(url or provider.default_url, provider),
        url_by=by,
        spec_by_user=bool(chosen) or "name" not in files.project,
        files=replace(files, project=project, user=user),
    )
    return replace(settings, base_url=url, key=_key(environ, choice))


def _whole(url: str, provider: Provider) -> str:
    return address(url, provider.name) if url else ""


def _fitting(file: Mapping[str, Any], spec: str) -> dict[str, Any]:
    """The table without what it says of another model than the one that was chosen instead."""
    table = {key: value for key, value in file.items() if value is not None}
    own = str(table.get("name") or spec)
    dropped: tuple[str, ...] = ()
    if own != spec:
        dropped = _OF_MODEL
    if own.partition(":")[0] != spec.partition(":")[0]:
        dropped += _OF_PROVIDER
    return {key: value for key, value in table.items() if key not in dropped}


def _numbers(
    chosen: Mapping[str, Any], environ: Mapping[str, str], table: Mapping[str, Any]
) -> dict[str, Any]:
    """The attributes that are numbers, as far as anything says what they are."""
    numbers: dict[str, Any] = {}
    for key, (attribute, least, most, whole) in _NUMBERS.items():
        variable = _VARIABLES.get(key, "")
        if key in chosen:
            value, source = chosen[key], f"--{key.replace('_', '-')}"
        elif environ.get(variable):
            value, source = _parsed(environ[variable], variable), variable
        elif key in table:
            value, source = table[key], f"'model.{key.replace('_', '-')}'"
        else:
            continue
        if math.isnan(value) or not least <= value <= most or (whole and value != int(value)):
            kind = "a whole number" if whole else "a number"
            raise UsageError(f"{source} must be {kind} from {least:g} to {most:g}, not {value:g}")
        numbers[attribute] = int(value) if whole else float(value)
    return numbers


def _parsed(text: str, variable: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{variable} must be a number, not {text[:60]!r}") from None


def _address(
    chosen: Mapping[str, Any],
    environ: Mapping[str, str],
    project: Mapping[str, Any],
    user: Mapping[str, Any],
    provider: Provider,
) -> tuple[str, _By]:
    """The base URL, "" for the provider's own, and who has chosen it."""
    if chosen.get("base_url"):
        return str(chosen["base_url"]), _By.USER
    for variable in (URL_VARIABLE, provider.url_variable):
        if environ.get(variable):
            return environ[variable], _By.USER
    if project.get("base_url"):
        return str(project["base_url"]), _By.PROJECT
    if user.get("base_url"):
        return str(user["base_url"]), _By.USER
    return "", _By.PROVIDER


class _By(Enum):
    USER, PROJECT, PROVIDER = range(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Choice:
    """The server, and who has chosen it; ``url`` is whole, "" if nothing says it."""

    provider: Provider
    url: str
    url_by: _By
    spec_by_user: bool
    files: Configured

    @property
    def by_user(self) -> bool:
        """True if the user has chosen the server; who chooses a provider chooses its own."""
        return self.url_by is _By.USER or (self.url_by is _By.PROVIDER and self.spec_by_user)

    def chosen(self, variable: str) -> bool:
        """True if the user has chosen the variable with the key: as such, or with the provider."""
        if variable in self.provider.key_variables:
            return self.spec_by_user
        return variable == KEY_VARIABLE or variable != self.files.project.get("api_key_env")

    def permitted(self, variable: str) -> Permission:
        """True if the key in a variable may go to the server."""
        by_user = self.by_user and self.chosen(variable)
        hosts = [*self.files.keys.get(variable, ())]
        if self.provider.default_url and variable in self.provider.key_variables:
            hosts.append(_whole(self.provider.default_url, self.provider))
        listed = permission(self.url, hosts) if self.url else Permission.NO
        return Permission.YES if listed is Permission.NO and by_user else listed


def _key(environ: Mapping[str, str], choice: _Choice) -> Secret:
    """The key that the environment holds and that may go to the server.

    The key of a provider's own service is passed over where it may not go. Any other was chosen, so
    that it may not go there is an error. Raises UsageError.
    """
    files, own = choice.files, choice.provider.key_variables
    named = str(files.project.get("api_key_env") or files.user.get("api_key_env") or "")
    if named and not named.upper().endswith(_KEY_NAMES):
        raise UsageError(
            "'model.api-key-env' must be the name of an environment variable that holds the key, "
            f"not the key, and end in {_KEY_NAMES}"
        )
    for variable in (KEY_VARIABLE, named, *own):
        if not environ.get(variable, "").strip():
            continue
        answer = choice.permitted(variable)
        if answer is Permission.YES:
            return Secret(environ[variable], variable)
        if choice.url and (answer is Permission.PLAIN or variable in (KEY_VARIABLE, named)):
            raise UsageError(_not_there(variable, answer, choice))
    usable = [each for each in own if choice.permitted(each) is Permission.YES]
    return Secret("", named or (*usable, KEY_VARIABLE)[0])  # a server that wants one will say so


def _not_there(variable: str, answer: Permission, choice: _Choice) -> str:
    """The reason for which a key is not sent, and what to write where so that it is."""
    files, server = choice.files, server_of(choice.url)
    lines = f"{files.user_file or _NO_HOME}:\n{_lines(variable, server)}"
    if answer is Permission.PLAIN:
        place = f"{files.place('base_url')}: " if choice.url_by is _By.PROJECT else ""
        return (
            f"{place}{variable} is not sent to {choice.url}: without encryption others can read "
            f"it; use https, or permit it in {lines}"
        )
    cause, also = "api_key_env", ""
    if not choice.by_user:
        cause = "base_url" if choice.url_by is _By.PROJECT else "name"
    if choice.chosen(variable):
        also = f"name the server yourself (--base-url or {URL_VARIABLE}), or "
    said = f"'model.{cause.replace('_', '-')}' is chosen by the project"
    return (
        f"{files.place(cause)}: {variable} is not sent to {server}, since {said}; if that is what "
        f"you want, {also}write into {lines}"
    )


def _lines(variable: str, server: str) -> str:
    return f'  [keys.{variable}]\n  hosts = ["{server}"]'
