"""Plans on the runners of a capability server, as real processes that talk over ROS 2."""

from __future__ import annotations

import signal
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

from gpsfsm.execution.journal_read import JournalReader
from tests.conftest import REPO

if TYPE_CHECKING:
    from tests.ros.support import Domain, Program

MISSIONS = REPO / "corpus" / "missions"
ARENA = REPO / "corpus" / "worlds" / "arena.yaml"
WAYPOINT = "nav2_capabilities/WaypointRunner"
MULTIPLEXER = "capabilities2_runner/InputMultiplexRunner"
GRASP = "gripper_capabilities/GraspRunner"
VIA = ("--real", "--via", "capabilities2", "--durability", "none", "--format", "plain")
WRONG = ("warning", "error", "dropped", "died")
"""What the server tells of a client that does not know its ways."""

DRIVES = """<Plan>
  <Runner interface="nav2_capabilities/WaypointRunner"
    provider="nav2_capabilities/WaypointRunner" x="1" y="2"/>
  <Control type="recovery">{}</Control>
</Plan>"""
NOTE = """<Runner interface="generic_capabilities/LogRunner"
    provider="generic_capabilities/LogRunner" text="help"/>"""
AGAIN = """<Runner interface="nav2_capabilities/WaypointRunner"
    provider="nav2_capabilities/WaypointRunner" x="0" y="0"/>"""
GRASPS = f"""<Plan>
  <Runner interface="{GRASP}" provider="{GRASP}" force="12" label="cup"/>
</Plan>"""


def rows(journal: Path) -> list[tuple[Any, ...]]:
    """What is journaled, without times, texts and lines, and what counts rows."""
    with JournalReader(str(journal)) as reader:
        kept = [row for row in reader.events(1) if row.kind != "LOG"]
    return [(*row[2:10], row.data) for row in kept]


def written(ros: Domain, name: str, text: str) -> Path:
    path = ros.folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def profile(ros: Domain, deadline: float = 600.0) -> Path:
    text = f"name: tester\nros: {{via: capabilities2, deadline: {deadline}}}\n"
    return written(ros, "tester.yaml", text)


def unspoilt(server: Program) -> None:
    """The server has met nothing of what makes it warn, drop or die."""
    assert not [row for row in server.journal() if row["event"] in WRONG]


def simulated(ros: Domain, mission: str) -> tuple[list[tuple[Any, ...]], list[str]]:
    """The journal of a mission in the arena, and the outcomes of its drives in their order."""
    journal = ros.folder / "simulated.db"
    plan = MISSIONS / f"{mission}.xml"
    ran = ros.gpsfsm("run", plan, "--world", ARENA, "--journal", journal, "--durability", "none")
    assert ran.returncode == 0, ran.stderr
    happened = rows(journal)
    kinds = [row[2] for row in happened if row[2] in ("SUCCEEDED", "FAILED")]
    return happened, ["fail" if kind == "FAILED" else "succeed" for kind in kinds]


@pytest.mark.parametrize(
    ("mission", "version"),
    [
        *[(f"navigation_{number}", 2) for number in range(1, 6)],
        ("navigation_4", 3),
        ("navigation_3", 1),
    ],
)
def test_a_mission_journals_what_its_simulation_does(
    ros: Domain, mission: str, version: int
) -> None:
    expected, outcomes = simulated(ros, mission)
    variants = ("capabilities2-v1",) if version == 1 else ()
    server = ros.server("capabilities2", "--version", str(version), variants=variants)
    server.command("outcomes", outcomes=outcomes)
    journal = ros.folder / "real.db"
    plan = MISSIONS / f"{mission}.xml"
    ran = ros.gpsfsm("run", plan, *VIA, "--journal", journal, variants=variants)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert rows(journal) == expected
    assert len(server.journal("acting")) == len(outcomes)
    assert server.wait_for("broken")["held"] == []  # freed one by one, the multiplexer last
    assert server.journal("freed")[-1]["capability"].rpartition("/")[2].startswith("InputMulti")
    unspoilt(server)


def test_the_reason_of_a_failure_is_told(ros: Domain) -> None:
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=["fail"])
    ran = ros.gpsfsm("run", MISSIONS / "navigation_1.xml", *VIA)
    assert ran.returncode == 1
    assert f"{WAYPOINT} has failed: it did not work" in ran.stdout


def test_a_server_that_is_killed_has_failed_and_the_recovery_acts(ros: Domain) -> None:
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=["hang"])
    plan = written(ros, "plan.xml", DRIVES.format(NOTE))
    with ros.running("run", plan, *VIA) as process:
        server.wait_for("acting")
        ros.kill(server.process)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 0, output + errors
    assert "the capability server does not answer" in output
    assert "LogRunner (text=help) succeeded" in output


