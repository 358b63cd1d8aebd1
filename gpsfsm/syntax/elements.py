"""The rules of single elements: attributes they need, that look wrong, and namespaces."""

from __future__ import annotations

from difflib import get_close_matches
from typing import TYPE_CHECKING, NamedTuple

from gpsfsm.late import pattern
from gpsfsm.model.finding import Related
from gpsfsm.model.plan import Attribute, ControlType, Kind
from gpsfsm.syntax.text import NAME, clip, is_namespace_declaration, strip

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from gpsfsm.syntax.token_reader import Collector
    from gpsfsm.syntax.tokens import RawAttribute, StartTag

# ---- Words of other plan languages, and what a plan says instead ---------------------------------


_TYPE_NAMES = tuple(ControlType)
_LIST = "sequential, recovery, parallel_any or parallel_all"

# Words of BehaviorTree.CPP, Nav2 and workflow languages for the four types of control.
_SYNONYMS: dict[str, str] = {
    word: kind
    for kind, words in {
        "sequential": "sequence seq serial sequencestar reactivesequence pipelinesequence",
        "recovery": "fallback selector reactivefallback recover retry recoverynode catch",
        "parallel_all": "parallelall all join concurrent",
        "parallel_any": "parallelany any race first",
    }.items()
    for word in words.split()
}
_PARALLEL = ("parallel", "parallelnode", "parallelize", "simultaneous")
_LOOPS = ("retryuntilsuccesful", "retryuntilsuccessful", "repeat", "keeprunninguntilfailure")
_DECORATORS = ("inverter", "forcesuccess", "forcefailure", "timeout", "delay", "subtree", "subplan")
_TREE_WORDS = (
    *("root", "behaviortree", "treenodesmodel", "action", "condition", "setblackboard"),
    *("checkblackboard", "decorator", "alwayssuccess", "alwaysfailure"),
)
_MOVES = ("movebase", "navigatetopose", "navigationaction", "gotowaypoint", "goto", "navigate")
_RUNNER = '<Runner interface="…" provider="…"/>'
_MAX_LISTED = 3


def behavior_tree_root(tag: str, attributes: list[str]) -> bool:
    """True if an outermost element is that of a BehaviorTree.CPP file."""
    return tag in ("root", "BehaviorTree", "TreeNodesModel") or any(
        name in ("main_tree_to_execute", "BTCPP_format") for name in attributes
    )


def control_type_hint(written: str) -> str:
    """The hint for an unknown control type."""
    word = strip(written)
    if word in _TYPE_NAMES:
        return f'remove the spaces: type="{word}"'
    lower = word.lower().replace("-", "_").replace(" ", "_")
    if lower in _TYPE_NAMES:
        return f'write type="{lower}": types are case-sensitive and have underscores'
    if lower in _PARALLEL:
        return (
            'write type="parallel_all" to wait for all children, '
            'or type="parallel_any" to wait for the first that succeeds'
        )
    nearest = _SYNONYMS.get(lower.replace("_", "")) or _SYNONYMS.get(lower)
    if nearest is None:
        close = get_close_matches(lower[:40], _TYPE_NAMES, n=1, cutoff=0.6)
        nearest = close[0] if close else None
    if nearest == ControlType.RECOVERY:
        return 'write type="recovery", with the goal right before it and only alternatives inside'
    return f'write type="{nearest}"' if nearest else f"use {_LIST}"


def missing_type_hint(name: str | None) -> str:
    """The hint where a control has no type; ``name`` is its name attribute."""
    if name is not None and strip(name) in _TYPE_NAMES:
        word = strip(name)
        return f'name="{word}" is the notation of 2024; write type="{word}"'
    return f'add type="…" with {_LIST}'


def nearest_attribute(wanted: str, names: list[str]) -> str:
    """The attribute that was probably meant to be ``wanted``, or ""."""
    for name in names:
        if name.lower() == wanted:
            return name
    close = get_close_matches(wanted, [name[:40] for name in names], n=1, cutoff=0.75)
    return close[0] if close else ""


