//! Tests of series of steps, whole and in parts.

use super::super::scratch::Scratch;
use super::super::{Array, Kind, Plan, State, VtkCell, sources, write_vtu};
use super::*;

fn grid(value: f64) -> Vec<Piece> {
    vec![Piece {
        points: vec![[value, 0.0, 0.0]],
        cells: [(VtkCell::Vertex, vec![0])].into_iter().collect(),
        point_data: vec![Array::scalar("u", vec![value])],
        cell_data: Vec::new(),
    }]
}

/// Runs a series over `times` and leaves it unfinished.
fn run<'d>(dir: &'d OutputDir, times: &[f64]) -> Series<'d> {
    let mut series = Series::new(dir, "hertz");
    for (number, &time) in times.iter().enumerate() {
        series.write_step(number, time, &grid(time)).unwrap();
        series.update_index().unwrap();
    }
    series
}

/// Times and files of the index, in order.
fn index(scratch: &Scratch) -> Vec<(f64, String)> {
    let text = scratch.read("hertz.pvd");
    let value = |line: &str, key: &str| {
        let rest = line.split_once(&format!("{key}=\"")).unwrap().1;
        rest.split_once('"').unwrap().0.to_owned()
    };
    text.lines()
        .filter(|line| line.starts_with("<DataSet"))
        .map(|line| (value(line, "timestep").parse().unwrap(), value(line, "file")))
        .collect()
}

#[test]
fn the_index_names_the_steps_up_to_its_last_update() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    for (step, time) in [0.1, 1.0 / 3.0, 1e-300].into_iter().enumerate() {
        let file = series.write_step(step, time, &grid(time)).unwrap();
        assert_eq!(file, scratch.path().join(format!("hertz_000{step}.vtu")));
        if step == 1 {
            assert_eq!(index(&scratch).len(), 1);
            continue;
        }
        series.update_index().unwrap();
        let steps = index(&scratch);
        assert_eq!(steps.len(), step + 1);
        assert_eq!(steps[step], (time, format!("hertz_000{step}.vtu")));
    }
}

#[test]
fn a_shorter_second_run_cleans_up_only_when_it_has_finished() {
    let scratch = Scratch::new();
    drop(OutputDir::create(scratch.path()).map(|dir| drop(run(&dir, &[0.0, 1.0, 2.0]))));
    let dir = OutputDir::create(scratch.path()).unwrap();
    let series = run(&dir, &[7.0]);
    assert_eq!(index(&scratch), [(7.0, "hertz_0000.vtu".to_owned())]);
    let with_leftovers = scratch.names();
    let removed = series.finish().unwrap();
    assert_eq!(removed, ["hertz_0001.vtu", "hertz_0002.vtu"]);
    // with the manifest and the lock
    assert_eq!(with_leftovers.len(), 4 + 2);
    drop(dir);
    assert_eq!(scratch.names(), ["hertz.pvd", "hertz_0000.vtu", "manifest.json"]);
}

#[test]
fn a_run_that_fails_at_its_first_step_touches_nothing() {
    let scratch = Scratch::new();
    drop(OutputDir::create(scratch.path()).map(|dir| drop(run(&dir, &[0.0, 1.0]))));
    let dir = OutputDir::create(scratch.path()).unwrap();
    let before = (scratch.names(), scratch.read("hertz.pvd"));
    let mut series = Series::new(&dir, "hertz");
    assert!(matches!(series.write_step(0, f64::NAN, &grid(0.0)), Err(OutputError::Time { .. })));
    assert!(matches!(series.write_step(0, 0.0, &[]), Err(OutputError::Vtu { .. })));
    assert_eq!(series.finish().unwrap(), [""; 0]);
    assert_eq!((scratch.names(), scratch.read("hertz.pvd")), before);
}

