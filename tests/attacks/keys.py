"""Project files that would have a key sent to a server of their author.

The user asks a model in a project of ``tests.hostile_projects``, and no key
reaches a server that the user has not permitted it; who may have which is said anew here.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hypothesis import strategies as st

from tests.campaigns.base import Pair
from tests.hostile_projects import PLACES, Case, World, cases, filled, played
from tests.hostile_servers import KEYS, Server, servers

if TYPE_CHECKING:
    from collections.abc import Iterator

_OWN = {"openai": "OPENAI_API_KEY", "ollama": "OLLAMA_API_KEY"}


def _key_cases() -> st.SearchStrategy[Case]:
    """Files that are read, with servers and keys in them and nothing else."""
    places = st.sampled_from(["here", "here", "here", *PLACES])
    return st.builds(replace, cases(), settings=st.just({}), place=places)


def judge(case: Case) -> Iterator[str]:
    """No key goes where it may not."""
    with played(case) as world:
        yield from _keys(world)


def _keys(world: World) -> Iterator[str]:
    """Ask a model; nobody learns a key who may not know it."""
    case = world.case
    for each in servers():
        each.shown.clear()
    words = ["--no-journal", "--attempts", "1", "--retries", "0", "--timeout", "5"]
    for name, value in case.flags.items():
        option = "--model" if name == "name" else f"--{name}"
        words += [option, str(filled(value, world.outside))]
    if case.named:
        words += ["--config", str(world.config)]
    ended = world.run("generate", "wait", "--no-constrain", *words)
    said = ended.out + ended.errors
    label = "nothing was sent"
    if "this configuration is not read" in said:
        label = "the file of others is refused"
    elif "the base URL" in said or "no default address" in said:
        label = "no such address"
    elif " no one answers at " in said:
        label = "nobody answers"
    for server in servers():
        for shown in server.shown:
            label = "sent without a key"
            for variable, key in KEYS.items():
                assert key not in said, "a key was told"
                if key in shown:
                    assert _permitted(variable, server, world), f"{variable} to {server.host}"
                    label = "sent with a permitted key"
    if " is not sent to " in said:
        assert ended.code == 2
        assert not any(each.shown for each in servers())
        assert "hosts = [" in said
        label = "refused, and told how to permit it"
    yield f"generate: {label}"


def _permitted(variable: str, server: Server, world: World) -> bool:
    """Whether the user lets the key go there, said anew and from the case alone."""
    case = world.case
    mine, evil = servers()
    listed = filled(case.permits.get(variable, ""), world.outside)
    if listed == server.host or (listed.startswith("localhost:") and server is evil):
        return True
    named = "base-url" in case.flags or "base-url" in case.user_model
    if server is not mine or not named:
        return False
    if variable == "GPSFSM_API_KEY" or variable == case.user_model.get("api-key-env"):
        return True
    read = case.named or case.place != "outside"  # where a search does not come to
    by_project = read and "name" in case.model
    chosen = case.flags.get("name") or ("" if by_project else case.user_model.get("name", ""))
    return _OWN.get(chosen.partition(":")[0]) == variable


PAIR = Pair(
    name="keys",
    about="hostile project files: a key goes only where the user lets it go",
    cases=_key_cases,
    judge=judge,
    text=str,
    full=6_000,
    batch=25,
    few=6,
    attack=True,
)
