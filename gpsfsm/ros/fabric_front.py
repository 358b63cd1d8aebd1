"""The front of a Fabric server: its public names, behind which only what is accepted gets through.

The server itself offers its names below a private namespace, by remapping. Whoever submits a plan
gets the answer of a ``Keeper`` first, who decides about texts and knows nothing of ROS. All fails
closed: whatever goes wrong, the answer is that of a server that rejects a plan; and while another
server offers a public name, or the private one is gone, nothing is passed on.

    client ── /fabric/plan/submit ──▶ front ── accepted ──▶ /private/fabric/plan/submit
"""

from __future__ import annotations

import asyncio
import threading
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, Protocol

from gpsfsm.errors import GpsfsmError
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import RosCall, RosKind
from gpsfsm.ros import fabric as names
from gpsfsm.ros.actions import SUCCEEDED, Action, Goal
from gpsfsm.ros.fabric import Fabric, servers_of
from gpsfsm.ros.ledger import Ledger
from gpsfsm.ros.messages import definition
from gpsfsm.ros.node import RosError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from gpsfsm.ros.node import RosNode

DECIDING, PASSING, GENERATING = 4, 4, 2
"""The numbers of plans on their way, of other requests of each kind, of plans being generated."""
_PASSED = (names.CANCEL, names.STATUS, names.COMPLETE, names.PARSE)
THREADS = DECIDING + PASSING * len(_PASSED) + GENERATING + 2
"""The threads that the node of a front needs: one for each of these, and for what they wait for."""

_SETTLE_S = 1.0
"""For the graph to show who offers the public names."""
_GENERATE_S = 900.0
_PROBE_S, _CANCEL_S = 60.0, 4.0
_LONGEST = 8_000
"""Letters of an error in an answer."""


class Keeper(Protocol):
    """The one who decides about texts; may be called from several threads."""

    def refused(self, plan: str, service: str) -> str:
        """The reason why a plan may not run, "" if it may."""

    def passed(self, service: str, plan_id: str, error: str) -> None:
        """A plan was accepted and passed on; ``plan_id`` "" if the server has not taken it."""

    def critique(self, plan: str) -> tuple[bool, str]:
        """True if a plan may run, and the findings, as a language model reads them."""

    def trouble(self, message: str) -> None:
        """Something is wrong with the server or the graph; may be said many times."""


