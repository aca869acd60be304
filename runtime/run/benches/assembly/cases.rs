//! The nine scenes whose tangents are timed, and what makes one callable.

use wfl::{Loader, SourceId};
use wfl_compiler::TermLaw;
use wfl_discrete::{
    assemble::{BranchCounts, FieldValues},
    system::System,
    window::Window,
};
use wfl_problem::Scene;
use wfl_sparse::csr::{Csr, PatternBuilder};

use crate::common;

/// A scene of one term.
pub(crate) struct Case {
    /// As in the table of results.
    pub(crate) name: &'static str,
    mesh: &'static str,
    element: &'static str,
    law: &'static str,
    /// Goal, thousand entities per second on one thread.
    pub(crate) goal: f64,
}

const ELASTIC: &str = "
param lambda = 10000
param mu = 10000
unknown u : vector ELEMENT
def sigma(v) = lambda*Div_v*Id(3) + 2*mu*Sym(Grad_v)
term law on all : sigma(u):Grad_Test_u
";
const NEO_HOOKEAN: &str = "
param lambda = 120
param mu = 80
unknown u : vector ELEMENT
def F = Id(3) + Grad_u
def P = mu*(F - Inv(F)') + lambda*log(Det(F))*Inv(F)'
term law on all : P:Grad_Test_u
";
const INTERFACE: &str = "
param lambda = 10000
param mu = 10000
param gamma = 1e5
region left = cells where x < 0
region right = cells where x > 0
region fault = interface from left to right
unknown uL : vector ELEMENT on left
unknown uR : vector ELEMENT on right
def sigma(v) = lambda*Div_v*Id(3) + 2*mu*Sym(Grad_v)
def jump(a,b) = a - Interpolate(b, neighbor_element)
def Pn = gamma*(jump(uL,uR).Normal) - (sigma(uL)*Normal).Normal
term law on fault : pos_part(Pn)*(Normal.jump(Test_uL,Test_uR))
";
const POISSON: &str = "
unknown u : scalar ELEMENT
term law on all : Grad_u.Grad_Test_u
";

/// The cases in the order of the table of results.
pub(crate) const CASES: [Case; 9] = [
    Case { name: "P1 tet elasticity", mesh: TETS, element: "P1", law: ELASTIC, goal: 9_000.0 },
    Case { name: "Q1 hex elasticity", mesh: HEXES, element: "Q1", law: ELASTIC, goal: 1_250.0 },
    Case { name: "P2 tet elasticity", mesh: FEW_TETS, element: "P2", law: ELASTIC, goal: 1_100.0 },
    Case { name: "P1 tet neo-Hookean", mesh: TETS, element: "P1", law: NEO_HOOKEAN, goal: 6_000.0 },
    Case { name: "P2 tet neo-Hookean", mesh: FEW_TETS, element: "P2", law: NEO_HOOKEAN, goal: 400.0 },
    Case { name: "Q1 hex neo-Hookean", mesh: HEXES, element: "Q1", law: NEO_HOOKEAN, goal: 1_000.0 },
    Case { name: "interface, tets", mesh: FAULT_TETS, element: "P1", law: INTERFACE, goal: 900.0 },
    Case { name: "interface, hexes", mesh: FAULT_HEXES, element: "Q1", law: INTERFACE, goal: 400.0 },
    Case { name: "P1 triangle Poisson", mesh: TRIANGLES, element: "P1", law: POISSON, goal: 40_000.0 },
];

// Rules exact for constant strain products: 1 point on P1, 4 on P2 tetrahedra, 2x2x2 on Q1 hexahedra, mass-exact ones
// on facets (3 points on triangles, 2x2 on squares).
const TETS: &str = "mesh box [0,0,0] to [1,1,1] cells [20,20,20] tet\nquadrature on all degree 1\n";
const FEW_TETS: &str = "mesh box [0,0,0] to [1,1,1] cells [12,12,12] tet\nquadrature on all degree 2\n";
const HEXES: &str = "mesh box [0,0,0] to [1,1,1] cells [24,24,24] hex\nquadrature on all degree 3\n";
const FAULT_TETS: &str = "mesh box [-1,0,0] to [1,4,4] cells [2,64,64] tet\nquadrature on fault degree 2\n";
const FAULT_HEXES: &str = "mesh box [-1,0,0] to [1,4,4] cells [2,64,64] hex\nquadrature on fault degree 3\n";
const TRIANGLES: &str = "mesh box [0,0] to [1,1] cells [300,300] tri\nquadrature on all degree 0\n";

/// A scene that uses no other file.
struct Alone;

impl Loader for Alone {
    fn load(&mut self, path: &str, _from: SourceId) -> Result<(String, String), wfl::Unloaded> {
        Err(format!("{path} is not part of the case").into())
    }
}

/// A case ready to be assembled again and again.
pub(crate) struct Problem {
    scene: Scene,
    matrix: Csr,
    residual: Vec<f64>,
    branches: BranchCounts,
    state: Vec<f64>,
}

impl Problem {
    /// Compiles the scene and allocates its matrix.
    pub(crate) fn new(case: &Case) -> Result<Self, String> {
        let law = case.law.replace("ELEMENT", case.element);
        let mut scene = common::scene(case.name, format!("wfl 1\n{}{law}", case.mesh), &mut Alone)?;
        let system = &mut scene.system;
        let n = system.numbering.n_dofs;
        let mut pattern = PatternBuilder::new(n, n);
        system.terms[0].for_each_entity(|rows, columns| pattern.add_coupling(rows, columns));
        let matrix = Csr::zeros(pattern.build_shared().map_err(|e| e.to_string())?);
        system.terms[0].locate(matrix.pattern(), &system.numbering.free);
        system.terms[0].set_step(Window::default());
        // small displacements that differ from node to node, both signs of the gap
        let state = (0..n).map(|k| 1e-3 * ((k * 7919 % 1000) as f64 / 1000.0 - 0.5)).collect();
        Ok(Self { scene, matrix, residual: vec![0.0; n], branches: BranchCounts::default(), state })
    }

    /// Entities of the term.
    pub(crate) fn n_entities(&self) -> usize {
        self.scene.system.terms[0].integrator.domain.n_entities
    }

    /// The tangent, from a matrix of any values to the one at the state.
    pub(crate) fn assemble(&mut self) -> Result<(), String> {
        let system = &self.scene.system;
        let mut fields = [&self.state[..]; MOST_FIELDS];
        let values = FieldValues { current: slices(system, &self.state, &mut fields), previous: &[], rates: None };
        system.terms[0].set_tangent(&system.mesh, values, self.matrix.values_mut()).map_err(|e| e.to_string())
    }

    /// The residual at the state.
    pub(crate) fn assemble_residual(&mut self) -> Result<(), String> {
        self.residual.fill(0.0);
        let mut fields = [&self.state[..]; MOST_FIELDS];
        let values =
            FieldValues { current: slices(&self.scene.system, &self.state, &mut fields), previous: &[], rates: None };
        let System { mesh, terms, .. } = &mut self.scene.system;
        terms[0].add_residual_to(mesh, values, &mut self.residual, &mut self.branches).map_err(|e| e.to_string())
    }

    /// Sum of the magnitudes of the matrix, to compare builds with each other.
    pub(crate) fn checksum(&self) -> f64 {
        self.matrix.values().iter().map(|v| v.abs()).sum()
    }

    /// The compiled law.
    pub(crate) fn law(&self) -> &TermLaw {
        &self.scene.system.terms[0].law
    }

    /// What the compiler says about the term.
    pub(crate) fn summary(&self) -> String {
        let t = &self.scene.terms[0];
        let kind = if t.symmetric { "symmetric" } else { "unsymmetric" };
        let slots = self.law().tests.len();
        format!("{kind}, {} points, {slots} test slots, {} instructions", t.n_points, t.instructions.1)
    }
}

/// Fields of a case.
const MOST_FIELDS: usize = 2;

/// The values of each field.
fn slices<'a, 'b>(system: &System, state: &'a [f64], out: &'b mut [&'a [f64]; MOST_FIELDS]) -> &'b [&'a [f64]] {
    for (k, slot) in out.iter_mut().enumerate().take(system.fields.len()) {
        *slot = system.range(k).map_or(&[], |range| &state[range]);
    }
    out
}
