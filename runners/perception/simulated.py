"""Perception in a world."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from gpsfsm.execution.runner import RunContext, RunnerError
from gpsfsm.runners.perception import ask_yes_or_no, question_and_text, verdict, verdict_word
from gpsfsm.simulation.base import Simulated, number, text_of

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from gpsfsm.execution.records import RunValue
    from gpsfsm.generation.service import Answers
    from gpsfsm.simulation.base import WorldState

_LISTENS_S = 5.0  # if the plan does not say how long
_LONGEST_S = 1e9  # that the capability files permit


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z']+", text.casefold())


_PEOPLE = frozenset(
    _words("person persons people somebody anybody someone anyone human humans visitor visitors")
)
_GOOD = frozenset(
    _words("good great nice happy glad thanks thank love like fine well wonderful perfect yes")
    + _words("please excellent friendly beautiful pleasant delighted")
)
_BAD = frozenset(
    _words("bad sad angry hate awful terrible no never wrong broken sorry unhappy annoyed tired")
    + _words("poor worst horrible pain afraid lost late")
)


class ImageAnalysisRunner(Simulated):
    """Says what the camera sees: what the world file answers, else the people and things in view.

    Asked for people, or for a thing by its name, it says yes or no.
    """

    idempotent = True
    takes_s = (2.0, 6.0)

    def act(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """The answer as text."""
        prompt = text_of(parameters.get("prompt"))
        answer = self.answer(prompt, context)
        if answer is not None:
            return {"text": answer.text, **answer.outputs}
        return {"text": _seen(self.world, self.now(context), prompt)}


def _seen(world: WorldState, now: float, prompt: str) -> str:
    """The view of the camera in words: for an analysis and for a check the same."""
    people = [person.looks for person in world.people_in_view(now)]
    here = [
        each
        for each in world.world.things
        if each.window.holds(now) and world.in_view(now, each.x, each.y)
    ]
    if set(_words(prompt)) & _PEOPLE:
        return _yes_or_no(people, "nobody")
    wanted = [each.name for each in world.world.things if each.name in prompt]
    if wanted:
        return _yes_or_no([_a(each.name) for each in here if each.name in wanted], "none")
    return f"I see {_listed([*people, *(_a(each.name) for each in here)], 'nothing special')}."


class CheckRunner(Simulated):
    """Succeeds on yes and fails on no: of what the camera sees, or of a text.

    The world file comes first: what it answers to this runner, then, without a text, to an
    ImageAnalysisRunner that is asked the same. A model, where the run has one, is asked about texts
    alone; what the camera sees is a matter of the world.
    """

    idempotent = True
    takes_s = (2.0, 6.0)

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Ask the model about a text, or the world. Raises RunnerError unless it says yes."""
        question, text = question_and_text(parameters)
        answers: Answers | None = self.services.get("answers")
        if text and answers is not None:
            least, greatest = self.settings.duration_s or self.takes_s
            answered = await answers.answer(
                lambda service, log: ask_yes_or_no(service, question, text, log),
                context,
                usual_s=least + (greatest - least) * context.random.random(),
            )
            if answered.ending is not None:
                return answered.ending.outputs
            return verdict(answered.text, verdict_word(answered.text))
        await self.pass_time(context)
        return self._from_world(question, text, context)

    def _from_world(self, question: str, text: str, context: RunContext) -> Mapping[str, RunValue]:
        answer = self.answer(f"{question}\n{text}" if text else question, context)
        if answer is not None:
            return verdict(answer.text, _word(answer.text), answer.outputs)
        if not text:
            answer = self.answer(question, context, interface=_LOOKS)
        said = text or _seen(self.world, self.now(context), question)
        said = said if answer is None else answer.text
        return verdict(said, _word(said))


_LOOKS = "perception_capabilities/ImageAnalysisRunner"


def _word(said: str) -> str:
    """The first word of an answer if it is yes or no. People say more than that."""
    first = _words(said)[:1]
    return first[0] if first in (["yes"], ["no"]) else verdict_word(said)


class TranscribeRunner(Simulated):
    """Writes down the words that are said while it listens."""

    takes_s = (0.5, 2.0)  # after listening

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Listen, then understand. Raises RunnerError if there was silence."""
        text = await _listen(self, parameters, context)
        await self.pass_time(context)
        if not text:
            raise RunnerError("nothing was heard")
        return {"text": text, "success": True}


class SpeechRunner(Simulated):
    """Says a text. People who hear it may reply."""

    takes_s = (0.3, 0.8)  # before it speaks

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """Speak, as long as the words take."""
        text = text_of(parameters.get("text")).strip()
        await self.pass_time(context)
        if not text:
            raise RunnerError("there is nothing to say: the text is empty")
        await context.sleep(self.world.talk_s(text))
        self.world.say(self.now(context), text)
        return {"success": True}


class SentimentRunner(Simulated):
    """Judges a mood by counting friendly and unfriendly words."""

    takes_s = (0.3, 1.0)

    async def run(
        self, parameters: Mapping[str, RunValue], context: RunContext
    ) -> Mapping[str, RunValue]:
        """The mood of the text, or of what is heard if there is none."""
        text = text_of(parameters.get("text")).strip()
        if not text:
            text = await _listen(self, parameters, context)
        await self.pass_time(context)
        if not text:
            raise RunnerError("there is no text, and nothing was heard")
        answer = self.answer(text, context)
        mood, score = _mood(text)
        outputs: dict[str, RunValue] = {"text": mood, "score": score, "analyzed_text": text}
        return outputs if answer is None else {**outputs, "text": answer.text, **answer.outputs}


async def _listen(
    runner: Simulated, parameters: Mapping[str, RunValue], context: RunContext
) -> str:
    begin = runner.now(context)
    window = number(parameters.get("audio_request_window"), _LISTENS_S)
    await context.sleep(min(max(0.0, window), _LONGEST_S))
    return runner.world.heard(begin, runner.now(context))


def _mood(text: str) -> tuple[str, float]:
    words = _words(text)
    good, bad = sum(word in _GOOD for word in words), sum(word in _BAD for word in words)
    score = round(max(good, bad, 1) / max(good + bad, 1), 2)
    if good == bad:
        return "neutral", 0.5
    return ("positive" if good > bad else "negative"), score


def _yes_or_no(seen: Sequence[str], none: str) -> str:
    return f"Yes, I see {_listed(seen, none)}." if seen else f"No, I see {none}."


def _a(name: str) -> str:
    """The name of a thing with an article."""
    return f"an {name}" if name[:1].lower() in "aeiou" else f"a {name}"


def _listed(names: Sequence[str], none: str) -> str:
    if not names:
        return none
    if len(names) == 1:
        return names[0]
    return f"{', '.join(names[:-1])} and {names[-1]}"