#[test]
fn an_index_of_two_runs_never_exists() {
    let scratch = Scratch::new();
    drop(OutputDir::create(scratch.path()).map(|dir| drop(run(&dir, &[0.0, 1.0]))));
    // The step file cannot be renamed into place: the run stops between index and step.
    std::fs::remove_file(scratch.path().join("hertz_0000.vtu")).unwrap();
    std::fs::create_dir(scratch.path().join("hertz_0000.vtu")).unwrap();
    let dir = OutputDir::create(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    assert!(series.write_step(0, 5.0, &grid(5.0)).is_err());
    assert_eq!(index(&scratch), []);
}

#[test]
fn the_same_run_gives_the_same_bytes() {
    let [first, second] = [Scratch::new(), Scratch::new()];
    for scratch in [&first, &second] {
        let dir = OutputDir::create(scratch.path()).unwrap();
        run(&dir, &[0.0, 0.5]).finish().unwrap();
    }
    assert_eq!(first.names(), second.names());
    for name in first.names() {
        let read = |scratch: &Scratch| std::fs::read(scratch.path().join(&name)).unwrap();
        assert_eq!(read(&first), read(&second), "{name}");
    }
}

/// The pieces of a part: a body of `n` vertices and a face of none or one.
fn part(n: usize, face: usize, value: f64) -> Vec<Piece> {
    let vertices = |n: usize| (0..n).map(|k| (VtkCell::Vertex, vec![u32::try_from(k).unwrap()])).collect();
    let body = Piece {
        points: vec![[value, 0.0, 0.0]; n],
        cells: vertices(n),
        point_data: vec![Array { name: "u & v".into(), components: 2, values: vec![value; 2 * n] }],
        cell_data: Vec::new(),
    };
    let face = Piece {
        points: vec![[value, 1.0, 0.0]; face],
        cells: vertices(face),
        point_data: vec![Array::matrix("s", [2, 2], vec![value; 4 * face])],
        cell_data: vec![Array::scalar("contact_state", vec![value; face])],
    };
    vec![body, face]
}

/// Two parts and one that has nothing.
fn parts(value: f64) -> impl Iterator<Item = Result<Vec<Piece>, OutputError>> {
    [(2, 1), (0, 0), (1, 0)].into_iter().map(move |(n, face)| Ok(part(n, face, value)))
}

fn parts_of(step: usize, n: usize) -> Vec<String> {
    let names = (0..n).map(|k| part_name("hertz", step, k));
    names.chain([step_name("hertz", step, "pvtu")]).collect()
}

#[test]
fn a_step_in_parts_has_a_grid_for_each_and_a_list_that_the_index_names() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    let files = series.write_parts(3, 0.25, parts(7.0)).unwrap();
    let expected: Vec<_> = parts_of(3, 3).iter().map(|name| scratch.path().join(name)).collect();
    assert_eq!(files, expected);
    series.update_index().unwrap();
    assert_eq!(index(&scratch), [(0.25, "hertz_0003.pvtu".to_owned())]);
    // all parts have the arrays of the list, also the one without cells
    let list = scratch.read("hertz_0003.pvtu");
    assert_eq!(sources(&list), Some(parts_of(3, 3)[..3].to_vec()));
    assert!(list.contains("<PUnstructuredGrid GhostLevel=\"0\">") && list.contains(">0.25</DataArray>"), "{list}");
    let in_list = |section: &str| -> Vec<String> {
        let inside = list.split_once(&format!("<{section}>\n")).unwrap().1.split_once("</").unwrap().0;
        inside.lines().map(|l| l.trim_end_matches("/>").trim_start_matches("<P").to_owned()).collect()
    };
    for name in &parts_of(3, 3)[..3] {
        let bytes = std::fs::read(scratch.path().join(name)).unwrap();
        let text = String::from_utf8_lossy(&bytes);
        for section in ["Points", "PointData", "CellData"] {
            let inside = text.split_once(&format!("<{section}>\n")).unwrap().1.split_once("</").unwrap().0;
            let own = inside.lines().map(|l| l.split_once(" format").unwrap().0.trim_start_matches('<').trim_end());
            assert_eq!(own.collect::<Vec<_>>(), in_list(&format!("P{section}")), "{name}");
        }
    }
    // the list has nothing of its own: each part is the file that a whole grid of its pieces would be
    let whole = OutputDir::create(scratch.path().join("whole")).unwrap();
    for (k, pieces) in parts(7.0).enumerate() {
        let file = write_vtu(&whole, "one.vtu", Some(0.25), &pieces.unwrap()).unwrap();
        assert_eq!(std::fs::read(file).unwrap(), std::fs::read(&files[k]).unwrap(), "part {k}");
    }
}

