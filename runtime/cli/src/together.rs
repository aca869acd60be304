//! What a command line asks of a run that does not go together.

use wfl_runtime::{Scene, accuracy::MESH_FILE, may_begin};
use wfl_tasks::{Loaded, folder::error_line};

use crate::{args::RunArgs, ended::explain, load::say, ready::folder, solvers::Solvers};

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
    if !loaded.knobs.is_empty() {
        say("error: mesh, degree and tolerance are picked for the accuracy: they cannot be given, too\n");
        return false;
    }
    if args.backend != Solvers::Own {
        say("error: for an accuracy a scene is run with the solvers of this program\n  = help: leave --backend out\n");
        return false;
    }
    // on the command line these exclude each other; the scene may ask for an accuracy, too
    if args.savings || args.resume {
        say(
            "error: a scene that asks for an accuracy is run on several meshes: --savings and --resume do not go with it\n",
        );
        return false;
    }
    may_write(args, loaded, scene, &[MESH_FILE])
}

/// Whether the results can be written, and the files `more` beside them, looked at before other runs are made for this
/// one; says why not.
pub(crate) fn may_write(args: &RunArgs, loaded: &Loaded, scene: &Scene, more: &[&str]) -> bool {
    match folder(args, loaded).map(|out| may_begin(scene, &out, more)) {
        Ok(Ok(())) => return true,
        Ok(Err(error)) => explain(loaded, scene, &error),
        Err(why) => say(&error_line(&why)),
    }
    false
}
