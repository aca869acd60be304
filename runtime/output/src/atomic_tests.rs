use super::super::files::BUFFER;
use super::super::scratch::Scratch;
use super::super::step_name;
use super::*;

fn put(dir: &OutputDir, name: &str, text: &str) -> Result<PathBuf, OutputError> {
    dir.write_atomic(name, |out| out.write_all(text.as_bytes()))
}

#[test]
fn makes_the_folder_with_its_parents_and_leaves_its_manifest() {
    let scratch = Scratch::new();
    let path = scratch.path().join("a/b");
    let dir = OutputDir::open(&path).unwrap();
    assert_eq!((dir.path(), dir.holds()), (path.as_path(), None));
    drop(dir);
    assert_eq!(fs::read_dir(&path).unwrap().count(), 0);
    let dir = OutputDir::create(&path).unwrap();
    dir.finish(State::Finished).unwrap();
    drop(dir);
    let names: Vec<_> = fs::read_dir(&path).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(names, [MANIFEST_FILE]);
    assert_eq!(OutputDir::open(&path).unwrap().holds(), Some((Kind::Run, State::Finished, Identity::default())));
}

#[test]
fn a_file_in_the_way_is_named() {
    let scratch = Scratch::new();
    let file = scratch.path().join("taken");
    fs::write(&file, "x").unwrap();
    for path in [file.clone(), file.join("below/it")] {
        match OutputDir::create(&path) {
            Err(OutputError::NotADirectory { obstacle, .. }) => assert_eq!(obstacle, file),
            other => panic!("{other:?}"),
        }
    }
    assert_eq!(fs::read_to_string(&file).unwrap(), "x");
}

#[cfg(target_os = "linux")]
#[test]
fn an_unwritable_folder_is_found_before_any_work() {
    // Not even the super-user can make files here.
    match OutputDir::create("/proc/self") {
        Err(OutputError::NotWritable { path, .. }) => {
            assert_eq!(path, Path::new("/proc/self"));
        }
        other => panic!("{other:?}"),
    }
    let below = OutputDir::create("/proc/self/results");
    assert!(matches!(below, Err(OutputError::CannotCreate { .. })));
}

#[test]
fn two_runs_cannot_share_a_folder() {
    let scratch = Scratch::new();
    let first = OutputDir::create(scratch.path()).unwrap();
    let second = OutputDir::create(scratch.path());
    assert!(matches!(second, Err(OutputError::InUse { .. })));
    drop(first);
    assert!(OutputDir::create(scratch.path()).is_ok());
}

#[test]
fn replaces_whole_files() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    put(&dir, "u.csv", "a longer first version").unwrap();
    let file = put(&dir, "u.csv", "second").unwrap();
    assert_eq!(fs::read_to_string(file).unwrap(), "second");
    drop(dir);
    assert_eq!(scratch.names(), [MANIFEST_FILE, "u.csv"]);
}

/// A folder where an earlier run wrote files.
fn left(scratch: &Scratch, names: &[&str]) {
    let dir = OutputDir::create(scratch.path()).unwrap();
    names.iter().for_each(|name| drop(put(&dir, name, "old").unwrap()));
    dir.finish(State::Finished).unwrap();
}

