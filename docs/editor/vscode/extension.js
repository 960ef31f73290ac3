// Starts `stc language-server` and lets the editor talk to it.
const { workspace } = require("vscode");
const { LanguageClient, TransportKind } = require("vscode-languageclient/node");

let client;

exports.activate = () => {
  const command = workspace.getConfiguration("stc").get("command");
  const server = { command, args: ["language-server"], transport: TransportKind.stdio };
  client = new LanguageClient("stc", "Spacetime constraints", server, {
    documentSelector: [{ language: "stc" }],
  });
  return client.start();
};

exports.deactivate = () => client && client.stop();
