"""Asks a model for a plan that goes on where another one gave up."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import Capabilities
from gpsfsm.cli._generating import session_for
from gpsfsm.cli._regenerate import ATTEMPTS, MOST_ATTEMPTS, policy_of
from gpsfsm.execution.lane import in_thread
from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.generation.keeping import Keeper
from gpsfsm.generation.language_model import MAX_ANSWER, Request
from gpsfsm.generation.loop import LoopOptions, generate, plan_key
from gpsfsm.generation.passing import PassingOn
from gpsfsm.generation.prompts.builder import PromptOptions
from gpsfsm.generation.prompts.continuation import Try, build_continuation
from gpsfsm.generation.stored import attempt_of
from gpsfsm.model.printable import clip
from gpsfsm.syntax import Limits, parse
from gpsfsm.syntax.response import extract_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.cli._runs import Shared
    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.generation.language_model import Answer, LanguageModel
    from gpsfsm.generation.loop import Attempt, Judge, Judgement
    from gpsfsm.generation.prompts.builder import Prompt
    from gpsfsm.generation.prompts.continuation import Step
    from gpsfsm.generation.service import ModelService
    from gpsfsm.watch.steps import StepTaker

__all__ = ["Regeneration", "facts_of"]

_MAX_PLAN = 20_000


def facts_of(shared: Shared, done: Iterable[StepTaker]) -> tuple[str, ...]:
    """What the robot knows: where it is, and in a simulated world the places that have names."""
    if shared.state is None:
        poses = [taker.pose for taker in done if taker.pose is not None]
        if not poses:
            return ()
        x, y = (round(each, 2) + 0.0 for each in poses[-1])
        told = f"- The robot was at x={x:g}, y={y:g} when it was looked up last."
        return (f"{told} Lengths are in metres.",)
    from gpsfsm.generation.prompts.surroundings import known_of  # noqa: PLC0415

    world, pose = shared.state.world, shared.state.pose(shared.past_us / 1_000_000)
    x, y, yaw = (round(each, 3) + 0.0 for each in (pose.x, pose.y, pose.yaw))  # no -0
    return known_of(replace(world, robot=replace(world.robot, x=x, y=y, yaw=yaw)))


@dataclass(slots=True)
class Regeneration:
    """A Regenerator.

    ``base`` says what is wanted, ``done`` what the plans have done, ``facts`` how things stand
    now. ``apart``: an answer is judged in a thread, while the event loop goes on.
    """

    service: ModelService
    base: Heading
    done: Mapping[int, StepTaker]
    facts: Callable[[], Sequence[str]]
    apart: bool = False

    async def __call__(self, due: Due, write: Callable[[QueueRow], None], /) -> None:
        """Ask, and write down what is asked and what comes of it. Raises GpsfsmError."""
        service, keeper = self.service, Keeper(_Log(write), due.gave_up)
        tries = [
            Try(text, self._steps(plan)) for plan, text in zip(due.chain, due.texts, strict=True)
        ]
        prompt = build_continuation(
            str(self.base.options.get("task", "")) or _task_in(due.texts[0]),
            service.library,
            tries,
            facts=self.facts(),
            options=PromptOptions(
                context_tokens=service.model.context_tokens,
                answer_tokens=service.max_tokens,
                follow_up_tokens=(service.model.context_tokens or 0) // 4,
            ),
        )
        past = self._past(due, prompt, keeper)
        judge = _going_on(service.judge, due)
        judged, spent = _Judged(service.model, judge, due.before, apart=self.apart), _Spent()

        def keep(attempt: Attempt) -> None:
            spent.seconds += 0.0 if attempt.answer is None else attempt.answer.latency_s
            if attempt.round == 1:  # said once, of the prompt that all of them begin with
                attempt = replace(attempt, note="; ".join(prompt.notes))
            keeper.attempt(attempt)

        found = await generate(
            judged,
            Request(prompt.messages, prompt.task),
            judged.judge,
            self._options(due, prompt),
            keep=keep,
            past=past,
            clock=lambda: spent.seconds,  # not that of the wall: after a crash it is the same
        )
        keeper.generated(found)

    def _steps(self, plan: int) -> tuple[Step, ...]:
        return self.done[plan].steps if plan in self.done else ()

    @property
    def _attempts(self) -> int:
        found = self.base.options.get("attempts")
        return found if type(found) is int and 1 <= found <= MOST_ATTEMPTS else ATTEMPTS

    def _past(self, due: Due, prompt: Prompt, keeper: Keeper) -> list[Attempt]:
        """The answers to this very prompt that are known; writes down that it is asked."""
        session = session_for(
            prompt,
            self.service.model,
            options={"seed": self.base.seed, "attempts": self._attempts, "candidates": 1},
            capabilities=Capabilities(self.service.library),
            why=self._why(due),
        )
        asked = [place for place, row in enumerate(due.kept) if row.kind is QueueKind.ASKED]
        if asked:
            last = due.kept[asked[-1]].data or {}
            if last.get("prompt_sha256") == session.prompt_sha256:
                return [attempt_of(row.data or {}) for row in due.kept[asked[-1] + 1 :]]
        keeper.asked(session)
        return []

    def _why(self, due: Due) -> str:
        failed = [step for step in self._steps(due.gave_up) if step.failed]
        return f"{failed[-1].action} {failed[-1].outcome}" if failed else "it gave up"

    def _options(self, due: Due, prompt: Prompt) -> LoopOptions:
        service, policy = self.service, policy_of(self.base.options)
        total_s = None if policy is None else policy.total_s
        return LoopOptions(
            rounds=self._attempts,
            max_tokens=service.max_tokens,
            temperature=service.temperature,
            seed=self.base.seed,
            total_s=None if total_s is None else total_s - due.spent_s,
            context_tokens=service.model.context_tokens,
            grammars=service.grammars(prompt.offered),
            seen=tuple(
                (plan_key(_plan_in(text)), _again(plan))
                for plan, text in zip(due.chain, due.texts, strict=True)
            ),
        )


def _going_on(judge: Judge, due: Due) -> Judge:
    """Accepts no plan that does nothing, or the same as one of the chain, however it is written."""
    known = {
        print_: _again(plan)
        for plan, text in zip(due.chain, due.texts, strict=True)
        if (print_ := _fingerprint(text))
    }

    def judged(answer: str) -> Judgement:
        found = judge(answer)
        if not found.accepted:
            return found
        print_ = _fingerprint(found.plan)
        code, why = ("repeated", known[print_]) if print_ in known else ("", "")
        if not print_:
            code, why = "empty", "the plan has no step in which anything is done"
        if not why:
            return found
        told = f"It is refused: {why}."
        return replace(found, accepted=False, told=told, errors=1, findings=((code, why),))

    return judged


@dataclass(slots=True)
class _Spent:
    """The seconds that answers have taken."""

    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class _Log:
    """The queue as the log of a Keeper; it knows the time itself."""

    write: Callable[[QueueRow], None]

    def write_queue(self, at_us: int, row: QueueRow) -> None:  # noqa: ARG002
        """Keep a row."""
        self.write(row)


class _Judged(PassingOn):
    """A model whose answers are judged as they come, and whose requests are counted on.

    ``before`` is how many requests for the same task came before those of this session.
    """

    def __init__(self, model: LanguageModel, judge: Judge, before: int, *, apart: bool) -> None:
        super().__init__(model)
        self._judge, self._before, self._apart = judge, before, apart
        self._known: dict[str, Judgement] = {}

    async def answer(self, request: Request) -> Answer:
        """Ask it. Raises ModelError."""
        number = self._before + (request.number or 0)
        answer = await super().answer(replace(request, number=number))
        if self._apart and len(answer.text) <= MAX_ANSWER:
            self._known[answer.text] = await in_thread(self._judge, answer.text)
        return answer

    def judge(self, answer: str, /) -> Judgement:
        """What is known about an answer by now."""
        return self._known.pop(answer, None) or self._judge(answer)


def _again(plan: int) -> str:
    return f"plan {plan} is the same, and it gave up"


def _plan_in(text: str) -> str:
    found = extract_plan(text, Limits().max_markup)
    return text if found is None else text[found.start : found.end].strip()


def _fingerprint(text: str) -> str:
    """What tells plans apart that do different things; "" for what is no plan or does nothing."""
    from gpsfsm.compile import compile_plan  # noqa: PLC0415

    found = parse(text, from_response=True).plan
    return compile_plan(found).automaton.fingerprint if found and found.runners else ""


def _task_in(text: str) -> str:
    """The task of a plan of which nobody has said what it is for."""
    said = [
        comment
        for found in re.findall(r"<!--(.*?)-->", text[:_MAX_PLAN], re.DOTALL)
        if not (comment := " ".join(found.split())).startswith("gpsfsm:") and comment
    ]
    what = f" It says of itself: {clip(' '.join(said), 1000)}" if said else ""
    shown = text if len(text) <= _MAX_PLAN else clip(text, _MAX_PLAN)
    return f"Achieve what this plan was to achieve.{what}\n\n{shown.strip()}"
