"""A stopper without a robot: python -m tests.service.stopper_child FOLDER

It writes into the file ``stops`` that it was asked to stop. How it answers stands in the file
``how``: "well"; "deaf" does not answer to stop; "partly" has problems; "strange" answers nonsense;
"late" answers a stop only before it answers the next one.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

_ANSWERS = {
    "well": {"cancelled": 2, "problems": []},
    "partly": {"cancelled": 1, "problems": ["/dock has not answered"]},
    "strange": {"cancelled": "all"},
}


def main(folder: Path) -> None:
    print(json.dumps({"ready": True}), flush=True)
    owed: list[str] = []
    for line in sys.stdin:
        word, _, number = line.strip().partition(" ")
        if word == "ping":
            print(json.dumps({"alive": True}), flush=True)
        elif word == "stop":
            with (folder / "stops").open("a", encoding="utf-8") as noted:
                noted.write("stop\n")
            how = (folder / "how").read_text(encoding="utf-8")
            if how in _ANSWERS:
                print("no JSON at all", flush=True)
                print(json.dumps({"stop": int(number), **_ANSWERS[how]}), flush=True)
            if how == "late":
                for late in owed:
                    print(late, flush=True)
                owed = [json.dumps({"stop": int(number), **_ANSWERS["well"]})]


if __name__ == "__main__":
    main(Path(sys.argv[1]))
