"""One goal of an action, from its sending to its end, whatever becomes of its server.

The graph of ROS 2 is not to be trusted here: a server that was killed stays listed for some twenty
seconds, and the result of its goals never comes, not even after it is back. So whoever waits looks
for signs of life: feedback, or else the answer to a request to cancel a goal that does not exist,
which any server refuses at once; and then the result is requested anew, since a server that was
restarted knows nothing of the goal and says so.

    silent for probe_s ── cancel an unknown goal ──▶ no answer within probe_s, 3 times: it is gone
                                                └─▶ answered: request the result again
                                                         ├─▶ UNKNOWN: it was restarted, goal lost
                                                         └─▶ nothing: it is working, look later
"""

from __future__ import annotations

import asyncio
import time
import uuid
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.ros.node import Answer, RosError

if TYPE_CHECKING:
    from collections.abc import Callable

    from gpsfsm.model.ros import RosCall
    from gpsfsm.ros.node import RosNode

UNKNOWN, SUCCEEDED, CANCELED, ABORTED = 0, 4, 5, 6
"""Codes of action_msgs/msg/GoalStatus."""

_UNKNOWN_GOAL, _ENDED_ALREADY = 2, 3
"""Return codes of action_msgs/srv/CancelGoal."""

_TRIES = 3
"""Signs of life that may stay out before a server counts as gone."""
_MOST_PAUSE = 15.0
"""A silent server has to give a sign of life at least once in so many multiples of ``probe_s``."""
_CANCEL_S = 2.0
_ACCEPT_S = 10.0
"""What a server may take at most to accept a goal."""
_NAMESPACE = uuid.UUID("5b0ff1a2-2f7f-4a0e-9a53-0d4d3f6a8c11")


class GoneError(RosError):
    """The server of a goal does not answer any more, or has lost the goal."""


def goal_id(key: str) -> uuid.UUID:
    """The id of the goal of an action of a run: the same after a resume."""
    return uuid.uuid5(_NAMESPACE, key)


class Goal:
    """A goal. ``feedback`` gets each message of feedback, in the thread of the node.

    ``client`` is an ActionClient of rclpy, ``kind`` its definition.
    """

    def __init__(
        self,
        node: RosNode,
        client: Any,
        kind: Any,
        key: str,
        *,
        call: RosCall,
        feedback: Callable[[Any], None],
    ) -> None:
        self._node, self._client, self._kind, self._call = node, client, kind, call
        self._id = goal_id(key)
        self._feedback = feedback
        self._heard = time.monotonic()
        self._handle = self._handle_of(self._id)
        self._sent: Answer[Any] | None = None

    async def send(self, goal: Any) -> bool:
        """Send it; False if the server does not want it. Raises GoneError without an answer.

        A server refuses a goal whose id it has, such as one that another process has sent; and the
        answer to a goal can be lost on the way. In both cases it is the server that says whether it
        has the goal.
        """
        answer: Answer[Any] = Answer(
            self._node,
            lambda: self._client.send_goal_async(
                goal, feedback_callback=self._on_feedback, goal_uuid=self._handle.goal_id
            ),
        )
        self._sent = answer
        try:
            handle = await answer.within(min(max(2 * self._call.probe_s, 2.0), _ACCEPT_S))
            accepted = bool(handle.accepted)
        except TimeoutError:
            if not await self._alive():
                raise GoneError("the server does not answer the goal") from None
            accepted = False
        self._heard = time.monotonic()
        return accepted or await self._has_it()

    async def _has_it(self) -> bool:
        """True if the server has this goal already: another process has sent it."""
        answer = self._request()
        try:
            status = (await answer.within(min(self._call.probe_s, _CANCEL_S))).status
        except TimeoutError:  # it is working on it
            return True
        return int(status) != UNKNOWN

    async def result(self) -> tuple[int, Any]:
        """The status and the result. Raises GoneError if they will never come.

        Silence of ``silence_s`` is a reason as well, where feedback is promised.
        """
        answers = [self._request()]
        pause, failures = self._call.probe_s, 0
        while True:
            done = next((each for each in answers if each.done), None)
            if done is not None:
                response = await done.within(0)
                if int(response.status) == UNKNOWN:
                    raise GoneError("the server was restarted and has lost the goal")
                return int(response.status), response.result
            await self._wait(answers, pause)
            quiet = time.monotonic() - self._heard
            if any(each.done for each in answers):
                continue
            if self._call.silence_s and quiet >= self._call.silence_s:
                raise GoneError(f"no feedback for {self._call.silence_s:g} s")
            if quiet < self._call.probe_s:
                pause, failures = self._call.probe_s, 0
                continue
            if await self._alive():
                failures, pause = 0, min(2 * pause, _MOST_PAUSE * self._call.probe_s)
                answers = [answers[0], self._request()]
            else:
                failures += 1
                pause = 0.0
                if failures == _TRIES:
                    raise GoneError("the server no longer answers")

    async def _wait(self, answers: list[Answer[Any]], seconds: float) -> None:
        if self._call.silence_s:
            left = self._heard + self._call.silence_s - time.monotonic()
            seconds = min(seconds, max(left, 0.0) + 0.001)
        waiting = [asyncio.ensure_future(each.within(0)) for each in answers]
        try:
            await asyncio.wait(waiting, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for each in waiting:
                each.cancel()

    def abandon(self) -> None:
        """Ask for it to be cancelled, and wait for nothing: nobody seems to be there."""
        self._node.call(self._handle.cancel_goal_async)

    async def cancel(self) -> str:
        """Cancel it, and wait until it has ended; "" if it has, else what remains unsure.

        A goal that has just been sent is cancelled once it is accepted: before that the server
        knows of no goal, and would begin it afterwards.
        """
        if self._sent is not None and not self._sent.done:
            with suppress(TimeoutError):
                await self._sent.within(_CANCEL_S / 2)
        answer: Answer[Any] = Answer(self._node, self._handle_of(self._id).cancel_goal_async)
        try:
            response = await answer.within(_CANCEL_S)
        except TimeoutError:
            return "the server does not answer the request to cancel its goal"
        if response.return_code == _UNKNOWN_GOAL:
            answered = self._sent is None or self._sent.done
            return "" if answered else "the server has not answered the goal, and may yet begin it"
        if response.return_code not in (0, _ENDED_ALREADY):
            return "the server does not cancel the goal"
        with suppress(TimeoutError):
            await self._request().within(_CANCEL_S)
            return ""
        return "the goal has not ended within 2 s of being cancelled"

    def _on_feedback(self, message: Any) -> None:
        self._heard = time.monotonic()
        self._feedback(message.feedback)

    async def _alive(self) -> bool:
        nobody = self._handle_of(uuid.uuid4())
        answer: Answer[Any] = Answer(self._node, nobody.cancel_goal_async)
        try:
            await answer.within(self._call.probe_s)
        except TimeoutError:
            return False
        return True

    def _request(self) -> Answer[Any]:
        """The result, requested once more."""
        return Answer(self._node, self._handle.get_result_async)

    def _handle_of(self, which: uuid.UUID) -> Any:
        """A handle of a goal, whoever has sent it."""
        from rclpy.action.client import ClientGoalHandle
        from unique_identifier_msgs.msg import UUID

        response = self._kind.Impl.SendGoalService.Response()
        response.accepted = True
        return ClientGoalHandle(self._client, UUID(uuid=list(which.bytes)), response)