def unknown_element(tag: str, attributes: list[str]) -> str:
    """The hint for the element ``tag``, which no plan has."""
    lower = tag.lower()
    if lower in ("plan", "control", "runner"):
        return f"write <{lower.capitalize()}>: names of elements are case-sensitive"
    if ":" in tag:
        return f"write <{tag.rpartition(':')[2][:40]}> without a prefix: a plan has no namespaces"
    if tag == "Event":
        return (
            '<Event name="…" provider="…"/> is the notation of 2024; '
            f"write {_RUNNER} with the full names of both"
        )
    hint = _tree_word(lower)
    if hint:
        return hint
    close = _like_an_element(lower)
    if close:
        return f"write <{close.capitalize()}>"
    if "interface" in attributes or "provider" in attributes:
        return f"write {_RUNNER}: every capability is a <Runner>, identified by its interface"
    return (
        "a plan contains only <Control> and <Runner> elements; remove it or express it with these"
    )


def _like_an_element(lower: str) -> str:
    """The element of a plan that is spelt almost like this, "" if there is none."""
    close = get_close_matches(lower[:40], ("plan", "control", "runner"), n=1, cutoff=0.75)
    return close[0] if close else ""


def behavior_tree(unknown: Mapping[str, Collection[str]], *, has_id: bool) -> list[str]:
    """The unknown elements that are a behaviour tree's; none if they do not look like one.

    ``unknown``: their names, each with the names of its attributes. ``has_id``: the plan has an
    ``ID``, as trees have. One word may have slipped in; two signs, of which one is an element that
    gives a tree its form, are a tree. What else the tree holds, its own actions, belongs to it.
    """
    alone = ("plan", "control", "runner", "event")
    names = [
        name
        for name, attributes in unknown.items()
        if _tree_word(name.lower())
        or not (
            name.lower() in alone
            or _like_an_element(name.lower())
            or "interface" in attributes
            or "provider" in attributes
        )
    ]
    forms = any(_tree_word(name.lower()) and name.lower() not in _MOVES for name in names)
    return names if forms and len(names) + has_id > 1 else []


def behavior_tree_hint(names: Collection[str]) -> str:
    """The words of a plan for these elements of a behaviour tree."""
    written: dict[str, list[str]] = {}
    for name in names:
        written.setdefault(_translation(name.lower()), []).append(f"<{clip(name)}>")
    parts = [f"{_listed(tags)} as {words}" for words, tags in written.items()]
    return f"write {'; '.join(parts)}. To have it checked as a tree, put it into <root>"


def _listed(tags: list[str]) -> str:
    if len(tags) > _MAX_LISTED:
        tags = [*tags[: _MAX_LISTED - 1], "the like"]
    return " and ".join(filter(None, (", ".join(tags[:-1]), tags[-1])))


def _translation(lower: str) -> str:
    """The words of a plan for what an element of a tree says."""
    kind = "parallel_all" if lower in _PARALLEL else _SYNONYMS.get(lower)
    if kind == "recovery":
        return 'its first child, with the others in a <Control type="recovery"> right after it'
    if kind:
        return f'<Control type="{kind}">'
    if lower in _LOOPS:
        return 'the step inside, followed by the same step in a <Control type="recovery">'
    if lower in _DECORATORS:
        return "the steps inside it"
    return _RUNNER


def _tree_word(lower: str) -> str:
    if lower in _PARALLEL:
        return (
            'this is a behaviour tree element; write <Control type="parallel_all">, '
            'or type="parallel_any" to wait for the first that succeeds'
        )
    if lower in _SYNONYMS:
        kind = _SYNONYMS[lower]
        more = ", with the goal right before it" if kind == "recovery" else ""
        return f'this is a behaviour tree element; write <Control type="{kind}">{more}'
    if lower in _LOOPS:
        return (
            "this is a behaviour tree element, and plans have no loops: "
            'write the runner again inside <Control type="recovery"> right after it'
        )
    if lower in _DECORATORS:
        return (
            "this is a behaviour tree element, and plans have nothing like it: "
            "write the runners in place, inside a <Control>"
        )
    if lower in _MOVES:
        return f"write {_RUNNER} with the navigation capability and its parameters, such as x and y"
    if lower in _TREE_WORDS:
        return f"this is a behaviour tree element; write {_RUNNER} for an action"
    return ""


