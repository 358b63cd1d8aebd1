"""The extension of Visual Studio Code, packed: all that it names is in it, and Node reads it."""

from __future__ import annotations

import json
import shutil
import subprocess
import zipfile
from typing import TYPE_CHECKING, Any

import pytest
from lxml import etree

from gpsfsm.version import REPOSITORY, VERSION
from tests.installation.support import run
from tests.pipelines.support import REPO, clone

if TYPE_CHECKING:
    from pathlib import Path

SOURCE = REPO / "editors" / "vscode"
PACKAGE: dict[str, Any] = json.loads((SOURCE / "package.json").read_text("utf-8"))


def test_the_lock_is_that_of_the_package() -> None:
    lock = json.loads((SOURCE / "package-lock.json").read_text("utf-8"))
    own = lock["packages"][""]
    assert own["dependencies"] == PACKAGE["dependencies"]
    assert own["version"] == lock["version"] == PACKAGE["version"] == VERSION
    for name, locked in lock["packages"].items():
        assert not name or locked["integrity"].startswith("sha512-")
        assert locked.get("resolved", "https://registry.npmjs.org/").startswith(
            "https://registry.npmjs.org/"
        )


def test_commands_and_settings_are_those_of_the_program() -> None:
    program = (SOURCE / PACKAGE["main"]).read_text("utf-8")
    for command in PACKAGE["contributes"]["commands"]:
        assert f'registerCommand("{command["command"]}"' in program
    for name in PACKAGE["contributes"]["configuration"]["properties"]:
        assert f'settings.get("{name.removeprefix("gpsfsm.")}")' in program
    assert PACKAGE["repository"]["url"] == REPOSITORY


@pytest.mark.packages
def test_it_is_packed(tmp_path: Path) -> None:
    if shutil.which("npm") is None:
        pytest.skip("npm is not installed")
    folder = clone(tmp_path / "clone")
    done = run("make", "extension", cwd=folder)
    assert done.returncode == 0, done.stdout + done.stderr
    (file,) = (folder / "build" / "vscode").glob("*.vsix")
    assert file.name == f"gpsfsm-{VERSION}.vsix"
    with zipfile.ZipFile(file) as archive:
        archive.extractall(tmp_path / "unpacked")
        manifest = etree.fromstring(archive.read("extension.vsixmanifest"))
    (identity,) = manifest.iter("{*}Identity")
    assert (identity.get("Id"), identity.get("Version")) == (PACKAGE["name"], VERSION)
    extension = tmp_path / "unpacked" / "extension"
    packed = json.loads((extension / "package.json").read_text("utf-8"))
    assert packed["contributes"] == PACKAGE["contributes"]
    assert (extension / PACKAGE["main"]).read_bytes() == (SOURCE / PACKAGE["main"]).read_bytes()
    assert (extension / "LICENSE.txt").read_bytes() == (REPO / "LICENSE").read_bytes()
    unwanted = [*extension.rglob("*.map"), *extension.rglob(".git*"), *extension.rglob("*.ts")]
    assert unwanted == []
    assert activated(extension, tmp_path) == ["gpsfsm lsp", "gpsfsm.restart"]


def activated(extension: Path, folder: Path) -> list[str]:
    """What the extension starts and registers, in Node, with a stand-in of the editor."""
    stand_in = folder / "node_modules" / "vscode" / "index.js"
    stand_in.parent.mkdir(parents=True)
    stand_in.write_text(
        """
const any = new Proxy(function () {}, { get: (_, name) => name === "version" ? "1.90.0" : any,
  apply: () => any, construct: () => any });
const own = { version: "1.90.0", commands: { registerCommand: name => (console.log(name), {}) },
  workspace: {
    getConfiguration: () => ({ get: name => name === "command" ? ["gpsfsm", "lsp"] : [] }),
    onDidChangeConfiguration: () => ({}) } };
module.exports = new Proxy(own, { get: (own, name) => name in own ? own[name] : any });
""",
        encoding="utf-8",
    )
    script = f"""
const client = require("{extension}/node_modules/vscode-languageclient/node");
client.LanguageClient = class {{
  constructor(id, name, server) {{ console.log([server.command, ...server.args].join(" ")); }}
  async start() {{}}
}};
require("{extension}").activate({{ subscriptions: [] }});
"""
    done = subprocess.run(
        ["node", "-e", script],
        cwd=folder,
        env={"NODE_PATH": str(folder / "node_modules"), "PATH": str(shutil.which("node"))},
        executable=shutil.which("node"),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return sorted(done.stdout.splitlines())
