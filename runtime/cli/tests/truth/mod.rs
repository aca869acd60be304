//! What is printed is true: scenes whose right answer is known from elsewhere (a closed form, another program, an
//! invariance), run through the real command. No number that is wrong without a word, no warning where all is right, no
//! cause that is not the cause. One file a class of scenes; `scenes/` has the long ones and their meshes.

use crate::common;

mod accuracy;
mod adaptive;
mod alarms;
mod axes;
mod bounces;
mod cohesive;
mod contact_form;
mod contact_rule;
mod dissipation;
mod flows;
mod friction;
mod joints;
mod jumps;
mod lags;
mod language;
mod mechanics;
mod offsets;
mod one_term;
mod open;
mod power_laws;
mod prescribed;
mod row_signs;
mod singular;
mod stability;
mod states;
mod steep;
mod units;
mod walls;
mod wandering;

use std::path::Path;

use crate::common::Folder;
use serde_json::Value;

/// How a run ended.
pub(crate) struct Ran {
    /// The exit code; -1 where a signal ended it.
    pub(crate) code: i32,
    /// Everything that was printed, both streams.
    pub(crate) text: String,
    /// `report.json`, null where there is none.
    report: Value,
}

impl Ran {
    /// True if a message with this code was printed: `W606`.
    pub(crate) fn tells(&self, code: &str) -> bool {
        self.text.contains(&format!("[{code}]"))
    }

    /// The line of the scene that the first message with this code marks; empty where it marks none.
    pub(crate) fn marked(&self, code: &str) -> &str {
        let message = self.text.split_once(&format!("[{code}]")).map_or("", |(_, behind)| behind);
        let own = message.split("\nwarning[").next().unwrap_or_default();
        let is_source =
            |line: &&str| line.trim_start().starts_with(|c: char| c.is_ascii_digit()) && line.contains(" | ");
        own.lines().find(is_source).and_then(|line| line.split_once(" | ")).map_or("", |(_, source)| source)
    }

    /// The codes of all warnings and errors, in the order in which they were printed.
    pub(crate) fn codes(&self) -> Vec<&str> {
        let starts = self.text.match_indices("warning[").chain(self.text.match_indices("error["));
        let mut places: Vec<usize> = starts.map(|(at, word)| at + word.len()).collect();
        places.sort_unstable();
        places.into_iter().filter_map(|at| self.text[at..].split(']').next()).collect()
    }

    /// A measure at the end of the last step.
    pub(crate) fn last(&self, name: &str) -> f64 {
        let steps = self.report["steps"].as_array().unwrap_or_else(|| panic!("no steps: {}", self.text));
        self.measure(steps.len() - 1, name)
    }

    /// A measure at the end of a step, counted from 0.
    pub(crate) fn measure(&self, step: usize, name: &str) -> f64 {
        let value = &self.report["steps"][step]["measures"][name];
        value.as_f64().unwrap_or_else(|| panic!("no measure `{name}`: {}", self.report["steps"][step]))
    }

    /// A number of what a demanded accuracy left in the report: `truth`, `cells`, `time`.
    pub(crate) fn accuracy(&self, name: &str) -> f64 {
        let value = &self.report["accuracy"][name];
        value.as_f64().unwrap_or_else(|| panic!("no `{name}`: {}\n{}", self.report["accuracy"], self.text))
    }

    /// The energy that friction has taken in all steps.
    pub(crate) fn friction_work(&self) -> f64 {
        let steps = self.report["steps"].as_array().unwrap_or_else(|| panic!("no steps: {}", self.text));
        steps.iter().filter_map(|step| step["friction_work"].as_f64()).sum()
    }

    /// How many steps there were.
    pub(crate) fn steps(&self) -> usize {
        self.report["steps"].as_array().map_or(0, Vec::len)
    }

    /// Points that are open, slip and stick at the end of the last step.
    pub(crate) fn contact(&self) -> [u64; 3] {
        let last = self.report["steps"].as_array().and_then(|steps| steps.last()).expect("a step");
        ["open", "slip", "stick"]
            .map(|state| last["contact"][state].as_u64().unwrap_or_else(|| panic!("{}", self.text)))
    }

    /// Asserts that the run was solved without a warning.
    pub(crate) fn assert_silent(&self) {
        assert!(self.code == 0 && self.codes().is_empty(), "exit {}: {}", self.code, self.text);
    }
}

/// `wfl run` of a scene with further words; `name` is that of one test.
pub(crate) fn run(name: &str, scene: &str, words: &[&str]) -> Ran {
    let folder = Folder::new(&format!("truth-{name}"));
    copy_meshes(&folder.0);
    folder.write("scene.wfl", scene);
    let all = [&["run", "scene.wfl", "--out", "out", "--threads", "1"], words].concat();
    let ran = folder.wfl(&all);
    let text = [&ran.stdout, &ran.stderr].map(|b| String::from_utf8_lossy(b).into_owned()).concat();
    let report = std::fs::read_to_string(folder.0.join("out/report.json"));
    let report = report.ok().and_then(|t| serde_json::from_str(&t).ok()).unwrap_or(Value::Null);
    Ran { code: ran.status.code().unwrap_or(-1), text, report }
}

/// The text of a scene in `scenes/`.
pub(crate) fn scene(name: &str) -> String {
    let path = scenes().join(format!("{name}.wfl"));
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

fn scenes() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/truth/scenes")
}

fn copy_meshes(to: &Path) {
    let files = std::fs::read_dir(scenes()).expect("the folder of scenes").map(|e| e.expect("a file").path());
    for file in files.filter(|f| f.extension().is_some_and(|e| e == "msh" || e == "csv")) {
        std::fs::copy(&file, to.join(file.file_name().expect("a name"))).expect("a copy of a mesh");
    }
}
