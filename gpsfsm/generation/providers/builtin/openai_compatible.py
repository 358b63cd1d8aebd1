"""Any other server that speaks OpenAI's chat completions; JSON schemas, if it heeds them."""

from __future__ import annotations

from gpsfsm.generation.providers.dialect import ChatDialect
from gpsfsm.generation.providers.http_model import http_provider

PROVIDER = http_provider("openai-compatible", ChatDialect())
