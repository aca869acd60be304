//! `wfl report` as a user meets it: what the page shows against closed forms, and folders that hold no whole run.

use std::process::Output;

use crate::common::Folder;

/// Two bars with E = 1, nu = 0 pressed together by the traction t against a penalty of 10 per area: the traction across
/// the fault is t, the gap -t/10, and nothing slips.
const PRESSED: &str = "wfl 1
param gamma = 10 [MPa/mm]
param E     = 1 [MPa]
param fric  = 0.5 [1]
mesh box [0,0] to [2,1] cells [4,3] quad
region left  = cells where x < 1
region right = cells where x > 1
region fault = interface from left to right
region west  = faces where x == 0
region east  = faces where x == 2
unknown uL : vector on left [mm]
unknown uR : vector on right [mm]
def jump(a,b) = a - Interpolate(b, neighbor_element)
def tang(w)   = w - (w.Normal)*Normal
def Pn    = gamma*(jump(uL,uR).Normal)
def Pt    = gamma*tang(jump(uL,uR))
def force = pos_part(Pn)*Normal + Ball_projection(Pt, fric*pos_part(Pn))
term bulk_left  on left  : E*Sym(Grad_uL):Grad_Test_uL
term bulk_right on right : E*Sym(Grad_uR):Grad_Test_uR
term contact on fault : force.jump(Test_uL,Test_uR)
fix uL = [0,0] on west
load uR = [-t,0]*E on east
steps t = 1 to 5 by 1
measure pressure = mean(Pn) on fault
output vtk \"fields\" : uL, force as traction, jump(uL,uR).Normal as overlap
output csv \"line\" : uL along [0,0.5] to [1,0.5] with points=5
";

impl Folder {
    fn run_for_page(&self, text: &str, more: &[&str]) -> Output {
        self.write("s.wfl", text);
        self.wfl(&[&["run", "s.wfl", "--out", "o"], more].concat())
    }

    fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.0.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// The page of the run in `o`.
    fn page(&self, more: &[&str]) -> String {
        let done = self.wfl(&[&["report", "o"], more].concat());
        assert!(done.status.success(), "{}", stderr(&done));
        self.read("o/report.html")
    }
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// The notes of a chart: what is shown when its points are pointed at, lines joined by `; `.
fn notes(svg: &str) -> Vec<String> {
    let all = svg.split("<title>").skip(1);
    all.map(|t| t.split("</title>").next().unwrap_or_default().replace('\n', "; ")).collect()
}

#[test]
fn the_page_shows_the_closed_form_with_units() {
    let folder = Folder::new("closed");
    let ran = folder.run_for_page(PRESSED, &[]);
    assert!(ran.status.success(), "{}", stderr(&ran));
    let page = folder.page(&["--plots", "--at", "1,5"]);
    let traction = notes(&folder.read("o/plots/traction_across_over_y.svg"));
    assert!(traction.iter().any(|n| n.contains("t = 1; y [mm] = 0; traction across [MPa] = 1")), "{traction:#?}");
    assert!(traction.iter().any(|n| n.contains("t = 5; y [mm] = 1; traction across [MPa] = 5")), "{traction:#?}");
    let overlap = notes(&folder.read("o/plots/overlap_over_y.svg"));
    assert!(
        overlap.iter().all(|n| n.contains("overlap [mm] = 0.1") || n.contains("overlap [mm] = 0.5")),
        "{overlap:#?}"
    );
    assert_eq!(overlap.len(), 2 * 4, "two steps, four nodes");
    let contact = notes(&folder.read("o/plots/contact.svg"));
    assert_eq!(contact.len(), 5 * 3, "five steps, three facets");
    assert!(contact.iter().all(|n| n.ends_with("stick")), "{contact:#?}");
    // measured pressure grows as t
    let pressure = notes(&folder.read("o/plots/measure_pressure.svg"));
    assert!(pressure[2].contains("= 3; pressure [MPa] = 3"), "{pressure:#?}");
    for part in ["5 of 5 converged", "def Pn    = gamma*(jump(uL,uR).Normal)", "<h2>Newton</h2>", "<h2>Time</h2>"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("class=\"failure\""));
    // round numbers make strains of 5 in both bodies, for which the law of small strains is not meant
    assert!(page.contains("W645") && page.matches("class=\"warning\"").count() == 2, "{page}");
    // the deformed bodies come first: the left one alone, as the scene writes no other
    let place = |part: &str| page.find(part).unwrap_or_else(|| panic!("no {part}"));
    assert!(place("<h2>The result</h2>") < place("<h2>The run</h2>"));
    let bodies = folder.read("o/plots/u_magnitude.svg");
    // u = -5 at the interface: half a length, so the displacements stay as they are
    assert!(bodies.contains("s: |u|") && bodies.contains("t = 5, true displacements"), "{bodies}");
}

#[test]
fn a_run_that_failed_is_shown_with_its_failure_and_without_older_files() {
    let folder = Folder::new("failed");
    assert!(folder.run_for_page(PRESSED, &[]).status.success());
    // pressed at t = 1 and 2, pulled apart at t = 3: nothing holds the right bar then
    let failed = folder.run_for_page(&PRESSED.replace("[-t,0]*E", "[t-2.5,0]*E"), &[]);
    assert_eq!(failed.status.code(), Some(1), "{}", stderr(&failed));
    let page = folder.page(&["--plots"]);
    assert!(page.contains("class=\"failure\" role=\"alert\">The run ended with an error: step 2 (t = 3)"), "{page}");
    let place = |part: &str| page.find(part).unwrap_or_else(|| panic!("no {part}"));
    assert!(place("<h2>The run</h2>") < place("<h2>The result</h2>"), "the reason comes first");
    // the files of the first run are still there, but they are not those of this one
    assert!(folder.0.join("o/fields_0004.vtu").exists());
    let traction = notes(&folder.read("o/plots/traction_across_over_y.svg"));
    assert!(traction[0].contains("t = 1; y [mm] = 0; traction across [MPa] = 1.5"), "{traction:#?}");
    assert!(traction.iter().all(|n| n.starts_with("t = 1;") || n.starts_with("t = 2;")), "{traction:#?}");
}

#[test]
fn folders_without_a_whole_run_are_refused_by_name() {
    let folder = Folder::new("broken");
    let message = |args: &[&str], expected: &str| {
        let refused = folder.wfl(&[&["report"], args].concat());
        let said = stderr(&refused);
        assert_eq!(refused.status.code(), Some(1), "{said}");
        assert!(said.contains(expected) && said.contains("= help: "), "{said}");
    };
    message(&["nowhere"], "there is no folder `nowhere`");
    std::fs::create_dir(folder.0.join("empty")).expect("a folder");
    message(&["empty"], "`empty` has no report.json: no run has ended in this folder");
    assert!(folder.run_for_page(PRESSED, &[]).status.success());
    let vtu = std::fs::read(folder.0.join("o/fields_0002.vtu")).expect("fields of a step");
    for part in [0, 100, vtu.len() / 2, vtu.len() - 60] {
        folder.write("o/fields_0002.vtu", &vtu[..part]);
        message(&["o"], "`o/fields_0002.vtu` is damaged: ");
    }
    folder.write("o/fields_0002.vtu", &vtu);
    let csv = folder.read("o/line_0004.csv");
    folder.write("o/line_0004.csv", &csv[..csv.len() - 9]);
    message(&["o"], "`o/line_0004.csv` is damaged: it has ");
    folder.write("o/line_0004.csv", csv.replacen("0.25,", "0.25,north,", 1));
    message(&["o"], "`o/line_0004.csv` is damaged: it has ");
    folder.write("o/line_0004.csv", csv.replacen("0.25,", "0.26,", 1));
    message(&["o"], "`o/line_0004.csv` is damaged: its content is not what was written");
    folder.write("o/line_0004.csv", &csv);
    let json = folder.read("o/report.json");
    folder.write("o/report.json", &json[..json.len() / 2]);
    message(&["o"], "`o/report.json` is damaged: EOF while parsing");
}

#[test]
fn numbers_that_are_not_finite_are_said() {
    let folder = Folder::new("nan");
    let text = PRESSED.replace("mean(Pn) on fault", "mean(sqrt(2*E - Pn)) on fault");
    folder.run_for_page(&text, &[]);
    let page = folder.page(&["--plots"]);
    assert!(page.contains("A measure is not a finite number at some step."));
    assert!(folder.read("o/plots/measure_pressure.svg").contains("values are not shown: not finite"));
}

/// u = sin(2 pi t) is above 1/2 from 1/12 to 5/12 of each period.
#[test]
fn events_are_listed_and_marked_on_charts_over_the_steps() {
    let text = "wfl 1\nmesh box [0] to [1] cells [1] segment\nunknown u : scalar\nterm a on all : u*Test_u\n\
        load u = sin(2*pi*t) on all\nmeasure top = max(u) on all\nevent high = top > 1/2\nevent never = top > 2\n\
        steps t = 0 to 2.25 by 0.01\n";
    let folder = Folder::new("report_events");
    let done = folder.run_for_page(text, &[]);
    assert!(done.status.success(), "{}", stderr(&done));
    let page = folder.page(&["--plots"]);
    let section = page.split_once("<h2>Events</h2>").expect("a section").1;
    let section = section.split_once("<h2>").expect("one behind it").0;
    for number in ["0.083", "0.41", "1.083", "1.41", "2.083", "at the last step it lasts", "never"] {
        assert!(section.contains(number), "{number}: {section}");
    }
    let svg = folder.read("o/plots/measure_top.svg");
    assert_eq!(svg.matches("class=\"o z\"").count(), 3, "{svg}");
    // a run without events has no such section
    let quiet = Folder::new("report_quiet");
    assert!(
        quiet.run_for_page(&text.replace("event high = top > 1/2\nevent never = top > 2\n", ""), &[]).status.success()
    );
    assert!(!quiet.page(&[]).contains("Events"));
}
