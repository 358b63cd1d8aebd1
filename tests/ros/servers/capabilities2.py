"""A capability server that behaves as the published Capabilities2 does, its defects included.

    python -m tests.ros.servers.capabilities2 [--version 1|2|3] [--hostile]

Runners are started, connected and triggered; what they do is told: ``outcomes`` are those of the
next triggers of leaves (``succeed``, ``fail``, ``silent`` as a goal that is rejected, ``drive``
until the goal is cancelled, ``hang`` as one whose server is gone), all others succeed. ``die`` ends
the process where the original aborts.

What the original does wrong, and this does too: a second connection between two instances is
dropped, connections and triggers without a bond are ignored without a word, a second trigger of an
instance, a parameter of another type and an event for a freed runner end the process, no leaf of
V2 tells that it has begun, and freeing a runner that acts blocks the server for good.
"""

from __future__ import annotations

import argparse
import threading
import time
import uuid
from typing import TYPE_CHECKING, Any

from bond.msg import Status
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup

from tests.ros.servers.base import FakeServer, arguments, of_choices, scripted
from tests.ros.servers.capabilities2_specs import HOSTILE, INTERFACES, PROVIDERS, redumped, runnable
from tests.ros.servers.messages import type_named

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

OUTCOMES = ("succeed", "fail", "silent", "drive", "hang")
STARTED, STOPPED, FAILED, SUCCEEDED, CONNECTED, TRIGGERED = 1, 2, 3, 4, 5, 7
MULTIPLEXERS = ("InputMultiplexRunner", "InputMultiplexAllRunner")
LEASE = 10.0
"""The seconds after which a bond without heartbeats is broken."""
READ = {
    "WaypointRunner": {"x": 1, "y": 1, "z": 1, "qx": 1, "qy": 1, "qz": 1, "qw": 1},
    "GraspRunner": {"force": 1, "label": 3, "fingers": 7},
}
"""The types by which leaves read their parameters."""
POSE = {"x": 1.5, "y": -0.25, "z": 0.0, "qx": 0.0, "qy": 0.0, "qz": 0.0, "qw": 1.0}
HANDED = {
    "RobotPoseRunner": [(key, 1, [f"{value:.6f}"]) for key, value in POSE.items()],
    "GraspRunner": [("widths", 6, ["0.010000", "0.020000"]), ("held", 0, ["true"])],
}


class Runner:
    """A runner that was started: one for a capability, whoever uses it."""

    def __init__(self, capability: str, provider: str) -> None:
        self.capability, self.provider = capability, provider
        self.connections: dict[str, tuple[int, Any]] = {}
        self.threads: dict[str, threading.Thread] = {}
        self.inputs: dict[str, int] = {}
        self.cancelled = threading.Event()

    @property
    def short(self) -> str:
        return self.capability.rpartition("/")[2]


