"""The extension for Visual Studio Code: it can be loaded, and it starts the server."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

import gpsfsm

FOLDER = Path(__file__).parents[2] / "editors" / "vscode"
MANIFEST = json.loads((FOLDER / "package.json").read_text())
NODE = shutil.which("node")

LOAD = """
const Module = require("node:module");
const told = [];
class LanguageClient {
  constructor(id, name, server, client) { told.push({ server, client }); }
  async start() { if (process.env.BROKEN) throw new Error("ENOENT"); told.push("started"); }
  async stop() { told.push("stopped"); }
}
const settings = { command: ["gpsfsm", "lsp"], plans: ["plans/*.xml"] };
const vscode = {
  workspace: {
    getConfiguration: () => ({ get: (name) => settings[name] }),
    onDidChangeConfiguration: () => ({}),
  },
  commands: { registerCommand: (name) => told.push(name) },
  window: { showErrorMessage: (text) => told.push(text) },
};
const load = Module._load;
Module._load = (name, ...rest) =>
  name === "vscode" ? vscode
  : name === "vscode-languageclient/node" ? { LanguageClient, TransportKind: { stdio: 0 } }
  : load(name, ...rest);
(async () => {
  const extension = require(process.argv[1]);
  await extension.activate({ subscriptions: [] });
  await extension.deactivate();
  console.log(JSON.stringify(told));
})();
"""


def test_the_version_is_that_of_gpsfsm() -> None:
    assert MANIFEST["version"] == gpsfsm.__version__
    assert (FOLDER / MANIFEST["main"]).is_file()


def test_it_can_be_packed_as_the_documentation_says() -> None:
    readme = (FOLDER / "README.md").read_text()
    page = (FOLDER.parents[1] / "docs" / "editors.md").read_text()
    assert "](" not in readme  # a relative link keeps vsce from packing it
    commands = re.findall(r"^(?:make|code --install).*$", readme, re.MULTILINE)
    assert len(commands) == 2
    assert all(f"\n{command}\n" in page for command in commands)
    assert commands[-1].endswith(f"{MANIFEST['name']}-{MANIFEST['version']}.vsix")


@pytest.mark.skipif(NODE is None, reason="node is not installed")
@pytest.mark.parametrize("broken", ["", "1"])
def test_it_starts_the_server_and_stops_it(broken: str) -> None:
    assert NODE is not None
    subprocess.run([NODE, "--check", FOLDER / "extension.js"], check=True)
    done = subprocess.run(
        [NODE, "-e", LOAD, FOLDER / "extension.js"],
        env={"BROKEN": broken},
        capture_output=True,
        text=True,
        check=True,
    )
    document = json.loads(done.stdout)
    (made,) = [each for each in document if isinstance(each, dict)]
    defaults = MANIFEST["contributes"]["configuration"]["properties"]
    command = [made["server"]["command"], *made["server"]["args"]]
    assert command == defaults["gpsfsm.command"]["default"] == ["gpsfsm", "lsp"]
    assert made["client"]["initializationOptions"] == {"plans": ["plans/*.xml"]}
    assert {"language": "xml", "scheme": "file"} in made["client"]["documentSelector"]
    if broken:
        assert any(
            "pip install 'gpsfsm[lsp]'" in each for each in document if isinstance(each, str)
        )
    else:
        assert document[-2:] == ["started", "stopped"]
