"""What a process does for the language server: check a text, and mend it.

The process can be ended when a text takes too long, so no plan can keep an editor waiting.
"""

from __future__ import annotations

import os
import pickle
import threading
import time
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal, TypeAlias

from gpsfsm.checking import CheckOptions, check_text, failed
from gpsfsm.model.report import Report
from gpsfsm.reading import read_plan
from gpsfsm.selection import apply_suppressions
from gpsfsm.workers.memory import limit_memory

if TYPE_CHECKING:
    from gpsfsm.baseline import Baseline
    from gpsfsm.fixing.edit import Edit
    from gpsfsm.model.finding import Finding
    from gpsfsm.model.report import PlanReport

__all__ = ["Job", "Mended", "Result", "Work"]

Result: TypeAlias = "PlanReport | tuple[Mended, ...] | str | bool"
"""The report of a check; the fixes of a finding; the text after all fixes; whether it is so."""

MEMORY_MB = 2_048
_LOOK_S = 1.0
_WARM = """<Plan><Control type="parallel_all"><Runner interface="a/A" provider="a/A"/>
<Runner interface="a/B" provider="a/B"/></Control></Plan>"""


@dataclass(frozen=True, slots=True)
class Mended:
    """A fix that is proved: what it does, and its edits."""

    title: str
    edits: tuple[Edit, ...]
    safe: bool


@dataclass(frozen=True, slots=True)
class Job:
    """A text and what is to be done with it.

    ``setting`` is the number of a setting, and ``packed`` what it holds, only where it is new.
    ``fix`` mends ``finding``, ``fix-all`` all that can be mended safely; ``allows`` tells whether a
    comment in the text allows ``finding``.
    """

    kind: Literal["warm", "check", "fix", "fix-all", "allows"]
    text: str = ""
    path: str = ""
    setting: int = 0
    packed: bytes = b""
    finding: Finding | None = None


@dataclass(slots=True)
class Work:
    """What the process knows between its jobs."""

    known: dict[int, tuple[CheckOptions, Baseline | None]] = field(default_factory=dict)

    def __call__(self, job: Job) -> Result:
        """Do a job. Never raises for what is in the text."""
        if job.kind == "warm":
            return self._warm()
        if job.packed:
            # From the process that has started this one; nothing of a plan is in it.
            self.known = {job.setting: pickle.loads(job.packed)}  # noqa: S301
        options, baseline = self.known[job.setting]
        if job.kind == "check":
            report = check_text(job.text, job.path, options)
            return report if baseline is None else baseline.apply(Report((report,))).plans[0]
        if job.kind == "allows":
            return _allows(job, options)
        try:
            return _mend(job, options)
        except Exception:  # a defect of a fix: there is nothing to offer, and the check goes on
            return () if job.kind == "fix" else job.text

    def _warm(self) -> PlanReport:
        """Load what checks need, so that the first one does not wait for it."""
        with suppress(OSError, ValueError):
            limit_memory(MEMORY_MB)
        threading.Thread(target=_end_with, args=(os.getppid(),), daemon=True).start()
        check_text(_WARM, "", CheckOptions())
        return failed("", "")


def _end_with(server: int) -> None:
    """End this process, whatever it does, once the server is gone: an editor may have killed it."""
    while os.getppid() == server:
        time.sleep(_LOOK_S)
    os._exit(0)


def _allows(job: Job, options: CheckOptions) -> bool:
    assert job.finding is not None
    read = read_plan(job.text, limits=options.limits, from_response=options.from_response)
    _, allowed, _ = apply_suppressions((job.finding,), read.suppressions)
    return bool(allowed)


def _mend(job: Job, options: CheckOptions) -> tuple[Mended, ...] | str:
    if job.kind == "fix-all":
        from gpsfsm.fixing import fix_text  # noqa: PLC0415  (few ask for it)

        fixed = fix_text(job.text, options, path=job.path)
        return fixed.text if fixed.applied else job.text
    from gpsfsm.lsp.mending import proved  # noqa: PLC0415  (loads the fixers)

    assert job.finding is not None
    analysis = replace(options.analysis, max_scenarios=0)
    return proved(job.text, job.path, job.finding, replace(options, analysis=analysis))
