"""Plans of all kinds put through every command with options that are drawn: no command breaks.

A user who does nothing but combine plans, commands and options must never meet a traceback, an exit
code that no page knows, a defect of gpsfsm or an answer that changes from run to run. And the
commands must not contradict each other: the gate accepts exactly what a check with the same options
finds no error in, and no run ends in a way that the check calls impossible.
"""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

from gpsfsm.strategies import answers
from gpsfsm.strategies import plans as described_plans
from tests.campaigns.base import Pair
from tests.cli.support import environment
from tests.forked import run_forked
from tests.oracle import to_xml
from tests.strategies import plans, plans_of_few_actions

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from subprocess import CompletedProcess

_ROOT = Path(__file__).resolve().parents[2]
_TASK = str(_ROOT / "docs" / "examples" / "rounds.yaml")
_TIMEOUT_S = 300

Words = tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Case:
    """Two texts, options about scenarios, and command lines in which PLAN and OTHER stand for them.

    ``engine`` and ``seed`` are those of the runs that are compared with the check.
    """

    text: bytes
    other: bytes
    options: Words
    engine: str
    seed: int
    commands: tuple[Words, ...]

    def __str__(self) -> str:
        lines = [f"gpsfsm check --engine {self.engine} {' '.join(self.options)}, seed {self.seed}"]
        lines += [f"gpsfsm {' '.join(words)}" for words in self.commands]
        texts = (text.decode("utf-8", "backslashreplace") for text in (self.text, self.other))
        return "\n".join([*lines, "-- PLAN", next(texts), "-- OTHER", next(texts)])


@cache
def _corpus() -> tuple[bytes, ...]:
    """Plans, trees and what breaks rules; the small ones."""
    files = sorted((_ROOT / "corpus").rglob("*.xml"))
    return tuple(text for text in map(Path.read_bytes, files) if len(text) < 4_000)


@st.composite
def _damaged(draw: st.DrawFn, texts: st.SearchStrategy[bytes]) -> bytes:
    """A text that lacks a part, or holds what does not belong there."""
    text = draw(texts)
    start = draw(st.integers(0, len(text)))
    end = draw(st.integers(start, min(len(text), start + 20)))
    new = draw(st.sampled_from([b"", b"<", b"\x00", b"\xff", b"&x;", b"<Plan>", b'"', b"]]>"]))
    return text[:start] + new + text[end:]


def _texts() -> st.SearchStrategy[bytes]:
    odd = plans(max_runners=6).map(to_xml)
    valid = described_plans(max_runners=5)
    broken = answers(max_defects=3).map(lambda answer: answer.text)
    few = plans_of_few_actions(min_runners=1, max_runners=5).map(to_xml)
    written = st.one_of(odd, few, valid, broken).map(lambda text: text.encode("utf-8", "replace"))
    sound = st.one_of(written, written, st.sampled_from(_corpus()))
    return st.one_of(sound, sound, sound, _damaged(sound))


_PATHS = ("/Plan/Runner[1]", "/Plan/Control[1]/Runner[1]", "/Plan/Control[1]/Runner[2]")
_ASSUMPTIONS = (
    "never fails: SpeechRunner",
    "GoRunner never succeeds",
    "WaypointRunner never fails",
    *(f"{path} fails" for path in _PATHS),
    f"{_PATHS[0]} fails implies {_PATHS[1]} succeeds",
    f"not ({_PATHS[1]} fails and {_PATHS[2]} fails)",
    f"{_PATHS[0]} fails and {_PATHS[0]} succeeds",
    "demo/Go fails",
    "nobody never fails",
    "((",
)
_FAULTS = ("failed", "no-start", "hang", "no-start,hang")
_ENGINES = ("paper", "paper", "fabric-v1", "fabric-v2")
_CHECKS = ("text", "github", "gitlab", "junit", "llm", "markdown", "sarif", "json")
_DRAWINGS = ("tree", "dot", "mermaid", "svg", "json", "connections")
_RULES = ("GP302", "orphan-at-completion", "GP703", "GP999", "")


@st.composite
def _options(draw: st.DrawFn) -> Words:
    """Options about scenarios, which check, gate, fix, grade and view have in common."""
    words: list[str] = []
    if draw(st.integers(0, 2)) == 0:
        words += ["--faults", draw(st.sampled_from(_FAULTS))]
    if draw(st.integers(0, 2)) == 0:
        words.append("--consistent")
    if draw(st.integers(0, 2)) == 0:
        words += ["--assume", draw(st.sampled_from(_ASSUMPTIONS))]
    if draw(st.integers(0, 9)) == 0:
        words += ["--solver", draw(st.sampled_from(("z3", "structural")))]
    if draw(st.integers(0, 9)) == 0:
        words += ["--rlimit", draw(st.sampled_from(("1", "2000")))]
    return tuple(words)