_NUMBER = r"[+-]?+(?:[0-9]++(?:\.[0-9]*+)?+|\.[0-9]++)(?:[eE][+-]?+[0-9]++)?+"
PACKED = (
    rf"[ ]*+[(\[{{]?+[ ]*+{_NUMBER}(?:(?:[ ]*+[,;][ ]*+|[ ]++){_NUMBER}){{1,2}}+"
    r"[ ]*+[,;]?+[ ]*+[)\]}]?+[ ]*+"
)
_PACKED = pattern(PACKED)
_LONGEST_PACKED = 200

# Parameters in which people write sentences: numbers in them are meant as text.
FREE_TEXT = frozenset(
    [
        *("interface", "provider", "name", "id", "uuid", "text"),
        *("task", "prompt", "plan", "message", "msg", "say"),
        *("speech", "question", "answer", "query", "description", "instruction"),
        *("instructions", "comment", "label", "title", "command"),
    ]
)
_COMPLETION = ("FabricCompletionRunner", "CompletionRunner")
_MAX_RELATED = 20
_TYPES = {kind.value: kind for kind in ControlType}
_ELEMENTS = frozenset(Kind)


def is_completion(interface: str) -> bool:
    """True if ``interface`` is that of a completion runner."""
    return interface.rpartition("/")[2] in _COMPLETION


def is_packed(name: str, text: str) -> bool:
    """True if the value ``text`` of a parameter packs several numbers into one."""
    if name in FREE_TEXT or len(text) > _LONGEST_PACKED:
        return False
    return _PACKED.fullmatch(text) is not None


