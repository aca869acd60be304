//! The numbers that iterations, linear solvers, contact, checks and the search for an accuracy decide by: writes `docs/constants.md`.
//!
//! `cargo run -p wfl-tests --bin constants` makes the page from the comments; with `-- vary NAME..` behind it the range of
//! these constants is measured first, with `-- vary` that of all which were not measured with their present value.

use std::{
    io::{self, Write as _},
    path::Path,
};

use wfl_tests::constants::{RANGES, VariedWorkspace, page, ranges, single_constants, write_ranges};

fn main() -> io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").canonicalize()?;
    let given: Vec<String> = std::env::args().skip(1).collect();
    match given.split_first() {
        None => {}
        Some((verb, names)) if verb == "vary" => vary(&root, names)?,
        Some((other, _)) => return Err(io::Error::other(format!("`{other}` is not known: vary [NAME..]"))),
    }
    std::fs::write(root.join("docs/constants.md"), page(&root))
}

/// Measures the ranges of constants and keeps each as soon as it is found.
fn vary(root: &Path, names: &[String]) -> io::Result<()> {
    let mut known = ranges(root);
    let is_wanted = |constant: &str, value: &str| match names {
        [] => !known.iter().any(|r| r.constant == constant && r.value == value),
        names => names.iter().any(|name| constant.ends_with(name)),
    };
    let wanted: Vec<_> = single_constants(root).into_iter().filter(|(name, c)| is_wanted(name, &c.value)).collect();
    let mut out = io::stdout();
    writeln!(out, "{} constants; building a copy in target/varied", wanted.len())?;
    let mut copy = VariedWorkspace::new(root)?;
    let usual = copy.measure()?;
    writeln!(out, "the tests take {:.0} s one by one; parts of lists or tables are left out:", usual.as_secs_f64())?;
    copy.left_out().try_for_each(|name| writeln!(out, "  {name}"))?;
    let left_out: Vec<String> = copy.left_out().map(str::to_owned).collect();
    for (name, constant) in wanted.iter().filter(|(name, _)| !left_out.contains(name)) {
        let range = copy.range(name, &constant.value)?;
        writeln!(out, "{name} = {}: {:?} {:?}", constant.value, range.passes, range.fails)?;
        out.flush()?;
        known.retain(|r| r.constant != *name);
        known.push(range);
        known.sort_by(|a, b| a.constant.cmp(&b.constant));
        std::fs::write(root.join(RANGES), write_ranges(&known))?;
    }
    Ok(())
}
