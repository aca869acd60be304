//! The rule of faces whose terms have kinks that depend on the unknowns: contact, friction, cohesion.
//!
//! Such a law holds at each point of the rule. As many points as the fields have nodes are as many conditions as the fields
//! can meet; with more points, stiff contact on a curved gap makes pressures alternate from point to point, however fine the
//! mesh is (`docs/quadrature.md` has the errors). Under this rule the law holds at the nodes. Faces that meet the axis of a
//! body of revolution have a point inside in place of the one on the axis, where the integrand is zero.
//!
//! Terms that read through a mapping keep Gauss rules: the fields of the other side have kinks inside a face there, and it
//! is their integral that needs points. So do discontinuous unknowns, whose fluxes are no contact, cells of second order,
//! and laws on quadrilateral faces that read the traction of the body (Nitsche's method).
//! On quadrilateral faces that are no parallelograms the nodes have the area vectors of their functions
//! ([`wfl_discrete::areas`]): a constant stress passes exactly.

use std::collections::BTreeMap;

use wfl::{Code, Diagnostic, ast::QuadratureRule};
use wfl_compiler::{
    interpret, run_prologue,
    types::{FieldKind, FieldOp, InputSlot},
};
use wfl_discrete::field::{Field, FieldSpace};
use wfl_mesh::{
    element::Family,
    mesh::{CellKind, FacetRef, Mesh},
};

use super::{
    Parts,
    constants::number,
    normals::faces_of,
    rule_choice::{RuleChoice, Rules, end_on_axis, ends, highest, is_bound},
    terms::{PlacedLaw, TermMaker},
};

/// A force below this part of that at the middle of the face is none.
const NOTHING: f64 = 1e-6;
/// States at which forces are compared; among so many some are closed and some slip.
const STATES: usize = 24;

/// Largest degree that `quadrature` takes.
const MAX_DEGREE: f64 = 60.0;

impl TermMaker<'_> {
    /// The rule of every region that has terms: what `quadrature` says, else that of faces with kinks, else the largest
    /// degree its terms need.
    pub(super) fn rules(&mut self, laws: &[PlacedLaw]) -> Rules {
        let mut on_place: BTreeMap<&str, Vec<&PlacedLaw>> = BTreeMap::new();
        for law in laws {
            on_place.entry(&law.place).or_default().push(law);
        }
        let mut rules = Rules::new();
        for (place, laws) in on_place {
            let given = self.parts.script.quadratures.iter().flat_map(|q| &q.places).any(|p| p.name == place);
            let own = if given { None } else { choice(self.parts, &laws) };
            let highest = laws.iter().map(|l| l.law.degree.rule()).max().unwrap_or(0);
            rules.insert(place.to_owned(), own.unwrap_or(RuleChoice::Degree(highest)));
        }
        for statement in &self.parts.script.quadratures {
            let Some(choice) = self.given(statement) else { continue };
            if let RuleChoice::Segments { mapping, .. } = choice {
                self.cuts_something(statement, mapping, laws);
            }
            for place in &statement.places {
                rules.insert(place.name.clone(), choice);
            }
        }
        rules
    }

    /// The rule that a statement asks for; `None` after a message.
    fn given(&mut self, statement: &wfl::Quadrature) -> Option<RuleChoice> {
        let degree = match &statement.rule {
            QuadratureRule::Vertex if statement.segments.is_none() => return Some(RuleChoice::Vertex),
            QuadratureRule::Vertex => {
                let d = Diagnostic::new(Code::E411, "segments have no rule at vertices: they end where edges pass");
                self.diagnostics.push(d.at(statement.span, "a degree is needed: segments of m degree 4"));
                return None;
            }
            QuadratureRule::Degree(e) => self.degree(e)?,
        };
        let Some(name) = &statement.segments else { return Some(RuleChoice::Degree(degree)) };
        // a mapping with a message of its own is not there
        let mapping = self.parts.env.mappings.iter().position(|m| m.name == name.name)?;
        let why = if self.parts.mesh.dim() < 2 {
            "the faces of a line are points"
        } else if !self.parts.env.mappings[mapping].has_normal {
            "it leads to positions: there are no edges of faces to cut at"
        } else {
            return Some(RuleChoice::Segments { mapping, degree });
        };
        let d = Diagnostic::new(Code::E411, format!("there are no segments of `{}`", name.name));
        self.diagnostics.push(d.at(name.span, why));
        None
    }

    /// The degree of a rule; `None` after a message.
    fn degree(&mut self, e: &wfl::ast::Expr) -> Option<usize> {
        let d = number(self.parts.env, "the degree of a rule", e, self.diagnostics)?;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked in the guard")]
        if d.fract() == 0.0 && (0.0..=MAX_DEGREE).contains(&d) {
            return Some(d as usize);
        }
        let m = Diagnostic::new(
            Code::E411,
            format!("the degree of a quadrature rule is a whole number from 0 to {MAX_DEGREE}, found {d}"),
        );
        self.diagnostics.push(m.at(e.span, ""));
        None
    }

    /// W411 for segments of a mapping that no law there reads through: nothing is cut.
    fn cuts_something(&mut self, statement: &wfl::Quadrature, mapping: usize, laws: &[PlacedLaw]) {
        let is_here = |l: &&PlacedLaw| statement.places.iter().any(|p| p.name == l.place);
        let mut here = laws.iter().filter(is_here).peekable();
        let is_measured = self.parts.script.reductions().flat_map(|m| &m.places);
        let mut is_measured = is_measured.filter(|p| statement.places.iter().any(|q| q.name == p.name));
        if is_measured.next().is_some()
            || here.peek().is_none()
            || here.any(|l| l.law.listing.graph.mapping == Some(mapping))
        {
            return;
        }
        let name = &self.parts.env.mappings[mapping].name;
        let d = Diagnostic::new(Code::W411, format!("no term on this region reads through `{name}`: nothing is cut"));
        self.diagnostics.push(d.at(statement.span, "the terms here have the rule on whole faces"));
    }
}

