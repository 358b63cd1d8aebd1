"""Plans on fabric-v3: its names, its validation in checks and gates, its runs."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

import gpsfsm
from gpsfsm.analysis.rules.base import control, go, hear, locate, note, plan, runner, tell_pose
from gpsfsm.capabilities.dialects import in_dialect, library_in_dialect
from gpsfsm.capabilities.library import (
    Capabilities,
    Library,
    builtin_capabilities,
    choose_capabilities,
)
from gpsfsm.capabilities.robot import load_profile
from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.cli import main
from gpsfsm.compile.engine_text import EngineReading, read_for_engine
from gpsfsm.execution.journal_read import JournalReader
from gpsfsm.execution.kernel import handed_over
from gpsfsm.execution.queue import Refusal
from gpsfsm.model.engine import Rejected
from gpsfsm.model.plan import Kind
from gpsfsm.porting import port
from gpsfsm.syntax import parse
from tests.capabilities.support import write
from tests.conftest import REPO
from tests.execution.queueing import FAIL, HANG, SLEEP, Bench

if TYPE_CHECKING:
    from pathlib import Path

    from gpsfsm.compile import Compiled
    from gpsfsm.model.finding import Finding

FP, OLD = "fp_perception_capabilities/SpeechRunner", "perception_capabilities/SpeechRunner"
WORDS = "prompt_capabilities/PromptSpeechRunner"
SPEAKS = plan(runner(WORDS, speech_text="Hello.", flush="true"), runner(FP, text="Good morning."))
WORLD = str(REPO / "corpus" / "worlds" / "home.yaml")
UNHEARD = plan(runner(WORDS, speech_text="Hello.", flush="true"), runner(FP))


def findings(text: str, code: str, capabilities: Capabilities | None = None) -> list[Finding]:
    report = check_text(
        text, "plan.xml", CheckOptions(engine="fabric-v3", capabilities=capabilities)
    )
    return [finding for finding in report.findings if finding.rule == code]


# -- validation ------------------------------------------------------------------------------------


def test_a_refusal_is_a_finding_at_the_runner() -> None:
    behind = plan(locate(), control("recovery", locate()), tell_pose(uuid="u"))
    (finding,) = findings(behind, "GP701")
    assert finding.location.line == 6
    assert (
        "RobotPoseRunner at line 4 outputs it, but only through the join of the recovery"
        in finding.message
    )
    assert (
        "engine message: Unsatisfied required runtime input 'x' for capability prompt_cap"
        in finding.message
    )
    assert finding.hint.startswith("put a step that outputs it right before this runner")
    (finding,) = findings(plan(runner(FP)), "GP701")
    assert finding.hint.startswith('write text="…" in the plan, or put a step')
    assert not findings(plan(locate(), tell_pose(uuid="u")), "GP701")
    for engine in ("fabric-v1", "fabric-v2"):
        report = check_text(behind, "plan.xml", CheckOptions(engine=engine))
        assert not [each for each in report.findings if each.rule in ("GP701", "GP710")]


def test_the_same_by_every_entrance(tmp_path: Path) -> None:
    text = plan(go(1.0, 2.0), runner(FP))
    file = tmp_path / "plan.xml"
    file.write_text(text, encoding="utf-8")
    report = gpsfsm.check(text, engine="fabric-v3")
    assert "GP701" in {each.rule for each in report.plans[0].findings}
    assert not gpsfsm.gate(text, engine="fabric-v3").accepted
    assert gpsfsm.gate(SPEAKS, engine="fabric-v3").accepted
    words = ("--engine", "fabric-v3", "--format", "json", "--output-file", str(tmp_path / "view"))
    assert main(["view", str(file), "--engine", "fabric-v3", "-o", str(tmp_path / "v.html")]) in (
        0,
        1,
    )
    assert main(["check", str(file), *words[:4]]) == 1
    assert main(["run", str(file), "--engine", "fabric-v3", "--force"]) == 2


def test_a_plan_is_ported_or_the_refusal_is_the_loss() -> None:
    outcome = port(plan(runner(FP)), "fabric-v3")
    assert outcome.text is None
    assert "fabric-v3 rejects the plan" in outcome.losses[0].lost
    integer = plan(runner("nav2_capabilities/WaypointRunner", x="1", y="2.0"))
    ported = port(integer, "fabric-v3")
    assert ported.text is not None
    assert 'x="1.0"' in ported.text
    parallel = plan(go(1.0, 2.0), control("parallel_all", runner(FP, text="a"), go(2.0, 2.0)))
    assert "fabric-v3 starts a unit" in port(parallel, "fabric-v3").losses[0].lost


def test_what_is_missing_at_run_time_is_a_warning() -> None:
    (finding,) = findings(UNHEARD, "GP710")
    assert (finding.severity.value, finding.location.line) == ("warning", 3)
    assert "the output is called 'speech'" in finding.message
    assert finding.hint == 'write text="…" in the plan'
    (finding,) = findings(plan(hear(), control("recovery", note(uuid="u"))), "GP710")
    assert "'text' comes with SUCCEEDED, but this step is triggered by FAILED" in finding.message
    (finding,) = findings(plan(runner(WORDS, task="Hello.", flush="true")), "GP710")
    assert "'task' is another name of the input 'speech_text'" in finding.message
    assert not findings(SPEAKS, "GP710")


# -- names -----------------------------------------------------------------------------------------


def test_the_newest_names_are_its_own() -> None:
    assert not findings(SPEAKS, "GP208")
    (finding,) = findings(plan(runner(OLD, text="a")), "GP208")
    assert finding.severity.value == "warning"
    assert finding.message == f"'{OLD}' is called '{FP}' on fabric-v3"
    assert not [
        each
        for each in check_text(plan(runner(OLD, text="a")), "plan.xml", CheckOptions()).findings
        if each.rule == "GP208"
    ]


def test_the_built_in_library_in_the_dialect() -> None:
    builtin = builtin_capabilities()
    there = in_dialect(builtin, "fabric-v3")
    assert in_dialect(there, "fabric-v3") is there
    for engine in ("paper", "fabric-v1", "fabric-v2"):
        assert in_dialect(builtin, engine) is builtin
    names = set(there.library.interface_names)
    assert FP in names
    assert not {name for name in names if name.startswith("perception_capabilities/")}
    assert there.library.translation(OLD) == FP
    assert len(names) == len(builtin.library.interface_names)
    speech = there.library.provider(WORDS)
    assert speech is not None
    assert [each.name for each in speech.configuration] == ["speech_text", "uuid", "flush"]
    assert [(each.name, each.aliases) for each in speech.outputs] == [("speech", ("text",))]
    assert speech.inputs[0].fallback == "speech_text"
    assert "speech_text='$speech_text'" in speech.command
    assert speech.effects.prompt_buffer is not None
    assert speech.effects.prompt_buffer.answer == "speech"
    looks = there.library.provider("fp_perception_capabilities/ImageAnalysisRunner")
    assert looks is not None
    assert looks.effects.question == "prompt", "it still asks what it asked"


def test_files_of_the_user_keep_their_names(tmp_path: Path) -> None:
    write(
        tmp_path / "perception_capabilities",
        {
            "interfaces/SpeechRunner.yaml": "name: SpeechRunner\nspec_type: interface\n",
            "providers/SpeechRunner.yaml": "name: SpeechRunner\nspec_type: provider\n"
            f"implements: {OLD}\n",
        },
    )
    capabilities = choose_capabilities([tmp_path])
    names = library_in_dialect(capabilities.library, "fabric-v3").interface_names
    assert OLD in names
    assert FP not in names
    alone = choose_capabilities([tmp_path], builtin=False)
    assert library_in_dialect(alone.library, "fabric-v3") is alone.library


@pytest.mark.parametrize(("listed", "name"), [("", FP), (f"runners: [{OLD}]\n", OLD)])
def test_a_robot_has_the_names_of_its_engine_or_of_its_list(
    tmp_path: Path, listed: str, name: str
) -> None:
    file = tmp_path / "robot.yaml"
    file.write_text(f"name: lab\nengine: fabric-v3\n{listed}", encoding="utf-8")
    assert load_profile(file).settings["engine"] == "fabric-v3"
    capabilities = choose_capabilities((), robot=file)
    assert name in capabilities.library.interface_names
    other = OLD if name == FP else FP
    (finding,) = findings(plan(runner(other, text="a")), "GP208", capabilities)
    assert finding.severity.value == "error"
    assert finding.message == f"'{other}' is called '{name}' on the robot 'lab'"
    assert not findings(plan(runner(name, text="a")), "GP701", capabilities)
    (finding,) = findings(plan(runner("nav2_capabilities/Fly")), "GP701", capabilities)
    assert (
        "engine message: Unmatched interface: nav2_capabilities/Fly provider: nav2"
        in finding.message
    )
    if not listed:
        speech = capabilities.library.provider(WORDS)
        assert speech is not None
        assert speech.outputs[0].name == "speech"


# -- runs ------------------------------------------------------------------------------------------


def test_an_output_goes_by_the_name_that_its_provider_declares() -> None:
    library = in_dialect(builtin_capabilities(), "fabric-v3").library
    (element,) = (each for each in parse(SPEAKS).plan.elements if each.interface == WORDS)  # type: ignore[union-attr]
    binding = library.bind(element)
    assert binding is not None
    assert handed_over(binding, succeeded=True, outputs={"text": "Hi."}) == {"speech": "Hi."}
    assert handed_over(binding, succeeded=True, outputs={"speech": "Ho.", "text": "Hi."}) == {
        "speech": "Ho."
    }
    assert handed_over(binding, succeeded=False, outputs={"text": "Hi."}) == {}
    assert element.kind is Kind.RUNNER


@pytest.mark.parametrize(("engine", "end"), [("fabric-v2", "COMPLETED"), ("fabric-v3", "HANG")])
def test_speech_is_handed_over_by_its_name_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], engine: str, end: str
) -> None:
    """The older engine calls it text, which is what is said; here there is nothing to say."""
    file, journal = tmp_path / "a.xml", tmp_path / "j.db"
    file.write_text(UNHEARD, encoding="utf-8")
    words = ("--engine", engine, "--force", "--world", WORLD, "--format", "plain")
    main(["run", str(file), *words, "--journal", str(journal)])
    out = capsys.readouterr().out
    assert out.splitlines()[-1].startswith(f"{end} after ")
    assert ("there is nothing to say" in out) is (end == "HANG")
    assert main(["replay", str(journal)]) == 0
    assert "simulated again" in capsys.readouterr().out


def test_a_plan_that_generates_the_next_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The next plan is queued, and judged and run for the same engine."""
    generate = runner(
        "fabric_capabilities/FabricGeneratePlanRunner", task="Go on.", uuid="u", flush="true"
    )
    text = plan(note(text="Be quick.", uuid="u"), generate)
    assert not findings(text, "GP701")
    good = plan(go(0.0, 0.0))
    again = control("recovery", go(0.0, 1.0)), control("recovery", go(1.0, 0.0))
    refused = plan(go(0.0, 0.0), *again)  # by the paper nothing is wrong with it
    answers = tmp_path / "answers.jsonl"
    rows = [{"task": "Go on.", "answer": answer} for answer in (refused, good)]
    answers.write_text("".join(f"{json.dumps(row)}\n" for row in rows), encoding="utf-8")
    file, journal = tmp_path / "a.xml", tmp_path / "j.db"
    file.write_text(text, encoding="utf-8")
    words = ["--engine", "fabric-v3", "--world", WORLD, "--model", f"replay:{answers}"]
    assert main(["run", str(file), *words, "--journal", str(journal)]) == 0
    out = capsys.readouterr().out
    assert "says: attempt 1 was rejected: GP703: this plan behaves differently" in out, out
    with JournalReader(str(journal)) as reader:
        runs = list(reader.runs())
        assert [str(run.status) for run in runs] == ["COMPLETED", "COMPLETED"]
        assert [run.options["engine"] for run in runs] == ["fabric-v3"] * 2
        assert reader.content(runs[1], "plan").decode() == good.strip()


