"""Settings that all tests share."""

from __future__ import annotations

import gc
import importlib
import os
import signal
import threading
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import HealthCheck, settings

from tests.cases import many

if TYPE_CHECKING:
    from collections.abc import Generator

# The same cases every time: whoever runs the suite gets the answer that everybody gets.
settings.register_profile(
    "fixed",
    deadline=None,
    max_examples=many(50),
    derandomize=True,
    suppress_health_check=[HealthCheck.too_slow],
)
# Other cases every time, and what failed once is tried first: make fuzz.
settings.register_profile("fresh", deadline=None, max_examples=50, print_blob=True)
settings.register_profile("nightly", deadline=None, max_examples=5_000, print_blob=True)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))

for _each in (signal.SIGHUP, signal.SIGINT, signal.SIGQUIT):
    # The processes that tests start get these signals, also below nohup or in the background of a
    # shell. A handler of Python is not inherited, but a signal that is ignored is.
    if signal.getsignal(_each) is signal.SIG_IGN:
        signal.signal(_each, lambda *_: None)

# No test depends on what the developer has configured.
os.environ["XDG_CONFIG_HOME"] = os.devnull

# Collecting twelve thousand tests makes millions of objects, none of them garbage: to look for some
# meanwhile is a third of the work, and to look through them again later slows every test down.
gc.disable()

REPO = Path(__file__).parents[1]
SHARED = REPO.parent / "shared" / "corpus"


@pytest.fixture(scope="session")
def shared_corpus() -> Path:
    """Real plans and model answers, which are not part of this repository."""
    if not SHARED.is_dir():
        pytest.skip("the corpus of real plans (../shared/corpus) is not here")
    return SHARED


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark what needs a browser: all that stands in a folder of this name."""
    for item in items:
        if "browser" in item.path.parts:
            item.add_marker(pytest.mark.browser)


@pytest.hookimpl(optionalhook=True)  # of pytest-xdist, for ``-n auto``
def pytest_xdist_auto_num_workers() -> int | None:
    """Two on each core, or four more than cores: tests wait for processes a third of their time."""
    if os.environ.get("PYTEST_XDIST_AUTO_NUM_WORKERS"):
        return None
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return min(2 * (cores or 1), (cores or 1) + 4)


def pytest_collectstart(collector: pytest.Collector) -> None:
    """Of many workers each begins with modules of its own.

    pytest compiles the tests anew after every change, and each worker would compile all of them:
    so one of four compiles a fourth, and then reads what the others have compiled meanwhile.
    """
    worker = getattr(collector.config, "workerinput", None)
    whole = collector.config.args == collector.config.getini("testpaths")
    if worker is not None and whole and isinstance(collector, pytest.Session):
        first = int(worker["workerid"].removeprefix("gw"))
        for file in sorted(REPO.glob("tests/**/test_*.py"))[first :: worker["workercount"]]:
            with suppress(Exception, pytest.skip.Exception):  # collecting it will tell
                importlib.import_module(".".join(file.relative_to(REPO).with_suffix("").parts))


HANGS_S = 900.0
"""A test that has not ended by then waits for what never comes: it fails, and the others go on."""


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Generator[None, None, None]:
    """End a test that would keep the whole suite from its end."""
    if not hasattr(signal, "SIGALRM") or threading.current_thread() is not threading.main_thread():
        return (yield)

    def give_up(*_: object) -> None:
        pytest.fail(f"the test has not ended after {HANGS_S:g} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, HANGS_S)
    try:
        return (yield)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def pytest_collection_finish() -> None:
    """From here on garbage is collected, of what the tests themselves leave."""
    gc.freeze()
    gc.enable()
