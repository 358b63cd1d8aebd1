"""Ask Woflan whether a net is sound. Runs in an interpreter that has pm4py, and imports no more."""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path
from typing import Any


def main(file: str) -> None:
    woflan = import_module("pm4py.algo.analysis.woflan.algorithm")
    objects = import_module("pm4py.objects.petri_net.obj")
    connect = import_module("pm4py.objects.petri_net.utils.petri_utils").add_arc_from_to
    document = json.loads(Path(file).read_text(encoding="utf-8"))
    net = objects.PetriNet("plan")
    places: dict[str, Any] = {}

    def place(name: str) -> Any:
        if name not in places:
            places[name] = objects.PetriNet.Place(name)
            net.places.add(places[name])
        return places[name]

    for number, (takes, gives) in enumerate(document["transitions"]):
        transition = objects.PetriNet.Transition(f"t{number}", f"t{number}")
        net.transitions.add(transition)
        for name in takes:
            connect(place(name), transition, net)
        for name in gives:
            connect(transition, place(name), net)
    start = objects.Marking({place(document["source"]): 1})
    end = objects.Marking({place(document["sink"]): 1})
    parameters = {
        woflan.Parameters.RETURN_ASAP_WHEN_NOT_SOUND: True,
        woflan.Parameters.PRINT_DIAGNOSTICS: False,
    }
    print("sound" if woflan.apply(net, start, end, parameters=parameters) else "unsound")


if __name__ == "__main__":
    main(sys.argv[1])
