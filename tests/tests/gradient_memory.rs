//! Steps that are computed again to keep to a bound of memory: derivatives have the bits that they have with all steps in memory.

use std::path::Path;

use wfl_gradient::{Direction, Gradients, Request, Tangents, gradients, tangents};
use wfl_run::{PassedStep, RunOptions};
use wfl_tests::ran_with;

/// A body on springs that is pulled up and down: friction with a memory, a state, and a rate.
const FRICTION: &str = "wfl 1
param p = 0.3
param q = 1.5
mesh box [0,0] to [2,1] cells [4,4] quad
region bottom = faces where y == 0
region top = faces where y == 1
unknown u : scalar
unknown tau : scalar on bottom
state worn : scalar on bottom := worn + abs(tau*(u - Previous_u))
term bulk on all : Grad_u.Grad_Test_u
term drag on all : 0.1*Dot_u*Test_u
term shear on bottom : tau*Test_u
term law on bottom : -(tau - Ball_projection(tau + 8*(u - Previous_u), p*(1 + x/4)/(1 + worn)))*Test_tau
fix u = q*(if t <= 1 then t else 2 - t) on top
steps t = 0 to 2 by 0.05
measure m = mean(u^2) on all
measure n = mean(worn) on bottom
";

/// The same with steps that the run chooses.
fn by_auto() -> String {
    let text = FRICTION.replace("steps t = 0 to 2 by 0.05", "steps t = 0 to 2 by auto with error=1e-3");
    text.replace("q*(if t <= 1 then t else 2 - t)", "q*t^2/2")
}

/// A bar that hits a wall: Newmark's rule, and explicit steps.
fn bar(scheme: &str) -> String {
    format!(
        "wfl 1\nparam p = 2\nparam q = 0.5\nmesh box [0] to [1] cells [8] segment\n\
         region left = faces where x == 0\nregion right = faces where x == 1\nunknown u : scalar\n\
         term bulk on all : p*Grad_u.Grad_Test_u\nterm mass on all : Dot2_u*Test_u\n\
         term wall on right : 20*pos_part(u - 0.1)*Test_u\nfix u = 0 on left\nstart Dot_u = q*x\n{scheme}\n\
         measure m = mean(u^2) on all\nmeasure n = max(u) on right\n"
    )
}

fn found(text: &str, bound: Option<u64>) -> (Gradients, Tangents, u64) {
    let options = RunOptions {
        keep_trajectory: true,
        trajectory_bytes: bound,
        ..RunOptions::without_files(2, std::time::Instant::now())
    };
    let request = Request::read("m, sum(n), mean(m)", "p, q").expect("names");
    let direction = Direction { parameters: vec![("p".to_owned(), vec![1.0])], fields: Vec::new() };
    let made = ran_with(&options, (Path::new("."), text.to_owned()), &[], &[], |of| {
        let steps = of.outcome.trajectory.iter().flat_map(|t| &t.steps);
        let bytes = steps.map(|step| PassedStep::bytes(step)).sum();
        let along = tangents(of, &["m".to_owned(), "n".to_owned()], std::slice::from_ref(&direction))?;
        Ok((gradients(of, &request)?, along, bytes))
    });
    made.unwrap_or_else(|told| panic!("{told}")).1
}

fn bits(of: &Gradients) -> Vec<u64> {
    of.results.iter().flat_map(|r| r.parameters.iter().flat_map(|p| &p.1)).map(|x| x.to_bits()).collect()
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn steps_that_are_computed_again_give_the_same_bits() {
    let newmark = "scheme newmark\nsteps t = 0 to 2 by 0.02";
    let explicit = "scheme explicit fraction=0.5\nsteps t = 0 to 2 by 0.05";
    for text in [FRICTION.to_owned(), by_auto(), bar(newmark), bar(explicit)] {
        let (all, along, bytes) = found(&text, None);
        assert_eq!((all.steps_again, along.steps_again), (0, 0));
        let bound = bytes / 3;
        let (some, some_along, held) = found(&text, Some(bound));
        assert_eq!(bits(&all), bits(&some), "{text}");
        let number = |of: &Tangents| of.moved.iter().flatten().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
        assert_eq!(number(&along), number(&some_along), "{text}");
        // more than half of the steps, each once in either direction
        assert!(some.steps_again > 0 && some_along.steps_again > 0, "{text}");
        assert!(some.steps_again == some_along.steps_again, "{} {}", some.steps_again, some_along.steps_again);
        assert!(held <= bound, "{held} of {bound}");
    }
}
