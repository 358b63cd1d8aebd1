"""Engines of constrained decoding, without models: whole texts, and sentences byte by byte."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

from lark import Lark
from lark.exceptions import LarkError
from llguidance import LLMatcher, LLTokenizer, grammar_from

from gpsfsm.checking import CheckOptions, check_text
from gpsfsm.grammars import grammars_for
from gpsfsm.model.finding import Severity

if TYPE_CHECKING:
    from random import Random

    from gpsfsm.capabilities.library import Capabilities

__all__ = ["Engines", "accepts", "allowed", "errors", "matcher", "sentence", "tokenizer"]

_PREFERRED = '"/<>]}'
_SOON = 600
_NEVER = 20_000
_BITS = [tuple(bit for bit in range(8) if byte >> bit & 1) for byte in range(256)]


@cache
def tokenizer() -> LLTokenizer:
    """One token per byte: what is allowed is seen byte by byte."""
    return LLTokenizer("byte")


@dataclass(frozen=True)
class Engines:
    """The grammars of a library in the engines that are installed with gpsfsm."""

    capabilities: Capabilities
    gbnf: str
    lark: str
    json_schema: str
    parser: Lark

    @staticmethod
    def of(capabilities: Capabilities, *, depth: int = 6) -> Engines:
        """Compile them; each must be understood without a warning."""
        texts = {str(key): text for key, text in grammars_for(capabilities, depth=depth)}
        parser = Lark(texts["lark"], parser="lalr")
        return Engines(capabilities, texts["gbnf"], texts["lark"], texts["json-schema"], parser)

    def verdicts(self, text: str) -> dict[str, bool]:
        """Which engine accepts a plan."""
        return {
            "lark": self._parses(text),
            "llguidance lark": accepts("lark", self.lark, text),
            "llguidance gbnf": accepts("gbnf", self.gbnf, text),
        }

    def _parses(self, text: str) -> bool:
        try:
            self.parser.parse(text)
        except LarkError:
            return False
        return True


@lru_cache(maxsize=16)
def _compiled(kind: str, grammar: str) -> LLMatcher:
    compiled = grammar_from(kind, grammar)
    failed, warnings = LLMatcher.validate_grammar_with_warnings(compiled, tokenizer())
    assert not failed, warnings
    assert not warnings
    result = LLMatcher(tokenizer(), compiled)
    assert not result.is_error(), result.get_error()
    return result


def matcher(kind: str, grammar: str) -> LLMatcher:
    """A matcher at the beginning of a text."""
    return _compiled(kind, grammar).deep_copy()


def accepts(kind: str, grammar: str, text: str) -> bool:
    """Whether an engine lets a model write exactly this text."""
    data = list(text.encode("utf-8", "surrogatepass"))
    match = matcher(kind, grammar)
    return match.try_consume_tokens(data) == len(data) and match.is_accepting()


def allowed(actual: LLMatcher) -> set[int]:
    """The bytes that may come next; 256 and more stand for the end."""
    mask = actual.compute_bitmask()
    numbers = (8 * place + bit for place, byte in enumerate(mask) for bit in _BITS[byte])
    return {number for number in numbers if number < tokenizer().vocab_size}


def sentence(kind: str, grammar: str, random: Random) -> str:
    """A text of the grammar, written byte by byte as the masks allow; mostly it ends soon."""
    match = matcher(kind, grammar)
    written = bytearray()
    while True:
        choices = sorted(allowed(match))
        assert choices, (written, match.get_error())
        assert len(written) < _NEVER
        ends = match.is_accepting()
        if ends and (choices[-1] > 255) and random.random() < 0.5:
            break
        choices = [number for number in choices if number <= 255]
        if not choices:
            break
        number = _chosen(choices, random, late=len(written) > _SOON)
        written.append(number)
        assert match.consume_token(number), match.get_error()
    return written.decode("utf-8", "surrogatepass")


def _chosen(choices: list[int], random: Random, *, late: bool) -> int:
    preferred = [byte for byte in _PREFERRED.encode() if byte in choices]
    if preferred and random.random() < (0.97 if late else 0.4):
        return preferred[0]
    plain = [number for number in choices if number < 128]
    if plain and random.random() < 0.9:
        return random.choice(plain)
    return random.choice(choices)


def errors(text: str, capabilities: Capabilities) -> list[str]:
    """The errors of a plan's text and of its capabilities, as ``check`` finds them."""
    report = check_text(text, "plan.xml", CheckOptions(capabilities=capabilities))
    assert "GP903" not in {finding.rule for finding in report.findings}
    return [
        f"{finding.rule}: {finding.message}"
        for finding in report.findings
        if finding.rule[:3] in ("GP1", "GP2") and finding.severity is Severity.ERROR
    ]
