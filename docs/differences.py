"""What docs/engines.md shows: plans, and how they end by the paper and on the engines.

The ends are written by hand, from what is known of the engines. ``docs/engines.py`` plays every
plan, and writes nothing if one of them does not end so.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["DIFFERENCES", "INPUTS", "TEXTS", "VALUES", "Difference", "Passed", "Text"]


@dataclass(frozen=True, slots=True)
class Difference:
    """A plan that is not run as the paper says.

    ``failing`` and ``refusing`` name the runners that fail and that do not start; all others
    succeed. ``paper``, ``first`` and ``second`` tell how the plan ends by the paper, on fabric-v1
    and on fabric-v2 (and fabric-v3), and which runners start: ``A + B → C`` are A and B at once,
    and C when one of them has ended. ``shown`` is the engine whose automaton is drawn, ``rules``
    are the rules that find it on that engine.
    """

    title: str
    words: str
    plan: str
    paper: str
    first: str
    second: str
    shown: str
    rules: tuple[str, ...]
    failing: tuple[str, ...] = ()
    refusing: tuple[str, ...] = ()


def _steps(*steps: str) -> str:
    return "\n".join(steps)


def _run(name: str) -> str:
    return f'<Runner interface="{name}" provider="{name}"/>'


def _control(kind: str, *steps: str) -> str:
    inside = "\n".join("    " + line for step in steps for line in step.split("\n"))
    return f'<Control type="{kind}">\n{inside}\n</Control>'


def _plan(*steps: str) -> str:
    inside = "\n".join("    " + line for line in _steps(*steps).split("\n"))
    return f"<Plan>\n{inside}\n</Plan>\n"


DRIVE, LOOK, SAY, HOME, DETOUR = map(_run, ("Drive", "Look", "Say", "Home", "Detour"))
MAP = _run("OccupancyGridRunner")

DIFFERENCES = (
    Difference(
        "The first unit of a parallel control starts with the runner before it",
        "The paper starts the units when the runner before the control has succeeded. The engines "
        "connect the first unit to STARTED of that runner, so both are active at once.",
        _plan(DRIVE, _control("parallel_all", LOOK, SAY)),
        "COMPLETED: Drive → Look + Say",
        "COMPLETED: Drive + Look + Say",
        "HANG: Drive",
        "fabric-v1",
        ("GP703",),
    ),
    Difference(
        "The runner before a parallel control is an input of its join",
        "All units fail here, so by the paper the control fails. On the engines the earlier "
        "success of the drive is enough for the join.",
        _plan(DRIVE, _control("parallel_any", LOOK, SAY), HOME),
        "GAVE_UP: Drive → Look + Say",
        "COMPLETED: Drive + Look + Say → Home",
        "COMPLETED: Drive → Home",
        "fabric-v1",
        ("GP703",),
        failing=("Look", "Say"),
    ),
    Difference(
        "The join of a parallel_all counts steps before it",
        "The engines do not count the units of the control, but all successes in the plan that "
        "lead nowhere yet: three here. The drive fails, so the third never comes. By the paper, "
        "nothing in the control starts.",
        _plan(DRIVE, _control("parallel_all", LOOK, SAY)),
        "GAVE_UP: Drive",
        "HANG: Drive + Look + Say",
        "HANG: Drive",
        "fabric-v1",
        ("GP703",),
        failing=("Drive",),
    ),
    Difference(
        "A join leads to itself until that is overwritten",
        "A new join collects all successes that lead nowhere, including its own. A runner behind "
        "the control undoes that; another control does not. Then the join triggers itself, and the "
        "engine crashes, whatever else happens.",
        _plan(DRIVE, _control("recovery", DETOUR), _control("recovery", HOME)),
        "COMPLETED: Drive",
        "ABORT: Drive",
        "ABORT: Drive",
        "fabric-v2",
        ("GP703", "GP704", "GP706"),
    ),
    Difference(
        "Units start one after the other",
        "By the paper all units start at once. On the engines each further unit waits for STARTED "
        "of the one before it. Here the first one does not start, so the second never does. (With "
        "`--faults no-start`, the same holds for the paper: semantics, 3.5.)",
        _plan(_control("parallel_any", LOOK, SAY)),
        "COMPLETED: Say",
        "HANG: nothing",
        "HANG: nothing",
        "fabric-v1",
        (),
        refusing=("Look",),
    ),
    Difference(
        "The runners of the second version do not report that they have started",
        "Only runners that wait for a message on a topic, such as OccupancyGridRunner, emit "
        "STARTED. A parallel control is then skipped, or waits for ever.",
        _plan(DRIVE, _control("parallel_any", LOOK, SAY), HOME),
        "COMPLETED: Drive → Look + Say → Home",
        "ABORT: Drive + Look + Say → Home",
        "COMPLETED: Drive → Home",
        "fabric-v2",
        ("GP703", "GP705"),
    ),
    Difference(
        "The second input of a join kills the engine",
        "For each input a join starts a thread in place of the previous one, which ends the "
        "process. In the first version this affects joins that need only one input, in the second "
        "all joins. So a parallel_all in which two units start always kills the second version.",
        _plan(_control("parallel_all", MAP, LOOK), SAY),
        "COMPLETED: OccupancyGridRunner + Look → Say",
        "COMPLETED: OccupancyGridRunner + Look → Say",
        "ABORT: OccupancyGridRunner + Look",
        "fabric-v2",
        ("GP703", "GP704"),
    ),
    Difference(
        "A nested control replaces the control around it",
        "The steps of a sequential control in a recovery or a parallel control are connected by "
        "SUCCEEDED to the step before, as if there were no control around them. The detour is "
        "taken although nothing has failed.",
        _plan(DRIVE, _control("recovery", _control("sequential", DETOUR, SAY)), HOME),
        "COMPLETED: Drive → Home",
        "COMPLETED: Drive → Detour → Say → Home",
        "COMPLETED: Drive → Detour → Say → Home",
        "fabric-v2",
        ("GP703",),
    ),
    Difference(
        "Steps behind two controls are never reached",
        "The second control is connected to STARTED or FAILED of the first one's join, which a "
        "join never emits. Everything that follows is unreachable, including completion.",
        _plan(
            _control("parallel_all", LOOK, SAY),
            _control("parallel_all", DRIVE, DETOUR),
            HOME,
        ),
        "COMPLETED: Look + Say → Drive + Detour → Home",
        "HANG: Look + Say",
        "HANG: Look",
        "fabric-v1",
        ("GP703", "GP706"),
    ),
    Difference(
        "A recovery guards the one runner before it",
        "By the paper it guards the whole control before it. On the engines the failure of the "
        "first step of that control leads nowhere.",
        _plan(_control("sequential", DRIVE, LOOK), _control("recovery", HOME)),
        "COMPLETED: Drive → Home",
        "HANG: Drive",
        "HANG: Drive",
        "fabric-v2",
        ("GP703",),
        failing=("Drive",),
    ),
    Difference(
        "Nothing gives up",
        "By the paper the plan gives up, and a new one is requested. The engines cannot give up: "
        "the plan stays in the state running for ever, and every plan behind it waits. That alone "
        "is not a finding GP703; GP302 reports which failures cause it and how many are needed.",
        _plan(DRIVE, _control("recovery", HOME)),
        "GAVE_UP: Drive → Home",
        "HANG: Drive → Home",
        "HANG: Drive → Home",
        "fabric-v2",
        ("GP302",),
        failing=("Drive", "Home"),
    ),
    Difference(
        "A runner that does not start reports nothing",
        "For the engines, a refused goal or a missing service is not a failure: there is no event, "
        "and so no recovery either. Use `--faults no-start` to consider such runs.",
        _plan(DRIVE, _control("recovery", HOME)),
        "COMPLETED: Home",
        "HANG: nothing",
        "HANG: nothing",
        "fabric-v2",
        (),
        refusing=("Drive",),
    ),
)


@dataclass(frozen=True, slots=True)
class Text:
    """A text, and whether gpsfsm, fabric-v1 and fabric-v2 take it: yes, no, or crashes.

    fabric-v3 takes what fabric-v2 takes, as far as no runner in it needs anything.
    """

    words: str
    text: str
    takes: tuple[str, str, str]


_GO = '<Runner interface="Go" provider="Go"/>'

TEXTS = (
    Text("text before the plan", f"Sure: <Plan>{_GO}</Plan>", ("no", "yes", "yes")),
    Text("text behind the plan", f"<Plan>{_GO}</Plan> Done.", ("no", "no", "no")),
    Text("Markdown fences", f"```xml\n<Plan>{_GO}</Plan>\n```", ("no", "no", "no")),
    Text(
        "a declaration that is not first",
        f'<!-- a --><?xml version="1.0"?><Plan>{_GO}</Plan>',
        ("no", "no", "no"),
    ),
    Text(
        "a bare ampersand",
        '<Plan><Runner interface="Go" provider="Go" t="&x"/></Plan>',
        ("no", "yes", "yes"),
    ),
    Text("two plans", f"<Plan>{_GO}</Plan><Plan/>", ("no", "yes", "yes")),
    Text(
        "an attribute twice",
        '<Plan><Runner interface="Go" interface="Go" provider="Go"/></Plan>',
        ("no", "no", "no"),
    ),
    Text("an unknown element", "<Plan><Event/></Plan>", ("no", "yes", "no")),
    Text(
        "a type in capitals",
        f'<Plan><Control type="Parallel_any">{_GO}</Control></Plan>',
        ("no", "yes", "no"),
    ),
    Text("a runner without provider", '<Plan><Runner interface="Go"/></Plan>', ("no", "yes", "no")),
    Text(
        "a runner in a runner",
        f'<Plan><Runner interface="Go" provider="Go">{_GO}</Runner></Plan>',
        ("no", "yes", "yes"),
    ),
    Text(
        "an empty control", f'<Plan><Control type="sequential"/>{_GO}</Plan>', ("yes", "yes", "no")
    ),
    Text(
        "a control with only a comment",
        '<Plan><Control type="sequential"><!-- a --></Control></Plan>',
        ("yes", "yes", "crashes"),
    ),
    Text("another outermost element", f"<Fabric>{_GO}</Fabric>", ("no", "crashes", "crashes")),
    Text("no step at all", "<Plan/>", ("yes", "yes", "yes")),
)

VALUES = (
    *("true", "True", "1", "+1", "007", "", " 1", "1 ", "2147483648", "1.0", ".5", "1e3", "0x1F"),
    *("0.1234567", "1e-7", "1e400", "inf", "nan", "1_000"),
)
"""Values of attributes, whose types are shown."""


@dataclass(frozen=True, slots=True)
class Passed:
    """A plan with a runner that needs an input, and what fabric-v3 makes of it.

    ``takes``: it runs the plan. ``rule`` is the one that speaks of it, "" for none.
    """

    words: str
    plan: str
    takes: bool
    rule: str = ""


def _capability(name: str, **parameters: str) -> str:
    words = "".join(f' {key}="{value}"' for key, value in parameters.items())
    return f'<Runner interface="{name}" provider="{name}"{words}/>'


_PERCEPTION = "fp_perception_capabilities"
_HEAR, _SAY = (_capability(f"{_PERCEPTION}/{name}Runner") for name in ("Transcribe", "Speech"))
_SAY_WRITTEN = _capability(f"{_PERCEPTION}/SpeechRunner", text="Hello.")
_WORDS = _capability(
    "prompt_capabilities/PromptSpeechRunner", speech_text="Say hello.", flush="true"
)
_TELL = _capability("prompt_capabilities/PromptCapabilityRunner", CapabilitySpecs="none")
_GO_THERE = _capability("nav2_capabilities/WaypointRunner", x="1.0", y="2.0")
_AGAIN = _control("recovery", _HEAR)

INPUTS = (
    Passed("the previous step provides the text", _plan(_HEAR, _SAY), takes=True),
    Passed("the plan writes the text", _plan(_SAY_WRITTEN), takes=True),
    Passed("nothing provides it", _plan(_SAY), False, "GP701"),
    Passed("a step further up provides it", _plan(_HEAR, _GO_THERE, _SAY), False, "GP701"),
    Passed("it comes through the join of a recovery", _plan(_HEAR, _AGAIN, _SAY), False, "GP701"),
    Passed(
        "it comes from a step that has failed and so provides nothing",
        _plan(_HEAR, _control("recovery", _SAY)),
        True,
        "GP710",
    ),
    Passed(
        "the output of the previous step has another name and the same meaning",
        _plan(_WORDS, _SAY),
        True,
        "GP710",
    ),
    Passed(
        "the plan writes a value that must come from the previous step",
        _plan(_TELL),
        False,
        "GP701",
    ),
)
