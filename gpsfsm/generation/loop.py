"""The loop: ask, judge, tell the model what is wrong, ask again, until a plan is accepted.

The loop decides nothing about plans: a ``Judge`` does. Nothing is lost: every answer, good or bad,
is kept (``keep``) before the loop goes on, and what was kept can be given back (``past``), so that
a loop whose process died goes on where it was and asks nothing twice. After an answer that was not
accepted, the question (``follow_up``) is as long as the model has room to read.
"""

from __future__ import annotations

import asyncio
import hashlib
import re
import time
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Protocol

from gpsfsm.errors import UsageError
from gpsfsm.execution.lane import in_thread
from gpsfsm.generation.language_model import (
    MAX_ANSWER,
    Answer,
    Finish,
    Message,
    ModelError,
    Request,
    Role,
    conversation_tokens,
)
from gpsfsm.generation.prompt_builder import find_template

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Iterator, Sequence

    from gpsfsm.generation.language_model import Constraint, LanguageModel

_FORMAT_VERSION = 1
MAX_ATTEMPTS = 100
MAX_CANDIDATES = 16
_WARMER = 0.3
_HOTTEST = 1.0


@dataclass(frozen=True, slots=True)
class Judgement:
    """The verdict about an answer.

    ``plan`` is the plan in it ("" if there is none), as it would be run: repairs that are safe have
    been made, ``repairs`` names them. ``feedback`` is the answer to the model. ``findings`` are the
    codes and messages that matter, the worst first. ``errors`` and ``warnings`` count them.
    ``decided`` is false if the plan could not be checked at all.
    """

    accepted: bool
    plan: str
    feedback: str
    errors: int = 0
    warnings: int = 0
    decided: bool = True
    repairs: tuple[str, ...] = ()
    findings: tuple[tuple[str, str], ...] = ()

    @property
    def badness(self) -> tuple[bool, bool, bool, int, int, int]:
        """The sort key: accepted first, then fewer errors and warnings, then short plans."""
        return (
            not self.accepted,
            not self.plan,
            not self.decided,
            self.errors,
            self.warnings,
            len(self.plan),
        )


class Judge(Protocol):
    """Takes the raw answer of a model; never raises for anything that is in it."""

    def __call__(self, answer: str, /) -> Judgement:
        """Judge it."""


@dataclass(frozen=True, slots=True)
class Attempt:
    """One answer, or the reason why there is none.

    ``round`` counts from 1, and so does ``candidate`` within a round. ``message`` is the last one
    to the model. ``answer`` is None if the model could not be reached. ``problem`` says why there
    is no answer, or why it was refused without a judgement; it is "" if the answer was judged.
    ``note`` says what was left out of the prompt to make it fit.
    """

    round: int
    candidate: int
    message: str
    answer: Answer | None = None
    judgement: Judgement | None = None
    problem: str = ""
    note: str = ""

    @property
    def accepted(self) -> bool:
        """True if the plan of this attempt is accepted, which ends the search."""
        return not self.problem and self.judgement is not None and self.judgement.accepted


@dataclass(frozen=True, slots=True)
class LoopOptions:
    """Options of the loop: how long to go on.

    ``rounds`` are asked at most, each for ``candidates`` answers at once. ``total_s`` bounds the
    whole (None: not at all). ``context_tokens`` is what the model can read and write together, of
    which ``max_tokens`` are for an answer (None: enough). ``seen`` are keys of plans (``plan_key``)
    that must not come again, with the reason why.
    """

    rounds: int = 3
    candidates: int = 1
    max_tokens: int = 4096
    temperature: float = 0.0
    seed: int | None = None
    total_s: float | None = None
    context_tokens: int | None = None
    grammars: tuple[tuple[Constraint, str], ...] = ()
    seen: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Generated:
    """The result of ``generate``; ``best`` is the accepted attempt or the closest one."""

    attempts: tuple[Attempt, ...]
    best: Attempt | None
    reason: str = ""

    @property
    def accepted(self) -> bool:
        """True if there is an accepted plan."""
        return self.best is not None and self.best.accepted

    @property
    def plan(self) -> str:
        """The plan of ``best``, accepted or not; "" if there is none."""
        judgement = None if self.best is None else self.best.judgement
        return "" if judgement is None else judgement.plan

    def to_dict(self) -> dict[str, Any]:
        """The data that ``gpsfsm generate --format json`` prints (docs/generation.md)."""
        from gpsfsm.generation.attempt_log import attempt_data

        return {
            "version": _FORMAT_VERSION,
            "accepted": self.accepted,
            "plan": self.plan,
            "reason": self.reason,
            "attempts": [attempt_data(attempt) for attempt in self.attempts],
        }


