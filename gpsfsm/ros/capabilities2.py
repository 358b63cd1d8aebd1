"""A Capabilities2 server as its clients reach it: its services, a bond with it, its events.

The server tells of an event of a runner only if a connection starts there, and whoever is at the
other end is triggered. So the runners of a plan are connected to inputs of the server's own
multiplexer, which wait for a second one that never comes:

    WaypointRunner 5c1e…  ──SUCCEEDED──▶  InputMultiplexRunner 5c1e…-SUCCEEDED (1 of 2 inputs)
                          ──FAILED─────▶  InputMultiplexRunner 5c1e…-FAILED

Each connection has a target of its own, since the server drops a second one between the same two
instances, and what a runner hands over arrives with the parameters of the target. Nothing else ever
follows from the event, so it is gpsfsm alone that says what comes next.
"""

from __future__ import annotations

import asyncio
import threading
import time
import uuid
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NoReturn

from gpsfsm.model.printable import clip
from gpsfsm.ros.bond import Bond
from gpsfsm.ros.capabilities2_values import INT, Typed, as_xml
from gpsfsm.ros.messages import definition
from gpsfsm.ros.node import RosError, waited
from gpsfsm.ros.services import WAIT_S, NoServerError, Service

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.ros.node import RosNode

FAILED, SUCCEEDED, TRIGGERED = 3, 4, 7
"""Codes of capabilities2_msgs/msg/CapabilityEventCode, and of the events of V1."""

_PACKAGE = "capabilities2_msgs"
_ESTABLISH = f"{_PACKAGE}/srv/EstablishBond"
_RUNNABLE = f"{_PACKAGE}/srv/GetRunnableSpecs"
_EVENTS = f"{_PACKAGE}/msg/CapabilityEventStamped"
_EVENTS_OF_V1 = "event_logger_msgs/msg/Event"
_USUAL = "capabilities"
_V1, _V2, _V3 = 1, 2, 3
_MULTIPLEXER, _MULTIPLEXER_OF_V1 = "InputMultiplexRunner", "InputMultiplexAllRunner"

ANSWER_S = 5.0
_USE_S = 25.0
"""A loading runner may take 30 seconds; V2 itself waits for an action server up to 1,000."""
_PROBE_S = 2.0
_TRIES = 2
_TAKEN_S = 5.0
_ECHO_S = 10.0
_LOOK_S = 0.2
_MOST_NAMES = 10_000


class GoneError(RosError):
    """The server does not answer any more, or has lost the bond."""


