//! What a scene of a stranger may read, what a wrong command line is told, and what an import keeps to.

use crate::common::Folder;

const SCENE: &str = "\
mesh box [0,0] to [1,1] cells [2,2] quad
param E = 2
unknown u : scalar
term t on all : E*u*Test_u
measure m = max(u) on all
";

impl Folder {
    /// A project in a folder, and a file beside it.
    fn with_project(name: &str) -> Self {
        let folder = Self::new(name);
        std::fs::create_dir_all(folder.0.join("project")).expect("a folder");
        folder.write("laws.wfl", "param secret_word = 1\n???\n");
        folder
    }

    /// The exit code and everything printed by `wfl` in the project with this scene.
    fn stranger_told(&self, scene: &str, words: &[&str]) -> (i32, String) {
        self.write("project/scene.wfl", scene);
        let ran = self.command(words).current_dir(self.0.join("project")).output().expect("the program can be started");
        let text = [ran.stdout, ran.stderr].map(|b| String::from_utf8_lossy(&b).into_owned()).concat();
        (ran.status.code().unwrap_or(-1), text)
    }
}

#[test]
fn a_scene_reads_its_own_folder_only() {
    let folder = Folder::with_project("reads");
    let absolute = folder.0.join("laws.wfl").display().to_string();
    #[cfg(unix)]
    std::os::unix::fs::symlink(folder.0.join("laws.wfl"), folder.0.join("project/link.wfl")).expect("a link");
    let names = [
        "../laws.wfl",
        absolute.as_str(),
        #[cfg(unix)]
        "link.wfl",
    ];
    for name in names {
        for line in
            [format!("use \"{name}\""), format!("data k : scalar = \"{name}\""), format!("start from \"{name}\"")]
        {
            let (code, told) = folder.stranger_told(&format!("{SCENE}{line}\n"), &["check", "scene.wfl"]);
            assert!(code == 1 && told.contains("error[E217]") && told.contains("--allow-read"), "{line}: {told}");
            assert!(!told.contains("secret_word"), "{told}");
        }
    }
    let used = format!("{SCENE}use \"../laws.wfl\"\n");
    let (_, told) = folder.stranger_told(&used, &["check", "scene.wfl", "--allow-read", ".."]);
    assert!(!told.contains("E217") && told.contains("E118"), "{told}");
    // a file of another kind shows none of its words
    std::fs::write(folder.0.join("project/k.csv"), "secret_word, k\n1, 2\n").expect("a file");
    let (code, told) = folder.stranger_told(&format!("{SCENE}data k : scalar = \"k.csv\"\n"), &["check", "scene.wfl"]);
    assert!(code == 1 && told.contains("E418") && !told.contains("secret_word"), "{told}");
}

#[test]
fn a_wrong_command_line_is_told_what_to_type() {
    let folder = Folder::with_project("types");
    for (words, help) in [
        (&["run", "scene.wfl", "--E", "3"][..], "wfl run scene.wfl E=3"),
        (&["run", "scene.wfl", "--E=3"], "wfl run scene.wfl E=3"),
        (&["run", "scene.wfl", "--output", "here"], "wfl run scene.wfl --out here"),
        (&["run", "scene.wfl", "--jobs=2"], "wfl run scene.wfl --threads=2"),
        (&["scene.wfl"], "wfl run scene.wfl"),
        (&["run", "scene"], "wfl run scene.wfl"),
        (&["solve", "scene.wfl"], "wfl run scene.wfl"),
        (&["chek", "scene.wfl"], "wfl check scene.wfl"),
        (&["check", "scene.wfl", "E", "3"], "without spaces: E=3"),
        (&["check", "scene.wfl", "E", "=", "3"], "without spaces: E=3"),
    ] {
        let (code, told) = folder.stranger_told(SCENE, words);
        assert!(code == 1 && told.contains("= help: ") && told.contains(&format!("{help}\n")), "{words:?}: {told}");
        assert_eq!(told.matches("error").count(), 1, "{told}");
    }
    for word in ["\u{1b}[31mE1", "E\u{202e}1"] {
        let (code, told) = folder.stranger_told(SCENE, &["explain", word]);
        assert!(code == 1 && !told.contains(['\u{1b}', '\u{202e}']) && told.contains('\u{fffd}'), "{told:?}");
    }
}

#[test]
fn an_import_keeps_to_what_it_knows() {
    let folder = Folder::with_project("import");
    for (form, told) in [
        ("Interpolate(u, m).Test_u", "`m` is a transformation of the model"),
        ("inner(grad(u), grad(v))*dx", "no word of GetFEM's language"),
        ("lambda.Test_u + Grad_u:Grad_Test_u + u.Test_lambda", "`lambda` has a test function and no derivative"),
        ("u.Test_u.c", "does not compile"),
        ("x*Test_u", "`x` is a name of the model there and a coordinate here"),
        ("f", "nothing says what is solved for"),
    ] {
        let (code, text) = folder.stranger_told(SCENE, &["import", form]);
        assert!(code == 1 && text.contains(told), "{form}: {text}");
    }
    let (code, text) = folder.stranger_told(SCENE, &["import", "-Grad_u.Grad_Test_u # a comment\n + u*Test_u"]);
    assert!(code == 0 && text.ends_with("term on all : -Grad_u.Grad_Test_u + u*Test_u\n"), "{text}");
}

#[test]
fn an_expectation_that_fails_shows_its_numbers() {
    let folder = Folder::with_project("expects");
    let (code, told) = folder.stranger_told(&format!("{SCENE}expect m > E/4\n"), &["run", "scene.wfl", "-q"]);
    assert!(code == 3 && told.contains("E604") && told.contains("m is 0, E/4 is 0.5"), "{told}");
}