def admitted(text: str, _name: str = "") -> Compiled | Refusal:
    """Admits plans as the engine compiles them."""
    reading = read_for_engine(text, "fabric-v3", "plan.xml", Library())
    if isinstance(reading, EngineReading):
        return reading.compiled
    return Refusal((str(reading.result),))


def test_a_plan_that_is_cancelled_frees_its_runners_and_the_queue_goes_on() -> None:
    bench = Bench(gate=admitted)
    for text in (HANG, FAIL, SLEEP):
        bench.queue.submit(text)
    bench.queue.at(5_000_000, lambda: bench.queue.cancel(1, "enough"))
    bench.queue.run_all()
    assert bench.statuses() == ["CANCELLED", "HANG", "COMPLETED"]


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ((locate(), tell_pose()), ""),
        ((tell_pose(),), ""),
        ((note(text="a"),), ""),
        ((locate(), note()), "Unsatisfied required runtime input 'text' for capability prompt"),
        ((runner("fabric_capabilities/FabricGeneratePlanRunner", task="a"),), ""),
        ((runner("a/Fly"),), "Unmatched interface: a/Fly provider: a/Fly combination"),
    ],
)
def test_the_published_files(shared_corpus: Path, steps: tuple[str, ...], message: str) -> None:
    """They require one input, the text of a PromptTextRunner."""
    capabilities = choose_capabilities([shared_corpus / "capabilities"], builtin=False)
    reading = read_for_engine(plan(*steps), "fabric-v3", "plan.xml", capabilities.library)
    assert isinstance(reading, EngineReading) is not bool(message)
    if not isinstance(reading, EngineReading):
        assert isinstance(reading.result, Rejected)
        assert reading.result.message.startswith(message)
    assert [
        (each.name, wanted.name)
        for each in capabilities.library.providers
        for wanted in each.inputs
        if wanted.demanded
    ] == [("prompt_capabilities/PromptTextRunner", "text")]
