//! `report.json`: what a run was given, what it did and what it found.
//!
//! Promises: keys in the order of the types below, parameters, measures and checks in the order of
//! declaration; times in seconds; numbers with the fewest digits that determine them.
//! JSON has no NaN and no infinity: a number that is not finite is written as `null` and read as
//! NaN, so `null` in place of a number means "computed, and not finite". Only
//! `peak_memory_bytes` and `contact` are also `null` where there is nothing to say.
//! Does not measure time or judge results: the caller fills in what it knows.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::{Hash, OrderedMap, OutputDir, OutputError, Real, hash::Hasher};
use crate::record::{AccuracyRecord, Marks};

/// The name of the report in the output folder.
pub const REPORT_FILE: &str = "report.json";

/// The report of one run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// The scene as the user named it.
    pub scene: String,
    /// Version of the program.
    pub version: String,
    /// Parameters with the values used, in the order of declaration.
    pub parameters: OrderedMap<ParameterValue>,
    /// The mesh.
    pub mesh: MeshReport,
    /// Number of unknowns of the system.
    pub dofs: u64,
    /// Number of threads.
    pub threads: u64,
    /// Largest resident memory of the process, see [`peak_memory_bytes`].
    pub peak_memory_bytes: Option<u64>,
    /// The same of each rank; left out of the file if there is one alone.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub peak_memory_by_rank: Vec<u64>,
    /// Where the time went.
    pub timings: Timings,
    /// One entry a step tried, also for steps that did not converge.
    pub steps: Vec<StepReport>,
    /// Conditions that were to hold.
    pub checks: OrderedMap<Check>,
    /// Unknowns of each field; left out of the file if empty.
    #[serde(default, skip_serializing_if = "OrderedMap::is_empty")]
    pub fields: OrderedMap<u64>,
    /// Factorisations of a matrix, also of a condensed one; 0 in a report of an older program.
    #[serde(default)]
    pub factorisations: u64,
    /// The linear and the nonlinear solver in words; left out of the file if `None`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solver: Option<String>,
    /// By event of the scene the times that it lasted; left out of the file if the scene has none.
    #[serde(default, skip_serializing_if = "OrderedMap::is_empty")]
    pub events: OrderedMap<Vec<EventReport>>,
    /// Warnings of the run; left out of the file if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub warnings: Vec<String>,
    /// Why the run ended before its last step; left out of the file if it did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// What was not done because the scene does not need it; left out of the file if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<LeftOutReport>,
    /// The files that this run wrote, in the order of writing; the folder may hold others of earlier runs. Left out of
    /// the file if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub files: Vec<String>,
    /// The demanded accuracy, the selected setting and its estimated error; omitted from the file if none
    /// was.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub accuracy: Option<AccuracyRecord>,
    /// Derivatives of results that were asked for; left out of the file if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub gradients: Vec<GradientReport>,
    /// The scene itself.
    #[serde(flatten)]
    pub about: About,
}

/// The derivatives of one result.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GradientReport {
    /// The result, as it was asked for.
    pub result: String,
    /// Its value.
    pub value: Real,
    /// Its derivatives by parameter.
    pub by: OrderedMap<ParameterValue>,
    /// Those to larger values alone, where they were asked for; left out of the file if empty.
    #[serde(default, skip_serializing_if = "OrderedMap::is_empty")]
    pub by_larger: OrderedMap<ParameterValue>,
    /// Those to smaller values alone; left out of the file if empty.
    #[serde(default, skip_serializing_if = "OrderedMap::is_empty")]
    pub by_smaller: OrderedMap<ParameterValue>,
}

/// One time that an event lasted.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct EventReport {
    /// When it began.
    pub begin: Real,
    /// When it ended; left out of the file if it lasted at the last step.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub end: Option<Real>,
}

/// Something that was not done.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LeftOutReport {
    /// What.
    pub name: String,
    /// Why the scene does not need it.
    pub why: String,
    /// The name of the switch that puts it back, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub switch: Option<String>,
    /// How many times as long it takes with it, if that was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<Real>,
    /// How far the measures move with it, relative to their largest values, if that was measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub moved: Option<Real>,
}

