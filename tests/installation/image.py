"""The steps of a Dockerfile, run without an engine of containers: each in a root of its own.

A root is a folder with this machine's system, read-only, in the place of the base image, and what
the steps have written. It is entered by chroot, in a mount namespace that ends with the command, so
this needs root on Linux. A step that this module does not know is a mistake.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from dataclasses import dataclass, field
from fnmatch import fnmatch
from pathlib import Path

__all__ = ["Image", "Step", "build", "can_build", "steps"]

_SYSTEM = ("bin", "etc", "lib", "lib32", "lib64", "sbin", "usr", sys.base_prefix.lstrip("/"))
"""The last one is Python, which the base image has."""
_PASSED_ON = ("PIP_", "SSL_", "REQUESTS_", "HTTP_PROXY", "HTTPS_PROXY", "NO_PROXY")
_VARIABLE = re.compile(r"\$(\w+)")
_LOOPBACK_UP = """
import fcntl, socket, struct
with socket.socket() as one: fcntl.ioctl(one, 0x8914, struct.pack("16sh14x", b"lo", 1))
"""
"""A new network has a loopback that is down: this is ``ip link set lo up``."""


@dataclass(frozen=True)
class Step:
    """An instruction and its text, continued lines joined."""

    name: str
    text: str

    def words(self) -> list[str]:
        """The text as a list of JSON, else as words of a shell."""
        return json.loads(self.text) if self.text.startswith("[") else shlex.split(self.text)


@dataclass
class Image:
    """A root, and what its steps say about the process that is to run in it."""

    root: Path
    environment: dict[str, str] = field(default_factory=dict)
    folder: str = "/"
    user: str = "0:0"
    labels: dict[str, str] = field(default_factory=dict)
    volumes: list[str] = field(default_factory=list)
    ports: list[str] = field(default_factory=list)
    health: list[str] = field(default_factory=list)
    entry: list[str] = field(default_factory=list)
    command: list[str] = field(default_factory=list)

    def start(
        self, words: list[str], *, environment: dict[str, str], log: Path
    ) -> subprocess.Popen[bytes]:
        """Start a process as a container with a read-only root does, without capabilities.

        It has a network of its own, so that its port is free.
        """
        writable = "".join(
            f"mount --bind {shlex.quote(str(self.root) + each)}{{,}}\n" for each in self.volumes
        )
        python = shlex.join([sys.executable, "-c", _LOOPBACK_UP])
        read_only = (
            f"{python}\n{writable}mount -o remount,bind,ro $root\nmount -t tmpfs tmpfs $root/tmp\n"
        )
        with log.open("wb") as output:
            return subprocess.Popen(
                self._inside(words, prepared=read_only),
                env={**self.environment, **environment},
                stdout=output,
                stderr=subprocess.STDOUT,
            )

    def run(
        self, words: list[str], *, beside: subprocess.Popen[bytes] | None = None
    ) -> subprocess.CompletedProcess[str]:
        """Run a step; or a command in the network of a process that was started."""
        network = [] if beside is None else ["nsenter", f"--target={_child(beside)}", "--net"]
        return subprocess.run(
            [*network, *self._inside(words)],
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )

    def _inside(self, words: list[str], prepared: str = "") -> list[str]:
        root = shlex.quote(str(self.root))
        user, _, group = self.user.partition(":")
        system = "".join(
            f"mount --rbind -o ro /{each} $root/{each}\n"
            for each in _SYSTEM
            if Path(f"/{each}").is_dir() and not Path(f"/{each}").is_symlink()
        )
        free = " ".join(
            ("setpriv", f"--reuid={user}", f"--regid={group or user}", "--clear-groups")
            + (("--no-new-privs", "--bounding-set=-all", "--inh-caps=-all") if prepared else ())
        )
        # the search path of the image holds for what runs in it, not for these tools
        script = f"""
