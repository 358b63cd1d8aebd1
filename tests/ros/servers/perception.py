"""Perception, as its clients see it: four services with answers of a script.

    python -m tests.ros.servers.perception [--package perception_msgs]

``answer`` sets fields of a service's next response, ``hang`` leaves its next request without one.
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

from tests.ros.servers.base import FakeServer, arguments, of_choices
from tests.ros.servers.messages import as_json, filled, type_named

SERVICES = {
    "speech": "PerceptionSpeech",
    "transcription": "PerceptionTranscribe",
    "sentiment_analysis": "PerceptionSentiment",
    "image_analysis": "PerceptionImageAnalysis",
}
USUAL: dict[str, dict[str, Any]] = {
    "speech": {"success": True, "audio": {"sample_rate": 16000, "channels": 1}},
    "transcription": {"success": True, "transcription": "bring the cup"},
    "sentiment_analysis": {"label": "POSITIVE", "score": 0.75, "analyzed_text": "good"},
    "image_analysis": {"response": "a table with a cup"},
}
"""The responses when the script is over."""


class Perception(FakeServer):
    """The four services of one package of interfaces."""

    def __init__(self, package: str) -> None:
        super().__init__("fake_perception")
        self.script: dict[str, list[dict[str, Any] | None]] = {name: [] for name in SERVICES}
        for name, short in SERVICES.items():
            service_type = type_named(f"{package}/srv/{short}")
            self.serve(service_type, f"perception/{name}", partial(self._answer, name))

    def do_answer(self, service: str, **response: Any) -> None:
        self.script[of_choices(service, tuple(SERVICES))].append(response)

    def do_hang(self, service: str) -> None:
        self.script[of_choices(service, tuple(SERVICES))].append(None)

    def _answer(self, name: str, request: Any, response: Any) -> Any:
        self.journal("request", service=name, request=as_json(request))
        present = response.get_fields_and_field_types()
        usual = {field: value for field, value in USUAL[name].items() if field in present}
        answer = self.script[name].pop(0) if self.script[name] else {}
        if answer is None:
            self.hang()
            return response
        return filled(response, usual | answer)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--package", default="fp_perception_msgs")
    Perception(parser.parse_args(arguments()).package).run()
