"""A stopper without a robot: python -m tests.service.stopper_child FOLDER

It writes into the file ``stops`` that it was asked to stop. How it answers stands in the file
``how``: "well"; "deaf" does not answer to stop; "partly" has problems; "strange" answers nonsense.
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
    for line in sys.stdin:
        if line == "ping\n":
            print(json.dumps({"alive": True}), flush=True)
        elif line == "stop\n":
            with (folder / "stops").open("a", encoding="utf-8") as noted:
                noted.write("stop\n")
            how = (folder / "how").read_text(encoding="utf-8")
            if how in _ANSWERS:
                print("no JSON at all", flush=True)
                print(json.dumps(_ANSWERS[how]), flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
