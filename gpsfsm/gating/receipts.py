"""Receipts: verdicts as JSON, and whether a plan is one that was accepted.

A receipt is no signature: who can write it can write what they like into it. Kept where only the
gate writes, it tells the plan that was accepted from one that was changed since.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

from gpsfsm.errors import ConfigError, misused, require_list
from gpsfsm.gating.deciding import Verdict
from gpsfsm.strict_json import DuplicateKeyError, strict_loads

if TYPE_CHECKING:
    from collections.abc import Sequence

    from gpsfsm.gating.deciding import Digests

MOST_BYTES = 64 << 20
_VERSION = 3
_EARLIER = (
    "this receipt has version {}, of an earlier gpsfsm, and its verdicts do not count; "
    "decide again with 'gpsfsm gate --format json'"
)
_PARTS = {
    "plan": "the plan is another one",
    "capabilities": "the capabilities are others",
    "options": "the options are others",
    "version": "this is another version of gpsfsm",
}


def write_receipt(verdicts: Sequence[Verdict]) -> str:
    """Write the verdicts as JSON (docs/gate.md), one line per plan."""
    require_list("write_receipt", "verdicts", verdicts)
    for each in verdicts:
        value: object = each
        if not isinstance(value, Verdict):
            raise misused("write_receipt", "verdicts of gpsfsm.gate", value)
    accepted = json.dumps(bool(verdicts) and all(verdicts))
    plans = ",".join(f"\n {json.dumps(each.to_dict())}" for each in verdicts)
    return f'{{"version": {_VERSION}, "accepted": {accepted}, "plans": [{plans}\n]}}\n'


def read_receipt(content: bytes, file: str) -> tuple[dict[str, str], ...]:
    """The digests of the plans that were accepted. Raises ConfigError for what is no receipt."""
    try:
        receipt = strict_loads(content)
        version = receipt["version"]
        if type(version) is int and 0 < version < _VERSION:
            raise ConfigError(f"{file}: {_EARLIER.format(version)}")
        if version != _VERSION:
            raise ConfigError(f"{file}: a receipt of version {_VERSION} is needed")
        return tuple(
            {name: str(each["digests"][name]) for name in (*_PARTS, "all")}
            for each in receipt["plans"]
            if each["verdict"] == "accepted" and each["reason"] == "passed"
        )
    except DuplicateKeyError as error:
        raise ConfigError(f"{file}: {error}, so the accepted plans are unknown") from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        message = f"{file}: this is not a receipt of 'gpsfsm gate --format json'"
        raise ConfigError(message) from error


def differences(digests: Digests, accepted: Sequence[dict[str, str]]) -> list[str]:
    """In what a plan differs from those that were accepted; [] if it is one of them."""
    if not accepted:
        return ["no plan was accepted"]
    ours = asdict(digests)
    if any(each["all"] == ours["all"] for each in accepted):
        return []
    of_this_plan = [each for each in accepted if each["plan"] == ours["plan"]]
    if not of_this_plan:
        return [_PARTS["plan"]]
    return [
        difference for name, difference in _PARTS.items() if of_this_plan[-1][name] != ours[name]
    ] or ["the receipt contradicts itself"]
