"""What is taken out of a report: pictures as files, texts by the clipboard."""

from __future__ import annotations

import base64
import re
import shlex
import struct
from functools import cache
from typing import TYPE_CHECKING, Any

import pytest
from lxml import etree

from tests.browser_support import opened
from tests.cli.support import run
from tests.conftest import REPO
from tests.viewing.browser.reports import document_of

if TYPE_CHECKING:
    from pathlib import Path

    from playwright.sync_api import Browser

    from tests.viewing.browser.conftest import Open
    from tests.viewing.browser.reports import Report

SVG = "{http://www.w3.org/2000/svg}"
_SPY = """() => {
  globalThis.copied = [];
  Object.defineProperty(navigator, "clipboard", {
    configurable: true,
    value: { writeText: async (text) => void globalThis.copied.push(text) },
  });
}"""
_NO_CLIPBOARD = """() => {
  globalThis.copied = [];
  Object.defineProperty(navigator, "clipboard", { configurable: true, value: undefined });
  document.execCommand = () => {
    globalThis.copied.push(document.activeElement.value);
    return true;
  };
}"""
_REFUSED = """() => {
  Object.defineProperty(navigator, "clipboard", { configurable: true, value: undefined });
  document.execCommand = () => false;
}"""


@cache
def door_check() -> dict[str, Any]:
    return document_of((REPO / "docs" / "examples" / "door_check.xml").read_text(encoding="utf-8"))


def saved(report: Report, form: str) -> tuple[str, bytes]:
    with report.page.expect_download() as download:
        report.page.get_by_role("button", name=f"as {form},").click()
    return download.value.suggested_filename, download.value.path().read_bytes()


def copied(report: Report, name: str) -> str:
    report.page.get_by_role("button", name=name).first.click()
    report.page.get_by_text("Copied", exact=True).first.wait_for()
    text: str = report.page.evaluate("globalThis.copied.pop()")
    return text


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_the_svg_is_the_picture_and_loads_nothing(theme: str, report: Open) -> None:
    with report(door_check(), theme=theme) as opened_report:
        name, data = saved(opened_report, "SVG")
        assert name == "plan0.svg"
        root: Any = etree.fromstring(data, etree.XMLParser(resolve_entities=False, no_network=True))
        assert root.tag == f"{SVG}svg"
        texts = {"".join(each.itertext()) for each in root.iter(f"{SVG}text")}
        drawn = [n for n in opened_report.plan["automaton"]["nodes"] if not n.get("hidden")]
        assert {n["label"][0] for n in drawn if n["label"]} <= texts
        assert {each.tag for each in root.iter()} <= {
            f"{SVG}{tag}" for tag in ("svg", "title", "rect", "path", "text")
        }
        for each in root.iter():
            for key, value in each.attrib.items():
                assert not re.search(r"href|style|class|^on", key), key
                assert not re.search(r"url\(|var\(|:|NaN|undefined|Infinity", value), value
        paper = root.find(f"{SVG}rect")
        assert paper is not None
        assert paper.get("fill") == opened_report.page.evaluate(
            "getComputedStyle(document.documentElement).getPropertyValue('--graph-paper').trim()"
        )
        assert root.get("font-family") == "sans-serif"


def test_the_svg_shows_folds_steps_and_selection(report: Open) -> None:
    with report(door_check()) as opened_report:
        _, plain = saved(opened_report, "SVG")
        opened_report.select("GP303")
        _, selected = saved(opened_report, "SVG")
        assert len(selected) > len(plain)
        opened_report.open_play("GP303")
        opened_report.page.get_by_label("To the end").click()
        opened_report.drawn()
        _, played = saved(opened_report, "SVG")
        assert "✗".encode() in played
        assert "✗".encode() not in selected
        opened_report.page.get_by_label("Fold everything", exact=True).click()
        opened_report.drawn()
        _, folded = saved(opened_report, "SVG")
        assert folded.count(b"<text") < plain.count(b"<text")