def test_a_server_that_is_restarted_breaks_the_bond_and_serves_the_recovery(ros: Domain) -> None:
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=["hang"])
    plan = written(ros, "plan.xml", DRIVES.format(AGAIN))
    with ros.running("run", plan, *VIA) as process:
        server.wait_for("acting")
        ros.kill(server.process)
        again = ros.server("capabilities2")
        message, errors = process.communicate(timeout=120)
    assert process.returncode == 0, message + errors
    assert (
        f"the capability server has stopped {WAYPOINT}" in message or "does not answer" in message
    )
    assert len(again.journal("bond")) == 1
    assert again.journal("acting", capability=WAYPOINT)
    unspoilt(again)


def test_what_acts_on_a_server_that_was_given_up_does_not_outlast_its_step(ros: Domain) -> None:
    """The runner is needed once more, and holds the session until then."""
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=["drive", "drive"])
    pose = "nav2_capabilities/RobotPoseRunner"
    look = f'<Runner interface="{pose}" provider="{pose}"/>'
    text = DRIVES.format(look).replace("</Plan>", f"{AGAIN}</Plan>")
    with ros.running("run", written(ros, "plan.xml", text), *VIA, "--force") as process:
        server.wait_for("acting")
        server.process.send_signal(signal.SIGSTOP)
        assert process.stdout is not None
        line = next(line for line in process.stdout if "does not answer" in line)
        server.process.send_signal(signal.SIGCONT)
        assert WAYPOINT.rpartition("/")[2] in line
        server.wait_for("cancelled", capability=WAYPOINT)
        assert not server.journal("freed", capability=pose)  # the run goes on
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)


def test_branches_act_at_once_and_hand_over_what_the_server_hands_over(ros: Domain) -> None:
    server = ros.server("capabilities2")
    pose = "nav2_capabilities/RobotPoseRunner"
    step = f'<Runner interface="{WAYPOINT}" provider="{WAYPOINT}" x="3" y="4"/>'
    look = f'<Runner interface="{pose}" provider="{pose}"/>'
    text = f"""<Plan><Control type="parallel_all">
        <Control type="sequential">{look}{step}</Control>{step}{step}
    </Control></Plan>"""
    ran = ros.gpsfsm("run", written(ros, "plan.xml", text), *VIA, "--force")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    drives = [row["parameters"] for row in server.journal("triggered", capability=WAYPOINT)]
    assert sorted(each["x"] for each in drives) == [[1, "1.5"], [1, "3.0"], [1, "3.0"]]
    unspoilt(server)


def test_a_goal_that_is_rejected_fails_at_the_deadline_and_is_recovered_from(ros: Domain) -> None:
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=["silent"])
    plan = written(ros, "plan.xml", DRIVES.format(AGAIN))
    ran = ros.gpsfsm("run", plan, *VIA, "--robot", profile(ros, deadline=2.5))
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"no event of {WAYPOINT} within 2.5 s" in ran.stdout
    assert [row["capability"] for row in server.journal("started")].count(WAYPOINT) == 2
    unspoilt(server)


@pytest.mark.parametrize("outcome", ["drive", "hang"])
def test_what_acts_is_stopped_with_the_run(ros: Domain, outcome: str) -> None:
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=[outcome])
    journal = ros.folder / "run.db"
    with ros.running("run", MISSIONS / "navigation_1.xml", *VIA, "--journal", journal) as process:
        server.wait_for("acting")
        process.send_signal(signal.SIGINT)
        output, errors = process.communicate(timeout=60)
    assert process.returncode == 130, output + errors
    assert server.wait_for("cancelled")["capability"] == WAYPOINT
    if outcome == "drive":
        server.wait_for("broken")
    assert not server.journal("died")


def test_a_run_goes_on_once_the_server_has_stopped_what_acted(ros: Domain) -> None:
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=["drive"])
    plan = written(ros, "plan.xml", DRIVES.format(AGAIN))
    journal = ros.folder / "run.db"
    with ros.running("run", plan, *VIA, "--journal", journal) as process:
        server.wait_for("acting")
        ros.kill(process)
    ran = ros.gpsfsm("resume", journal, "--real")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert f"the capability server has stopped {WAYPOINT}" in ran.stdout
    happened = [row["event"] for row in server.journal() if row.get("capability") == WAYPOINT]
    assert happened.index("cancelled") < len(happened) - 1 - happened[::-1].index("triggered")


