"""Which hosts may be allowed, and what is said of texts that are none."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gpsfsm.cli import main
from gpsfsm.runners.generic.http import allowed_host, host_name, shown

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("text", "host"),
    [
        ("robot", "robot"),
        ("Robot.Local:8080", "robot.local:8080"),
        ("robot:080", "robot:80"),
        ("10.0.0.7", "10.0.0.7"),
        ("my_robot-1.local", "my_robot-1.local"),
        ("xn--bcher-kva.example", "xn--bcher-kva.example"),
        ("[::1]", "[::1]"),
        ("[0:0::0001]:80", "[::1]:80"),
        ("[2001:DB8::1]", "[2001:db8::1]"),
    ],
)
def test_hosts(text: str, host: str) -> None:
    assert allowed_host(text) == host
    assert allowed_host(host) == host


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "it is empty; write a host, as in robot.local"),
        ("  ", "it is empty"),
        ("*", "there are no patterns"),
        ("*.local", "there are no patterns"),
        ("http://robot.local:8080/x?y", "it is more than a host; write robot.local:8080"),
        ("http://me:secret@robot.local", "it is more than a host; write robot.local"),
        ("robot/x", "it is more than a host; write robot"),
        ("http://*/", "there are no patterns"),
        ("http:///x", "it is more than a host; write a host, as in"),
        ("me@robot", "it is more than a host; write robot"),
        ("robot:0", "there is no port 0"),
        ("robot:65536", "there is no port 65536"),
        ("robot:http", "it is not a host"),
        ("robot:", "it is not a host"),
        (":80", "it is not a host"),
        ("robot.", "it is not a host"),
        ("-robot", "it is not a host"),
        ("a b", "it is not a host"),
        ("robot\\", "it is not a host"),
        ("a" * 64, "it is not a host"),
        ("bücher.example", "names with other letters are written in their ASCII form"),
        ("::1", "write [::1], with brackets"),
        ("[::x]", "[::x] is not an IPv6 address"),
        ("[robot]", "[robot] is not an IPv6 address"),
        ("[fe80::1%eth0]", "an address with a zone cannot be allowed"),
    ],
)
def test_texts_that_are_no_hosts(text: str, why: str) -> None:
    with pytest.raises(ValueError, match=f"^{re.escape(why)}"):
        allowed_host(text)


@given(st.text(max_size=30))
def test_any_text_is_a_host_or_is_refused(text: str) -> None:
    try:
        host = allowed_host(text)
    except ValueError:
        return
    assert allowed_host(host) == host == host.lower()
    assert host.isascii()
    assert not set(host) & set("/\\@?#* ")


def test_names_of_hosts() -> None:
    assert [host_name(name) for name in ("ROBOT", "0::1", "::x")] == ["robot", "[::1]", "[::x]"]


@given(st.text("abc/?#@:.", max_size=12))
def test_no_password_is_ever_shown(password: str) -> None:
    secret = f"SECRET{password}"
    assert "SECRET" not in shown(f"http://me:{secret}@robot/x")
    assert "SECRET" not in shown(f"https://me:x{secret}@robot:80/x@y?z#@")


@pytest.mark.parametrize(
    "url", ["http://robot.local:8080/a/b@c", "http://[::1]:80/x#y", "robot", "", "mailto:me"]
)
def test_what_is_not_secret_is_shown(url: str) -> None:
    assert shown(url) == url


@pytest.mark.parametrize(
    ("option", "value", "message"),
    [
        ("--allow-host", "", "--allow-host '': it is empty; write a host"),
        ("--allow-host", "robot,*", "--allow-host '*': there are no patterns"),
        ("--allow-host", "http://me:secret@r/x", "--allow-host 'http://***@r/x': it is more than"),
        ("--allow-program", "", "--allow-program '': it names no program"),
        ("--allow-function", "os.getcwd", "--allow-function 'os.getcwd': it names no function"),
        ("--allow-function", "os:a.b", "--allow-function 'os:a.b': it names no function"),
        ("--allow-module", "my robot", "--allow-module 'my robot': it names no module"),
    ],
)
def test_options_that_would_allow_nothing_are_refused(
    option: str, value: str, message: str, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    plan = tmp_path / "plan.xml"
    plan.write_text('<Plan><Runner interface="a/B" provider="a/B"/></Plan>')
    assert main(["run", "--real", option, value, str(plan)]) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith(f"gpsfsm: {message}")
    assert "secret" not in output.err
