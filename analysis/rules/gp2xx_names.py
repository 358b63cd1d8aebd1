"""Rules on names: of interfaces and providers, and what the capability files say of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.analysis.rules.base import Rule, go, plan
from gpsfsm.analysis.rules.names import (
    Names,
    Status,
    at,
    either,
    mixes_dialects,
    more_runners,
    not_permitted,
    others,
    quoted,
    short,
    survey,
)
from gpsfsm.analysis.words import listed
from gpsfsm.capabilities.library import namespace
from gpsfsm.model.finding import Related, Severity
from gpsfsm.model.plan import Location
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from gpsfsm.analysis.context import Context
    from gpsfsm.capabilities.library import FileDefect, Library
    from gpsfsm.model.capability import Binding, Permission, Robot
    from gpsfsm.model.finding import Finding

_INTERFACE_LENGTH = len("interface")
_PROVIDER_LENGTH = len("provider")


def _find_unknown_interface(context: Context) -> Iterator[Finding]:
    """One finding per interface, at the first runner that names it."""
    pairs = survey(context)
    groups: dict[tuple[Status, str], list[int]] = {}
    for status in (Status.NO_INTERFACE, Status.NEAR_INTERFACE):
        for (interface, _), numbers in pairs[status].items():
            groups.setdefault((status, interface), []).extend(numbers)
    names = Names(context.capabilities.library)
    for (status, interface), numbers in groups.items():
        numbers.sort()
        yield _unknown_interface_finding(context, names, status, interface, numbers)


def _unknown_interface_finding(
    context: Context, names: Names, status: Status, interface: str, numbers: list[int]
) -> Finding:
    implemented = names.implements(interface)
    nearest = [quoted(implemented)] if implemented else _interfaces_near(names, interface)
    meant = f"; did you mean {either(nearest)}?" if nearest else ""
    if implemented:
        meant = f"; that is a provider of {quoted(implemented)}"
    more = more_runners(numbers)
    if status is Status.NO_INTERFACE:
        robot = context.capabilities.robot
        on_robot = f" on the robot {quoted(robot.name)}" if robot else ""
        message = f"there is no interface {quoted(interface)}{on_robot}{more}{meant}"
        severity = Severity.ERROR
    else:
        message = f"no file describes the interface {quoted(interface)}{more}{meant}"
        severity = Severity.WARNING
    return UNKNOWN_INTERFACE.finding(
        message,
        at(context, context.runner(numbers[0]), "interface"),
        severity=severity,
        hint=f"write {nearest[0]}"
        if nearest
        else _packages(names.library, interface, robot=context.capabilities.robot is not None),
        related=others(context, numbers, "interface"),
        length=_INTERFACE_LENGTH,
    )


def _interfaces_near(names: Names, interface: str) -> list[str]:
    return [quoted(name) for name in names.interfaces_near(interface)]


def _packages(library: Library, interface: str, *, robot: bool) -> str:
    """The names that there are instead; ``robot``: they are those of its profile."""
    package = namespace(interface)
    same = [name for name in library.interface_names if namespace(name) == package]
    if package and same:
        return (
            f"use one of {quoted(package)}: {', '.join(same[:5])}{', …' if len(same) > 5 else ''}"
        )
    if robot:
        names = [quoted(name) for name in sorted(library.interface_names)]
        return f"use one that the robot has: {listed(names, most=5)}"
    return "run 'gpsfsm capabilities list' to see all interfaces"


UNKNOWN_INTERFACE = Rule(
    code="GP201",
    name="unknown-interface",
    severity=Severity.ERROR,
    summary="A runner names an interface that does not exist.",
    why=(
        "The executor looks up the interface before the first step and does not find it, so "
        "the plan does not even start. Language models often put the right runner in the "
        "wrong package."
    ),
    fix="write the interface as the capability files name it",
    bad=plan(go(2.0, -0.5).replace("nav2_capabilities/", "perception_capabilities/")),
    good=plan(go(2.0, -0.5)),
    severities=(
        "error if the name is misspelt or in the wrong package, or if the capability files are "
        "known to be complete; warning if they describe the package but not this runner, or if "
        "the package's name is nearly that of one that has such a runner"
    ),
    find=_find_unknown_interface,
)


def _find_unknown_provider(context: Context) -> Iterator[Finding]:
    """One finding per pair of interface and provider, at the first runner that names it."""
    pairs = survey(context)
    names = Names(context.capabilities.library)
    for status in (Status.NO_PROVIDER, Status.NEAR_PROVIDER):
        for (interface, provider), numbers in pairs[status].items():
            yield _unknown_provider_finding(context, names, status, (interface, provider), numbers)
    yield from _mixed(context, pairs[Status.BOUND])


def _unknown_provider_finding(
    context: Context, names: Names, status: Status, pair: tuple[str, str], numbers: list[int]
) -> Finding:
    library = names.library
    interface, provider = pair
    here = library.translation(interface) or interface
    implementing = [quoted(each.name) for each in library.providers_of(here)]
    implemented = names.implements(provider)
    remark = f"; {either(implementing)} does" if implementing else ""
    severity = Severity.ERROR
    if implemented:
        what = f"{quoted(provider)} implements {quoted(implemented)}, not {quoted(here)}"
    elif status is Status.NO_PROVIDER:
        what = f"there is no provider {quoted(provider)}"
        remark = f"; {either(implementing)} implements {quoted(here)}" if implementing else ""
    else:
        severity = Severity.WARNING
        what = f"no file describes the provider {quoted(provider)}"
        remark = f"; did you mean {either(implementing)}?"
    return UNKNOWN_PROVIDER.finding(
        f"{what}{remark}{more_runners(numbers)}",
        at(context, context.runner(numbers[0]), "provider"),
        severity=severity,
        hint=f"write {implementing[0]}" if implementing else _NOBODY,
        related=others(context, numbers, "provider"),
        length=_PROVIDER_LENGTH,
    )


def _mixed(context: Context, bound: Mapping[tuple[str, str], list[int]]) -> Iterator[Finding]:
    """Interface and provider in two spellings of the same thing."""
    for (interface, provider), numbers in bound.items():
        binding = context.bindings[numbers[0]]
        if binding is None or not _two_spellings(binding, interface, provider):
            continue
        name, wanted = binding.interface.name, binding.provider.name
        yield UNKNOWN_PROVIDER.finding(
            f"the interface is {quoted(interface)} but the provider is {quoted(provider)}: these "
            f"names belong to different dialects{more_runners(numbers)}",
            at(context, context.runner(numbers[0]), "provider"),
            severity=Severity.ERROR if context.capabilities.robot else Severity.WARNING,
            hint=f"write {quoted(wanted)}" + (f" for {quoted(name)}" if name != wanted else ""),
            related=others(context, numbers, "provider"),
            length=_PROVIDER_LENGTH,
        )


def _two_spellings(binding: Binding, interface: str, provider: str) -> bool:
    if interface == provider or short(interface) != short(provider):
        return False
    described = binding.interface
    spellings = {described.name, *described.formerly}
    return interface in spellings and provider in spellings


_NOBODY = "name a provider of this interface; no capability file describes one"

UNKNOWN_PROVIDER = Rule(
    code="GP202",
    name="unknown-provider",
    severity=Severity.ERROR,
    summary="A runner names a provider that does not exist or implements another interface.",
    why=(
        "The provider is what the executor starts. If it does not exist, nothing starts; if "
        "it implements another interface, the robot does something other than the plan says."
    ),
    fix="name a provider that implements the interface",
    bad=plan(
        go(2.0, -0.5).replace(
            'provider="nav2_capabilities/WaypointRunner"',
            'provider="nav2_capabilities/RobotPoseRunner"',
        )
    ),
    good=plan(go(2.0, -0.5)),
    severities=(
        "error if the provider implements another interface, or does not exist; warning if only "
        "its package looks misspelt, or if interface and provider are spelt in different dialects, "
        "which is an error under a robot profile"
    ),
    find=_find_unknown_provider,
)


_MAX_RELATED = 5


def _find_other_dialect(context: Context) -> Iterator[Finding]:
    """One finding per pair of packages, at the first runner that is written so.

    Without the profile of a robot, and on an engine without names of its own, all published
    dialects are equally right; only a plan that mixes them cannot run on any stack.
    """
    library, robot = context.capabilities.library, context.capabilities.robot
    engine = context.capabilities.named_by
    if robot is None and not engine and not mixes_dialects(library, context.plan.runners):
        return
    translations: dict[str, str | None] = {}
    groups: dict[tuple[str, str], dict[str, int]] = {}
    for number, runner in enumerate(context.plan.runners):
        name = runner.interface
        if name in translations:
            continue
        here = translations[name] = library.translation(name)
        if here is not None:
            groups.setdefault((namespace(name), namespace(here)), {})[name] = number
    for names in groups.values():
        (first, number), *rest = names.items()
        more = f" (and {len(rest)} more of this package)" if rest else ""
        yield OTHER_DIALECT.finding(
            _other_name(first, translations[first] or first, robot, engine) + more,
            at(context, context.runner(number), "interface"),
            severity=_severity_of_dialect(robot, engine),
            hint="" if robot else OTHER_DIALECT.fix,
            related=tuple(
                Related(
                    at(context, context.runner(number), "interface"),
                    f"{quoted(name)} is called {quoted(translations[name] or name)}",
                )
                for name, number in rest[:_MAX_RELATED]
            ),
            length=_INTERFACE_LENGTH,
        )


def _severity_of_dialect(robot: Robot | None, engine: str) -> Severity:
    if robot is not None:
        return Severity.ERROR
    return Severity.WARNING if engine else Severity.INFO


def _other_name(name: str, here: str, robot: Robot | None, engine: str) -> str:
    if robot is not None:
        return f"{quoted(name)} is called {quoted(here)} on the robot {quoted(robot.name)}"
    if engine:
        return f"{quoted(name)} is called {quoted(here)} on {engine}"
    return f"the plan mixes dialects: {quoted(name)} is another name of {quoted(here)}"


OTHER_DIALECT = Rule(
    code="GP208",
    name="other-dialect",
    severity=Severity.INFO,
    summary="A runner's name belongs to another dialect than the robot or the rest of the plan.",
    why=(
        "The packages of the capabilities were renamed more than once. gpsfsm knows all "
        "published names, but each robot uses only one set: a plan that mixes them runs on no "
        "robot."
    ),
    fix="use the robot's names throughout; a robot profile defines them",
    bad=plan(go(2.0, -0.5).replace("nav2_capabilities", "capabilities2_runner_nav2"), go(0.0, 0.0)),
    good=plan(go(2.0, -0.5)),
    severities=(
        "error under a robot profile, which defines the names; warning on fabric-v3, which "
        "has the newest published names; info if a plan mixes names"
    ),
    find=_find_other_dialect,
)


_MAX_REASON = 200
_MULTIPLEX = "capabilities2_runner/InputMultiplexRunner"


def _find_deprecated_interface(context: Context) -> Iterator[Finding]:
    """One finding per interface or provider, at the first runner that names it."""
    library = context.capabilities.library
    lookups: dict[tuple[str, str], tuple[str, str, str]] = {}
    groups: dict[tuple[str, str, str], list[int]] = {}
    for number, runner in enumerate(context.plan.runners):
        pair = runner.interface, runner.provider
        if pair not in lookups:
            binding = context.bindings[number]
            lookups[pair] = _deprecation(library, pair, binding.provider.name if binding else "")
        if lookups[pair][0]:
            groups.setdefault(lookups[pair], []).append(number)
    for (what, name, reason), numbers in groups.items():
        yield DEPRECATED_INTERFACE.finding(
            f"the {what} {quoted(name)} is deprecated: {clip(reason, _MAX_REASON)}"
            f"{more_runners(numbers)}",
            at(context, context.runner(numbers[0]), what),
            related=others(context, numbers, what),
            length=len(what),
        )


def _deprecation(library: Library, pair: tuple[str, str], provider: str) -> tuple[str, str, str]:
    """Attribute, name and reason; empty if neither interface nor provider is deprecated."""
    interface = library.interface(library.translation(pair[0]) or pair[0])
    if interface is not None and interface.deprecated:
        return "interface", interface.name, interface.deprecated
    described = library.provider(provider) if provider else None
    if described is not None and described.deprecated:
        return "provider", described.name, described.deprecated
    return "", "", ""


DEPRECATED_INTERFACE = Rule(
    code="GP209",
    name="deprecated-interface",
    severity=Severity.WARNING,
    summary="A runner names a deprecated interface or provider.",
    why="The capability file marks it as deprecated; the message quotes the reason.",
    fix="use the replacement that the message names",
    bad=plan(go(2.0, -0.5), f'<Runner interface="{_MULTIPLEX}" provider="{_MULTIPLEX}"/>'),
    good=plan(go(2.0, -0.5)),
    find=_find_deprecated_interface,
)


def _find_undescribed_runner(context: Context) -> Iterator[Finding]:
    """One finding for the whole plan, at the first such runner."""
    first: dict[str, int] = {}
    for (interface, _), numbers in survey(context)[Status.UNDESCRIBED].items():
        first.setdefault(interface, numbers[0])
    if not first:
        return
    (interface, number), *rest = first.items()
    meant = Names(context.capabilities.library).namesakes(interface)
    other = f", or write {quoted(meant[0])} if that is what you mean" if meant else ""
    names = listed([quoted(name) for name in first])
    yield UNDESCRIBED_RUNNER.finding(
        f"no capability file describes {names}, so {'their' if rest else 'its'} parameters, "
        "outputs and effects are not checked",
        context.plan.location(context.runner(number)),
        hint=UNDESCRIBED_RUNNER.fix + other,
        related=tuple(
            context.related(context.runner(number), quoted(name))
            for name, number in rest[:_MAX_RELATED]
        ),
    )


UNDESCRIBED_RUNNER = Rule(
    code="GP210",
    name="undescribed-runner",
    severity=Severity.INFO,
    summary="No capability file describes a runner.",
    why=(
        "A plan does not say what a runner needs, outputs and occupies. gpsfsm assumes "
        "nothing about a runner that no file describes, so the rules about parameters, data "
        "flow, resources and time do not check it."
    ),
    fix="pass the folder of the robot's capability files with --capabilities DIR",
    bad=plan(
        go(2.0, -0.5), '<Runner interface="lift_bot/LiftRunner" provider="lift_bot/LiftRunner"/>'
    ),
    good=plan(go(2.0, -0.5)),
    find=_find_undescribed_runner,
)


def _find_unpermitted_runner(context: Context) -> Iterator[Finding]:
    """One finding per runner and what it reaches, at the parameter that names it."""
    allow, robot = context.capabilities.allow, context.capabilities.robot
    for number, binding in enumerate(context.bindings):
        if binding is None:
            continue
        for permission, name in binding.provider.reaches:
            allowed = [text for kind, text in allow or () if kind is permission]
            message = not_permitted(binding, permission, name, allowed)
            if not message:
                continue
            runner = context.runner(number)
            attribute = binding.written.get(name)
            yield UNPERMITTED_RUNNER.finding(
                f"{short(runner.interface)} {message}",
                at(context, runner, attribute.name if attribute else ""),
                severity=Severity.WARNING if allow is None else Severity.ERROR,
                hint=_permit(permission, robot),
                length=len(attribute.name) if attribute else 0,
            )


def _permit(permission: Permission, robot: Robot | None) -> str:
    if robot is None:
        return (
            f"remove it, or permit it: --allow-{permission.value} of 'gpsfsm gate' and 'gpsfsm "
            "run', or a robot profile"
        )
    return f"remove it, or permit it: 'allow: {permission.value}s' in the robot's profile"


UNPERMITTED_RUNNER = Rule(
    code="GP213",
    name="unpermitted-runner",
    severity=Severity.ERROR,
    summary="A runner starts a program or calls a URL or function without permission.",
    why=(
        "A plan comes from a model or from somebody else. What it starts or calls can do "
        "anything that the robot's computer can do, however harmless the plan looks."
    ),
    fix="remove it, or permit what it reaches",
    bad=plan(
        go(2.0, -0.5),
        '<Runner interface="generic_capabilities/ProcessRunner" '
        'provider="generic_capabilities/ProcessRunner" command="rm -rf /"/>',
    ),
    good=plan(go(2.0, -0.5)),
    severities=(
        "error in a gate and under a robot profile; warning in a check without configured "
        "permissions"
    ),
    find=_find_unpermitted_runner,
)


_SHOWN = 3
_MAX_DEFECT = 200


def _find_defective_capability_file(context: Context) -> Iterator[Finding]:
    """One finding for the files of the plan's runners, and one for all others, at its beginning."""
    touched: list[FileDefect] = []
    others: list[FileDefect] = []
    concerned = _Concerned(context) if context.capabilities.defects else None
    for each in context.capabilities.defects:
        (touched if concerned and concerned.by(each) else others).append(each)
    for defects, whose, severity in (
        (touched, f" of runners of this {context.terms.whole}", Severity.ERROR),
        (others, "", Severity.WARNING),
    ):
        if not defects:
            continue
        shown = "; ".join(clip(each.text, _MAX_DEFECT) for each in defects[:_SHOWN])
        count = "a defect" if len(defects) == 1 else f"{len(defects)} defects"
        more = f"; and {len(defects) - _SHOWN} more" if len(defects) > _SHOWN else ""
        yield DEFECTIVE_CAPABILITY_FILE.finding(
            f"the capability files{whose} have {count}: {shown}{more}",
            Location(1, 1, "/Plan"),
            severity=severity,
            length=1,
        )


