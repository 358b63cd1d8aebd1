"""The prompt server of a robot (prompt_tools), over ROS 2: the model that the robot itself asks.

The service is ``prompt/prompt`` of prompt_msgs, in the namespace of the robot. A request is sent
alone: the buffers of a run are kept by the run (semantics, section 8.3), not by the server.
"""

from __future__ import annotations

import asyncio
import time
from typing import TYPE_CHECKING, Any

from gpsfsm.generation.language_model import Answer, ModelError, Usage, cost_of, estimated_tokens
from gpsfsm.generation.providers import Provider
from gpsfsm.generation.providers.dialect import without_thoughts
from gpsfsm.model.printable import clip
from gpsfsm.ros.node import RosError, process_node
from gpsfsm.ros.services import Service

if TYPE_CHECKING:
    from gpsfsm.generation.language_model import LanguageModel, Request
    from gpsfsm.generation.providers import ModelSettings, Rendered

_SERVICE = "prompt/prompt"
_TYPE = "prompt_msgs/srv/Prompt"
_DEFAULT = "default"
"""The name of the model that the server is configured with."""


class PromptServer:
    """A model behind the prompt server of a robot; ``family`` is what the server calls it."""

    def __init__(self, family: str, settings: ModelSettings) -> None:
        self._family = family
        self._settings = settings
        self._service: Service | None = None

    @property
    def name(self) -> str:
        """The provider and the family."""
        return f"prompt-tools:{clip(self._family, 200)}"

    @property
    def context_tokens(self) -> int | None:
        """As much as the settings say."""
        return self._settings.context_tokens

    async def close(self) -> None:
        """Let go of the client; the node stays for those who act."""
        service, self._service = self._service, None
        if service is not None:
            await service.close()

    async def answer(self, request: Request) -> Answer:
        """Ask. Raises ModelError if the server is not there, does not answer or says no."""
        began = time.monotonic()
        try:
            if self._service is None:
                node = await asyncio.to_thread(process_node)
                self._service = await Service.open(node, _SERVICE, (_TYPE,))
            response = await self._service.ask(self._values(request), self._settings.timeout_s)
        except TimeoutError:
            raise ModelError(
                f"{self.name}: no answer within {self._settings.timeout_s:g} s", again=True
            ) from None
        except RosError as error:
            raise ModelError(f"{self.name}: {error}") from None
        return self._read(response.response, request, time.monotonic() - began)

    def _values(self, request: Request) -> dict[str, Any]:
        text = "\n\n".join(turn.text for turn in request.messages)
        family = "" if self._family == _DEFAULT else self._family
        return {"prompt.prompt": text, "prompt.model_family": family}

    def _read(self, response: Any, request: Request, seconds: float) -> Answer:
        text = without_thoughts(response.response)
        if response.buffered:
            raise ModelError(f"{self.name}: the server has kept the prompt and has not sent it")
        if not text.strip():
            raise ModelError(f"{self.name}: the answer is empty", again=True, empty=True)
        if not response.success:
            raise ModelError(f"{self.name}: the server says that it failed: {clip(text, 200)}")
        prompt = sum(estimated_tokens(turn.text) for turn in request.messages)
        usage = Usage(prompt, estimated_tokens(text), estimated=True)
        return Answer(
            text=text,
            model=self._family,
            usage=usage,
            latency_s=seconds,
            raw=response.response,
            cost=cost_of(usage, self._settings),
        )


def _make(model: str, settings: ModelSettings, _: Rendered | None) -> LanguageModel:
    return PromptServer(model, settings)


PROVIDER = Provider("prompt-tools", _make, default_model=_DEFAULT)
