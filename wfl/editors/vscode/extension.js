// Starts `wfl lsp` for scenes, runs and checks them in a terminal, and shows the files of the library.
'use strict';

const vscode = require('vscode');
const { LanguageClient, TransportKind } = require('vscode-languageclient/node');

let client;

function program() {
  return vscode.workspace.getConfiguration('wfl').get('command', 'wfl');
}

// A word for the shell of the terminal, in quotes.
function quoted(text) {
  return `"${text.replace(/(["\\$`])/g, process.platform === 'win32' ? '$1' : '\\$1')}"`;
}

function inTerminal(word, uri) {
  const scene = vscode.Uri.parse(uri).fsPath;
  const terminal =
    vscode.window.terminals.find((t) => t.name === 'WFL') || vscode.window.createTerminal({ name: 'WFL' });
  terminal.show(true);
  terminal.sendText(`${quoted(program())} ${word} ${quoted(scene)}`);
}

async function ofEditor(word) {
  const editor = vscode.window.activeTextEditor;
  if (!editor || editor.document.languageId !== 'wfl') {
    vscode.window.showInformationMessage('Open a scene first.');
    return;
  }
  await editor.document.save();
  inTerminal(word, editor.document.uri.toString());
}

async function start() {
  const server = { command: program(), args: ['lsp'], transport: TransportKind.stdio };
  client = new LanguageClient('wfl', 'WFL', server, {
    documentSelector: [{ scheme: 'file', language: 'wfl' }],
    synchronize: { fileEvents: vscode.workspace.createFileSystemWatcher('**/*.{wfl,msh,csv}') },
    middleware: {
      // runs and checks belong into a terminal, where they can be watched and stopped
      executeCommand: (command, args, next) => {
        if (command === 'wfl.run' || command === 'wfl.check') {
          return inTerminal(command.slice('wfl.'.length), args[0]);
        }
        return next(command, args);
      },
    },
  });
  try {
    await client.start();
  } catch (error) {
    vscode.window.showErrorMessage(
      `WFL: cannot start \`${program()} lsp\` (${error.message}). ` +
        'Install it with: cargo install --path runtime/cli, or set wfl.command.'
    );
  }
}

async function activate(context) {
  context.subscriptions.push(
    vscode.commands.registerCommand('wfl.runHere', () => ofEditor('run')),
    vscode.commands.registerCommand('wfl.checkHere', () => ofEditor('check')),
    vscode.commands.registerCommand('wfl.restart', async () => {
      await deactivate();
      await start();
    }),
    vscode.workspace.registerTextDocumentContentProvider('wfl-library', {
      provideTextDocumentContent: (uri) => client.sendRequest('wfl/library', { uri: uri.toString() }),
    })
  );
  await start();
}

async function deactivate() {
  if (client) {
    const old = client;
    client = undefined;
    await old.stop();
  }
}

module.exports = { activate, deactivate };
