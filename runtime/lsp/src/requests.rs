//! Requests by their names: parameters are read, the text is found, a feature answers.

use lsp_server::{ErrorCode, Request};
use lsp_types::{
    CodeActionParams, CodeLensParams, CompletionParams, DocumentFormattingParams, DocumentSymbolParams,
    ExecuteCommandParams, FoldingRangeParams, GotoDefinitionParams, HoverParams, InlayHintParams, ReferenceParams,
    RenameParams, SemanticTokensParams, SignatureHelpParams, TextDocumentIdentifier, TextDocumentPositionParams, Uri,
};
use serde::{Serialize, de::DeserializeOwned};
use serde_json::Value;

use crate::{
    features::{actions, complete, format, hints, hover, navigate, outline, rename, signature, tokens},
    places,
    state::State,
    view::{Refused, View, view},
};

/// Reads the parameters of a request and asks a feature about its text; a text that is not known has no answer.
fn about<P: DeserializeOwned, R: Serialize>(
    state: &State,
    request: &Request,
    document: impl Fn(&P) -> &TextDocumentIdentifier,
    feature: impl Fn(&View<'_>, &P) -> Result<R, Refused>,
) -> Result<Value, Refused> {
    let params: P = read(request)?;
    let Some(view) = view(state, &document(&params).uri) else { return Ok(Value::Null) };
    written(feature(&view, &params)?)
}

fn read<P: DeserializeOwned>(request: &Request) -> Result<P, Refused> {
    serde_json::from_value(request.params.clone())
        .map_err(|e| Refused { code: ErrorCode::InvalidParams as i32, why: e.to_string() })
}

fn written(answer: impl Serialize) -> Result<Value, Refused> {
    serde_json::to_value(answer).map_err(|e| Refused { code: ErrorCode::InternalError as i32, why: e.to_string() })
}

/// The answer to a request.
pub(crate) fn answer(state: &State, request: &Request) -> Result<Value, Refused> {
    match request.method.as_str() {
        "textDocument/hover" => about(
            state,
            request,
            |p: &HoverParams| &p.text_document_position_params.text_document,
            |v, p| Ok(hover::hover(v, p.text_document_position_params.position)),
        ),
        "textDocument/definition" => about(
            state,
            request,
            |p: &GotoDefinitionParams| &p.text_document_position_params.text_document,
            |v, p| Ok(navigate::definition(v, p.text_document_position_params.position)),
        ),
        "textDocument/references" => about(
            state,
            request,
            |p: &ReferenceParams| &p.text_document_position.text_document,
            |v, p| Ok(navigate::references(v, p.text_document_position.position, &p.context)),
        ),
        "textDocument/documentHighlight" => about(
            state,
            request,
            |p: &TextDocumentPositionParams| &p.text_document,
            |v, p| Ok(navigate::highlights(v, p.position)),
        ),
        "textDocument/prepareRename" => about(
            state,
            request,
            |p: &TextDocumentPositionParams| &p.text_document,
            |v, p| rename::prepare(v, p.position),
        ),
        "textDocument/rename" => about(
            state,
            request,
            |p: &RenameParams| &p.text_document_position.text_document,
            |v, p| rename::rename(v, p.text_document_position.position, &p.new_name),
        ),
        _ => more(state, request),
    }
}

/// Requests about whole texts and about what is being written.
fn more(state: &State, request: &Request) -> Result<Value, Refused> {
    match request.method.as_str() {
        "textDocument/completion" => about(
            state,
            request,
            |p: &CompletionParams| &p.text_document_position.text_document,
            |v, p| Ok(complete::complete(v, p.text_document_position.position)),
        ),
        "textDocument/signatureHelp" => about(
            state,
            request,
            |p: &SignatureHelpParams| &p.text_document_position_params.text_document,
            |v, p| Ok(signature::signature(v, p.text_document_position_params.position)),
        ),
        "textDocument/documentSymbol" => {
            about(state, request, |p: &DocumentSymbolParams| &p.text_document, |v, _| Ok(outline::symbols(v)))
        }
        "textDocument/foldingRange" => {
            about(state, request, |p: &FoldingRangeParams| &p.text_document, |v, _| Ok(outline::folds(v)))
        }
        "textDocument/codeLens" => {
            about(state, request, |p: &CodeLensParams| &p.text_document, |v, _| Ok(outline::lenses(v)))
        }
        "textDocument/semanticTokens/full" => {
            about(state, request, |p: &SemanticTokensParams| &p.text_document, |v, _| Ok(tokens::tokens(v)))
        }
        "textDocument/formatting" => {
            about(state, request, |p: &DocumentFormattingParams| &p.text_document, |v, _| format::format(v))
        }
        "textDocument/inlayHint" => {
            about(state, request, |p: &InlayHintParams| &p.text_document, |v, p| Ok(hints::hints(v, p.range)))
        }
        "textDocument/codeAction" => {
            about(state, request, |p: &CodeActionParams| &p.text_document, |v, p| Ok(actions::actions(v, p.range)))
        }
        "workspace/executeCommand" => command(state, request),
        "wfl/library" => library(request),
        other => {
            let why = format!("this server does not answer {other}");
            Err(Refused { code: ErrorCode::MethodNotFound as i32, why })
        }
    }
}

/// `wfl.check` and `wfl.run` of a scene, whose address is the argument.
fn command(state: &State, request: &Request) -> Result<Value, Refused> {
    let params: ExecuteCommandParams = read(request)?;
    let argument = params.arguments.first().cloned().unwrap_or_default();
    let uri: Uri = serde_json::from_value(argument).map_err(|e| Refused::new(format!("which scene? {e}")))?;
    let path = places::file(&uri).ok_or_else(|| Refused::new("the scene is no file: save it first"))?;
    let root = state.files.root(&path);
    match params.command.as_str() {
        outline::CHECK => state.ask(&root),
        outline::RUN => state.run(&root).map_err(Refused::new)?,
        other => return Err(Refused::new(format!("there is no command {other}"))),
    }
    Ok(Value::Null)
}

/// The text of a file of the library, `{"uri": "wfl-library:/contact.wfl"}`.
fn library(request: &Request) -> Result<Value, Refused> {
    let params: TextDocumentIdentifier = read(request)?;
    let text = places::library_text(params.uri.as_str());
    text.map(Value::from).ok_or_else(|| Refused::new("the library has no such file"))
}
