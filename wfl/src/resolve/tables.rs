//! `table("history.csv", t)`: the files of tables, read once each. What a table is stands in [`crate::tables`].

use std::sync::Arc;

use super::Resolver;
use crate::{
    ast::{Argument, Expr, ExprKind},
    codes::Code,
    diag::Diagnostic,
    render::at_expr,
    source::Span,
    tables::{NoTable, Table},
    walk::children,
};

/// How it is called.
const USAGE: &str = "table(\"history.csv\", t), or with several columns: table(\"history.csv\", t, \"q\")";

impl Resolver<'_> {
    /// Reads the files that these expressions name; `None` after a message.
    pub(super) fn read_tables(&mut self, expressions: &[&Expr]) -> Option<()> {
        let mut calls = Vec::new();
        expressions.iter().for_each(|e| each_call(e, &mut calls));
        let mut complete = Some(());
        for (e, arguments) in calls {
            complete = self.table(e, arguments).and(complete);
        }
        complete
    }

    /// One call: its words, its file, its column.
    fn table(&mut self, e: &Expr, arguments: &[Argument]) -> Option<()> {
        let form = match arguments {
            [Argument::Text(file, at), Argument::Expr(_)] => Some((file, *at, None)),
            [Argument::Text(file, at), Argument::Expr(_), Argument::Text(column, place)] => {
                Some((file, *at, Some((column.as_str(), *place))))
            }
            _ => None,
        };
        let Some((file, at, column)) = form else {
            let d = Diagnostic::new(
                Code::E105,
                "`table` takes a file in quotes and a number; a column in quotes may follow",
            );
            self.diagnostics.push(at_expr(d.help(USAGE), e, &self.expander.expansions, ""));
            return None;
        };
        let table = self.table_of(file, at)?;
        let Err((why, help)) = table.curve(column.map(|c| c.0)) else { return Some(()) };
        let d = Diagnostic::new(Code::E446, why).at(column.map_or(at, |c| c.1), "").help(help);
        self.tell_once(d)
    }

    /// The table of a file; a file is read once.
    fn table_of(&mut self, file: &str, at: Span) -> Option<Arc<Table>> {
        if let Some(known) = self.script.tables.iter().find(|t| t.name == file) {
            return Some(Arc::clone(known));
        }
        let text = match self.loader.table(file) {
            Ok(text) => text,
            Err(not) => {
                let code = if not.outside { Code::E217 } else { Code::E446 };
                let d = Diagnostic::new(code, format!("cannot read \"{file}\": {}", not.why)).at(at, "");
                let help =
                    not.help.or_else(|| not.missing.then(|| "files are named as seen from the scene".to_owned()));
                return self.tell_once(match help {
                    Some(help) => d.help(help),
                    None => d,
                });
            }
        };
        match Table::parse(file, text.into(), at) {
            Ok(table) => {
                let table = Arc::new(table);
                self.script.tables.push(Arc::clone(&table));
                Some(table)
            }
            Err(NoTable { line, why, help }) => {
                let line = line.map_or(String::new(), |l| format!(", line {l}"));
                let d = Diagnostic::new(Code::E446, format!("\"{file}\" is no table{line}: {why}"));
                self.tell_once(d.at(at, "").help(help))
            }
        }
    }

    /// A macro that reads a file may be used often: one message suffices.
    fn tell_once<T>(&mut self, d: Diagnostic) -> Option<T> {
        if !self.diagnostics.contains(&d) {
            self.diagnostics.push(d);
        }
        None
    }
}

/// The calls of `table` in an expression.
fn each_call<'e>(e: &'e Expr, found: &mut Vec<(&'e Expr, &'e [Argument])>) {
    if let ExprKind::Call(callee, arguments) = &e.kind
        && matches!(&callee.kind, ExprKind::Name(word) if word == "table")
    {
        found.push((e, arguments));
    }
    children(e, &mut |c| each_call(c, found));
}
