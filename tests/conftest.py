"""Settings that all tests share."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

settings.register_profile("dev", deadline=None, max_examples=50)
settings.register_profile(
    "ci",
    deadline=None,
    max_examples=50,
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile("nightly", deadline=None, max_examples=5_000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "dev"))

for _each in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
    # The processes that tests start get these signals, also below nohup or in the background of a
    # shell. A handler of Python is not inherited, but a signal that is ignored is.
    if signal.getsignal(_each) is signal.SIG_IGN:
        signal.signal(_each, lambda *_: None)

# No test depends on what the developer has configured.
os.environ["XDG_CONFIG_HOME"] = os.devnull

REPO = Path(__file__).parents[1]
SHARED = REPO.parent / "shared" / "corpus"


@pytest.fixture(scope="session")
def shared_corpus() -> Path:
    """Real plans and model answers, which are not part of this repository."""
    if not SHARED.is_dir():
        pytest.skip("the corpus of real plans (../shared/corpus) is not here")
    return SHARED
