//! Known fields at a value of the step variable, and what the first step needs of them.

use wfl_compiler::Class;

use super::{RuleChoice, Scene};
use crate::{
    checks::{self, CoarseLoad, Hourglass, LockedBody, NegativeBody},
    consistency::{self, ContactForm},
    contact::{Coercivity, coercivity as of_contact},
    finite::BadGiven,
    system::{System, SystemError},
};

/// First values of the scene: those of the unknowns by dof, those of states where they are kept.
pub(crate) fn start(scene: &mut Scene) -> Result<Vec<f64>, BadGiven> {
    let mut u = vec![0.0; scene.system.numbering.n_dofs];
    let time = scene.steps.first();
    for (field, value) in &mut scene.starts {
        let positions = node_positions(&scene.system, *field);
        let values = agreed(&scene.system, value.at(&positions, time, 0.0))?;
        match scene.system.numbering.starts[*field] {
            Some(first) => u[first..first + values.len()].copy_from_slice(&values),
            None => scene.system.known.data[*field] = values,
        }
    }
    scene.system.numbering.follow(&mut u);
    Ok(u)
}

/// The parameter of each Nitsche term of a scene against the smallest for which the method is coercive, at its first
/// step. Nothing is assembled.
///
/// # Errors
/// [`SystemError`] where a known field has no finite value.
pub fn coercivity(scene: &mut Scene) -> Result<Vec<Coercivity>, SystemError> {
    begin_first_step(scene)?;
    Ok(of_contact(&scene.system, &scene.contact))
}

/// The fields of a scene whose terms on cells are not positive definite, at its first step. Nothing is assembled.
///
/// # Errors
/// [`SystemError`] where a known field has no finite value.
pub fn negative_bodies(scene: &mut Scene) -> Result<Vec<NegativeBody>, SystemError> {
    begin_first_step(scene)?;
    Ok(checks::negative_bodies(&scene.system))
}

/// The displacements of a scene whose bodies are nearly incompressible on elements of degree 1, at its first step. Nothing
/// is assembled.
///
/// # Errors
/// [`SystemError`] where a known field has no finite value.
pub fn locked_bodies(scene: &mut Scene) -> Result<Vec<LockedBody>, SystemError> {
    begin_first_step(scene)?;
    Ok(checks::locked_bodies(&scene.system))
}

/// The loads of a scene that their quadrature rules do not resolve, each at the first of three steps where it is so: one in
/// the middle, the last and the first. Loads that are integrated exactly are not looked at.
///
/// # Errors
/// [`SystemError`] where a known field has no finite value.
pub fn coarse_loads(scene: &mut Scene) -> Result<Vec<CoarseLoad>, SystemError> {
    let mut ruled: Vec<(usize, usize)> = scene
        .terms
        .iter()
        .enumerate()
        .filter_map(|(k, t)| match t.rule {
            RuleChoice::Degree(degree) if t.class == Class::Constant => Some((k, degree)),
            _ => None,
        })
        .collect();
    let values = scene.steps.values.clone();
    let last = values.len().saturating_sub(1);
    let mut found: Vec<CoarseLoad> = Vec::new();
    for at in [last.div_ceil(2), last, 0] {
        if ruled.is_empty() {
            break;
        }
        let time = values.get(at).copied().unwrap_or(0.0);
        let increment = scene.steps.first_increment();
        set_data(scene, time, increment)?;
        scene.system.set_laws(time, increment);
        found.extend(checks::coarse_loads(&scene.system, &ruled));
        ruled.retain(|(term, _)| found.iter().all(|f| f.term != *term));
    }
    found.sort_by_key(|f| f.term);
    Ok(found)
}

/// The kinds of cells on which the terms at these positions leave deformations without stiffness because of their rule,
/// at the first step of a scene. Nothing is assembled but single cells.
///
/// # Errors
/// [`SystemError`] where a known field has no finite value.
pub fn hourglasses(scene: &mut Scene, given: &[usize]) -> Result<Vec<Hourglass>, SystemError> {
    begin_first_step(scene)?;
    Ok(checks::hourglasses(&scene.system, given))
}

