"""Errors as the service tells them: problem details (RFC 9457), always JSON."""

from __future__ import annotations

import json
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["CONTENT_TYPE", "Problem", "problem_body"]

CONTENT_TYPE = "application/problem+json"


class Problem(Exception):  # noqa: N818  (that is what RFC 9457 calls it)
    """An answer that is an error. ``more`` are further members of its body."""

    def __init__(
        self,
        status: int,
        detail: str,
        *,
        retry_s: int | None = None,
        headers: Mapping[str, str] | None = None,
        **more: Any,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.detail = detail
        self.more = more
        self.headers = dict(headers or {})
        if retry_s is not None:
            self.headers["retry-after"] = str(retry_s)

    def body(self) -> bytes:
        """The body of the answer."""
        return problem_body(self.status, self.detail, **self.more)


def problem_body(status: int, detail: str, **more: Any) -> bytes:
    """Problem details as JSON; they are about nothing but the status, so the type is blank."""
    title = HTTPStatus(status).phrase
    body = {"type": "about:blank", "title": title, "status": status, "detail": detail, **more}
    return json.dumps(body).encode()
