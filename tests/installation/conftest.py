"""A release and the tools that install from it, made once."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

import pytest

from tests.installation.support import Released, make_release, run

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture(scope="session")
def released(tmp_path_factory: pytest.TempPathFactory) -> Released:
    """Its packages are built: that takes a third of a minute."""
    return make_release(tmp_path_factory.mktemp("released"))


@pytest.fixture(scope="session")
def tools(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the programs pipx, uv and pre-commit."""
    folder = tmp_path_factory.mktemp("tools")
    made = run(sys.executable, "-m", "venv", folder, cwd=folder)
    assert made.returncode == 0, made.stderr
    done = run(folder / "bin" / "pip", "install", "-q", "pipx", "pre-commit", "uv", cwd=folder)
    assert done.returncode == 0, done.stderr
    return folder / "bin"