def test_a_run_goes_on_with_a_server_that_was_restarted(ros: Domain) -> None:
    server = ros.server("capabilities2")
    server.command("outcomes", outcomes=["hang"])
    plan = written(ros, "plan.xml", DRIVES.format(AGAIN))
    journal = ros.folder / "run.db"
    with ros.running("run", plan, *VIA, "--journal", journal) as process:
        server.wait_for("acting")
        ros.kill(process)
    ros.kill(server.process)
    again = ros.server("capabilities2")
    ran = ros.gpsfsm("resume", journal, "--real")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    (triggered,) = [row for row in again.journal("triggered") if row["capability"] == WAYPOINT]
    assert triggered["parameters"]["x"] == [1, "0.0"]
    unspoilt(again)


def test_parameters_go_as_their_file_says_and_outputs_come_back_so(ros: Domain) -> None:
    server = ros.server("capabilities2", "--version", "3")
    assert ros.gpsfsm("capabilities", "pull", "--output", "robot").returncode == 0
    journal = ros.folder / "run.db"
    plan = written(ros, "plan.xml", GRASPS)
    ran = ros.gpsfsm("run", plan, "--real", "--robot", "robot/robot.yaml", "--journal", journal)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    (triggered,) = [row for row in server.journal("triggered") if row["capability"] == GRASP]
    assert triggered["parameters"] == {"force": [1, "12.0"], "label": [3, "cup"]}
    (data,) = [row[-1] for row in rows(journal) if row[2] == "SUCCEEDED"]
    assert data == '{"held":true,"widths":[0.01,0.02]}'


def test_a_parameter_without_a_type_is_never_sent(ros: Domain) -> None:
    server = ros.server("capabilities2")
    head = f"name: {GRASP}\nspec_version: 1.2\nspec_type"
    written(ros, "own/gripper_capabilities/interfaces/GraspRunner.yaml", f"{head}: interface\n")
    written(
        ros,
        "own/gripper_capabilities/providers/GraspRunner.yaml",
        f"{head}: provider\nimplements: {GRASP}\ndefinition:\n"
        "  configuration_parameters: [{name: force}, {name: label, type: string}]\n",
    )
    ran = ros.gpsfsm("run", written(ros, "plan.xml", GRASPS), *VIA, "--capabilities", "own")
    assert ran.returncode == 1, ran.stdout + ran.stderr
    assert "does not say which type 'force' has" in ran.stdout
    assert not [row for row in server.journal("triggered") if row["capability"] == GRASP]
    unspoilt(server)


def test_prompts_stay_with_gpsfsm_also_if_the_server_has_them(ros: Domain) -> None:
    ros.server("capabilities2")
    name = "prompt_capabilities/PromptTextRunner"
    text = f'<Plan><Runner interface="{name}" provider="{name}" text="a" uuid="b"/></Plan>'
    ran = ros.gpsfsm("run", written(ros, "plan.xml", text), *VIA, "--force")
    assert ran.returncode == 2
    assert f"{name} asks a language model" in ran.stderr


def test_without_a_server_nothing_starts(ros: Domain) -> None:
    ran = ros.gpsfsm("run", MISSIONS / "navigation_1.xml", *VIA)
    assert ran.returncode == 2
    assert f"there is no capability server (waited 5 s in domain {ros.number}" in ran.stderr
    pulled = ros.gpsfsm("capabilities", "pull", "--output", "robot")
    assert pulled.returncode == 2
    assert not (ros.folder / "robot").exists()


# --- what a robot offers --------------------------------------------------------------------------


@pytest.mark.parametrize(("version", "grasp"), [(2, False), (3, True)])
def test_what_is_pulled_fits_and_runs(ros: Domain, version: int, grasp: bool) -> None:
    server = ros.server("capabilities2", "--version", str(version))
    pulled = ros.gpsfsm("capabilities", "pull", "--output", "robot", "--name", "Bot")
    assert pulled.returncode == 0, pulled.stderr
    checked = ros.gpsfsm("capabilities", "check", "robot", "--fail-on", "warning")
    assert checked.returncode == 0, checked.stdout
    assert checked.stdout.startswith("2 files: 1 interface, 1 provider")  # of what is not built in
    written_by = (ros.folder / "robot/gripper_capabilities/providers/GraspRunner.yaml").read_text()
    assert ("definition:" in written_by) == grasp
    robot = (ros.folder / "robot" / "robot.yaml").read_text()
    assert robot.startswith('name: "Bot"\n')
    assert f'  domain: {ros.number}\n  via: "capabilities2"\n' in robot
    for name in (WAYPOINT, "nav2_capabilities/RobotPoseRunner", GRASP):
        assert f'  - "{name}"\n' in robot
    plan = MISSIONS / "navigation_1.xml"
    ran = ros.gpsfsm("run", plan, "--real", "--robot", "robot/robot.yaml")
    assert ran.returncode == 0, ran.stdout + ran.stderr
    assert server.journal("acting", capability=WAYPOINT)