@dataclass(slots=True)
class _Search:
    """The state of the loop."""

    attempts: list[Attempt] = field(default_factory=list)
    seen: dict[str, str] = field(default_factory=dict)


def plan_key(plan: str) -> str:
    """A key that tells plans apart: the SHA-256 of the text without its white space."""
    return hashlib.sha256("".join(plan.split()).encode("utf-8", "surrogatepass")).hexdigest()


async def generate(
    model: LanguageModel,
    request: Request,
    judge: Judge,
    options: LoopOptions | None = None,
    *,
    keep: Callable[[Attempt], None] = lambda _: None,
    past: Iterable[Attempt] = (),
    aside: bool = False,
    clock: Callable[[], float] = time.monotonic,
) -> Generated:
    """Ask until a plan is accepted.

    ``request`` holds the messages of the prompt and the task; the rest comes from ``options``.
    ``keep`` is called with each attempt, in order, before anything follows from it; what it raises
    ends the loop. ``past`` are attempts that were kept before. ``aside``: answers are judged in a
    thread, while the event loop goes on. Model and server may fail: that ends
    in a reason, not in an exception. Raises UsageError for options that make no sense.
    """
    options = _valid(options or LoopOptions())
    search = _Search(seen=dict(options.seen))
    kept = _by_round(past)
    began = clock() - sum(_spent(attempts) for attempts in kept.values())
    for number in range(1, options.rounds + 1):
        left = None if options.total_s is None else options.total_s - (clock() - began)
        done = kept.get(number, [])
        follow = _question(request.messages, search, options)
        for attempt in done:
            _remember(search, attempt)
        if len(done) < options.candidates:
            if left is not None and left <= 0:
                return _ended(search, f"the time of {options.total_s:g} s is over")
            question = _request(request, follow.messages, options, search)
            before = (number - 1) * options.candidates
            question = replace(question, number=before)
            ask = _Asking(model, question, judge, number, follow.note, keep, aside)
            fresh = await ask.all(range(len(done) + 1, options.candidates + 1), left, search.seen)
            assert len(done) + len(fresh) == options.candidates  # each candidate has one attempt
            for attempt in fresh:
                keep(attempt)
                _remember(search, attempt)
            done = [*done, *fresh]
        if any(attempt.accepted for attempt in done):
            return _ended(search, "")
        if all(attempt.answer is None for attempt in done):
            return _ended(search, done[-1].problem)
    rounds = f"{options.rounds} attempt{'s' if options.rounds > 1 else ''}"
    return _ended(search, f"no plan was accepted in {rounds}")


def _valid(options: LoopOptions) -> LoopOptions:
    if not 1 <= options.rounds <= MAX_ATTEMPTS:
        raise UsageError(f"attempts must be from 1 to {MAX_ATTEMPTS}, not {options.rounds}")
    if not 1 <= options.candidates <= MAX_CANDIDATES:
        raise UsageError(f"candidates must be from 1 to {MAX_CANDIDATES}, not {options.candidates}")
    return options


def _by_round(past: Iterable[Attempt]) -> dict[int, list[Attempt]]:
    rounds: dict[int, list[Attempt]] = {}
    for attempt in past:
        rounds.setdefault(attempt.round, []).append(attempt)
    return rounds


def _again(number: int) -> str:
    return f"this plan was rejected in attempt {number}"


def _is_rejected(attempt: Attempt) -> bool:
    """True if it has a plan that must not come again; what was cut off may come whole."""
    if attempt.answer is None or attempt.answer.finish is Finish.LENGTH or attempt.accepted:
        return False
    return attempt.judgement is not None and attempt.judgement.plan != ""


def _spent(attempts: Sequence[Attempt]) -> float:
    """Seconds that a round has taken."""
    return max((each.answer.latency_s for each in attempts if each.answer is not None), default=0)


def _remember(search: _Search, attempt: Attempt) -> None:
    search.attempts.append(attempt)
    if _is_rejected(attempt):
        assert attempt.judgement is not None
        key = plan_key(attempt.judgement.plan)
        search.seen.setdefault(key, _again(attempt.round))


def _ended(search: _Search, reason: str) -> Generated:
    judged = [attempt for attempt in search.attempts if attempt.judgement is not None]
    best = min(judged, key=_order, default=None)
    return Generated(tuple(search.attempts), best, reason)


def _order(attempt: Attempt) -> tuple[object, ...]:
    assert attempt.judgement is not None
    return (not attempt.accepted, *attempt.judgement.badness, attempt.round, attempt.candidate)


# -- what is asked ------------------------------------------------------------------------------


