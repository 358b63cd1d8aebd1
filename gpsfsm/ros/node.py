"""The node of this process: its context, the thread in which it spins, its start and its end.

All that touches rclpy runs in that one thread, so no call races with the answers to it; others hand
in functions (``call``) and await what comes of them (``answer``). The end keeps to an order without
which the process aborts: the executor, its thread, the node, the context.
"""

from __future__ import annotations

import asyncio
import atexit
import os
import re
import sys
import threading
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from itertools import pairwise
from secrets import token_hex
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from gpsfsm.errors import GpsfsmError, UsageError, installing
from gpsfsm.model.printable import clip
from gpsfsm.model.ros import DISCOVERY, RosSettings

if TYPE_CHECKING:
    from collections.abc import Callable, Coroutine, Sequence

_DISCOVERY = "ROS_AUTOMATIC_DISCOVERY_RANGE"
_NAME = "gpsfsm"
_PATIENCE_S = 5.0
"""How long the thread may take to end."""
_SWITCH_S = 0.001
_SOURCE = re.compile(r", at \S+:\d+")  # where rcl has found an error
_Made = TypeVar("_Made")


class RosError(GpsfsmError):
    """Something that ROS 2 needs is not there, or does not answer."""


def distribution() -> str:
    """The ROS 2 that is sourced, as ``$ROS_DISTRO`` has it; ``<distro>`` if none is."""
    return os.environ.get("ROS_DISTRO", "") or "<distro>"


def rclpy_module() -> Any:
    """The module rclpy. Raises RosError, which says what to do, if it cannot be imported."""
    try:
        import rclpy
        import rclpy.action
    except ImportError as error:
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        hint = f"source /opt/ros/{distribution()}/setup.bash, and use its Python"
        if error.name not in ("rclpy", None):  # rclpy itself is there
            hint = f"what a sourced ROS 2 lacks in an environment comes with {installing('ros')}"
        raise RosError(f"rclpy cannot be used in Python {version} ({error}): {hint}") from None
    return rclpy


class RosNode:
    """A node that spins in a thread of its own. Raises RosError if it cannot be made.

    ``handle`` is the node of rclpy, for what is called in its thread; ``shared`` is what those who
    use the node have in common, by name. With ``threads``, callbacks of reentrant groups run in so
    many threads, and may wait. ``on_error`` is called with what goes wrong in the executor, which
    goes on: a message that cannot be decoded, which anybody may send, must not end it.
    """

    def __init__(
        self,
        settings: RosSettings,
        name: str = _NAME,
        *,
        threads: int = 1,
        on_error: Callable[[Exception], object] = lambda _: None,
    ) -> None:
        rclpy = rclpy_module()
        from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
        from rclpy.signals import SignalHandlerOptions

        # else whoever waits for an answer waits for the thread of the node to give way, twice 5 ms
        sys.setswitchinterval(min(sys.getswitchinterval(), _SWITCH_S))
        if settings.discovery:
            os.environ[_DISCOVERY] = DISCOVERY[settings.discovery]
        self.settings = settings
        self.context = rclpy.Context()
        try:
            rclpy.init(
                args=arguments(settings),
                context=self.context,
                domain_id=settings.domain,
                signal_handler_options=SignalHandlerOptions.NO,
            )
        except Exception as error:  # what rcl says of arguments that it does not take
            raise RosError(f"the node cannot be started: {clip(str(error), 500)}") from None
        try:
            self.handle: Any = rclpy.create_node(
                name,
                context=self.context,
                namespace=settings.namespace or None,
                start_parameter_services=False,
            )
        except Exception as error:
            rclpy.try_shutdown(context=self.context)
            raise RosError(f"the node cannot be made: {clip(str(error), 500)}") from None
        self._executor: Any = (
            SingleThreadedExecutor(context=self.context)
            if threads == 1
            else MultiThreadedExecutor(threads, context=self.context)
        )
        self._on_error = on_error
        self._executor.add_node(self.handle)
        self._thread = threading.Thread(target=self._spin, name="ros", daemon=True)
        self.shared: dict[str, Any] = {}
        self._rules = {self._full(old): new for old, new in rules(settings)}
        self._closed = False
        self._lock = threading.Lock()
        self._thread.start()
        atexit.register(self.close)

    def _spin(self) -> None:
        from rclpy.executors import ExternalShutdownException, ShutdownException

        with suppress(ExternalShutdownException, ShutdownException):
            while not self._closed and self.context.ok():
                try:
                    self._executor.spin_once()
                except (ExternalShutdownException, ShutdownException):
                    raise
                except Exception as error:
                    self._on_error(error)

    def name(self, name: str) -> str:
        """The full name of an action, service or topic on this robot.

        rcl remaps the parts of an action and not its name, so that is done here, for all alike.
        """
        full = self._full(name)
        return self._full(self._rules.get(full, full))

    def _full(self, name: str) -> str:
        space = self.handle.get_namespace().rstrip("/")
        if name.startswith("~"):
            return f"{space}/{self.handle.get_name()}{name[1:]}"
        return name if name.startswith("/") else f"{space}/{name}"

    def call(self, function: Callable[[], _Made]) -> Future[_Made]:
        """Call a function in the thread of the node; the future has what it returns or raises."""
        future: Future[_Made] = Future()

        def run() -> None:
            try:
                future.set_result(function())
            except BaseException as error:  # it is for the caller, not for the executor
                future.set_exception(error)

        with self._lock:
            if self._closed:
                future.set_exception(RosError("the node has been closed"))
            else:
                self._executor.create_task(run)
        return future

    def do(self, function: Callable[[], _Made], within_s: float = _PATIENCE_S) -> _Made:
        """The same, waiting for it. Not for the thread of the node itself."""
        return self.call(function).result(within_s)

    def close(self) -> None:
        """End the node in the order that does not abort the process. Once is enough."""
        with self._lock:
            if self._closed:
                return
            self._closed = True
        atexit.unregister(self.close)
        self._executor.shutdown(timeout_sec=_PATIENCE_S)
        self._thread.join(_PATIENCE_S)
        for waitable in [*self.handle.waitables]:  # clients of actions keep the node alive
            if hasattr(waitable, "destroy"):
                waitable.destroy()
        self.handle.destroy_node()
        self.context.try_shutdown()


