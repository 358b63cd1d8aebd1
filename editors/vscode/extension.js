"use strict";

const vscode = require("vscode");
const { LanguageClient, TransportKind } = require("vscode-languageclient/node");

let client;

/** Start the server as the settings say, and tell the user if it cannot be started. */
async function start() {
  const settings = vscode.workspace.getConfiguration("gpsfsm");
  const [command, ...args] = settings.get("command");
  client = new LanguageClient(
    "gpsfsm",
    "gpsfsm",
    { command, args, transport: TransportKind.stdio },
    {
      documentSelector: [
        { scheme: "file", language: "xml" },
        { scheme: "untitled", language: "xml" },
      ],
      initializationOptions: { plans: settings.get("plans") },
    },
  );
  try {
    await client.start();
  } catch (error) {
    client = undefined;
    vscode.window.showErrorMessage(
      `gpsfsm: '${[command, ...args].join(" ")}' cannot be started (${error.message}). ` +
        "Install it with: pip install 'gpsfsm[lsp]', or set gpsfsm.command.",
    );
  }
}

async function stop() {
  const running = client;
  client = undefined;
  await running?.stop();
}

async function restart() {
  await stop();
  await start();
}

async function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand("gpsfsm.restart", restart),
    vscode.workspace.onDidChangeConfiguration((event) => {
      if (event.affectsConfiguration("gpsfsm")) {
        return restart();
      }
    }),
  );
  await start();
}

module.exports = { activate, deactivate: stop };