@dataclass(frozen=True)
class Server:
    """A server in the graph: where its services are, and which version it is.

    ``runnable`` is the service that lists what can be run, "" if it has none (before V3).
    """

    node: RosNode
    prefix: str
    version: int
    runnable: str = ""
    clients: dict[str, Service] = field(default_factory=dict)

    @classmethod
    async def find(cls, node: RosNode, wait_s: float = WAIT_S) -> Server:
        """The server of a robot. Raises RosError, which says what is there instead."""
        end = time.monotonic() + wait_s
        while True:
            services = dict(await asyncio.to_thread(node.do, _services(node)))
            server = cls._of(node, services)
            if server is not None:
                return server
            if time.monotonic() > end:
                domain = node.context.get_domain_id()
                raise RosError(
                    f"there is no capability server (waited {wait_s:g} s in domain {domain} for "
                    f"{_USUAL}/establish_bond): start it, or set domain and namespace in the robot "
                    "profile"
                )
            await asyncio.sleep(0.1)

    @classmethod
    def _of(cls, node: RosNode, services: dict[str, list[str]]) -> Server | None:
        prefixes = [
            name.removesuffix("/establish_bond")
            for name, kinds in services.items()
            if _ESTABLISH in kinds and name.endswith("/establish_bond")
        ]
        usual = node.name(_USUAL)
        if usual in prefixes:
            prefixes = [usual]
        if not prefixes:
            return None
        if len(prefixes) > 1:
            raise RosError(
                f"there are several capability servers ({clip(', '.join(sorted(prefixes)), 200)}): "
                "set the namespace of the robot in its profile"
            )
        prefix = prefixes[0]
        if not services.keys() & {f"{prefix}/connect_capability", f"{prefix}/configure_capability"}:
            return None  # its other services are about to appear
        if f"{prefix}/trigger_capability" not in services:
            return None
        runnable = next((name for name, kinds in services.items() if _RUNNABLE in kinds), "")
        version = _V3 if runnable else _V2
        if f"{prefix}/connect_capability" not in services:
            version = _V1
        return cls(node, prefix, version, runnable)

    async def request(
        self,
        name: str,
        kind: str,
        values: Mapping[str, RunValue],
        within_s: float = ANSWER_S,
    ) -> Any:
        """The response of one of its services. Raises GoneError if there is none in time."""
        full = name if name.startswith("/") else f"{self.prefix}/{name}"
        if full not in self.clients:
            types = [f"{_PACKAGE}/srv/{kind}"]
            self.clients[full] = await Service.open(self.node, full, types, WAIT_S)
        try:
            return await self.clients[full].ask(values, within_s)
        except TimeoutError:
            raise GoneError(
                f"the capability server does not answer on {full} (waited {within_s:g} s)"
            ) from None

    async def interfaces(self) -> list[str]:
        """The names of the interfaces that it offers."""
        response = await self.request("get_interfaces", "GetInterfaces", {})
        return _names(response.interfaces)

    async def providers(self, interface: str) -> list[str]:
        """The providers of an interface, the default one first."""
        response = await self.request("get_providers", "GetProviders", {"interface": interface})
        first = [response.default_provider] if response.default_provider else []
        return _names([*first, *response.providers])

    async def alive(self) -> bool:
        """True if it answers at all; the request is the cheapest that it has."""
        try:
            await self.request("get_semantic_interfaces", "GetSemanticInterfaces", {}, _PROBE_S)
        except (GoneError, NoServerError):
            return False
        return True


def _services(node: RosNode) -> Callable[[], list[tuple[str, list[str]]]]:
    return lambda: list(node.handle.get_service_names_and_types())


def _names(names: Iterable[str]) -> list[str]:
    listed = list(dict.fromkeys(names))
    if len(listed) > _MOST_NAMES:
        raise RosError(f"the capability server lists more than {_MOST_NAMES} names")
    return listed


@dataclass(frozen=True)
class Heard:
    """An event of an instance, with the parameters that it hands over."""

    code: int
    parameters: tuple[Any, ...] = ()


class Instance:
    """An instance of a runner that acts, and what is heard of it."""

    def __init__(self, name: str, capability: str) -> None:
        self.name = name
        self.capability = capability
        self._loop = asyncio.get_running_loop()
        self.taken: asyncio.Future[None] = self._loop.create_future()
        self.ended: asyncio.Future[Heard] = self._loop.create_future()

    def hear(self, heard: Heard) -> None:
        """Take an event, in whatever thread."""
        self._loop.call_soon_threadsafe(self._take, heard)

    def _take(self, heard: Heard) -> None:
        if not self.taken.done():
            self.taken.set_result(None)
        if heard.code in (SUCCEEDED, FAILED) and not self.ended.done():
            self.ended.set_result(heard)


