"""A machine with a loop and a connection that stops: a robot that asks to be let through."""

import networkx as nx

import gpsfsm

door = nx.MultiDiGraph()
door.add_node("begin", kind="start")
door.add_node(
    "drive",
    kind="runner",
    interface="nav2_capabilities/WaypointRunner",
    parameters={"x": 4.0, "y": 0.5},
)
door.add_node(
    "watch",
    kind="runner",
    interface="perception_capabilities/ImageAnalysisRunner",
    parameters={"prompt": "Is somebody in the way?"},
)
door.add_node(
    "ask",
    kind="runner",
    interface="perception_capabilities/SpeechRunner",
    parameters={"text": "May I pass?"},
)
door.add_node("end", kind="complete")
door.add_edge("begin", "drive", event="SUCCEEDED")
door.add_edge("drive", "watch", event="STARTED")
door.add_edge("watch", "drive", event="SUCCEEDED", action="stop")
door.add_edge("watch", "watch", event="FAILED")
door.add_edge("drive", "ask", event="STOPPED")
door.add_edge("ask", "drive", event="SUCCEEDED")
door.add_edge("drive", "watch", event="SUCCEEDED", action="stop")
door.add_edge("drive", "end", event="SUCCEEDED")

print(gpsfsm.check(door).plans[0].verdict)
