//! `wfl new`: every scene to start from is written once, runs as it is, and is in canonical form.

use std::process::Output;

use crate::common::Folder;

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("UTF-8 output")
}

fn code(ran: &Output) -> i32 {
    ran.status.code().expect("an exit code")
}

#[test]
fn every_scene_to_start_from_is_written_formatted_and_solved_without_a_warning() {
    let folder = Folder::new("new-all");
    for template in wfl::TEMPLATES {
        let kind = template.kind;
        let file = format!("{kind}.wfl");
        let made = folder.wfl(&["new", kind]);
        assert_eq!(code(&made), 0, "{kind}: {}", text(&made.stderr));
        let written = std::fs::read_to_string(folder.0.join(&file)).expect("the scene is there");
        assert_eq!(written, template.text);
        assert_eq!(code(&folder.wfl(&["fmt", "--check", &file])), 0, "{kind} is not in canonical form");
        let comments = written.lines().filter(|l| l.trim_start().starts_with('#')).count();
        assert!(comments >= 4, "{kind} has {comments} lines of comments");
        assert!(written.contains("\nexpect "), "{kind} expects nothing");
        let ran = folder.wfl(&["run", &file]);
        assert_eq!(code(&ran), 0, "{kind}: {}{}", text(&ran.stdout), text(&ran.stderr));
        assert_eq!(text(&ran.stderr), "", "{kind} has messages");
    }
}

#[test]
fn a_file_that_is_there_is_never_overwritten() {
    let folder = Folder::new("new-twice");
    let mine = folder.write("heat.wfl", "# mine\n");
    let ran = folder.wfl(&["new", "heat"]);
    assert_eq!(code(&ran), 1);
    assert!(text(&ran.stderr).contains("heat.wfl is there already and stays as it is"), "{}", text(&ran.stderr));
    assert_eq!(std::fs::read_to_string(mine).expect("the file"), "# mine\n");
    let ran = folder.wfl(&["new", "heat", "wall.wfl"]);
    assert_eq!(code(&ran), 0);
    assert!(folder.0.join("wall.wfl").is_file());
}

#[test]
fn kinds_are_listed_without_one_and_beside_a_wrong_one() {
    let folder = Folder::new("new-kinds");
    let listed = text(&folder.wfl(&["new"]).stdout);
    let ran = folder.wfl(&["new", "signorni"]);
    assert_eq!(code(&ran), 1);
    let told = text(&ran.stderr);
    assert!(told.contains("help: wfl new signorini"), "{told}");
    for template in wfl::TEMPLATES {
        assert!(listed.contains(template.title) && told.contains(template.title), "{} is not listed", template.kind);
    }
    assert_eq!(std::fs::read_dir(&folder.0).expect("the folder").count(), 0);
}

#[test]
fn a_scene_has_the_ending_of_scenes() {
    let folder = Folder::new("new-ending");
    let ran = folder.wfl(&["new", "poisson", "mine"]);
    assert_eq!(code(&ran), 1);
    assert!(text(&ran.stderr).contains("wfl new poisson mine.wfl"), "{}", text(&ran.stderr));
}
