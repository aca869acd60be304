//! `scheme ... massless=REGION`: the nodes of a region, such as the faces of contact, give their mass to nodes beside them.
//!
//! Done once, before the run, at the state where time starts. Promises: an error names what stands against it; scenes that
//! do not ask for it are left alone.

use wfl::{Code, Diagnostic, ResolvedScript, ast::Ident, nearest};
use wfl_discrete::redistribution::{Unmovable, redistribution};

use super::Scene;

/// Takes the mass from the nodes of a region.
pub(super) fn finish(scene: &mut Scene, script: &ResolvedScript, region: &Ident) -> Result<(), Box<Diagnostic>> {
    let Some(set) = scene.regions.get(&region.name).map(|r| r.set.clone()) else {
        let d = Diagnostic::new(Code::E452, format!("there is no region `{}`", region.name));
        let near = nearest(&region.name, scene.regions.keys().map(String::as_str));
        return Err(d.did_you_mean(region.span, near).into());
    };
    if let Some(state) = scene.states.iter().find(|state| state.reads_second_rates()) {
        let name = &scene.system.fields[state.field].name;
        let d = Diagnostic::new(Code::E452, format!("the state `{name}` reads accelerations"));
        let declared = script.fields.iter().find(|f| f.name.name == *name).map_or(region.span, |f| f.name.span);
        let d = d.at(declared, "").at(region.span, "laws of a step see none where nodes give their mass to others");
        return Err(d.help("without `massless`, or a state of the velocity").into());
    }
    let first = scene.steps.first_window();
    let given =
        |error| Diagnostic::new(Code::E452, format!("the mass cannot be computed: {error}")).at(region.span, "");
    let mut equations = scene.equations();
    scene.solving(&mut equations).set_data(first).map_err(|e| given(e.to_string()))?;
    equations.system.set_laws(first);
    let mesh = &scene.system.mesh;
    let found = redistribution(&mut equations.system, &|field| field.nodes_in(mesh, &scene.topology, &set));
    let made = found.map_err(|why| Box::new(unmovable(scene, script, region, why)))?;
    scene.system.redistribute(made);
    Ok(())
}

/// What is said of nodes that cannot give their mass away.
fn unmovable(scene: &Scene, script: &ResolvedScript, region: &Ident, why: Unmovable) -> Diagnostic {
    let name = &region.name;
    match why {
        Unmovable::NoNodes => {
            let d = Diagnostic::new(Code::E452, format!("`massless={name}` takes mass from nowhere"));
            d.at(region.span, "no field with a second rate has nodes there")
        }
        Unmovable::Mixed { term } => {
            let span = scene.terms.get(term).map_or(region.span, |t| t.span);
            let d = Diagnostic::new(Code::E452, "this inertia is no mass that stays the same");
            let text = "what else depends on unknowns or on the step variable stands in the same term";
            let d = d.at(span, text).at(region.span, "its mass is to be taken from some nodes");
            d.help("write the inertia as a term of its own: rho*Dot2_u.Test_u")
        }
        Unmovable::OnFaces { term } => {
            let span = scene.terms.get(term).map_or(region.span, |t| t.span);
            let d = Diagnostic::new(
                Code::E452,
                "this mass is that of the faces themselves, and would be moved by a layer of cells",
            );
            let d = d.at(span, "").at(region.span, "its nodes are to have no mass");
            d.help("without `massless`, or with the mass on other faces")
        }
        Unmovable::Turning { term } => {
            let span = scene.terms.get(term).map_or(region.span, |t| t.span);
            let d = Diagnostic::new(Code::E452, "this force of the velocity is not symmetric");
            let text = "nodes without mass have rates of another kind than the others: the forces between the two would do work";
            let d = d.at(span, text).at(region.span, "its nodes are to have no mass");
            d.help(
                "`scheme bdf2` with `massless`, or no `massless`, or the term on regions that do not touch these nodes",
            )
        }
        Unmovable::Thin { field, position } => {
            let at = wfl_discrete::finite::position(position);
            let d = Diagnostic::new(Code::E452, format!("the mass of `{field}` at {at} has nowhere to go"));
            let declared = script.fields.iter().find(|f| f.name.name == field).map_or(region.span, |f| f.name.span);
            let d = d.at(region.span, "nodes without mass need two layers of other nodes behind them");
            d.at(declared, "").help("a finer mesh, or a smaller region")
        }
        Unmovable::System(error) => {
            Diagnostic::new(Code::E452, format!("the mass cannot be computed: {error}")).at(region.span, "")
        }
    }
}
