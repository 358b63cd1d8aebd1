"""The Fabric server, as its clients see it: plans are queued and executed one after the other.

    python -m tests.ros.servers.fabric --version 2|3 [--prefix /fabric] [--queue-ends] [--forgets]
        [--action-prefix /fabric]

It executes nothing: a plan walks through the states of a run. Commands:

- ``next``: the end of the next plan, and the elements that are rejected if it is one of a check;
- ``pace``: the seconds in each state, and null for one state per command ``step``;
- ``generate``: fields of the next result of the action ``generate``;
- ``answer_after``: the seconds that plans which are submitted wait for their answer, and
  ``status_after`` likewise for requests of the status.

Version 2 needs the interfaces of ``fabric-v2``. With ``--queue-ends`` it is like the original in
that nothing takes plans out of its queue once that was empty; with ``--forgets`` version 3 does not
know the state of a plan that has left the queue.
"""

from __future__ import annotations

import argparse
import threading
import time
import uuid
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree as ET

from fabric_msgs.msg import FabricStatus
from rclpy.action import ActionServer

from tests.ros.servers.base import FakeServer, arguments, of_choices, scripted
from tests.ros.servers.messages import as_json, filled, type_named

WALK = (
    "PARSING",
    "VALIDATING",
    "BONDING",
    "CAPABILITY_STARTING",
    "CAPABILITY_CONNECTING",
    "RUNNING",
)
FAILURES = {
    "PARSE_FAILED": "PARSING",
    "VALIDATION_FAILED": "VALIDATING",
    "BOND_FAILED": "BONDING",
    "CAPABILITY_START_FAILED": "CAPABILITY_STARTING",
    "CAPABILITY_CONNECT_FAILED": "CAPABILITY_CONNECTING",
}
"""The failures, with the state that each of them follows."""
OUTCOMES = ("COMPLETED", "HANG", "REFUSED", *FAILURES)
NAMES = {
    2: {
        "submit": ("set_plan", "SetFabricPlan"),
        "cancel": ("cancel_plan", "CancelFabricPlan"),
        "get_status": ("get_plan_status", "GetPlanStatus"),
        "set_completion": ("set_completion", "CompleteFabric"),
    },
    3: {
        "submit": ("plan/submit", "SubmitFabricPlan"),
        "cancel": ("plan/cancel", "CancelFabricPlan"),
        "get_status": ("plan/get_status", "GetPlanStatus"),
        "set_completion": ("plan/set_completion", "CompleteFabric"),
        "parse": ("plan/parse", "ParsePlan"),
    },
}
_LONGEST_PLAN = 1_000_000


@dataclass(kw_only=True, eq=False)
class Plan:
    """A plan that was submitted, and its state."""

    plan_id: str
    text: str
    outcome: str
    rejected: list[str] = field(default_factory=list)
    status: str = "QUEUED"
    metadata: Any = None
    is_complete: bool = False
    is_cancelled: bool = False


