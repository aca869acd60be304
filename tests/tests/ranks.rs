//! One scene on several ranks: residuals and tangents have the bits of one rank, on every rank.

use std::path::Path;

use wfl_discrete::{
    system::{Branches, Form, LinearTerms},
    window::Window,
};
use wfl_host::team::in_threads;
use wfl_jit::JitBackend;
use wfl_problem::Scene;
use wfl_sparse::csr::Csr;
use wfl_tests::prepared;

/// What the ranks have together.
#[derive(PartialEq)]
struct Assembled {
    /// Vectors by dof, one after the other.
    vectors: Vec<Vec<u64>>,
    /// Counts of branches and states of contact, as text.
    branches: String,
    /// Matrices with the rows of all ranks.
    matrices: Vec<Csr>,
    /// Rows that this rank has.
    own: usize,
}

fn example(path: &str, edits: &[(&str, String)]) -> Scene {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples").join(path);
    let text = std::fs::read_to_string(&file).expect("an example");
    let backend = JitBackend::new().expect("machine code on this processor");
    prepared(file.parent().expect("a folder"), text, edits, &[], &backend).expect("a scene")
}

fn bits(values: &[f64]) -> Vec<u64> {
    // adding zero takes the sign off a zero
    values.iter().map(|x| (x + 0.0).to_bits()).collect()
}

/// Displacements of a thousandth, the same in every run.
fn state(scene: &Scene) -> Vec<f64> {
    let at = |k: usize| ((k * 7919) % 1009) as f64 / 1009.0 - 0.5;
    (0..scene.system.numbering.n_dofs).map(|k| 2e-3 * at(k)).collect()
}

fn assembled(scene: &mut Scene) -> Assembled {
    let window = match scene.steps.values.as_slice() {
        [first, second, ..] => Window::new(*second, second - first),
        _ => Window::new(1.0, 1.0),
    };
    let u = state(scene);
    let Scene { system, contact, .. } = scene;
    let known: Vec<usize> = (0..system.fields.len()).filter(|k| system.data()[*k].is_empty()).collect();
    let unsolved: Vec<usize> = known.into_iter().filter(|k| system.numbering.starts[*k].is_none()).collect();
    for k in unsolved {
        let n = system.fields[k].n_dofs();
        system.set_data(k, vec![0.25; n]);
    }
    system.begin_rates(window.increment);
    system.begin_step(window).expect("finite");
    contact.begin_step(window);
    let mut all = Assembled { vectors: Vec::new(), branches: String::new(), matrices: Vec::new(), own: 0 };
    let mut tangent = system.new_tangent();
    let stuck = contact.tied(system, &u);
    for (branches, linear) in
        [(Branches::AsWritten, LinearTerms::ByMatrix), (Branches::Frozen(&stuck), LinearTerms::AtPoints)]
    {
        let residual = system.residual(&u, &Form { branches, linear, ..Form::AS_WRITTEN }).expect("finite");
        system.tangent(&u, branches, &mut tangent).expect("finite");
        let rounding = system.rounding(&u, &residual, &tangent);
        all.vectors.push(bits(&residual.forces));
        for mut numbers in [residual.values, residual.linear_sizes, rounding] {
            // each rank has its rows
            system.team().sum(&mut numbers);
            all.vectors.push(bits(&numbers));
        }
        all.branches.push_str(&format!("{:?}", residual.branches));
        all.matrices.push(system.whole(tangent.changing.clone()).expect("fits"));
    }
    all.own = (0..system.numbering.n_dofs).filter(|dof| system.owns(*dof)).count();
    all.matrices.push(system.whole(system.bulk().clone()).expect("fits"));
    all
}

