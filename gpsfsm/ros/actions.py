"""Goals of an action, from their sending to their ends, whatever becomes of their server.

The graph of ROS 2 is not to be trusted here: a server that was killed stays listed for some twenty
seconds, and the result of its goals never comes, not even after it is back. So whoever waits looks
for signs of life: feedback, the status topic, or the answer to a request to cancel a goal that does
not exist, which any server refuses at once. What a server says goes into the ledger
(``gpsfsm.ros.ledger``) in the thread of the node, whether anybody still waits for it or not::

    silent for probe_s ── cancel an unknown goal ──▶ no answer, 3 times: the goal is UNKNOWN
                                                └─▶ answered: request the result again
                                                         ├─▶ not known there: lost, or never begun
                                                         └─▶ nothing: it is working, look later

An answer that the goal is not known proves something only if the goal had been accepted when it was
asked for, or if a server answers that has appeared since the goal was sent: else the goal may still
be on its way. A goal that is not wanted any more is cancelled again and again, until it has ended.
"""

from __future__ import annotations

import asyncio
import time
import uuid
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.runner import InDoubtError
from gpsfsm.model.ros import OnResume
from gpsfsm.ros.ledger import LOST, NEVER, OURS, Entry, GoalState, Ledger, Said, goal_id
from gpsfsm.ros.node import Answer, RosError

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.ros import RosCall
    from gpsfsm.ros.ledger import Tell
    from gpsfsm.ros.node import RosNode

UNKNOWN, SUCCEEDED, CANCELED, ABORTED = 0, 4, 5, 6
"""Codes of action_msgs/msg/GoalStatus."""
_ENDS = {SUCCEEDED: "succeeded", CANCELED: "canceled", ABORTED: "aborted"}

_UNKNOWN_GOAL, _NOT_CANCELABLE = 2, 3
"""Return codes of action_msgs/srv/CancelGoal. A goal that is being cancelled is not cancelable a
second time (rcl_action_process_cancel_request), so that proves no end, whatever the code is called.
"""

_TRIES = 3
"""Signs of life that may stay out before a server counts as silent."""
_MOST_PAUSE = 15.0
"""A silent server has to give a sign of life at least once in so many multiples of ``probe_s``."""
_LOOK_S = 1.0
"""Between two looks at the graph, where a server that was restarted shows."""
_AGAIN_S = 0.5
"""Between two requests to cancel a goal that is not wanted any more."""
_ASK_S, _SOON_S = 2.0, 0.2
_ACCEPT_S = 10.0
"""What a server may take at most to accept a goal, before it is asked whether it has it."""


class GoneError(RosError):
    """The server of a goal has lost it, or says nothing of it any more: it does not act."""


class ForgottenError(GoneError):
    """The status topic says how a goal has ended, and its server has forgotten the result."""

    def __init__(self, how: str) -> None:
        super().__init__(f"its server says that the goal has {how}, and has forgotten the rest")
        self.how = how


