//! The pages of the guide and of the examples: links lead somewhere, the book has every page, every example its page with
//! formulation, reference and pictures that a command makes.

use std::{
    collections::BTreeSet,
    fs,
    path::{Component, Path, PathBuf},
};

/// Bytes of a picture, so that the repository stays small.
const PNG: u64 = 100_000;
const SVG: u64 = 200_000;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Names of the files or folders in a folder, in order.
fn names(folder: &str) -> BTreeSet<String> {
    let entries = fs::read_dir(root().join(folder)).unwrap_or_else(|e| panic!("{folder}: {e}"));
    entries.map(|e| e.expect("a name").file_name().to_string_lossy().into_owned()).collect()
}

/// Pages whose links are followed, as paths from the root.
fn pages() -> Vec<String> {
    let docs = names("docs").into_iter().filter(|n| n.ends_with(".md")).map(|n| format!("docs/{n}"));
    let examples = names("examples").into_iter().map(|n| format!("examples/{n}/README.md"));
    docs.chain(examples).chain(["README.md".to_owned()]).collect()
}

/// The text without blocks of code.
fn prose(text: &str) -> String {
    let mut code = false;
    let keep = |line: &&str| {
        let fence = line.starts_with("```");
        code ^= fence;
        !fence && !code
    };
    text.lines().filter(keep).collect::<Vec<_>>().join("\n")
}

/// Targets of the links and pictures of a page.
fn links(text: &str) -> Vec<String> {
    let text = prose(text);
    let after = text.split("](").skip(1);
    after.filter_map(|rest| Some(rest.split_once(')')?.0.to_owned())).collect()
}

/// Anchors of the headings of a page, as browsers of repositories and mdBook make them.
fn anchors(text: &str) -> BTreeSet<String> {
    let heading = |line: &&str| line.starts_with('#');
    let anchor = |line: &str| {
        let words = line.trim_start_matches('#').trim().to_lowercase();
        let kept = words.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
        kept.map(|c| if c == ' ' { '-' } else { c }).collect()
    };
    prose(text).lines().filter(heading).map(anchor).collect()
}

/// The path without `..`.
fn plain(path: &Path) -> PathBuf {
    let mut out = PathBuf::new();
    for part in path.components() {
        if part == Component::ParentDir {
            out.pop();
        } else {
            out.push(part);
        }
    }
    out
}

#[test]
fn every_link_between_pages_leads_to_a_page_and_an_anchor() {
    let mut wrong = Vec::new();
    for page in pages() {
        for link in links(&read(&root().join(&page))) {
            if link.starts_with("http") {
                continue;
            }
            let (file, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target =
                if file.is_empty() { PathBuf::from(&page) } else { plain(&Path::new(&page).with_file_name(file)) };
            let path = root().join(&target);
            if !path.exists() {
                wrong.push(format!("{page}: no {}", target.display()));
            } else if !anchor.is_empty() && !anchors(&read(&path)).contains(anchor) {
                wrong.push(format!("{page}: no heading `{anchor}` in {}", target.display()));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn the_book_has_every_page_once() {
    let listed: Vec<String> = links(&read(&root().join("docs/SUMMARY.md")));
    let once: BTreeSet<&String> = listed.iter().collect();
    assert_eq!(once.len(), listed.len(), "a page is listed twice");
    let there = names("docs").into_iter().filter(|n| n.ends_with(".md") && n != "SUMMARY.md");
    assert_eq!(listed.iter().cloned().collect::<BTreeSet<_>>(), there.collect::<BTreeSet<_>>());
}

#[test]
fn every_example_has_its_formulation_its_reference_and_a_picture_that_a_command_makes() {
    let gallery = read(&root().join("docs/gallery.md"));
    for name in names("examples") {
        let page = read(&root().join(format!("examples/{name}/README.md")));
        for part in ["# ", "\n## Reference\n", "\n## Picture\n", "\nwfl run examples/", "\nwfl plot out/"] {
            assert!(page.contains(part), "{name}: no `{}`", part.trim());
        }
        assert!(gallery.contains(&format!("](../examples/{name}/README.md)")), "{name} is not in the gallery");
        for scene in page.lines().filter_map(|l| l.strip_prefix("wfl run ")) {
            let file = scene.split(' ').next().unwrap_or_default();
            assert!(root().join(file).is_file(), "{name}: no scene {file}");
        }
        let pictures: Vec<String> =
            links(&page).into_iter().filter(|l| l.ends_with(".png") || l.ends_with(".svg")).collect();
        assert!(!pictures.is_empty(), "{name} has no picture");
        for picture in pictures {
            let path = plain(&Path::new("examples").join(&name).join(&picture)).display().to_string();
            let made = page.lines().any(|l| l.starts_with("wfl plot ") && l.ends_with(&path));
            assert!(made, "no command makes {path}");
            let limit = if path.ends_with(".png") { PNG } else { SVG };
            let size = fs::metadata(root().join(&path)).unwrap_or_else(|e| panic!("{path}: {e}")).len();
            assert!(size < limit, "{path} has {size} bytes");
            let shown = path.strip_prefix("docs/").is_some_and(|p| gallery.contains(&format!("]({p})")));
            assert!(shown, "{path} is not in the gallery, or not in the folder of the book");
        }
    }
}

#[test]
fn anchors_are_made_as_readers_of_pages_make_them() {
    let found = anchors("# Friction on the total slip, and on it\n```\n# no heading\n```\n## `a_b`: c (d)\n");
    let expected = ["friction-on-the-total-slip-and-on-it", "a_b-c-d"];
    assert_eq!(found, expected.into_iter().map(str::to_owned).collect());
}
