//! In which range of each constant suites pass: a copy of the workspace whose constants can be changed by the environment
//! is built once, and its suites run with one constant changed at a time.

use std::{
    collections::BTreeSet,
    fmt::Write as _,
    io,
    path::{Path, PathBuf},
    process::{Command, Stdio},
    time::{Duration, Instant},
};

use super::rewritten::{ASKED, Names, SOURCE, VARIABLE, rewritten};
use super::{FOLDERS, constants_in};

/// What a constant is multiplied by: downwards and upwards, the farther one first; where that passes, the nearer one is not
/// tried.
const FACTORS: [[f64; 2]; 2] = [[0.1, 0.5], [10.0, 2.0]];
/// Tests are run for one change as long as they take this together, quick ones first.
pub const BUDGET: Duration = Duration::from_secs(10);
/// Tests that take so many times as long as without a change, and [`PATIENCE`] more, have failed: an iteration that no longer
/// ends.
const SLOWER: u32 = 4;
const PATIENCE: Duration = Duration::from_secs(5);
/// Attempts to build the copy; each leaves out the constants that cannot be functions.
const ATTEMPTS: usize = 8;

/// Packages whose suites are built, and the suites of them that are run: unit tests of crates by the names of these, and
/// programs of tests.
const PACKAGES: [&str; 6] = ["wfl-suites", "wfl-cli", "wfl-linear", "wfl-newton", "wfl-contact", "wfl-checks"];
/// The suites, in the order in which they are run, quick ones first: the program that has them, and the part of it.
pub const SUITES: [[&str; 2]; 8] = [
    ["wfl_linear", ""],
    ["wfl_newton", ""],
    ["wfl_contact", ""],
    ["wfl_checks", ""],
    ["suites", "robust::"],
    ["suites", "scenes::"],
    ["suites", "checks::"],
    ["command", "truth::"],
];

/// What is told of a constant that no suite asks for.
pub const UNREAD: &str = "no suite asks for it";

/// What a suite is called: the part of its program, or the program.
#[must_use]
pub fn name_of([program, part]: [&'static str; 2]) -> &'static str {
    match part {
        "" => program,
        part => part.trim_end_matches(':'),
    }
}

/// Within which factors of a constant the suites pass.
#[derive(Clone, Debug, PartialEq)]
pub struct Range {
    /// The constant: file from the folder of its crate, and name.
    pub constant: String,
    /// Its value when that was found.
    pub value: String,
    /// The smallest and the largest factor at which all suites passed.
    pub passes: [f64; 2],
    /// The suite that failed first beyond, downwards and upwards; empty where nothing failed.
    pub fails: [String; 2],
}

/// The table of ranges: `constant,value,least,most,suite below,suite above`.
#[must_use]
pub fn read_ranges(text: &str) -> Vec<Range> {
    let range = |line: &str| {
        let mut cells = line.split(',').map(str::trim);
        let mut next = || cells.next().map(str::to_owned);
        Some(Range {
            constant: next()?,
            value: next()?,
            passes: [next()?.parse().ok()?, next()?.parse().ok()?],
            fails: [next()?, next()?],
        })
    };
    text.lines().skip(1).filter_map(range).collect()
}

/// The table as text.
#[must_use]
pub fn write_ranges(ranges: &[Range]) -> String {
    let mut text = "constant,value,least factor,largest factor,fails below,fails above\n".to_owned();
    for Range { constant, value, passes: [least, most], fails: [below, above] } in ranges {
        writeln!(text, "{constant},{value},{least},{most},{below},{above}").expect("a text takes all that is written");
    }
    text
}

/// A suite that was built.
struct Suite {
    name: &'static str,
    /// The part of its program, as a filter of tests.
    part: &'static str,
    program: PathBuf,
    folder: PathBuf,
    tests: Vec<Test>,
}

/// A test of a suite.
struct Test {
    name: String,
    usual: Duration,
    /// The constants that it asks for.
    reads: BTreeSet<String>,
}

/// The copy of the workspace.
pub struct VariedWorkspace {
    root: PathBuf,
    suites: Vec<Suite>,
    left_out: BTreeSet<String>,
}

fn write_if_new(path: &Path, text: &[u8]) -> io::Result<()> {
    if std::fs::read(path).is_ok_and(|old| old == text) {
        return Ok(());
    }
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder)?;
    }
    std::fs::write(path, text)
}