#[test]
fn what_the_manifest_does_not_name_is_left_alone() {
    let scratch = Scratch::new();
    left(&scratch, &["ours.csv", "gone.csv"]);
    fs::write(scratch.path().join("theirs.csv"), "mine").unwrap();
    fs::write(scratch.path().join("u_0003.vtu"), "mine").unwrap();
    fs::create_dir(scratch.path().join("place.csv")).unwrap();
    fs::remove_file(scratch.path().join("gone.csv")).unwrap();
    fs::create_dir(scratch.path().join("gone.csv")).unwrap();
    let plan = |file: &str| Plan { files: vec![file.to_owned()], ..Plan::default() };
    let dir = OutputDir::open(scratch.path()).unwrap();
    for name in ["theirs.csv", "place.csv", "gone.csv"] {
        match dir.begin(Kind::Run, &Identity::default(), &plan(name)) {
            Err(OutputError::Foreign { file, .. }) => assert_eq!(file, scratch.path().join(name)),
            other => panic!("{name}: {other:?}"),
        }
    }
    let steps = |n| Plan { series: vec![("u".to_owned(), "vtu", n)], ..Plan::default() };
    assert!(matches!(dir.begin(Kind::Run, &Identity::default(), &steps(4)), Err(OutputError::Foreign { .. })));
    // nothing was begun: the manifest is that of the earlier run
    assert_eq!(dir.holds().unwrap().1, State::Finished);
    assert!(matches!(dir.begin(Kind::Sweep, &Identity::default(), &steps(3)), Err(OutputError::OtherKind { .. })));
    dir.begin(Kind::Run, &Identity::default(), &steps(3)).unwrap();
    for name in ["theirs.csv", "place.csv", "gone.csv", "u_0003.vtu", MANIFEST_FILE] {
        let is_refused = put(&dir, name, "ours").is_err();
        assert!(is_refused, "{name}");
        assert!(dir.remove("theirs.csv").is_ok());
    }
    put(&dir, "ours.csv", "new").unwrap();
    assert_eq!(
        [scratch.read("theirs.csv"), scratch.read("u_0003.vtu"), scratch.read("ours.csv")],
        ["mine", "mine", "new"]
    );
}

#[cfg(unix)]
#[test]
fn links_are_not_followed() {
    let scratch = Scratch::new();
    left(&scratch, &["ours.csv", "checkpoint.wflc"]);
    let elsewhere = Scratch::new();
    let victim = elsewhere.path().join("victim");
    fs::write(&victim, "mine").unwrap();
    for name in ["ours.csv", "checkpoint.wflc", "other.csv"] {
        drop(fs::remove_file(scratch.path().join(name)));
        std::os::unix::fs::symlink(&victim, scratch.path().join(name)).unwrap();
    }
    let dir = OutputDir::create(scratch.path()).unwrap();
    for name in ["ours.csv", "other.csv"] {
        assert!(matches!(put(&dir, name, "x"), Err(OutputError::Foreign { .. })), "{name}");
    }
    for at in [0, 2] {
        assert!(matches!(dir.append("checkpoint.wflc", at, b"x"), Err(OutputError::Foreign { .. })), "at {at}");
    }
    drop(dir);
    fs::remove_file(scratch.path().join(MANIFEST_FILE)).unwrap();
    std::os::unix::fs::symlink(&victim, scratch.path().join(MANIFEST_FILE)).unwrap();
    assert!(matches!(OutputDir::create(scratch.path()), Err(OutputError::Foreign { .. })));
    assert_eq!(fs::read_to_string(victim).unwrap(), "mine");
}

#[test]
fn a_file_that_is_not_what_was_written_is_noticed() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    put(&dir, "u.csv", "1,2,3").unwrap();
    assert!(dir.verify("u.csv").unwrap().is_some());
    for (text, words) in [("1,2,", "4 bytes, 5 were"), ("1,2,3,4", "7 bytes, 5 were"), ("1,2,4", "not what was")] {
        fs::write(scratch.path().join("u.csv"), text).unwrap();
        assert!(dir.verify("u.csv").unwrap_err().to_string().contains(words), "{text}");
    }
    fs::remove_file(scratch.path().join("u.csv")).unwrap();
    assert!(dir.verify("u.csv").unwrap().is_none() && dir.verify("v.csv").unwrap().is_none());
    // a process that is killed while it replaces a file leaves the former one
    put(&dir, "u.csv", "first").unwrap();
    put(&dir, "u.csv", "second").unwrap();
    fs::write(scratch.path().join("u.csv"), "first").unwrap();
    assert!(dir.verify("u.csv").unwrap().is_some());
    dir.finish(State::Stopped).unwrap();
    assert!(dir.verify("u.csv").is_err());
    // of an earlier run it is none of this one's
    drop(dir);
    assert!(OutputDir::create(scratch.path()).unwrap().verify("u.csv").unwrap().is_none());
}

