"""The gate with a time budget: a process decides; when it is late or gone, that is a refusal."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

import gpsfsm
import gpsfsm.workers.child_process as child_module
from gpsfsm.analysis.options import AnalysisOptions
from gpsfsm.checking import CheckOptions
from gpsfsm.errors import ConfigError, UsageError
from gpsfsm.gating import Gate, GateOptions, Reason, gate_process, gate_text
from gpsfsm.gating.deciding import digests_of
from gpsfsm.gating.gate_process import written

if TYPE_CHECKING:
    from collections.abc import Iterator

RUNNER = '<Runner interface="a/Go" provider="a/Go"/>'
GOOD = f"<Plan>{RUNNER}</Plan>"
WRONG = '<Plan><Runner provider="a/Go"/></Plan>'
HUGE = "<Plan>" + RUNNER * 60_000 + "</Plan>"
"""Takes seconds."""
ACCEPTED = "accepted (structure only: no task was given)"


@pytest.fixture(scope="module")
def gate() -> Iterator[Gate]:
    with Gate(budget_ms=60_000) as process:
        yield process


@pytest.mark.parametrize(
    "text", [GOOD, WRONG, "", "\ud800", "<Plan>", "<Plan/>", b"\xff\x00", HUGE[:90]]
)
def test_it_says_what_would_be_said_here(gate: Gate, text: str | bytes) -> None:
    content = text.encode("utf-8", "surrogatepass") if isinstance(text, str) else text
    assert gate(text, "plän \ud800.xml") == gate_text(content, "plän \ud800.xml")


def test_what_takes_too_long_is_refused_and_the_next_plan_is_decided() -> None:
    with Gate(budget_ms=300) as impatient:
        worker = impatient._worker
        assert worker is not None
        verdict = impatient(HUGE, "huge.xml")
        assert (verdict.accepted, verdict.reason) == (False, Reason.INCONCLUSIVE)
        assert "300 ms" in verdict.message
        assert verdict.digests == digests_of(HUGE, GateOptions())
        assert worker._process.poll() is not None  # it is not left running
        impatient.budget_ms = 60_000
        assert impatient(GOOD, "good.xml").accepted


def test_a_worker_that_dies_is_a_refusal_and_is_replaced(gate: Gate) -> None:
    assert gate(GOOD).accepted
    assert gate._worker is not None
    gate._worker._process.kill()
    gate._worker._process.wait()
    verdict = gate(GOOD)
    assert (verdict.accepted, verdict.reason) == (False, Reason.INCONCLUSIVE)
    assert "has ended" in verdict.message
    assert gate(GOOD).accepted


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux bounds the memory of a process")
def test_what_takes_too_much_memory_is_refused_and_the_next_plan_is_decided() -> None:
    large = b"<Plan><!--" + b"x" * 60_000_000 + b"-->" + RUNNER.encode() + b"</Plan>"
    with Gate(budget_ms=60_000, memory_mb=256) as narrow:
        verdict = narrow(large, "large.xml")
        assert (verdict.accepted, verdict.reason) == (False, Reason.INCONCLUSIVE)
        assert "memory" in verdict.message
        assert narrow(GOOD, "good.xml").accepted


LIAR = """
import sys
from gpsfsm.workers.frames import pack, read
def say(head, body=b""):
    sys.stdout.buffer.write(pack(head, body))
    sys.stdout.buffer.flush()