class ElementRules:
    """Checks one element at a time and reports to ``collector``."""

    def __init__(self, collector: Collector) -> None:
        self._collector = collector

    def plan(self, tag: StartTag, path: str, *, of_tree: bool = False) -> None:
        """``<Plan name?>``; ``of_tree``: its ``ID`` is part of what is reported already."""
        self._foreign(tag, path, allowed=("name", "ID") if of_tree else ("name",))

    def runner(self, tag: StartTag, attributes: tuple[Attribute, ...], path: str) -> None:
        """``<Runner interface provider …>``."""
        interface = provider = None
        for attribute in attributes:
            name, text = attribute.name, attribute.text
            if name == "interface":
                interface = text
            elif name == "provider":
                provider = text
            elif isinstance(attribute.value, str) and text[:1] in "0123456789+-.([{ ":
                # Only text can be packed: one number alone is typed as a number.
                self._packed(tag, attribute, path)
        if interface is None or provider is None or not (strip(interface) and strip(provider)):
            self._needs(tag, attributes, path, "interface", interface)
            self._needs(tag, attributes, path, "provider", provider)

    def control(
        self, tag: StartTag, attributes: tuple[Attribute, ...], path: str
    ) -> ControlType | None:
        """``<Control type name?>``; None where the type is missing or unknown."""
        texts = {attribute.name: attribute.text for attribute in attributes}
        written = texts.get("type")
        if written is None or not strip(written):
            self._no_type(tag, texts, path)
            return None
        self._foreign(tag, path, allowed=("type", "name"))
        if written in _TYPES:
            return _TYPES[written]
        start, length = _span(tag, "type")
        message = f"'{clip(written)}' is not a type of control"
        hint = control_type_hint(written)
        self._collector.add("GP106", start, length, message=message, hint=hint, element=path)
        return None

    def _no_type(self, tag: StartTag, texts: dict[str, str], path: str) -> None:
        if self._collector.full("GP107"):
            self._collector.count("GP107")
            return
        names = [name for name in texts if name not in ("type", "name")]
        near = nearest_attribute("type", names)
        self._foreign(tag, path, allowed=("type", "name", near))
        if "type" in texts:
            start, length = _span(tag, "type")
            message = "the type of this control is empty"
        else:
            start, length = tag.start, 1 + len(tag.name)
            message = "this control has no type, so it is not clear how it runs its children"
        hint = missing_type_hint(texts.get("name"))
        if near:
            hint = f"write 'type' instead of '{near}': names are case-sensitive"
        self._collector.add("GP107", start, length, message=message, hint=hint, element=path)

    def _needs(
        self,
        tag: StartTag,
        attributes: tuple[Attribute, ...],
        path: str,
        name: str,
        text: str | None,
    ) -> None:
        """Report ``name`` where it is missing or blank."""
        if text is not None and strip(text):
            return
        if self._collector.full("GP107"):
            self._collector.count("GP107")
            return
        if text is not None:
            start, length = _span(tag, name)
            message = f"the {name} of this runner is empty"
        else:
            start, length = tag.start, 1 + len(tag.name)
            message = f"this runner has no {name}"
        others = [a.name for a in attributes if a.name not in ("interface", "provider")]
        near = nearest_attribute(name, others) if text is None else ""
        other = "provider" if name == "interface" else "interface"
        same = next((strip(a.text) for a in attributes if a.name == other), "")
        if near:
            hint = f"write '{name}' instead of '{near}': names are case-sensitive"
        elif same:
            hint = f'add {name}="{clip(same, 80)}", if it is the same as the {other}'
        else:
            hint = f'add {name}="package/SomeRunner" with the capability to run'
        self._collector.add("GP107", start, length, message=message, hint=hint, element=path)

    def _packed(self, tag: StartTag, attribute: Attribute, path: str) -> None:
        text = attribute.text
        if not is_packed(attribute.name, text):
            return
        start, length = _span(tag, attribute.name)
        message = (
            f'{attribute.name}="{clip(text)}" packs several numbers into one attribute; '
            "the runner gets it as one text, not as numbers"
        )
        hint = 'write one attribute per number, as in x="2.0" y="-0.5"'
        self._collector.add("GP111", start, length, message=message, hint=hint, element=path)

    def _foreign(self, tag: StartTag, path: str, *, allowed: tuple[str, ...]) -> None:
        """Report the attributes that mean nothing on a plan or control, all at once."""
        foreign = [raw for raw in tag.attributes if raw.name not in allowed and raw.name != "xmlns"]
        if not foreign:
            return
        names = ", ".join(f"'{clip(raw.name)}'" for raw in foreign[:5])
        more = f" and {len(foreign) - 5} more" if len(foreign) > 5 else ""
        verb = "has" if len(foreign) == 1 else "have"
        plural = "" if len(foreign) == 1 else "s"
        message = f"the attribute{plural} {names}{more} {verb} no effect on <{tag.name}>"
        first = foreign[0]
        self._collector.add(
            "GP112",
            first.start,
            _length(first),
            message=message,
            hint=_foreign_hint(foreign),
            element=path,
            related=(
                Related(self._collector.location(raw.start, path), f"'{clip(raw.name)}'")
                for raw in foreign[1:_MAX_RELATED]
            ),
        )

    def namespaced(self, tag: StartTag, path: str) -> None:
        """Report the attributes of a runner that belong to XML namespaces."""
        for raw in tag.attributes:
            if ":" not in raw.name:
                continue
            what = "declares" if is_namespace_declaration(raw.name) else "belongs to"
            message = f"'{clip(raw.name)}' {what} an XML namespace, and plans have none"
            hint = "write the parameter without a prefix, or remove it"
            length = _length(raw)
            self._collector.add(
                "GP112", raw.start, length, message=message, hint=hint, element=path
            )