fn files(folder: &Path, out: &mut Vec<PathBuf>) -> io::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        match path.is_dir() {
            true if name == "target" || name.starts_with(".git") => {}
            true => files(&path, out)?,
            false => out.push(path),
        }
    }
    Ok(())
}

/// The crate that a folder of constants belongs to, and the place of the folder in it.
fn in_crate(folder: &str) -> (&str, &str) {
    match folder.split_once("/src/") {
        Some((of, rest)) => (of, rest),
        None => (folder.trim_end_matches("/src"), ""),
    }
}

/// The manifest of a crate whose constants ask the host for their values: it depends on the host.
fn with_host(manifest: &str) -> String {
    match manifest.contains("wfl-host.workspace") {
        true => manifest.to_owned(),
        false => manifest.replacen("[dependencies]\n", "[dependencies]\nwfl-host.workspace = true\n", 1),
    }
}

impl VariedWorkspace {
    /// Makes and builds the copy of the workspace at `root` in `target/varied`.
    ///
    /// # Errors
    /// What cannot be read, written or built.
    pub fn new(root: &Path) -> io::Result<Self> {
        let mut this = Self { root: root.join("target/varied"), suites: Vec::new(), left_out: BTreeSet::new() };
        for _ in 0..ATTEMPTS {
            this.write(root)?;
            let blamed = this.build(root)?;
            if blamed.is_empty() {
                return Ok(this);
            }
            this.left_out.extend(blamed);
        }
        Err(io::Error::other("the copy cannot be built"))
    }

    /// Constants that are part of lists, tables or patterns, which this program does not change.
    pub fn left_out(&self) -> impl Iterator<Item = &str> {
        self.left_out.iter().map(String::as_str)
    }

    fn write(&self, root: &Path) -> io::Result<()> {
        let mut all = Vec::new();
        files(root, &mut all)?;
        for path in all {
            let relative = path.strip_prefix(root).map_err(io::Error::other)?;
            let shown = relative.display().to_string();
            let mut bytes = std::fs::read(&path)?;
            if shown == "runtime/host/src/lib.rs" {
                bytes.extend_from_slice(SOURCE.as_bytes());
            }
            for (folder, _) in FOLDERS {
                let (of, within) = in_crate(folder);
                if shown == format!("{of}/Cargo.toml") {
                    bytes = with_host(&String::from_utf8_lossy(&bytes)).into_bytes();
                }
                let sources = format!("{of}/src/");
                let file = shown.strip_prefix(&sources).filter(|file| file.ends_with(".rs"));
                // the search for an accuracy is a folder of its crate: others do not name its constants
                let Some(file) = file.and_then(|file| file.strip_prefix(within)) else { continue };
                let file = file.trim_start_matches('/');
                let names = self.names(root, folder);
                let text = String::from_utf8_lossy(&bytes).into_owned();
                bytes = rewritten(file, &format!("{folder}/{file}"), &text, &names).into_bytes();
            }
            write_if_new(&self.root.join(relative), &bytes)?;
        }
        Ok(())
    }

    fn names(&self, root: &Path, folder: &str) -> Names {
        let mut names = Names::new();
        for constant in constants_in(root, folder) {
            let is_single = !constant.kind.starts_with('[');
            if is_single && !self.left_out.contains(&format!("{folder}/{}:{}", constant.file, constant.name)) {
                names.entry(constant.file).or_default().insert(constant.name);
            }
        }
        names
    }