class _Concerned:
    """The files and names on which what is known of a plan's runners rests."""

    def __init__(self, context: Context) -> None:
        semantic = {each.name: each.origin for each in context.capabilities.library.semantic}
        self.files: set[str] = set()
        self.names: set[str] = set()
        for runner, binding in zip(context.plan.runners, context.bindings, strict=True):
            self.names |= {runner.interface, runner.provider}
            if binding is not None:
                described = binding.interface, binding.provider
                self.files |= {each.origin for each in described}
                self.names |= {each.name for each in described}
                self.files.add(semantic.get(binding.semantic, ""))
        self.files.discard("")  # of what no file describes
        self.names |= {short(name) for name in self.names}

    def by(self, defect: FileDefect) -> bool:
        """True if a defect concerns one of the runners."""
        named = not self.names.isdisjoint(defect.names)
        return named or defect.file in self.files or not defect.names


DEFECTIVE_CAPABILITY_FILE = Rule(
    code="GP211",
    name="defective-capability-file",
    severity=Severity.WARNING,
    summary="A capability file has defects.",
    why=(
        "gpsfsm ignores the defective parts of the file, so runners that it was meant to describe "
        "may count as unknown or undescribed, and what it declares of them is not checked. A gate "
        "does not decide a plan with such runners; with --fail-on warning, it rejects every plan "
        "until the files are right."
    ),
    fix="fix the files; 'gpsfsm capabilities check DIR' lists everything that is wrong with them",
    bad="",
    good=plan(go(2.0, -0.5)),
    severities="error if the file describes a runner of the plan, or nobody knows which",
    find=_find_defective_capability_file,
)


