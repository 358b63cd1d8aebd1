"""What has to be known to ask a model: which one, where, with which key and how patiently.

``settings_of`` joins flags, environment and configuration file; a flag comes before a variable,
and a variable before the file.
"""

from __future__ import annotations

import math
import os
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import TYPE_CHECKING, Any

from gpsfsm.errors import UsageError
from gpsfsm.generation.providers.secret import Secret

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.generation.providers.registry import Provider

__all__ = ["KEY_VARIABLE", "MODEL_VARIABLE", "URL_VARIABLE", "Constrain", "ModelSettings"]
__all__ += ["settings_of"]

MODEL_VARIABLE = "GPSFSM_MODEL"
URL_VARIABLE = "GPSFSM_BASE_URL"
KEY_VARIABLE = "GPSFSM_API_KEY"

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
    """Whether grammars are sent: after a probe has shown that they are heeded, or in any case."""

    PROBE = "probe"
    ALWAYS = "always"
    NEVER = "never"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelSettings:
    """How a model is asked.

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


def settings_of(
    flags: Mapping[str, Any] | None = None,
    *,
    environment: Mapping[str, str] | None = None,
    file: Mapping[str, Any] | None = None,
) -> ModelSettings:
    """The settings that hold.

    ``flags`` and ``file`` (the table ``[tool.gpsfsm.model]``) have the same keys: ``name``,
    ``base_url``, ``temperature``, ``max_tokens``, ``timeout``, ``retries``, ``max_wait``,
    ``context``, ``max_answer_bytes``, ``prompt_price``, ``answer_price``, ``constrain``,
    ``dialect``, ``thinking``, and only in a file ``api_key_env``; None is as good as absent.
    ``environment`` is that of the process if it is None. Without a model ``spec`` is "". Raises
    UsageError.
    """
    given = {key: value for key, value in (flags or {}).items() if value is not None}
    table = {key: value for key, value in (file or {}).items() if value is not None}
    environ = os.environ if environment is None else environment
    spec = str(given.get("name") or environ.get(MODEL_VARIABLE) or table.get("name") or "")
    table = _fitting(table, spec)
    found = _numbers(given, environ, table)
    for key in ("dialect", "thinking"):
        if (value := given.get(key, table.get(key))) is not None:
            found[key] = value
    found["constrain"] = Constrain(given.get("constrain") or table.get("constrain") or "probe")
    settings = ModelSettings(spec=spec, **found)
    if not spec:
        return settings
    from gpsfsm.generation.providers.registry import find_provider  # noqa: PLC0415  (a cycle)

    provider, _ = find_provider(spec)
    url, from_file = _address(given, environ, table, provider)
    secret = _key(environ, table, provider, foreign=from_file)
    return replace(settings, base_url=url, key=secret)


def _fitting(table: dict[str, Any], spec: str) -> dict[str, Any]:
    """The table without what it says of another model than the one that was chosen instead."""
    own = str(table.get("name") or spec)
    dropped: tuple[str, ...] = ()
    if own != spec:
        dropped = _OF_MODEL
    if own.partition(":")[0] != spec.partition(":")[0]:
        dropped += _OF_PROVIDER
    return {key: value for key, value in table.items() if key not in dropped}


def _numbers(
    given: Mapping[str, Any], environ: Mapping[str, str], table: Mapping[str, Any]
) -> dict[str, Any]:
    """The attributes that are numbers, as far as anything says what they are."""
    found: dict[str, Any] = {}
    for key, (attribute, least, most, whole) in _NUMBERS.items():
        variable = _VARIABLES.get(key, "")
        if key in given:
            value, source = given[key], f"--{key.replace('_', '-')}"
        elif environ.get(variable):
            value, source = _parsed(environ[variable], variable), variable
        elif key in table:
            value, source = table[key], f"'model.{key.replace('_', '-')}'"
        else:
            continue
        if math.isnan(value) or not least <= value <= most or (whole and value != int(value)):
            kind = "a whole number" if whole else "a number"
            raise UsageError(f"{source} must be {kind} from {least:g} to {most:g}, not {value:g}")
        found[attribute] = int(value) if whole else float(value)
    return found


def _parsed(text: str, variable: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UsageError(f"{variable} must be a number, not {text[:60]!r}") from None


def _address(
    given: Mapping[str, Any],
    environ: Mapping[str, str],
    table: Mapping[str, Any],
    provider: Provider,
) -> tuple[str, bool]:
    """The base URL, "" if nothing says one, and whether the configuration file does."""
    if given.get("base_url"):
        return str(given["base_url"]), False
    for variable in (URL_VARIABLE, provider.url_variable):
        if environ.get(variable):
            return environ[variable], False
    return str(table.get("base_url", "")), "base_url" in table


def _key(
    environ: Mapping[str, str], table: Mapping[str, Any], provider: Provider, *, foreign: bool
) -> Secret:
    """The key that the environment holds.

    A configuration file may come with a project of others. So an address in it gets the key that
    the same file names, or GPSFSM_API_KEY, never the key of the provider's own service.
    """
    named = str(table.get("api_key_env", ""))
    if named and not named.upper().endswith(_KEY_NAMES):
        raise UsageError(
            "'model.api-key-env' must be the name of an environment variable that holds the key, "
            f"not the key, and end in {_KEY_NAMES}"
        )
    own = () if foreign else provider.key_variables
    for variable in (KEY_VARIABLE, named, *own):
        if environ.get(variable, "").strip():
            return Secret(environ[variable], variable)
    return Secret("", named or (*own, KEY_VARIABLE)[0])  # a server that wants one will say so
