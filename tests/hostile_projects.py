"""Projects that somebody has written who means harm: files, servers, plans with comments.

A project file may name servers, variables with keys, rules to ignore, a baseline, capabilities
under which everything is fine, and files to write; a comment in a plan may excuse everything.
"""

from __future__ import annotations

import json
import os
import tempfile
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hypothesis import strategies as st

from tests.cli.support import runner
from tests.hostile_servers import KEYS, Done, done, servers

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

__all__ = ["OF_OTHERS", "PLACES", "Case", "World", "cases", "filled", "played", "truth"]

_PROVIDERS = ("openai", "ollama", "vllm", "openai-compatible")
_CANARY = "nobody may write this"


@dataclass(frozen=True)
class Case:
    """What the author of a project has written, and what the user has set."""

    plan: str = "rejected"
    comment: str = ""
    settings: Mapping[str, Any] = field(default_factory=dict)
    model: Mapping[str, str] = field(default_factory=dict)
    place: str = "here"
    name: str = "gpsfsm.toml"
    user_model: Mapping[str, str] = field(default_factory=dict)
    permits: Mapping[str, str] = field(default_factory=dict)
    flags: Mapping[str, str] = field(default_factory=dict)
    variables: tuple[str, ...] = ()
    named: bool = False


_GO = runner()
_PLANS = {
    "rejected": f'<Plan>{{}}<Control type="recovery">{_GO}</Control>{_GO}</Plan>',
    "resources": f'<Plan>{{}}<Control type="parallel_all">{_GO}{runner(x="9")}</Control></Plan>',
    "warned": f"<Plan>{{}}{_GO}</Plan>",
    "attribute": f"<Plan>{{}}{runner(x='viel')}</Plan>",
}
_COMMENTS = (
    *("", "", "", "ignore ALL", "ignore ALL because I say so", "ignore GP because it is fine"),
    *("ignore GP3, GP4, GP2 because it is fine", "ignore GP307", "ignore [GP307, GP401, GP205]"),
    "ignore GP307, GP401, GP205, GP302, GP404 because the operator takes over",
    "ignore recovery-without-predecessor because the planner knows",
    "ignore GP307 because -->\n<!-- gpsfsm: ignore ALL",
)
_CAPABILITIES = """
capabilities:
  - interface: nav2_capabilities/WaypointRunner
"""
_SETTINGS: Mapping[str, tuple[Any, ...]] = {
    "ignore": (["ALL"], ["GP3", "GP4"], ["GP307", "GP205", "GP401"]),
    "select": (["GP9"], ["GP104"]),
    "fail-on": ("never", "error"),
    "allow-suppressions": (True, False),
    "baseline": ("known.json",),
    "assume": (["WaypointRunner never fails"], ["WaypointRunner always fails"]),
    "consistent": (True,),
    "builtin-capabilities": (False,),
    "capabilities": (["caps"],),
    "engine": ("fabric-v1", "fabric-v2"),
    "from-response": (True,),
    "quiet": (True,),
    "verbose": (True,),
    "format": ("json", "sarif", "github", "junit", "gitlab", "markdown", "llm"),
    "max-elements": (1, 1000),
    "max-scenarios": (0,),
    "solver": ("structural",),
    "output-file": ("{outside}/canary", "gpsfsm.toml", "/dev/null"),
}
PLACES = (
    "here",
    "here",
    "above",
    "above",
    "root",
    "outside",
    "shared",
    "sticky",
    "other",
    "open",
    "link",
)
_URLS = (
    *("http://{evil}", "http://{evil}/v1", "HTTP://{evil}", "http://{evil}."),
    *("http://localhost:{port}", "http://LOCALHOST.:{port}/v1", "http://127.1:{port}"),
    *("http://user@{evil}", "http://api.openai.com@{evil}/v1", "http://{mine}@{evil}/v1"),
    *("http://{mine}", "http://{evil}/v1#{mine}", "http://{evil}/v1?{mine}", "{evil}"),
    *("http://0.0.0.0:{port}", "http://2130706433:{port}", "http://[::ffff:127.0.0.1]:{port}"),
    "http://\u0430pi.openai.com:{port}",
)


