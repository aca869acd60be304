//! The equations of a scene at one step, with the state that they are read at beside the unknowns.
//!
//! A scene does not change behind `prepare`: who solves, judges or differentiates it asks for equations of his own.
//! Promises: a copy shares meshes, tables and code with the scene, and is changed by nobody else.

use std::{fmt, ops::Deref};

use wfl_checks::{
    CoarseLoad, DrivenSides, Hourglass, UnbalancedLoad,
    consistency::{self, ContactForm},
};
use wfl_compiler::Class;
use wfl_contact::Contact;
use wfl_discrete::{
    finite::BadGiven,
    system::{System, SystemError},
    window::Window,
};

use super::{RuleChoice, Scene};

/// The equations of a scene at one step.
#[derive(Clone)]
pub struct Equations {
    /// The discrete problem with known fields, the past and rates.
    pub system: System,
    /// The laws of contact, and the state they are in.
    pub contact: Contact,
}

impl fmt::Debug for Equations {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Window { stage, increment, .. } = self.system.step();
        write!(f, "Equations(at {stage} with the increment {increment}, {} dofs)", self.system.numbering.n_dofs)
    }
}

/// A scene with equations of it that somebody solves: what a run hands around. It reads as its scene; of `system` and
/// `contact` it has those of the equations.
pub struct Solving<'a> {
    /// The scene as it was made.
    pub scene: &'a Scene,
    /// The discrete problem with known fields, the past and rates.
    pub system: &'a mut System,
    /// The laws of contact, and the state they are in.
    pub contact: &'a mut Contact,
}

impl Deref for Solving<'_> {
    type Target = Scene;

    fn deref(&self) -> &Scene {
        self.scene
    }
}

impl Solving<'_> {
    /// Brings the known fields to a step.
    ///
    /// # Errors
    /// [`SystemError::Given`] for a value that is not finite.
    pub fn set_data(&mut self, window: Window) -> Result<(), SystemError> {
        for (field, value) in &self.scene.data {
            let positions = node_positions(self.system, *field);
            let values = agreed(self.system, value.at(&positions, window));
            self.system.set_data(*field, values.map_err(Box::new)?);
        }
        Ok(())
    }

    /// A copy of the equations as they are now.
    #[must_use]
    pub fn now(&self) -> Equations {
        Equations { system: self.system.clone(), contact: self.contact.clone() }
    }

    /// First values: those of the unknowns by dof, those of states where the equations keep them.
    ///
    /// # Errors
    /// [`BadGiven`] for a value that is not finite.
    pub fn start(&mut self) -> Result<Vec<f64>, BadGiven> {
        let system = &mut *self.system;
        let mut u = vec![0.0; system.numbering.n_dofs];
        let first = Window::instant(self.scene.steps.first());
        for (field, value) in &self.scene.starts {
            let positions = node_positions(system, *field);
            let values = agreed(system, value.at(&positions, first))?;
            match system.numbering.starts[*field] {
                Some(first) => u[first..first + values.len()].copy_from_slice(&values),
                None => system.set_data(*field, values),
            }
        }
        system.numbering.follow(&mut u);
        Ok(u)
    }

    /// Brings known fields and laws to a step; assembles nothing.
    ///
    /// # Errors
    /// [`SystemError::Given`] for a value that is not finite.
    pub fn stand_at(&mut self, window: Window) -> Result<(), SystemError> {
        self.set_data(window)?;
        self.system.set_laws(window);
        self.contact.begin_step(self.system.step());
        Ok(())
    }
}

impl Scene {
    /// This scene with equations of it.
    pub fn solving<'a>(&'a self, equations: &'a mut Equations) -> Solving<'a> {
        Solving { scene: self, system: &mut equations.system, contact: &mut equations.contact }
    }

    /// The equations before the first step: known fields, the past and rates are zero, contact is open.
    #[must_use]
    pub fn equations(&self) -> Equations {
        Equations { system: self.system.clone(), contact: self.contact.clone() }
    }

    /// The equations at the first step. Nothing is assembled.
    ///
    /// # Errors
    /// [`SystemError`] where a known field has no finite value.
    pub fn at_first_step(&self) -> Result<Equations, SystemError> {
        let mut equations = self.equations();
        self.solving(&mut equations).stand_at(self.steps.first_window())?;
        Ok(equations)
    }

