"""gpsfsm: formal checks for robot plans that language models write.

>>> import gpsfsm
>>> gpsfsm.check("<Plan/>").plans[0].verdict.value
'accepted'
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from gpsfsm.model.showing import Make, Show, offer, offer_data
from gpsfsm.version import VERSION

if TYPE_CHECKING:
    from gpsfsm.analysis.options import AnalysisOptions
    from gpsfsm.analysis.rules import Rule, all_rules
    from gpsfsm.api import check
    from gpsfsm.capabilities.library import (
        Capabilities,
        Library,
        builtin_capabilities,
        choose_capabilities,
    )
    from gpsfsm.checking import CheckOptions
    from gpsfsm.compile import Compiled, compile_plan
    from gpsfsm.equivalence import Difference, UndecidedError
    from gpsfsm.errors import (
        AssumptionError,
        ConfigError,
        GpsfsmError,
        InputError,
        InternalError,
        UsageError,
    )
    from gpsfsm.execution.conformance import ConformanceError, check_runner
    from gpsfsm.execution.journal_rows import Row
    from gpsfsm.execution.lane import in_thread
    from gpsfsm.execution.records import Status
    from gpsfsm.execution.runner import RunContext, Runner, RunnerError
    from gpsfsm.fixing import Applied, Fixed
    from gpsfsm.fuzzing import (
        Act,
        Breach,
        Campaign,
        Fate,
        Property,
        Run,
        Subject,
        TimedScenario,
        play,
        subject_of,
    )
    from gpsfsm.fuzzing.campaign_report import CampaignReport
    from gpsfsm.gating import Gate, GateOptions, gate, gate_text
    from gpsfsm.gating.receipts import write_receipt
    from gpsfsm.generation.language_model import (
        Answer,
        Constraint,
        LanguageModel,
        Message,
        ModelError,
        Request,
    )
    from gpsfsm.generation.loop import Attempt, Generated
    from gpsfsm.generation.providers import Provider
    from gpsfsm.generation.providers.dialect import Ask, ChatDialect, GrammarField, chat_body
    from gpsfsm.generation.providers.http_model import http_provider
    from gpsfsm.grading.grade_tables import GradeTable
    from gpsfsm.grading.grader import Grade, Graded, Grader
    from gpsfsm.grading.rewards import (
        Reward,
        Rewards,
        Scale,
        openrlhf_reward_func,
        reward,
        rewards,
        verl_compute_score,
        verl_compute_scores,
    )
    from gpsfsm.grammars import TreeError, grammars_for, relax_ng, rendered, schema_path
    from gpsfsm.model.automaton import Automaton
    from gpsfsm.model.event import End, Event, Outcome
    from gpsfsm.model.finding import Finding, Scenario, Severity
    from gpsfsm.model.plan import Location, Plan
    from gpsfsm.model.printable import printable
    from gpsfsm.model.report import Facts, PlanReport, Report, Verdict
    from gpsfsm.porting import Loss, Ported
    from gpsfsm.public.answers import generate, generate_async, grade
    from gpsfsm.public.plans import Comparison, diff, fix, port, view
    from gpsfsm.public.runs import fuzz, replay, resume
    from gpsfsm.report import Format, RenderOptions, render
    from gpsfsm.running.interruption import Interruption
    from gpsfsm.running.replaying import Replayed, ReplayedRun
    from gpsfsm.running.run import run, run_async
    from gpsfsm.running.run_result import PlanEnding, RunResult
    from gpsfsm.simulation.base import Simulated
    from gpsfsm.simulation.load import load_world
    from gpsfsm.simulation.world import World
    from gpsfsm.streams import Form
    from gpsfsm.syntax import Limits, Parsed, parse
    from gpsfsm.tasks.load import load_task
    from gpsfsm.tasks.task import Task
    from gpsfsm.workers import engine_of, map_items

__all__ = [
    "Act",
    "AnalysisOptions",
    "Answer",
    "Applied",
    "Ask",
    "AssumptionError",
    "Attempt",
    "Automaton",
    "Breach",
    "Campaign",
    "CampaignReport",
    "Capabilities",
    "ChatDialect",
    "CheckOptions",
    "Comparison",
    "Compiled",
    "ConfigError",
    "ConformanceError",
    "Constraint",
    "Difference",
    "End",
    "Event",
    "Facts",
    "Fate",
    "Finding",
    "Fixed",
    "Form",
    "Format",
    "Gate",
    "GateOptions",
    "Generated",
    "GpsfsmError",
    "Grade",
    "GradeTable",
    "Graded",
    "Grader",
    "GrammarField",
    "InputError",
    "InternalError",
    "Interruption",
    "LanguageModel",
    "Library",
    "Limits",
    "Location",
    "Loss",
    "Message",
    "ModelError",
    "Outcome",
    "Parsed",
    "Plan",
    "PlanEnding",
    "PlanReport",
    "Ported",
    "Property",
    "Provider",
    "RenderOptions",
    "Replayed",
    "ReplayedRun",
    "Report",
    "Request",
    "Reward",
    "Rewards",
    "Row",
    "Rule",
    "Run",
    "RunContext",
    "RunResult",
    "Runner",
    "RunnerError",
    "Scale",
    "Scenario",
    "Severity",
    "Simulated",
    "Status",
    "Subject",
    "Task",
    "TimedScenario",
    "TreeError",
    "UndecidedError",
    "UsageError",
    "Verdict",
    "World",
    "__version__",
    "all_rules",
    "builtin_capabilities",
    "chat_body",
    "check",
    "check_runner",
    "choose_capabilities",
    "compile_plan",
    "diff",
    "engine_of",
    "fix",
    "fuzz",
    "gate",
    "gate_text",
    "generate",
    "generate_async",
    "grade",
    "grammars_for",
    "http_provider",
    "in_thread",
    "load_task",
    "load_world",
    "map_items",
    "openrlhf_reward_func",
    "parse",
    "play",
    "port",
    "printable",
    "relax_ng",
    "render",
    "rendered",
    "replay",
    "resume",
    "reward",
    "rewards",
    "run",
    "run_async",
    "schema_path",
    "subject_of",
    "verl_compute_score",
    "verl_compute_scores",
    "view",
    "write_receipt",
]

__version__ = VERSION

_HOMES = {
    "analysis.options": ("AnalysisOptions",),
    "analysis.rules": ("Rule", "all_rules"),
    "api": ("check",),
    "capabilities.library": (
        "Capabilities",
        "Library",
        "builtin_capabilities",
        "choose_capabilities",
    ),
    "checking": ("CheckOptions",),
    "compile": ("Compiled", "compile_plan"),
    "equivalence": ("Difference", "UndecidedError"),
    "errors": (
        "AssumptionError",
        "ConfigError",
        "GpsfsmError",
        "InputError",
        "InternalError",
        "UsageError",
    ),
    "execution.conformance": ("ConformanceError", "check_runner"),
    "execution.journal_rows": ("Row",),
    "execution.lane": ("in_thread",),
    "execution.records": ("Status",),
    "execution.runner": ("RunContext", "Runner", "RunnerError"),
    "fixing": ("Applied", "Fixed"),
    "fuzzing": (
        "Act",
        "Breach",
        "Campaign",
        "Fate",
        "Property",
        "Run",
        "Subject",
        "TimedScenario",
        "play",
        "subject_of",
    ),
    "fuzzing.campaign_report": ("CampaignReport",),
    "gating": ("Gate", "GateOptions", "gate", "gate_text"),
    "gating.receipts": ("write_receipt",),
    "generation.language_model": (
        "Answer",
        "Constraint",
        "LanguageModel",
        "Message",
        "ModelError",
        "Request",
    ),
    "generation.loop": ("Attempt", "Generated"),
    "generation.providers.dialect": ("Ask", "ChatDialect", "GrammarField", "chat_body"),
    "generation.providers.http_model": ("http_provider",),
    "generation.providers": ("Provider",),
    "grading.grade_tables": ("GradeTable",),
    "grading.grader": ("Grade", "Graded", "Grader"),
    "grading.rewards": (
        "Reward",
        "Rewards",
        "Scale",
        "openrlhf_reward_func",
        "reward",
        "rewards",
        "verl_compute_score",
        "verl_compute_scores",
    ),
    "grammars": ("TreeError", "grammars_for", "relax_ng", "rendered", "schema_path"),
    "model.automaton": ("Automaton",),
    "model.event": ("End", "Event", "Outcome"),
    "model.finding": ("Finding", "Scenario", "Severity"),
    "model.plan": ("Location", "Plan"),
    "model.printable": ("printable",),
    "model.report": ("Facts", "PlanReport", "Report", "Verdict"),
    "porting": ("Loss", "Ported"),
    "public.answers": ("generate", "generate_async", "grade"),
    "public.plans": ("Comparison", "diff", "fix", "port", "view"),
    "public.runs": ("fuzz", "replay", "resume"),
    "report": ("Format", "RenderOptions", "render"),
    "running.interruption": ("Interruption",),
    "running.replaying": ("Replayed", "ReplayedRun"),
    "running.run": ("run", "run_async"),
    "running.run_result": ("PlanEnding", "RunResult"),
    "simulation.base": ("Simulated",),
    "simulation.load": ("load_world",),
    "simulation.world": ("World",),
    "streams": ("Form",),
    "syntax": ("Limits", "Parsed", "parse"),
    "tasks.load": ("load_task",),
    "tasks.task": ("Task",),
    "workers": ("engine_of", "map_items"),
}
_HOME = {name: module for module, names in _HOMES.items() for name in names}


def _later(name: str) -> Show:
    """Load what draws only when a notebook asks for it."""

    def show(value: Any) -> str | None:
        shown: str | None = getattr(importlib.import_module("gpsfsm.report._notebook"), name)(value)
        return shown

    return show


for _name in (
    *("automaton_svg", "plan_svg", "finding_html", "plan_report_html", "report_html"),
    *("finding_text", "plan_report_text", "report_text"),
):
    offer(_name, _later(_name))


def _data(name: str) -> Make:
    """Load what makes data only when somebody asks for it."""

    def make(value: Any) -> Any:
        return getattr(importlib.import_module("gpsfsm.report.json"), name)(value)

    return make


for _name in ("plan_report_data", "report_data", "report_frame"):
    offer_data(_name, _data(_name))


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'gpsfsm' has no attribute '{name}'")
    return getattr(importlib.import_module(f"gpsfsm.{_HOME[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