@st.composite
def _command(draw: st.DrawFn, options: Words, engine: str) -> Words:
    """A command line, but for the plan and its options those that are drawn here."""
    name = draw(st.sampled_from(_NAMES))
    of_engine = ("--engine", engine)
    if name == "check":
        form = draw(st.sampled_from(_CHECKS))
        task = draw(st.sampled_from([(), ("--task", _TASK), ("--statistics",), ("--quiet",)]))
        return (name, "--format", form, *of_engine, *task, *options, "PLAN", "OTHER")
    if name == "show":
        return (name, "--format", draw(st.sampled_from(_DRAWINGS)), *of_engine, "PLAN")
    if name == "fix":
        how = draw(st.sampled_from([("--diff",), ("-o", "-"), ("--unsafe-fixes", "--diff")]))
        return (name, *how, *options, "PLAN")
    if name == "port":
        to = draw(st.sampled_from(("fabric-v1", "fabric-v2")))
        how = draw(st.sampled_from([("--diff",), ("--check",), (), ("--unsafe",)]))
        return (name, "--to", to, *how, "PLAN")
    if name == "diff":
        form = draw(st.sampled_from(("text", "json")))
        kept = draw(st.sampled_from([(), ("--consistent",), ("--tolerance", "0.5")]))
        return (name, "--format", form, *kept, "PLAN", draw(st.sampled_from(("OTHER", "PLAN"))))
    if name == "view":
        diff = draw(st.sampled_from([(*of_engine, *options), ("--diff",)]))
        return (name, "-o", "-", *diff, "PLAN", "OTHER")
    if name == "grade":
        table = draw(st.sampled_from(("text", "csv", "md", "json")))
        return (name, "--task", _TASK, "--table", table, *options, "PLAN", "OTHER")
    if name == "mutate":
        return ("fuzz", "--mutate", "--runs", "3", "--format", "json", "PLAN")
    if name == "prompt":
        form = draw(st.sampled_from(("text", "json")))
        return (name, "--format", form, "--example", "PLAN", "Look after the lab.")
    if name == "capabilities":
        more = draw(st.sampled_from([("list",), ("show", "WaypointRunner"), ("check", "PLAN")]))
        return (name, *more)
    return ("rule", *filter(None, (draw(st.sampled_from(_RULES)),)))


_NAMES = ("check", "show", "fix", "port", "diff", "view", "grade", "mutate", "prompt")
_NAMES += ("capabilities", "rule")
_UNCONFIGURED = ("gate", "rule", "capabilities")
"""What has no ``--isolated``."""


@st.composite
def cases(draw: st.DrawFn) -> Case:
    """A case; ``--from-response`` goes with all options or with none."""
    options = draw(_options())
    if draw(st.integers(0, 4)) == 0:
        options += ("--from-response",)
    engine = draw(st.sampled_from(_ENGINES))
    commands = draw(st.lists(_command(options, engine), min_size=1, max_size=3))
    text, other = draw(_texts()), draw(_texts())
    return Case(text, other, options, engine, draw(st.integers(0, 99)), tuple(commands))


class Player:
    """Runs commands on the two texts of a case, each command twice."""

    def __init__(self, case: Case, folder: str) -> None:
        self.folder = Path(folder)
        (self.folder / "plan.xml").write_bytes(case.text)
        (self.folder / "other.xml").write_bytes(case.other)
        self.files = {"PLAN": "plan.xml", "OTHER": "other.xml"}

    def play(self, *words: str) -> CompletedProcess[bytes]:
        """The command's end, which is an honest one, and the same each time."""
        responses = [self.files.get(word, word) for word in words]
        if words[0] not in _UNCONFIGURED:
            responses.insert(1, "--isolated")
        once, again = (self._once(responses) for _ in range(2))
        what = " ".join(responses)
        assert once.returncode in (0, 1, 2), f"{what}: exit code {once.returncode}\n{_said(once)}"
        for sign in (b"Traceback", b"defect of gpsfsm", b"has a defect"):
            assert sign not in once.stderr, f"{what}: {_said(once)}"
        assert b"this is a defect" not in once.stdout, f"{what}: {_said(once)}"
        ends = [(done.returncode, done.stdout, done.stderr) for done in (once, again)]
        assert ends[0] == ends[1], f"{what}: not the same twice"
        return once

    def _once(self, words: list[str]) -> CompletedProcess[bytes]:
        around = environment()
        return run_forked(
            words, cwd=self.folder, stdin=b"", environment=around, timeout_s=_TIMEOUT_S
        )


def _said(done: CompletedProcess[bytes]) -> str:
    return (done.stdout[-2_000:] + b"\n" + done.stderr[-2_000:]).decode("utf-8", "replace")


