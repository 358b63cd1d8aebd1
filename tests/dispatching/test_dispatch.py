"""A dispatch as far as it goes without ROS 2; the rest is in ``tests/ros``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from gpsfsm.dispatching import dispatch as dispatching
from gpsfsm.dispatching.dispatch import Dispatch
from gpsfsm.dispatching.gate_node import for_engine
from gpsfsm.gating import GateOptions
from gpsfsm.model.ros import RosSettings
from gpsfsm.ros.fabric import V2
from gpsfsm.ros.node import RosError
from gpsfsm.running.interruption import Interruption
from tests.dispatching.test_mirror import go, plan

if TYPE_CHECKING:
    import pytest


class Server:
    """A server that nothing is to be submitted to."""

    release, root = V2, "/fabric"

    def submit(self, *_: object) -> tuple[str, str]:
        """Fail."""
        raise AssertionError("a plan was submitted")


def test_what_is_interrupted_while_it_is_decided_is_not_submitted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def deaf(*_: object) -> None:
        raise RosError("no events")

    monkeypatch.setattr(dispatching, "subscribe", deaf)
    options = for_engine(GateOptions(), V2.engine)
    settings = Dispatch(options=options, ros=RosSettings(), budget_ms=1_000, memory_mb=256)
    nothing: Any = None
    server: Any = Server()
    text = plan(go(1))
    run = dispatching._Run(settings, options, server, text.encode(), "plan.xml")
    interruption = Interruption()
    interruption.request()
    assert run.go(nothing, text, None, interruption) == 130
    assert "plan.xml: interrupted, so it is not submitted" in capsys.readouterr().err