/// The rule of the terms on one region of faces, if it is not that of their degrees.
fn choice(parts: Parts<'_>, laws: &[&PlacedLaw]) -> Option<RuleChoice> {
    let set = laws.iter().find_map(|l| l.set.as_ref().filter(|_| l.at_nodes.is_none()))?;
    let facets = faces_of(set)?;
    let kinked: Vec<&PlacedLaw> = laws.iter().copied().filter(|l| l.law.degree.kinked).collect();
    let mapped = laws.iter().any(|l| l.law.listing.graph.mapping.is_some());
    // of quadrilaterals the nodes do not see enough of the traction of a body: Nitsche's method would need four times the
    // parameter, and is unstable at the one that is usual
    let reads_traction = |l: &&PlacedLaw| l.law.trials.iter().any(|t| t.op == FieldOp::Grad);
    let quadrilaterals = facets.iter().any(|f| parts.mesh.facet_kind(*f) == CellKind::Quadrilateral);
    let unstable = quadrilaterals && kinked.iter().any(reads_traction);
    if kinked.is_empty() || mapped || unstable || parts.mesh.dim() < 2 || parts.mesh.order() > 1 {
        return None;
    }
    let fields = kinked.iter().flat_map(|l| &l.law.trials).filter_map(|t| parts.fields.get(t.field.index()));
    let fields: Vec<&Field> = fields.filter(|f| f.degree() > 0).collect();
    let broken = |f: &&Field| f.kind == FieldKind::Unknown && !is_continuous(f);
    if fields.iter().any(broken) {
        return None;
    }
    // corners of triangles have no point of their own from degree two on, and multipliers there no equation
    let triangles = facets.iter().any(|f| parts.mesh.facet_kind(*f) == CellKind::Triangle);
    if triangles && fields.iter().any(|f| f.kind == FieldKind::Multiplier && f.degree() > 1) {
        return None;
    }
    let degree = fields.iter().map(|f| f.degree()).max()?;
    // what is tested there, and what shares the points for the sake of a state, has its nodes there, too
    let bound = laws.iter().filter(|l| is_bound(&l.law, parts.fields));
    let degree = bound.filter_map(|l| highest(&l.law, parts.fields)).fold(degree, usize::max);
    let axis = match parts.mesh.dim() {
        2 => Ends { mesh: parts.mesh, facets: &facets, laws: &kinked }.axis(),
        _ => None,
    };
    Some(RuleChoice::Nodes { degree, axis })
}