def _foreign_hint(foreign: Sequence[RawAttribute]) -> str:
    """The advice on attributes of a plan or control: an ID is no parameter of any runner."""
    identity = sum(raw.name.lower() == "id" for raw in foreign)
    if identity == len(foreign):
        return "remove it, or write name instead: only behaviour trees have IDs"
    them = "it" if len(foreign) == 1 else "them"
    moved = f"only runners take parameters: move {them} to the runner that needs {them}"
    if not identity:
        return f"{moved}, or remove {them}"
    rest = "the other" if len(foreign) == 2 else "the others"
    needs = "it" if len(foreign) == 2 else "them"
    return (
        f"remove the ID, which only behaviour trees have; move {rest} to the runner that "
        f"needs {needs}, or remove {needs} too"
    )


def _length(raw: RawAttribute) -> int:
    return raw.value_end + 1 - raw.start


def _span(tag: StartTag, name: str) -> tuple[int, int]:
    """Offset and length of an attribute, for underlining."""
    for raw in tag.attributes:
        if raw.name == name:
            return raw.start, _length(raw)
    return tag.start, 1 + len(tag.name)


class NamespaceResult(NamedTuple):
    """The consequences of an element's names for the whole: see ``TreeBuilder``."""

    broken: bool
    fatal: bool


class Namespaces:
    """The prefixes in force at the element being read, and the rules about them.

    ``reported`` is the offset of the last element whose own name was reported.
    """

    def __init__(self, collector: Collector) -> None:
        self.reported = -1
        self._collector = collector
        self._frames: list[tuple[int, frozenset[str]]] = []

    def check(self, tag: StartTag, depth: int, path: str) -> NamespaceResult:
        """Check the names of an element at ``depth``."""
        self._enter(tag.attributes, depth)
        broken = fatal = False
        wrong = self._fault(tag.name)
        if wrong:
            broken = True
            self.reported = tag.start
            self._report_name(tag.name, tag.start, wrong, path)
        for raw in tag.attributes:
            wrong = self._fault(raw.name)
            if wrong:
                broken = True
                self._report_name(raw.name, raw.start, wrong, path)
            if not is_namespace_declaration(raw.name):
                continue
            empty = raw.value_end == raw.value_start
            if empty and raw.name != "xmlns":
                broken = True
                message = f"'{clip(raw.name)}' declares a prefix without a namespace"
                self._report(raw, "GP101", message, path)
            if not empty and raw.name == "xmlns" and tag.name in _ELEMENTS:
                fatal = True
                message = f"'xmlns' puts <{tag.name}> into an XML namespace, and plans have none"
                self._report(raw, "GP105", message, path)
        return NamespaceResult(broken, fatal)

    def _enter(self, attributes: list[RawAttribute], depth: int) -> None:
        """Take in the declarations of an element at ``depth``; those as deep or deeper end."""
        while self._frames and self._frames[-1][0] >= depth:
            self._frames.pop()
        declared = {raw.name[6:] for raw in attributes if raw.name.startswith("xmlns:")}
        if declared:
            inherited = self._frames[-1][1] if self._frames else frozenset[str]()
            self._frames.append((depth, inherited | declared))

    def _fault(self, name: str) -> str:
        """The fault of a name; "" if it has none."""
        prefix, colon, local = name.partition(":")
        if not colon:
            return ""
        if not prefix or ":" in local or not NAME.match(local):
            return "has a misplaced colon"
        if prefix == "xml" or is_namespace_declaration(name):
            return ""
        declared = bool(self._frames) and prefix in self._frames[-1][1]
        return "" if declared else "has a prefix that is not declared"

    def _report_name(self, name: str, start: int, wrong: str, path: str) -> None:
        message = f"'{clip(name)}' {wrong}"
        hint = f"write '{clip(name.rpartition(':')[2])}': a plan has no namespaces"
        # The name of an element follows its '<'.
        length = len(name) + (start == self.reported)
        self._collector.add("GP101", start, length, message=message, hint=hint, element=path)

    def _report(self, raw: RawAttribute, rule: str, message: str, path: str) -> None:
        length = raw.value_end + 1 - raw.start
        hint = "remove it: a plan has no namespaces"
        self._collector.add(rule, raw.start, length, message=message, hint=hint, element=path)