#[test]
fn one_part_is_held_at_a_time_and_nothing_changes_before_all_are_written() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    series.write_parts(0, 0.0, parts(1.0)).unwrap();
    let state = || -> Vec<Vec<u8>> {
        scratch.names().iter().map(|name| std::fs::read(scratch.path().join(name)).unwrap()).collect()
    };
    let before = (scratch.names(), state());
    let fail = |second: Result<Vec<Piece>, OutputError>| {
        let mut series = Series::new(&dir, "hertz");
        let error = series.write_parts(0, 0.0, [Ok(part(1, 1, 2.0)), second]).unwrap_err();
        assert_eq!((scratch.names(), state()), before);
        error
    };
    let lost = || OutputError::Remove { file: PathBuf::new(), source: io::ErrorKind::BrokenPipe.into() };
    assert!(matches!(fail(Err(lost())), OutputError::Remove { .. }));
    let fault = |pieces: Vec<Piece>| match fail(Ok(pieces)) {
        OutputError::Vtu { file, source } if file.ends_with("hertz_0000.p0001.vtu") => source,
        other => panic!("{other:?}"),
    };
    assert_eq!(fault(part(1, 1, 2.0)[..1].to_vec()), VtuError::PartPieces { part: 1, expected: 2, found: 1 });
    let mut other = part(0, 0, 2.0);
    other[1].cell_data.clear();
    let lacks = VtuError::PartArrays { part: 1, name: "contact_state".into() };
    assert_eq!(fault(other.clone()), lacks);
    other[1].point_data[0] = Array::scalar("s", Vec::new());
    assert_eq!(fault(other), VtuError::PartArrays { part: 1, name: "s".into() });
    let none = Series::new(&dir, "hertz").write_parts(0, 0.0, [] as [Result<Vec<Piece>, OutputError>; 0]);
    assert!(matches!(none, Err(OutputError::Vtu { source: VtuError::NoPiece, .. })));
}

