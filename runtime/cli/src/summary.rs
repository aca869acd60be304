//! The short form of `wfl check`: what is solved, contact first, in lines made of the tables that `--all` prints.

use wfl::Diagnostic;
use wfl_tasks::Loaded;

use crate::table::{Table, cell};

/// Rows of one kind that are shown; of more the number is told.
const SHOWN: usize = 12;

/// The lines, with the name of what they are about in front of the first of each.
pub(crate) fn text(loaded: &Loaded, tables: &[Table]) -> String {
    let mut lines = Lines::default();
    let mut rows = |label: &'static str, table: &str, words: &dyn Fn(&Row<'_>) -> Option<String>| {
        let Some(table) = tables.iter().find(|t| t.name == table) else { return };
        lines.push(label, (0..table.rows.len()).filter_map(|k| words(&Row { table, k })).collect());
    };
    equations(&mut rows);
    bodies(&mut rows);
    rows("measures", "measures", &|r| Some(format!("{}: {} on {}", r.get("name"), r.get("what"), r.get("on"))));
    rows("outputs", "outputs", &|r| {
        Some(format!("{} {}: {} files, about {} MB", r.get("format"), r.get("file"), r.get("files"), r.get("about MB")))
    });
    lines.push("findings", vec![findings(&loaded.messages)]);
    let more = "tables: rules and classes of terms, statements of regions, parameters, the schedule of Newton";
    format!("{}\nwith --all: {more}\n", lines.text())
}

/// Adds the rows of a table under a label, each in words or not at all.
type Rows<'r> = dyn FnMut(&'static str, &str, &dyn Fn(&Row<'_>) -> Option<String>) + 'r;

/// What is solved, and how.
fn equations(rows: &mut Rows<'_>) {
    rows("contact", "contact", &|r| Some(format!("{} on {}: {}", r.get("terms"), r.get("on"), r.get("what it is"))));
    rows("accuracy", "accuracy", &|r| Some(r.all()));
    rows("unknowns", "fields", &|r| {
        let kind = r.get("kind");
        let solved = kind == "unknown" || kind == "multiplier";
        let word = if kind == "multiplier" { "multiplier, " } else { "" };
        let [name, shape, element, on] = ["name", "shape", "element", "on"].map(|c| r.get(c));
        let dofs = format!("{} of {} dofs free", r.get("free dofs"), r.get("dofs"));
        solved.then(|| format!("{name}: {word}{shape} {element} on {on}, {dofs}"))
    });
    rows("solver", "system", &|r| Some(format!("{} free dofs; {}", r.get("free"), r.get("solver"))));
    rows("ranks", "several ranks", &|r| Some(r.all()));
    rows("terms", "terms", &|r| {
        let [name, class, rule] = ["name", "class", "rule"].map(|c| r.get(c));
        // loads are told as statements
        let on = format!(" on {}", r.get("on"));
        let name_on = if name.ends_with(&on) { name.clone() } else { format!("{name}{on}") };
        (!name.starts_with("load")).then(|| format!("{name_on}: {class}, {rule}"))
    });
    for (label, kind) in [("fixed", "fixed"), ("loads", "load"), ("start", "start")] {
        rows(label, "conditions", &|r| (r.get("kind") == kind).then(|| r.get("statement")));
    }
    rows("steps", "conditions", &|r| {
        let (kind, statement) = (r.get("kind"), r.get("statement"));
        kind.ends_with("steps").then(|| format!("{kind}: {}", statement.trim_start_matches("steps ")))
    });
}

/// The mesh and its regions.
fn bodies(rows: &mut Rows<'_>) {
    rows("mesh", "mesh", &|r| {
        let [cells, kind, nodes, from, to] = ["cells", "kind", "nodes", "from", "to"].map(|c| r.get(c));
        Some(format!("{cells} {kind} cells, {nodes} nodes, from [{from}] to [{to}]"))
    });
    rows("cell sizes", "cell sizes", &|r| Some(format!("{} to {}", r.get("smallest cell"), r.get("largest cell"))));
    rows("refined", "refinements", &|r| Some(format!("{}: {} cells", r.get("statement"), r.get("cells after"))));
    rows("regions", "regions", &|r| {
        let [name, kind, members, size] = ["name", "kind", "members", "measure"].map(|c| r.get(c));
        let size = if size == "-" { String::new() } else { format!(", measure {size}") };
        let is_built_in = r.get("statement") == "-" && (name == "all" || name == "boundary");
        (!is_built_in).then(|| format!("{name}: {members} {kind}{size}"))
    });
    rows("normals", "interfaces", &|r| {
        let sheet = r.get("sheet");
        let sheet = if sheet == "1" { String::new() } else { format!(", sheet {sheet}") };
        Some(format!("of {}{sheet}: [{}]", r.get("name"), r.get("mean normal")))
    });
    rows("rims", "rims", &|r| {
        Some(format!("of {}, {}: {} without a condition", r.get("field"), r.get("rim"), r.get("without a condition")))
    });
    rows("tables", "tables", &|r| {
        Some(format!("{}: {} rows from {} to {}", r.get("file"), r.get("rows"), r.get("from"), r.get("to")))
    });
}

/// Codes of the messages, which are printed above.
fn findings(messages: &[Diagnostic]) -> String {
    let mut codes: Vec<&str> = messages.iter().map(|d| d.code.as_str()).collect();
    codes.sort_unstable();
    codes.dedup();
    if codes.is_empty() { "none".to_owned() } else { format!("{} (above; wfl explain {})", codes.join(", "), codes[0]) }
}

/// A row of a table.
struct Row<'t> {
    table: &'t Table,
    k: usize,
}

impl Row<'_> {
    /// The text in a column; empty if there is none.
    fn get(&self, column: &str) -> String {
        let place = self.table.columns.iter().position(|c| *c == column);
        place.map(|c| cell(&self.table.rows[self.k][c])).unwrap_or_default()
    }

    /// All of the row, with the names of the columns.
    fn all(&self) -> String {
        let cells = self.table.columns.iter().zip(&self.table.rows[self.k]);
        let told = cells.filter(|(_, value)| !value.is_null());
        told.map(|(column, value)| format!("{column} {}", cell(value))).collect::<Vec<_>>().join(", ")
    }
}

/// Lines with labels.
#[derive(Default)]
struct Lines(Vec<(&'static str, String)>);

impl Lines {
    fn push(&mut self, label: &'static str, mut told: Vec<String>) {
        let more = told.len().saturating_sub(SHOWN);
        // one more line is as long as telling that there is one
        if more > 1 {
            told.truncate(SHOWN);
            told.push(format!("and {more} more"));
        }
        let labels = std::iter::once(label).chain(std::iter::repeat(""));
        self.0.extend(labels.zip(told));
    }

    fn text(&self) -> String {
        let width = self.0.iter().map(|line| line.0.len()).max().unwrap_or(0);
        self.0.iter().map(|(label, told)| format!("{label:width$}  {told}\n")).collect()
    }
}