fn on_ranks(path: &str, edits: &[(&str, String)], ranks: usize) -> Vec<Assembled> {
    std::thread::scope(|scope| {
        let each = in_threads(ranks).into_iter().map(|team| {
            scope.spawn(move || {
                let mut scene = example(path, edits);
                scene.share_rows(team);
                assembled(&mut scene)
            })
        });
        let each: Vec<_> = each.collect();
        each.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
    })
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn ranks_have_the_residuals_and_tangents_of_one() {
    let smaller = [("cells [8, 8, 8]", "cells [4, 4, 4]".to_owned())];
    let massless = [("beta=0.2652 gamma=0.53", "massless=wall".to_owned())];
    let scenes: [(&str, &[(&str, String)]); 12] = [
        ("fault/nitsche.wfl", &smaller),
        ("fault/augmented_lagrangian.wfl", &smaller),
        ("fault_gmsh/fault_30deg.wfl", &[]),
        ("surfaces/tjunction.wfl", &[]),
        ("mapping/pressed.wfl", &[]),
        ("mapping/periodic.wfl", &[]),
        ("elasticity/rollers.wfl", &[]),
        ("hyperelastic/shear.wfl", &[]),
        ("plasticity/perzyna.wfl", &[]),
        ("stokes/stokes.wfl", &[]),
        ("hertz/hertz.wfl", &[]),
        ("dynamics/bar.wfl", &massless),
    ];
    for (path, edits) in scenes {
        let alone = assembled(&mut example(path, edits));
        for ranks in 2..=4 {
            for (rank, found) in on_ranks(path, edits, ranks).into_iter().enumerate() {
                let name = format!("{path}, rank {rank} of {ranks}");
                for (k, (found, expected)) in found.vectors.iter().zip(&alone.vectors).enumerate() {
                    let apart = found.iter().zip(expected).filter(|(a, b)| a != b).count();
                    assert!(apart == 0 && found.len() == expected.len(), "{name}: vector {k} differs at {apart}");
                }
                assert_eq!(found.branches, alone.branches, "{name}");
                for (k, (found, expected)) in found.matrices.iter().zip(&alone.matrices).enumerate() {
                    assert_eq!(found.pattern(), expected.pattern(), "{name}: pattern {k}");
                    assert_eq!(bits(found.values()), bits(expected.values()), "{name}: matrix {k}");
                }
                let most = alone.own.div_ceil(ranks) * 3 / 2;
                assert!(ranks * found.own >= alone.own / 2 && found.own <= most, "{name}: {}", found.own);
            }
        }
    }
}

#[test]
fn ranks_have_the_forces_of_the_mass_that_nodes_gave_away() {
    let edits = [("beta=0.2652 gamma=0.53", "massless=wall".to_owned())];
    let forces = |scene: &Scene| {
        let mut out = vec![0.0; scene.system.numbering.n_dofs];
        scene.system.add_redistributed(&state(scene), &mut out);
        scene.system.team().sum(&mut out);
        bits(&out)
    };
    let alone = forces(&example("dynamics/bar.wfl", &edits));
    assert!(alone.iter().any(|word| *word != 0));
    std::thread::scope(|scope| {
        for team in in_threads(2) {
            scope.spawn(|| {
                let mut scene = example("dynamics/bar.wfl", &edits);
                scene.share_rows(team);
                assert_eq!(forces(&scene), alone);
            });
        }
    });
}

#[test]
fn a_number_that_is_not_finite_is_the_same_error_on_every_rank() {
    let told = |scene: &mut Scene| {
        let mut u = state(scene);
        scene.system.begin_step(Window::new(1.0, 1.0)).expect("finite");
        // a cell turned inside out far from the parts of most ranks
        u[0] = 1e3;
        let residual = scene.system.residual(&u, &Form::AS_WRITTEN);
        residual.map_or_else(|error| format!("{error:?}"), |_| "finite".to_owned())
    };
    let edits = [("n = 4", "n = 6".to_owned())];
    let alone = told(&mut example("hyperelastic/shear.wfl", &edits));
    assert!(alone.contains("NonFinite"), "{alone}");
    let each: Vec<String> = std::thread::scope(|scope| {
        let each = in_threads(3).into_iter().map(|team| {
            scope.spawn(|| {
                let mut scene = example("hyperelastic/shear.wfl", &edits);
                scene.share_rows(team);
                told(&mut scene)
            })
        });
        let each: Vec<_> = each.collect();
        each.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
    });
    assert!(each.iter().all(|text| *text == alone), "{each:?}");
}
