"""``--jobs``: where the work is done."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from gpsfsm.cli._options import Decorator

__all__ = ["jobs_option"]

_MOST = 256


class _Jobs(click.ParamType):  # type: ignore[type-arg]  # older releases of click take none
    """A number of processes, or ray with or without an address."""

    name = "jobs"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        """A number, or the name of a cluster."""
        text = str(value)
        if text.lstrip("+-").isdigit():
            number: int = click.IntRange(0, _MOST).convert(value, param, ctx)
            return number
        from gpsfsm.errors import UsageError  # noqa: PLC0415
        from gpsfsm.workers import jobs_of  # noqa: PLC0415  (only for those who use it)

        try:
            return jobs_of(text)
        except UsageError as error:
            self.fail(str(error), param, ctx)


def jobs_option(verb: str) -> Decorator:
    """``--jobs`` as ``jobs``, a number or a text; ``verb`` is what is done, such as "Check"."""
    return click.option(
        "-j",
        "--jobs",
        type=_Jobs(),
        default=1,
        metavar="N|ray",
        help=f"{verb} in N processes, 0: one per core; or on a Ray cluster: ray, or "
        "ray://HOST:PORT. [default: 1]",
    )
