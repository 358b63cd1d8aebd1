"""What the address of a request says behind its question mark."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.service.problems import Problem

if TYPE_CHECKING:
    from starlette.requests import Request

__all__ = ["MOST", "NO_NUMBER", "whole_number"]

MOST = (1 << 53) - 1
"""Where JSON numbers cease to be exact."""

NO_NUMBER = (422, "There is something else where a number was expected.")


def whole_number(
    request: Request, name: str, default: int, *, least: int = 0, most: int = MOST
) -> int:
    """The number that a name stands for. Raises Problem 422."""
    text = request.query_params.get(name)
    if text is None:
        return default
    if text.isascii() and text.isdigit() and len(text) <= len(str(MOST)):
        found = int(text)
        if least <= found <= most:
            return found
    raise Problem(422, f"{name} is a number from {least} to {most}")
