//! One scene on several ranks: residuals and tangents have the bits of one rank, on every rank.

use std::path::Path;

use wfl_compiler::types::{RateForm, RateOrder};
use wfl_discrete::{
    system::{Branches, Form, InRates, LinearTerms, System},
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

/// The products of the mass with accelerations and its matrix over the free dofs, of all rows.
fn masses(scene: &mut Scene) -> (Vec<f64>, Csr) {
    let u = state(scene);
    let mut forces = scene.system.mass_times(&u, &u).expect("finite");
    scene.system.team().sum(&mut forces);
    let own = scene.system.mass_over_free(&u, Branches::AsWritten).expect("finite");
    (forces, scene.system.whole(own).expect("fits"))
}

#[test]
fn ranks_have_the_mass_that_nodes_gave_away() {
    let edits = [("beta=0.2652 gamma=0.53", "massless=wall".to_owned())];
    let (forces, mass) = masses(&mut example("dynamics/bar.wfl", &edits));
    let of = |forces: &[f64], mass: &Csr| (bits(forces), bits(mass.values()));
    let alone = of(&forces, &mass);
    assert!(alone.0.iter().any(|word| *word != 0));
    std::thread::scope(|scope| {
        for team in in_threads(2) {
            scope.spawn(|| {
                let mut scene = example("dynamics/bar.wfl", &edits);
                scene.share_rows(team);
                let (forces, mass) = masses(&mut scene);
                assert_eq!(of(&forces, &mass), alone);
            });
        }
    });
}

/// On bodies with faces, in local frames of nodes, with dofs that follow others, with mass that was given away.
#[test]
fn a_mass_over_free_dofs_has_the_products_of_the_mass() {
    let turned = "mesh box [0,0] to [3,2] cells [4,3] quad map [0.8*x - 0.6*y, 0.6*x + 0.8*y]\n\
        region floor = faces where abs(0.8*y - 0.6*x) < 1e-6\nunknown u : vector\nunknown p : scalar\n\
        term inertia on all : (2 + u.u)*Dot2_u.Test_u + 1e9*Grad_u:Grad_Test_u\nterm plate on floor : 3*Dot2_u.Test_u\n\
        term flow on all : 5*Dot_p*Test_p + Dot_u.Grad_Test_p\nfix u.Normal = 0 on floor\nsteps t = 0 to 1 by 0.1\n";
    let backend = JitBackend::new().expect("machine code on this processor");
    let text = |edits| prepared(Path::new("."), turned.to_owned(), edits, &[], &backend).expect("a scene");
    let constant = [("(2 + u.u)", "2".to_owned()), ("3*Dot2_u", "0*Dot2_u".to_owned())];
    let given_away = [&constant[..], &[("steps", "scheme bdf2 massless=floor\nsteps".to_owned())]].concat();
    let scenes = [
        text(&[]),
        text(&given_away),
        example("dynamics/bars.wfl", &[]),
        example("dynamics/sphere.wfl", &[]),
        example("dynamics/sliding.wfl", &[]),
    ];
    for (k, mut scene) in scenes.into_iter().enumerate() {
        let u = state(&scene);
        let matrix = scene.system.mass_over_free(&u, Branches::AsWritten).expect("finite");
        let system = &mut scene.system;
        let free: Vec<f64> = (0..matrix.n_cols()).map(|k| u[system.numbering.free_dofs[k] as usize]).collect();
        let zero = vec![0.0; u.len()];
        let mut rates = zero.clone();
        system.numbering.advance(&zero, &free, 1.0, &mut rates);
        let is_first = |system: &System, d: usize| {
            let rates = system.rates().expect("rates").fields();
            rates.iter().any(|of| of.form == RateForm::First && of.dofs.contains(&d))
        };
        let mut forces = system.mass_times(&u, &rates).expect("finite");
        let of_first: Vec<f64> = (0..u.len()).map(|d| if is_first(system, d) { rates[d] } else { 0.0 }).collect();
        let terms: Vec<usize> = (0..system.terms.len()).collect();
        let first = InRates { order: RateOrder::First, terms: &terms, at: &u, branches: Branches::AsWritten };
        let beside = system.times_rates(first, &of_first).expect("finite");
        forces.iter_mut().zip(beside).for_each(|(f, b)| *f += b);
        system.numbering.turn(&mut forces);
        let (mut exact, mut found) = (Vec::new(), vec![0.0; free.len()]);
        system.numbering.gather(&forces, &mut exact);
        matrix.multiply(&free, &mut found, 1);
        let largest = exact.iter().fold(0.0f64, |m, x| m.max(x.abs()));
        let error = exact.iter().zip(&found).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
        assert!(largest > 0.0 && error < 1e-14 * largest, "scene {k}: {error} of {largest}");
    }
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