    /// Builds the suites; the constants that stand where none of them compiles.
    fn build(&mut self, root: &Path) -> io::Result<BTreeSet<String>> {
        self.suites.clear();
        // all at once: other packages alone select other features, with which everything below is built again
        let packages = PACKAGES.iter().flat_map(|package| ["-p", package]);
        let programs: BTreeSet<&str> =
            SUITES.iter().filter(|[_, part]| !part.is_empty()).map(|[program, _]| *program).collect();
        let programs = programs.into_iter().flat_map(|program| ["--test", program]);
        let output = Command::new("cargo")
            .current_dir(&self.root)
            .args(["test", "--release", "--no-run", "--message-format=json", "--lib"])
            .args(packages.chain(programs))
            // a folder of its own: crates of the copy have the names of those that are used otherwise
            .args(["--target-dir", &self.root.join("target").display().to_string()])
            .stderr(Stdio::inherit())
            .output()?;
        let text = String::from_utf8_lossy(&output.stdout);
        let messages: Vec<serde_json::Value> =
            text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
        if !output.status.success() {
            return self.blamed(root, &messages);
        }
        for [program, part] in SUITES {
            let name = name_of([program, part]);
            let built = messages.iter().find(|m| m["profile"]["test"] == true && m["target"]["name"] == program);
            let text = |key: &str| built.and_then(|m| m[key].as_str()).map(PathBuf::from);
            let (Some(program), Some(manifest)) = (text("executable"), text("manifest_path")) else {
                return Err(io::Error::other(format!("{name} has no program")));
            };
            let folder = manifest.parent().map(Path::to_path_buf).unwrap_or_default();
            self.suites.push(Suite { name, part, program, folder, tests: Vec::new() });
        }
        Ok(BTreeSet::new())
    }

    /// The constants that are named on the lines of errors.
    fn blamed(&self, root: &Path, messages: &[serde_json::Value]) -> io::Result<BTreeSet<String>> {
        let mut blamed = BTreeSet::new();
        let errors = messages.iter().map(|m| &m["message"]).filter(|m| m["level"] == "error");
        let spans = errors.flat_map(|m| m["spans"].as_array().cloned().unwrap_or_default());
        for span in spans {
            let lines = span["text"].as_array().cloned().unwrap_or_default();
            let code: String = lines.iter().filter_map(|line| line["text"].as_str()).collect::<Vec<_>>().join(" ");
            let at = span["file_name"].as_str().unwrap_or_default();
            for (folder, _) in FOLDERS {
                let is_own = at.starts_with(&format!("{}/src/", in_crate(folder).0));
                let is_named = |name: &String| {
                    code.contains(&format!("{name}()")) && is_own || code.contains(name.as_str()) && !is_own
                };
                for (file, names) in self.names(root, folder) {
                    let named = names.iter().filter(|name| is_named(name));
                    blamed.extend(named.map(|name| format!("{folder}/{file}:{name}")));
                }
            }
        }
        match blamed.is_empty() {
            true => Err(io::Error::other("the copy does not compile, and no constant is to blame")),
            false => Ok(blamed),
        }
    }

    /// Runs each test by itself, for the time that it takes and the constants that it asks for.
    ///
    /// # Errors
    /// The first that fails.
    pub fn measure(&mut self) -> io::Result<Duration> {
        let asked = self.root.join("asked");
        for suite in &mut self.suites {
            for name in suite.listed()? {
                std::fs::create_dir_all(&asked)?;
                let start = Instant::now();
                if !suite.passes(&[&name], [ASKED, &asked.display().to_string()], Duration::from_secs(3600))? {
                    return Err(io::Error::other(format!("{name} of {} fails without a change", suite.name)));
                }
                let usual = start.elapsed();
                let files = std::fs::read_dir(&asked)?;
                let reads = files.map(|file| Ok(file?.file_name().to_string_lossy().replace('!', "/")));
                suite.tests.push(Test { name, usual, reads: reads.collect::<io::Result<_>>()? });
                std::fs::remove_dir_all(&asked)?;
            }
        }
        Ok(self.suites.iter().flat_map(|suite| &suite.tests).map(|test| test.usual).sum())
    }