class FabricFront:
    """Offers the public names of a Fabric server, ``private``, which has others.

    Raises RosError if somebody else offers them.
    """

    def __init__(
        self, node: RosNode, private: Fabric, keeper: Keeper, root: str = names.PUBLIC
    ) -> None:
        self._node, self._private, self._keeper, self._root = node, private, keeper, root
        self._release = private.release
        self._own = {f"{root}/{name}" for name in _public(self._release)}
        self._public = [f"{root}/{name}" for each in names.RELEASES for name in _public(each)]
        self._deciding = threading.BoundedSemaphore(DECIDING)
        self._passing = {what: threading.BoundedSemaphore(PASSING) for what in _PASSED}
        self._generating = threading.BoundedSemaphore(GENERATING)
        self._action: tuple[Any, ...] = ()  # client and server of the one that generates
        self._refuse_others()
        self._offer()

    def close(self) -> None:
        """Take back the action: a node does not end well with one."""
        action, self._action = self._action, ()
        self._node.do(lambda: [each.destroy() for each in action])

    def _refuse_others(self) -> None:
        time.sleep(_SETTLE_S)
        for name in self._public:
            if servers_of(self._node, name):
                raise RosError(
                    f"another server offers {name}: plans could get past the gate; start Fabric "
                    f"with its names remapped below {self._private.root}"
                )

    def _offer(self) -> None:
        handlers = {
            names.SUBMIT: self._submit,
            names.CANCEL: self._cancel,
            names.STATUS: self._status,
            names.COMPLETE: self._complete,
            names.PARSE: self._parse,
        }
        for what, name, _ in self._release.services:
            self._serve(self._private.kind(what), f"{self._root}/{name}", handlers[what])
        if self._release.generates:
            self._node.do(self._offer_generation)
            self._serve(definition("fabric_msgs/srv/ParsePlan"), "~/critique", self._critique)
        else:
            self._serve(self._private.kind(names.SUBMIT), "~/critique", self._critique)

    def _serve(self, kind: Any, name: str, handler: Callable[[Any, Any], None]) -> None:
        from rclpy.callback_groups import ReentrantCallbackGroup

        def handled(request: Any, response: Any) -> Any:
            try:
                handler(request, response)
            except Exception as error:  # the answer of a gate that breaks is a rejection
                self._keeper.trouble(f"{name}: {type(error).__name__}: {clip(str(error), 300)}")
                return kind.Response()
            return response

        self._node.do(
            lambda: self._node.handle.create_service(
                kind, name, handled, callback_group=ReentrantCallbackGroup()
            )
        )

    # -- whether anything may be passed on ----------------------------------------------------

    def trouble(self) -> str:
        """The reason why nothing is passed on now, "" if there is none."""
        for name in self._public:
            if servers_of(self._node, name) > (name in self._own):
                return f"another server offers {name} as well, so plans could get past the gate"
        if not self._private.is_ready(names.SUBMIT):
            return f"there is no Fabric server below {self._private.root}"
        return ""

    def _why_not(self, plan: str, service: str) -> str:
        """The reason why a plan is not passed on."""
        try:
            why = self.trouble()
            if why:
                self._keeper.trouble(why)
            return why or self._keeper.refused(plan, service) or self.trouble()
        except Exception as error:
            why = _words(error)
            self._keeper.trouble(f"{service}: {why}")
            return f"the gate could not decide: {why}"

    # -- services -----------------------------------------------------------------------------

    def _submit(self, request: Any, response: Any) -> None:
        response.plan_id, response.error = self._submitted(request)

    def _submitted(self, request: Any) -> tuple[str, str]:
        """The id of a plan, or why it is rejected.

        The place is held until the server has answered: else plans that wait for a server that is
        slow would take the threads in which its answers arrive.
        """
        try:
            with _place(self._deciding):
                return self._decided_and_passed(request)
        except RosError as error:
            self._keeper.trouble(f"{names.SUBMIT}: {error}")
            return "", _short(f"rejected by the gate: {error}")

    def _decided_and_passed(self, request: Any) -> tuple[str, str]:
        why = self._why_not(request.plan, names.SUBMIT)
        if why:
            return "", _short(f"rejected by the gate: {why}")
        try:
            answer = self._private.request(names.SUBMIT, request)
        except RosError as error:
            self._keeper.passed(names.SUBMIT, "", str(error))
            return "", _short(
                f"the gate accepted the plan and passed it on, but {error}: it may run anyway"
            )
        self._keeper.passed(names.SUBMIT, answer.plan_id, answer.error)
        return answer.plan_id, answer.error

    def _passed_on(self, what: str, request: Any, response: Any) -> bool:
        """Fill in the answer of the server; False if there is none."""
        try:
            with _place(self._passing[what]):
                answer = self._private.request(what, request)
        except RosError as error:
            self._keeper.trouble(str(error))
            return False
        for name in answer.get_fields_and_field_types():
            setattr(response, name, getattr(answer, name))
        return True

    def _cancel(self, request: Any, response: Any) -> None:
        if not self._passed_on(names.CANCEL, request, response):
            response.success = False

    def _status(self, request: Any, response: Any) -> None:
        if not self._passed_on(names.STATUS, request, response):
            response.status.code = names.Code.UNKNOWN

    def _complete(self, request: Any, response: Any) -> None:
        self._passed_on(names.COMPLETE, request, response)

    def _parse(self, request: Any, response: Any) -> None:
        """The server itself would parse the plan, and some texts bring it down: gated as well."""
        try:
            with _place(self._deciding):
                why = self._why_not(request.plan, names.PARSE)
        except RosError as error:
            why = str(error)
        if why:
            response.success, response.error = False, _short(f"rejected by the gate: {why}")
        elif not self._passed_on(names.PARSE, request, response):
            response.success, response.error = False, "the Fabric server does not answer"

    def _critique(self, request: Any, response: Any) -> None:
        try:
            with _place(self._deciding):
                accepted, text = self._keeper.critique(request.plan)
        except RosError as error:
            accepted, text = False, str(error)
        response.error = text
        if self._release.generates:
            response.success = accepted

    # -- the action that generates plans ------------------------------------------------------

    def _offer_generation(self) -> None:
        from rclpy.action import ActionClient, ActionServer, CancelResponse
        from rclpy.callback_groups import ReentrantCallbackGroup

        node, group = self._node.handle, ReentrantCallbackGroup()
        kind = definition(names.GENERATE)
        path = self._release.generates
        private = f"{self._private.root}/{path}"
        client = ActionClient(node, kind, private, callback_group=group)
        server = ActionServer(
            node,
            kind,
            f"{self._root}/{path}",
            self._generate,
            callback_group=group,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
        )
        call = RosCall(RosKind.ACTION, name=private, probe_s=_PROBE_S)
        own = Action(
            *(self._node, client, kind, call),
            resources=None,  # it moves nothing, and several may generate at once
            ledger=Ledger(),
            doubt_s=_GENERATE_S,
        )
        self._action = (own, server)

    def _generate(self, handle: Any) -> Any:
        """Let the server generate a plan but not queue it; that is done here, once it is gated."""
        kind = definition(names.GENERATE)
        result = kind.Result()
        try:
            with _place(self._generating):
                status, answer = asyncio.run(self._generated(kind, handle))
            result.plan, result.reasoning = answer.plan, answer.reasoning
            result.header = answer.header
            if answer.plan_id:  # however it has ended
                why = "the server has queued a plan that it was to generate only"
                self._keeper.trouble(why)
                self._private.cancel(answer.plan_id)
                raise RosError(why)
            if status != SUCCEEDED:
                raise RosError("the Fabric server has generated no plan")
            if handle.request.auto_queue:
                result.plan_id = self._queued(answer.plan)
            handle.succeed()
        except Exception as error:
            why = _words(error)
            self._keeper.trouble(f"{self._release.generates}: {clip(why, 300)}")
            result.reasoning = _short(f"{why}\n{result.reasoning}".strip())
            (handle.canceled if handle.is_cancel_requested else handle.abort)()
        return result

    async def _generated(self, kind: Any, handle: Any) -> tuple[int, Any]:
        """The end of the goal, without its wish to be queued. Raises RosError."""
        goal = kind.Goal()
        for name in goal.get_fields_and_field_types():
            setattr(goal, name, getattr(handle.request, name))
        goal.auto_queue = False
        # a model is slow, and the server may serve nothing else meanwhile
        key = bytes(handle.goal_id.uuid).hex()
        sent: Goal = self._action[0].goal(key, handle.publish_feedback)
        if not await sent.send(goal):
            raise RosError("the Fabric server has rejected the goal")
        task = asyncio.ensure_future(sent.result())
        end = time.monotonic() + _GENERATE_S
        while not task.done():
            await asyncio.wait([task], timeout=0.1)
            if handle.is_cancel_requested or time.monotonic() > end:
                await sent.cancel(_CANCEL_S)
                task.cancel()
                raise RosError("the generation of a plan was cancelled")
        return task.result()

    def _queued(self, plan: str) -> str:
        """The id of a generated plan that is accepted and submitted. Raises RosError."""
        message = self._private.message(names.SUBMIT)
        message.plan = plan
        plan_id, error = self._submitted(message)
        if not plan_id:
            raise RosError(error)
        return plan_id


def _public(release: names.Release) -> list[str]:
    """The services by which plans get to a server, with that in which its action takes goals."""
    listed = [name for _, name, _ in release.services]
    if release.generates:
        listed.append(f"{release.generates}/_action/send_goal")
    return listed


def _words(error: Exception) -> str:
    """An error for people, as far as it is made for them."""
    return str(error) if isinstance(error, GpsfsmError) else type(error).__name__


@contextmanager
def _place(places: threading.BoundedSemaphore) -> Iterator[None]:
    """A place among those that wait. Raises RosError if all are taken."""
    if not places.acquire(blocking=False):
        raise RosError("the gate is busy; try again later")
    try:
        yield
    finally:
        places.release()


def _short(text: str) -> str:
    """A text that every client can take."""
    clean = text.encode("utf-8", "backslashreplace").decode()
    return clean if len(clean) <= _LONGEST else f"{clean[: _LONGEST - 1]}…"