class Session:
    """A bond with a server, for all runners of a run. Its methods may be awaited on any loop."""

    _making = threading.Lock()

    def __init__(self, server: Server) -> None:
        self.server = server
        self.problem = ""
        self._node = server.node
        self._bond = Bond(server.node, (f"{server.prefix}/bond", f"/{_USUAL}/bond"))
        self._instances: dict[str, Instance] = {}
        self._holders: set[int] = set()
        self._over = False
        self._using = 0
        self._multiplexer = ("", "")
        self._subscription: Any = None
        self._numbers = iter(range(1, 1 << 30))

    @classmethod
    def of(cls, node: RosNode, holder: object) -> Session:
        """The one of a node, opened when it is first needed; blocks. Raises RosError."""
        with cls._making:
            session = node.shared.get(cls.__name__)
            if not isinstance(session, cls) or session.unusable:
                server = waited(Server.find(node))
                session = cls(server)
                waited(session._open())
                node.shared[cls.__name__] = session
            session._holders.add(id(holder))
            return session

    @property
    def serial(self) -> bool:
        """True if the events of a runner do not say which of its instances they are of."""
        return self.server.version == _V1

    @property
    def unusable(self) -> bool:
        """True once the bond is over, or the server is gone."""
        return self._over or bool(self.problem or self._bond.problem)

    async def _request(
        self, name: str, kind: str, values: Mapping[str, RunValue], within_s: float = ANSWER_S
    ) -> Any:
        """The response of a service; a server that does not answer makes the session unusable."""
        within_s = max(within_s, _USE_S) if self._using else within_s
        try:
            return await self.server.request(name, kind, values, within_s)
        except GoneError as error:
            self._give_up(str(error))
            raise

    def _give_up(self, problem: str) -> None:
        """Use it no more. What acts under its bond may act on, so the bond ends at once.

        Others may hold the session for long, and would keep the bond alive.
        """
        self.problem = self.problem or problem
        self._bond.over = True

    async def _open(self) -> None:
        interfaces = await self.server.interfaces()
        wanted = _MULTIPLEXER_OF_V1 if self.server.version == _V1 else _MULTIPLEXER
        name = next((name for name in interfaces if name.rpartition("/")[2] == wanted), "")
        if not name:
            raise RosError(
                f"the capability server {self.server.prefix} has no {wanted}, without which it "
                "does not report how its runners end: install its package on the robot"
            )
        providers = await self.server.providers(name)
        self._multiplexer = (name, providers[0] if providers else name)
        await asyncio.to_thread(self._node.do, self._subscribe)
        response = await self.server.request("establish_bond", "EstablishBond", {})
        await asyncio.to_thread(self._bond.begin, response.bond_id)
        try:
            await self.use(*self._multiplexer)
            await self._echo()
        except RosError:
            await self._bond.end()
            await self._unsubscribe()
            raise

    def _subscribe(self) -> None:
        from rclpy.qos import QoSProfile

        handle = self._node.handle
        kind, name, take = _EVENTS, f"{self.server.prefix}/events", self._take
        if self.server.version == _V1:
            kind, name, take = _EVENTS_OF_V1, "/events", self._take_v1
        listed = [each for each, kinds in handle.get_topic_names_and_types() if kind in kinds]
        if listed and name not in listed:
            name = listed[0]
        self._subscription = handle.create_subscription(
            definition(kind), name, take, QoSProfile(depth=100)
        )

    async def _echo(self) -> None:
        """Wait until an event comes through: those before the server knows the listener are lost.

        The multiplexer, triggered with its only input, succeeds at once.
        """
        end = time.monotonic() + _ECHO_S
        while time.monotonic() < end:
            instance = Instance(self._fresh(), self._multiplexer[0])
            counted = [_count(1)]
            try:
                await self._begin(instance, *self._multiplexer, counted)
                async with asyncio.timeout(0.5):
                    await asyncio.shield(instance.ended)
                    return
            except TimeoutError:
                continue
            finally:
                self._instances.pop(instance.name, None)
        raise RosError(
            f"the capability server {self.server.prefix} takes triggers, but none of its events "
            "arrives: are its definitions of another version than those here?"
        )

    def _fresh(self) -> str:
        return f"gpsfsm-{uuid.uuid4()}" if self.server.version > _V1 else str(next(self._numbers))

    # -- runners --------------------------------------------------------------------------------

    async def use(self, capability: str, provider: str) -> None:
        """Have a runner started. Raises RosError if it is not, as far as the server tells."""
        self._using += 1  # the server answers nothing else meanwhile
        try:
            request: dict[str, RunValue] = {
                "capability": capability,
                "preferred_provider": provider,
                "bond_id": self._bond.name,
            }
            await self._request("use_capability", "UseCapability", request, _USE_S)
        finally:
            self._using -= 1
        if self.server.version == _V1:
            return
        running = await self._running()
        if capability not in running:
            raise RosError(f"the capability server has not started {capability}: its log says why")
        if running[capability] not in ("", provider):
            raise RosError(
                f"{capability} runs already with the provider {clip(running[capability], 200)}, "
                f"and the capability server has one at a time: {provider} cannot be used beside it"
            )

    async def _running(self, within_s: float = ANSWER_S) -> dict[str, str]:
        """The capabilities that are started, whoever uses them, and their providers."""
        response = await self.server.request(
            "get_running_capabilities", "GetRunningCapabilities", {}, within_s
        )
        return {
            each.capability.capability: each.capability.provider
            for each in response.running_capabilities
        }

    async def outlive(self, capability: str, within_s: float) -> bool:
        """Free a runner, and wait until nobody uses it; True if that is so for sure."""
        await self.free(capability)
        end = time.monotonic() + within_s
        while self.server.version > _V1 and time.monotonic() < end:
            if capability not in await self._running():
                return True
            await asyncio.sleep(_LOOK_S)
        return False

    async def free(self, capability: str, within_s: float = ANSWER_S) -> None:
        """Have a runner stopped, with all that it does; what it does for others goes on."""
        request: dict[str, RunValue] = {"capability": capability, "bond_id": self._bond.name}
        await self._request("free_capability", "FreeCapability", request, within_s)

    async def act(
        self,
        capability: str,
        provider: str,
        parameters: list[Typed],
        *,
        key: str,
        deadline_s: float,
    ) -> Heard:
        """Trigger an instance and wait for its end. Raises RosError, also if nothing is heard."""
        name = str(uuid.uuid5(uuid.NAMESPACE_URL, f"{self._bond.name}/{key}"))
        instance = Instance(name if self.server.version > _V1 else self._fresh(), capability)
        try:
            await self._begin(instance, capability, provider, parameters)
            return await self._end(instance, deadline_s)
        finally:
            self._instances.pop(instance.name, None)

    async def _begin(
        self, instance: Instance, capability: str, provider: str, parameters: list[Typed]
    ) -> None:
        self._instances[instance.name] = instance
        begin = self._begin_v1 if self.server.version == _V1 else self._begin_v2
        await begin(instance, capability, provider, parameters)

    async def _begin_v2(
        self, instance: Instance, capability: str, provider: str, parameters: list[Typed]
    ) -> None:
        bond: dict[str, RunValue] = {"bond_id": self._bond.name}
        source = (capability, provider, instance.name, parameters)
        for code, word in ((SUCCEEDED, "SUCCEEDED"), (FAILED, "FAILED"), (TRIGGERED, "TRIGGERED")):
            waits = (*self._multiplexer, f"{instance.name}-{word}", [_count(2)])
            connection = {"connection.type.code": code, **_capability("connection.source", *source)}
            connection |= _capability("connection.target", *waits)
            await self._request("connect_capability", "ConnectCapability", bond | connection)
        trigger = bond | _capability("capability", *source)
        await self._request("trigger_capability", "TriggerCapability", trigger)

    async def _begin_v1(
        self, instance: Instance, capability: str, provider: str, parameters: list[Typed]
    ) -> None:
        """V1 tells no instances apart, and takes the connections of a runner in their order."""
        number = Typed("id", INT, (instance.name,))
        own = as_xml(capability, provider, [*parameters, number])
        request: dict[str, RunValue] = {
            "connection_description": "gpsfsm",
            "trigger_id": int(instance.name),
            **_capability_of_v1("source", capability, provider, own),
        }
        for event in ("success", "failure"):
            waits = as_xml(*self._multiplexer, [_count(2), Typed("id", INT, (self._fresh(),))])
            request |= _capability_of_v1(f"target_on_{event}", *self._multiplexer, waits)
        await self._request("configure_capability", "ConfigureCapability", request)
        instance.hear(Heard(TRIGGERED))  # V1 confirms no trigger
        trigger: dict[str, RunValue] = {"capability": capability, "parameters": own}
        await self._request("trigger_capability", "TriggerCapability", trigger)

    async def _end(self, instance: Instance, deadline_s: float) -> Heard:
        end = time.monotonic() + deadline_s
        await asyncio.wait([instance.taken], timeout=min(_TAKEN_S, deadline_s))
        if not instance.taken.done():
            await self._lives(instance.capability)
            raise RosError(
                f"the capability server has not triggered {instance.capability}: its log says why"
            )
        failures = 0
        while not instance.ended.done():
            left = end - time.monotonic()
            if left <= 0:
                raise RosError(
                    f"no event of {instance.capability} within {deadline_s:g} s: the server tells "
                    "nothing of a goal that was rejected, nor of a server that is gone"
                )
            await asyncio.wait([instance.ended], timeout=min(left, _PROBE_S))
            if not instance.ended.done():
                failures = 0 if await self._lives(instance.capability) else failures + 1
            if failures == _TRIES and not instance.ended.done():
                self._lost(self.problem or "the capability server does not answer")
        return instance.ended.result()

    async def _lives(self, capability: str) -> bool:
        """True if the server answers. Raises GoneError if it has no such runner any more."""
        if self._bond.problem:
            self._lost(self._bond.problem)
        if self._using:
            return True  # it answers once the runner has started
        if self.server.version == _V1:
            return await self.server.alive()
        try:
            running = await self._running(_PROBE_S)
        except GoneError:
            return bool(self._using)
        if capability not in running:
            self._lost(
                f"the capability server has stopped {capability}: it was restarted, or another "
                "client has stopped it there"
            )
        return True

    def _lost(self, problem: str) -> NoReturn:
        self._give_up(problem)
        raise GoneError(problem)

    # -- events ---------------------------------------------------------------------------------

    def _take(self, message: Any) -> None:
        """An event of V2, in the thread of the node."""
        event = message.event
        instance = self._instances.get(event.trigger_id)
        target = event.connection.target
        if (
            instance is None
            or event.connection.source.capability not in ("", instance.capability)
            or not target.instance_id.startswith(f"{instance.name}-")
        ):
            return
        kept = tuple(each for each in target.parameters if each.key != "input_count")
        instance.hear(Heard(int(event.code.code), kept))

    def _take_v1(self, message: Any) -> None:
        """An event of V1, which names no instance: of one runner, one at a time acts."""
        if message.target.capability != self._multiplexer[0]:
            return
        code = int(message.event)
        for instance in list(self._instances.values()):
            if instance.capability == message.source.capability:
                instance.hear(Heard(code))

    # -- the end --------------------------------------------------------------------------------

    async def release(self, holder: object) -> None:
        """Somebody needs it no more; the last one ends the bond, the multiplexer before it."""
        if not await asyncio.to_thread(self._let_go, holder):
            return
        if not self.problem:
            try:
                await self.free(self._multiplexer[0], _PROBE_S)
            except RosError as error:
                self._give_up(str(error))
        await self._bond.end()
        await self._unsubscribe()

    async def _unsubscribe(self) -> None:
        await asyncio.to_thread(
            self._node.do, lambda: self._node.handle.destroy_subscription(self._subscription)
        )

    def _let_go(self, holder: object) -> bool:
        """True if nobody holds it any more, and nobody can begin to."""
        with self._making:
            self._holders.discard(id(holder))
            if self._holders or self._over:
                return False
            self._over = True
            return True


def _capability(
    at: str, capability: str, provider: str, instance: str, parameters: Sequence[Typed]
) -> dict[str, RunValue]:
    """The fields of a Capability of V2, at a place in a request."""
    return {
        f"{at}.capability": capability,
        f"{at}.provider": provider,
        f"{at}.instance_id": instance,
        f"{at}.parameters[].key": [each.key for each in parameters],
        f"{at}.parameters[].type": [each.code for each in parameters],
        f"{at}.parameters[].value": [list(each.texts) for each in parameters],
    }


def _capability_of_v1(at: str, capability: str, provider: str, xml: str) -> dict[str, RunValue]:
    return {
        f"{at}.capability": capability,
        f"{at}.provider": provider,
        f"{at}.parameters": xml,
    }


def _count(inputs: int) -> Typed:
    return Typed("input_count", INT, (str(inputs),))