def judge(case: Case) -> Iterator[str]:
    """No command breaks, and none contradicts another."""
    with tempfile.TemporaryDirectory(prefix="gpsfsm-") as folder:
        player = Player(case, folder)
        yield from _gate(player, case)
        yield from _fuzz(player, case)
        yield from _run(player, case)
        for words in case.commands:
            done = player.play(*words)
            yield f"{words[0]}: {done.returncode}"


def _check(player: Player, *options: str) -> tuple[int, Mapping[str, Any] | None]:
    """The exit code of a check and what it says of the plan; None if it is a usage error."""
    done = player.play("check", "--format", "json", *options, "PLAN")
    return done.returncode, json.loads(done.stdout)["plans"][0] if done.stdout else None


def _gate(player: Player, case: Case) -> Iterator[str]:
    options = (*case.options, "--engine", case.engine)
    code, plan = _check(player, "--allow-suppressions", *options)
    lenient = ("--allow-suppressions", "--allow-trees", "--budget-ms", "600000")
    done = player.play("gate", "--format", "json", *lenient, *options, "PLAN")
    if plan is None:
        assert (code, done.returncode) == (2, 2), "a check refuses its options, the gate does not"
        yield "gate: usage"
        return
    verdict = json.loads(done.stdout)["plans"][0]
    reason = verdict["reason"]
    proved = "structural" not in case.options  # a gate accepts nothing that z3 has not proved
    accepted = code == 0 and reason != "empty" and proved
    assert (reason == "passed") is accepted, f"check ends with {code}, the gate says {reason}"
    assert (done.returncode == 0) is accepted, f"gate: {reason}, exit code {done.returncode}"
    if verdict["facts"] is not None and code != 2:
        assert verdict["facts"] == plan["facts"], "the gate states other facts than the check"
    yield f"gate: {reason}"


def _fuzz(player: Player, case: Case) -> Iterator[str]:
    """What fuzzing meets, by the paper, is among the facts; nothing is stopped for being slow."""
    kept = dict(zip(case.options, case.options[1:], strict=False))
    faults = kept.get("--faults", "failed")
    options = ["--faults", faults]
    options += ["--consistent"] * ("--consistent" in case.options)
    options += ["--assume", kept["--assume"]] if "--assume" in kept else []
    words = ("--seed", str(case.seed), "--runs", "15", "--timeout", "0", "--format", "json")
    wanted = ("--property", "completes", "--property", "ends")
    done = player.play("fuzz", *words, *wanted, *options, "PLAN")
    if not done.stdout:
        yield f"fuzz: {done.returncode}"
        return
    _, plan = _check(player, *options)
    assert plan is not None, "fuzz takes options that check does not"
    ends = [each["scenario"]["ends"] for each in json.loads(done.stdout)["findings"]]
    for end in ends:
        _possible(end, plan)
    yield from (f"fuzz: {end}" for end in ends or ("nothing",))


def _run(player: Player, case: Case) -> Iterator[str]:
    """A run ends in a way that the check calls possible, or is refused where the check refuses."""
    code, plan = _check(player, "--engine", case.engine)
    words = ("--engine", case.engine, "--seed", str(case.seed), "--failure", "0.4")
    for more in ((), ("--force",)):
        done = player.play("run", *words, "--format", "json", *more, "PLAN")
        ends = [
            record["data"]["status"]
            for record in map(json.loads, done.stdout.splitlines())
            if record.get("kind") == "ENDED"
        ]
        assert len(ends) <= 1, "one plan, more than one end"
        for end in ends:
            assert plan is not None
            assert more or code == 0, "a plan with errors is run, and nobody has forced it"
            assert (done.returncode == 0) is (end == "COMPLETED"), f"{end}: {done.returncode}"
            _possible(end, plan)
            yield f"run: {end}"
        if not ends:
            assert done.returncode, "nothing was run, and the exit code is 0"
            yield "run: refused"


_FREQUENCIES = {"COMPLETED": "completes", "GAVE_UP": "gives_up", "STUCK": "stuck"}


def _possible(end: str, plan: Mapping[str, Any]) -> None:
    """The facts of the plan say that a run may end so."""
    facts = plan["facts"]
    assert facts is not None, f"a run ends in {end}, and the check has no facts"
    name = _FREQUENCIES.get(end)
    said = facts[name] if name else facts["engine"]["hangs" if end == "HANG" else "aborts"]
    assert said != "never", f"a run ends in {end}, which the check calls impossible"


PAIR = Pair(
    name="commands",
    about="random plans through every command: honest exit codes, same bytes, no contradictions",
    cases=cases,
    judge=judge,
    text=str,
    full=2_000,
    batch=10,
    few=2,
    attack=True,
)