class Action:
    """One action of the robot: its client, its status topic, and our goals there.

    To be made in the thread of the node. ``client`` is an ActionClient of rclpy, ``kind`` its
    definition; ``resources`` are what its goals use besides itself, None if nothing is exclusive.
    """

    def __init__(
        self,
        node: RosNode,
        client: Any,
        kind: Any,
        call: RosCall,
        *,
        resources: frozenset[str] | None = frozenset(),
        ledger: Ledger = OURS,
        doubt_s: float = 30.0,
    ) -> None:
        from action_msgs.msg import GoalStatusArray
        from rclpy.qos import DurabilityPolicy, QoSProfile

        self.node, self.client, self.kind, self.call = node, client, kind, call
        self.name = node.name(call.name)
        self.resources = frozenset() if resources is None else resources | {self.name}
        self.ledger, self.doubt_s = ledger, doubt_s
        self._goals: dict[str, Goal] = {}
        self._topic = f"{self.name}/_action/status"
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        handle = node.handle
        self._status = handle.create_subscription(
            GoalStatusArray, self._topic, self._take_status, latched
        )
        self._timer = handle.create_timer(_AGAIN_S, self._cancel_again)
        self._timer.cancel()
        self._closing = False

    def goal(
        self,
        key: str,
        feedback: Callable[[Any], None] = lambda _: None,
        tell: Tell = lambda *_: None,
    ) -> Goal:
        """A goal of this name; ``feedback`` gets each message of it, in the thread of the node.

        ``tell`` gets the lines of the ledger about it.
        """
        return Goal(self, key, feedback, tell)

    def servers(self) -> frozenset[bytes]:
        """The servers on the graph, by the ids of their status topics."""
        infos = self.node.handle.get_publishers_info_by_topic(self._topic)
        return frozenset(bytes(info.endpoint_gid) for info in infos)

    def close(self) -> None:
        """Let go of it once none of its goals may act any more; in the thread of the node."""
        self._closing = True
        if any(map(self.ledger.may_act, self._goals)):
            self.keep_cancelling()
        else:
            self.destroy()

    def destroy(self) -> None:
        """Let go of it at once; in the thread of the node."""
        self.node.handle.destroy_timer(self._timer)
        self.node.handle.destroy_subscription(self._status)
        self.client.destroy()

    def enter(self, goal: Goal) -> None:
        """Follow a goal from now on."""
        open_goals = {name: each for name, each in self._goals.items() if self.ledger.may_act(name)}
        self._goals = {**open_goals, goal.name: goal}

    def keep_cancelling(self) -> None:
        """Ask again and again for the ends of goals that nobody wants; in the node's thread."""
        for goal in filter(self.ledger.may_act, self._goals if self._closing else ()):
            self.ledger.cancel(goal)
        self._timer.reset()

    def _cancel_again(self) -> None:
        unwanted = {each.goal for each in self.ledger.unwanted()} & self._goals.keys()
        for goal in sorted(unwanted):
            self._goals[goal].ask_cancel()
        if not unwanted:
            self._timer.cancel()
            if self._closing:
                self.destroy()

    def _take_status(self, message: Any) -> None:
        for each in message.status_list:
            goal = self._goals.get(bytes(each.goal_info.goal_id.uuid).hex())
            if goal is not None:
                goal.take_status(int(each.status))


@dataclass(frozen=True, slots=True)
class _Question:
    """The circumstances of a question: what the answer "not known here" would prove."""

    accepted: bool
    in_new: bool
    attempt: int