/// Brings known fields and laws to the first step.
fn begin_first_step(scene: &mut Scene) -> Result<(), SystemError> {
    let (time, increment) = (scene.steps.first(), scene.steps.first_increment());
    set_data(scene, time, increment)?;
    scene.system.set_laws(time, increment);
    scene.contact.begin_step(scene.system.known.step(time, increment));
    Ok(())
}

/// Judges the contact terms of a scene, at its last step.
pub fn contact_forms(scene: &mut Scene) -> Vec<ContactForm> {
    let values = &scene.steps.values;
    let time = values.last().copied().unwrap_or(0.0);
    let increment = match &scene.steps.auto {
        Some(auto) => auto.first,
        None => values.len().checked_sub(2).map_or(1.0, |k| time - values[k]),
    };
    // where a known field is not finite, the run itself says which
    if scene.contact.is_empty() || set_data(scene, time, increment).is_err() {
        return Vec::new();
    }
    scene.system.set_laws(time, increment);
    scene.contact.begin_step(scene.system.known.step(time, increment));
    consistency::contact_forms(&scene.system, &scene.contact)
}

/// Brings the known fields to a value of the step variable.
///
/// # Errors
/// [`SystemError::Given`] for a value that is not finite.
pub(crate) fn set_data(scene: &mut Scene, time: f64, increment: f64) -> Result<(), SystemError> {
    for (field, value) in &mut scene.data {
        let positions = node_positions(&scene.system, *field);
        let values = agreed(&scene.system, value.at(&positions, time, increment));
        scene.system.known.data[*field] = values.map_err(Box::new)?;
    }
    Ok(())
}

/// Values at the nodes that this rank has: of a part of the mesh the others have other nodes, and other errors.
fn agreed(system: &System, own: Result<Vec<f64>, BadGiven>) -> Result<Vec<f64>, BadGiven> {
    if system.mesh.is_whole() { own } else { BadGiven::agreed(own, system.mesh.team()) }
}

pub(crate) fn node_positions(system: &System, field: usize) -> Vec<[f64; 3]> {
    let f = &system.fields[field];
    (0..f.n_nodes()).map(|n| f.node_position(n)).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use wfl::{NoFiles, SourceMap, resolve};
    use wfl_compiler::InterpreterBackend;

    use super::coercivity;

    #[test]
    fn the_variant_of_nitsches_method_and_its_parameter_come_out_as_they_are_written() {
        for (young, gamma) in [("100", "300"), ("97.3", "123.457"), ("2.1e11", "1e13/7"), ("1/3", "0.7")] {
            for theta in ["1", "0", "-1", "0.3"] {
                let text = format!(
                    "wfl 1
param E = {young}
param gamma = {gamma}
param theta = {theta}
mesh box [0,0] to [1,1] cells [2,2] quad
region floor = faces where y == 0
region top = faces where y == 1
unknown u : vector
def stress(v) = E*Sym(Grad_v) + 0.3*E*Trace(Grad_v)*Id(2)
def pn(v) = (stress(v)*Normal).Normal
term elastic on all : stress(u):Grad_Test_u
term consistent on floor : -theta/gamma*pn(u)*pn(Test_u)
term contact on floor : 1/gamma*pos_part(gamma*u.Normal - pn(u))*(gamma*Test_u.Normal - theta*pn(Test_u))
fix u(1) = 0 on top
load u = [0,-1] on top
"
                );
                let mut sources = SourceMap::new();
                let main = sources.add("scene.wfl", text);
                let script = resolve(&mut sources, main, &mut NoFiles, &[]);
                let script = script.value.unwrap_or_else(|| panic!("{:?}", script.diagnostics));
                let made = crate::prepare(&script, Path::new("."), &InterpreterBackend);
                let mut scene = made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics));
                let value = |name: &str| scene.params.iter().find(|p| p.0 == name).unwrap().1.values[0];
                let (gamma, theta) = (value("gamma"), value("theta"));
                let found = coercivity(&mut scene).unwrap();
                assert_eq!(found.iter().map(|c| (c.theta, c.gamma)).collect::<Vec<_>>(), [(theta, gamma)]);
            }
        }
    }
}