def _find_mismatched_names(context: Context) -> Iterator[Finding]:
    """One finding per pair of interface and provider, at the first runner that names it."""
    names = Names(context.capabilities.library)
    for (interface, provider), numbers in survey(context)[Status.FOREIGN].items():
        implemented = quoted(names.implements(provider))
        yield MISMATCHED_NAMES.finding(
            f"no file describes the interface {quoted(interface)}, but its provider "
            f"{quoted(provider)} implements {implemented}{more_runners(numbers)}",
            at(context, context.runner(numbers[0]), "interface"),
            hint=f"write {implemented}, or name a provider of {quoted(interface)}",
            related=others(context, numbers, "interface"),
            length=_INTERFACE_LENGTH,
        )


MISMATCHED_NAMES = Rule(
    code="GP212",
    name="mismatched-names",
    severity=Severity.ERROR,
    summary="A runner combines an unknown interface with a provider of another interface.",
    why=(
        "The provider is what starts; the interface is what gets checked. If the two do not "
        "match, the robot could drive although the plan says that it speaks, and nothing about "
        "the drive would have been checked. One wrong letter, a space or a letter of another "
        "alphabet is enough."
    ),
    fix="write the interface that the provider implements, or a provider of the interface",
    bad=plan(
        go(2.0, -0.5).replace('interface="nav2_capabilities/WaypointRunner"', 'interface="a/Say"')
    ),
    good=plan(go(2.0, -0.5)),
    find=_find_mismatched_names,
)


UNBOUND_LEAF = Rule(
    code="GP214",
    name="unbound-leaf",
    severity=Severity.WARNING,
    summary="Nobody knows what a leaf of a behaviour tree does on the robot.",
    why=(
        "A robot profile says what a robot has and what it may do. A leaf of a behaviour tree is a "
        "name: unless the profile binds it to a runner, the leaf may drive anywhere and start any "
        "program. A gate does not decide such a tree."
    ),
    fix=(
        "bind the leaf in 'leaves' of the robot's profile, or write the full name of a runner, "
        'such as <Action ID="nav2_capabilities/WaypointRunner"/>'
    ),
    bad="",
    good=plan(go(2.0, -0.5)),
)

RULES = (
    UNKNOWN_INTERFACE,
    UNKNOWN_PROVIDER,
    OTHER_DIALECT,
    DEPRECATED_INTERFACE,
    UNDESCRIBED_RUNNER,
    UNPERMITTED_RUNNER,
    DEFECTIVE_CAPABILITY_FILE,
    MISMATCHED_NAMES,
    UNBOUND_LEAF,
)
