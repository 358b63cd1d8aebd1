"""Check the fenced blocks of README.md and docs/ that docs/check.py does not run.

Each language has its fate. ``sh`` is run line by line in a scratch folder, beside files that have
the names which the pages use; a ``gpsfsm`` there may end with 0 or 1 (findings). A model is that of
the tests' server, which speaks the protocols of Ollama and OpenAI, on an address of its own. What
serves does so on a free port until it says so, and is stopped; ``curl`` meets such a service. A
journal that a block does not write itself is that of a run which was killed. Lines that need what
no machine of CI has stand in NOT_RUN with the reason; if they call gpsfsm their options are still
parsed. ``git clone`` of this repository takes this clone, and ``pip install`` is held
against pyproject.toml. ``python`` is run there, too, or compiled with its imports and names looked
up (FRAGMENTS). ``xml``, ``yaml``, ``toml`` and ``json`` are read, by the readers of gpsfsm where
the file is one of theirs. What is left is listed in ELSEWHERE and WHOLE.

``python docs/blocks.py [FILE…]`` checks pages; exit code 1 if a block is not as it should be.
"""

from __future__ import annotations

import argparse
import ast
import doctest
import json
import re
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
import textwrap
import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

sys.path.insert(0, str(Path(__file__).parent))

import click
import yaml
from check import ROOT, documents, environment
from lxml import etree

import gpsfsm
from gpsfsm.version import REPOSITORY

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

TIMEOUT_S = 120

ELSEWHERE = {
    "console": "docs/check.py runs it and compares what it prints",
    "mermaid": "docs/engines.py --check compares it",
    "ebnf": "tests/grammars hold the grammar against the parser",
    "service": "tests/service plays it",
    "lua": "configures an editor that is not installed; tests/lsp start the server",
    "elisp": "configures an editor that is not installed; tests/lsp start the server",
    "groovy": "tests/pipelines run its commands",
    "text": "is output, or a drawing",
}
"""Languages of blocks about which nothing is decided here."""

WHOLE = {
    ("docs/install.md", "sh"): "make package-check runs it where nothing is installed",
    ("docs/install.md", "ini"): "tests/installation read the unit",
    ("docs/gate.md", "sh"): "tests/pipelines run it as a hook",
    ("docs/how-to/extend.md", "sh"): "tests/test_plugins.py runs it with the package of the page",
    ("docs/service.md", "nginx"): "tests/service run it",
}
"""Blocks of a language in a page for which other tests answer."""

_HERE = re.escape(REPOSITORY.removeprefix("https://")) + r"(?![\w-])"
NOT_RUN = {
    r"source /opt/ros/|ros2 ": "needs an installed ROS 2",
    r"gpsfsm (?:run|resume) .*--real\b|gpsfsm (dispatch|ros|capabilities pull)\b"
    r"|.*--model prompt-tools": "needs a robot: tests/ros, tests/running",
    r"ollama |llama-server |vllm |python -m sglang": "is the server of a model",
    r"python -m (verl|openrlhf)": "needs a trainer, and hours",
    r".*--jobs ray": "needs a Ray cluster: make test-ray",
    r"make |python -m tests\.": "is what CI itself runs, or takes hours",
    r"python3? -m venv|\. ": "makes an environment: make package-check",
    r"pip install|pipx |uv tool": "installs: make package-check",
    r"npm |npx |code ": "needs node or an editor: tests/lsp read the extension",
    rf"git clone https://(?!{_HERE})|python experiments/evaluate\.py gpsfsm-2026": (
        "needs a repository of others: tests/grading use a sample of it"
    ),
    r"gpsfsm fix PATH": "is a synopsis",
}
"""Commands of sh blocks that are not run, and why; what begins like a pattern is meant."""

FRAGMENTS = {
    ("docs/execution.md", 1): "needs a world, a runner and a model of the reader's",
    ("docs/execution.md", 2): "is about names inside gpsfsm, which are no public ones",
    ("docs/formats.md", 1): "is a module of another package: tests/test_plugins.py",
    ("docs/machines.md", 2): "goes on with a plan of the reader's",
    ("docs/providers.md", 1): "is a module of another package: tests/test_plugins.py",
    ("docs/runners.md", 2): "is a part of a method",
    ("docs/runners.md", 3): "is a test of a package of the reader's: tests/runners",
    ("docs/gate.md", 2): "keeps a process: tests/pipelines run it",
}
"""Python blocks (the number in its page) that are compiled only, and why."""

