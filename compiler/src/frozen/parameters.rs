//! Which scalar parameters of a scene scale the arguments of its projections: the penalty, Nitsche and augmentation
//! parameters, whatever they are called.
//!
//! Parameters are constants of a compiled term. So the term is built once more for each parameter that it names, with
//! that parameter as a known global number in place of a constant; all others keep their values. The derivatives S of
//! an argument with respect to displacements are then differentiated by the parameter p: the argument's displacement
//! part scales with p where `p dS/dp = S` for every displacement, which holds for all p exactly if S is p times what
//! does not depend on p. Structure decides where it can: equal scalars, absent entries. Else the identity is tested at
//! sampled states in double-double arithmetic.
//!
//! Promises: no false yes but by coincidence of all samples. A parameter that must be a constant (an exponent of a
//! kinked form, the size of a tensor) or that changes which projections there are scales nothing. Judges no method:
//! that a parameter scales a gap does not say that it has no physical meaning.

use std::collections::BTreeSet;

use super::{Found, FrozenLaw, ProjectionKind, projections, slopes::by_slot};
use crate::{
    build::Env,
    dd::Dd,
    degree::Degree,
    derive::derive,
    graph::{ExprId, Graph, Leaf, Role},
    interp::interpret,
    law::{Listing, ValueLaw},
    lower::Lowering,
    random::Random,
    real::Real,
    symmetry::unit_normals,
    term::{TermSource, listing_of, tangent_of, values_law},
    types::{BasisSlot, FieldId, FieldKind, FieldOp, FieldSig, InputSlot, PlaceSig, Shape},
};

/// What of an argument a parameter scales.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScaledPart {
    /// The displacements alone: gradients and multipliers enter the argument without the parameter, or not at all.
    Displacement,
    /// Displacements, gradients and multipliers alike.
    Argument,
}

/// A scalar parameter that scales an argument.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scaling {
    /// The name of the parameter.
    pub parameter: String,
    /// Position of the projection in [`FrozenLaw::projections`].
    pub projection: usize,
    /// What of the argument it scales.
    pub part: ScaledPart,
}

/// States at which an identity is tested.
const SAMPLES: u64 = 8;
/// Relative difference of two numbers that are equal but for rounding of double-double arithmetic.
const SAME: f64 = 1e-22;

/// The scalar parameters that scale the arguments of the projections of a term, by parameter and projection.
///
/// `source` is the text from which the term was compiled on `place`, and `frozen` its frozen form.
#[must_use]
pub fn scaling_parameters(env: &Env<'_>, place: &PlaceSig, source: TermSource<'_>, frozen: &FrozenLaw) -> Vec<Scaling> {
    let mut names = BTreeSet::new();
    wfl::each_name(source.text(), &mut |name| {
        names.insert(name);
    });
    let mut out = Vec::new();
    for name in names {
        let Some(value) = env.params.get(name).filter(|c| c.values.len() == 1) else { continue };
        let Some(symbolic) = Symbolic::build(env, place, source, name) else { continue };
        let found = symbolic.projections();
        if !found.iter().map(shape_of).eq(frozen.projections.iter().map(|p| (p.kind, p.n))) {
            continue;
        }
        for (projection, f) in found.iter().enumerate() {
            let part = symbolic.scaled_part(f.argument, value.values[0]);
            out.extend(part.map(|part| Scaling { parameter: name.to_owned(), projection, part }));
        }
    }
    out
}

fn shape_of(found: &Found) -> (ProjectionKind, usize) {
    (found.projection.kind, found.projection.n)
}

/// A term in which one parameter is a known global number.
struct Symbolic {
    listing: Listing,
    root: ExprId,
    fields: Vec<FieldSig>,
    /// The field that the parameter has become.
    parameter: FieldId,
}

impl Symbolic {
    /// `None` where the parameter must be a constant.
    fn build(env: &Env<'_>, place: &PlaceSig, source: TermSource<'_>, name: &str) -> Option<Self> {
        let parameter = FieldId::new(env.fields.len());
        let mut fields = env.fields.to_vec();
        let (shape, kind) = (Shape::SCALAR, FieldKind::Data);
        fields.push(FieldSig { name: name.to_owned(), shape, degree: 0, kind, global: true, on_faces: false });
        let mut params = env.params.clone();
        params.remove(name);
        let env = Env { fields: &fields, params: &params, ..*env };
        let listing = listing_of(&env, place, source).value?;
        let root = listing.residual?;
        Some(Self { listing, root, fields, parameter })
    }