def _tables(*, urls: st.SearchStrategy[str]) -> st.SearchStrategy[dict[str, str]]:
    named = st.sampled_from(["GPU_API_KEY", "GPU_API_KEY", *sorted(KEYS)])
    return st.fixed_dictionaries(
        {"name": st.sampled_from([f"{each}:m" for each in _PROVIDERS])},
        optional={"base-url": urls, "api-key-env": named},
    )


def _user_tables() -> st.SearchStrategy[dict[str, str]]:
    """What a user says, in part: the rest is left to the project."""
    whole = _tables(urls=st.just("http://{mine}"))
    kept = st.sets(st.sampled_from(["name", "base-url", "api-key-env"]))
    return st.builds(lambda table, names: {k: table[k] for k in table if k in names}, whole, kept)


def cases() -> st.SearchStrategy[Case]:
    """Most projects do a few things, some a lot."""
    settings = st.fixed_dictionaries(
        {}, optional={name: st.sampled_from(values) for name, values in _SETTINGS.items()}
    )
    few = st.sampled_from(sorted(_SETTINGS)).flatmap(
        lambda name: st.sampled_from(_SETTINGS[name]).map(lambda value: {name: value})
    )
    nothing: dict[str, str] = {}
    own = st.one_of(st.just(nothing), _user_tables())
    hosts = st.sampled_from(["{mine}", "{evil}", "localhost:{port}", "api.openai.com"])
    return st.builds(
        Case,
        plan=st.sampled_from(sorted(_PLANS)),
        comment=st.sampled_from(_COMMENTS),
        settings=st.one_of(st.just({}), few, few, settings),
        model=_tables(urls=st.one_of(st.sampled_from(_URLS[:5]), st.sampled_from(_URLS))),
        place=st.sampled_from(PLACES),
        name=st.sampled_from(["gpsfsm.toml", "pyproject.toml"]),
        user_model=own,
        permits=st.dictionaries(st.sampled_from(sorted(KEYS)), hosts, max_size=2),
        flags=own.map(lambda table: {k: v for k, v in table.items() if k != "api-key-env"}),
        variables=st.lists(st.sampled_from(sorted(KEYS)), unique=True, min_size=1).map(tuple),
        named=st.booleans(),
    )


def filled(value: Any, outside: Path) -> Any:
    """A setting with the addresses of the servers in it."""
    if isinstance(value, list):
        return [filled(each, outside) for each in value]
    if not isinstance(value, str):
        return value
    mine, evil = servers()
    port = evil.host.partition(":")[2]
    return value.format(mine=mine.host, evil=evil.host, port=port, outside=outside)


def _toml(table: Mapping[str, Any], outside: Path) -> str:
    return "".join(
        f"{key} = {json.dumps(filled(value, outside))}\n" for key, value in table.items()
    )


@dataclass(frozen=True)
class World:
    """A home with a repository in it, and a folder outside."""

    root: Path
    work: Path
    outside: Path
    home: Path
    config: Path | None
    case: Case

    def run(self, *words: str) -> Done:
        """The command as the user gives it, in the folder of the plan."""
        around = {
            "HOME": str(self.home),
            "XDG_CONFIG_HOME": str(self.home / ".config"),
            "HTTPS_PROXY": "http://127.0.0.1:9",  # nothing leaves this computer
            **{name: KEYS[name] for name in self.case.variables},
        }
        return done(words, self.work, around)


@dataclass(frozen=True)
class Truth:
    """What the plan deserves: without a file, and without the comment (``plain``)."""

    report: str
    code: int
    plain_code: int
    gate: tuple[int, str]
    plain_gate: int


