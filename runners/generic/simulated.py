"""Generic runners in a world: what answers them stands in the world file."""

from __future__ import annotations

from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.runners.generic import waiting_time, write_line
from gpsfsm.runners.generic.http import shown
from gpsfsm.simulation.base import Simulated, number, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    from gpsfsm.execution.records import RunValue


class WaitRunner(Simulated):
    """Waits in the time of the run; never fails."""

    idempotent = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Wait."""
        await context.sleep(waiting_time(parameters, context))


class LogRunner(Simulated):
    """Writes into the log of the run; never fails."""

    idempotent = True

    async def run(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """Write."""
        self.act(parameters, context)

    def act(self, parameters: Mapping[str, RunValue], context: RunContext) -> None:
        """One line, with its level."""
        write_line(parameters, context)


class _Timed(Simulated):
    """An action with a timeout, which it never exceeds."""

    async def timed(self, context: RunContext, timeout: RunValue | None) -> None:
        """Let the usual time pass; at the timeout it fails."""
        least, greatest = self.settings.duration_s or self.takes_s
        seconds = least + (greatest - least) * context.random.random()
        chance = context.random.random()
        limit = number(timeout, 30.0)
        await context.sleep(min(seconds, limit))
        if seconds > limit:
            raise RunnerError(f"it was not done after {limit:g} seconds")
        if chance < self.settings.fails:
            raise RunnerError(self.settings.message or "it failed by chance, as the world has it")

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue] | None:
        """Wait, perhaps fail, then answer."""
        await self.timed(context, parameters.get("timeout_s"))
        return self.act(parameters, context)


class HttpRunner(_Timed):
    """Answers a request by its method, address and body, as in ``POST http://… body``."""

    takes_s = (0.05, 0.5)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """The answer; raises RunnerError if there is none, or if its status is not expected."""
        method = text_of(parameters.get("method")) or "GET"
        url = text_of(parameters.get("url"))
        answer = self.answer(f"{method} {url} {text_of(parameters.get('body'))}", context)
        if answer is None:
            raise RunnerError(f"nothing answers at {shown(url)}")
        outputs = {"response_body": answer.text, "status_code": 200, **answer.outputs}
        status, wanted = outputs["status_code"], parameters.get("expect_status")
        fits = 200 <= number(status, 0) < 300 if wanted is None else status == wanted
        if not fits:
            raise RunnerError(f"the status is {text_of(status)}", status_code=status)
        return outputs


class ProcessRunner(_Timed):
    """Answers a command line."""

    takes_s = (0.05, 1.0)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """The output; raises RunnerError if there is no such program, or with its exit code."""
        command = text_of(parameters.get("command"))
        answer = self.answer(command, context)
        if answer is None:
            raise RunnerError(f"there is no program for {command!r} in this world")
        outputs = {"stdout": answer.text, "stderr": "", "exit_code": 0, **answer.outputs}
        if outputs["exit_code"] != 0:
            stderr, code = outputs["stderr"], outputs["exit_code"]
            raise RunnerError(f"the exit code is {text_of(code)}", stderr=stderr, exit_code=code)
        return outputs


class PythonRunner(Simulated):
    """Answers the call of a function, as in ``module:name argument``."""

    takes_s = (0.01, 0.5)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """The result of the function; raises RunnerError if there is no such function."""
        function = text_of(parameters.get("function"))
        names = ("argument", "text", "response_body", "stdout", "result")
        arguments = [text_of(parameters.get(name)) for name in names]
        answer = self.answer(" ".join([function, *filter(None, arguments)]), context)
        if answer is None:
            raise RunnerError(f"there is no function {function!r} in this world")
        return {"result": answer.text, **answer.outputs}
