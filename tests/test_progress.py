"""Who counts the items of long work, and how often."""

from __future__ import annotations

import sys
from types import ModuleType, SimpleNamespace

import pytest

from gpsfsm.errors import UsageError
from gpsfsm.progress import counted, ticking


@pytest.mark.parametrize("progress", [None, False, True])
def test_where_nobody_looks_no_bar_is_drawn(
    progress: bool | None, capsys: pytest.CaptureFixture[str]
) -> None:
    assert list(counted("abc", 3, progress)) == ["a", "b", "c"]
    with ticking(progress, "items", None) as tick:
        tick(1, None)
    assert capsys.readouterr() == ("", "")


def test_progress_is_a_choice_or_a_function() -> None:
    with pytest.raises(UsageError, match="progress takes True, or a function of two numbers"):
        list(counted("abc", 3, "yes"))  # type: ignore[arg-type]


@pytest.mark.parametrize("total", [250, None])
def test_a_bar_in_a_notebook_sends_few_messages_and_ends_full(
    total: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[str] = []

    class Handle:
        def update(self, bar: object) -> None:
            sent.append(bar._repr_html_())  # type: ignore[attr-defined]

    def display(bar: object, *, display_id: bool) -> Handle:
        assert display_id
        sent.append(bar._repr_html_())  # type: ignore[attr-defined]
        return Handle()

    ipython = ModuleType("IPython")
    ipython.get_ipython = lambda: SimpleNamespace(kernel=object())  # type: ignore[attr-defined]
    inner = ModuleType("IPython.display")
    inner.display = display  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "IPython", ipython)
    monkeypatch.setitem(sys.modules, "IPython.display", inner)
    with ticking(True, "<runs>", total) as tick:
        for done in range(1, 251):
            tick(done, total)
    assert len(sent) == (126 if total else 26)
    if total:
        assert sent[-1] == (
            '<div><progress value="250" max="250"></progress> &lt;runs&gt;: 250 of 250</div>'
        )
    else:
        assert sent[-1] == "<div><progress></progress> &lt;runs&gt;: 250</div>"
