//! What a command line asks of a run that does not go together.

use wfl::{Code, Diagnostic};
use wfl_gradient::{Request, ahead, stated};
use wfl_output::record::MESH_FILE;
use wfl_problem::{Scene, place_of_moving, shared_beside};
use wfl_run::may_begin;
use wfl_tasks::{Loaded, folder::error_line, gradient::files};

use crate::{
    args::RunArgs,
    ended::explain,
    load::{print_all, say},
    ready::folder,
    solvers::Solvers,
};

/// Says that there is no accuracy of which the command line says more.
pub(crate) fn says_more_of_no_accuracy(args: &RunArgs) -> bool {
    let says_more = args.of.is_some() || args.budget.is_some();
    if says_more {
        say("error: --of and --budget say more about an accuracy\n  = help: --accuracy 1e-3\n");
    }
    says_more
}

/// Whether a setting can be picked for an accuracy; says why not.
pub(crate) fn may_pick(args: &RunArgs, loaded: &Loaded, scene: &Scene) -> bool {
    if scene.system.has_moving_images()
        && let Some(span) = place_of_moving(&loaded.script)
    {
        let d = Diagnostic::new(Code::E802, "no accuracy is estimated where a mapping moves");
        let d = d.at(span, "its images follow the bodies").help("compare runs on two meshes: wfl sweep");
        print_all(&[d], &loaded.sources);
        return false;
    }
    if !loaded.knobs.is_empty() {
        say("error: mesh, degree and tolerance are picked for the accuracy: they cannot be given, too\n");
        return false;
    }
    if args.backend != Solvers::Own {
        say("error: for an accuracy a scene is run with the solvers of this program\n  = help: leave --backend out\n");
        return false;
    }
    if args.gradient.gradient.is_some() || !loaded.script.gradients.is_empty() {
        say(
            "error: a scene that asks for an accuracy is run on several meshes: derivatives do not go with it\n  = help: run the \
             setting that was found with --gradient\n",
        );
        return false;
    }
    // on the command line these exclude each other; the scene may ask for an accuracy, too
    if args.savings || args.resume {
        say(
            "error: a scene that asks for an accuracy is run on several meshes: --savings and --resume do not go with it\n",
        );
        return false;
    }
    may_write(args, loaded, scene, &[(MESH_FILE.to_owned(), "the mesh for the accuracy".to_owned())])
}

/// Whether what is asked for beside the results of a run can be done, looked at before anything is; says why not.
pub(crate) fn may_do_more(args: &RunArgs, loaded: &Loaded, scene: &Scene, request: Option<&Request>) -> bool {
    let stated = match stated(scene, &loaded.script) {
        Ok(stated) => stated,
        Err(d) => {
            print_all(&[*d], &loaded.sources);
            return false;
        }
    };
    let all: Vec<&Request> = stated.iter().chain(request).collect();
    if let Some(d) = all.iter().find_map(|request| ahead(scene, &loaded.script, request).err()) {
        print_all(&[*d], &loaded.sources);
        return false;
    }
    let files: Vec<(String, String)> = all.iter().copied().flat_map(files).collect();
    let nothing = !args.savings && all.is_empty();
    nothing || may_write(args, loaded, scene, &files)
}

/// Messages about files of the derivatives that a scene states which other results have, too.
pub(crate) fn shares_files(loaded: &Loaded, scene: &Scene) -> Vec<Diagnostic> {
    // what is wrong with the statements themselves a run tells
    let stated = stated(scene, &loaded.script).unwrap_or_default();
    let files: Vec<(String, String)> = stated.iter().flat_map(files).collect();
    shared_beside(&loaded.script, scene.steps.several(), &files)
}

/// Whether the results can be written, and beside them the files `more`, each with what is in it; looked at before other
/// runs are made for this one; says why not.
fn may_write(args: &RunArgs, loaded: &Loaded, scene: &Scene, more: &[(String, String)]) -> bool {
    let shared = shared_beside(&loaded.script, scene.steps.several(), more);
    if !shared.is_empty() {
        print_all(&shared, &loaded.sources);
        return false;
    }
    let names: Vec<&str> = more.iter().map(|(name, _)| name.as_str()).collect();
    match folder(args, loaded).map(|out| may_begin(scene, &out, &names)) {
        Ok(Ok(())) => return true,
        Ok(Err(error)) => explain(loaded, scene, &error),
        Err(why) => say(&error_line(&why)),
    }
    false
}
