//! Each scene and each command of the guide, as a reader would type them in.
//!
//! A block "```wfl name.wfl", "```csv name.csv" or "```inp name.inp" is written to that file, "```diff old.wfl new.wfl" writes `new.wfl` with the
//! lines replaced one by one, and further new ones at its end. In a block "```console" each line after `$ ` is a command
//! that must succeed, and the lines below it are in what it prints.

use crate::common::Folder;

/// Pages with snippets.
const PAGES: [&str; 15] = [
    "axisymmetry",
    "cookbook",
    "first_hour",
    "from_calculix",
    "flow_in_faults",
    "from_getfem",
    "from_moose",
    "from_ufl",
    "gradients",
    "incremental_friction",
    "initial_stress",
    "regions",
    "restart",
    "time",
    "units",
];

/// A block of a page: the words behind the fence, and its lines.
struct Block {
    head: Vec<String>,
    lines: Vec<String>,
}

fn blocks(page: &str) -> Vec<Block> {
    let text = self::page(page);
    let (mut found, mut open): (Vec<Block>, Option<Block>) = (Vec::new(), None);
    for line in text.lines() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(_), Some(_)) => found.extend(open.take()),
            (Some(head), None) => {
                open = Some(Block { head: head.split(' ').map(str::to_owned).collect(), lines: Vec::new() });
            }
            (None, Some(block)) => block.lines.push(line.to_owned()),
            (None, None) => {}
        }
    }
    found
}

/// Words of a command line; quotes hold words together.
fn words(line: &str) -> Vec<String> {
    let parts = line.split('"').enumerate();
    let words = parts.flat_map(|(k, part)| match k % 2 {
        0 => part.split_whitespace().map(str::to_owned).collect(),
        _ => vec![part.to_owned()],
    });
    words.collect()
}

fn changed(folder: &Folder, block: &Block) {
    let [_, old, new] = &block.head[..] else { panic!("a diff names two files: {:?}", block.head) };
    let mut text = std::fs::read_to_string(folder.0.join(old)).expect("a file that the page has shown");
    let lines = |sign: &str| block.lines.iter().filter_map(|l| l.strip_prefix(sign)).collect::<Vec<_>>();
    let (gone, new_lines) = (lines("-"), lines("+"));
    for (out, into) in gone.iter().zip(&new_lines) {
        assert!(text.contains(out), "{old} has no line {out}");
        text = text.replace(out, into);
    }
    for line in new_lines.iter().skip(gone.len()) {
        text.push_str(line);
        text.push('\n');
    }
    folder.write(new, &text);
}

/// Runs the commands of a block.
fn typed(folder: &Folder, page: &str, block: &Block) -> usize {
    let (mut said, mut commands) = (String::new(), 0);
    for line in &block.lines {
        if let Some(command) = line.strip_prefix("$ wfl ") {
            let words = words(command);
            let done = folder.wfl(&words.iter().map(String::as_str).collect::<Vec<_>>());
            said = format!("{}{}", String::from_utf8_lossy(&done.stdout), String::from_utf8_lossy(&done.stderr));
            assert!(done.status.success(), "{page}: wfl {command}: {said}");
            commands += 1;
        } else {
            assert!(said.contains(line.as_str()), "{page}: `{line}` is not in {said}");
        }
    }
    commands
}

#[test]
fn every_scene_and_command_of_the_guide_works_as_it_is_written() {
    for page in PAGES {
        let folder = Folder::new(&format!("guide_{page}"));
        let (mut scenes, mut commands) = (0, 0);
        for block in blocks(page) {
            match block.head[0].as_str() {
                "wfl" => {
                    folder.write(&block.head[1], &(block.lines.join("\n") + "\n"));
                    scenes += 1;
                }
                "csv" | "inp" => drop(folder.write(&block.head[1], block.lines.join("\n") + "\n")),
                "diff" => changed(&folder, &block),
                "console" => commands += typed(&folder, page, &block),
                _ => {}
            }
        }
        assert!(scenes > 0 && commands > 0, "{page} has {scenes} scenes and {commands} commands");
    }
}

/// The page of the guide with this name.
fn page(name: &str) -> String {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("../../docs/{name}.md"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn every_line_that_a_run_with_contact_prints_is_explained() {
    let folder = Folder::new("guide_lines");
    assert!(folder.wfl(&["new", "fault"]).status.success());
    let done = folder.wfl(&["run", "fault.wfl"]);
    let said = String::from_utf8_lossy(&done.stdout).into_owned();
    let page = page("reading_the_run");
    // measures have a `=` before any colon, and are the scene's own
    let lines = said.lines().skip(1).filter(|l| l.find(':').is_some_and(|colon| !l[..colon].contains(" = ")));
    let mut explained = 0;
    for line in lines {
        let words: Vec<&str> = line.split([':', '`']).next().unwrap_or_default().split_whitespace().collect();
        // `equilibrium of uL, uR`, `time 0.1 s`: the words before names and numbers
        let own = words.iter().take_while(|w| w.chars().all(|c| c.is_ascii_lowercase())).take(2);
        let start = own.copied().collect::<Vec<_>>().join(" ");
        assert!(!start.is_empty() && page.contains(&format!("| `{start}")), "no line for `{line}` ({start})");
        explained += 1;
    }
    assert!(explained >= 9, "only {explained} lines in {said}");
}

#[test]
fn words_of_a_command_are_those_of_a_shell() {
    assert_eq!(words("import \"a b\" --out x"), ["import", "a b", "--out", "x"]);
}
