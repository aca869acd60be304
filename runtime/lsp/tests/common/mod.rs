//! An editor that talks to the server over its standard input and output.
#![allow(dead_code, reason = "each suite takes a part of it")]

use std::{
    collections::BTreeMap,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, Command, Stdio},
    sync::mpsc::{Receiver, channel},
    time::Duration,
};

use serde_json::{Value, json};

/// Longer than any answer takes on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// An editor with a server.
pub(crate) struct Editor {
    server: Child,
    input: ChildStdin,
    output: Receiver<Value>,
    next: i64,
    /// The last messages of each file, by its name.
    messages: BTreeMap<String, Vec<Value>>,
    /// The version of the text that they are about.
    told: BTreeMap<String, i64>,
    versions: BTreeMap<String, i64>,
    /// What was shown to the user.
    pub(crate) shown: Vec<String>,
    /// The answer to `initialize`.
    pub(crate) capabilities: Value,
    folder: PathBuf,
    texts: BTreeMap<String, String>,
    /// Answered requests.
    pub(crate) answered: usize,
}

impl Editor {
    /// Starts a server for the files of an empty folder; the name is that of one test.
    pub(crate) fn new(name: &str) -> Self {
        Self::with_words(name, &[])
    }

    /// The same with arguments of the server.
    pub(crate) fn with_words(name: &str, words: &[&Path]) -> Self {
        let folder = std::env::temp_dir().join(format!("wfl-lsp-{name}-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let folder = std::fs::canonicalize(folder).expect("a temporary folder");
        let mut server = Command::new(env!("CARGO_BIN_EXE_wfl-lsp"))
            .args(words)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the server starts");
        let input = server.stdin.take().expect("a pipe");
        let mut from = BufReader::new(server.stdout.take().expect("a pipe"));
        let (send, output) = channel();
        std::thread::spawn(move || {
            while let Some(message) = message(&mut from) {
                if send.send(message).is_err() {
                    break;
                }
            }
        });
        let mut editor = Self {
            server,
            input,
            output,
            next: 0,
            messages: BTreeMap::new(),
            told: BTreeMap::new(),
            versions: BTreeMap::new(),
            shown: Vec::new(),
            capabilities: Value::Null,
            folder,
            texts: BTreeMap::new(),
            answered: 0,
        };
        editor.capabilities = editor.ask("initialize", json!({"capabilities": {}}));
        editor.tell("initialized", json!({}));
        editor
    }

    /// Writes a file beside the others.
    pub(crate) fn write(&self, name: &str, text: &str) {
        std::fs::write(self.folder.join(name), text).expect("a temporary file");
    }

    /// Puts a file of the examples beside the others.
    pub(crate) fn copy(&self, path: &str) {
        let name = path.rsplit('/').next().unwrap_or(path);
        std::fs::copy(examples().join(path), self.folder.join(name)).expect("a file of the examples");
    }

    pub(crate) fn uri(&self, name: &str) -> String {
        format!("file://{}", self.folder.join(name).display())
    }

    /// Opens a text, which need not be on disc.
    pub(crate) fn open(&mut self, name: &str, text: &str) {
        let version = self.next_version(name);
        let document = json!({"uri": self.uri(name), "languageId": "wfl", "version": version, "text": text});
        self.tell("textDocument/didOpen", json!({ "textDocument": document }));
        self.texts.insert(name.to_owned(), text.to_owned());
    }

    /// Gives an open text another content.
    pub(crate) fn change(&mut self, name: &str, text: &str) {
        let version = self.next_version(name);
        let document = json!({"uri": self.uri(name), "version": version});
        self.tell("textDocument/didChange", json!({"textDocument": document, "contentChanges": [{"text": text}]}));
        self.texts.insert(name.to_owned(), text.to_owned());
    }

    fn next_version(&mut self, name: &str) -> i64 {
        let version = self.versions.entry(name.to_owned()).or_insert(0);
        *version += 1;
        *version
    }

    pub(crate) fn text(&self, name: &str) -> &str {
        &self.texts[name]
    }

    /// The position of the first character of `needle`, moved by some characters of the same line.
    pub(crate) fn at(&self, name: &str, needle: &str, by: u64) -> Value {
        let text = self.text(name);
        let start = text.find(needle).unwrap_or_else(|| panic!("{needle} is not in {name}"));
        let line = text[..start].matches('\n').count();
        let column = text[..start].rsplit('\n').next().unwrap_or("").encode_utf16().count() as u64;
        json!({"line": line, "character": column + by})
    }

    /// Asks about a place of a text.
    pub(crate) fn ask_at(&mut self, method: &str, name: &str, needle: &str, by: u64) -> Value {
        let position = self.at(name, needle, by);
        let uri = self.uri(name);
        let context = json!({"includeDeclaration": true, "triggerKind": 1, "isRetrigger": false});
        self.ask(method, json!({"textDocument": {"uri": uri}, "position": position, "context": context}))
    }

    /// Asks about a whole text.
    pub(crate) fn ask_of(&mut self, method: &str, name: &str) -> Value {
        let uri = self.uri(name);
        let range = json!({"start": {"line": 0, "character": 0}, "end": {"line": 99_999, "character": 0}});
        let options = json!({"tabSize": 4, "insertSpaces": true});
        let context = json!({"diagnostics": []});
        self.ask(method, json!({"textDocument": {"uri": uri}, "range": range, "options": options, "context": context}))
    }

    /// The result of a request.
    pub(crate) fn ask(&mut self, method: &str, params: Value) -> Value {
        let answer = self.answer(method, params);
        assert!(answer.get("error").is_none(), "{method}: {answer}");
        answer["result"].clone()
    }

    /// Asks and takes any answer.
    pub(crate) fn tell_and_wait(&mut self, method: &str, params: Value) {
        self.answer(method, params);
    }

    /// Why a request was refused.
    pub(crate) fn refused(&mut self, method: &str, params: Value) -> String {
        let answer = self.answer(method, params);
        answer["error"]["message"].as_str().unwrap_or_else(|| panic!("{method} was answered: {answer}")).to_owned()
    }

    fn answer(&mut self, method: &str, params: Value) -> Value {
        self.next += 1;
        let id = self.next;
        self.send(&json!({"jsonrpc": "2.0", "id": id, "method": method, "params": params}));
        loop {
            let message = self.receive();
            if message["id"] == json!(id) {
                self.answered += 1;
                return message;
            }
        }
    }

    pub(crate) fn tell(&mut self, method: &str, params: Value) {
        self.send(&json!({"jsonrpc": "2.0", "method": method, "params": params}));
    }

    fn send(&mut self, message: &Value) {
        let text = message.to_string();
        write!(self.input, "Content-Length: {}\r\n\r\n{text}", text.len()).expect("the server listens");
        self.input.flush().expect("the server listens");
    }

    /// The next message; messages of files and lines shown are kept.
    pub(crate) fn receive(&mut self) -> Value {
        let message = self.output.recv_timeout(PATIENCE).expect("the server answers");
        match message["method"].as_str() {
            Some("textDocument/publishDiagnostics") => self.keep(&message["params"]),
            Some("window/showMessage") => {
                self.shown.push(message["params"]["message"].as_str().unwrap_or("").to_owned());
            }
            _ => {}
        }
        message
    }

    /// The messages of a file, once they are as wanted. Those of an open text are about it as it is now.
    pub(crate) fn messages_when(&mut self, name: &str, wanted: impl Fn(&[Value]) -> bool) -> Vec<Value> {
        loop {
            let now = self.versions.get(name).is_none_or(|v| self.told.get(name).is_none_or(|t| t == v || *t == 0));
            if let Some(list) = self.messages.get(name)
                && now
                && wanted(list)
            {
                return list.clone();
            }
            let last = self.messages.get(name).cloned();
            match self.output.recv_timeout(PATIENCE) {
                Ok(message) if message["method"] == "textDocument/publishDiagnostics" => self.keep(&message["params"]),
                Ok(_) => {}
                Err(_) => panic!("{name} has other messages: {last:#?}"),
            }
        }
    }

    fn keep(&mut self, published: &Value) {
        let name = published["uri"].as_str().unwrap_or("").rsplit('/').next().unwrap_or("").to_owned();
        self.told.insert(name.clone(), published["version"].as_i64().unwrap_or(0));
        self.messages.insert(name, published["diagnostics"].as_array().cloned().unwrap_or_default());
    }

    /// The messages of a text that was just opened or changed: the first that are about it as it is now.
    pub(crate) fn next_messages(&mut self, name: &str) -> Vec<Value> {
        while self.told.get(name) != self.versions.get(name) {
            self.receive();
        }
        self.messages[name].clone()
    }

    /// A text with changes of the protocol.
    pub(crate) fn changed(&self, name: &str, edits: &Value) -> String {
        let text = self.text(name);
        let offset = |p: &Value| {
            let line = p["line"].as_u64().expect("a line") as usize;
            let start: usize = text.split_inclusive('\n').take(line).map(str::len).sum();
            // the texts of these tests are ASCII where they are changed
            start + p["character"].as_u64().expect("a column") as usize
        };
        let mut list: Vec<(usize, usize, String)> = edits
            .as_array()
            .expect("a list of changes")
            .iter()
            .map(|e| {
                let new = e["newText"].as_str().expect("a text").to_owned();
                (offset(&e["range"]["start"]), offset(&e["range"]["end"]), new)
            })
            .collect();
        list.sort_by_key(|e| std::cmp::Reverse(e.0));
        let mut out = text.to_owned();
        for (start, end, new) in list {
            out.replace_range(start..end, &new);
        }
        out
    }

    /// Says good-bye; the server ends well.
    pub(crate) fn close(mut self) {
        self.ask("shutdown", Value::Null);
        self.tell("exit", Value::Null);
        let status = self.server.wait().expect("the server ends");
        assert!(status.success(), "{status}");
    }
}

impl Drop for Editor {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}

/// One message of the protocol; none at the end.
fn message(from: &mut impl BufRead) -> Option<Value> {
    let mut length = 0;
    loop {
        let mut line = String::new();
        if from.read_line(&mut line).ok()? == 0 {
            return None;
        }
        if line.trim().is_empty() {
            break;
        }
        if let Some(n) = line.trim().strip_prefix("Content-Length: ") {
            length = n.parse().ok()?;
        }
    }
    let mut bytes = vec![0; length];
    from.read_exact(&mut bytes).ok()?;
    serde_json::from_slice(&bytes).ok()
}

/// The folder of the examples.
pub(crate) fn examples() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples")
}

/// A scene of the examples.
pub(crate) fn example(path: &str) -> String {
    let path = examples().join(path);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}