#[test]
fn steps_of_the_other_kind_and_of_more_parts_go_when_the_run_has_finished() {
    let names = |steps: &[Vec<String>]| {
        let more = ["hertz.pvd", "manifest.json"].map(str::to_owned);
        let mut names: Vec<String> = steps.concat().into_iter().chain(more).collect();
        names.sort();
        names
    };
    let scratch = Scratch::new();
    drop(OutputDir::create(scratch.path()).map(|dir| drop(run(&dir, &[0.0, 1.0, 2.0]))));
    let dir = OutputDir::create(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    (0..2).for_each(|k| drop(series.write_parts(k, 1.0, parts(1.0)).unwrap()));
    assert!(scratch.names().contains(&"hertz_0000.vtu".to_owned()));
    series.update_index().unwrap();
    assert_eq!(series.finish().unwrap(), ["hertz_0000.vtu", "hertz_0001.vtu", "hertz_0002.vtu"]);
    dir.finish(State::Finished).unwrap();
    drop(dir);
    assert_eq!(scratch.names(), names(&[parts_of(0, 3), parts_of(1, 3)]));
    // two parts in place of three, one step in place of two
    let dir = OutputDir::create(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    series.write_parts(0, 1.0, parts(2.0).take(2)).unwrap();
    assert!(scratch.names().contains(&"hertz_0000.p0002.vtu".to_owned()));
    series.update_index().unwrap();
    let gone = [&["hertz_0000.p0002.vtu".to_owned()], &parts_of(1, 3)[..]].concat();
    assert_eq!(series.finish().unwrap(), gone);
    dir.finish(State::Finished).unwrap();
    drop(dir);
    assert_eq!(scratch.names(), names(&[parts_of(0, 2)]));
    let dir = OutputDir::create(scratch.path()).unwrap();
    assert_eq!(run(&dir, &[0.0]).finish().unwrap(), parts_of(0, 2));
}

/// Goes on behind steps 0 and 1, and gives the names of their files.
fn taken(dir: &OutputDir, series: &mut Series<'_>) -> Vec<String> {
    let mut names = Vec::new();
    let mut adopt = |name: String| {
        assert!(dir.verify(&name)?.is_some(), "{name}");
        names.push(name);
        Ok::<(), OutputError>(())
    };
    (0..2).for_each(|k| series.go_on_from(k, 0.5, &mut adopt).unwrap());
    names
}

#[test]
fn a_run_goes_on_with_any_number_of_parts() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    series.write_step(0, 0.5, &grid(0.5)).unwrap();
    (1..3).for_each(|k| drop(series.write_parts(k, 0.5, parts(1.0)).unwrap()));
    // killed: step 2 is written again, in another number of parts
    drop(dir);
    let first_two = [&["hertz_0000.vtu".to_owned()], &parts_of(1, 3)[..]].concat();
    for n in [2, 3, 1] {
        let dir = OutputDir::open(scratch.path()).unwrap();
        let mut series = Series::new(&dir, "hertz");
        assert_eq!(taken(&dir, &mut series), first_two);
        dir.go_on(Kind::Run, &Plan::default()).unwrap();
        series.write_parts(2, 0.75, parts(1.0).take(n)).unwrap();
        assert_eq!(dir.own_files_of("hertz_0002."), parts_of(2, n));
        series.update_index().unwrap();
        assert_eq!(
            index(&scratch),
            [(0.5, "hertz_0000.vtu".into()), (0.5, "hertz_0001.pvtu".into()), (0.75, "hertz_0002.pvtu".into())]
        );
    }
    // and as a whole, where the journal still names what is gone
    let dir = OutputDir::open(scratch.path()).unwrap();
    let mut series = Series::new(&dir, "hertz");
    taken(&dir, &mut series);
    dir.go_on(Kind::Run, &Plan::default()).unwrap();
    series.write_step(2, 0.75, &grid(0.5)).unwrap();
    series.finish().unwrap();
    dir.finish(State::Finished).unwrap();
    assert!(dir.own_files().iter().all(|name| scratch.path().join(name).exists()));
    assert_eq!(dir.own_files_of("hertz_0002."), ["hertz_0002.vtu"]);
}

#[test]
fn parts_that_are_gone_or_changed_are_found_when_a_run_goes_on() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    Series::new(&dir, "hertz").write_parts(0, 0.5, parts(1.0)).unwrap();
    drop(dir);
    let missed = |file: &str| {
        std::fs::remove_file(scratch.path().join(file)).unwrap();
        let dir = OutputDir::open(scratch.path()).unwrap();
        let mut missed = Vec::new();
        let mut adopt = |name: String| {
            missed.extend(dir.verify(&name)?.is_none().then_some(name));
            Ok::<(), OutputError>(())
        };
        Series::new(&dir, "hertz").go_on_from(0, 0.5, &mut adopt).unwrap();
        missed
    };
    assert_eq!(missed("hertz_0000.p0001.vtu"), ["hertz_0000.p0001.vtu"]);
    assert_eq!(missed("hertz_0000.pvtu"), ["hertz_0000.pvtu"]);
    std::fs::write(scratch.path().join("hertz_0000.pvtu"), "changed").unwrap();
    let dir = OutputDir::open(scratch.path()).unwrap();
    let error = Series::new(&dir, "hertz").go_on_from(0, 0.5, &mut |_| Ok::<(), OutputError>(())).unwrap_err();
    assert!(matches!(error, OutputError::Damaged { .. }));
}

#[test]
fn a_list_names_plain_files_only_and_is_whole() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    Series::new(&dir, "a&b'c").write_parts(0, 0.5, parts(1.0)).unwrap();
    let list = scratch.read("a&b'c_0000.pvtu");
    assert_eq!(sources(&list).unwrap()[0], "a&b'c_0000.p0000.vtu");
    assert_eq!(sources(&list[..list.len() - 1]), None);
    assert_eq!(sources(&list.replace("a&amp;b&apos;c_0000.p0001", "../up")), None);
}
