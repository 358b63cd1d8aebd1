"""A domain of ROS 2 for each test that asks for one."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import pytest

from tests.ros.support import Domain, missing, orphaned, reserved_domain, shared_memory_files

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


@pytest.fixture
def ros(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Domain]:
    """A domain of the test's own; at the end no process and no shared memory of it may be left.

    ``@pytest.mark.parametrize("ros", [{"variants": ("humble",)}], indirect=True)`` sets its fields.
    """
    if reason := missing():
        pytest.skip(reason)
    options = getattr(request, "param", {})
    with reserved_domain() as number:
        before = shared_memory_files()
        domain = Domain(number=number, folder=tmp_path, **options)
        try:
            yield domain
        finally:
            domain.close()
        deadline = time.monotonic() + 10
        while left := orphaned(shared_memory_files() - before):
            # tests beside this one have processes that are about to map a file, or to remove it
            assert time.monotonic() < deadline, f"left in /dev/shm: {sorted(left)}"
            time.sleep(0.1)
