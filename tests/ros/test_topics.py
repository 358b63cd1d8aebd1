"""Topics: the publisher's quality of service, watches, ages, and why there is no message."""

from __future__ import annotations

import json
import signal
import time
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    import subprocess
    from pathlib import Path

    from tests.ros.support import Domain, Program

BOOL, BATTERY = "std_msgs/msg/Bool", "sensor_msgs/msg/BatteryState"
INTERFACE = "name: demo/{0}\nspec_type: interface\nspec_version: 1.2\n"
PROVIDER = """
name: demo/{0}
spec_type: provider
spec_version: 1.2
implements: demo/{0}
ros:
{1}
definition:
  configuration_parameters: []
  runtime_parameters:
    input: []
    output:
      - {{name: value, type: string}}
"""
READ = "  topic: {0}\n  type: {1}\n  outputs: {{value: {2}}}\n"
BATTERY_READ = READ.format("battery_state", BATTERY, "voltage")
DOOR = READ.format("door", BOOL, "data")
OPEN = DOOR + "  until: {data: true}\n"


def words(ros: Domain, *steps: str) -> tuple[str | Path, ...]:
    """The command for a plan with one runner after the other, each by its section ``ros``."""
    names = [f"R{steps.index(each)}" for each in steps]
    files = {"plan.xml": "<Plan>\n"}
    for name, section in zip(names, steps, strict=True):
        files[f"caps/demo/interfaces/{name}.yaml"] = INTERFACE.format(name)
        files[f"caps/demo/providers/{name}.yaml"] = PROVIDER.format(name, section.rstrip())
        files["plan.xml"] += f'<Runner interface="demo/{name}" provider="demo/{name}"/>\n'
    files["plan.xml"] += "</Plan>\n"
    for name, text in files.items():
        file = ros.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text.lstrip())
    options = ("--capabilities", ros.folder / "caps", "--journal", "run.db", "--format", "plain")
    return ("run", "--real", "--force", ros.folder / "plan.xml", *options)


def ran(ros: Domain, *steps: str) -> tuple[int, str]:
    """The exit code and the output of such a plan."""
    ended = ros.gpsfsm(*words(ros, *steps))
    assert "Traceback" not in ended.stderr
    return ended.returncode, ended.stdout + ended.stderr


def rows(ros: Domain, kind: str) -> list[dict[str, Any]]:
    listed = ros.gpsfsm("events", "run.db", "--format", "jsonl")
    lines = [json.loads(line) for line in listed.stdout.splitlines()[1:]]
    return [row for row in lines if row["kind"] == kind]


def values(ros: Domain) -> list[Any]:
    return [row["data"].get("value") for row in rows(ros, "SUCCEEDED") if "data" in row]


def ended(process: subprocess.Popen[str]) -> tuple[int, str]:
    out, error = process.communicate(timeout=60)
    return process.returncode, out + error


def publishing(
    ros: Domain, name: str, kind: str, reliability: str = "reliable", durability: str = "volatile"
) -> Program:
    server = ros.server("publisher")
    quality = {"reliability": reliability, "durability": durability}
    server.command("advertise", name=name, of_type=kind, **quality)
    return server


@pytest.mark.parametrize("reliability", ["best_effort", "reliable"])
def test_a_sensor_is_heard_whatever_it_offers(ros: Domain, reliability: str) -> None:
    server = publishing(ros, "battery_state", BATTERY, reliability)
    server.command("repeat", name="battery_state", hertz=20, voltage=12.5)
    code, out = ran(ros, BATTERY_READ, BATTERY_READ)
    assert code == 0, out
    assert values(ros) == [12.5, 12.5]


def test_what_a_publisher_keeps_is_there_for_each_step(ros: Domain) -> None:
    server = publishing(ros, "door", BOOL, durability="transient_local")
    server.command("publish", name="door", data=True)
    code, out = ran(ros, DOOR, OPEN, DOOR)
    assert code == 0, out
    assert values(ros) == [True, True, True]