    fn projections(&self) -> Vec<Found> {
        let g = &self.listing.graph;
        projections(g, self.root, &g.reachable(self.root)).0
    }

    /// What of an argument scales with the parameter, whose value in the scene is `value`.
    fn scaled_part(&self, argument: ExprId, value: f64) -> Option<ScaledPart> {
        let mut g = self.listing.graph.clone();
        let slopes = tangent_of(&mut g, &self.fields, argument).ok()?;
        let change = self.by_parameter(&mut g, slopes)?;
        if g.is_zero(change) {
            return None;
        }
        let mut lowering = Lowering::new(&g);
        let (slopes, changes) = (by_slot(&mut lowering, slopes), by_slot(&mut lowering, change));
        let p = lowering.global_value(self.parameter);
        let zero = lowering.scalars.constant(0.0);
        let (mut pairs, mut moves, mut fixed, mut scaled) = (Vec::new(), false, true, true);
        for (slopes, changes) in slopes.iter().zip(&changes) {
            for (slot, slope) in slopes {
                let change = changes.get(slot).copied();
                let times = change.map_or(zero, |c| lowering.scalars.mul(p, c));
                let equal = times == *slope;
                if self.is_displacement(slot) {
                    moves = true;
                } else {
                    fixed &= change.is_none();
                    scaled &= change.is_some();
                }
                if !equal && (self.is_displacement(slot) || change.is_some()) {
                    pairs.extend([*slope, times]);
                }
            }
        }
        let part = if fixed { ScaledPart::Displacement } else { ScaledPart::Argument };
        if !moves || !(fixed || scaled) {
            return None;
        }
        let Some(shape) = Shape::new(&[pairs.len()]) else { return Some(part) };
        let law = values_law(&self.fields, "", lowering, &pairs, shape, Degree::default());
        self.agree(&law, value).then_some(part)
    }

    /// The derivative with respect to the parameter.
    fn by_parameter(&self, g: &mut Graph, e: ExprId) -> Option<ExprId> {
        let found = derive(g, e, &mut |g, leaf| match leaf {
            Leaf::Field { field, role: Role::Current, .. } if field == self.parameter => Some(g.number(1.0)),
            _ => None,
        });
        found.ok()
    }

    fn is_displacement(&self, slot: &BasisSlot) -> bool {
        slot.op == FieldOp::Value && self.fields[slot.field.index()].kind == FieldKind::Unknown
    }

    /// Whether outputs are equal in pairs at sampled states.
    fn agree(&self, law: &ValueLaw, value: f64) -> bool {
        let mut tested = false;
        for sample in 0..SAMPLES {
            let outputs = self.sample(law, value, sample);
            if outputs.iter().any(|x| !x.is_finite()) {
                continue;
            }
            tested = true;
            let size = outputs.iter().fold(0.0f64, |m, x| m.max(x.to_f64().abs()));
            let differ = |pair: &[Dd; 2]| pair[0].sub(pair[1]).to_f64().abs() > SAME * size;
            if outputs.as_chunks().0.iter().any(differ) {
                return false;
            }
        }
        tested
    }

    /// The outputs at a random state; the parameter is near its value, or near 1 if that is 0.
    fn sample(&self, law: &ValueLaw, value: f64, sample: u64) -> Vec<Dd> {
        let mut generator = Random::new(sample);
        let mut random = || generator.next();
        random();
        let parameter = if value == 0.0 { 1.0 } else { value } * 2f64.powf(random());
        let mut inputs: Vec<f64> = law.inputs.iter().map(|_| random()).collect();
        unit_normals(&law.inputs, &mut inputs);
        for (slot, x) in law.inputs.iter().zip(&mut inputs) {
            if matches!(slot, InputSlot::Field(b) if b.field == self.parameter) {
                *x = parameter;
            }
        }
        let exact = |list: &[f64]| list.iter().map(|x| Dd::from_f64(*x)).collect::<Vec<Dd>>();
        let step: Vec<f64> = law.prologue.slots.iter().map(|_| 1.5 + 0.5 * random()).collect();
        let prologue = law.prologue.kernel.kernel();
        let mut uniforms = vec![Dd::from_f64(0.0); prologue.outputs.len()];
        interpret(&law.prologue.kernel, &exact(&step), &[], &mut Vec::new(), &mut uniforms);
        let mut outputs = vec![Dd::from_f64(0.0); law.kernel.kernel().outputs.len()];
        interpret(&law.kernel, &uniforms, &exact(&inputs), &mut Vec::new(), &mut outputs);
        outputs
    }
}
