//! A page: sections with texts, tables and charts in one HTML file that loads nothing.

use crate::{Chart, colour::style, text::escape};

/// A page that is read from above to below. Everything given to it is text, never markup.
#[derive(Clone, Debug)]
pub struct Page {
    title: String,
    lead: String,
    sections: Vec<Section>,
    again: Option<u32>,
}

/// A part of a page with a heading of its own.
#[derive(Clone, Debug)]
pub struct Section {
    title: String,
    parts: Vec<Part>,
}

#[derive(Clone, Debug)]
enum Part {
    Text(String),
    Warning(String),
    Failure(String),
    Facts(Vec<(String, String)>),
    Table(Table),
    Chart { svg: String, small: bool },
    Code { title: String, text: String },
}

/// A table with a head. Columns in which every entry is a number are set to the right.
#[derive(Clone, Debug, Default)]
pub struct Table {
    head: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table without rows.
    #[must_use]
    pub fn new<S: Into<String>>(head: impl IntoIterator<Item = S>) -> Self {
        Table { head: head.into_iter().map(Into::into).collect(), rows: Vec::new() }
    }

    /// Adds a row; missing entries are empty. `yes` and `no` are shown in the colours of good and bad.
    pub fn row<S: Into<String>>(&mut self, row: impl IntoIterator<Item = S>) {
        self.rows.push(row.into_iter().map(Into::into).collect());
    }

    /// True if it has no rows.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    fn html(&self) -> String {
        let number = |text: &str| text.starts_with(|c: char| c.is_ascii_digit() || matches!(c, '−' | '-' | '+' | '.'));
        let right = |k: usize| self.rows.iter().filter_map(|r| r.get(k)).all(|e| e.is_empty() || number(e));
        let class = |k: usize| if right(k) { r#" class="n""# } else { "" };
        let mut out = String::from(r#"<div class="scroll"><table><thead><tr>"#);
        for (k, name) in self.head.iter().enumerate() {
            out.push_str(&format!("<th{}>{}</th>", class(k), escape(name)));
        }
        out.push_str("</tr></thead><tbody>\n");
        for row in &self.rows {
            out.push_str("<tr>");
            for k in 0..self.head.len().max(row.len()) {
                let entry = row.get(k).map_or("", String::as_str);
                let shade = match entry {
                    "yes" => r#" class="ok""#,
                    "no" => r#" class="bad""#,
                    _ => class(k),
                };
                out.push_str(&format!("<td{shade}>{}</td>", escape(entry)));
            }
            out.push_str("</tr>\n");
        }
        out.push_str("</tbody></table></div>\n");
        out
    }
}

impl Section {
    /// An empty section.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Section { title: title.into(), parts: Vec::new() }
    }

    /// Adds a paragraph.
    #[must_use]
    pub fn text(mut self, text: impl Into<String>) -> Self {
        self.parts.push(Part::Text(text.into()));
        self
    }

    /// Adds something to look out for.
    #[must_use]
    pub fn warning(mut self, text: impl Into<String>) -> Self {
        self.parts.push(Part::Warning(text.into()));
        self
    }

    /// Adds something that went wrong.
    #[must_use]
    pub fn failure(mut self, text: impl Into<String>) -> Self {
        self.parts.push(Part::Failure(text.into()));
        self
    }

    /// Adds names with what they are, side by side.
    #[must_use]
    pub fn facts<A: Into<String>, B: Into<String>>(mut self, facts: impl IntoIterator<Item = (A, B)>) -> Self {
        self.parts.push(Part::Facts(facts.into_iter().map(|(a, b)| (a.into(), b.into())).collect()));
        self
    }

    /// Adds a table.
    #[must_use]
    pub fn table(mut self, table: Table) -> Self {
        self.parts.push(Part::Table(table));
        self
    }

    /// Adds a chart; charts that follow each other stand side by side where there is room.
    #[must_use]
    pub fn chart(mut self, chart: &Chart) -> Self {
        self.parts.push(Part::Chart { svg: chart.embedded(), small: false });
        self
    }

    /// Adds a chart of many: three or more stand side by side where there is room.
    #[must_use]
    pub fn small(mut self, chart: &Chart) -> Self {
        self.parts.push(Part::Chart { svg: chart.embedded(), small: true });
        self
    }

    /// Adds a text as it is, in letters of equal width, to be opened by the reader.
    #[must_use]
    pub fn code(mut self, title: impl Into<String>, text: impl Into<String>) -> Self {
        self.parts.push(Part::Code { title: title.into(), text: text.into() });
        self
    }

