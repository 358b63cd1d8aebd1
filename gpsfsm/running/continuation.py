"""Continuation of plans: a model writes one that goes on where another one gave up."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from gpsfsm.capabilities.library import Capabilities
from gpsfsm.execution.lane import in_thread
from gpsfsm.execution.queue_rows import QueueKind
from gpsfsm.generation.attempt_log import Keeper, attempt_of
from gpsfsm.generation.language_model import MAX_ANSWER, ModelWrapper, Request
from gpsfsm.generation.loop import LoopOptions, generate, plan_key
from gpsfsm.generation.prompt_builder import PromptOptions, Try, build_continuation
from gpsfsm.model.printable import clip
from gpsfsm.running.bounds import attempts_of, policy_of
from gpsfsm.running.model_access import session_for
from gpsfsm.syntax import Limits, parse
from gpsfsm.syntax.response import extract_plan

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Mapping, Sequence

    from gpsfsm.execution.chain import Due
    from gpsfsm.execution.journal import Heading
    from gpsfsm.execution.queue_rows import QueueRow
    from gpsfsm.generation.language_model import Answer, LanguageModel
    from gpsfsm.generation.loop import Attempt, Judge, Judgement
    from gpsfsm.generation.prompt_builder import Prompt, Step
    from gpsfsm.generation.service import ModelService
    from gpsfsm.running.drivers import Shared
    from gpsfsm.watch.record_text import StepTaker

_MAX_PLAN = 20_000


def facts_of(shared: Shared, done: Iterable[StepTaker]) -> tuple[str, ...]:
    """The facts about the robot: where it is, and in a simulated world the named places."""
    if shared.state is None:
        poses = [taker.pose for taker in done if taker.pose is not None]
        if not poses:
            return ()
        x, y = (round(each, 2) + 0.0 for each in poses[-1])
        line = f"- The robot was at x={x:g}, y={y:g} when it was last looked up."
        return (f"{line} Lengths are in metres.",)
    from gpsfsm.generation.prompt_builder import world_facts

    world, pose = shared.state.world, shared.state.pose(shared.past_us / 1_000_000)
    x, y, yaw = (round(each, 3) + 0.0 for each in (pose.x, pose.y, pose.yaw))  # no -0
    return world_facts(replace(world, robot=replace(world.robot, x=x, y=y, yaw=yaw)))


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

        generated = await generate(
            judged,
            Request(prompt.messages, prompt.task),
            judged.judge,
            self._options(due, prompt),
            keep=keep,
            past=past,
            clock=lambda: spent.seconds,  # not that of the wall: after a crash it is the same
        )
        keeper.generated(generated)

    def _steps(self, plan: int) -> tuple[Step, ...]:
        return self.done[plan].steps if plan in self.done else ()

    def _past(self, due: Due, prompt: Prompt, keeper: Keeper) -> list[Attempt]:
        """The answers to this very prompt that are known; writes down that it is asked."""
        session = session_for(
            prompt,
            self.service.model,
            seed=self.base.seed,
            rounds=attempts_of(self.base.options),
            capabilities=Capabilities(self.service.library),
            why=self._why(due),
        )
        requests = [place for place, row in enumerate(due.kept) if row.kind is QueueKind.ASKED]
        if requests:
            last = due.kept[requests[-1]].data or {}
            if last.get("prompt_sha256") == session.prompt_sha256:
                return [attempt_of(row.data or {}) for row in due.kept[requests[-1] + 1 :]]
        keeper.session(session)
        return []

    def _why(self, due: Due) -> str:
        failed = [step for step in self._steps(due.gave_up) if step.failed]
        return f"{failed[-1].action} {failed[-1].outcome}" if failed else "it gave up"

    def _options(self, due: Due, prompt: Prompt) -> LoopOptions:
        service, policy = self.service, policy_of(self.base.options)
        total_s = None if policy is None else policy.total_s
        return LoopOptions(
            rounds=attempts_of(self.base.options),
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
    repeated = {
        print_: _again(plan)
        for plan, text in zip(due.chain, due.texts, strict=True)
        if (print_ := _fingerprint(text))
    }

    def judged(answer: str) -> Judgement:
        judgement = judge(answer)
        if not judgement.accepted:
            return judgement
        print_ = _fingerprint(judgement.plan)
        code, why = ("repeated", repeated[print_]) if print_ in repeated else ("", "")
        if not print_:
            code, why = "empty", "the plan has no step that does anything"
        if not why:
            return judgement
        message = f"It is refused: {why}."
        return replace(
            judgement, accepted=False, feedback=message, errors=1, findings=((code, why),)
        )

    return judged


@dataclass(slots=True)
class _Spent:
    """The seconds that answers have taken."""

    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class _Log:
    """The queue as the log of a Keeper; it knows the time itself."""

    write: Callable[[QueueRow], None]

    def write_queue(self, _at_us: int, row: QueueRow) -> None:
        """Keep a row."""
        self.write(row)


class _Judged(ModelWrapper):
    """A model whose answers are judged as they come, and whose requests are counted on.

    ``before`` is how many requests for the same task came before those of this session.
    """

    def __init__(self, model: LanguageModel, judge: Judge, before: int, *, apart: bool) -> None:
        super().__init__(model)
        self._judge, self._before, self._apart = judge, before, apart
        self._judgements: dict[str, Judgement] = {}

    async def answer(self, request: Request) -> Answer:
        """Ask it. Raises ModelError."""
        number = self._before + (request.number or 0)
        answer = await super().answer(replace(request, number=number))
        if self._apart and len(answer.text) <= MAX_ANSWER:
            self._judgements[answer.text] = await in_thread(self._judge, answer.text)
        return answer

    def judge(self, answer: str, /) -> Judgement:
        """The judgement of an answer, made already or made now."""
        return self._judgements.pop(answer, None) or self._judge(answer)


def _again(plan: int) -> str:
    return f"plan {plan} is the same, and it gave up"


def _plan_in(text: str) -> str:
    plan = extract_plan(text, Limits().max_markup)
    return text if plan is None else plan.of(text).strip()


def _fingerprint(text: str) -> str:
    """A text that differs for plans that do different things; "" for none that does anything."""
    from gpsfsm.compile import compile_plan

    plan = parse(text, from_response=True).plan
    return compile_plan(plan).automaton.fingerprint if plan and plan.runners else ""


def _task_in(text: str) -> str:
    """The task of a plan of which nobody has said what it is for."""
    said = [
        comment
        for written in re.findall(r"<!--(.*?)-->", text[:_MAX_PLAN], re.DOTALL)
        if not (comment := " ".join(written.split())).startswith("gpsfsm:") and comment
    ]
    what = f" It says of itself: {clip(' '.join(said), 1000)}" if said else ""
    shown = text if len(text) <= _MAX_PLAN else clip(text, _MAX_PLAN)
    return f"Achieve what this plan was to achieve.{what}\n\n{shown.strip()}"