/// What a scene says about itself, kept so that results can be read without it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct About {
    /// The name of the step variable; left out of the file if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub step_variable: Option<String>,
    /// Units by name, as the scene gives or implies them: coordinates (`X`), step variable, parameters, fields,
    /// measures, outputs. Left out of the file if the scene has none.
    #[serde(default, skip_serializing_if = "OrderedMap::is_empty")]
    pub units: OrderedMap<String>,
    /// What parameters are, in the words of the scene, by name; left out of the file if it says nothing.
    #[serde(default, skip_serializing_if = "OrderedMap::is_empty")]
    pub descriptions: OrderedMap<String>,
    /// Its text first, then those of the files it uses; left out of the file if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub texts: Vec<SceneText>,
    /// How its mesh was refined beyond what it says itself; left out of the file if it was not.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub marks: Marks,
}

/// A text of a scene.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneText {
    /// The file, or `(command line)`.
    pub name: String,
    /// What it holds.
    pub text: String,
}

/// The value of a parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum ParameterValue {
    /// A number.
    Number(Real),
    /// A text, such as the name of a file.
    Text(String),
    /// The entries of a vector.
    Vector(Vec<Real>),
    /// The rows of a matrix.
    Matrix(Vec<Vec<Real>>),
}

impl From<f64> for ParameterValue {
    fn from(number: f64) -> Self {
        ParameterValue::Number(Real(number))
    }
}

impl From<&str> for ParameterValue {
    fn from(text: &str) -> Self {
        ParameterValue::Text(text.to_owned())
    }
}

impl From<&[f64]> for ParameterValue {
    fn from(entries: &[f64]) -> Self {
        ParameterValue::Vector(entries.iter().copied().map(Real).collect())
    }
}

/// The mesh in numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshReport {
    /// Dimension of the space.
    pub dim: u64,
    /// Number of cells.
    pub cells: u64,
    /// Number of nodes.
    pub nodes: u64,
    /// Number of cells of each kind.
    pub kinds: OrderedMap<u64>,
    /// Where it came from: the file, or the generator with its arguments.
    pub source: String,
}

/// Wall times in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timings {
    /// Reading the scene.
    pub parse: f64,
    /// Compiling its terms.
    pub compile: f64,
    /// Reading or generating the mesh.
    pub mesh: f64,
    /// Looking at the scene before the run, and at each converged state.
    #[serde(default)]
    pub check: f64,
    /// Residuals and tangents, and what contact does with them.
    pub assemble: f64,
    /// Factorisations.
    pub factor: f64,
    /// Solutions with a factorised system.
    pub solve: f64,
    /// Measures, states and prints.
    #[serde(default)]
    pub measure: f64,
    /// Writing results, as far as the run waits for it.
    pub write: f64,
    /// From start to end of this process: the sum of the others and some milliseconds of start-up. The others include
    /// what was spent before a run was resumed.
    pub total: f64,
}

/// Why the iterations of a step ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Stop {
    /// The residual is below the tolerance.
    Tolerance,
    /// The residual is as small as rounding allows.
    Floor,
    /// The largest number of iterations was reached.
    Maxit,
    /// Nothing was solved: the state from which time starts.
    Given,
    /// Nothing acts, and the state of rest solves the equations exactly.
    Rest,
}

/// One step of a run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StepReport {
    /// The `t` of the scene.
    pub t: Real,
    /// Whether the step counts as solved.
    pub converged: bool,
    /// Why its iterations ended.
    pub stop: Stop,
    /// Number of linear systems solved for it.
    pub iterations: u64,
    /// Relative residual that rounding leaves at the end; left out of the file where unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub floor: Option<Real>,
    /// Estimated correct decimal digits of the unknowns, as far as rounding decides them; left out where unknown.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub digits: Option<Real>,
    /// Norm of the residual before the first and after every iteration.
    pub residual: Vec<Real>,
    /// Contact points at the end; `None` if the scene has no contact.
    pub contact: Option<ContactCounts>,
    /// Energy that friction took from the motion in this step, negative where it gave some back; left out of the file
    /// without friction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction_work: Option<Real>,
    /// Measures at the end, in the order of declaration.
    pub measures: OrderedMap<Real>,
    /// Every attempt at a part of the step; left out of the file if one was enough.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub attempts: Vec<AttemptReport>,
}

