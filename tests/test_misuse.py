"""What public functions answer to values of another type than they take."""

from __future__ import annotations

import asyncio
import inspect
from collections.abc import Callable
from typing import Any

import pytest

import gpsfsm
from gpsfsm import Grader, rewards

REPORT = gpsfsm.check("<Plan/>")
PARSED = gpsfsm.parse("<Plan/>")
BUILT_IN = gpsfsm.builtin_capabilities()
TASK = {"interface": "GoRunner", "places": {"A": {"x": 1}}, "steps": [{"do": "A"}]}
GO = '<Plan><Runner interface="a/Go" provider="a/Go"/></Plan>'
check, gate, parse = gpsfsm.check, gpsfsm.gate, gpsfsm.parse
diff, fuzz, generate, run = gpsfsm.diff, gpsfsm.fuzz, gpsfsm.generate, gpsfsm.run
verl_scores = gpsfsm.verl_compute_scores
NO_TEXT = "takes the text of a plan or the path of a file, not "
CALLS: dict[str, list[tuple[Callable[..., Any], Any, dict[str, Any], str]]] = {
    "check": [
        *((check, wrong, {}, "check takes the text of a plan, a path") for wrong in (None, 3, {})),
        *((check, wrong, {}, "check takes paths in a list") for wrong in ([3], ["a.xml", None])),
        (check, REPORT, {}, "not a value of type Report"),
        (check, "<Plan/>", {"limits": 3}, "limits takes a gpsfsm.Limits, not 3"),
        (check, "<Plan/>", {"select": "GP3"}, r"select takes a list of texts, such as select=\["),
        (check, "<Plan/>", {"consistent": "yes"}, "consistent takes True or False, not 'yes'"),
        (check, "<Plan/>", {"rlimit": "5"}, "rlimit takes a whole number, not '5'"),
    ],
    "gate": [
        *((gate, wrong, {}, "gate takes the text of a plan or") for wrong in (None, 3, ["a.xml"])),
        (gate, "<Plan/>", {"allow_empty": 1}, "gate takes True or False as allow_empty, not 1"),
        (gate, "<Plan/>", {"allow_trees": "x"}, "gate takes True or False as allow_trees"),
        (gate, "<Plan/>", {"task": 3}, "gate takes the path of a task file as task, not 3"),
        (gate, "<Plan/>", {"budget_ms": "5"}, "budget_ms must be"),
        (gate, "<Plan/>", {"fail_on": None}, "fail_on must be error or warning"),
    ],
    "parse": [
        *((parse, wrong, {}, "parse takes the text of a plan") for wrong in (None, 3, ["<Plan/>"])),
        (parse, "<Plan/>", {"limits": 3}, "parse takes a gpsfsm.Limits as limits, not 3"),
    ],
    "compile_plan": [
        *(
            (gpsfsm.compile_plan, wrong, {}, "compile_plan takes a plan, not .*parse.*plan is one")
            for wrong in (None, "<Plan/>", PARSED)
        ),
        *(
            (gpsfsm.compile_plan, PARSED.plan, {"bindings": wrong}, "None for each runner")
            for wrong in (3, "x", (None,), (1, 2))
        ),
        (gpsfsm.compile_plan, PARSED.plan, {"start_chain": 1}, "True or False as start_chain"),
    ],
    "render": [
        (gpsfsm.render, "x", {"name": "sarif"}, "render takes a report, not 'x'; gpsfsm.check"),
        (gpsfsm.render, None, {}, "render takes a report, not None"),
        (gpsfsm.render, REPORT.plans[0], {}, r"gpsfsm.Report\(\(it,\)\) is a report of one plan"),
        (gpsfsm.render, REPORT, {"name": None}, "there is no format 'None'; the formats are"),
        (gpsfsm.render, REPORT, {"options": 3}, "render takes a gpsfsm.report.RenderOptions"),
    ],
    "Limits": [
        (lambda value: gpsfsm.Limits(max_bytes=value), wrong, {}, "Limits takes a whole number as")
        for wrong in ("3", None, 1.5, True)
    ],
    "rewards": [
        (rewards, "<Plan/>", {"tasks": TASK}, "rewards takes a list of answers, not '<Plan/>'; re"),
        *((rewards, wrong, {"tasks": TASK}, "a list of answers") for wrong in (None, 3, b"<P/>")),
        (rewards, {"a": 1}, {"tasks": TASK}, "a list of answers"),
        (rewards, ["<Plan/>"], {"tasks": 3}, "a task is the path of a task file"),
    ],
    "reward": [
        (gpsfsm.reward, "<Plan/>", {"task": 3}, "a task is the path of a task file"),
        (gpsfsm.reward, "<Plan/>", {"task": TASK, "shaping": []}, "True or False as shaping"),
    ],
    "verl_compute_score": [
        (gpsfsm.verl_compute_score, "x", {"solution_str": "x", "ground_truth": 3}, "a task is the"),
    ],
    "verl_compute_scores": [
        (verl_scores, [], {"solution_strs": [], "ground_truths": 3}, "a list as ground_truths"),
    ],
    "openrlhf_reward_func": [
        (gpsfsm.openrlhf_reward_func, 3, {"prompts": [], "labels": []}, "a list as queries, not 3"),
        (gpsfsm.openrlhf_reward_func, [], {"prompts": ["x"], "labels": []}, "0 queries, 1 prompts"),
        (
            gpsfsm.openrlhf_reward_func,
            [3],
            {"prompts": ["x"], "labels": [TASK]},
            "texts in queries",
        ),
    ],
    "fix": [
        *((gpsfsm.fix, wrong, {}, f"fix {NO_TEXT}") for wrong in (None, 3, ["a.xml"])),
        (gpsfsm.fix, GO, {"unsafe": 1}, "fix takes True or False as unsafe, not 1"),
        (gpsfsm.fix, GO, {"select": "GP1"}, "select takes a list of texts"),
    ],
    "diff": [
        (diff, None, {"second": GO}, f"diff {NO_TEXT}None"),
        (diff, GO, {"second": 3}, f"diff {NO_TEXT}3"),
        (diff, GO, {"second": GO, "tolerance": "x"}, "a number from 0 on as tolerance, not 'x'"),
        (diff, GO, {"second": GO, "tolerance": -1}, "a number from 0 on as tolerance, not -1"),
        (diff, GO, {"second": GO, "assume": "x"}, "a list as assume, not 'x'"),
        (diff, GO, {"second": GO, "assume": [None]}, "an assumption is a text .*, not None"),
        (diff, GO, {"second": GO, "limits": 3}, "diff takes a gpsfsm.Limits as limits, not 3"),
    ],
    "view": [
        (gpsfsm.view, 3, {}, "view takes the text of a plan, a path, or a list of paths, not 3"),
        (gpsfsm.view, GO, {"diff": True}, "diff compares two plans, not 1"),
        (gpsfsm.view, GO, {"task": 3}, "a task is the path of a task file"),
    ],
    "port": [
        (gpsfsm.port, None, {"engine": "fabric-v2"}, f"port {NO_TEXT}None"),
        (
            gpsfsm.port,
            GO,
            {"engine": "x"},
            "plans cannot be ported to 'x'; the targets are fabric-v1, fabric-v2",
        ),
        (gpsfsm.port, GO, {"engine": "fabric-v2", "unsafe": "x"}, "True or False as unsafe"),
    ],
    "grade": [
        (gpsfsm.grade, None, {"task": TASK}, "grade takes the answer of a model, a path, or a"),
        (gpsfsm.grade, GO, {"task": 3}, "a task is the path of a task file"),
        (gpsfsm.grade, GO, {"task": TASK, "by": "x"}, "there is no column 'x'"),
        (gpsfsm.grade, GO, {"task": TASK, "progress": 3}, "progress takes True, or a function of"),
    ],
    "generate": [
        (generate, 3, {"model": "ollama:x"}, "generate takes a task in words, not 3"),
        (generate, "go", {"model": 3}, "generate takes a model, not 3; model="),
        (generate, "go", {"model": "nobody:x"}, "there is no provider 'nobody'"),
        (generate, "go", {"model": "ollama:x", "facts": "x"}, "a list as facts, not 'x'"),
        (generate, "go", {"model": "ollama:x", "fail_on": "x"}, "fail_on must be error or warning"),
        (generate, " ", {"model": "ollama:x"}, "there is no task"),
        *(
            (generate, "go", {"model": "ollama:x", name: "x"}, f"generate takes .* as {name}, not")
            for name in ("attempts", "candidates", "seed", "mend", "temperature", "max_tokens")
        ),
        (generate, "go", {"model": "ollama:x", "timeout_s": []}, "a number from 0 on as timeout_s"),
    ],
    "fuzz": [
        (fuzz, None, {}, f"fuzz {NO_TEXT}None"),
        (fuzz, "<Plan/>", {}, "the plan has no runner"),
        (fuzz, GO, {"runs": 0}, "fuzz takes a whole number of at least 1 as runs, not 0"),
        (fuzz, GO, {"seed": "x"}, "fuzz takes a whole number as seed, not 'x'"),
        (fuzz, GO, {"time_s": "x"}, "a number from 0 on as time_s, not 'x'"),
        (fuzz, GO, {"limit_s": "x"}, "a number from 0 on as limit_s, not 'x'"),
        (fuzz, GO, {"faults": "late"}, "a list as faults, not 'late'"),
        (fuzz, GO, {"properties": "x"}, "a list as properties, not 'x'"),
        (fuzz, GO, {"properties": [3]}, "a property is its name or a function of a run, not 3"),
        (fuzz, GO, {"progress": 3}, "progress takes True, or a function of"),
    ],
    "resume": [
        *((gpsfsm.resume, wrong, {}, "resume takes the path of a journal") for wrong in (None, 3)),
    ],
    "replay": [
        *((gpsfsm.replay, wrong, {}, "replay takes the path of a journal") for wrong in (None, 3)),
        (gpsfsm.replay, "x.db", {"run": 0}, "a whole number of at least 1 as run, not 0"),
    ],
    "run": [  # tests/running/test_run.py has more
        (run, 3, {}, "plan takes the text of a plan, a path, or a list of them, not 3"),
        (run, GO, {"failure": 2}, "failure takes a probability, from 0 to 1, not 2"),
        (run, GO, {"durability": "x"}, "the durability is one of power, process, none"),
        *(
            (run, None, {"journal": "run.db", name: value}, f"{name} needs a plan: without one")
            for name, value in (("world", "w.yaml"), ("seed", 1), ("failure", 0.5))
        ),
        (run, None, {"journal": "run.db", "timeout_s": 1.0}, "timeout_s needs a plan"),
        (run, None, {"journal": "run.db", "max_plans": 1}, "max_plans needs a plan"),
    ],
    "subject_of": [
        (gpsfsm.subject_of, None, {}, "the text of a plan, or a plan, not None"),
        (gpsfsm.subject_of, GO, {"library": 3}, "takes a gpsfsm.Library as library, not 3"),
        (gpsfsm.subject_of, GO, {"faults": [None]}, "there is no fault 'None'"),
        (gpsfsm.subject_of, GO, {"assumptions": [3]}, "an assumption is a text .*, not 3"),
    ],
    "play": [(gpsfsm.play, None, {"scenario": None}, "play takes a Subject, not None; gpsfsm.sub")],
    "grammars_for": [
        (gpsfsm.grammars_for, None, {}, "takes capabilities, not None; gpsfsm.built"),
        (gpsfsm.grammars_for, BUILT_IN, {"depth": None}, "a whole number as depth, not None"),
        (gpsfsm.grammars_for, BUILT_IN, {"only": "WaitRunner"}, "a list as only"),
        (gpsfsm.grammars_for, BUILT_IN, {"only": [None]}, "takes texts in only, not None"),
    ],
    "write_receipt": [
        (gpsfsm.write_receipt, None, {}, "a list as verdicts, not None"),
        (gpsfsm.write_receipt, ["x"], {}, "takes verdicts of gpsfsm.gate, not 'x'"),
    ],
    "schema_path": [(gpsfsm.schema_path, None, {}, "there is no schema 'None'")],
    "engine_of": [(gpsfsm.engine_of, None, {"items": 3}, "'None' is not a value of --jobs")],
    "gate_text": [
        *(
            (gpsfsm.gate_text, wrong, {"name": "x"}, "takes the text of a plan, not ")
            for wrong in (None, 3, [])
        ),
        (gpsfsm.gate_text, GO, {"name": "x", "options": 3}, "takes gpsfsm.GateOptions as options"),
        (gpsfsm.Gate, 3, {}, "Gate takes gpsfsm.GateOptions as options, not 3"),
    ],
    "Rewards": [
        (lambda value: gpsfsm.Rewards(jobs=value), "x", {}, "a whole number of at least 0 as jobs"),
        (lambda value: gpsfsm.Rewards(timeout_s=value), "x", {}, "a number from 0 on as timeout_s"),
        (lambda value: gpsfsm.Rewards(scale=value), 3, {}, "a gpsfsm.Scale as scale, not 3"),
    ],
    "load_task": [(gpsfsm.load_task, wrong, {}, "cannot be read") for wrong in ("nope.yaml", "")],
    "load_world": [(gpsfsm.load_world, wrong, {}, "cannot be read") for wrong in ("nope.yaml", "")],
    "choose_capabilities": [
        (gpsfsm.choose_capabilities, ["nope"], {}, "nope: cannot be read"),
        *((gpsfsm.choose_capabilities, wrong, {}, "a list as paths") for wrong in (None, 3, "x")),
        (gpsfsm.choose_capabilities, [], {"builtin": "no"}, "True or False as builtin, not 'no'"),
    ],
    "chat_body": [(gpsfsm.chat_body, None, {}, "chat_body takes a gpsfsm.Ask, not None")],
    "printable": [(gpsfsm.printable, wrong, {}, "printable takes a text") for wrong in (None, b"")],
    "rendered": [
        (gpsfsm.rendered, wrong, {}, "a text of JSON, not") for wrong in (None, b"{}", [])
    ],
    "Grader": [
        (Grader, wrong, {}, "Grader takes a task, not .*load_task") for wrong in (None, "t.yaml")
    ],
}