_PLAN = """\
<Plan name="sample">
  <Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/WaypointRunner" x="1.5" y="0.5"/>
  <Control type="recovery">
    <Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/WaypointRunner" x="1.0" y="0.5"/>
  </Control>
  <!-- what follows is in lines 7 and 9, of which pages speak -->
  <Runner interface="nav2_capabilities/WaypointRunner" provider="nav2_capabilities/WaypointRunner" x="0.5" y="0.5"/>
  <Control type="recovery">
    <Runner interface="perception_capabilities/SpeechRunner" provider="perception_capabilities/SpeechRunner" text="Help."/>
  </Control>
</Plan>
"""  # noqa: E501  (a plan)
_FILES = {
    **dict.fromkeys(("plan.xml", "other.xml", "first.xml", "second.xml"), _PLAN),
    **dict.fromkeys(("plans/patrol.xml", "plans/rounds.xml", "answer.txt"), _PLAN),
    "answers.jsonl": json.dumps({"answer": _PLAN}) + "\n",
    "tree.xml": (
        '<root BTCPP_format="4"><BehaviorTree ID="a"><Sequence><AlwaysSuccess/></Sequence>'
        "</BehaviorTree></root>\n"
    ),
    "task.yaml": "interface: WaypointRunner\nsteps:\n  - do: {x: 1.5, y: 0.5}\n",
    "robot.yaml": "name: lab\nmap: {x: [-10, 10], y: [-5, 5]}\n",
    "world.yaml": "world: lab\n",
    "tokens": "a-token-of-the-documentation\n",
}
_CONFIG = "from gpsfsm.checking.config import load_config as read"
_FOLDERS = ("corpus", "docs", "editors", "examples", "experiments", "grammars")


@dataclass(frozen=True, slots=True)
class Fence:
    """A fenced block: its page, the line of the fence, the language, and what is in it."""

    file: Path
    line: int
    language: str
    text: str
    number: int
    """Its number among the blocks of its language in this page."""

    @property
    def page(self) -> str:
        """The page as tables name it."""
        return self.file.relative_to(ROOT).as_posix() if ROOT in self.file.parents else "page.md"


def fences(file: Path) -> Iterator[Fence]:
    """All fenced blocks of a page."""
    mark, language, first = "", "", 0
    inside: list[str] = []
    counts: dict[str, int] = {}
    for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1):
        stripped = line.strip()
        if not mark and stripped.startswith("```"):
            mark = stripped[: len(stripped) - len(stripped.lstrip("`"))]
            language = (stripped.lstrip("`").split() or [""])[0]
            first, inside = number, []
        elif mark and stripped == mark:
            text = textwrap.dedent("\n".join(inside)) + "\n"
            if not language:
                language = "sh" if re.match(r"(gpsfsm|pip) ", text) else "text"
            counts[language] = counts.get(language, 0) + 1
            yield Fence(file, first, language, text, counts[language])
            mark = ""
        elif mark:
            inside.append(line)


def problems(fence: Fence) -> Iterator[str]:
    """The problems of a block, a text each."""
    if fence.language in ELSEWHERE or (fence.page, fence.language) in WHOLE:
        return
    checker = _CHECKERS.get(fence.language)
    if checker is None:
        yield f"nothing checks blocks of {fence.language!r}"
        return
    try:
        yield from checker(fence)
    except (SyntaxError, ValueError, etree.XMLSyntaxError, yaml.YAMLError, gpsfsm.GpsfsmError) as e:
        yield f"{type(e).__name__}: {e}"


# -- sh ----------------------------------------------------------------------------------------


def commands(text: str) -> list[str]:
    """The commands of an sh block, without comments; a backslash continues a line."""
    joined = re.sub(r"\\\n\s*", "", text)
    lines = (re.sub(r"(^|\s)#.*", "", line).rstrip() for line in joined.splitlines())
    return [line for line in lines if line]


def reason_not_run(command: str) -> str:
    """The pattern of NOT_RUN that a command begins like; "" if it is run."""
    return next((pattern for pattern in NOT_RUN if re.match(pattern, command)), "")


def _sh(fence: Fence) -> Iterator[str]:
    script, runs = [_SHELL], False
    if re.search(r"^curl ", fence.text, re.M):
        real = "--real --token-file tokens --robot robot.yaml" if "$TOKEN" in fence.text else ""
        script.append(f"REAL='{real}'\n{_SERVICE}")
    for command in commands(fence.text):
        if not reason_not_run(command):
            script.append(_step(command))
            runs = True
        elif command.startswith(("pip install", "pipx install", "uv tool install")):
            yield from _not_installable(command)
        elif command.startswith("gpsfsm ") and "PATH" not in command:
            yield from _not_parsed(command)
    if runs:
        yield from _run(["/bin/bash", "-c", "\n".join(script)])