def _question(prompt: Sequence[Message], search: _Search, options: LoopOptions) -> FollowUp:
    """The prompt, or what follows the best answer of the last round."""
    if not search.attempts:
        return FollowUp(tuple(prompt))
    last = search.attempts[-1].round
    answered = [each for each in search.attempts if each.round == last and each.answer is not None]
    if not answered:
        return FollowUp(tuple(prompt))
    best = min(answered, key=lambda each: each.judgement.badness if each.judgement else (True,) * 6)
    room = None
    if options.context_tokens is not None:
        room = options.context_tokens - options.max_tokens
    return follow_up(prompt, best, room)


def _request(
    base: Request, messages: Sequence[Message], options: LoopOptions, search: _Search
) -> Request:
    """A model that repeats itself is asked with more temperature."""
    plans = [each.judgement.plan for each in search.attempts if each.judgement is not None]
    repeats = len(plans) - len({plan_key(plan) for plan in plans})
    temperature = options.temperature
    if repeats:
        temperature = max(temperature, min(_HOTTEST, temperature + _WARMER * repeats))
    assert temperature >= options.temperature
    return replace(
        base,
        messages=tuple(messages),
        grammars=options.grammars,
        max_tokens=options.max_tokens,
        temperature=temperature,
        seed=options.seed,
    )


def _now_s() -> float:
    return time.monotonic()


def _whole_s(began_s: float) -> float:
    """The seconds with all retries, where the model tells of the last request alone.

    Whole seconds, so that answers that come out of a file take the same time always.
    """
    return float(int(_now_s() - began_s))


@dataclass(frozen=True, slots=True)
class _Asking:
    """One round: the same question, one or several times at once."""

    model: LanguageModel
    request: Request
    judge: Judge
    round: int
    note: str
    keep: Callable[[Attempt], None]
    aside: bool

    async def all(
        self, candidates: Iterable[int], left_s: float | None, seen: dict[str, str]
    ) -> list[Attempt]:
        """The attempts in the order of their numbers, whichever comes first."""
        numbers = list(candidates)
        asking = [asyncio.ensure_future(self._answer(number, left_s)) for number in numbers]
        try:
            answers = await asyncio.gather(*asking)
        except asyncio.CancelledError:
            self._keep_some(numbers, asking)
            raise
        taken = dict(seen)
        attempts: list[Attempt] = []
        for number, answer in zip(numbers, answers, strict=True):
            try:
                attempt = await self._judgement(number, answer, taken)
            except asyncio.CancelledError:
                for each in attempts:
                    self.keep(each)
                self._keep_some(numbers[len(attempts) :], asking[len(attempts) :])
                raise
            assert attempt.problem or attempt.judgement is not None  # never neither
            attempts.append(attempt)
            if _is_rejected(attempt):
                assert attempt.judgement is not None
                taken.setdefault(plan_key(attempt.judgement.plan), _again(self.round))
        return attempts

    def _keep_some(self, numbers: Sequence[int], asking: Sequence[asyncio.Task[Any]]) -> None:
        """Keep what has come already: it was paid for."""
        for number, task in zip(numbers, asking, strict=True):
            if task.done() and not task.cancelled() and task.exception() is None:
                outcome = task.result()
                attempt = Attempt(self.round, number, self._last_message, note=self.note)
                if isinstance(outcome, Answer):
                    attempt = replace(
                        attempt, answer=replace(outcome, text=outcome.text[:MAX_ANSWER])
                    )
                    outcome = "the search was stopped before this answer was judged"
                self.keep(replace(attempt, problem=outcome))

    @property
    def _last_message(self) -> str:
        return self.request.messages[-1].text

    async def _answer(self, candidate: int, left_s: float | None) -> Answer | str:
        assert self.request.number is not None
        began_s = _now_s()
        request = replace(self.request, number=self.request.number + candidate - 1)
        if candidate > 1:  # the same question would get the same answer
            seed = candidate - 1 if request.seed is None else request.seed + candidate - 1
            warm = max(request.temperature, _WARMER)
            request = replace(request, seed=seed, temperature=warm)
        try:
            async with asyncio.timeout(left_s):
                answer = await self.model.answer(request)
        except TimeoutError:
            return f"{self.model.name} did not answer in the time that was left"
        except ModelError as error:
            if not error.empty:
                return str(error)
            return Answer("", self.model.name, latency_s=_whole_s(began_s))
        if answer.requests == 1:
            return answer
        return replace(answer, latency_s=max(answer.latency_s, _whole_s(began_s)))

    async def _judgement(
        self, candidate: int, answer: Answer | str, seen: dict[str, str]
    ) -> Attempt:
        if not self.aside:
            return self._judged(candidate, answer, seen)
        attempt: Attempt = await in_thread(self._judged, candidate, answer, seen)
        return attempt

    def _judged(self, candidate: int, answer: Answer | str, seen: dict[str, str]) -> Attempt:
        attempt = Attempt(self.round, candidate, self._last_message, note=self.note)
        if isinstance(answer, str):
            return replace(attempt, problem=answer)
        if len(answer.text) > MAX_ANSWER:  # nobody would read it, and no plan is that long
            answer = replace(answer, text=answer.text[:MAX_ANSWER], raw="", finish=Finish.LENGTH)
            longer = f"the answer was cut off: it is longer than {MAX_ANSWER:,} characters"
            return replace(attempt, answer=answer, problem=longer)
        judgement = self.judge(answer.text)
        attempt = replace(attempt, answer=answer, judgement=judgement)
        if answer.finish is Finish.LENGTH:  # what is missing is not to be made up
            return replace(attempt, problem="the answer was cut off: it is longer than allowed")
        if judgement.plan and (why := seen.get(plan_key(judgement.plan))):
            return replace(attempt, problem=why)
        return attempt


