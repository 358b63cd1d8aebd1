"""Which buffer a prompt fills or flushes, where the value is read in several ways."""

from __future__ import annotations

import pytest

from gpsfsm.analysis.flow import prompts_of
from gpsfsm.capabilities.library import Library
from gpsfsm.compile import compile_plan
from gpsfsm.execution.kernel import parameters
from gpsfsm.model.capability import (
    Effects,
    Input,
    Interface,
    Parameter,
    PromptBuffer,
    Provider,
    ValueType,
)
from gpsfsm.simulation.base import said_true, text_of
from tests import oracle
from tests.support import plan_of

BUFFER = Effects(PromptBuffer("uuid", "flush"))


def asking(uuid: ValueType, flush: ValueType) -> Provider:
    return Provider(
        "d/Ask",
        "d/Ask",
        described=True,
        configuration=(
            Parameter("u", uuid),
            Parameter("uuid", uuid),
            Parameter("flush", flush),
        ),
        inputs=(Input("uuid", uuid, fallback="u"),),
        effects=BUFFER,
    )


@pytest.mark.parametrize(
    ("words", "kind", "uuid"),
    [
        ("uuid=01", ValueType.STRING, "01"),
        ("u=01", ValueType.STRING, "01"),
        ("u=true", ValueType.STRING, "true"),
        ("u=01", ValueType.ANY, "01"),
        ("uuid=01", ValueType.INT, "1"),
        ("u=true", ValueType.BOOL, "true"),
        ("u=1", ValueType.DOUBLE, "1.0"),
        ("", ValueType.STRING, ""),
    ],
)
@pytest.mark.parametrize("flush", ["true", "false", None])
@pytest.mark.parametrize("flushing", [ValueType.BOOL, ValueType.STRING, ValueType.ANY])
def test_the_buffer_is_the_one_that_a_run_uses(
    words: str, kind: ValueType, uuid: str, flush: str | None, flushing: ValueType
) -> None:
    library = Library((Interface("d/Ask"),), (asking(kind, flushing),))
    text = " ".join(["d/Ask", *([words] if words else []), *([f"flush={flush}"] if flush else [])])
    plan = plan_of(oracle.plan(oracle.R(text, provider="d/Ask")))
    binding = library.bind(plan.runners[0])
    prompts = prompts_of(compile_plan(plan, bindings=(binding,)))
    assert prompts is not None
    (prompt,) = prompts.all
    assert (prompt.uuid, prompt.flush) == (uuid, flush == "true")
    used = parameters(plan.runners[0], binding, {})
    assert text_of(used.get("uuid")) == uuid
    assert said_true(used.get("flush")) == (flush == "true")