class Answer(Generic[_Made]):
    """The result of an rclpy future, to be awaited on an event loop of asyncio.

    ``start`` makes the future, in the thread of the node.
    """

    def __init__(self, node: RosNode, start: Callable[[], Any]) -> None:
        self._loop = asyncio.get_running_loop()
        self._future: asyncio.Future[_Made] = self._loop.create_future()

        def begin() -> None:
            start().add_done_callback(self._arrived)

        node.call(begin).add_done_callback(self._begun)

    def _begun(self, begun: Future[None]) -> None:
        error = begun.exception()
        if error is not None:
            self._settle(lambda: self._future.set_exception(error))

    def _arrived(self, answered: Any) -> None:
        error = answered.exception()
        if error is not None:
            self._settle(lambda: self._future.set_exception(error))
        elif not answered.cancelled():
            self._settle(lambda: self._future.set_result(answered.result()))

    def _settle(self, settle: Callable[[], None]) -> None:
        def if_open() -> None:
            if not self._future.done():
                settle()

        with suppress(RuntimeError):  # the loop is closed: nobody waits any more
            self._loop.call_soon_threadsafe(if_open)

    async def within(self, seconds: float) -> _Made:
        """The answer. Raises TimeoutError if it takes longer; 0: however long it takes."""
        async with asyncio.timeout(seconds or None):
            return await asyncio.shield(self._future)

    @property
    def done(self) -> bool:
        """True once it is there."""
        return self._future.done()


def waited(work: Coroutine[Any, Any, _Made]) -> _Made:
    """The result of a coroutine, for those who cannot await it: it blocks.

    It gets a thread of its own, so an event loop that runs here, and is blocked, is no obstacle.
    """
    with ThreadPoolExecutor(1, "ros-waiting") as pool:
        return pool.submit(asyncio.run, work).result()


def rules(settings: RosSettings) -> list[tuple[str, str]]:
    """The rules by which names are remapped, those of the command line last.

    >>> rules(RosSettings(remap=(("a", "b"),), arguments=("-r", "/c:=/d", "-r", "__ns:=/x")))
    [('a', 'b'), ('/c', '/d')]
    """
    pairs = [*settings.remap]
    for flag, text in pairwise(settings.arguments):
        old, sign, new = text.partition(":=")
        if flag in ("-r", "--remap") and sign and not old.startswith("__"):
            pairs.append((old.rpartition(":")[2].removeprefix("//"), new))
    return pairs


def arguments(settings: RosSettings) -> list[str]:
    """The arguments of a node: those of the command line last, which so have the last word."""
    rules = [part for old, new in settings.remap for part in ("-r", f"{old}:={new}")]
    written = [*rules, *settings.arguments]
    return ["--ros-args", *written] if written else []


def refuse_malformed(words: Sequence[str]) -> None:
    """Raise UsageError, with what rcl says, if a node does not take these words of a command line.

    Without rclpy there is no node that could read them.
    """
    if not words:
        return
    try:
        rclpy = rclpy_module()
    except RosError:
        return
    from rclpy.signals import SignalHandlerOptions

    context = rclpy.Context()
    try:
        rclpy.init(
            args=["--ros-args", *words],
            context=context,
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except Exception as error:
        reason = _SOURCE.sub("", str(error)).removeprefix("failed to initialize rcl: ")
        if reason.startswith("["):  # a list of them is all that rclpy says
            reason = f"unknown arguments {reason[1:-1]}"
        raise UsageError(f"after --ros-args: {clip(reason, 500)}") from None
    finally:
        rclpy.try_shutdown(context=context)


class _Process:
    """The settings and the node of this process."""

    settings: RosSettings | None = None
    node: RosNode | None = None


_MAKING = threading.Lock()


def choose(settings: RosSettings) -> None:
    """Say where the robot is, before a node is made.

    Raises UsageError if there is a node for another robot.
    """
    with _MAKING:
        if _Process.node is not None and _Process.settings != settings:
            raise UsageError("this process has a node for another robot already")
        _Process.settings = settings


def process_node() -> RosNode:
    """The node of this process: made when it is first needed, closed when the process ends.

    Two of one name could not be told apart on the graph, so each has a suffix of its own; a name
    that the command line gives (``-r __node:=name``) is taken as it is. Raises RosError.
    """
    with _MAKING:
        if _Process.node is None:
            settings = _Process.settings = _Process.settings or RosSettings()
            _Process.node = RosNode(settings, f"{_NAME}_{token_hex(3)}")
        return _Process.node


def make_ahead(settings: RosSettings) -> None:
    """Begin to make the node, in a thread: it takes a while until a robot sees it.

    What goes wrong shows when the node is needed. The process does not end before it is made: what
    is half made cannot be closed, and would take the process down.
    """

    def make() -> None:
        with suppress(GpsfsmError):
            process_node()

    choose(settings)
    threading.Thread(target=make, name="ros ahead").start()


def node_if_made() -> RosNode | None:
    """The node of this process, if something has needed one."""
    return _Process.node


def close_node() -> None:
    """Close the node of this process, if there is one."""
    with _MAKING:
        node, _Process.node = _Process.node, None
    if node is not None:
        node.close()
