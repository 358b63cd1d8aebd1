"""Any other server that speaks OpenAI's chat completions; JSON schemas, if it heeds them."""

from __future__ import annotations

from gpsfsm.generation.providers.asking import http_provider
from gpsfsm.generation.providers.chat import ChatDialect

__all__ = ["PROVIDER"]

PROVIDER = http_provider("openai-compatible", ChatDialect())
