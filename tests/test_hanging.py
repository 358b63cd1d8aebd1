"""A test that waits for what never comes fails, so that the suite comes to its end."""

from __future__ import annotations

import asyncio
import time

import pytest

from tests import conftest


@pytest.mark.parametrize("on_a_loop", [False, True])
def test_a_test_that_hangs_fails(monkeypatch: pytest.MonkeyPatch, on_a_loop: bool) -> None:
    monkeypatch.setattr(conftest, "HANGS_S", 0.05)
    call = conftest.pytest_runtest_call()
    next(call)
    with pytest.raises(pytest.fail.Exception, match="has not ended after"):
        asyncio.run(asyncio.sleep(60)) if on_a_loop else time.sleep(60)
    call.close()
