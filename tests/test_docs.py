"""The documentation: commands print what it shows, links lead somewhere, pictures are current."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from urllib.parse import unquote

import pytest

from tests.forked import write_program

REPO = Path(__file__).parents[1]
CHECK = REPO / "docs" / "check.py"
FENCE = "```"
_LINK = re.compile(r"\]\(([^)\s]+)\)")


def check(*arguments: object, timeout_s: float = 600) -> subprocess.CompletedProcess[str]:
    ours = ("PYTHON", "LANG", "LC_")  # of this process alone
    kept = {name: text for name, text in os.environ.items() if not name.startswith(ours)}
    return subprocess.run(
        [sys.executable, str(CHECK), *map(str, arguments)],
        env=kept,
        capture_output=True,
        text=True,
        encoding="utf-8",
        timeout=timeout_s,
        check=False,
    )


def page(folder: Path, *lines: str) -> Path:
    file = folder / "page.md"
    file.write_text("\n".join(("# Page", f"{FENCE}console", *lines, FENCE, "")), encoding="utf-8")
    return file


def documents() -> list[Path]:
    names = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md")
    results = [*(REPO / name for name in names), *sorted((REPO / "docs").rglob("*.md"))]
    return [file for file in results if file.exists()]


def page_name(file: Path) -> str:
    return file.relative_to(REPO).as_posix()


WITH_COMMANDS = [
    file
    for file in (REPO / "README.md", *sorted(REPO.glob("docs/**/*.md")))
    if f"{FENCE}console\n" in file.read_text(encoding="utf-8")
]


@pytest.mark.commands
@pytest.mark.parametrize(
    "document", WITH_COMMANDS, ids=lambda file: file.relative_to(REPO).as_posix()
)
def test_commands_print_what_the_documentation_shows(document: Path, tmp_path: Path) -> None:
    """A test for each page: ``make docs-check`` runs them, on all cores."""
    write_program(tmp_path)
    report = check(document, "--programs", tmp_path)
    assert report.returncode == 0, report.stdout + report.stderr


def test_pages_are_checked_apart_and_none_is_left_out() -> None:
    everything = "\n".join(file.read_text(encoding="utf-8") for file in documents())
    here = "\n".join(file.read_text(encoding="utf-8") for file in WITH_COMMANDS)
    assert len(WITH_COMMANDS) > 10
    assert here.count(f"{FENCE}console\n") == everything.count(f"{FENCE}console\n")
    pattern = re.compile(r"/tmp/[\w.-]+")  # noqa: S108  (what the pages write, not this test)
    written = [set(pattern.findall(file.read_text("utf-8"))) for file in WITH_COMMANDS]
    assert sum(map(len, written)) == len(set().union(*written)), "two pages write the same file"


@pytest.mark.parametrize(
    "lines",
    [
        ("$ echo one", "one"),
        ("$ echo one; echo two", "one", "two"),
        ("$ echo one; echo two; echo three", "one", "…", "three"),
        ("$ echo one", "…", "one", "…"),
        ("$ seq 5", "…", "2", "3", "…", "5"),
        ("$ echo a; echo b; echo a; echo c", "a", "…", "a", "…", "c"),
        ("$ seq 5000", "1", "…", "4999", "5000"),
        ("$ true", "…"),
        ("$ echo 'a …'", "a …"),
        ("$ true", "$ echo one", "one"),
        ("$ false", "$ echo $?", "1"),
        ("$ echo one >&2", "one"),
        ("$ echo one \\", "> two", "one two"),
        ("$ printf 'one   \\n'", "one"),
        ("$ pwd | grep -c /", "1"),
    ],
)
def test_accepts_what_is_printed(tmp_path: Path, lines: tuple[str, ...]) -> None:
    report = check(page(tmp_path, *lines))
    assert report.returncode == 0, report.stdout


@pytest.mark.parametrize(
    ("lines", "difference"),
    [
        (("$ echo one", "two"), "+one"),
        (("$ echo one",), "+one"),
        (("$ true", "one"), "-one"),
        (("$ echo one; echo two; echo three", "one", "…", "four"), "+three"),
        (("$ echo 'a b'", "a …"), "+a b"),
        (("$ seq 3", "1", "…", "3", "…", "3"), "+2"),
        (("$ seq 3", "1", "2", "…", "2", "3"), "-…"),
        (("$ seq 3", "…", "2"), "+3"),
        (("$ no-such-program", "…", "fine"), "-fine"),
    ],
)
def test_refuses_what_is_not_printed(
    tmp_path: Path, lines: tuple[str, ...], difference: str
) -> None:
    report = check(page(tmp_path, *lines))
    assert report.returncode == 1
    assert difference in report.stdout
    assert "page.md:3: $ " in report.stdout


@pytest.mark.parametrize(
    ("lines", "written"),
    [
        (("$ echo one", "two"), ("$ echo one", "one")),
        (("$ echo one",), ("$ echo one", "one")),
        (("$ true", "one", "$ echo 2", "2"), ("$ true", "$ echo 2", "2")),
        (("$ echo 'a \\", "> b'", "c"), ("$ echo 'a \\", "> b'", "a \\", "b")),
        (("$ seq 5", "1", "…", "5"), ("$ seq 5", "1", "…", "5")),
        (
            ("$ echo a.xml: new; seq 3; echo 1 plan", "a.xml: old", "…", "1 plan"),
            ("$ echo a.xml: new; seq 3; echo 1 plan", "a.xml: new", "…", "1 plan"),
        ),
        (
            ("$ echo head line; echo; seq 7; echo; echo the end", "head lines", "…", "", "the end"),
            ("$ echo head line; echo; seq 7; echo; echo the end", "head line", "…", "", "the end"),
        ),
        (
            ("$ seq 20 29", "20", "gone", "…", "24", "25", "gone", "…", "29"),
            ("$ seq 20 29", "20", "…", "24", "25", "…", "29"),
        ),
        (("$ echo begin; seq 9", "begins", "…"), ("$ echo begin; seq 9", "begin", "…")),
        (("$ seq 9; echo the end", "…", "the ends"), ("$ seq 9; echo the end", "…", "the end")),
    ],
)
def test_what_is_printed_now_is_written(
    tmp_path: Path, lines: tuple[str, ...], written: tuple[str, ...]
) -> None:
    before = "Text before.\n"
    file = page(tmp_path, *lines)
    file.write_text(before + file.read_text("utf-8") + "Text behind.\n", encoding="utf-8")
    report = check("--write", file)
    assert report.returncode == 0, report.stdout
    text = file.read_text("utf-8")
    assert text == before + page(tmp_path, *written).read_text("utf-8") + "Text behind.\n"
    file.write_text(text, encoding="utf-8")
    assert check(file).returncode == 0


@pytest.mark.parametrize(
    ("lines", "written", "remark"),
    [
        (("$ seq 3", "a", "…", "b"), ("$ seq 3", "1", "2", "3"), "'…' had no place any more"),
        (("$ seq 3", "1", "…", "gone"), ("$ seq 3", "1", "2", "3"), "'…' had no place any more"),
        (("$ echo '$ one'", "a"), ("$ echo '$ one'", "a"), "cannot stand in a block"),
        (("$ echo '> one'", "a"), ("$ echo '> one'", "a"), "cannot stand in a block"),
        (("$ echo '```'", "a"), ("$ echo '```'", "a"), "cannot stand in a block"),
    ],
)
def test_what_somebody_has_to_look_at_is_listed(
    tmp_path: Path, lines: tuple[str, ...], written: tuple[str, ...], remark: str
) -> None:
    file = page(tmp_path, *lines)
    report = check("--write", file)
    assert report.returncode == 1
    assert f"page.md:3: {lines[0]}" in report.stdout
    assert remark in report.stdout
    assert file.read_text("utf-8") == page(tmp_path, *written).read_text("utf-8")


def test_what_is_as_shown_is_not_written(tmp_path: Path) -> None:
    file = page(tmp_path, "$ echo one", "…")
    stamp = file.stat().st_mtime_ns
    assert "1 commands, 0 written, 0 to be looked at" in check("--write", file).stdout
    assert file.stat().st_mtime_ns == stamp


def test_the_programs_of_this_installation_come_first(tmp_path: Path) -> None:
    report = check(
        page(tmp_path, "$ command -v python", str(Path(sys.executable).parent / "python"))
    )
    assert report.returncode == 0, report.stdout


def test_nothing_is_configured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a new machine: who commits has to say who that is."""
    for role in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{role}_NAME", "A developer")
        monkeypatch.setenv(f"GIT_{role}_EMAIL", "developer@example.org")
    command = "$ git init -q . && git commit --allow-empty -qm x"
    done = check(page(tmp_path, command, "Author identity unknown", "…"), "--root", tmp_path)
    assert done.returncode == 0, done.stdout