class Fabric(FakeServer):
    """The services of one version, and the queue behind them."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__("fake_fabric")
        self.version: int = options.version
        self.queue_ends, self.forgets = options.queue_ends, options.forgets
        self.pace: float | None = options.pace
        self.answer_after = self.status_after = 0.0
        self.outcomes: list[dict[str, Any]] = []
        self.generated: list[dict[str, Any]] = []
        self.queue: list[Plan] = []
        self.current: Plan | None = None
        self._steps = 0
        self._news = threading.Condition()
        self._worker = threading.Thread(target=self._process, name="queue")
        self._worker.start()
        for method, (name, short) in NAMES[self.version].items():
            service_type = type_named(f"fabric_msgs/srv/{short}")
            self.serve(service_type, f"{options.prefix}/{name}", getattr(self, f"_{method}"))
        if self.version == 3:
            action_type = type_named("fabric_msgs/action/GeneratePlan")
            name = f"{options.action_prefix or options.prefix}/plan/generate"
            self.keep(
                ActionServer(
                    self.node, action_type, name, self._generate, callback_group=self.group
                )
            )

    def do_next(self, outcome: str, rejected: tuple[str, ...] = (), error: str = "") -> None:
        of_choices(outcome, OUTCOMES)
        self.outcomes.append({"outcome": outcome, "rejected": list(rejected), "error": error})

    def do_pace(self, seconds: float | None) -> None:
        with self._news:
            self.pace = seconds
            self._news.notify_all()

    def do_step(self) -> None:
        with self._news:
            self._steps += 1
            self._news.notify_all()

    def do_answer_after(self, seconds: float) -> None:
        self.answer_after = seconds

    def do_status_after(self, seconds: float) -> None:
        self.status_after = seconds

    def do_generate(self, **result: Any) -> None:
        self.generated.append(result)

    def stop(self) -> None:
        with self._news:
            self._news.notify_all()
        self._worker.join()

    def _submit(self, request: Any, response: Any) -> Any:
        if self.answer_after:
            self.journal("asked")
            self.stopping.wait(self.answer_after)
        plan, response.error = self._add(request.plan, getattr(request, "metadata", None))
        response.plan_id = plan.plan_id if plan is not None else ""
        return response

    def _add(self, text: str, metadata: Any = None) -> tuple[Plan | None, str]:
        """The plan in the queue, or an error."""
        script = scripted(self.outcomes, {"outcome": "COMPLETED", "rejected": [], "error": ""})
        if script["outcome"] == "REFUSED":
            self.journal("refused", plan=text, error=script["error"])
            return None, script["error"]
        plan = Plan(
            plan_id=str(uuid.uuid4()),
            text=text,
            outcome=script["outcome"] if _runners(text) else "PARSE_FAILED",
            rejected=script["rejected"],
            metadata=metadata,
        )
        with self._news:
            self.queue.append(plan)
            self._news.notify_all()
        fields = {} if metadata is None else {"metadata": as_json(metadata)}
        self.journal("submitted", plan_id=plan.plan_id, plan=text, **fields)
        return plan, ""

    def _cancel(self, request: Any, response: Any) -> Any:
        plan = self._plan(request.plan_id)
        self.journal("cancel", plan_id=request.plan_id, has_plan=plan is not None)
        response.success = self.version == 2 or plan is not None
        if self.version == 3 and plan is not None:
            with self._news:
                plan.is_cancelled = True
                if plan in self.queue:
                    self.queue.remove(plan)
                    self._enter(plan, "CANCELLED")
                self._news.notify_all()
        return response

    def _get_status(self, request: Any, response: Any) -> Any:
        self.stopping.wait(self.status_after)
        plan = self._plan(request.plan_id)
        if self.forgets and plan not in self.queue:
            plan = None
        status = "UNKNOWN" if plan is None else plan.status
        response.status.code = getattr(FabricStatus, status)
        if self.version == 3:
            response.status.plan_id = request.plan_id
            if plan is not None and plan.metadata is not None:
                response.status.metadata = plan.metadata
        if status in ("PARSE_FAILED", "VALIDATION_FAILED") and plan is not None:
            response.rejected_list = plan.rejected
        return response

    def _set_completion(self, request: Any, response: Any) -> Any:
        self.journal("set_completion", plan_id=request.plan_id)
        with self._news:
            if self.current is not None and self.current.plan_id == request.plan_id:
                self.current.is_complete = True
                self._news.notify_all()
        return response

    def _parse(self, request: Any, response: Any) -> Any:
        """One connection per runner, each to the next one in the text; the nesting is ignored."""
        runners = _runners(request.plan)
        self.journal("parse", plan=request.plan, runners=len(runners))
        response.success = bool(runners)
        response.error = "" if runners else "the plan is not XML, or has no runners"
        nodes = [
            {"interface": name, "provider": provider, "instance_id": number}
            for number, (name, provider) in enumerate(runners)
        ]
        connections = [{"source": node} for node in nodes]
        for connection, following in zip(connections, nodes[1:], strict=False):
            connection["on_success"] = following
        return filled(response, {"connections": connections})

    def _generate(self, handle: Any) -> Any:
        action_type = type_named("fabric_msgs/action/GeneratePlan")
        request = handle.request
        self.journal("generate", task=request.task, auto_queue=request.auto_queue)
        for name in ("GENERATION_REQUESTED", "GENERATION_COMPLETE"):
            feedback = action_type.Feedback()
            feedback.status.code = getattr(FabricStatus, name)
            handle.publish_feedback(feedback)
            if not self._rest() or handle.is_cancel_requested:
                handle.abort()
                return action_type.Result()
        result = filled(action_type.Result(), scripted(self.generated, {"plan": "<Plan/>"}))
        if request.auto_queue:
            plan, _ = self._add(result.plan)
            result.plan_id = plan.plan_id if plan is not None else ""
        handle.succeed()
        return result

    def _plan(self, plan_id: str) -> Plan | None:
        """The current plan or one in the queue: no other is remembered."""
        with self._news:
            plans = [*([] if self.current is None else [self.current]), *self.queue]
        return next((plan for plan in plans if plan.plan_id == plan_id), None)

    def _process(self) -> None:
        while not self.stopping.is_set():
            with self._news:
                self._news.wait_for(lambda: self.queue or self.stopping.is_set())
            while self.queue and self._rest():
                with self._news:
                    if not self.queue:  # it was cancelled meanwhile
                        break
                    plan = self.current = self.queue.pop(0)
                self._execute(plan)
            if self.queue_ends:
                self.journal("queue_ended")
                return

    def _execute(self, plan: Plan) -> None:
        """Walk through the states until one of them is the last."""
        for status in WALK:
            self._enter(plan, status)
            if not self._rest(plan):
                return
            if plan.is_cancelled:
                self._enter(plan, "CANCELLED")
                return
            if FAILURES.get(plan.outcome) == status:
                self._enter(plan, plan.outcome)
                return
        if plan.outcome == "HANG":
            with self._news:
                self._news.wait_for(
                    lambda: plan.is_complete or plan.is_cancelled or self.stopping.is_set()
                )
            if self.stopping.is_set():
                return
        self._enter(plan, "CANCELLED" if plan.is_cancelled else "COMPLETED")

    def _enter(self, plan: Plan, status: str) -> None:
        plan.status = status
        self.journal("status", plan_id=plan.plan_id, status=status)

    def _rest(self, plan: Plan | None = None) -> bool:
        """Stay in a state as long as the pace has it, and not when the server is stopped."""
        end = time.monotonic() + (self.pace or 0)

        def over() -> bool:
            cancelled = plan is not None and plan.is_cancelled
            paced = self._steps > 0 if self.pace is None else time.monotonic() >= end
            return self.stopping.is_set() or cancelled or paced

        with self._news:
            while not over():
                self._news.wait(None if self.pace is None else max(0.0, end - time.monotonic()))
            if self.pace is None and self._steps:
                self._steps -= 1
        return not self.stopping.is_set()


def _runners(text: str) -> list[tuple[str, str]]:
    """Interface and provider of each runner of a plan, and none if it is not XML."""
    if len(text) > _LONGEST_PLAN:
        return []
    try:
        root = ET.fromstring(text)  # noqa: S314
    except ET.ParseError:
        return []
    runners = [element for element in root.iter() if element.tag == "Runner"]
    return [(each.get("interface", ""), each.get("provider", "")) for each in runners]


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--version", type=int, choices=(2, 3), default=3)
    parser.add_argument("--prefix", default="/fabric")
    parser.add_argument("--action-prefix", default="")
    parser.add_argument("--pace", type=float, default=0.02)
    parser.add_argument("--queue-ends", action="store_true")
    parser.add_argument("--forgets", action="store_true")
    Fabric(parser.parse_args(arguments())).run()