read(sys.stdin.buffer)
say({{"ready": True}})
read(sys.stdin.buffer)
{answer}
"""


@pytest.mark.parametrize(
    "answer",
    [
        "pass",
        "sys.stdout.buffer.write(b'accepted')",
        "say({})",
        "say({'is': 'verdict'})",
        "say({'is': 'verdict'}, b'null')",
        "say({'is': 'verdict'}, b'{}')",
        "say({'ready': True})",
        "sys.stdout.buffer.write(b'\\xff' * 100)",
        "say({'is': 'verdict'}, open('other.json', 'rb').read())",
    ],
)
def test_a_worker_that_talks_nonsense_is_a_refusal(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, answer: str
) -> None:
    """Also if it is the verdict on another plan."""
    monkeypatch.chdir(tmp_path)
    Path("other.json").write_bytes(written(gate_text(GOOD, "<text>")))
    code = "import sys; sys.path[:] = sys.argv[2:]\n" + LIAR.format(answer=answer)
    monkeypatch.setattr(child_module, "_PROGRAM", code)
    with Gate(budget_ms=60_000) as deceived:
        verdict = deceived(GOOD.replace("Go", "Stop"))
    assert (verdict.accepted, verdict.reason) == (False, Reason.INCONCLUSIVE)


@pytest.mark.parametrize("executable", ["", "/no/such/python", sys.executable])
def test_without_a_worker_there_is_no_acceptance(
    monkeypatch: pytest.MonkeyPatch, executable: str
) -> None:
    monkeypatch.setattr(sys, "executable", executable)
    monkeypatch.setattr(child_module, "_PROGRAM", "raise SystemExit(0)")
    verdict = gpsfsm.gate(GOOD)
    assert (bool(verdict), verdict.reason) == (False, Reason.INCONCLUSIVE)


def test_a_machine_that_can_start_nothing_accepts_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(gate_process, "start_worker", broken)
    verdict = gpsfsm.gate(GOOD)
    assert (bool(verdict), verdict.reason) == (False, Reason.INCONCLUSIVE)
    assert "RuntimeError" in verdict.message


def test_what_cannot_be_handed_over_is_a_refusal() -> None:
    strange = GateOptions(fail_on=lambda: None)  # type: ignore[arg-type]
    with Gate(strange) as gate:
        assert not gate(GOOD)


def test_a_worker_that_never_is_ready_is_a_refusal(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(child_module, "_PROGRAM", "import time; time.sleep(600)")
    monkeypatch.setattr(gate_process, "_START_S", 0.2)
    verdict = gpsfsm.gate(GOOD)
    assert (bool(verdict), verdict.reason) == (False, Reason.INCONCLUSIVE)
    assert "ready" in verdict.message


def test_it_takes_no_module_from_the_current_folder(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A folder of plans may hold a file with the name of a module."""
    for name in ("json", "gpsfsm", "z3", "pickle"):
        (tmp_path / f"{name}.py").write_text("raise SystemExit(0)", encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [entry for entry in sys.path if entry])
    with Gate(budget_ms=60_000) as gate:
        assert gate(WRONG).reason is Reason.FINDINGS
        assert gate(GOOD)