def test_a_folder_is_overwritten_on_demand_only(ros: Domain) -> None:
    ros.server("capabilities2")
    own = written(ros, "robot/robot.yaml", "name: mine\n")
    refused = ros.gpsfsm("capabilities", "pull", "--output", "robot")
    assert refused.returncode == 2
    assert "is not empty" in refused.stderr
    assert own.read_text() == "name: mine\n"
    assert ros.gpsfsm("capabilities", "pull", "--output", "robot", "--force").returncode == 0
    assert own.read_text() != "name: mine\n"


@pytest.mark.parametrize("version", [2, 3])
def test_texts_of_a_robot_that_are_none_are_left_out_by_name(ros: Domain, version: int) -> None:
    ros.server("capabilities2", "--version", str(version), "--hostile")
    pulled = ros.gpsfsm("capabilities", "pull", "--output", "a/b/robot")
    assert pulled.returncode == 1, pulled.stderr
    left_out = pulled.stderr.count("is left out")
    assert left_out == (6 if version == 2 else 8)
    assert "Traceback" not in pulled.stderr
    inside = {path.relative_to(ros.folder) for path in (ros.folder / "a").rglob("*.yaml")}
    folder = Path("a/b/robot")
    grasp = {
        folder / f"gripper_capabilities/{kind}/GraspRunner.yaml"
        for kind in ("interfaces", "providers")
    }
    assert inside == {folder / "robot.yaml", *grasp}
    assert not list(ros.folder.glob("*.yaml"))


# --- the fake server ------------------------------------------------------------------------------


SERVICE = "capabilities2_msgs/srv/"


def bonded(ros: Domain, *used: str) -> tuple[Any, str]:
    """A client that uses some runners in a bond of its own."""
    client = ros.client()
    response = client.call("/capabilities/establish_bond", SERVICE + "EstablishBond")
    bond = response["bond_id"]
    for each in used:
        request = {"capability": each, "preferred_provider": each, "bond_id": bond}
        client.call("/capabilities/use_capability", SERVICE + "UseCapability", **request)
    return client, bond


def connect(client: Any, bond: str, target: str, code: int) -> None:
    source = {"capability": WAYPOINT, "provider": WAYPOINT, "instance_id": "0"}
    connection = {
        "type": {"code": code},
        "source": source,
        "target": {"capability": MULTIPLEXER, "provider": MULTIPLEXER, "instance_id": target},
    }
    client.call(
        "/capabilities/connect_capability",
        SERVICE + "ConnectCapability",
        bond_id=bond,
        connection=connection,
    )


def trigger(client: Any, bond: str, **parameters: list[Any]) -> None:
    capability = {
        "capability": WAYPOINT,
        "provider": WAYPOINT,
        "instance_id": "0",
        "parameters": [
            {"key": key, "type": kind, "value": [value]}
            for key, (kind, value) in parameters.items()
        ],
    }
    client.call(
        "/capabilities/trigger_capability",
        SERVICE + "TriggerCapability",
        bond_id=bond,
        capability=capability,
    )


def test_the_fake_server_drops_a_second_connection_of_two_instances(ros: Domain) -> None:
    server = ros.server("capabilities2")
    client, bond = bonded(ros, WAYPOINT, MULTIPLEXER, WAYPOINT)
    server.wait_for("warning", text=f"could not start runner: running already: {WAYPOINT}")
    connect(client, bond, "1", 4)
    connect(client, bond, "1", 3)
    assert server.wait_for("dropped")["connection"] == f"{bond}/0/1"
    trigger(client, bond)
    server.wait_for("acting", capability=WAYPOINT)


@pytest.mark.parametrize("how", ["type", "freed", "twice"])
def test_the_fake_server_ends_where_the_original_aborts(ros: Domain, how: str) -> None:
    server = ros.server("capabilities2")
    client, bond = bonded(ros, WAYPOINT, MULTIPLEXER)
    connect(client, bond, "1", 4)
    if how == "freed":
        request = {"capability": MULTIPLEXER, "bond_id": bond}
        client.call("/capabilities/free_capability", SERVICE + "FreeCapability", **request)
    if how == "twice":
        trigger(client, bond)
        server.wait_for("acting")
    trigger(client, bond, **({"x": [2, "1"]} if how == "type" else {"x": [1, "1"]}))
    server.wait_for("died")
    server.process.wait(60)
    assert server.process.returncode == 134
