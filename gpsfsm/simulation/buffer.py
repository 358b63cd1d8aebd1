"""The prompt buffers of a run (semantics, section 8.3)."""

from __future__ import annotations

__all__ = ["PromptBuffers"]

_MAX_TEXTS = 10_000
_MAX_CHARACTERS = 10_000_000


class PromptBuffers:
    """What prompt runners have kept, by uuid. Nothing is ever taken out."""

    def __init__(self) -> None:
        self._kept: dict[str, list[str]] = {}
        self._texts = 0
        self._characters = 0

    def fill(self, uuid: str, text: str) -> None:
        """Keep a text. Without a uuid nothing can ever flush it, so it is not kept.

        Raises OverflowError for more than 10,000 texts or 10,000,000 characters.
        """
        if not uuid:
            return
        self._texts += 1
        self._characters += len(text)
        if self._texts > _MAX_TEXTS or self._characters > _MAX_CHARACTERS:
            raise OverflowError("the prompt buffers of this run are full")
        self._kept.setdefault(uuid, []).append(text)

    def kept(self, uuid: str) -> tuple[str, ...]:
        """What is in the buffer of a uuid, the oldest first."""
        return tuple(self._kept.get(uuid, ())) if uuid else ()
