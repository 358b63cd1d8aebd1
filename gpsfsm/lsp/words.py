"""Texts about the parts of a plan: elements, control types, capabilities, parameters.

``Prose`` is such a text, as Markdown or plain. What comes from plans and capability files is never
markup in it: a plan must not put links or pictures into an editor.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from lsprotocol.types import MarkupContent, MarkupKind

from gpsfsm.capabilities.describe import runner_line
from gpsfsm.model.capability import Source, ValueType
from gpsfsm.model.plan import ControlType
from gpsfsm.model.printable import clip

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from gpsfsm.capabilities.library import Library
    from gpsfsm.model.capability import Interface, Parameter, Provider
    from gpsfsm.model.plan import Value

CONTROLS: dict[str, str] = {
    ControlType.SEQUENTIAL.value: (
        "Its children run one after the other. It fails with the child that fails, unless a "
        "recovery right behind that child handles the failure."
    ),
    ControlType.RECOVERY.value: (
        "Runs when the sibling right before it fails. Its children are alternatives: when one "
        "fails the next one is tried, and the first that succeeds lets the plan continue."
    ),
    ControlType.PARALLEL_ANY.value: (
        "Its children start together. It succeeds with the first one that succeeds, while the "
        "others keep running, and fails once all have failed."
    ),
    ControlType.PARALLEL_ALL.value: (
        "Its children start together. It succeeds when all have succeeded, and fails as soon as "
        "one fails, while the others keep running."
    ),
}
"""The control types, in the words of docs/semantics.md."""

ELEMENTS: dict[str, str] = {
    "Plan": "The whole plan. Its children run one after the other.",
    "Control": "Determines how its children run, by the attribute type.",
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
    """An attribute that a plan may write for a runner."""

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
        """``required``, ``optional`` or its default."""
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
    """The attributes of a runner: parameters and inputs, the required ones first."""
    entries = {each.name: _of_parameter(each) for each in provider.configuration}
    for each in provider.inputs:
        if each.name not in entries and any(
            source is not Source.UPSTREAM for source in each.satisfiable_from
        ):
            entries[each.name] = Writable(
                each.name, each.type, each.required, each.default, (), each.description
            )
    return sorted(entries.values(), key=lambda each: (not each.required, each.default is not None))


def provider_of(library: Library, interface: str, provider: str) -> Provider | None:
    """The provider that a runner means; the default one of its interface if it names none.

    While a text is written the interface may be missing still.
    """
    if not interface.strip():
        return library.provider(provider)
    resolved = library.resolve(interface, provider)
    if resolved.provider is None and resolved.interface is not None and not resolved.implements:
        return library.resolve(interface, "").provider  # the name is half written
    return resolved.provider


def tell_interface(prose: Prose, name: str, library: Library) -> None:
    """The purpose of an interface, and how a plan writes it."""
    own_name = library.translation(name) or name
    interface = library.interface(own_name)
    if interface is None:
        return
    prose.title(name, f"is called {own_name} here" if own_name != name else "(interface)")
    prose.text(interface.description).text(_deprecated(interface))
    providers = library.providers_of(own_name)
    if providers:
        prose.text(f"Providers: {', '.join(each.name for each in providers)}.")
        prose.code(runner_line(own_name, providers[0]))


def tell_provider(prose: Prose, provider: Provider) -> None:
    """A provider: its action, parameters and outputs."""
    prose.title(provider.name, f"(provider of {provider.implements})")
    prose.text(provider.description).text(_deprecated(provider))
    prose.items(map(_line, writable(provider)))
    if provider.outputs:
        names = ", ".join(each.name for each in provider.outputs)
        prose.text(f"Passes to the runner right behind it: {names}.")
    prose.items(_facts(provider))


def tell_parameter(prose: Prose, parameter: Writable, provider: Provider) -> None:
    """A parameter: its type, meaning and bounds."""
    kind = parameter.type.value or "any type"
    prose.title(parameter.name, f"({kind}, {parameter.need}; {provider.name})")
    prose.text(parameter.description)
    if parameter.choices:
        prose.text(f"One of {', '.join(parameter.choices)}.")
    prose.text(parameter.bounds)
    if parameter.aliases:
        prose.text(f"Also called {', '.join(parameter.aliases)}.")


def _of_parameter(parameter: Parameter) -> Writable:
    low, high = parameter.minimum, parameter.maximum
    bounds = [
        *([f"at least {low:g}"] if low is not None else []),
        *([f"at most {high:g}"] if high is not None else []),
    ]
    return Writable(
        parameter.name,
        parameter.type,
        parameter.required,
        parameter.default,
        parameter.choices,
        parameter.description,
        " and ".join(bounds).capitalize() + "." * bool(bounds),
        parameter.aliases,
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


def _deprecated(capability: Interface | Provider) -> str:
    return f"Deprecated: {capability.deprecated}" if capability.deprecated else ""


_LONGEST = 4_000
_MARKUP = re.compile(
    r"(?P<always>[\\`*\[\]<>&|~@]|:(?=//)|(?<=www)\.|(?<!\w)_|_(?!\w))"
    r"|^(?P<first>[#+\-=]|\d++[.)])",
    re.IGNORECASE,
)
"""What could be read as markup: not more, since some editors show the backslashes."""


@dataclass(slots=True)
class Prose:
    """Paragraphs; ``markdown`` says whether the editor can show Markdown."""

    markdown: bool = True
    _parts: list[str] = field(default_factory=list)

    def title(self, text: str, note: str = "") -> Prose:
        """A name, and a few words on it."""
        shown = f"**{self._safe(text)}**" if self.markdown else clip(text, _LONGEST)
        self._parts.append(f"{shown} {self._safe(note)}".rstrip())
        return self

    def text(self, text: str) -> Prose:
        """A paragraph."""
        if text.strip():
            self._parts.append(self._safe(" ".join(text.split())))
        return self

    def items(self, texts: Iterable[str], *, numbered: bool = False) -> Prose:
        """A list."""
        lines = [
            f"{f'{number}.' if numbered else '-'} {self._safe(' '.join(text.split()))}"
            for number, text in enumerate(texts, start=1)
        ]
        if lines:
            self._parts.append("\n".join(lines))
        return self

    def code(self, text: str) -> Prose:
        """A line of a plan."""
        shown = clip(" ".join(text.split()), _LONGEST)
        if not self.markdown:
            self._parts.append(shown)
            return self
        longest = max((len(run) for run in re.findall("`+", shown)), default=0)
        fence = "`" * max(3, longest + 1)
        self._parts.append(f"{fence}xml\n{shown}\n{fence}")
        return self

    def rule(self) -> Prose:
        """A line between two subjects."""
        self._parts.append("---")
        return self

    def join(self, other: Prose) -> Prose:
        """Another text behind this one."""
        self._parts += other._parts
        return self

    def __bool__(self) -> bool:
        return bool(self._parts)

    def written(self) -> MarkupContent:
        """For the protocol."""
        kind = MarkupKind.Markdown if self.markdown else MarkupKind.PlainText
        return MarkupContent(kind, "\n\n".join(self._parts))

    def _safe(self, text: str) -> str:
        shown = clip(text, _LONGEST)
        return _MARKUP.sub(_escaped, shown) if self.markdown else shown


def _escaped(markup: re.Match[str]) -> str:
    """With a backslash before it; of ``1.`` before the full stop."""
    return f"{markup[0][:-1]}\\{markup[0][-1]}"