def test_the_svg_is_drawn_as_the_canvas_is(browser: Browser, report: Open, tmp_path: Path) -> None:
    """As an image, few of its dots differ from those of the PNG; fonts may."""
    compare = """async ([svg, png]) => {
      const dots = async (source) => {
        const image = new Image();
        image.src = source;
        await image.decode();
        const canvas = document.createElement("canvas");
        [canvas.width, canvas.height] = [400, 400];
        const context = canvas.getContext("2d");
        context.drawImage(image, 0, 0, 400, 400);
        return context.getImageData(0, 0, 400, 400).data;
      };
      const [one, other] = [await dots(svg), await dots(png)];
      let far = 0;
      for (let at = 0; at < one.length; at += 4) {
        const by = Math.abs(one[at] - other[at]) + Math.abs(one[at + 1] - other[at + 1]);
        far += by > 120 ? 1 : 0;
      }
      return far / (400 * 400);
    }"""
    with report(door_check()) as opened_report:
        opened_report.open_play("GP303")
        opened_report.press(".", ".")
        urls = []
        for form, media in (("SVG", "image/svg+xml"), ("PNG", "image/png")):
            data = base64.b64encode(saved(opened_report, form)[1]).decode()
            urls.append(f"data:{media};base64,{data}")
    file = tmp_path / "empty.html"
    file.write_text("<!doctype html><link rel=icon href=data:,>")
    with opened(browser, file.as_uri()) as page:
        assert page.evaluate(compare, urls) < 0.02


def test_the_png_has_the_size_of_what_is_seen(report: Open) -> None:
    with report(door_check()) as opened_report:
        page = opened_report.page
        page.get_by_label("Show everything (f)").click()
        opened_report.settled()
        width, height = page.evaluate(
            "(({ width, height }) => [width, height])"
            "(document.querySelector('.graph-touch').gpsfsmGraph.picture)"
        )
        name, data = saved(opened_report, "PNG")
        assert name == "plan0.png"
        assert data.startswith(b"\x89PNG\r\n\x1a\n")
        size = struct.unpack(">II", data[16:24])
        assert size == (round(2 * (width + 48)), round(2 * (height + 48)))
        page.get_by_label("Zoom in (+)").click()
        page.get_by_label("Zoom in (+)").click()
        opened_report.drawn()
        box = page.locator(".graph").evaluate("(one) => [one.clientWidth, one.clientHeight]")
        _, data = saved(opened_report, "PNG")
        size = struct.unpack(">II", data[16:24])
        assert all(abs(dots - 2 * side) <= 1 for dots, side in zip(size, box, strict=True))


def test_hostile_names_stay_text(report: Open) -> None:
    document = document_of('<Plan><Runner interface="a/B" provider="a/B"/></Plan>')
    document["plans"][0]["name"] = '../..\\"><script>\x01.xml'
    document["plans"][0]["automaton"]["nodes"][1]["label"] = ["<script>\ufffe\x01", "]]>&"]
    with report(document) as opened_report:
        name, data = saved(opened_report, "SVG")
        assert re.fullmatch(r"[\w-]+\.svg", name)
        root: Any = etree.fromstring(data)
        assert not list(root.iter(f"{SVG}script"))
        assert "<script>\ufffd\u2039U+0001\u203a" in {each.text for each in root.iter(f"{SVG}text")}


