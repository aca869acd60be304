//! `wfl run --watch`: the page while a run goes on, and after it.

use crate::common::Folder;

/// A block pressed onto a floor in steps.
const SCENE: &str = "wfl 1
mesh box [0,0] to [1,1] cells [4,4] quad
region floor = faces where y == 0
region top   = faces where y == 1
unknown u : vector
term bulk    on all   : 1000*Sym(Grad_u):Grad_Test_u
term contact on floor : 1e5*pos_part(u.Normal)*(Test_u.Normal)
fix u = [0,-1e-3*t] on top
steps t = 1 to 5 by 1
measure force = integral(1e5*pos_part(u.Normal)) on floor
";

#[test]
fn the_page_of_a_run_has_its_measures_and_rests_when_it_has_ended() {
    let folder = Folder::new("watch");
    folder.write("pressed.wfl", SCENE);
    let done = folder.wfl(&["run", "pressed.wfl", "--watch"]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.success() && said.contains("watch the run in watch.html"), "{said}");
    let page = std::fs::read_to_string(folder.0.join("watch.html")).expect("the page");
    for words in ["5 of 5 steps done", "the run has ended", "Contact points", "force = ", "relative residual"] {
        assert!(page.contains(words), "{words}");
    }
    assert!(!page.contains("http-equiv"), "it would load itself for ever");
    // a page of ours is replaced, another file is not, and nothing is run before that is said
    assert!(folder.wfl(&["run", "pressed.wfl", "--watch", "--out", "again"]).status.success());
    folder.write("notes.html", "<p>mine</p>");
    let done = folder.wfl(&["run", "pressed.wfl", "--watch=notes.html", "--out", "never"]);
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert!(done.status.code() == Some(1) && said.contains("is no page of this program"), "{said}");
    assert!(!folder.0.join("never").exists());
    assert_eq!(std::fs::read_to_string(folder.0.join("notes.html")).expect("the file"), "<p>mine</p>");
    assert_eq!(folder.wfl(&["run", "pressed.wfl", "--watch", "--accuracy", "1e-2"]).status.code(), Some(1));
}