#[test]
fn what_a_killed_writer_left_is_known() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    put(&dir, "u.csv", "1").unwrap();
    dir.append("log", 0, b"ab").unwrap();
    dir.append("log", 2, b"cd").unwrap();
    dir.append("log", 3, b"e").unwrap();
    // as if killed: nothing is ended
    std::mem::forget(dir.books.lock().unwrap().journal.take());
    drop(dir);
    let dir = OutputDir::open(scratch.path()).unwrap();
    assert_eq!(dir.holds().unwrap().1, State::Running);
    assert_eq!(dir.own_files(), ["log", "u.csv"]);
    assert!(dir.verify("u.csv").unwrap().is_some() && dir.verify("log").unwrap().is_some());
    dir.go_on(Kind::Run, &Plan::default()).unwrap();
    put(&dir, "v.csv", "2").unwrap();
    dir.finish(State::Finished).unwrap();
    assert_eq!((dir.own_files().len(), scratch.read("log").as_str()), (3, "abce"));
}

#[test]
fn a_failed_write_keeps_the_former_file_and_names_it() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    put(&dir, "u.csv", "former").unwrap();
    let result = dir.write_atomic("u.csv", |out| {
        out.write_all(&vec![b'x'; 3 * BUFFER])?;
        Err(io::ErrorKind::StorageFull.into())
    });
    match result {
        Err(OutputError::Write { file, source }) => {
            assert_eq!(file, scratch.path().join("u.csv"));
            assert_eq!(source.kind(), io::ErrorKind::StorageFull);
        }
        other => panic!("{other:?}"),
    }
    assert_eq!(scratch.read("u.csv"), "former");
    drop(dir);
    assert_eq!(scratch.names(), [MANIFEST_FILE, "u.csv"]);
}

#[test]
fn temporary_files_of_a_killed_run_go_away() {
    let scratch = Scratch::new();
    fs::write(scratch.path().join(".wfl-1-0.tmp"), "half").unwrap();
    for name in [".wfl-notes", ".wfl-notes.tmp", ".wfl-1.tmp", ".wfl--0.tmp"] {
        fs::write(scratch.path().join(name), "mine").unwrap();
    }
    OutputDir::open(scratch.path()).unwrap();
    assert_eq!(scratch.names(), [".wfl--0.tmp", ".wfl-1.tmp", ".wfl-notes", ".wfl-notes.tmp"]);
}

#[test]
fn only_plain_visible_names_are_accepted() {
    let scratch = Scratch::new();
    let dir = OutputDir::create(scratch.path()).unwrap();
    for name in ["", ".", "..", ".hidden", "a/b", "../up", "a\\b", "a\nb", "a\0b"] {
        let result = put(&dir, name, "x");
        assert!(matches!(result, Err(OutputError::BadName { .. })), "{name:?}");
    }
    put(&dir, "Spannung σ (1).csv", "x").unwrap();
    drop(dir);
    assert_eq!(scratch.names(), ["Spannung σ (1).csv", MANIFEST_FILE]);
}

#[test]
fn only_steps_of_the_same_series_of_an_earlier_run_are_stale() {
    let scratch = Scratch::new();
    let others = ["u_00007.csv", "u_0007.vtu", "u_0007_0001.csv", "uu_0007.csv", "u_.csv"];
    left(&scratch, &[&others[..], &["u_0001.csv", "u_0002.csv", "u_12345.csv"]].concat());
    fs::write(scratch.path().join("u_0050.csv"), "mine").unwrap();
    let dir = OutputDir::create(scratch.path()).unwrap();
    put(&dir, &step_name("u", 1, "csv"), "new").unwrap();
    let removed = dir.remove_stale_steps("u", "csv").unwrap();
    assert_eq!(removed, ["u_0002.csv", "u_12345.csv"]);
    drop(dir);
    let mut kept: Vec<&str> = others.to_vec();
    kept.extend(["u_0001.csv", "u_0050.csv", MANIFEST_FILE]);
    kept.sort_unstable();
    assert_eq!(scratch.names(), kept);
}