class Base(FakeServer):
    """What all versions have in common: bonds, and runners by capability."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__("capabilities")
        self.options = options
        self.code = 0
        self.outcomes: list[str] = []
        self.bonds: dict[str, set[str]] = {}
        self.runners: dict[str, Runner] = {}
        self.alone = MutuallyExclusiveCallbackGroup()  # all entities of the original share one
        self._seen: dict[str, float] = {}
        self._links = self.node.create_publisher(Status, "/capabilities/bond", 100)
        self.node.create_subscription(
            Status, "/capabilities/bond", self._heartbeat, 100, callback_group=self.alone
        )
        self.node.create_timer(0.1, self._beat, callback_group=self.alone)
        for name, kind, answer in (
            ("establish_bond", "EstablishBond", self._establish),
            ("use_capability", "UseCapability", self._use),
            ("free_capability", "FreeCapability", self._free),
            ("trigger_capability", "TriggerCapability", self._trigger),
            ("get_interfaces", "GetInterfaces", self._interfaces),
            ("get_semantic_interfaces", "GetSemanticInterfaces", lambda _, response: response),
            ("get_providers", "GetProviders", self._providers),
        ):
            self.offer(name, kind, answer)

    def offer(self, name: str, kind: str, answer: Callable[[Any, Any], Any]) -> None:
        self.node.create_service(
            type_named(f"capabilities2_msgs/srv/{kind}"),
            f"~/{name}",
            answer,
            callback_group=self.alone,
        )

    # -- commands -------------------------------------------------------------------------------

    def do_outcomes(self, outcomes: list[str]) -> None:
        self.outcomes += [of_choices(each, OUTCOMES) for each in outcomes]

    def die(self, why: str) -> None:
        """End where the original calls std::terminate."""
        self.journal("died", why=why)
        self.code = 134
        self.end()

    # -- bonds ----------------------------------------------------------------------------------

    def _establish(self, _: Any, response: Any) -> Any:
        response.bond_id = str(uuid.uuid4())
        self.bonds[response.bond_id] = set()
        self._seen[response.bond_id] = time.monotonic()
        self.journal("bond", id=response.bond_id)
        return response

    def _beat(self) -> None:
        for bond in list(self.bonds):
            self._tell(bond, active=True)
            if time.monotonic() - self._seen[bond] > LEASE:
                self._broken(bond)

    def _tell(self, bond: str, *, active: bool) -> None:
        self._links.publish(
            Status(
                id=bond,
                instance_id="server",
                active=active,
                heartbeat_timeout=LEASE,
                heartbeat_period=0.1,
            )
        )

    def _heartbeat(self, message: Any) -> None:
        if message.instance_id == "server" or message.id not in self.bonds:
            return
        self._seen[message.id] = time.monotonic()
        if not message.active:
            self._broken(message.id)

    def _broken(self, bond: str) -> None:
        """All that the bond held is freed, in the order of the names."""
        held = self.bonds.pop(bond, None)
        if held is None:
            return
        self._tell(bond, active=False)
        self.journal("broken", id=bond, held=sorted(held))
        for capability in sorted(held):
            if not any(capability in others for others in self.bonds.values()):
                self._stop(capability)

    # -- runners --------------------------------------------------------------------------------

    def _use(self, request: Any, response: Any) -> Any:
        capability, provider = request.capability, request.preferred_provider
        self.bonds.setdefault(request.bond_id, set()).add(capability)
        self._seen.setdefault(request.bond_id, time.monotonic())
        if capability in self.runners:
            self.journal("warning", text=f"could not start runner: running already: {capability}")
        elif not any(name == provider for name, _ in PROVIDERS):
            self.journal("warning", text=f"could not start runner: no provider {provider}")
        else:
            self.runners[capability] = Runner(capability, provider)
            self.journal("started", capability=capability)
        return response

    def _free(self, request: Any, response: Any) -> Any:
        self.bonds.get(request.bond_id, set()).discard(request.capability)
        self.journal("freed", capability=request.capability)
        if not any(request.capability in held for held in self.bonds.values()):
            self._stop(request.capability)
        return response

    def _stop(self, capability: str) -> None:
        runner = self.runners.get(capability)
        if runner is None:
            return
        acting = [thread for thread in runner.threads.values() if thread.is_alive()]
        if acting:
            self.journal("cancelled", capability=capability)
            runner.cancelled.set()
        for thread in acting:
            while thread.is_alive() and not self.stopping.is_set():
                thread.join(0.05)  # its goal ends in a callback, and none is called meanwhile
        self.runners.pop(capability, None)

    def start(self, runner: Runner, slot: str, act: Callable[[], None]) -> bool:
        """Let an instance act in a thread; false where that aborts the original."""
        if slot in runner.threads:
            self.die(f"a second thread for {slot}")
            return False
        thread = threading.Thread(target=act, daemon=True)
        runner.threads[slot] = thread
        thread.start()
        return True

    def outcome(self, runner: Runner) -> str:
        outcome = str(scripted(self.outcomes, "succeed"))
        self.journal("acting", capability=runner.capability, outcome=outcome)
        return outcome

    def _trigger(self, request: Any, response: Any) -> Any:
        raise NotImplementedError

    # -- descriptions ---------------------------------------------------------------------------

    def _interfaces(self, _: Any, response: Any) -> Any:
        response.interfaces = list(INTERFACES[self.options.version])
        return response

    def _providers(self, request: Any, response: Any) -> Any:
        response.providers = [
            name for name, implements in PROVIDERS if implements == request.interface
        ]
        return response


class Server(Base):
    """V2, and V3, which is V2 with one more service."""

    def __init__(self, options: argparse.Namespace) -> None:
        super().__init__(options)
        stamped = type_named("capabilities2_msgs/msg/CapabilityEventStamped")
        self._events = self.node.create_publisher(stamped, "~/events", 10)
        self._event = stamped
        self.offer("connect_capability", "ConnectCapability", self._connect)
        self.offer("get_running_capabilities", "GetRunningCapabilities", self._running)
        self.offer("get_capability_specs", "GetCapabilitySpecs", self._specs)
        self.offer("get_capability_spec", "GetCapabilitySpec", self._spec)
        if options.version == 3:
            self.offer("list_what_can_run", "GetRunnableSpecs", self._runnable)

    def _connect(self, request: Any, response: Any) -> Any:
        source, target = request.connection.source, request.connection.target
        held = self.bonds.get(request.bond_id, set())
        for each in (source, target):
            if each.capability not in held or each.capability not in self.runners:
                self.journal("error", text=f"{each.capability} is not used by this bond")
                return response
        runner = self.runners[source.capability]
        name = f"{request.bond_id}/{source.instance_id}/{target.instance_id}"
        if name in runner.connections:
            self.journal("dropped", connection=name)
            return response
        runner.connections[name] = (request.connection.type.code, target)
        self._publish(CONNECTED, "", None, None)
        return response

    def _trigger(self, request: Any, response: Any) -> Any:
        capability = request.capability
        if capability.capability not in self.bonds.get(request.bond_id, set()):
            self.journal("error", text=f"{capability.capability} is not used by this bond")
            return response
        self.journal(
            "triggered",
            capability=capability.capability,
            parameters={each.key: [each.type, *each.value] for each in capability.parameters},
        )
        self._run(request.bond_id, capability)
        return response

    def _run(self, bond: str, capability: Any) -> None:
        """Trigger a runner, for a client or by an event."""
        runner = self.runners.get(capability.capability)
        if runner is None:
            self.die(f"an event for {capability.capability}, which is freed")
            return
        instance = capability.instance_id
        parameters = {each.key: each for each in capability.parameters}

        def act() -> None:
            if runner.short in MULTIPLEXERS:
                self._multiplex(runner, bond, instance, parameters)
            else:
                self._act(runner, bond, instance, parameters)

        if self.start(runner, f"{bond}/{instance}", act):
            self.emit(runner, bond, instance, TRIGGERED)

    def _multiplex(self, runner: Runner, bond: str, instance: str, parameters: Any) -> None:
        count = 1
        if "input_count" in parameters:
            if parameters["input_count"].type != 2:
                self.die("bad any_cast of input_count")
                return
            count = int(parameters["input_count"].value[0])
        runner.inputs[instance] = runner.inputs.get(instance, 0) + 1
        if runner.inputs[instance] == count:
            self.emit(runner, bond, instance, SUCCEEDED)

    def _act(self, runner: Runner, bond: str, instance: str, parameters: Any) -> None:
        for key, code in READ.get(runner.short, {}).items():
            if key in parameters and parameters[key].type != code:
                self.die(f"bad any_cast of {key}")
                return
        outcome = self.outcome(runner)
        if outcome == "succeed":
            self.emit(runner, bond, instance, SUCCEEDED, HANDED.get(runner.short, ()))
        elif outcome == "fail":
            self.emit(runner, bond, instance, FAILED, [("message", 3, ["it did not work"])])
        elif outcome == "drive":
            while not self.stopping.is_set() and not runner.cancelled.wait(0.05):
                pass
            self.emit(runner, bond, instance, FAILED)
        elif outcome == "hang":
            self.hang()

    def emit(
        self, runner: Runner, bond: str, instance: str, code: int, handed: Iterable[Any] = ()
    ) -> None:
        """Tell of an event where a connection starts, and trigger what is at its other end."""
        for name, (kind, target) in sorted(runner.connections.items()):
            if kind != code or name.split("/")[:2] != [bond, instance]:
                continue
            sent = type_named("capabilities2_msgs/msg/Capability")()
            sent.capability, sent.provider = target.capability, target.provider
            sent.instance_id = target.instance_id
            sent.parameters = list(target.parameters)
            for key, of_type, value in handed:
                parameter = type_named("capabilities2_msgs/msg/CapabilityParameter")()
                parameter.key, parameter.type, parameter.value = key, of_type, value
                sent.parameters.append(parameter)
            self._publish(code, instance, runner, sent)
            self._run(bond, sent)

    def _publish(self, code: int, instance: str, runner: Runner | None, target: Any) -> None:
        message = self._event()
        message.event.trigger_id = instance
        message.event.code.code = code
        if runner is not None:
            message.event.connection.source.capability = runner.capability
            message.event.connection.source.provider = runner.provider
            message.event.connection.target = target
        self._events.publish(message)

    def _running(self, _: Any, response: Any) -> Any:
        for runner in self.runners.values():
            running = type_named("capabilities2_msgs/msg/RunningCapability")()
            running.capability.capability = runner.capability
            running.capability.provider = runner.provider
            response.running_capabilities.append(running)
        return response

    def _specs(self, _: Any, response: Any) -> Any:
        hostile = HOSTILE if self.options.hostile else ()
        for package, kind, content in (*redumped(self.options.version), *hostile):
            spec = type_named("capabilities2_msgs/msg/CapabilitySpec")()
            spec.package, spec.type, spec.content = package, kind, content
            response.capability_specs.append(spec)
        return response

    def _spec(self, _: Any, response: Any) -> Any:
        return response

    def _runnable(self, _: Any, response: Any) -> Any:
        for name, content in runnable(hostile=self.options.hostile):
            response.index_of_specs.append(name)
            spec = type_named("capabilities2_msgs/msg/RunnableSpec")()
            spec.spec = content
            response.runnable_specs.append(spec)
        return response


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--version", type=int, default=2, choices=[1, 2, 3])
    parser.add_argument("--hostile", action="store_true")
    options = parser.parse_args(arguments())
    server: Base
    if options.version == 1:
        from tests.ros.servers.capabilities2_v1 import ServerV1

        server = ServerV1(options)
    else:
        server = Server(options)
    server.run()
    raise SystemExit(server.code)


if __name__ == "__main__":
    main()