def _step(command: str) -> str:
    """A line of the script for a command."""
    call = re.match(r"((?:\w+=\S+ )*)gpsfsm (\w+)", command)
    if command.startswith("jing ") and shutil.which("jing") is None:
        return ": jing is not installed"
    if call is None:
        return command
    match call[2]:
        case "init":  # it wants a folder without a profile
            return f"(mkdir -p fresh && cd fresh && {command})"
        case "serve":
            return f"{call[1]}served {command.removeprefix(call[1])} --port 0"
        case "generate":  # it has to end with a plan
            return re.sub(r"--base-url \S+", '--base-url "$GPSFSM_BASE_URL"', command)
        case "replay" | "resume":
            return f"test -e run.db || killed; {{ {command}; }} || test $? -eq 1"
    return f"{{ {command}; }} || test $? -eq 1"


_SHELL = """\
set -e
served() {  # a command that serves: until it says so
  "$@" 2> served.txt & local it=$!
  while kill -0 $it 2> /dev/null && ! grep -sq 'serving at' served.txt; do sleep 0.1; done
  kill $it && wait $it || { cat served.txt; return 3; }
}
killed() {  # run.db is the journal of a run that was killed
  gpsfsm run plan.xml --speed 1 --journal run.db & local it=$!
  for _ in {1..100}; do
    sleep 0.2; test -s run.db && gpsfsm events run.db | grep -q STARTED && break
  done
  kill -KILL $it; wait $it || true
}
"""
_MODEL = re.compile(r"--model (?!replay:)[\w-]+:([\w./:-]+)")
_SERVICE = """\
gpsfsm serve --journal curl.db --port 0 $REAL 2> service.txt & service=$!
trap 'kill $service; wait $service' EXIT
place=
while kill -0 $service && test -z "$place"; do
  sleep 0.1; place=$(sed -n 's,.*serving at http://,,p' service.txt)
done
TOKEN=$(cat tokens)
curl() {
  set -- "${@/127.0.0.1:8321/$place}"
  command curl --silent --fail-with-body "${@/localhost:8321/$place}"
}
"""


@cache
def _models() -> str:
    """The address of a server with all models of the pages, which answer with a plan."""
    sys.path.insert(0, str(ROOT))
    from tests.generation.fake_server import FakeServer

    texts = (page.read_text(encoding="utf-8") for page in documents(ROOT))
    names = {name for text in texts for name in _MODEL.findall(text)}
    return FakeServer([_PLAN], models=sorted(names)).__enter__().url


def _run(words: Sequence[str]) -> Iterator[str]:
    """Run a program beside the sample files; yields what it said if it failed."""
    with tempfile.TemporaryDirectory() as name:
        scratch = Path(name)
        for file, text in _FILES.items():
            (scratch / file).parent.mkdir(exist_ok=True)
            (scratch / file).write_text(text, encoding="utf-8")
            (scratch / file).chmod(0o600)
        shutil.copytree(ROOT / "docs/examples/my_robot", scratch / "my_robot")
        shutil.copy(scratch / "robot.yaml", scratch / "my_robot")
        for folder in _FOLDERS:
            (scratch / folder).symlink_to(ROOT / folder)
        make = scratch / ".bin" / "make"  # what CI runs anyway, in a block that is run
        make.parent.mkdir()
        make.write_text("#!/bin/sh\n", encoding="utf-8")
        make.chmod(make.stat().st_mode | stat.S_IXUSR)
        bare = environment(make.parent)
        count = int(bare["GIT_CONFIG_COUNT"])
        git = {"GIT_CONFIG_COUNT": str(count + 2)}
        for number, (key, value) in enumerate(
            ((f"url.{ROOT}.insteadOf", REPOSITORY), ("safe.directory", "*")), start=count
        ):
            git |= {f"GIT_CONFIG_KEY_{number}": key, f"GIT_CONFIG_VALUE_{number}": value}
        done = subprocess.run(  # noqa: S603  (the blocks of our own documentation)
            words,
            cwd=scratch,
            env={
                **bare,
                **git,
                **{"GPSFSM_BASE_URL": _models(), "BROWSER": "true", "HOME": name},
            },
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            timeout=TIMEOUT_S,
            check=False,
        )
    if done.returncode:
        yield f"exit code {done.returncode}\n{done.stdout.decode(errors='replace')[-2000:]}"


def _not_parsed(command: str) -> Iterator[str]:
    """Parse the options of a gpsfsm that is not run."""
    from gpsfsm.cli import main

    words = shlex.split(re.split(r" (?:[|<>]|&&|--ros-args) ", command)[0])[1:]
    place: click.Command = main if isinstance(main, click.Command) else _group()
    context = click.Context(place, info_name="gpsfsm")
    while isinstance(place, click.Group):
        name, command_of_it, words = place.resolve_command(context, words)
        assert command_of_it is not None
        place, context = command_of_it, click.Context(command_of_it, context, info_name=name)
    try:
        place.make_parser(context).parse_args(list(words))
    except click.UsageError as error:
        yield f"{command}: {error.format_message()}"