def test_only_console_blocks_are_run(tmp_path: Path) -> None:
    file = tmp_path / "page.md"
    file.write_text(f"{FENCE}sh\n$ exit 3\n{FENCE}\n$ exit 4\n", encoding="utf-8")
    report = check(file)
    assert report.returncode == 2
    assert "0 commands" in report.stdout


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        (f"{FENCE}console\nhello\n{FENCE}\n", "page.md:2: output before the first command"),
        (f"{FENCE}console\n$ true\n", "never closed"),
    ],
)
def test_refuses_blocks_that_make_no_sense(tmp_path: Path, text: str, complaint: str) -> None:
    file = tmp_path / "page.md"
    file.write_text(text, encoding="utf-8")
    report = check(file)
    assert report.returncode == 1
    assert complaint in report.stdout


def test_a_missing_file_is_a_failure(tmp_path: Path) -> None:
    assert check(tmp_path / "missing.md").returncode == 1


def test_links_lead_to_files_and_headings() -> None:
    broken = []
    for file in documents():
        for link in _LINK.findall(_without_code(file.read_text(encoding="utf-8"))):
            if re.match(r"[a-z]+:", link):
                continue
            path, _, heading = unquote(link).partition("#")
            target = (file.parent / path).resolve() if path else file
            if not target.exists() or (heading and heading not in _headings(target)):
                broken.append(f"{file.relative_to(REPO)}: {link}")
    assert not broken


