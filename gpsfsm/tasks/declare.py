"""The Declare templates (Pesic and van der Aalst, 2006) as LTLf formulas over the events of a run.

``{a}`` is the event of the first action that counts (its start, its success or its failure),
``{A}`` its start, ``{b}`` the start of the second action, ``start(*)`` the start of any action.
"Next" speaks of starts: between two starts there are always other events.
"""

from __future__ import annotations

from typing import Literal

__all__ = ["AFTER", "BINARY", "COUNTED", "UNARY", "formula_text"]

After = Literal["start", "success", "failure"]
AFTER: tuple[After, ...] = ("start", "success", "failure")

COUNTED = ("existence", "absence", "exactly")
"""Templates on one action that take ``times``."""

UNARY = {
    "init": "!start(*) W {a}",
    "last": "G (start(*) -> ({a} | X F (start(*) | {a})))",
}
"""Templates on one action."""

_PRECEDENCE = "(!{b} W {a})"
_RESPONSE = "G ({a} -> F {b})"
_ALTERNATE_RESPONSE = "G ({a} -> X (!{a} U {b}))"
_ALTERNATE_PRECEDENCE = "((!{b} W {a}) & G ({b} -> WX (!{b} W {a})))"
_CHAIN_RESPONSE = "G ({a} -> X (!start(*) U {b}))"
_CHAIN_PRECEDENCE = (
    "((!{b} W (start(*) & !{b})) & G ((start(*) & !{A}) -> WX (!start(*) W (start(*) & !{b})))"
    " & G ({A} -> ({a} | WX (!{b} W ({a} | (start(*) & !{b}))))))"
)

BINARY = {
    "responded_existence": "F {a} -> F {b}",
    "coexistence": "F {a} <-> F {b}",
    "response": _RESPONSE,
    "precedence": _PRECEDENCE,
    "succession": f"{_RESPONSE} & {_PRECEDENCE}",
    "alternate_response": _ALTERNATE_RESPONSE,
    "alternate_precedence": _ALTERNATE_PRECEDENCE,
    "alternate_succession": f"{_ALTERNATE_RESPONSE} & {_ALTERNATE_PRECEDENCE}",
    "chain_response": _CHAIN_RESPONSE,
    "chain_precedence": _CHAIN_PRECEDENCE,
    "chain_succession": f"{_CHAIN_RESPONSE} & {_CHAIN_PRECEDENCE}",
    "not_coexistence": "!(F {a} & F {b})",
    "not_succession": "G ({a} -> WX G !{b})",
    "not_chain_succession": "G ({a} -> WX (!start(*) W (start(*) & !{b})))",
}
"""Templates on two actions."""

_EVENTS: dict[After, str] = {"start": "start", "success": "succeeds", "failure": "fails"}


def formula_text(
    template: str, names: tuple[str, ...], *, after: After = "start", times: int = 1
) -> str:
    """The formula of a template, as text. ``names`` hold no quotation marks.

    >>> formula_text("precedence", ("A", "B"), after="success")
    '(!start("B") W succeeds("A"))'
    """
    first = f'"{names[0]}"'
    event = f"{_EVENTS[after]}({first})"
    if template in COUNTED:
        if template == "exactly":
            return f"{_times(event, times)} & !({_times(event, times + 1)})"
        text = _times(event, times)
        return text if template == "existence" else f"!({text})"
    pattern = UNARY[template] if template in UNARY else BINARY[template]
    text = pattern.replace("{a}", event).replace("{A}", f"start({first})")
    return text.replace("{b}", f'start("{names[-1]}")')


def _times(event: str, times: int) -> str:
    """At least so often."""
    text = f"F {event}"
    for _ in range(times - 1):
        text = f"F ({event} & X {text})"
    return text if times else "true"