def _group() -> click.Group:
    import gpsfsm.cli as package

    return next(each for each in vars(package).values() if isinstance(each, click.Group))


def _not_installable(command: str) -> Iterator[str]:
    """Compare what is to be installed with pyproject.toml."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    for word in shlex.split(command)[2:]:
        extra = re.fullmatch(r"(?:gpsfsm|\.)\[([\w,]+)\]", word)
        names = extra[1].split(",") if extra else []
        for name in set(names) - set(project["optional-dependencies"]):
            yield f"{command}: there is no extra {name!r}"


# -- python ------------------------------------------------------------------------------------


def _python(fence: Fence) -> Iterator[str]:
    if fence.page == "docs/api.md":  # signatures; tests/test_api_page.py compares them
        return
    if (fence.page, fence.number) not in FRAGMENTS:
        yield from _run([sys.executable, "-c", fence.text])
        return
    text = fence.text.replace("...\n    ", "if True:\n    ")
    tree = compile(text, fence.page, "exec", ast.PyCF_ONLY_AST | ast.PyCF_ALLOW_TOP_LEVEL_AWAIT)
    for node in ast.walk(tree):
        names: list[str] = []
        if isinstance(node, ast.ImportFrom) and node.module == "gpsfsm":
            names = [each.name for each in node.names]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            names = [node.attr] if node.value.id == "gpsfsm" else []
        yield from (f"gpsfsm has no {each}" for each in names if not hasattr(gpsfsm, each))


def _pycon(fence: Fence) -> Iterator[str]:
    said: list[str] = []
    space: dict[str, Any] = {"gpsfsm": gpsfsm, **{n: getattr(gpsfsm, n) for n in gpsfsm.__all__}}
    name, line = fence.page, fence.line
    test = doctest.DocTestParser().get_doctest(fence.text, space, name, name, line)
    doctest.DocTestRunner(optionflags=doctest.ELLIPSIS).run(test, out=said.append)
    yield from said


# -- data --------------------------------------------------------------------------------------


def _xml(fence: Fence) -> Iterator[str]:
    if fence.page.startswith("docs/rules/"):  # tests/analysis check each, also what is malformed
        return
    text = re.sub(r"^<\?xml[^>]*\?>\s*", "", fence.text)
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False)
    root = etree.fromstring(f"<all>{text}</all>".encode(), parser)
    for plan in root.iter("Plan"):
        report = gpsfsm.check(etree.tostring(plan, encoding="unicode", with_tail=False))
        errors = [each for each in report.findings if each.severity == "error"]
        yield from (f"{e.rule}: {e.message}" for e in errors if e.rule.startswith("GP1"))


def _json(fence: Fence) -> Iterator[str]:
    text = fence.text
    try:
        json.loads(text)
    except ValueError:
        for line in text.splitlines():  # or JSON lines
            json.loads(line)
    yield from ()


def _toml(fence: Fence) -> Iterator[str]:
    values = tomllib.loads(fence.text)
    ours = values.get("tool", {}).get("gpsfsm") or set(values) & {"ignore", "fail-on", "keys"}
    if ours:
        name = "pyproject.toml" if "tool" in values else "gpsfsm.toml"
        if "keys" not in values:
            yield from _read(name, fence.text, _CONFIG)


def _yaml(fence: Fence) -> Iterator[str]:
    values = yaml.safe_load(fence.text)
    if not isinstance(values, dict):
        return
    if "spec_type" in values:
        return  # docs/examples has these files, and console blocks check them
    if "world" in values:
        yield from _read("world.yaml", fence.text, "from gpsfsm import load_world as read")
    elif "name" in values and set(values) & {"ros", "leaves", "map"}:
        source = "from gpsfsm.capabilities.robot import load_profile as read"
        yield from _read("robot.yaml", fence.text, source)


def _read(name: str, text: str, source: str) -> Iterator[str]:
    """Let a reader of gpsfsm read a file."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, name)
        file.write_text(text, encoding="utf-8")
        names: dict[str, Any] = {}
        exec(source, names)  # noqa: S102  (readers are imported where they are needed)
        try:
            names["read"](file)
        except gpsfsm.GpsfsmError as error:
            yield str(error)


_CHECKERS = {
    "sh": _sh,
    "python": _python,
    "pycon": _pycon,
    "xml": _xml,
    "json": _json,
    "toml": _toml,
    "yaml": _yaml,
}


def main() -> int:
    """Check the given pages, or all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("files", nargs="*", type=Path, help="default: README.md and docs/**/*.md")
    count = failed = 0
    for file in parser.parse_args().files or documents(ROOT):
        for fence in fences(file.resolve()):
            count += 1
            for problem in problems(fence):
                failed += 1
                print(f"{file}:{fence.line}: {fence.language}: {problem}", end="\n\n")
    print(f"{count} blocks, {failed} problems")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