@pytest.mark.parametrize(
    ("call", "value", "more", "message"),
    [
        pytest.param(*each, id=f"{name}-{at}")
        for name in CALLS
        for at, each in enumerate(CALLS[name])
    ],
)
def test_misuse_is_told_with_what_to_pass(
    call: Callable[..., Any], value: Any, more: dict[str, Any], message: str
) -> None:
    with pytest.raises(gpsfsm.UsageError, match=message):
        call(value, **more)


PARTS = {
    *("check_runner", "http_provider", "in_thread", "map_items"),  # for authors
    *("generate_async", "run_async"),  # as generate and run
    *("all_rules", "builtin_capabilities", "relax_ng"),  # take nothing
}


def test_every_public_function_is_misused_here() -> None:
    functions = {name for name in gpsfsm.__all__ if inspect.isfunction(getattr(gpsfsm, name))}
    assert functions - PARTS <= set(CALLS)
    assert set(gpsfsm.__all__) >= PARTS
    assert not inspect.signature(gpsfsm.all_rules).parameters


@pytest.mark.parametrize(
    "call",
    [
        gpsfsm.fix,
        gpsfsm.fuzz,
        gpsfsm.replay,
        gpsfsm.resume,
        gpsfsm.run,
        gpsfsm.view,
        lambda path: gpsfsm.diff(GO, path),
        lambda path: gpsfsm.port(path, "fabric-v2"),
    ],
)
def test_a_file_that_is_not_there_is_named(call: Callable[..., Any]) -> None:
    with pytest.raises(gpsfsm.InputError, match=r"^no/such\.xml: "):
        call("no/such.xml")


@pytest.mark.parametrize("call", [gpsfsm.generate_async, gpsfsm.run_async])
def test_they_refuse_what_the_others_refuse(call: Callable[..., Any]) -> None:
    more = {"model": "ollama:x"} if call is gpsfsm.generate_async else {}
    with pytest.raises(gpsfsm.UsageError, match=r"(generate|plan) takes .*, not 3"):
        asyncio.run(call(3, **more))


def test_an_event_loop_that_runs_is_not_blocked() -> None:
    async def work() -> None:
        gpsfsm.generate("go", model="ollama:x")

    with pytest.raises(gpsfsm.UsageError, match=r"await gpsfsm\.generate_async"):
        asyncio.run(work())
