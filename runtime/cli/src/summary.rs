//! The short form of `wfl check`: what is solved, contact first, in lines made of the tables that `--all` prints.

use wfl::Diagnostic;
use wfl_tasks::Loaded;

use crate::table::{Table, cell};

/// Rows of one kind that are shown; of more the number is told.
const SHOWN: usize = 12;

/// The lines, with the name of what they are about in front of the first of each.
pub(crate) fn text(loaded: &Loaded, tables: &[Table]) -> String {
    let find = |name: &str| tables.iter().find(|t| t.name == name);
    let mut lines = Lines::default();
    let mut rows = |label: &'static str, table: &str, words: &dyn Fn(&Row<'_>) -> Option<String>| {
        let Some(table) = find(table) else { return };
        let told = (0..table.rows.len()).filter_map(|k| words(&Row { table, k })).collect();
        lines.push(label, told);
    };
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
        (!name.starts_with("load")).then(|| format!("{name} on {}: {class}, {rule}", r.get("on")))
    });
    for (label, kind) in [("fixed", "fixed"), ("loads", "load"), ("start", "start")] {
        rows(label, "conditions", &|r| (r.get("kind") == kind).then(|| r.get("statement")));
    }
    rows("steps", "conditions", &|r| {
        r.get("kind")
            .ends_with("steps")
            .then(|| format!("{}: {}", r.get("kind"), r.get("statement").trim_start_matches("steps ")))
    });
    rows("mesh", "mesh", &|r| {
        let [cells, kind, nodes, from, to] = ["cells", "kind", "nodes", "from", "to"].map(|c| r.get(c));
        Some(format!("{cells} {kind} cells, {nodes} nodes, from [{from}] to [{to}]"))
    });
    rows("cell sizes", "cell sizes", &|r| Some(format!("{} to {}", r.get("smallest cell"), r.get("largest cell"))));
    rows("refined", "refinements", &|r| Some(format!("{}: {} cells", r.get("statement"), r.get("cells after"))));
    rows("regions", "regions", &|r| {
        let [name, kind, members, size] = ["name", "kind", "members", "measure"].map(|c| r.get(c));
        let size = if size == "-" { String::new() } else { format!(", measure {size}") };
        (r.get("statement") != "-" || name != "all" && name != "boundary")
            .then(|| format!("{name}: {members} {kind}{size}"))
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
    rows("measures", "measures", &|r| Some(format!("{}: {} on {}", r.get("name"), r.get("what"), r.get("on"))));
    rows("outputs", "outputs", &|r| {
        Some(format!("{} {}: {} files, about {} MB", r.get("format"), r.get("file"), r.get("files"), r.get("about MB")))
    });
    lines.push("findings", vec![findings(&loaded.messages)]);
    format!(
        "{}\nwfl check {} --all prints tables: rules and classes of terms, statements of regions, parameters, the schedule of Newton\n",
        lines.text(),
        loaded.name
    )
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
