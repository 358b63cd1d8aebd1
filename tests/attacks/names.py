"""Names that almost belong together: interfaces and providers that a check takes for others.

A runner of a plan has an interface, by which people, tasks and checks know it, and a provider,
which is what is loaded. The cases mix names that are known with misspelt, foreign and swapped ones,
names of older dialects and semantic interfaces; packages are installed that register runners under
any of these names. Whatever would be loaded for real must be what was checked, whatever passes the
gate must be what ``run --real`` takes, and nothing that drives may pass for speech. Nothing is ever
loaded or started here: classes are looked up, as before a run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import EntryPoint
from typing import TYPE_CHECKING
from unittest.mock import patch
from xml.sax.saxutils import quoteattr

from hypothesis import strategies as st

from gpsfsm.capabilities.describe import least_files
from gpsfsm.capabilities.library import Capabilities, Library, Match, bind, builtin_capabilities
from gpsfsm.capabilities.table import dump
from gpsfsm.checking import CheckOptions
from gpsfsm.compile import compile_plan
from gpsfsm.execution import registry
from gpsfsm.execution.journal import Heading
from gpsfsm.execution.kernel import Kernel
from gpsfsm.execution.registry import Maker
from gpsfsm.execution.runner import Runner, RunnerError
from gpsfsm.gating import GateOptions, gate_text
from gpsfsm.grading.grader import Grade, Grader
from gpsfsm.model.capability import Interface, Provider, SemanticInterface
from gpsfsm.running.admission import Admission, Refused
from gpsfsm.running.prepare import REAL
from gpsfsm.syntax import Limits, parse
from gpsfsm.tasks.task import Pattern, Step, Task
from tests.campaigns.base import Pair
from tests.capabilities.support import describe

if TYPE_CHECKING:
    from collections.abc import Iterator

    from hypothesis.strategies import DrawFn, SearchStrategy

    from gpsfsm.model.plan import Plan

DRIVE = "nav2_capabilities/WaypointRunner"
SPEAK = "perception_capabilities/SpeechRunner"
ATTRIBUTES = {
    "WaypointRunner": 'x="1.0" y="2.0"',
    "SpeechRunner": 'text="hello"',
    "ProcessRunner": 'command="id"',
    "LogRunner": 'text="hello"',
    "WaitRunner": 'seconds="0.1"',
}
DESCRIBED = (
    *(DRIVE, SPEAK, "generic_capabilities/ProcessRunner", "generic_capabilities/WaitRunner"),
    *("generic_capabilities/LogRunner", "nav2_capabilities/RobotPoseRunner"),
)
FORMER = ("capabilities2_runner_nav2/WaypointRunner", "capabilities2_runner_audio/SpeakRunner")
BASE = Provider("home/Driver", DRIVE, described=True, resources=("base",))
HOME = Library(
    interfaces=(Interface("home/Bare"), Interface(FORMER[0])),
    providers=(
        BASE,
        replace(BASE, name="home/KitchenDriver", implements="home/Kitchen"),
        replace(BASE, name="home/Orphan", implements="home/Unfiled"),
        Provider("home/Silent", DRIVE, runner="gpsfsm.runners.generic:WaitRunner"),
        Provider(FORMER[0], FORMER[0], runner="capabilities2_runner::WaypointRunner"),
    ),
    semantic=(
        SemanticInterface("home/Kitchen", DRIVE),
        SemanticInterface("home/Nowhere", "home/Missing"),
    ),
)
"""What files of a robot may say: all of it, or any part."""

_NAMES = tuple(
    dict.fromkeys(
        (
            *(*DESCRIBED, *FORMER, *HOME.interface_names, *(each.name for each in HOME.providers)),
            *("home/Unfiled", "home/Missing", "lift_bot/Lift", "x/SpeechRunner", "x/Say", "Say"),
        )
    )
)
_ALIKE = str.maketrans("aceopxysi", "\u0430\u0441\u0435\u043e\u0440\u0445\u0443\u0455\u0456")
_BLANKS = (" ", "\N{NO-BREAK SPACE}", "\N{ZERO WIDTH SPACE}", "\N{SOFT HYPHEN}", "\t", "/", ".")


class Registered(Runner):
    """What an installed package has registered under some name."""

    async def run(self, parameters: object, context: object) -> None:
        """Act; it never comes to that."""
        raise AssertionError


@dataclass(frozen=True, slots=True)
class Case:
    """A plan of runners with these names, in this control, and what there is on the robot."""

    library: Library
    pairs: tuple[tuple[str, str], ...]
    control: str
    installed: tuple[str, ...]

    @property
    def text(self) -> str:
        """The plan."""
        steps = "".join(
            f"\n<Runner interface={quoteattr(interface)} provider={quoteattr(provider)} "
            f"{ATTRIBUTES.get((provider or interface).rpartition('/')[2].strip(), '')}/>"
            for interface, provider in self.pairs
        )
        if not self.control:
            return f"<Plan>{steps}\n</Plan>\n"
        return f'<Plan>\n<Control type="{self.control}">{steps}\n</Control>\n</Plan>\n'

    def __repr__(self) -> str:
        library = self.library
        own = [
            *(each.name for each in library.interfaces if each in HOME.interfaces),
            *(each.name for each in library.providers if each in HOME.providers),
            *(each.name for each in library.semantic if each in HOME.semantic),
        ]
        return f"{self.text}\nfiles: {own}\ninstalled: {list(self.installed)}"


@st.composite
def _spelt(draw: DrawFn, name: str) -> str:
    """A name, as it is or almost."""
    how = draw(st.integers(0, 14))
    if how < 3 or how > 9 or not name:
        return name
    at = draw(st.integers(0, len(name) - 1))
    if how == 3:
        return name[:at] + name[at + 1 :]
    if how == 4:
        return name[:at] + draw(st.sampled_from("abzZ_-é")) + name[at + 1 :]
    if how == 5:
        return name[:at] + name[at:].translate(_ALIKE)
    if how == 6:
        blank = draw(st.sampled_from(_BLANKS))
        return draw(st.sampled_from([name + blank, blank + name, name[:at] + blank + name[at:]]))
    if how == 7:
        return draw(st.sampled_from([name.swapcase(), name.lower(), name.upper(), name.title()]))
    short = name.rpartition("/")[2]
    if how == 8:
        others = (short, f"x/{short}", f"x/{name}", name.replace("/", "//"))
        outside = (f"../{short}", f"./{short}", f".{name}", f"x/.{short}", f"x/../{short}")
        return draw(st.sampled_from(others + outside))
    return draw(st.sampled_from(["", " ", short[::-1], name + name]))


@st.composite
def pairs(draw: DrawFn) -> tuple[str, str]:
    """An interface and a provider: of one thing or of two, spelt well or not, or swapped."""
    name = draw(st.sampled_from(_NAMES))
    other = name if draw(st.integers(0, 2)) else draw(st.sampled_from(_NAMES))
    interface, provider = draw(_spelt(name)), draw(_spelt(other))
    if draw(st.integers(0, 5)) == 0:
        return provider, interface
    return interface, provider


@st.composite
def libraries(draw: DrawFn) -> Library:
    """The built-in library, mostly with a part of the files of a robot."""
    builtin = builtin_capabilities().library
    if draw(st.integers(0, 2)) == 0:
        return builtin

    def some(entries: tuple[object, ...]) -> tuple[object, ...]:
        return tuple(entry for entry in entries if draw(st.booleans()))

    return builtin.extended(
        Library(
            some(HOME.interfaces),  # type: ignore[arg-type]
            some(HOME.providers),  # type: ignore[arg-type]
            some(HOME.semantic),  # type: ignore[arg-type]
        )
    )


@st.composite
def cases(draw: DrawFn) -> Case:
    """A plan and a robot."""
    drawn = draw(st.lists(pairs(), min_size=1, max_size=3))
    if draw(st.booleans()):
        drawn.append(drawn[0])  # two that do the same, at once maybe
    control = draw(st.sampled_from(["", "parallel_all", "parallel_any", "sequential"]))
    names = sorted({name for pair in drawn for name in pair if name.strip()})
    installed = {DRIVE, *(name for name in names if draw(st.booleans()))}
    return Case(draw(libraries()), tuple(drawn), control, tuple(sorted(installed)))


def judge(case: Case) -> Iterator[str]:
    """Nothing would be loaded but what was checked, and the gate and a run agree."""
    parsed = parse(case.text, file="plan.xml")
    assert parsed.plan is not None, parsed.problems
    with patch.object(registry, "entry_points", lambda group: _entries(case, group)):
        loaded = _would_load(case.library, parsed.plan)
        passes, code, missing = _admitted(case)
    yield from _agreement(case, parsed.plan, passes, code, missing)
    drives = [each for each in loaded if each is not None and "base" in each.resources]
    at_once = case.control.startswith("parallel") and len(drives) > 1
    assert not (passes and at_once), "two that hold the base pass the gate and act at once"
    if at_once:
        yield "two would drive at once: refused"
    yield "loaded" if any(loaded) else "nothing would be loaded"
    yield from _as_speech(case, loaded)


def _entries(case: Case, group: str) -> list[EntryPoint]:
    return [EntryPoint(name, f"{__name__}:{Registered.__name__}", group) for name in case.installed]


def _would_load(library: Library, plan: Plan) -> list[Provider | None]:
    """Per runner of a plan the provider whose class a real run would make; None for none."""
    kernel = Kernel(compile_plan(plan, bindings=bind(plan, library)))
    maker = Maker(library, bound=kernel.bound)
    providers: list[Provider | None] = []
    for number, runner in enumerate(plan.runners):
        key = kernel.runners[kernel.runner_of[number]]
        binding = library.bind(runner)
        try:
            made, provider = maker.runner_class(*key), maker.described(*key)
        except RunnerError:
            providers.append(None)
            continue
        assert binding is not None, f"{key} is loaded as {made}, and was not described"
        assert binding.provider == provider
        assert binding.interface.name == key[0]
        assert fits(library, runner.interface, runner.provider, provider), (key, provider.name)
        providers.append(provider)
    return providers


def fits(library: Library, interface: str, provider: str, loaded: Provider) -> bool:
    """Whether a provider is what an interface and a provider say, by the tables of the files alone.

    (docs/capabilities.md, "How names are looked up", once more.)
    """
    interfaces = {each.name: each for each in library.interfaces}
    redefined = {each.name: each.redefines for each in library.semantic}
    former = {name: each.name for each in reversed(library.interfaces) for name in each.formerly}
    named = {each.name for each in library.providers}

    def base(name: str) -> str:
        response = redefined.get(name, name)
        response = response if response in interfaces or name in redefined else former.get(name, "")
        return response if response in interfaces else ""

    meant = {base(interface), former.get(interface, "")} - {""}
    of_it = loaded.described and (
        loaded.implements == interface or base(loaded.implements) in meant
    )
    if provider in named and provider == loaded.name:
        return bool(meant) and of_it
    # the default one: none is named, or one of another dialect or of a semantic interface
    stands_for = provider in ("", interface) or former.get(provider, "") in meant
    return bool(meant) and of_it and stands_for


def _admitted(case: Case) -> tuple[bool, int, bool]:
    """Whether the gate lets a plan pass, the exit code of a real run, and if files are missing."""
    capabilities = Capabilities(case.library)
    options = GateOptions(check=CheckOptions(capabilities=capabilities, trees=False))
    heading = Heading(plan=b"", capabilities=_table(case.library), mode=REAL)
    decision = Admission(heading, capabilities, Limits()).decide(case.text, "plan.xml")
    code = decision.code if isinstance(decision, Refused) else 0
    missing = "so nothing that it does has been checked" in getattr(decision, "message", "")
    return gate_text(case.text, "plan.xml", options).accepted, code, missing


@cache
def _table(library: Library) -> str:
    return dump(library)


def _agreement(case: Case, plan: Plan, passes: bool, code: int, missing: bool) -> Iterator[str]:
    matches = {case.library.resolve(each.interface, each.provider).match for each in plan.runners}
    assert passes or code == 1, "a run takes what the gate refuses"
    if Match.MISMATCH in matches:
        assert not passes
        yield "refused: names that do not fit"
    if not passes:
        yield "refused by gate and run"
    elif code == 0:
        assert matches == {Match.DESCRIBED}
        yield "accepted by gate and run"
    else:
        assert (code, missing) == (2, True)
        assert matches - {Match.DESCRIBED} <= {Match.UNDESCRIBED, Match.SILENT}
        yield "accepted by the gate, not described: no real run"
        for each in plan.runners:
            yield from _written(case.library, each.interface, each.provider)


def _written(library: Library, interface: str, provider: str) -> Iterator[str]:
    """Whoever writes the files that a run asks for has described the runner."""
    files = least_files(library, interface, provider)
    if files:
        resolution = describe(library, files, provider).resolve(interface, provider)
        assert resolution.match is Match.DESCRIBED, (resolution, files)
        yield "the lines to write are told"


SAY = Task(steps=(Step((Pattern("say", ("SpeechRunner",)),)),))


def _as_speech(case: Case, loaded: list[Provider | None]) -> Iterator[str]:
    """A task that wants nothing but speech is not fulfilled by what drives."""
    graded = Grader(SAY, CheckOptions(capabilities=Capabilities(case.library))).grade(
        case.text, "plan.xml"
    )
    if graded.grade is not Grade.SUCCESS:  # of what is no plan, what was meant is graded
        return
    for provider in loaded:
        assert provider is None or provider.implements == SPEAK, provider
    yield "graded as speech"


def _cases() -> SearchStrategy[Case]:
    return cases()


PAIR = Pair(
    name="names",
    about="interfaces and providers that almost fit: what is loaded is what was checked",
    cases=_cases,
    judge=judge,
    text=str,
    full=20_000,
    batch=50,
    few=25,
    attack=True,
)