/// One attempt at a part of a step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AttemptReport {
    /// What grows in this part: `steps` the step variable, `load` loads and prescribed values of the first step.
    pub path: String,
    /// Where the part starts; 0 is the start of the step, 1 its end.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
    /// Number of linear systems solved for it.
    pub iterations: u64,
    /// Whether it gave a solution.
    pub converged: bool,
    /// The error it ended with, if any.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Quadrature points of the contact interfaces by what they do.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ContactCounts {
    /// Points without contact.
    pub open: u64,
    /// Points in contact that slide.
    pub slip: u64,
    /// Points in contact that stick.
    pub stick: u64,
}

/// A condition with the numbers behind it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Check {
    /// What was found.
    pub value: Real,
    /// The largest value allowed, in the unit of the value.
    pub tolerance: Real,
    /// Whether the condition holds.
    pub ok: bool,
}

impl Check {
    /// Holds if `value <= tolerance`; never for NaN.
    #[must_use]
    pub fn at_most(tolerance: f64, value: f64) -> Self {
        Check { value: Real(value), tolerance: Real(tolerance), ok: value <= tolerance }
    }
}

/// Writes the report as [`REPORT_FILE`] and returns its path.
///
/// # Errors
/// [`OutputError::Write`]; a former report is then kept.
pub fn write_report(dir: &OutputDir, report: &Report) -> Result<PathBuf, OutputError> {
    dir.write_hashed(REPORT_FILE, report.meaning(), |out| {
        serde_json::to_writer_pretty(&mut *out, report)?;
        out.write_all(b"\n")
    })
}

impl Report {
    /// A hash of what a run decides: without what depends on the machine at that hour (times, threads, memory).
    #[must_use]
    pub fn meaning(&self) -> Hash {
        let lasting = Report {
            timings: Timings::default(),
            threads: 0,
            peak_memory_bytes: None,
            peak_memory_by_rank: Vec::new(),
            ..self.clone()
        };
        // a report is JSON for all numbers; its text, as long as the run, is never held as a whole
        let mut hasher = Hasher::default();
        match serde_json::to_writer(&mut hasher, &lasting) {
            Ok(()) => hasher.end(),
            Err(_) => Hash::of(&[]),
        }
    }

    /// Whether the report in the folder says what this one says and was written by this writer.
    #[must_use]
    pub fn is_in(&self, dir: &OutputDir) -> bool {
        dir.has_written(REPORT_FILE, self.meaning())
    }
}

/// Largest resident memory of this process up to now, in bytes: `VmHWM` of `/proc/self/status`;
/// `None` where the system has no such file.
#[must_use]
pub fn peak_memory_bytes() -> Option<u64> {
    peak_of_status(&std::fs::read_to_string("/proc/self/status").ok()?)
}

