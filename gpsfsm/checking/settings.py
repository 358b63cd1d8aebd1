"""The keys of a configuration file and what they may hold.

Imports pydantic, which is slow: only ``checking/config.py`` imports this, once it has read some.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, create_model

from gpsfsm.checking.option_table import OPTIONS, Kind, Option

_VARIABLE = r"^[A-Za-z_][A-Za-z0-9_]{0,99}$"
"""The name of a variable of the environment."""

_HOST = r"^(https?://)?([A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\])(:[0-9]{1,5})?$"
"""``host``, ``host:port`` or ``http://host:port``."""


def _usable(host: str) -> str:
    """The host; raises ValueError for a port or an address of a computer that cannot be."""
    _ = urlsplit(host if "://" in host else f"//{host}").port
    return host


def _kebab(name: str) -> str:
    return name.replace("_", "-")


_STRICT = ConfigDict(extra="forbid", strict=True, frozen=True, alias_generator=_kebab)


class ModelTable(BaseModel):
    """The language model that is asked, ``[tool.gpsfsm.model]``. A key never stands in a file."""

    model_config = _STRICT

    name: str | None = None
    base_url: str | None = None
    api_key_env: Annotated[str, Field(pattern=_VARIABLE)] | None = None
    temperature: Annotated[float, Field(ge=0, le=2)] | None = None
    max_tokens: Annotated[int, Field(ge=1, le=1_000_000)] | None = None
    timeout: Annotated[float, Field(gt=0, le=86_400)] | None = None
    retries: Annotated[int, Field(ge=0, le=20)] | None = None
    max_wait: Annotated[float, Field(ge=0, le=3_600)] | None = None
    context: Annotated[int, Field(ge=256, le=100_000_000)] | None = None
    max_answer_bytes: Annotated[int, Field(ge=1_024, le=1 << 30)] | None = None
    prompt_price: Annotated[float, Field(ge=0, le=1e9)] | None = None
    answer_price: Annotated[float, Field(ge=0, le=1e9)] | None = None
    constrain: Literal["probe", "always", "never"] | None = None
    dialect: str | None = None
    thinking: bool | None = None


def _key_of(option: Option) -> tuple[Any, None]:
    """The type of an option's key, and None for a file that does not say."""
    literal: Any = Literal
    number = Field(ge=option.least, le=option.most)
    kinds: dict[Kind, Any] = {
        Kind.FLAG: bool,
        Kind.COUNT: Annotated[int, number],
        Kind.AMOUNT: Annotated[float, Field(gt=option.above, allow_inf_nan=False)],
    }
    kind: Any = literal[option.choices] if option.choices else kinds.get(option.kind, str)
    if option.kind.is_list:
        listed: Any = list
        kind = listed[kind]
    return kind | None, None


class KeyTable(BaseModel):
    """The hosts that get the key in a variable, ``[keys.OPENAI_API_KEY]``."""

    model_config = _STRICT

    hosts: list[Annotated[str, Field(pattern=_HOST, max_length=300), AfterValidator(_usable)]]


_KEYS: dict[str, Any] = {option.name: _key_of(option) for option in OPTIONS}

Settings = create_model("Settings", __config__=_STRICT, **_KEYS, model=(ModelTable | None, None))
"""The keys of a file: one per option in the table, and ``model`` for the commands that ask one."""

UserSettings = create_model(
    "UserSettings",
    __base__=Settings,
    keys=(dict[Annotated[str, Field(pattern=_VARIABLE)], KeyTable] | None, None),
)
"""The user's own file: the same, and where keys may go."""
