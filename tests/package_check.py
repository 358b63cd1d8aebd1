"""Build sdist and wheel, and use the wheel in an empty environment elsewhere.

Run by ``make package-check``; not a test module, since it downloads packages.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
PLAN = REPO / "corpus" / "plans" / "patrol.xml"


def run(*command: str | Path, cwd: Path, expect: int = 0) -> str:
    """Run a command; stop with its output if it exits otherwise than expected."""
    done = subprocess.run(
        [str(word) for word in command], cwd=cwd, capture_output=True, text=True, check=False
    )
    if done.returncode != expect:
        sys.exit(f"{' '.join(map(str, command))} exited {done.returncode}:\n{done.stderr}")
    return done.stdout


def main() -> None:
    """Exit non-zero with the reason if the package does not work."""
    with tempfile.TemporaryDirectory() as folder:
        away = Path(folder)
        run(sys.executable, "-m", "pip", "wheel", "-q", "--no-deps", "-w", away, REPO, cwd=away)
        (wheel,) = away.glob("gpsfsm-*.whl")
        run(sys.executable, "-m", "venv", away / "env", cwd=away)
        python = away / "env" / "bin" / "python"
        run(python, "-m", "pip", "install", "-q", wheel, cwd=away)
        run(python, "-c", "import gpsfsm.analysis, gpsfsm.grammars, gpsfsm.runners", cwd=away)
        run(python, "-c", "import analysis", cwd=away, expect=1)
        out = run(away / "env" / "bin" / "gpsfsm", "check", PLAN, "--format", "json", cwd=away)
        assert '"version": 1' in out or '"version":1' in out, out
        run(python, "-c", "from gpsfsm.grammars import relax_ng; relax_ng()", cwd=away)
        assume = ["--assume", "never fails: SpeechRunner"]
        run(away / "env" / "bin" / "gpsfsm", "check", PLAN, *assume, cwd=away)
        print(f"{wheel.name}: installed and used in an empty environment")


if __name__ == "__main__":
    main()
