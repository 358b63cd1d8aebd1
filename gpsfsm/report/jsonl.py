"""JSON lines: one object per plan, for streams and tables of many answers.

Each line is the entry of the plan in the format ``json`` with the ``version`` of that format, so
that lines can be cut, sorted and joined. Settings that narrow a report are told on standard error.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.report import Format, RenderOptions
from gpsfsm.report.json import plan_line
from gpsfsm.streams import Form

if TYPE_CHECKING:
    from gpsfsm.model.report import Report


def _render(report: Report, _: RenderOptions) -> str:
    return "".join(map(plan_line, report.plans))


FORMAT = Format(name="jsonl", render=_render, form=Form.JSON)
