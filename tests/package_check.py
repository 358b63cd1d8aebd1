"""Build the sdist and from it the wheel, look into both, use the wheel in an empty environment.

Run by ``make package-check``; not a test module, since it downloads packages.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tarfile
import tempfile
import tomllib
import zipfile
from pathlib import Path

REPO = Path(__file__).resolve().parents[1]
PLAN = REPO / "corpus" / "plans" / "patrol.xml"
NOT_SOURCE = (".*", "*.egg-info", "__pycache__", "build", "dist", "node_modules")
IN_SDIST = ("CHANGELOG.md", "LICENSE", "README.md", "pyproject.toml")


def run(*command: str | Path, cwd: Path, expect: int = 0) -> str:
    """Run a command; stop with its output if it exits otherwise than expected."""
    done = subprocess.run(
        [str(word) for word in command], cwd=cwd, capture_output=True, text=True, check=False
    )
    if done.returncode != expect:
        sys.exit(
            f"{' '.join(map(str, command))} exited {done.returncode}:\n{done.stdout}{done.stderr}"
        )
    return done.stdout


def packaged() -> dict[str, str]:
    """Every file that is to be installed: where it is in the tree → where it is in the wheel."""
    setup = tomllib.loads((REPO / "pyproject.toml").read_text(encoding="utf-8"))["tool"][
        "setuptools"
    ]
    found = {}
    for package in setup["packages"]:
        inner = package.replace(".", "/")
        folder = setup["package-dir"].get(package, inner)
        for pattern in ("*.py", *setup["package-data"].get(package, ())):
            for file in (REPO / folder).glob(pattern):
                name = file.relative_to(REPO / folder).as_posix()
                found[f"{folder}/{name}"] = f"{inner}/{name}"
    return found


def build(away: Path) -> tuple[Path, Path]:
    """The sdist, made from a copy of the tree, and the wheel, made from the sdist."""
    source = away / "source"
    ignored = shutil.ignore_patterns(*NOT_SOURCE)
    shutil.copytree(REPO, source, symlinks=True, ignore=ignored)
    run(sys.executable, "-m", "build", "--outdir", away / "dist", source, cwd=away)
    (sdist,) = (away / "dist").glob("gpsfsm-*.tar.gz")
    (wheel,) = (away / "dist").glob("gpsfsm-*.whl")
    return sdist, wheel


def check_contents(sdist: Path, wheel: Path) -> None:
    """Both hold every file of the packages; the sdist no tests, which would lack their helpers."""
    files = packaged()
    with tarfile.open(sdist) as archive:
        within = {member.name.partition("/")[2] for member in archive if member.isfile()}
    missing = {*files, *IN_SDIST} - within
    tests = {name for name in within if name.startswith("tests/")}
    if missing or tests:
        sys.exit(f"{sdist.name}: missing {sorted(missing)}, unwanted {sorted(tests)}")
    with zipfile.ZipFile(wheel) as archive:
        installed = {name for name in archive.namelist() if ".dist-info/" not in name}
        licensed = any(name.endswith("/LICENSE") for name in archive.namelist())
    wrong = installed ^ set(files.values())
    if wrong or not licensed:
        sys.exit(f"{wheel.name}: missing or unwanted {sorted(wrong)}, LICENSE: {licensed}")


def use(wheel: Path, away: Path) -> None:
    """Install the wheel where nothing else is, and do with it what its users do."""
    run(sys.executable, "-m", "venv", away / "env", cwd=away)
    python, gpsfsm = away / "env" / "bin" / "python", away / "env" / "bin" / "gpsfsm"
    run(python, "-m", "pip", "install", "-q", wheel, cwd=away)
    run(python, "-c", "import gpsfsm.analysis, gpsfsm.grammars, gpsfsm.runners", cwd=away)
    run(python, "-c", "import analysis", cwd=away, expect=1)
    out = run(gpsfsm, "check", PLAN, "--format", "json", cwd=away)
    if '"version": 2' not in out and '"version":2' not in out:
        sys.exit(f"gpsfsm check printed:\n{out}")
    if '"GP210"' in out:
        sys.exit(f"gpsfsm check knows none of the runners that it comes with:\n{out}")
    run(gpsfsm, "capabilities", "show", "WaypointRunner", cwd=away)
    run(python, "-c", "from gpsfsm.grammars import relax_ng; relax_ng()", cwd=away)
    run(gpsfsm, "check", PLAN, "--assume", "never fails: SpeechRunner", cwd=away)


def main() -> None:
    """Exit non-zero with the reason if the package does not work."""
    with tempfile.TemporaryDirectory() as folder:
        away = Path(folder)
        sdist, wheel = build(away)
        check_contents(sdist, wheel)
        use(wheel, away)
        print(f"{sdist.name}, {wheel.name}: built, complete, used in an empty environment")


if __name__ == "__main__":
    main()
