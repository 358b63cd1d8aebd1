"""A domain of ROS 2 for each test that asks for one."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from tests.ros.support import Domain, missing, remove_orphaned, reserved_domain

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark the tests that start processes on ROS 2: they are a group of their own."""
    for item in items:
        if "ros" in getattr(item, "fixturenames", ()):
            item.add_marker("ros")


@pytest.fixture
def ros(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Domain]:
    """A domain of the test's own; at the end no process and no shared memory of it may be left.

    ``@pytest.mark.parametrize("ros", [{"variants": ("humble",)}], indirect=True)`` sets its fields.
    """
    if reason := missing():
        pytest.skip(reason)
    options = getattr(request, "param", {})
    with reserved_domain() as number:
        domain = Domain(number=number, folder=tmp_path, **options)
        remove_orphaned(domain.ports())
        try:
            yield domain
        finally:
            domain.close()
