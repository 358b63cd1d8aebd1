"""The stream for Groot2, held against the publisher of BehaviorTree.CPP and read by btview."""

from __future__ import annotations

import random
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET  # our own texts, so no defence is needed

import pytest

from gpsfsm.cli import main
from gpsfsm.errors import UsageError
from gpsfsm.execution.records import Kind, Record
from gpsfsm.watch import groot_tree
from gpsfsm.watch.groot_stream import GrootStream, Shown, address_of, reply
from gpsfsm.watch.groot_tree import FAILURE, IDLE, RUNNING, SUCCESS, WAS
from tests.cli.support import TIMEOUT_S, environment, start
from tests.oracle.btcpp import engine
from tests.watch.groot_client import (
    LEAVES,
    NESTED,
    SEQUENCE,
    asking,
    free_port,
    header,
    parsed,
    tree_of,
    whole,
    zmq,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

# --- the wire ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def real() -> Iterator[Callable[..., list[bytes]]]:
    """The publisher of BehaviorTree.CPP, with the tree ``NESTED`` that never ran."""
    module = engine()
    factory = module.BehaviorTreeFactory()
    for name in LEAVES:
        factory.register_simple_condition(name, lambda _: module.NodeStatus.SUCCESS)
    tree, port = factory.create_tree_from_text(NESTED), free_port()
    publisher = module.Groot2Publisher(tree, port)
    with asking(port) as ask:
        yield ask
    del publisher


REQUESTS: dict[str, tuple[bytes, ...]] = {
    "statuses": (header("S"),),
    "another number": (header("S", number=0xFFFF_FFFE),),
    "another protocol": (header("S", protocol=1),),
    "more parts": (header("S"), b"x", b"y"),
    "no header": (b"",),
    "short header": (header("S")[:5],),
    "long header": (header("S") + b"z",),
    "unknown": (header("?"),),
    "letter 0": (header("\0"),),
    "letter 255": (header("\xff"),),
    "hooks": (header("D"),),
    "no hooks": (header("A"),),
    "disabled hooks": (header("X"),),
    "transitions": (header("t"),),
    "stop recording": (header("r"), b"stop"),
    "recording without a part": (header("r"),),
    "blackboard without a part": (header("B"),),
    "blackboard that is not there": (header("B"), b"none"),
    "insertion without a part": (header("I"),),
    "removal without a part": (header("R"),),
    "unlocking without a part": (header("U"),),
    "unlocking with two": (header("U"), b"{}", b"{}"),
}


@pytest.mark.parametrize("name", REQUESTS)
def test_replies_are_those_of_the_real_publisher(
    name: str, real: Callable[..., list[bytes]]
) -> None:
    parts = REQUESTS[name]
    ours, theirs = reply(Shown(tree_of(NESTED)), parts), real(*parts)
    assert [len(part) for part in ours] == [len(part) for part in theirs]
    if theirs[0] != b"error":  # the tree's identity is one's own
        assert ours[0][:6] == theirs[0][:6]
        assert ours[0][12] >> 4 == theirs[0][12] >> 4 == 4  # both are UUIDs, version 4
        ours, theirs = ours[1:], theirs[1:]
    assert ours == theirs


def test_the_tree_is_written_as_the_real_publisher_does(real: Callable[..., list[bytes]]) -> None:
    _, theirs = real(header("T"))
    ours = reply(Shown(tree_of(NESTED)), [header("T")])[1]
    trees = [parsed(text).findall("BehaviorTree") for text in (ours, theirs)]
    written = [
        [re.sub(rb">\s+<", b"><", ET.tostring(each)).strip() for each in row] for row in trees
    ]
    assert written[0] == written[1]
    assert len(written[0]) == 4
    models = parsed(ours).find("TreeNodesModel")
    real_models = parsed(theirs).find("TreeNodesModel")
    assert models is not None
    assert real_models is not None
    kinds = {each.get("ID"): each.tag for each in real_models}
    tags = {each.get("ID"): each.tag for each in models if each.get("ID") not in LEAVES}
    assert tags == {name: kinds[name] for name in ("AlwaysSuccess", "Fallback", "Sequence")}
    assert {each.tag for each in models if str(each.get("ID"))[0] == "C"} == set()  # none is used


@pytest.mark.parametrize("kind", ["I", "R", "U", "r"])
def test_nothing_changes_the_run(kind: str) -> None:
    hook = b'{"enabled":true,"uid":1,"mode":1,"once":false,"desired_status":"FAILURE","position":0}'
    for part in (hook, b"", b"\xff\0", b"start"):
        answer = reply(Shown(tree_of(SEQUENCE)), [header(kind), part])
        if kind == "r" and part != b"start":
            assert len(answer) == 1  # nothing was recorded
        else:
            assert answer[0] == b"error"
            assert answer[1].startswith(b"read only")


def test_every_request_has_an_answer() -> None:
    shown, chance = Shown(tree_of(SEQUENCE)), random.Random(5)  # noqa: S311
    for _ in range(2_000):
        parts = [
            chance.randbytes(chance.choice((0, 5, 6, 6, 6, 7))) for _ in range(chance.randint(0, 3))
        ]
        answer = reply(shown, parts)
        if answer[0] == b"error":
            assert len(answer) == 2
        else:
            assert answer[0][:1] == b"\x02"
            assert answer[0][1:6] == parts[0][1:6]
            assert answer[0][6:] == shown.identity


def test_a_message_that_is_too_large_harms_nobody() -> None:
    port = free_port()
    stream = GrootStream("127.0.0.1", port)
    stream.show(tree_of(SEQUENCE))
    with stream, asking(port) as ask, asking(port) as other:
        assert len(ask(header("S"))) == 2
        for parts in ([b"x" * 100_000], [header("S"), b"y" * 1_000_000]):
            with zmq.Context() as context, context.socket(zmq.REQ) as large:
                large.setsockopt(zmq.LINGER, 0)
                large.connect(f"tcp://127.0.0.1:{port}")
                large.send_multipart(parts)
                assert not large.poll(300)  # the connection is cut
        assert other(header("S")) == ask(header("S"))
        assert other(header("S"), *[b"part"] * 2_000) == ask(header("S"))


def test_requests_wait_for_the_first_run_and_the_next_run_has_another_tree() -> None:
    port = free_port()
    stream = GrootStream("127.0.0.1", port)
    with stream, asking(port) as ask:
        answers: list[list[bytes]] = []
        early = threading.Thread(target=lambda: answers.append(ask(header("T"))))
        early.start()
        stream.show(tree_of(SEQUENCE))
        early.join(TIMEOUT_S)
        assert answers[0][1].count(b"_uid") == 4
        stream.show(tree_of(NESTED))
        again = ask(header("T"))
        assert again[1].count(b"_uid") == 12
        assert again[0][6:] != answers[0][0][6:]
        assert ask(header("S"))[0][6:] == again[0][6:]


def test_a_client_that_follows_sees_the_end() -> None:
    port = free_port()
    stream = GrootStream("127.0.0.1", port)
    shown = stream.show(tree_of(SEQUENCE))
    stream.__enter__()
    with asking(port) as ask:
        shown.add([Record(Kind.BEGIN)])
        assert ask(header("S"))[1][2::3] == bytes((RUNNING, RUNNING, IDLE, IDLE))
        shown.add([Record(Kind.FAILED, 1), Record(Kind.ENDED)])
        leaving = threading.Thread(target=stream.__exit__, args=(None, None, None))
        leaving.start()
        assert ask(header("S"))[1][2::3] == bytes((WAS + RUNNING, WAS + FAILURE, IDLE, IDLE))
        leaving.join(TIMEOUT_S)
        assert not leaving.is_alive()


# --- the command ---------------------------------------------------------------------------------


@pytest.fixture
def tree_file(tmp_path: Path) -> str:
    path = tmp_path / "tree.xml"
    path.write_text(NESTED, encoding="utf-8")
    return str(path)


ALWAYS = whole('<Sequence><A0/><SubTree ID="Sub"/></Sequence>').replace("<AlwaysSuccess/>", "<A1/>")


@pytest.mark.parametrize("fails", [False, True])
def test_btview_follows_a_real_run(tmp_path: Path, fails: bool) -> None:
    client_of = pytest.importorskip("btview.client", reason="btview is not installed").Groot2Client
    port = free_port()
    tree_file = tmp_path / "tree.xml"
    tree_file.write_text(ALWAYS, encoding="utf-8")
    drawn = ("--failure", str(int(fails)), "--speed", "0.4" if fails else "4")  # takes 4 to 5 s
    with start("run", tree_file, "--groot", str(port), *drawn) as run:
        client = client_of("127.0.0.1", port, timeout_ms=TIMEOUT_S * 1000)
        names = {node.uid: node.registration for node in client.fetch_tree().walk()}
        seen: list[dict[int, int]] = []
        while not seen or seen[-1][1] < WAS:
            statuses = {uid: state.raw for uid, state in client.poll().statuses.items()}
            if not seen or statuses != seen[-1]:
                seen.append(statuses)
            time.sleep(0.02)
        client.close()
        _, err = run.communicate(timeout=TIMEOUT_S)
    assert (run.returncode, err) == (int(fails), b"")
    rows = ["Sequence", "A0", "SubTree", "Sequence", "A8", "SubTree", "Fallback", "A9", "A1"]
    assert names == dict(enumerate(rows, start=1))
    expected = [{1: RUNNING, 2: RUNNING}]
    if fails:
        expected += [{1: WAS + FAILURE, 2: WAS + FAILURE}]
    else:
        expected += [
            {1: RUNNING, 2: SUCCESS, 3: RUNNING, 4: RUNNING, 5: RUNNING},
            {1: RUNNING, 2: SUCCESS, 3: RUNNING, 4: RUNNING, 5: SUCCESS}
            | dict.fromkeys((6, 7, 8), RUNNING),
            dict.fromkeys(range(1, 9), WAS + SUCCESS),
        ]
    rows = [dict.fromkeys(names, IDLE) | each for each in expected]
    assert seen == [each for each in rows if each in seen]  # a client that is slow misses some
    assert seen[-1] == rows[-1]


def test_btview_is_one_of_several(tree_file: str) -> None:
    """A client that goes, and one that comes while the run goes on."""
    port = free_port()
    with start(
        "run", tree_file, tree_file, "--groot", f"localhost:{port}", "--speed", "0.05"
    ) as run:
        for _ in range(3):
            with asking(port) as ask:
                assert len(ask(header("S"))) == 2
        run.send_signal(signal.SIGINT)
        run.communicate(timeout=TIMEOUT_S)
    assert run.returncode == 130


def test_a_run_leaves_no_thread_and_no_port(
    tree_file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    port, before = free_port(), threading.active_count()
    for _ in range(2):
        assert (
            main(["run", tree_file, "--groot", str(port), "--speed", "1e6", "--failure", "0"]) == 0
        )
        assert "COMPLETED" in capsys.readouterr().out
        assert threading.active_count() == before


@pytest.mark.parametrize("further", [0, 1])
def test_a_port_that_is_taken(
    tree_file: str, further: int, capsys: pytest.CaptureFixture[str]
) -> None:
    port, before = free_port(), threading.active_count()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", port + further))
        taken.listen()
        assert main(["run", tree_file, "--groot", str(port)]) == 2
    out, err = capsys.readouterr()
    assert (out, err) == (
        "",
        f"gpsfsm: --groot cannot use 127.0.0.1:{port + further}: address already in use; "
        "name another port, or an address of this machine\n",
    )
    assert threading.active_count() == before


@pytest.mark.parametrize(
    "text", ["0", "65535", "99999", "abc", "", "a b:80", "::1:80", "1667:", ":80"]
)
def test_an_address_that_is_none(
    text: str, tree_file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", tree_file, "--groot", text]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("gpsfsm: --groot takes a port, such as 1667, or host:port, not '")


def test_addresses() -> None:
    assert address_of("1667") == ("127.0.0.1", 1667)
    assert address_of("localhost:80") == ("127.0.0.1", 80)
    assert address_of("[::1]:1667") == ("[::1]", 1667)
    with pytest.raises(UsageError, match=re.escape("cannot use nowhere.invalid:1667: ")):
        GrootStream("nowhere.invalid", 1667).__enter__()


def test_what_is_no_tree(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = tmp_path / "plan.xml"
    plan.write_text('<Plan><Runner interface="a" provider="a"/></Plan>', encoding="utf-8")
    assert main(["run", str(plan), "--groot", "1667"]) == 2
    message = f"gpsfsm: --groot shows behaviour trees, and {plan} holds none; leave it out\n"
    assert capsys.readouterr() == ("", message)


def test_a_tree_with_errors_is_not_run(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    tree = tmp_path / "tree.xml"
    tree.write_text('<root BTCPP_format="4"><BehaviorTree><Sequence/></BehaviorTree></root>')
    assert main(["run", str(tree), "--groot", str(free_port())]) == 1
    assert "GP805" in capsys.readouterr().err


def test_a_tree_that_the_protocol_cannot_number(
    tree_file: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(groot_tree, "MOST_USES", 9)
    before = threading.active_count()
    assert main(["run", tree_file, "--groot", str(free_port())]) == 2
    assert capsys.readouterr().err == (
        "gpsfsm: --groot shows at most 9 nodes of a tree; leave it out\n"
    )
    assert threading.active_count() == before


def test_without_the_library_it_says_what_to_install(
    tree_file: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "zmq", None)
    assert main(["run", tree_file, "--groot", "1667"]) == 2
    message = "gpsfsm: --groot needs pyzmq: pip install 'gpsfsm[groot]', or '.[groot]' in a clone\n"
    assert capsys.readouterr() == ("", message)
    assert main(["run", tree_file, "--failure", "0"]) == 0  # which needs none of it


def test_nothing_of_it_is_loaded_without_the_option(tree_file: str) -> None:
    program = (
        "import sys; from gpsfsm.cli import main; code = main(sys.argv[1:]); "
        "print(code, [name for name in sys.modules if 'zmq' in name or 'groot' in name])"
    )
    words = [sys.executable, "-c", program, "run", tree_file, "--failure", "0"]
    done = subprocess.run(
        words, env=environment(), capture_output=True, timeout=TIMEOUT_S, check=True
    )
    assert done.stdout.splitlines()[-1] == b"0 []"