@pytest.mark.parametrize("clipboard", [_SPY, _NO_CLIPBOARD])
def test_texts_are_copied_with_or_without_a_clipboard(clipboard: str, report: Open) -> None:
    with report({**door_check(), "check": "--ignore GP402"}) as opened_report:
        opened_report.page.evaluate(clipboard)
        opened_report.select("GP303")
        finding = next(one for one in opened_report.plan["findings"] if one["rule"] == "GP303")
        text = copied(opened_report, "Copy the finding as text")
        assert text.startswith(
            f"plan0.xml:6:5: {finding['severity']} GP303 join-deadlock: {finding['message']}\n"
        )
        assert f"  hint: {finding['hint']}\n" in text
        assert all(f"  plan0.xml:{one['line']}: " in text for one in finding["related"])
        story = opened_report.plan["plays"][finding["play"]]["story"]
        head, *lines = copied(opened_report, "Copy the scenario as text").splitlines()
        assert head.endswith(f"which ends: {opened_report.plan['plays'][finding['play']]['ends']}")
        assert lines == [f"{at}. {line}" for at, line in enumerate(story, 1)]
        assert copied(opened_report, "Copy a link to this finding") == opened_report.page.url
        assert copied(opened_report, "Copy the text of the plan") == opened_report.plan["source"]
        command = copied(opened_report, "Copy command")
        assert command == "gpsfsm check --ignore GP402 plan0.xml"
        assert not opened_report.page.locator(".copied-text").count()


@pytest.mark.parametrize("named", [True, False])
def test_a_message_is_copied_as_it_is(named: bool, report: Open) -> None:
    document = document_of((REPO / "docs" / "examples" / "door_check.xml").read_text("utf-8"))
    (finding, *_) = document["plans"][0]["findings"]
    finding["message"] = "expected : before the name"
    name = f" {document['rules'][finding['rule']]['name']}" if named else ""
    if not named:
        del document["rules"][finding["rule"]]
    with report(document) as opened_report:
        opened_report.page.evaluate(_SPY)
        opened_report.select(finding["rule"])
        head, *_ = copied(opened_report, "Copy the finding as text").splitlines()
        place = f"plan0.xml:{finding['line']}:{finding['column']}"
        message = finding["message"]
        assert head == f"{place}: {finding['severity']} {finding['rule']}{name}: {message}"


def test_no_command_is_copied_for_a_name_that_a_terminal_would_obey(report: Open) -> None:
    document = document_of("<Plan/>", "<Plan/>", "<Plan/>")
    document["check"] = ""
    for plan, name in zip(document["plans"], ("a.xml", "b\x1b[2J.xml", "c\x9b.xml"), strict=True):
        plan["name"] = name
    with report(document) as opened_report:
        opened_report.page.locator(".plan-link").first.click()
        command = opened_report.page.get_by_role("button", name="Copy command")
        command.wait_for()
        for _ in range(2):
            opened_report.press("]")
            assert not command.count()
        opened_report.press("[", "[")
        command.wait_for()


def test_what_cannot_be_copied_is_shown_selected(report: Open) -> None:
    with report(door_check()) as opened_report:
        opened_report.page.evaluate(_REFUSED)
        opened_report.page.get_by_role("button", name="Copy the text of the plan").click()
        dialog = opened_report.page.get_by_role("dialog", name="Copy")
        dialog.wait_for()
        assert (
            opened_report.page.evaluate("getSelection().toString()") == opened_report.plan["source"]
        )
        opened_report.page.keyboard.press("Escape")
        dialog.wait_for(state="detached")


def test_the_command_finds_the_same(browser: Browser, tmp_path: Path) -> None:
    plan = (REPO / "docs" / "examples" / "door_check.xml").read_bytes()
    (tmp_path / "it's a plan.xml").write_bytes(plan)
    options = ("--ignore", "GP402", "--no-consistent", "--engine", "paper")
    made = run("view", "it's a plan.xml", "-o", "page.html", *options, cwd=tmp_path)
    assert made.returncode in (0, 1)
    with opened(browser, (tmp_path / "page.html").as_uri()) as page:
        page.evaluate(_SPY)
        page.get_by_role("button", name="Copy command").click()
        command: str = page.evaluate("globalThis.copied.pop()")
        shown = page.evaluate("gpsfsmPage.store.plan.findings.map((one) => one.rule)")
    program, *words = shlex.split(command)
    assert program == "gpsfsm"
    assert set(options) <= set(words)
    done = run(*words, "--format", "json", cwd=tmp_path)
    assert sorted(re.findall(rb'"rule": ?"(GP\d+)"', done.stdout)) == sorted(
        rule.encode() for rule in shown
    )