set -eu
root={root} wanted=$PATH
PATH=/usr/sbin:/usr/bin:/sbin:/bin
mount --bind $root $root
{prepared}{system}mount --rbind /dev $root/dev
mount -t proc proc $root/proc
exec chroot $root {free} env PATH="$wanted" /bin/sh -c 'cd "$1"; shift; exec "$@"' sh "$@"
"""
        apart = ["--mount", "--pid", "--fork", "--kill-child", *(["--net"] if prepared else [])]
        return ["unshare", *apart, "bash", "-c", script, "sh", self.folder, *words]


def _child(process: subprocess.Popen[bytes]) -> str:
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text("ascii").split()
    return (children or [str(process.pid)])[0]


def can_build() -> bool:
    """Whether this process may mount and change its root."""
    if not sys.platform.startswith("linux") or os.geteuid() != 0:
        return False
    if not all(map(shutil.which, ("unshare", "nsenter", "setpriv", "chroot"))):
        return False
    tried = ["unshare", "--mount", "--pid", "--fork", "sh", "-c", "mount -t tmpfs tmpfs /mnt"]
    return subprocess.run(tried, capture_output=True, check=False).returncode == 0


def steps(file: Path) -> list[Step]:
    """The instructions of a Dockerfile."""
    lines = [line for line in file.read_text("utf-8").splitlines() if not line.startswith("#")]
    joined = re.sub(r"\s*\\\n\s*", " ", "\n".join(lines))
    return [Step(*line.split(maxsplit=1)) for line in joined.splitlines() if line.strip()]


def build(file: Path, context: Path, away: Path) -> Image:
    """Run the steps of a Dockerfile with what its .dockerignore leaves of the context."""
    stages: dict[str, Image] = {}
    image = Image(away)
    for step in steps(file):
        words = step.words()
        if step.name == "FROM":
            name = words[2] if words[1:2] == ["AS"] else "last"
            image = stages[name] = _begin(away / name, words[0])
        elif step.name == "COPY":
            _copy(image, words, context, stages)
        else:
            _apply(image, step)
    return image


def _begin(root: Path, base: str) -> Image:
    assert re.fullmatch(r"python:3\.\d+-slim-\w+", base), base
    for name in ("data", "dev", "opt", "proc", "run", "tmp", "var"):
        (root / name).mkdir(parents=True)
    (root / "data").rmdir()
    for name in _SYSTEM:
        system = Path("/") / name
        if system.is_symlink():
            (root / name).symlink_to(system.readlink())
        elif system.is_dir():
            (root / name).mkdir(parents=True, exist_ok=True)
    passed = {
        name: text for name, text in os.environ.items() if name.upper().startswith(_PASSED_ON)
    }
    python = f"{Path(sys.base_prefix) / 'bin'}:/usr/sbin:/usr/bin:/sbin:/bin"
    return Image(root, {"PATH": python, **passed})


def _apply(image: Image, step: Step) -> None:
    text, words = step.text, step.words() if step.name not in ("RUN", "HEALTHCHECK") else []
    match step.name:
        case "RUN":
            done = image.run(["/bin/sh", "-c", text])
            assert done.returncode == 0, f"{text}\n{done.stdout}{done.stderr}"
        case "ENV":
            for name, value in _pairs(words).items():
                filled = _VARIABLE.sub(lambda actual: image.environment[actual[1]], value)
                image.environment[name] = filled
        case "LABEL":
            image.labels |= _pairs(words)
        case "USER":
            image.user = text
        case "WORKDIR":
            image.folder = text
            (image.root / text.lstrip("/")).mkdir(parents=True, exist_ok=True)
        case "VOLUME":
            image.volumes += words
        case "EXPOSE":
            image.ports += words
        case "HEALTHCHECK":
            image.health = json.loads(text.partition(" CMD ")[2])
        case "ENTRYPOINT":
            image.entry = words
        case "CMD":
            image.command = words
        case _:
            assert step.name == "STOPSIGNAL", f"this builder does not know {step.name}"


def _copy(image: Image, words: list[str], context: Path, stages: dict[str, Image]) -> None:
    of = next((word.partition("=")[2] for word in words if word.startswith("--from=")), None)
    *sources, target = (word for word in words if not word.startswith("--"))
    place = image.root / os.path.join(image.folder, target).lstrip("/")  # noqa: PTH118
    for source in sources:
        if of is None:
            assert _sent(source), f".dockerignore leaves {source} out"
            there, ignored = context / source, shutil.ignore_patterns("__pycache__", "*.egg-info")
        else:
            there, ignored = stages[of].root / source.lstrip("/"), None
        if there.is_dir():
            shutil.copytree(there, place, symlinks=True, ignore=ignored, dirs_exist_ok=True)
        else:
            shutil.copy2(there, place / there.name if target.endswith("/") else place)


def _pairs(words: list[str]) -> dict[str, str]:
    return dict(word.split("=", 1) for word in words)


def _sent(name: str) -> bool:
    """Whether the context holds it: the last line of .dockerignore that fits decides."""
    sent = True
    for line in (Path(__file__).parents[2] / ".dockerignore").read_text("utf-8").splitlines():
        if line and not line.startswith("#") and fnmatch(name, line.removeprefix("!")):
            sent = line.startswith("!")
    return sent