    /// The first suite with a test that fails with a constant times a factor, of the quickest tests that ask for it.
    fn failing(&self, constant: &str, factor: f64) -> io::Result<Option<&str>> {
        let change = format!("{constant}={factor}");
        let asks = |test: &&Test| test.reads.contains(constant);
        let mut times: Vec<Duration> =
            self.suites.iter().flat_map(|suite| suite.tests.iter().filter(asks)).map(|test| test.usual).collect();
        times.sort_unstable();
        // the quickest one in any case
        let mut spent = Duration::ZERO;
        let within = times.iter().enumerate().take_while(|(k, time)| {
            spent += **time;
            *k == 0 || spent <= BUDGET
        });
        let Some((_, longest)) = within.last() else { return Ok(None) };
        for suite in &self.suites {
            let chosen: Vec<&Test> = suite.tests.iter().filter(asks).filter(|test| test.usual <= *longest).collect();
            let names: Vec<&str> = chosen.iter().map(|test| test.name.as_str()).collect();
            let usual: Duration = chosen.iter().map(|test| test.usual).sum();
            if !names.is_empty() && !suite.passes(&names, [VARIABLE, &change], usual * SLOWER + PATIENCE)? {
                return Ok(Some(suite.name));
            }
        }
        Ok(None)
    }

    /// The range of a constant, `folder/file:NAME`.
    ///
    /// # Errors
    /// If a suite cannot be started.
    pub fn range(&self, constant: &str, value: &str) -> io::Result<Range> {
        let mut range = Range {
            constant: constant.to_owned(),
            value: value.to_owned(),
            passes: [1.0; 2],
            fails: [String::new(), String::new()],
        };
        if !self.suites.iter().flat_map(|suite| &suite.tests).any(|test| test.reads.contains(constant)) {
            range.fails = [UNREAD.to_owned(), UNREAD.to_owned()];
            return Ok(range);
        }
        for (side, factors) in FACTORS.into_iter().enumerate() {
            for factor in factors {
                let Some(suite) = self.failing(constant, factor)? else {
                    range.passes[side] = factor;
                    break;
                };
                suite.clone_into(&mut range.fails[side]);
            }
        }
        Ok(range)
    }
}

impl Suite {
    /// The names of its tests.
    fn listed(&self) -> io::Result<Vec<String>> {
        let mut command = Command::new(&self.program);
        command.args((!self.part.is_empty()).then_some(self.part)).args(["--list", "--format", "terse"]);
        let output = command.current_dir(&self.folder).output()?;
        let text = String::from_utf8_lossy(&output.stdout);
        Ok(text.lines().filter_map(|line| line.strip_suffix(": test")).map(str::to_owned).collect())
    }

    /// Whether these tests pass with a variable of the environment.
    fn passes(&self, tests: &[&str], [variable, value]: [&str; 2], within: Duration) -> io::Result<bool> {
        let mut command = Command::new(&self.program);
        command.args(tests).arg("--exact");
        command.current_dir(&self.folder).env(variable, value).stdout(Stdio::null()).stderr(Stdio::null());
        let mut child = command.spawn()?;
        let start = Instant::now();
        loop {
            if let Some(status) = child.try_wait()? {
                return Ok(status.success());
            }
            if start.elapsed() > within {
                child.kill()?;
                child.wait()?;
                return Ok(false);
            }
            std::thread::sleep(Duration::from_millis(50));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_ranges_is_read_as_it_was_written() {
        let fails = ["wfl-newton lib".to_owned(), String::new()];
        let range = Range { constant: "a/b.rs:C".to_owned(), value: "1e-3".to_owned(), passes: [0.5, 10.0], fails };
        assert_eq!(read_ranges(&write_ranges(std::slice::from_ref(&range))), [range]);
    }

    #[test]
    fn a_crate_with_constants_depends_on_the_host() {
        let lines = |host| format!("[dependencies]\n{host}wfl-mesh.workspace = true\n");
        let with = lines("wfl-host.workspace = true\n");
        assert_eq!(with_host(&lines("")), with);
        assert_eq!(with_host(&with), with);
    }

    #[test]
    fn a_folder_of_constants_belongs_to_a_crate() {
        assert_eq!(in_crate("runtime/newton/src"), ("runtime/newton", ""));
        assert_eq!(in_crate("runtime/adapt/src/accuracy"), ("runtime/adapt", "accuracy"));
    }
}