def test_it_works_in_a_script_without_a_main_guard(tmp_path: Path) -> None:
    script = tmp_path / "dispatch.py"
    script.write_text(
        f"import gpsfsm\nprint(gpsfsm.gate({GOOD!r}))\n",
        encoding="utf-8",
    )
    folder = str(Path(gpsfsm.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": folder},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, f"{ACCEPTED}\n", "")


def test_when_the_gate_is_killed_its_worker_ends(tmp_path: Path) -> None:
    code = (
        "from gpsfsm.gating import Gate\n"
        "with Gate(budget_ms=600_000) as gate:\n"
        "    print(gate._worker._process.pid, flush=True)\n"
        f"    gate({HUGE!r}[:6] + '{RUNNER}' * 60_000 + '</Plan>')\n"
    )
    file = tmp_path / "killed.py"
    file.write_text(code.replace(repr(HUGE), "'<Plan>'"), encoding="utf-8")
    folder = str(Path(gpsfsm.__file__).parents[1])
    with subprocess.Popen(
        [sys.executable, str(file)],
        env={**os.environ, "PYTHONPATH": folder},
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        worker = int(process.stdout.readline())
        assert alive(worker)
        process.kill()
    until = time.monotonic() + 30
    while alive(worker) and time.monotonic() < until:
        time.sleep(0.02)
    assert not alive(worker)


def alive(process: int) -> bool:
    stat = Path(f"/proc/{process}/stat")
    try:
        return stat.read_text().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_a_process_is_started_before_anything_heavy_is_loaded() -> None:
    code = "from gpsfsm.gating.gate_process import start_worker\nimport sys\nprint(*sys.modules)"
    folder = str(Path(gpsfsm.__file__).parents[1])
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={**os.environ, "PYTHONPATH": folder},
        capture_output=True,
        text=True,
        check=True,
    )
    loaded = set(done.stdout.split())
    assert "gpsfsm.gating.gate_process" in loaded
    assert (
        not {"gpsfsm.checking.check", "z3", "lxml", "pydantic", "asyncio", "gpsfsm.gating.deciding"}
        & loaded
    )


def test_threads_take_turns(gate: Gate) -> None:
    texts = [GOOD, WRONG] * 4
    actual: dict[int, str] = {}

    def ask(number: int) -> None:
        actual[number] = str(gate(texts[number]))

    threads = [threading.Thread(target=ask, args=(number,)) for number in range(len(texts))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [actual[number] for number in range(8)] == [ACCEPTED, "rejected: findings"] * 4


def test_senseless_options_are_told() -> None:
    structural = AnalysisOptions(solver="structural")
    check = CheckOptions(engine="fabric-v2", analysis=structural, trees=False)
    with Gate(GateOptions(check=check)) as senseless, pytest.raises(UsageError, match="structural"):
        senseless(GOOD)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"budget_ms": 0}, "budget_ms"),
        ({"budget_ms": True}, "budget_ms"),
        ({"budget_ms": 1.5}, "budget_ms"),
        ({"fail_on": "never"}, "fail_on"),
        ({"assume": "never fails"}, "assume takes a list"),
        ({"capabilities": "folder"}, "capabilities takes a list"),
        ({"engine": "v9"}, "no engine"),
        ({"solver": "guess"}, "no solver"),
        ({"ignore": ["nothing"]}, "no rule"),
    ],
)
def test_the_call_refuses_options_that_make_no_sense(options: dict[str, Any], message: str) -> None:
    with pytest.raises(UsageError, match=message):
        gpsfsm.gate(GOOD, **options)


def test_a_gate_needs_some_memory() -> None:
    with pytest.raises(UsageError, match="memory_mb must be from 256"):
        Gate(memory_mb=100)


def test_the_call_takes_texts_and_paths(tmp_path: Path) -> None:
    file = tmp_path / "plan.xml"
    file.write_text(GOOD, encoding="utf-8")
    for plan in (GOOD, GOOD.encode(), file):
        assert gpsfsm.gate(plan, budget_ms=None)
    assert gpsfsm.gate(str(file), budget_ms=None).reason is Reason.FINDINGS  # a text, and no plan
    for missing in (tmp_path, tmp_path / "missing.xml", Path("no\0file"), Path("missing.xml")):
        verdict = gpsfsm.gate(missing)
        assert (bool(verdict), verdict.reason) == (False, Reason.UNREADABLE)
        assert verdict.report is not None
    assert gpsfsm.gate("", budget_ms=None).reason is Reason.FINDINGS
    with pytest.raises(UsageError, match="not a value of type list"):
        gpsfsm.gate([file])  # type: ignore[arg-type]


def test_the_call_is_strict_unless_told_otherwise(tmp_path: Path) -> None:
    tree = '<root BTCPP_format="4"><BehaviorTree ID="a"><Go/></BehaviorTree></root>'
    assert not gpsfsm.gate(tree, budget_ms=None)
    assert gpsfsm.gate(tree, budget_ms=None, allow_trees=True)
    assert gpsfsm.gate("<Plan/>", budget_ms=None).reason is Reason.EMPTY
    assert gpsfsm.gate("<Plan/>", budget_ms=None, allow_empty=True)
    assert gpsfsm.gate(GOOD, budget_ms=None, fail_on="warning")
    assert not gpsfsm.gate(GOOD, budget_ms=None, tolerate=1)
    empty = f"{GOOD.removesuffix('</Plan>')}<Control type='sequential'/></Plan>"
    assert not gpsfsm.gate(empty, budget_ms=None, fail_on="warning")
    quiet = {"fail_on": "warning", "ignore": ["GP109"]}
    assert gpsfsm.gate(empty, budget_ms=None, **quiet)  # type: ignore[arg-type]
    with pytest.raises(ConfigError):
        gpsfsm.gate(GOOD, task=tmp_path / "missing.yaml")
