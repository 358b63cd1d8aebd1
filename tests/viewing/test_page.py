"""The report: one file, nothing of a plan is markup in it, and nothing else is ever loaded."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from importlib import resources
from pathlib import Path
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.viewing.js_bundle import joined
from gpsfsm.viewing.page import data_block, is_report, page, unpacked
from tests.fixing.support import STEPS
from tests.viewing.support import document_of

REPO = Path(__file__).parents[2]
HOSTILE = """\
<Plan>
  <Control type="parallel_all" name="&lt;/script&gt;&lt;script&gt;alert(1)&lt;/script&gt;">
    <Runner interface="&lt;img src=x onerror=alert(2)&gt;" provider="a/b" text="&lt;!-- &amp;lt;"/>
    <Runner interface="x/__proto__" provider="constructor" name="toString" text="\u2028\u202e"/>
  </Control>
  <Runner interface="hasOwnProperty" provider="]]&gt;" text="&lt;/noscript&gt;&lt;svg onload=x"/>
</Plan>
"""


class _Parts(HTMLParser):
    """The elements of a page, and what stands in its scripts and styles."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.inside: list[tuple[str, str]] = []
        self._open = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append((tag, dict(attrs)))
        self._open = tag

    def handle_endtag(self, tag: str) -> None:
        self._open = ""

    def handle_data(self, data: str) -> None:
        if self._open in ("script", "style"):
            self.inside.append((self._open, data))

    def of(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def _data(text: str) -> Any:
    (block,) = re.findall(r'<script type="application/json"[^>]*>(.*?)</script>', text, re.DOTALL)
    return unpacked(json.loads(block))


def test_the_page_holds_the_document() -> None:
    shown = document_of(STEPS)
    text = page(shown)
    assert _data(text) == shown
    assert text == page(document_of(STEPS))
    assert is_report(text.encode()[:4_096])


def test_nothing_of_a_plan_is_markup() -> None:
    shown = document_of(HOSTILE)
    shown["title"] = shown["plans"][0]["name"] = "</title><script>alert(3)</script>.xml"
    text = page(shown)
    assert _data(text) == shown
    hostile, harmless = _Parts(text), _Parts(page(document_of(STEPS)))
    count = [
        [tag for tag, _ in parts.tags if tag not in ("li", "h2")] for parts in (hostile, harmless)
    ]
    assert count[0] == count[1]
    assert [kind for kind, _ in hostile.inside] == [kind for kind, _ in harmless.inside]
    assert "img" not in {tag for tag, _ in hostile.tags}


@given(st.text(st.characters(), max_size=40), st.binary(max_size=20))
def test_any_text_stays_in_its_block(text: str, path: bytes) -> None:
    names = [text, path.decode("utf-8", "surrogateescape"), f"</script>{text}<!--<script>"]
    block = data_block({"names": names})
    assert not re.search("[<>&\u2028\u2029]", block)
    assert json.loads(block.encode("utf-8"))["names"] == names


def test_the_policy_allows_what_is_there_and_nothing_else() -> None:
    parts = _Parts(page(document_of(STEPS)))
    (policy,) = [
        attributes["content"] or ""
        for attributes in parts.of("meta")
        if attributes.get("http-equiv") == "Content-Security-Policy"
    ]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert (rules["img-src"], rules["base-uri"], rules["form-action"]) == (
        "data:",
        "'none'",
        "'none'",
    )
    for kind in ("script", "style"):
        texts = [text for tag, text in parts.inside if tag == kind and not text.startswith("{")]
        hashes = {
            f"'sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}'"
            for text in texts
        }
        assert set(rules[f"{kind}-src"].split()) == hashes
    for tag, attributes in parts.tags:
        assert not any(name.startswith("on") or name in ("style", "src") for name in attributes), (
            tag
        )
    assert [link["href"] for link in parts.of("link")] == ["data:,"]


def test_without_scripts_the_findings_can_be_read() -> None:
    text = page(document_of(STEPS))
    (bare,) = re.findall(r"<noscript>(.*?)</noscript>", text, re.DOTALL)
    assert "GP302" in bare
    assert "plan0.xml" in bare


def test_a_page_of_a_dozen_runners_is_small() -> None:
    text = (REPO / "corpus" / "plans" / "tour_guide.xml").read_text(encoding="utf-8")
    shown = document_of(text)
    assert shown["plans"][0]["facts"]["runners"] == 12
    assert len(page(shown).encode()) < 250_000


def test_pages_of_hundreds_of_runners_grow_with_their_plans() -> None:
    text = (REPO / "corpus" / "plans" / "tour_guide.xml").read_text(encoding="utf-8")
    bare = len(page(document_of("<Plan/>")).encode())
    assert bare < 226_000
    runner = '<Runner interface="nav/Waypoint" provider="nav/Waypoint" x="1.5" y="2"/>'
    hundred, thousand = (
        len(page(document_of(f"<Plan>{runner * count}</Plan>")).encode()) - bare
        for count in (100, 1_000)
    )
    assert hundred < 120_000
    assert thousand < 450_000
    assert len(page(document_of(text)).encode()) - bare < 40_000


def test_styles_and_scripts_hold_nothing_that_only_authors_read() -> None:
    parts = _Parts(page(document_of(STEPS)))
    (style,) = (text for kind, text in parts.inside if kind == "style")
    assert "/*" not in style
    (script,) = (text for kind, text in parts.inside if kind == "script" and "use strict" in text)
    assert not re.search(r"^(//|[ \t]|/\*)", script, re.MULTILINE)


def test_texts_of_scripts_stay_as_they_are() -> None:
    parts = _Parts(page(document_of(STEPS)))
    (script,) = (text for kind, text in parts.inside if kind == "script" and "use strict" in text)
    folder = resources.files("gpsfsm.viewing") / "web"
    whole = joined("report.js", lambda name: folder.joinpath(name).read_text(encoding="utf-8"))
    bare = re.sub(r"(?m)(?:^| )// .*$", "", whole)
    texts = re.findall(r'"(?:[^"\\\n]|\\.)*"', bare)
    assert not {text for text in texts if text not in script}
    script = re.sub(r"(?m) ?// .*$", "", script)
    assert re.sub(r"[\s;,]", "", script) == re.sub(r"[\s;,]", "", bare)
    assert len(script) < 0.97 * len(whole)