    /// True if nothing was added.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.parts.is_empty()
    }

    fn html(&self, number: usize) -> String {
        let mut out = format!("<section id=\"s{number}\"><h2>{}</h2>\n", escape(&self.title));
        let mut open = "";
        for part in &self.parts {
            let needed = part.room();
            if needed != open {
                out.push_str(if open.is_empty() { "" } else { "</div>\n" });
                out.push_str(needed);
                open = needed;
            }
            out.push_str(&part.html());
        }
        out.push_str(if open.is_empty() { "" } else { "</div>\n" });
        out.push_str("</section>\n");
        out
    }
}

impl Part {
    /// The box around parts of this kind that follow each other.
    fn room(&self) -> &'static str {
        match self {
            Part::Chart { small: false, .. } => "<div class=\"charts\">\n",
            Part::Chart { small: true, .. } => "<div class=\"charts small\">\n",
            _ => "",
        }
    }

    fn html(&self) -> String {
        match self {
            Part::Text(text) => format!("<p>{}</p>\n", escape(text)),
            Part::Warning(text) => format!("<div class=\"warning\">{}</div>\n", escape(text)),
            Part::Failure(text) => format!("<div class=\"failure\" role=\"alert\">{}</div>\n", escape(text)),
            Part::Facts(facts) => {
                let one = |(name, fact): &(String, String)| {
                    format!("<div><dt>{}</dt><dd>{}</dd></div>\n", escape(name), escape(fact))
                };
                format!("<dl>{}</dl>\n", facts.iter().map(one).collect::<String>())
            }
            Part::Table(table) => table.html(),
            Part::Chart { svg, .. } => format!("<figure>{svg}</figure>\n"),
            Part::Code { title, text } => {
                format!("<details><summary>{}</summary><pre>{}</pre></details>\n", escape(title), escape(text))
            }
        }
    }
}

impl Page {
    /// An empty page.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Page { title: title.into(), lead: String::new(), sections: Vec::new(), again: None }
    }

    /// The sentence under the title.
    #[must_use]
    pub fn lead(mut self, text: impl Into<String>) -> Self {
        self.lead = text.into();
        self
    }

    /// A browser loads the page again after so many seconds: its file changes.
    #[must_use]
    pub fn again(mut self, seconds: u32) -> Self {
        self.again = Some(seconds);
        self
    }

    /// Adds a section; an empty one is left out.
    #[must_use]
    pub fn section(mut self, section: Section) -> Self {
        if !section.is_empty() {
            self.sections.push(section);
        }
        self
    }

    /// The file.
    #[must_use]
    pub fn html(&self) -> String {
        let title = escape(&self.title);
        let again = self.again.map_or_else(String::new, |s| format!("<meta http-equiv=\"refresh\" content=\"{s}\">"));
        let mut out = format!(
            "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">{again}\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\n\
             <meta name=\"generator\" content=\"WFL\"><title>{title}</title>\n<style>{}{}</style></head>\n<body><main>\n\
             <h1>{title}</h1>\n<p class=\"lead\">{}</p>\n<nav>",
            include_str!("page.css"),
            style(),
            escape(&self.lead),
        );
        for (k, section) in self.sections.iter().enumerate() {
            out.push_str(&format!("<a href=\"#s{k}\">{}</a>\n", escape(&section.title)));
        }
        out.push_str("</nav>\n");
        for (k, section) in self.sections.iter().enumerate() {
            out.push_str(&section.html(k));
        }
        out.push_str(&format!(
            "</main><div id=\"tip\" role=\"tooltip\"></div>\n<script>{}</script></body></html>\n",
            include_str!("page.js")
        ));
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_loads_nothing_and_keeps_markup_as_text() {
        let mut table = Table::new(["run", "error"]);
        table.row(["<script>", "1e-3"]);
        let chart = Chart::new("a & b");
        let section = Section::new("<one>").text("x < y").table(table).chart(&chart).chart(&chart).warning("!");
        let html = Page::new("T<").section(section).section(Section::new("empty")).html();
        assert!(!html.contains("<one>") && !html.contains("<script>\"") && !html.contains("empty"));
        assert!(html.contains("<td>&lt;script&gt;</td><td class=\"n\">1e-3</td>"), "{html}");
        assert_eq!(html.matches("<div class=\"charts\">").count(), 1);
        let outside = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!outside.contains("http") && !outside.contains("src=") && !outside.contains("url("));
    }
}
