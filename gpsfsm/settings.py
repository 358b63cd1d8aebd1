"""The keys of a configuration file and what they may hold.

Imports pydantic, which is slow: only ``gpsfsm.config`` imports this, once it has found settings.
"""

from __future__ import annotations

from typing import Annotated, Literal
from urllib.parse import urlsplit

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from gpsfsm.analysis.options import MAX_RLIMIT, MAX_TOTAL_RLIMIT

__all__ = ["KeyTable", "ModelTable", "Settings", "UserSettings"]

_HOST = r"^(https?://)?([A-Za-z0-9._-]+|\[[0-9A-Fa-f:.]+\])(:[0-9]{1,5})?$"
"""``host``, ``host:port`` or ``http://host:port``."""

_AtLeastOne = Annotated[int, Field(ge=1)]
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _usable(host: str) -> str:
    """The host; raises ValueError for a port or an address of a computer that cannot be."""
    _ = urlsplit(host if "://" in host else f"//{host}").port
    return host


def _kebab(name: str) -> str:
    return name.replace("_", "-")


class ModelTable(BaseModel):
    """Which language model is asked, ``[tool.gpsfsm.model]``. A key never stands in a file."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, alias_generator=_kebab)

    name: str | None = None
    base_url: str | None = None
    api_key_env: Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,99}$")] | None = None
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


class Settings(BaseModel):
    """One field per option of ``gpsfsm check``; None means that the file does not say.

    ``model`` is for the commands that ask one.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, alias_generator=_kebab)

    format: str | None = None
    select: list[str] | None = None
    ignore: list[str] | None = None
    fail_on: Literal["error", "warning", "never"] | None = None
    allow_suppressions: bool | None = None
    quiet: bool | None = None
    statistics: bool | None = None
    jobs: Annotated[int, Field(ge=0, le=256)] | None = None
    assume: list[str] | None = None
    consistent: bool | None = None
    faults: list[Literal["failed", "no-start", "hang"]] | None = None
    solver: Literal["auto", "z3", "structural"] | None = None
    rlimit: Annotated[int, Field(ge=1, le=MAX_RLIMIT)] | None = None
    total_rlimit: Annotated[int, Field(ge=1, le=MAX_TOTAL_RLIMIT)] | None = None
    max_scenarios: Annotated[int, Field(ge=0)] | None = None
    from_response: bool | None = None
    capabilities: list[str] | None = None
    builtin_capabilities: bool | None = None
    deadline: _Positive | None = None
    energy_limit: _Positive | None = None
    engine: Literal["paper", "fabric-v1", "fabric-v2"] | None = None
    baseline: str | None = None
    max_bytes: _AtLeastOne | None = None
    max_depth: _AtLeastOne | None = None
    max_elements: _AtLeastOne | None = None
    max_attributes: _AtLeastOne | None = None
    max_attribute_length: _AtLeastOne | None = None
    color: Literal["auto", "always", "never"] | None = None
    model: ModelTable | None = None


class KeyTable(BaseModel):
    """Where the key in a variable may go, ``[keys.OPENAI_API_KEY]``."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, alias_generator=_kebab)

    hosts: list[Annotated[str, Field(pattern=_HOST, max_length=300), AfterValidator(_usable)]]


class UserSettings(Settings):
    """The user's own file: the same, and where keys may go."""

    keys: dict[Annotated[str, Field(pattern=r"^[A-Za-z_][A-Za-z0-9_]{0,99}$")], KeyTable] | None = (
        None
    )
