"""Words of other plan languages, and what a plan says instead."""

from __future__ import annotations

from difflib import get_close_matches

from gpsfsm.model.plan import ControlType
from gpsfsm.syntax.text import strip

_TYPES = tuple(ControlType)
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


def behavior_tree_root(tag: str, attributes: list[str]) -> bool:
    """True if an outermost element is that of a BehaviorTree.CPP file."""
    return tag in ("root", "BehaviorTree", "TreeNodesModel") or any(
        name in ("main_tree_to_execute", "BTCPP_format") for name in attributes
    )


def control_type_hint(written: str) -> str:
    """The hint for an unknown control type."""
    word = strip(written)
    if word in _TYPES:
        return f'remove the blanks: type="{word}"'
    lower = word.lower().replace("-", "_").replace(" ", "_")
    if lower in _TYPES:
        return f'write type="{lower}": types are case-sensitive and have underscores'
    if lower in _PARALLEL:
        return (
            'write type="parallel_all" to wait for all children, '
            'or type="parallel_any" to wait for the first that succeeds'
        )
    nearest = _SYNONYMS.get(lower.replace("_", "")) or _SYNONYMS.get(lower)
    if nearest is None:
        close = get_close_matches(lower[:40], _TYPES, n=1, cutoff=0.6)
        nearest = close[0] if close else None
    if nearest == ControlType.RECOVERY:
        return 'write type="recovery", with the goal right before it and only alternatives inside'
    return f'write type="{nearest}"' if nearest else f"use {_LIST}"


def missing_type_hint(name: str | None) -> str:
    """The hint where a control has no type; ``name`` is its name attribute."""
    if name is not None and strip(name) in _TYPES:
        word = strip(name)
        return f'name="{word}" is how plans of 2024 said it; write type="{word}"'
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
            '<Event name="…" provider="…"/> is how plans of 2024 said it; '
            f"write {_RUNNER} with the full names of both"
        )
    hint = _tree_word(lower)
    if hint:
        return hint
    close = get_close_matches(lower[:40], ("plan", "control", "runner"), n=1, cutoff=0.75)
    if close:
        return f"write <{close[0].capitalize()}>"
    if "interface" in attributes or "provider" in attributes:
        return f"write {_RUNNER}: every capability is a <Runner>, told apart by its interface"
    return "a plan holds <Control> and <Runner> elements only; remove it or express it with these"


def _tree_word(lower: str) -> str:
    if lower in _PARALLEL:
        return (
            'this is a behaviour tree word; write <Control type="parallel_all">, '
            'or type="parallel_any" to wait for the first that succeeds'
        )
    if lower in _SYNONYMS:
        kind = _SYNONYMS[lower]
        more = ", with the goal right before it" if kind == "recovery" else ""
        return f'this is a behaviour tree word; write <Control type="{kind}">{more}'
    if lower in _LOOPS:
        return (
            "this is a behaviour tree word; a plan has no loops: "
            'write the runner again inside <Control type="recovery"> right after it'
        )
    if lower in _DECORATORS:
        return (
            "this is a behaviour tree word; a plan has no such element: "
            "write the runners in place, inside a <Control>"
        )
    if lower in _MOVES:
        return f"write {_RUNNER} with the navigation capability and its parameters, such as x and y"
    if lower in _TREE_WORDS:
        return f"this is a behaviour tree word; a plan says what to do with {_RUNNER}"
    return ""