def test_pages_have_no_characters_that_nobody_sees() -> None:
    hidden = re.compile(r"[\x00-\x08\x0b-\x1f\x7f\ufeff\u200b\u2060\u202a-\u202e\u2066-\u2069]")
    texts = {page_name(file): file.read_bytes().decode() for file in documents()}
    assert [name for name, text in texts.items() if hidden.search(text)] == []


@pytest.mark.parametrize("script", ["pictures.py", "engines.py"])
def test_pictures_are_what_the_compiler_makes(script: str) -> None:
    """And the plans of docs/engines.md end as is written there by hand."""
    completed = subprocess.run(
        [sys.executable, str(REPO / "docs" / script), "--check"],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert completed.returncode == 0, completed.stdout + completed.stderr


def _without_code(text: str) -> str:
    return re.sub(r"`[^`\n]*`", "", _without_blocks(text))


def _without_blocks(text: str) -> str:
    return re.sub(rf"^{FENCE}.*?^{FENCE}", "", text, flags=re.DOTALL | re.MULTILINE)


def _headings(file: Path) -> set[str]:
    """The anchors of a page, as GitHub makes them from its headings."""
    lines = re.sub(
        rf"^{FENCE}.*?^{FENCE}",
        "",
        file.read_text(encoding="utf-8"),
        flags=re.DOTALL | re.MULTILINE,
    ).splitlines()
    titles = (line.lstrip("#").strip() for line in lines if re.match(r"#{1,6} ", line))
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}
