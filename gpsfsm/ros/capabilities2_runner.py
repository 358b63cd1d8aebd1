"""The runner of whatever a Capabilities2 server offers, and the choice of those that act there.

With ``--via capabilities2`` the robot's own runners act, as they do for Fabric; gpsfsm takes the
place of Fabric. What gpsfsm has runners of its own for stays with it: generic steps, prompts, the
queue of plans.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from gpsfsm.execution.runner import LoadContext, RunContext, Runner, RunnerError
from gpsfsm.ros.capabilities2 import FAILED, GoneError, Server, Session
from gpsfsm.ros.capabilities2_values import outputs, reason, typed
from gpsfsm.ros.node import RosError, choose, process_node, waited
from gpsfsm.ros.runner import Services

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.capabilities.library import Library
    from gpsfsm.execution.records import RunValue
    from gpsfsm.model.capability import Provider
    from gpsfsm.model.ros import RosSettings

_FRESH_S = 60.0
_OUTLIVE_S = 9.0
"""A bond breaks 10 seconds after the end of a process, which is a while ago already."""
_FREE_S = 3.0
"""Within the grace time of an instance that is to stop."""


class Capabilities2Runner(Runner):
    """Has the robot's runner started, triggers it, and waits for what it tells."""

    brings_dependencies = True
    """The server starts what a runner depends on by itself."""

    def __init__(self) -> None:
        self._settings: RosSettings | None = None
        self._described: Provider | None = None
        self._session: Session | None = None
        self._capability = self._provider = ""
        self._used = False
        self._acting = 0
        self._one = asyncio.Lock()
        self._using = asyncio.Lock()

    async def start(self, context: LoadContext) -> None:
        """Have it started. Raises RunnerError, as far as the server tells that it is not."""
        services = context.services.get("ros")
        if not isinstance(services, Services):
            raise RunnerError("a capability server acts in a run with --real only")
        self._settings = services.settings
        self._described = services.library.resolve(context.interface, context.provider).provider
        if self._described is None:
            raise RunnerError(f"no file describes {context.provider or context.interface}")
        offered = await asyncio.to_thread(Offered.of, services.settings)
        names = offered.names(services.library, context.interface, self._described)
        if names is None:
            raise RunnerError(f"the capability server does not offer {self._described.name}")
        self._capability, self._provider = names
        try:
            await self._use()
        except BaseException:
            await self.stop()  # nobody else does, and the bond would be held for ever
            raise

    async def _use(self) -> Session:
        """The bond under which its runner is started; a new one if the server was restarted."""
        async with self._using:
            session = self._session
            if session is None or session.unusable:
                if session is not None:
                    await session.release(self)
                node = await asyncio.to_thread(process_node)
                session = self._session = await asyncio.to_thread(Session.of, node, self)
                self._used = False
            if not self._used:
                await session.use(self._capability, self._provider)
                self._used = True
            return session

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Trigger it, and hand over what its event brings."""
        assert self._described is not None
        values = typed(self._described, parameters)
        try:
            session = await self._use()
            if session.serial:
                async with self._one:
                    return await self._act(session, values, context)
            return await self._act(session, values, context)
        except RosError as error:
            raise RunnerError(str(error)) from None

    async def _act(
        self, session: Session, values: list[Any], context: RunContext
    ) -> Mapping[str, RunValue]:
        assert self._described is not None
        ended = False
        self._acting += 1
        try:
            heard = await session.act(
                self._capability,
                self._provider,
                values,
                key=context.key,
                deadline_s=self._deadline_s,
            )
            ended = True
        except GoneError:
            ended = True  # there is nobody who could stop it
            raise
        finally:
            self._acting -= 1
            if not ended:
                await self._free(session, context)
        handed = outputs(self._described, heard.parameters)
        if heard.code == FAILED:
            why = reason(heard.parameters)
            failed = f"{self._capability} has failed" + (f": {why}" if why else "")
            raise RunnerError(failed, **handed)
        return handed

    @property
    def _deadline_s(self) -> float:
        assert self._settings is not None
        assert self._described is not None
        call = self._described.ros
        own = 0.0 if call is None else call.deadline_s
        return own or self._settings.deadline_s

    async def _free(self, session: Session, context: RunContext) -> None:
        """Stop an instance: the server can only let go of a whole runner."""
        if self._acting:
            context.log(
                f"the capability server cannot stop one instance of {self._capability} while "
                "others act: it continues there"
            )
            return
        self._used = False
        try:
            await session.free(self._capability, _FREE_S)
        except RosError as error:
            context.log(
                f"{error}: it may hang when a runner is freed that acts; if it stays so, restart it"
            )

    async def left(self, key: str) -> str:
        """Wait until the bond of the process that has ended is broken: the server stops it then."""
        del key  # with the bond all instances end
        session = await self._use()
        self._used = False
        try:
            if await session.outlive(self._capability, _OUTLIVE_S):
                return f"the capability server has stopped {self._capability}"
        except RosError as error:
            raise RunnerError(str(error)) from None
        raise RunnerError(
            f"{self._capability} may still act for the process that has ended: the capability "
            "server has not let go of it yet, or cannot say so"
        )

    async def stop(self) -> None:
        """Free the runner; with the last one the bond ends."""
        session, self._session = self._session, None
        if session is None:
            return
        if self._used and not session.problem:
            with suppress(RosError):  # then the bond ends alone
                await session.free(self._capability, _FREE_S)
        self._used = False
        await session.release(self)


class Offered:
    """The offer of a robot's server: the providers by the names of the interfaces."""

    def __init__(self, providers: Mapping[str, Sequence[str]]) -> None:
        self._providers = providers
        self._since = time.monotonic()

    @classmethod
    def of(cls, settings: RosSettings) -> Offered:
        """The offer of the server, as of late; blocks. Raises RosError."""
        choose(settings)
        node = process_node()
        offered = node.shared.get(cls.__name__)
        if not isinstance(offered, cls) or time.monotonic() - offered._since > _FRESH_S:
            offered = node.shared[cls.__name__] = waited(cls._requested(node))
        return offered

    @classmethod
    async def _requested(cls, node: Any) -> Offered:
        server = await Server.find(node)
        return cls({name: await server.providers(name) for name in await server.interfaces()})

    def names(
        self, library: Library, interface: str, described: Provider
    ) -> tuple[str, str] | None:
        """Interface and provider as the server calls them; None if it does not offer them.

        The names of the plan come first, then those of the file, then earlier ones.
        """
        about = library.interface(described.implements)
        usual = {described.implements, "" if about is None else about.default_provider}
        formerly = () if about is None else about.formerly
        for name in (interface, described.implements, *formerly):
            offered = self._providers.get(name, ())
            if described.name in offered:
                return name, described.name
            if offered and described.name in usual:  # the server calls it otherwise
                return name, name if name in offered else offered[0]
        return None


class Via:
    """A hook for the maker of runners: the providers that act on the server of a robot."""

    def __init__(self, settings: RosSettings, library: Library) -> None:
        self._settings, self._library = settings, library
        self._problem = ""

    def __call__(self, described: Provider) -> type[Runner] | None:
        """The class that has a provider act there; None if the server does not offer it."""
        if self._problem:
            raise RunnerError(self._problem)  # without waiting once more
        try:
            offered = Offered.of(self._settings)
        except RosError as error:
            self._problem = str(error)
            raise RunnerError(self._problem) from None
        names = offered.names(self._library, described.implements, described)
        return None if names is None else Capabilities2Runner
