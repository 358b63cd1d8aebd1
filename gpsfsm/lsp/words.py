"""What is said about the parts of a plan: elements, control types, capabilities, parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from gpsfsm.capabilities.describe import runner_line
from gpsfsm.model.capability import Source, ValueType
from gpsfsm.model.plan import ControlType

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.capabilities.library import Library
    from gpsfsm.lsp.prose import Prose
    from gpsfsm.model.capability import Interface, Parameter, Provider
    from gpsfsm.model.plan import Value

__all__ = [
    "CONTROLS",
    "ELEMENTS",
    "LABELS",
    "Writable",
    "provider_of",
    "tell_interface",
    "tell_parameter",
    "tell_provider",
    "writable",
]

CONTROLS: dict[str, str] = {
    ControlType.SEQUENTIAL.value: (
        "Its children run one after the other. It fails with the child that fails, unless a "
        "recovery right behind that child takes the failure."
    ),
    ControlType.RECOVERY.value: (
        "Runs when the sibling right before it fails. Its children are alternatives: when one "
        "fails the next one is tried, and the first that succeeds lets the plan go on."
    ),
    ControlType.PARALLEL_ANY.value: (
        "Its children start together. It succeeds with the first one that succeeds, while the "
        "others run on, and fails once all have failed."
    ),
    ControlType.PARALLEL_ALL.value: (
        "Its children start together. It succeeds when all have succeeded, and fails as soon as "
        "one fails, while the others run on."
    ),
}
"""The control types, in the words of docs/semantics.md."""

ELEMENTS: dict[str, str] = {
    "Plan": "The whole plan. Its children run one after the other.",
    "Control": "Says how its children run: the attribute type tells which way.",
    "Runner": "One action of the robot: an interface, the provider that does it, its parameters.",
}
LABELS: dict[str, str] = {
    "interface": "What the action is: package/Name.",
    "provider": "Who does it: a provider that implements the interface.",
    "type": f"How the children run: {', '.join(CONTROLS)}.",
    "name": "A label for people. It means nothing to the robot.",
    "id": "A label. It means nothing to the robot.",
}


@dataclass(frozen=True, slots=True)
class Writable:
    """What a plan may write as an attribute of a runner."""

    name: str
    type: ValueType
    required: bool
    default: Value | None = None
    choices: tuple[str, ...] = ()
    description: str = ""
    bounds: str = ""
    aliases: tuple[str, ...] = ()

    @property
    def need(self) -> str:
        """Whether it has to be there."""
        if self.default is not None:
            shown = str(self.default)
            return f"default {shown.lower() if isinstance(self.default, bool) else shown}"
        return "required" if self.required else "optional"

    @property
    def values(self) -> tuple[str, ...]:
        """The values to choose from, as far as there are few."""
        if self.choices:
            return self.choices
        return ("true", "false") if self.type is ValueType.BOOL else ()


def writable(provider: Provider) -> list[Writable]:
    """What a plan may write for a runner: parameters and inputs, the required ones first."""
    found = {each.name: _of_parameter(each) for each in provider.configuration}
    for each in provider.inputs:
        if each.name not in found and any(
            source is not Source.UPSTREAM for source in each.satisfiable_from
        ):
            found[each.name] = Writable(
                each.name, each.type, each.required, each.default, (), each.description
            )
    return sorted(found.values(), key=lambda each: (not each.required, each.default is not None))


def provider_of(library: Library, interface: str, provider: str) -> Provider | None:
    """The provider that a runner means; the default one of its interface if it names none.

    While a text is written the interface may be missing still.
    """
    if not interface.strip():
        return library.provider(provider)
    found = library.resolve(interface, provider)
    if found.provider is None and found.interface is not None and not found.implements:
        return library.resolve(interface, "").provider  # the name is half written
    return found.provider


def tell_interface(prose: Prose, name: str, library: Library) -> None:
    """What an interface is for, and how a plan writes it."""
    known = library.translation(name) or name
    found = library.interface(known)
    if found is None:
        return
    prose.title(name, f"is called {known} here" if known != name else "(interface)")
    prose.text(found.description).text(_deprecated(found))
    providers = library.providers_of(known)
    if providers:
        prose.text(f"Providers: {', '.join(each.name for each in providers)}.")
        prose.code(runner_line(known, providers[0]))


def tell_provider(prose: Prose, provider: Provider) -> None:
    """What a provider does, what it takes and what it gives."""
    prose.title(provider.name, f"(provider of {provider.implements})")
    prose.text(provider.description).text(_deprecated(provider))
    prose.items(map(_line, writable(provider)))
    if provider.outputs:
        names = ", ".join(each.name for each in provider.outputs)
        prose.text(f"Gives to the runner right behind it: {names}.")
    prose.items(_facts(provider))


def tell_parameter(prose: Prose, parameter: Writable, provider: Provider) -> None:
    """What a parameter says."""
    kind = parameter.type.value or "any type"
    prose.title(parameter.name, f"({kind}, {parameter.need}; {provider.name})")
    prose.text(parameter.description)
    if parameter.choices:
        prose.text(f"One of {', '.join(parameter.choices)}.")
    prose.text(parameter.bounds)
    if parameter.aliases:
        prose.text(f"Also called {', '.join(parameter.aliases)}.")


def _of_parameter(found: Parameter) -> Writable:
    low, high = found.minimum, found.maximum
    bounds = [
        *([f"at least {low:g}"] if low is not None else []),
        *([f"at most {high:g}"] if high is not None else []),
    ]
    return Writable(
        found.name,
        found.type,
        found.required,
        found.default,
        found.choices,
        found.description,
        " and ".join(bounds).capitalize() + "." * bool(bounds),
        found.aliases,
    )


def _line(each: Writable) -> str:
    kind = f"{each.type.value}, " if each.type.value else ""
    return f"{each.name} ({kind}{each.need}): {each.description}".rstrip(": ")


def _facts(provider: Provider) -> Iterator[str]:
    if provider.outcomes.never_fails:
        yield "never fails"
    if provider.outcomes.may_hang:
        yield "may hang"
    if provider.resources:
        yield f"holds {', '.join(provider.resources)}"


def _deprecated(found: Interface | Provider) -> str:
    return f"Deprecated: {found.deprecated}" if found.deprecated else ""