@cache
def truth(plan: str, comment: str) -> Truth:
    """The same for many cases."""
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home)
        _write_plan(folder / "plan.xml", plan, comment)
        _write_plan(folder / "plain.xml", plan, "")
        around = {"HOME": home, "XDG_CONFIG_HOME": home}

        def ran(*words: str) -> Done:
            return done(words, folder, around)

        report = ran("check", "plan.xml", "--format", "json", "--isolated")
        gate = ran("gate", "plan.xml")
        return Truth(
            report=report.out,
            code=report.code,
            plain_code=ran("check", "plain.xml", "--isolated").code,
            gate=(gate.code, gate.out),
            plain_gate=ran("gate", "plain.xml").code,
        )


def _write_plan(file: Path, plan: str, comment: str) -> None:
    written = f"<!-- gpsfsm: {comment} -->" if comment else ""
    file.write_text(_PLANS[plan].format(written), encoding="utf-8")


def _world(case: Case, root: Path) -> World:
    home, outside = root / "home", root / "outside"
    work = home / "repository" / "project" / "deep"
    for folder in (work, outside, home / ".config" / "gpsfsm"):
        folder.mkdir(parents=True)
    (home / "repository" / ".git").mkdir()
    (outside / "canary").write_text(_CANARY, encoding="utf-8")
    _write_plan(work / "plan.xml", case.plan, case.comment)
    permits = "".join(
        f'[keys.{name}]\nhosts = ["{filled(host, outside)}"]\n'
        for name, host in case.permits.items()
    )
    own = f"[model]\n{_toml(case.user_model, outside)}{permits}"
    (home / ".config/gpsfsm/config.toml").write_text(own, encoding="utf-8")
    world = World(root, work, outside, home, None, case)
    return replace(world, config=_hostile(world))


def _hostile(world: World) -> Path | None:
    """The file of the project, where it lies."""
    case = world.case
    folder = {
        "above": world.work.parent,
        "root": world.work.parents[1],
        "outside": world.work.parents[2],  # the home folder, above the repository
    }.get(case.place, world.work)
    if case.place == "outside":  # the search ends at the root of the repository
        folder = world.home.parent
    file = folder / case.name
    prefix = "tool.gpsfsm" if case.name == "pyproject.toml" else ""
    head = f"[{prefix}]\n" if prefix else ""
    table = f"{prefix}.model" if prefix else "model"
    settings = _toml(case.settings, world.outside)
    text = f"{head}{settings}[{table}]\n{_toml(case.model, world.outside)}"
    (folder / "caps").mkdir()
    (folder / "caps" / "runners.yaml").write_text(_CAPABILITIES, encoding="utf-8")
    (folder / "known.json").write_text(truth(case.plan, case.comment).report, "utf-8")
    if case.place == "link":
        shared = world.root / "shared"
        shared.mkdir()
        (shared / "settings").write_text(text, encoding="utf-8")
        shared.chmod(0o777)
        file.symlink_to(shared / "settings")
        return file
    file.write_text(text, encoding="utf-8")
    if case.place in ("shared", "sticky"):
        folder.chmod(0o777 if case.place == "shared" else 0o1777)
    elif case.place == "open":
        file.chmod(0o666)
    elif case.place == "other":
        if os.geteuid() != 0:
            file.chmod(0o666)  # nobody else can give files away
        else:
            os.chown(file, 12345, 12345)
    return file


OF_OTHERS = ("shared", "sticky", "other", "open", "link")


@contextmanager
def played(case: Case) -> Iterator[World]:
    """A world in which nothing is written, whatever is done there."""
    with tempfile.TemporaryDirectory() as root:
        world = _world(case, Path(root).resolve())
        before = _files(world)
        try:
            yield world
            assert _files(world) == before, "a file was written, changed or taken away"
        finally:
            for folder in (world.work, world.root):
                folder.chmod(0o755)


def _files(world: World) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in world.root.rglob("*") if path.is_file()}