_FINDING = re.compile(r"\d+\. ")
_REST = "There is more, which is left out here."
_WANT = ", for want of room"


@dataclass(frozen=True, slots=True)
class FollowUp:
    """A conversation, and what was left out of it for want of room ("" if nothing was)."""

    messages: tuple[Message, ...]
    note: str = ""


def follow_up(prompt: Sequence[Message], attempt: Attempt, room: int | None = None) -> FollowUp:
    """The prompt, the answer and what is wrong with it, in at most ``room`` tokens (None: any).

    Earlier answers are left out: they cost room and mislead. If there is too little room, some of
    the findings go first, the worst stay, then the answer goes; the prompt always stays. Users and
    models take turns, since many servers refuse anything else.
    """
    for variant in _variants(prompt, attempt):
        if room is None or conversation_tokens(each.text for each in variant.messages) <= room:
            return variant
    return FollowUp(tuple(prompt), "asked as if for the first time" + _WANT)


def _variants(prompt: Sequence[Message], attempt: Attempt) -> Iterator[FollowUp]:
    """The longest first."""
    shown = _shown(attempt)
    answers = [(Message(Role.ASSISTANT, shown),), ()] if shown else [()]
    for answer in answers:
        missing = "asked without its earlier answer" if shown and not answer else ""
        for correction, shortened in _corrections(attempt, alone=not answer):
            lost = "" if not shortened else "asked without some of what was wrong"
            note = " and ".join(each for each in (missing, lost) if each)
            yield FollowUp(_joined(prompt, answer, correction), note + _WANT if note else "")


def _joined(
    prompt: Sequence[Message], answer: Sequence[Message], correction: str
) -> tuple[Message, ...]:
    """Without an answer in between, what is said to the model is one message."""
    if answer:
        return (*prompt, *answer, Message(Role.USER, correction))
    *before, last = prompt
    return (*before, Message(last.role, f"{last.text.rstrip()}\n\n{correction}"))


def _shown(attempt: Attempt) -> str:
    """The answer of the model; after repairs its plan, for the findings are about that.

    Of what was cut off nothing is shown: it is long, and to be written anew.
    """
    judged = attempt.judgement
    if attempt.answer is None or attempt.answer.finish is Finish.LENGTH:
        return ""
    return judged.plan if judged is not None and judged.repairs else attempt.answer.text.strip()


def _corrections(attempt: Attempt, *, alone: bool) -> Iterator[tuple[str, bool]]:
    """The corrections of the answer, each with a mark if it is less than there is to say.

    Beside the answer, unless it is ``alone``, there is at least one finding.
    """
    assert attempt.answer is not None
    if not attempt.answer.text.strip():
        yield find_template("empty").filled({}), False
    elif attempt.answer.finish is Finish.LENGTH:
        yield find_template("cut").filled({}), False
    else:
        correction = ""
        if attempt.judgement is not None and not attempt.judgement.accepted:
            correction = attempt.judgement.feedback.strip()
        if attempt.problem:
            refused = find_template("refused").filled({"why": attempt.problem})
            if not correction:
                yield refused, False
                return
            correction = f"{refused}\n{correction}"
        template = find_template("correction")
        yield template.filled({"findings": correction}), False
        parts = correction.split("\n\n")
        first = next((place for place, part in enumerate(parts) if _FINDING.match(part)), 0)
        for kept in range(len(parts) - 1, 0 if alone else first, -1):
            yield template.filled({"findings": "\n\n".join([*parts[:kept], _REST])}), True