def test_a_map_that_nobody_keeps(ros: Domain) -> None:
    server = publishing(ros, "map", "nav_msgs/msg/OccupancyGrid")
    server.command("repeat", name="map", hertz=10, info={"width": 2, "height": 1}, data=[0, 100])
    name = "nav2_capabilities/OccupancyGridRunner"
    (ros.folder / "map.xml").write_text(
        f'<Plan>\n<Runner interface="{name}" provider="{name}"/>\n</Plan>\n'
    )
    run = ros.gpsfsm("run", "--real", ros.folder / "map.xml", "--journal", "run.db")
    assert run.returncode == 0, run.stdout + run.stderr


@pytest.mark.parametrize(
    ("topic", "kind", "section", "reason"),
    [
        ("r1/door", BOOL, "", "nothing publishes on /door; there is /r1/door"),
        ("door", "std_msgs/msg/Int32", "", "is a std_msgs/msg/Int32 on the robot, not a std_msgs/"),
        ("door", BOOL, "", "/door has a publisher, but no message has come"),
        (
            *("door", BOOL, "  qos: {durability: transient_local}\n"),
            "requests reliable, transient_local of /door, and its publishers offer reliable, vol",
        ),
    ],
)
def test_the_reason_of_a_silence(
    ros: Domain, topic: str, kind: str, section: str, reason: str
) -> None:
    publishing(ros, topic, kind)
    code, out = ran(ros, DOOR + section + "  deadline: 3\n  wait: 2\n  late: true\n")
    assert code == 1
    assert "has not ended within 3 s: " in out
    assert reason in out
    (line,) = [row for row in rows(ros, "LOG") if "silence" in row["data"]]
    assert line["data"]["topic"] == "/door"


def test_a_watch_ends_at_the_first_message_that_fulfils_it(ros: Domain) -> None:
    server = publishing(ros, "door", BOOL)
    server.command("repeat", name="door", hertz=50, data=False)
    with ros.running(*words(ros, OPEN)) as process:
        server.command("meet", name="door")
        time.sleep(2)
        assert process.poll() is None
        server.command("cease", name="door")
        server.command("publish", name="door", data=True)
        code, out = ended(process)
    assert code == 0, out
    assert values(ros) == [True]
    assert rows(ros, "LOG") == []


def test_a_watch_that_no_message_fulfils(ros: Domain) -> None:
    server = publishing(ros, "door", BOOL)
    server.command("repeat", name="door", hertz=20, data=False)
    code, out = ran(ros, OPEN + "  deadline: 2\n")
    assert code == 1
    assert "messages of /door fits, the last has data=False" in out


def test_a_watch_notices_that_its_publisher_has_gone(ros: Domain) -> None:
    server = publishing(ros, "door", BOOL)
    server.command("repeat", name="door", hertz=20, data=False)
    with ros.running(*words(ros, OPEN + "  silence: 1\n")) as process:
        server.command("meet", name="door")
        time.sleep(1.5)
        assert process.poll() is None
        server.command("withdraw", name="door")
        code, out = ended(process)
    assert code == 1
    assert "has been silent for 1 s" in out


def test_a_watch_that_can_never_end_does_not_begin(ros: Domain) -> None:
    code, out = ran(ros, DOOR + "  until: {data: 1}\n  late: true\n")
    assert code == 2
    assert "plan.xml:2: demo/R0: 'until' compares data, a boolean, with == 1" in out