    /// The equations at the first step, where laws with a memory read the start as their past, and first values. Nothing is
    /// assembled.
    ///
    /// # Errors
    /// [`SystemError`] where a known field or a first value is not finite.
    pub fn started(&self) -> Result<(Equations, Vec<f64>), SystemError> {
        let mut equations = self.equations();
        let mut solving = self.solving(&mut equations);
        let u = solving.start().map_err(Box::new)?;
        solving.stand_at(self.steps.first_window())?;
        equations.system.end_step(&u);
        Ok((equations, u))
    }

    /// The loads that their quadrature rules do not resolve, each at the first of three steps where it is so: one in the
    /// middle, the last and the first. Loads that are integrated exactly are not looked at.
    ///
    /// # Errors
    /// [`SystemError`] where a known field has no finite value.
    pub fn coarse_loads(&self) -> Result<Vec<CoarseLoad>, SystemError> {
        let mut ruled: Vec<(usize, usize)> = self
            .terms
            .iter()
            .enumerate()
            .filter_map(|(k, t)| match t.rule {
                RuleChoice::Degree(degree) if t.class == Class::Constant => Some((k, degree)),
                _ => None,
            })
            .collect();
        let values = &self.steps.values;
        let last = values.len().saturating_sub(1);
        let mut equations = self.equations();
        let mut found: Vec<CoarseLoad> = Vec::new();
        for at in [last.div_ceil(2), last, 0] {
            if ruled.is_empty() {
                break;
            }
            let time = values.get(at).copied().unwrap_or(0.0);
            self.solving(&mut equations).stand_at(Window::new(time, self.steps.first_increment()))?;
            found.extend(wfl_checks::coarse_loads(&equations.system, &ruled));
            ruled.retain(|(term, _)| found.iter().all(|f| f.term != *term));
        }
        found.sort_by_key(|f| f.term);
        Ok(found)
    }

    /// The kinds of cells on which the terms at these positions leave deformations without stiffness because of their rule,
    /// at the first step with states as they start. Nothing is assembled but single cells.
    ///
    /// # Errors
    /// [`SystemError`] where a known field or a first value is not finite.
    pub fn hourglasses(&self, terms: &[usize]) -> Result<Vec<Hourglass>, SystemError> {
        if terms.is_empty() {
            return Ok(Vec::new());
        }
        Ok(wfl_checks::hourglasses(&self.started()?.0.system, terms))
    }

    /// Loads on numbers that nothing balances, and interfaces that drive their sides, at the start. Nothing is assembled.
    ///
    /// # Errors
    /// [`SystemError`] where a known field or a first value is not finite.
    pub fn signs(&self) -> Result<(Vec<UnbalancedLoad>, Vec<DrivenSides>), SystemError> {
        let (equations, u) = self.started()?;
        Ok((wfl_checks::unbalanced_loads(&equations.system, &u), wfl_checks::driven_sides(&equations.system, &u)))
    }

    /// Judges the contact terms, at the last step.
    #[must_use]
    pub fn contact_forms(&self) -> Vec<ContactForm> {
        let values = &self.steps.values;
        let increment = match &self.steps.auto {
            Some(auto) => auto.first,
            None if values.len() > 1 => self.steps.increment(values.len() - 1),
            None => 1.0,
        };
        if self.contact.is_empty() {
            return Vec::new();
        }
        let mut equations = self.equations();
        // where a known field is not finite, the run itself says which
        match self.solving(&mut equations).stand_at(Window::new(self.steps.last(), increment)) {
            Ok(()) => consistency::contact_forms(&equations.system, &equations.contact),
            Err(_) => Vec::new(),
        }
    }
}

/// Values at the nodes that this rank has: of a part of the mesh the others have other nodes, and other errors.
fn agreed(system: &System, own: Result<Vec<f64>, BadGiven>) -> Result<Vec<f64>, BadGiven> {
    BadGiven::agreed(own, system.mesh.holders())
}

/// Where the nodes of a field are, by node.
#[must_use]
pub fn node_positions(system: &System, field: usize) -> Vec<[f64; 3]> {
    let f = &system.fields[field];
    (0..f.n_nodes()).map(|n| f.node_position(n)).collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use wfl::{NoFiles, SourceMap, resolve};
    use wfl_compiler::InterpreterBackend;

    use wfl_contact::coercivity;

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
                let scene = made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics));
                let value = |name: &str| scene.params.iter().find(|p| p.0 == name).unwrap().1.values[0];
                let (gamma, theta) = (value("gamma"), value("theta"));
                let first = scene.at_first_step().unwrap();
                let found = coercivity(&first.system, &first.contact);
                assert_eq!(found.iter().map(|c| (c.theta, c.gamma)).collect::<Vec<_>>(), [(theta, gamma)]);
            }
        }
    }
}
