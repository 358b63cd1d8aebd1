"""GP302: a failure that nothing handles."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.fixing.fixer import Edit, Fix, Fixer, Safety
from gpsfsm.fixing.layout import escaped, indentation, line_end, step
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from collections.abc import Iterator

    from gpsfsm.fixing.draft import Draft, Node
    from gpsfsm.model.plan import Element

_LOG = "generic_capabilities/LogRunner"
_LONGEST = 80


def propose(draft: Draft) -> Iterator[Fix]:
    """One fix per failure: a recovery that logs it, as the place for a better alternative."""
    plan = draft.plan
    logger = draft.library.provider(_LOG)
    if plan is None or logger is None or not logger.outcomes.never_fails:
        return
    for finding in draft.findings("GP302"):
        element = draft.element(finding)
        node = draft.node(element) if element else None
        if element is None or node is None or finding.severity is Severity.INFO:
            continue
        at = draft.offset(finding)
        title = "skeleton of a recovery added"
        yield Fix("GP302", title, at, (_skeleton(draft, element, node),), Safety.UNSAFE)


def _skeleton(draft: Draft, element: Element, node: Node) -> Edit:
    name = element.interface.rpartition("/")[2] or "the block"
    question = escaped(f"{name} has failed; what now?"[:_LONGEST])
    runner = f'<Runner interface="{_LOG}" provider="{_LOG}" text="{question}"/>'
    before = indentation(draft.text, node.start)
    opened, closed = '<Control type="recovery">', "</Control>"
    if before is None:
        return Edit(node.stop, node.stop, f"{opened}{runner}{closed}")
    end = line_end(draft.text)
    deeper = before + step(draft.text, node)
    lines = (f"{before}{opened}", f"{deeper}{runner}", f"{before}{closed}")
    return Edit(node.stop, node.stop, end + end.join(lines))


FIXER = Fixer(
    name="missing-recovery",
    rules=("GP302",),
    propose=propose,
    unsafe=(
        "adds a recovery that logs the failure, after which the plan goes on: a skeleton in which "
        "to write the alternative (only with `--select GP302`, since giving up is often right)"
    ),
    on_request=True,
)
