"""PromptTools, as its clients see it: one service, which answers or keeps a prompt for later.

    python -m tests.ros.servers.prompt

``answer`` sets fields of the next response of the model, ``hang`` leaves the next prompt that goes
to the model without one. The journal shows requests, and under ``model`` what the model received.
"""

from __future__ import annotations

import uuid
from typing import Any

from prompt_msgs.srv import Prompt

from tests.ros.servers.base import FakeServer
from tests.ros.servers.messages import as_json, filled


class PromptTools(FakeServer):
    """The service, and the texts that it keeps per conversation."""

    def __init__(self) -> None:
        super().__init__("fake_prompt")
        self.script: list[dict[str, Any] | None] = []
        self.kept: dict[str, list[str]] = {}
        self.serve(Prompt, "prompt/prompt", self._prompt)

    def do_answer(self, **response: Any) -> None:
        self.script.append(response)

    def do_hang(self) -> None:
        self.script.append(None)

    def _prompt(self, request: Prompt.Request, response: Prompt.Response) -> Prompt.Response:
        self.journal("request", request=as_json(request))
        prompt, key = request.prompt, request.uuid
        if not prompt.use_cache:
            return self._ask([prompt.prompt], response)
        if not prompt.flush_cache:
            response.uuid = self._keep(key, prompt.prompt)
            response.response.buffered = True
            return response
        # the texts stay: whoever uses the same uuid once more sends them once more
        return self._ask([*self.kept.get(key, []), prompt.prompt], response)

    def _keep(self, key: str, text: str) -> str:
        key = key or str(uuid.uuid4())
        texts = self.kept.setdefault(key, [])
        texts[-1:] = [f"{texts[-1]} {text}" if texts else text]
        return key

    def _ask(self, texts: list[str], response: Prompt.Response) -> Prompt.Response:
        """The response of the model to all these texts."""
        self.journal("model", texts=texts)
        answer = self.script.pop(0) if self.script else {}
        if answer is None:
            self.hang()
            return response
        usual = {"response": f"answer to: {texts[-1]}", "success": True, "confidence": 0.5}
        filled(response.response, usual | answer)
        return response


if __name__ == "__main__":
    PromptTools().run()
