//! The loop of the server: notifications change what is known (`state.rs`), requests are answered (`requests.rs`).

use crossbeam_channel::{Receiver, select, unbounded};
use lsp_server::{Connection, Message, Notification, Request, Response};
use lsp_types::{DidChangeTextDocumentParams, DidCloseTextDocumentParams, DidOpenTextDocumentParams};
use serde_json::Value;

use crate::{
    Options,
    capabilities::capabilities,
    check::{self, Checked},
    requests,
    state::{Ended, State},
};

/// Serves until the editor says good-bye.
pub(crate) fn serve(connection: &Connection, options: Options) -> Result<(), String> {
    let capabilities = serde_json::to_value(capabilities()).map_err(|e| e.to_string())?;
    connection.initialize(capabilities).map_err(|e| format!("no editor speaks on standard input: {e}"))?;
    let (jobs, found) = check::start(options.pause).map_err(|e| e.to_string())?;
    let (runs, ended) = unbounded();
    let state = State::new(connection.sender.clone(), options, jobs, runs);
    Server { connection, state }.listen(&found, &ended)
}

struct Server<'c> {
    connection: &'c Connection,
    state: State,
}

impl Server<'_> {
    fn listen(&mut self, found: &Receiver<Checked>, ended: &Receiver<Ended>) -> Result<(), String> {
        let connection = self.connection;
        loop {
            select! {
                recv(connection.receiver) -> message => match message {
                    Ok(Message::Request(request)) => {
                        if connection.handle_shutdown(&request).map_err(|e| e.to_string())? {
                            return Ok(());
                        }
                        self.request(request);
                    }
                    Ok(Message::Notification(notification)) => {
                        // a notification that cannot be read has nobody to be told to
                        let _ = self.notification(notification);
                    }
                    Ok(Message::Response(_)) => {}
                    // the editor is gone without a good-bye
                    Err(_) => return Ok(()),
                },
                recv(found) -> found => match found {
                    Ok(Ok(found)) => self.state.checked(found),
                    Ok(Err(broken)) => self.state.broke_down(&broken),
                    Err(_) => return Err("the thread that checks scenes has ended".to_owned()),
                },
                recv(ended) -> ended => {
                    if let Ok(ended) = ended {
                        self.state.show(ended.typ, ended.message);
                    }
                }
            }
        }
    }

    fn request(&mut self, request: Request) {
        let id = request.id.clone();
        let response = match requests::answer(&self.state, &request) {
            Ok(value) => Response::new_ok(id, value),
            Err(refused) => Response::new_err(id, refused.code, refused.why),
        };
        self.state.send(response);
    }

    fn notification(&mut self, notification: Notification) -> Result<(), serde_json::Error> {
        let params: Value = notification.params;
        match notification.method.as_str() {
            "textDocument/didOpen" => {
                let opened: DidOpenTextDocumentParams = serde_json::from_value(params)?;
                let document = opened.text_document;
                self.state.text(&document.uri, document.text, document.version);
            }
            "textDocument/didChange" => {
                let mut changed: DidChangeTextDocumentParams = serde_json::from_value(params)?;
                if let Some(last) = changed.content_changes.pop() {
                    let document = changed.text_document;
                    self.state.text(&document.uri, last.text, document.version);
                }
            }
            "textDocument/didClose" => {
                let closed: DidCloseTextDocumentParams = serde_json::from_value(params)?;
                self.state.close(&closed.text_document.uri);
            }
            "textDocument/didSave" | "workspace/didChangeWatchedFiles" => {
                self.state.files.forget();
                self.state.refresh_all();
            }
            _ => {}
        }
        Ok(())
    }
}