fn is_continuous(field: &Field) -> bool {
    match &field.space {
        FieldSpace::Nodal(space) => space.family() == Family::Continuous,
        FieldSpace::Global | FieldSpace::Points(_) => true,
    }
}

/// The ends of the facets of a region of a plane mesh, and the laws with kinks there.
struct Ends<'a> {
    mesh: &'a Mesh,
    facets: &'a [FacetRef],
    laws: &'a [&'a PlacedLaw],
}

impl Ends<'_> {
    /// The coordinate whose zero is an axis: at the ends that lie there the laws have no force, or no finite one.
    fn axis(&self) -> Option<usize> {
        let reads_positions = |l: &&PlacedLaw| l.law.inputs.iter().any(|slot| matches!(slot, InputSlot::X(_)));
        if !self.laws.iter().any(reads_positions) {
            return None;
        }
        (0..2).find(|axis| {
            let on = self.facets.iter().filter_map(|f| Some((*f, end_on_axis(self.mesh, *f, *axis)?)));
            let own = on.take(2).any(|(facet, end)| self.is_dead(facet, end));
            self.mesh.team().any(own)
        })
    }

    /// Whether no law has a finite force at an end of a facet for any of some states, where it has one in the middle.
    fn is_dead(&self, facet: FacetRef, end: usize) -> bool {
        let ends = ends(self.mesh, facet);
        let middle = [0, 1, 2].map(|d| 0.5 * (ends[0][d] + ends[1][d]));
        let (mut acts, mut dead) = (false, true);
        for state in 0..STATES {
            for law in self.laws {
                let [at_end, inside] = [ends[end], middle].map(|x| force(law, x, state));
                acts |= inside > 0.0;
                dead &= !at_end.is_finite() || at_end <= NOTHING * inside;
            }
        }
        acts && dead
    }
}

/// The largest flux of a law at a position in a made-up state; not a number where it has no finite one.
fn force(law: &PlacedLaw, x: [f64; 3], state: usize) -> f64 {
    let law = &law.law;
    // magnitudes from 1e-6 to 1e6: far beyond every gap and far below
    #[expect(clippy::cast_possible_wrap, reason = "few states")]
    let size = 10f64.powi((state % 13) as i32 - 6);
    let some = |k: usize| size * scattered(state * 97 + k);
    let normal = [0.6, -0.8, 0.0];
    let inputs: Vec<f64> = law
        .inputs
        .iter()
        .enumerate()
        .map(|(k, slot)| match slot {
            InputSlot::X(d) | InputSlot::ImageX(d) => x[usize::from(*d)],
            InputSlot::Normal(_, d) => normal[usize::from(*d)],
            InputSlot::ElementSize(_) => 1.0,
            _ => some(k),
        })
        .collect();
    let uniforms = run_prologue(&law.prologue, &vec![0.5; law.prologue.slots.len()]);
    let mut out = vec![0.0; law.residual.kernel().outputs.len()];
    interpret(&law.residual, &uniforms, &inputs, &mut Vec::new(), &mut out);
    let worse = |m: f64, flux: &f64| if m.is_nan() || flux.is_nan() { f64::NAN } else { m.max(flux.abs()) };
    out[..law.tests.len()].iter().fold(0.0, worse)
}

/// A number between -1 and 1 that no formula of a scene follows: the fractional parts of multiples of the golden ratio.
fn scattered(k: usize) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    let x = (k + 1) as f64 * 0.618_033_988_749_894_9;
    2.0 * x.fract() - 1.0
}