def test_a_message_between_two_steps_is_not_lost(ros: Domain) -> None:
    """It came while another step waited, and counts once."""
    server = publishing(ros, "door", BOOL)
    server.command("advertise", name="gate", of_type=BOOL)
    gate, later = READ.format("gate", BOOL, "data"), OPEN + "  max_age: 30\n  deadline: 3\n"
    with ros.running(*words(ros, gate, later, later)) as process:
        server.command("meet", name="door")
        server.command("meet", name="gate")
        time.sleep(1)
        server.command("publish", name="door", data=True)
        server.command("publish", name="door", data=False)
        time.sleep(1)
        server.command("publish", name="gate", data=True)
        code, out = ended(process)
    assert code == 1
    assert values(ros) == [True, True]
    assert "has not ended within 3 s: none of 1 message of /door fits" in out


def test_what_is_too_old_is_passed_over(ros: Domain) -> None:
    server = publishing(ros, "battery_state", BATTERY)
    with ros.running(*words(ros, BATTERY_READ + "  max_age: 5\n")) as process:
        server.command("meet", name="battery_state")
        time.sleep(1)
        server.command("publish", name="battery_state", age=60, voltage=1.0)
        time.sleep(0.5)
        server.command("publish", name="battery_state", age=1, voltage=2.0)
        code, out = ended(process)
    assert code == 0, out
    assert values(ros) == [2.0]


def test_only_old_messages(ros: Domain) -> None:
    server = publishing(ros, "battery_state", BATTERY, "best_effort")
    server.command("repeat", name="battery_state", hertz=10, age=60, voltage=1.0)
    code, out = ran(ros, BATTERY_READ + "  max_age: 5\n  deadline: 2\n")
    assert code == 1
    assert "the last message of /battery_state was 60" in out


def test_a_publisher_that_comes_later_is_heard_as_well(ros: Domain) -> None:
    """It offers less than the one that is there; then one comes that keeps its message."""
    first = publishing(ros, "door", BOOL)
    first.command("repeat", name="door", hertz=20, data=False)
    with ros.running(*words(ros, OPEN, OPEN)) as process:
        first.command("meet", name="door")
        time.sleep(1)
        second = publishing(ros, "door", BOOL, "best_effort")
        second.command("repeat", name="door", hertz=20, data=True)
        time.sleep(2)
        for each in (first, second):
            each.command("withdraw", name="door")
        code, out = ended(process)
    assert code == 0, out


def test_all_steps_that_wait_get_a_message_and_a_stop_ends_them(ros: Domain) -> None:
    server = publishing(ros, "door", BOOL)
    command = words(ros, OPEN)
    plan = ros.folder / "plan.xml"
    runner = '<Runner interface="demo/R0" provider="demo/R0"/>\n'
    both = f'<Control type="parallel_all">\n{runner}{runner}</Control>\n'
    plan.write_text(f"<Plan>\n{both}{runner}</Plan>\n")
    with ros.running(*command) as process:
        server.command("meet", name="door")
        time.sleep(1)
        server.command("publish", name="door", data=True)
        time.sleep(1)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        code, out = ended(process)
    assert code == 130, out
    assert values(ros) == [True, True]


def test_the_subscription_ends_with_the_run(ros: Domain) -> None:
    server = publishing(ros, "door", BOOL, durability="transient_local")
    server.command("publish", name="door", data=True)
    words(ros, DOOR, DOOR)
    ran = ros.python("-c", _IN_PYTHON.format(ros.folder / "plan.xml", ros.folder / "caps"))
    assert ran.returncode == 0, ran.stderr
    assert json.loads(ran.stdout) == [1, 0]


_IN_PYTHON = """
import json, threading, time
import gpsfsm
from gpsfsm.ros.node import process_node, node_if_made
most = 0
def count():
    return sum(each.topic_name == "/door" for each in process_node().handle.subscriptions)
def look():
    global most
    while not over:
        if node_if_made():
            most = max(most, process_node().do(count))
        time.sleep(0.01)
over = False
looking = threading.Thread(target=look)
looking.start()
from pathlib import Path
run = gpsfsm.run(Path("{}"), real=True, force=True, capabilities=["{}"])
over = True
looking.join()
time.sleep(0.5)
print(json.dumps([min(most, 1), process_node().do(count)]))
"""
