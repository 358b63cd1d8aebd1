"""What a user's machine has when gpsfsm has been released: an index, a release, nothing else."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from gpsfsm.version import REPOSITORY, VERSION
from tests.pipelines.support import REPO, clone, snippets

if TYPE_CHECKING:
    from collections.abc import Iterable

__all__ = ["PAGE", "Released", "make_release", "run", "section"]

PAGE = REPO / "docs" / "install.md"
_DOWNLOADS = f"{REPOSITORY}/releases/download/v{VERSION}/"
_FROM_HERE = ("HOME", "PATH", "PIP_", "UV_", "SSL_", "REQUESTS_", "HTTP", "NO_PROXY", "LANG")


def run(*command: str | Path, cwd: Path, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run a command with nothing of the environment of the tests but what leads to an index."""
    kept = {name: text for name, text in os.environ.items() if name.upper().startswith(_FROM_HERE)}
    return subprocess.run(
        command, cwd=cwd, env={**kept, **environment}, capture_output=True, text=True, check=False
    )


@dataclass(frozen=True)
class Released:
    """A release, in folders of this machine: ``repository`` stands for the one on GitHub."""

    repository: Path
    dist: Path
    assets: Path

    @property
    def wheel(self) -> Path:
        """The wheel."""
        (file,) = self.dist.glob("gpsfsm-*.whl")
        return file

    @property
    def sdist(self) -> Path:
        """The source distribution."""
        (file,) = self.dist.glob("gpsfsm-*.tar.gz")
        return file

    def environment(self, home: Path) -> dict[str, str]:
        """That of a user whose index has the release, and to whom the repository is near."""
        response = os.environ.get("PIP_FIND_LINKS", "")
        return {
            "HOME": str(home),
            "PIP_FIND_LINKS": f"{self.dist} {response}".strip(),
            "UV_FIND_LINKS": str(self.dist),
            "GIT_CONFIG_COUNT": "2",
            "GIT_CONFIG_KEY_0": f"url.file://{self.repository}.insteadOf",
            "GIT_CONFIG_VALUE_0": REPOSITORY,
            "GIT_CONFIG_KEY_1": "safe.directory",
            "GIT_CONFIG_VALUE_1": "*",
        }

    def shell(
        self, script: str, home: Path, *, programs: Iterable[Path] = ()
    ) -> subprocess.CompletedProcess[str]:
        """Run a script of the documentation as this user: as written, but for the downloads."""
        home.mkdir(parents=True, exist_ok=True)
        path = [*map(str, programs), str(home / ".local" / "bin"), os.environ["PATH"]]
        return run(
            *("bash", "-eo", "pipefail", "-c"),
            script.replace(_DOWNLOADS, f"file://{self.assets}/"),
            cwd=home,
            **self.environment(home) | {"PATH": os.pathsep.join(path)},
        )


def make_release(away: Path) -> Released:
    """Build the sdist from a clone, and the wheel from the sdist."""
    repository = clone(away / "repository")
    built = run(sys.executable, "-m", "build", "--outdir", away / "dist", repository, cwd=away)
    assert built.returncode == 0, built.stdout + built.stderr
    assets = away / "assets"
    assets.mkdir()
    for name in ("constraints.txt", "compose.yaml", "packaging/gpsfsm.service"):
        shutil.copy(repository / name, assets)
    sums = subprocess.run("sha256sum -- * > SHA256SUMS", shell=True, cwd=assets, check=True)  # noqa: S602
    assert sums.returncode == 0
    return Released(repository, away / "dist", assets)


def section(heading: str) -> str:
    """The commands that the page shows below a heading, in their order."""
    text = PAGE.read_text("utf-8")
    lines = text.partition(f"\n## {heading}\n")[2].partition("\n## ")[0]
    blocks = [each.text for each in snippets(PAGE) if each.language == "sh" and each.text in lines]
    assert blocks, f"{PAGE.name} shows no commands below {heading}"
    return "".join(blocks)