/// The line reads `VmHWM:    12345 kB`; the unit is fixed and means 1024 bytes, see proc(5).
fn peak_of_status(status: &str) -> Option<u64> {
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::super::scratch::Scratch;
    use super::*;

    fn sample() -> Report {
        Report {
            scene: "hertz.wfl".into(),
            version: "0.1.0".into(),
            parameters: [
                ("young", ParameterValue::from(2.1e11)),
                ("axis", ParameterValue::from(&[0.0, 1.0][..])),
                ("law", ParameterValue::from("coulomb")),
                ("fabric", ParameterValue::Matrix(vec![vec![Real(1.0)], vec![Real(0.5)]])),
            ]
            .into_iter()
            .collect(),
            mesh: MeshReport {
                dim: 2,
                cells: 8,
                nodes: 15,
                kinds: [("quadrilateral", 8)].into_iter().collect(),
                source: "box".into(),
            },
            dofs: 30,
            threads: 2,
            peak_memory_bytes: None,
            timings: Timings::default(),
            steps: vec![StepReport {
                t: Real(0.1),
                converged: true,
                stop: Stop::Maxit,
                iterations: 2,
                floor: None,
                digits: None,
                residual: vec![Real(1.0), Real(f64::INFINITY), Real(1.0 / 3.0)],
                contact: Some(ContactCounts { open: 1, slip: 2, stick: 3 }),
                measures: [("force", Real(-5e-324))].into_iter().collect(),
                attempts: Vec::new(),
                friction_work: None,
            }],
            checks: [("residual", Check::at_most(1e-8, 1e-9))].into_iter().collect(),
            ..Report::default()
        }
    }

    #[test]
    fn the_file_is_the_documented_one() {
        let scratch = Scratch::new();
        let dir = OutputDir::create(scratch.path()).unwrap();
        write_report(&dir, &sample()).unwrap();
        let text = scratch.read(REPORT_FILE);
        assert!(text.ends_with("}\n"));
        let compact: String = text.split_whitespace().collect();
        let expected = [
            r#"{"scene":"hertz.wfl","version":"0.1.0","#,
            r#""parameters":{"young":210000000000.0,"axis":[0.0,1.0],"law":"coulomb","#,
            r#""fabric":[[1.0],[0.5]]},"#,
            r#""mesh":{"dim":2,"cells":8,"nodes":15,"kinds":{"quadrilateral":8},"source":"box"},"#,
            r#""dofs":30,"threads":2,"peak_memory_bytes":null,"#,
            r#""timings":{"parse":0.0,"compile":0.0,"mesh":0.0,"check":0.0,"assemble":0.0,"factor":0.0,"#,
            r#""solve":0.0,"measure":0.0,"write":0.0,"total":0.0},"#,
            r#""steps":[{"t":0.1,"converged":true,"stop":"maxit","iterations":2,"#,
            r#""residual":[1.0,null,0.3333333333333333],"#,
            r#""contact":{"open":1,"slip":2,"stick":3},"measures":{"force":-5e-324}}],"#,
            r#""checks":{"residual":{"value":1e-9,"tolerance":1e-8,"ok":true}},"factorisations":0}"#,
        ];
        assert_eq!(compact, expected.concat());
    }

    #[test]
    fn a_report_reads_back_as_it_was() {
        let mut report = sample();
        report.steps[0].residual.truncate(1); // NaN is not equal to itself
        report.peak_memory_bytes = Some(1 << 40);
        report.fields.insert("u", 28_u64);
        report.solver = Some("Newton, LU".into());
        report.warnings.push("line\n\"two\"".into());
        report.left_out.push(LeftOutReport {
            name: "LU".into(),
            why: "symmetric".into(),
            switch: Some("symmetric".into()),
            times: Some(Real(1.5)),
            moved: None,
        });
        report.files.push("a_0000.vtu".into());
        report.about.step_variable = Some("t".into());
        report.about.units.insert("X", "mm");
        report.about.texts.push(SceneText { name: "a.wfl".into(), text: "wfl 1\n".into() });
        let json = serde_json::to_string(&report).unwrap();
        assert_eq!(serde_json::from_str::<Report>(&json).unwrap(), report);
    }

    #[test]
    fn numbers_that_are_not_finite_are_null_and_read_as_nan() {
        for number in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let value = ParameterValue::from(number);
            assert_eq!(serde_json::to_string(&value).unwrap(), "null");
        }
        let step: Vec<Real> = serde_json::from_str("[null, 2]").unwrap();
        assert!(step[0].0.is_nan());
        assert_eq!(step[1], Real(2.0));
        assert!(matches!(
            serde_json::from_str("null").unwrap(),
            ParameterValue::Number(Real(number)) if number.is_nan()
        ));
    }

    #[test]
    fn a_check_of_nan_fails() {
        assert!(!Check::at_most(1.0, f64::NAN).ok);
        assert!(!Check::at_most(1.0, 1.5).ok);
        assert!(Check::at_most(1.0, 1.0).ok);
    }

    #[test]
    fn peak_memory_is_read_in_bytes() {
        let status = "Name:\twfl\nVmPeak:\t  900 kB\nVmHWM:\t  123 kB\nVmRSS:\t 100 kB\n";
        assert_eq!(peak_of_status(status), Some(123 * 1024));
        assert_eq!(peak_of_status("VmRSS:\t 100 kB\n"), None);
        assert_eq!(peak_of_status("VmHWM:\t many kB\n"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn peak_memory_sees_a_large_block() {
        let Some(before) = peak_memory_bytes() else {
            return; // sandboxes may hide the line
        };
        let block = std::hint::black_box(vec![1_u8; 64 << 20]);
        let after = peak_memory_bytes().unwrap();
        assert!(after >= 64 << 20 && after >= before, "{before} {after}");
        drop(block);
    }
}