class Goal:
    """A goal of ours."""

    def __init__(
        self, action: Action, key: str, feedback: Callable[[Any], None], tell: Tell
    ) -> None:
        self._action, self._node, self._call = action, action.node, action.call
        self._ledger = action.ledger
        self._id = goal_id(key)
        self.name = self._id.hex
        self._feedback, self._tell = feedback, tell
        self._handle = self._handle_of(self._id)
        self._message: Any = None
        self._result: Any = None  # the response with status and result
        self._servers: frozenset[bytes] = frozenset()
        self._attempt = self._answered = 0
        self._is_forgotten = False
        self._refused = False
        self._heard = self._fed = time.monotonic()
        self._silent_since = self._cancelled = 0.0
        self._is_answered = True
        self._missed = 0.0  # since when the server does not know it
        self._loop = asyncio.get_running_loop()
        self._news = asyncio.Event()

    @property
    def entry(self) -> Entry:
        """The entry of the ledger."""
        return self._ledger[self.name]

    @property
    def doubt(self) -> str:
        """Words for people about what it may still do; "" for nothing."""
        return self.entry.words if self._may_act() else ""

    def _begin(self, state: GoalState = GoalState.NOT_SENT) -> None:
        who, resources = f"the action {self._call.name}", self._action.resources
        may_repeat = self._call.on_resume is not OnResume.CANCEL
        entry = Entry(self.name, who, resources, may_repeat=may_repeat, state=state)
        entry = replace(entry, accepted=state is GoalState.ACCEPTED)
        self._ledger.begin(entry, self._line)
        self._action.enter(self)

    def _line(self, text: str, data: Mapping[str, RunValue]) -> None:
        self._tell(text, data)

    # -- what it is told, in the thread of the node ----------------------------------------------

    def _take(self, said: Said, how: str = "") -> None:
        self._heard = time.monotonic()
        self._silent_since = 0.0
        if self.entry.state is GoalState.UNKNOWN:
            self._ledger.take(self.name, Said.ALIVE)
        entry = self._ledger.take(self.name, said, how)
        if said is Said.ACCEPTED:
            self._ask_result()
            if entry.unwanted:
                self.ask_cancel()
        with suppress(RuntimeError):  # nobody waits any more
            self._loop.call_soon_threadsafe(self._news.set)

    def take_status(self, status: int) -> None:
        """Take in what the status topic says; after a second attempt it may be of the first."""
        if not self._may_act():
            return
        if self._attempt > 1:
            self._take(Said.ALIVE)
            self._ask_result()
        elif status in _ENDS:
            self._take(Said.ENDED, _ENDS[status])
        elif status != UNKNOWN and not self.entry.accepted:
            self._take(Said.ACCEPTED)

    def _send(self) -> None:
        if self._ledger.take(self.name, Said.SENT).state is not GoalState.IN_FLIGHT:
            return  # it has been withdrawn meanwhile
        self._servers = self._action.servers()
        self._attempt += 1
        self._refused = False
        try:
            sent = self._action.client.send_goal_async(
                self._message, feedback_callback=self._on_feedback, goal_uuid=self._handle.goal_id
            )
        except BaseException:  # it cannot be written as a message
            self._take(Said.ENDED, NEVER)
            raise
        attempt = self._attempt
        sent.add_done_callback(lambda answered: self._on_answer(answered, attempt))

    def _on_answer(self, answered: Any, attempt: int) -> None:
        if answered.result().accepted:
            self._answered = attempt
            self._take(Said.ACCEPTED)
        elif attempt != self._attempt:
            self._take(Said.ALIVE)
        else:  # a server also refuses a goal whose id it has: it says which of the two it is
            self._refused = True
            self._take(Said.ALIVE)
            self._ask_result()

    def _on_feedback(self, message: Any) -> None:
        self._heard = self._fed = time.monotonic()
        self._silent_since = 0.0
        if self.entry.state is not GoalState.ACCEPTED:
            self._take(Said.ACCEPTED)
        self._feedback(message.feedback)

    def _keep_feedback(self) -> None:
        """Go on listening: rclpy stops with any answer to a request for the result."""
        listening = getattr(self._action.client, "_feedback_callbacks", None)
        if self._may_act() and listening is not None:
            listening[self._id.bytes] = self._on_feedback

    def _question(self) -> _Question:
        in_new = bool(self._servers and self._action.servers() - self._servers)
        accepted = self.entry.accepted
        if self._attempt > 1:  # a server that has died may be heard late: only the answer counts
            accepted = self._answered == self._attempt
        return _Question(accepted, in_new, self._attempt)

    def _ask_result(self) -> None:
        question = self._question()

        def answered(future: Any) -> None:
            response = future.result()
            if int(response.status) != UNKNOWN and question.attempt == self._attempt:
                self._result = response
                self._take(Said.ENDED, _ENDS.get(int(response.status), ""))
            else:
                self._absent(question)

        self._handle.get_result_async().add_done_callback(answered)

    def ask_cancel(self) -> None:
        """Ask for it to be cancelled; in the thread of the node."""
        now = time.monotonic()
        if now - self._cancelled < _ASK_S and not self._is_answered:
            return  # the last request is on its way
        self._cancelled, self._is_answered = now, False
        question = self._question()

        def answered(future: Any) -> None:
            self._is_answered = True
            if future.result().return_code == _UNKNOWN_GOAL:
                self._absent(question)
                return
            self._take(Said.ALIVE)
            if future.result().return_code == _NOT_CANCELABLE:
                self._ask_result()

        self._handle.cancel_goal_async().add_done_callback(answered)

    def _absent(self, question: _Question) -> None:
        """A server does not know the goal."""
        self._is_forgotten = not self._may_act()
        self._keep_feedback()
        said, how = Said.ALIVE, ""
        if question.attempt == self._attempt:
            if question.in_new:
                said = Said.ABSENT_IN_NEW
            elif question.accepted:
                said = Said.ABSENT
            elif not self._attempt:  # of a process that has ended
                self._missed = self._missed or time.monotonic()
            elif self._refused:
                said, how = Said.REJECTED, "rejected"
        self._take(said, how)

    # -- what it is asked for, on an event loop --------------------------------------------------

    async def _news_within(self, seconds: float) -> bool:
        """Wait for news of it; False if there are none in time."""
        with suppress(TimeoutError):
            async with asyncio.timeout(max(seconds, 0.001)):
                await self._news.wait()
        is_news = self._news.is_set()
        self._news.clear()
        return is_news

    async def _ask(self, function: Callable[[], None]) -> None:
        await asyncio.wrap_future(self._node.call(function))

    async def send(self, message: Any) -> bool:
        """Send it, once nothing in doubt is in its way; False if the server does not want it.

        Raises InDoubtError if the server gives no sign of life for ``doubt_s``, or if what is in
        the way stays in doubt for so long.
        """
        await self._ask(self._begin)
        self._message = message
        await self._until_free()
        await self._until_seen()
        await self._ask(self._send)
        began = time.monotonic()
        patience = min(max(2 * self._call.probe_s, 2.0), _ACCEPT_S)
        while (entry := self.entry).may_act and not entry.accepted:
            if await self._news_within(min(patience, _LOOK_S)) and not self._refused:
                continue
            await self._ask(self._look)
            if time.monotonic() - began > self._action.doubt_s and self._may_act():
                raise InDoubtError(self.entry.words)
            quiet = time.monotonic() - self._heard
            if self._refused or (quiet >= patience and await self._is_alive()):
                await self._ask(self._ask_result)
                patience = self._call.probe_s
                if not await self._news_within(min(self._call.probe_s, _ASK_S)):
                    await self._ask(lambda: self._take(Said.ACCEPTED))  # it works on it
        if entry.state is GoalState.NOT_SENT:  # a new server is there, and has never had it
            return await self.send(message)
        return entry.how != "rejected"

    async def _until_seen(self) -> None:
        """Wait for the status topic of the server, by which another one is told from it."""
        end = time.monotonic() + self._call.wait_s
        while not await asyncio.wrap_future(self._node.call(self._action.servers)):
            if time.monotonic() > end:
                raise GoneError("its server has gone, and the goal was not sent")
            await asyncio.sleep(0.02)

    async def _until_free(self) -> None:
        end = time.monotonic() + self._action.doubt_s
        while left := self._ledger.blocking(self._action.resources, self.name):
            if time.monotonic() > end:
                raise InDoubtError(f"it cannot begin: {left[0].words}")
            await asyncio.sleep(0.02)

    def _look(self) -> None:
        """Ask a server that has appeared since the goal was sent whether it has it."""
        if self._servers and self._action.servers() - self._servers:
            self._ask_result()

    async def result(self) -> tuple[int, Any]:
        """The status and the result. Raises GoneError if it has ended without one.

        Silence of ``silence_s`` is a reason to cancel it, where feedback is promised. Raises
        InDoubtError if the server gives no sign of life for ``doubt_s``.
        """
        pause = self._call.probe_s
        while self._may_act():
            if await self._news_within(min(pause, _LOOK_S, self._unfed_s())):
                continue
            if self._unfed_s() <= 0:
                if doubt := await self.cancel(self._action.doubt_s):
                    raise InDoubtError(doubt)
                raise GoneError(f"no feedback for {self._call.silence_s:g} s")
            quiet = time.monotonic() - self._heard
            if quiet < self._call.probe_s:
                pause = self._call.probe_s
            elif quiet >= pause and await self._is_alive():
                pause = min(2 * pause, _MOST_PAUSE * self._call.probe_s)
                await self._ask(self._ask_result)
            await self._ask(self._look)
        return await self._ending()

    def _may_act(self) -> bool:
        return self._ledger.may_act(self.name)

    def _unfed_s(self) -> float:
        left = self._fed + self._call.silence_s - time.monotonic()
        return left if self._call.silence_s else _LOOK_S

    async def _ending(self) -> tuple[int, Any]:
        """The result of a goal that has ended."""
        how = self.entry.how
        pause, end = _SOON_S, time.monotonic() + self._action.doubt_s
        while self._result is None and how in _ENDS.values() and time.monotonic() < end:
            if self._is_forgotten:
                break
            if not await self._news_within(pause):  # the status topic was quicker
                await self._ask(self._ask_result)
                pause = self._call.probe_s
        if self._result is not None:
            return int(self._result.status), self._result.result
        if how in _ENDS.values():
            raise ForgottenError(how)
        if how == NEVER:
            raise GoneError("the goal was not sent, since the robot is being stopped")
        raise GoneError("the server was restarted and has lost the goal")

    async def cancel(self, within_s: float = float("inf")) -> str:
        """Cancel it, and wait until it has ended; "" if it has, else what may still happen.

        A goal that the server has not answered is cancelled once it is accepted: before that the
        server knows of no goal, and would begin it afterwards.
        """
        self._ledger.cancel(self.name)
        await self._ask(self._begin_to_cancel)
        began = time.monotonic()
        while self._may_act() and (left := began + within_s - time.monotonic()) > 0:
            await self._news_within(min(left, _AGAIN_S))
            if time.monotonic() - max(self._heard, began) > _ASK_S:
                self._ledger.take(self.name, Said.SILENT)
        return self.doubt

    def abandon(self) -> None:
        """Go on cancelling it without anybody who waits for its end."""
        if self.withdraw():
            self._node.call(self._begin_to_cancel)

    def withdraw(self) -> str:
        """Send it no more; what it may still do if it has been sent, "" for nothing."""
        if self._message is not None:
            self._ledger.cancel(self.name)
        return self.doubt

    def _begin_to_cancel(self) -> None:
        self.ask_cancel()
        self._action.keep_cancelling()

    async def cancel_left(self, within_s: float) -> str:
        """The same for a goal that a process which has ended may have sent."""
        await self._ask(lambda: self._begin(GoalState.ACCEPTED))  # it may have been
        return await self.cancel(within_s)

    async def is_there(self, within_s: float) -> bool:
        """True if the server has a goal of a process that has ended, or its result.

        It is followed from then on. False if the server does not know it: it has never had it, or
        has forgotten it. The status topic may still have it then, which keeps the last message.
        Raises InDoubtError without a sign of life.
        """
        await self._ask(lambda: self._begin(GoalState.IN_FLIGHT))
        await self._ask(self._ask_result)
        end = time.monotonic() + within_s
        while (entry := self.entry).may_act and not entry.accepted:
            if self._missed:
                if time.monotonic() - self._missed > _ASK_S:
                    await self._ask(lambda: self._take(Said.ENDED, LOST))
                await self._news_within(_SOON_S)
            elif await self._news_within(min(self._call.probe_s, _ASK_S)):
                continue
            elif await self._is_alive():
                await self._ask(lambda: self._take(Said.ACCEPTED))  # it works on it
            elif time.monotonic() > end:
                await self._ask(self.let_go)
                raise InDoubtError(f"{entry.who} does not answer")
        return entry.how != LOST

    def let_go(self) -> None:
        """Leave a goal alone that ``is_there``; in the thread of the node."""
        self._ledger.forget(self.name)

    async def follow(self, message: Any, feedback: Callable[[Any], None], tell: Tell) -> None:
        """Go on with a goal that ``is_there``, as if it had been sent here."""
        self._message, self._feedback, self._tell = message, feedback, tell
        self._fed = time.monotonic()
        await self._ask(self._keep_feedback)
        if self.entry.may_act:
            tell(*self.entry.line)

    async def _is_alive(self) -> bool:
        """True if the server gives a sign of life. Raises InDoubtError after ``doubt_s`` without.

        After three tries without one, what the goal does is unknown.
        """
        began = time.monotonic()
        since = self._silent_since = self._silent_since or began
        nobody = self._handle_of(uuid.uuid4())
        answer: Answer[Any] = Answer(self._node, nobody.cancel_goal_async)
        try:
            await answer.within(self._call.probe_s)
        except TimeoutError:
            if self._heard > began:  # it has said something else meanwhile
                return True
            silent_s = time.monotonic() - since
            if silent_s >= (_TRIES - 0.5) * self._call.probe_s:
                self._ledger.take(self.name, Said.SILENT)
            if silent_s >= self._action.doubt_s and self.entry.may_act:
                raise InDoubtError(self.entry.words) from None
            return False
        await self._ask(lambda: self._take(Said.ALIVE))
        self._news.clear()
        return True

    def _handle_of(self, which: uuid.UUID) -> Any:
        """A handle of a goal, whoever has sent it."""
        from rclpy.action.client import ClientGoalHandle
        from unique_identifier_msgs.msg import UUID

        response = self._action.kind.Impl.SendGoalService.Response()
        response.accepted = True
        return ClientGoalHandle(self._action.client, UUID(uuid=list(which.bytes)), response)
