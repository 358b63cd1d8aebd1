"""The keys of a configuration file and what they may hold.

Imports pydantic, which is slow: only ``gpsfsm.config`` imports this, once it has found settings.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from gpsfsm.analysis.options import MAX_RLIMIT

__all__ = ["Settings"]

_AtLeastOne = Annotated[int, Field(ge=1)]
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]


def _kebab(name: str) -> str:
    return name.replace("_", "-")


class Settings(BaseModel):
    """One field per option of ``gpsfsm check``; None means that the file does not say."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, alias_generator=_kebab)

    format: str | None = None
    output_file: str | None = None
    select: list[str] | None = None
    ignore: list[str] | None = None
    fail_on: Literal["error", "warning", "never"] | None = None
    quiet: bool | None = None
    statistics: bool | None = None
    jobs: Annotated[int, Field(ge=0, le=256)] | None = None
    assume: list[str] | None = None
    consistent: bool | None = None
    faults: list[Literal["failed", "no-start", "hang"]] | None = None
    solver: Literal["auto", "z3", "structural"] | None = None
    rlimit: Annotated[int, Field(ge=1, le=MAX_RLIMIT)] | None = None
    max_scenarios: Annotated[int, Field(ge=0)] | None = None
    from_response: bool | None = None
    capabilities: list[str] | None = None
    builtin_capabilities: bool | None = None
    deadline: _Positive | None = None
    energy_limit: _Positive | None = None
    baseline: str | None = None
    max_bytes: _AtLeastOne | None = None
    max_depth: _AtLeastOne | None = None
    max_elements: _AtLeastOne | None = None
    max_attributes: _AtLeastOne | None = None
    max_attribute_length: _AtLeastOne | None = None
    color: Literal["auto", "always", "never"] | None = None
