//! The degree of the quadrature rule of an integrand.
//!
//! Degrees count in the reference entity: the total degree on simplices, the degree in each variable on tensor
//! products of lines. Four things make it.
//!
//! **Polynomials** are integrated exactly, up to degree 12.
//!
//! **Functions that are no polynomials** (a determinant in a logarithm, an inverse, a quotient) become exact with no
//! rule. With `p` the largest degree of a field (or gradient) in it and `q` that of the test function, a linear law of
//! the same fields has degree `p + q`. On tensor products one degree more is taken, on simplices `p` more, so that the
//! quadratic part of the law is resolved, too: `2p + 1` and `3p` as a rule. (In one variable a tensor product has the
//! most of its terms below the degree `p`; `3p` would cost (3/2)^3 as much there.) Without a test function (a measure) a
//! quadratic quantity takes the place of the linear law. Functions of the coordinates alone count one degree more, because
//! no element has smoothed them. `docs/quadrature.md` has what these rules cost and what they leave.
//!
//! **Kinks** that depend on the unknowns add 2 once: where the contact set cuts a facet no rule is exact. Facets with such
//! terms have another rule than that of this degree unless they are mapped (`runtime/problem/src/face_rules.rs`).
//!
//! **The geometry.** Where the map `x(r)` from the reference entity is not affine, the measure and the cofactors of its
//! gradient `J` are polynomials. With `x` of degree `g` (1 for straight edges, 2 for second-order cells) in a cell of
//! dimension `d`:
//!
//! | | tensor products | simplices |
//! |---|---|---|
//! | column `j` of `J` | `g-1` in variable `j`, `g` in the others | `g-1` |
//! | `det J`, one factor from each column | `gd - 1` | `(g-1) d` |
//! | row `j` of the cofactors, without column `j` | `g(d-1)` in variable `j`, `g(d-1) - 1` in the others | `(g-1)(d-1)` |
//! | `det J grad v`, row `j` times the derivative of `v` in variable `j` | `g(d-1) + k - 1` | `(g-1)(d-1) + k - 1` |
//! | normal times measure of a face, the cofactors with the face as variable `j` | `g(d-1) - 1` | `(g-1)(d-1)` |
//!
//! for `v` of degree `k`. Wedges and pyramids count as tensor products: on a wedge the total degree in x and y and the degree
//! in z, on a pyramid the degrees in x/(1 - z), y/(1 - z) and 1 - z are at most those of the column, and their rules are
//! exact for them. In both columns `det J grad v` has the degree of `det J` and `k - g`, so that a gradient counts
//! as `k - g` and the measure as its degree; one gradient in an integral over cells leaves a polynomial. Two gradients
//! leave `det J` in a denominator; then, as for the other quotients, the degree on an affine entity is kept, and the
//! state that must come out exactly is that of constant gradients (constant stress): there the unknowns are constants
//! and what multiplies them is a polynomial. On faces a gradient is a quotient, the normal times the measure is a
//! polynomial, and the measure alone is one on plane faces. On others it is a root: an integral over them without test
//! functions (a measure) counts it with at least the degree by which `wfl check` tells their area, so that both agree; an
//! equation keeps that of the normal times the measure, with which constant stress is met. Second-order cells have the degree of their geometry, which
//! may be 1 or 0 (affine): it is measured, not read off from the kind of the cell.

use crate::{
    graph::{Arity, ExprId, Graph, Leaf, Node, Role},
    types::{EntityGeometry, FieldOp, FieldSig, PlaceKind, PlaceSig, Side},
};

/// The degree that the quadrature rule of an integrand should have, and why.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Degree {
    rule: usize,
    /// A kink depends on the unknowns.
    pub kinked: bool,
    /// A function that is no polynomial of the fields and coordinates.
    pub rough: bool,
    /// Entities that are not affine raised it.
    pub raised: bool,
    /// Entities that are not affine leave a quotient by their determinant, or a root of it.
    pub quotient: bool,
    /// Another formula, or another cell, holds on a part of an entity.
    pub piecewise: bool,
}

/// Largest degree the estimate asks for.
const LARGEST: usize = 12;
/// What kinks add.
const KINK: i32 = 2;
/// What the measure of a face or an edge that is not affine counts at least where nothing is tested: it is the root of a
/// polynomial, and has the degree by which lengths and areas of regions are told (`facet_measures`).
const ROOT: i32 = 5;

impl Degree {
    /// The degree the quadrature rule should have.
    #[must_use]
    pub fn rule(self) -> usize {
        self.rule
    }

    /// True if the rule is exact, so that more points give the same number.
    #[must_use]
    pub fn is_exact(self) -> bool {
        let limited = self.rule >= LARGEST;
        !(self.kinked || self.rough || self.quotient || self.piecewise || limited)
    }

    /// Why it is this degree, in words.
    #[must_use]
    pub fn why(self) -> &'static str {
        match (self.kinked, self.rough, self.quotient, self.raised) {
            (true, ..) => "kinks: 2 more",
            (_, true, _, true) => "not a polynomial; constant gradients exact",
            (_, true, ..) => "not a polynomial: 2p + 1, or 3p on simplices",
            (_, _, true, _) => "constant gradients exact",
            (.., true) => "exact, with the measure",
            _ => "exact",
        }
    }
}

/// What is taken for the fields and the map.
#[derive(Clone, Copy, PartialEq, Eq)]
enum View {
    /// The map is affine.
    Affine,
    /// The map is that of the entities.
    Mapped,
    /// The same, and all fields but test functions have constant values and gradients.
    ConstantState,
}

/// What is known of a node.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Estimate {
    /// Degree of its polynomial part by the number of quotients by `det J` in it: none, one, more.
    parts: [Option<i32>; 3],
    /// Degree with functions that are no polynomials counted as their arguments.
    whole: i32,
    /// Largest degree of a field or coordinate in it.
    leaf: i32,
    /// Degree of the test and trial functions.
    test: i32,
    /// It has a field in it.
    fields: bool,
    /// A part of it is no polynomial.
    rough: bool,
    kinked: bool,
    piecewise: bool,
}

/// Of a number.
const CONSTANT: Estimate = Estimate {
    parts: [Some(0), None, None],
    whole: 0,
    leaf: 0,
    test: 0,
    fields: false,
    rough: false,
    kinked: false,
    piecewise: false,
};

impl Estimate {
    fn sum(self, o: Estimate) -> Estimate {
        Estimate {
            parts: std::array::from_fn(|k| self.parts[k].max(o.parts[k])),
            whole: self.whole.max(o.whole),
            leaf: self.leaf.max(o.leaf),
            test: self.test.max(o.test),
            ..self.flags(o)
        }
    }

    fn product(self, o: Estimate) -> Estimate {
        let mut parts = [None; 3];
        for (i, a) in self.parts.iter().enumerate() {
            for (j, b) in o.parts.iter().enumerate() {
                let part = &mut parts[(i + j).min(2)];
                *part = (*part).max(a.zip(*b).map(|(a, b)| a + b));
            }
        }
        Estimate {
            parts,
            whole: self.whole + o.whole,
            leaf: self.leaf.max(o.leaf),
            test: self.test + o.test,
            ..self.flags(o)
        }
    }

    fn flags(self, o: Estimate) -> Estimate {
        Estimate {
            fields: self.fields || o.fields,
            rough: self.rough || o.rough,
            kinked: self.kinked || o.kinked,
            piecewise: self.piecewise || o.piecewise,
            ..self
        }
    }

    /// Of a function that is no polynomial.
    fn composed(self) -> Estimate {
        let constant = Estimate { kinked: self.kinked, fields: self.fields, piecewise: self.piecewise, ..CONSTANT };
        if self == constant {
            return self;
        }
        let unsmoothed = i32::from(!self.fields);
        Estimate { parts: [None; 3], whole: self.whole + unsmoothed, leaf: self.leaf + unsmoothed, rough: true, ..self }
    }

    /// Of a selection or a projection, whose branches move with the unknowns or stay.
    fn with_kink(self, kinked: bool) -> Estimate {
        Estimate { kinked: self.kinked || kinked, piecewise: true, ..self }
    }

    /// Degree of the polynomial part with at most so many quotients.
    fn exact(&self, quotients: usize) -> i32 {
        self.parts[..=quotients].iter().flatten().copied().max().unwrap_or(0)
    }

    /// The degree on affine entities of what multiplies these functions.
    fn affine(&self, arity: Arity, entity: EntityGeometry) -> i32 {
        let tested = arity.test || arity.trial;
        let kink = if self.kinked { KINK } else { 0 };
        let linear = if tested { self.leaf + self.test } else { self.whole.min(2 * self.leaf) };
        let beyond = if entity.tensor { 1 } else { self.leaf };
        let rough = if self.rough { linear + beyond.max(kink) } else { 0 };
        rough.max(self.exact(2) + kink)
    }
}

/// The degree of an integrand on a place.
#[must_use]
pub(crate) fn degree(graph: &Graph, root: ExprId, fields: &[FieldSig], place: &PlaceSig) -> Degree {
    let entities = place.entities.iter().copied();
    let each = entities.map(|entity| degree_on(graph, root, fields, entity, place.kind));
    each.reduce(Degree::larger).unwrap_or_else(|| {
        let point = EntityGeometry { tensor: false, dim: 0, order: 0 };
        degree_on(graph, root, fields, point, place.kind)
    })
}

impl Degree {
    fn larger(self, o: Degree) -> Degree {
        Degree {
            rule: self.rule.max(o.rule),
            raised: if self.rule == o.rule {
                self.raised || o.raised
            } else {
                [self, o][usize::from(o.rule > self.rule)].raised
            },
            quotient: self.quotient || o.quotient,
            ..self
        }
    }
}

fn degree_on(graph: &Graph, root: ExprId, fields: &[FieldSig], entity: EntityGeometry, kind: PlaceKind) -> Degree {
    // an edge in space is a line, the face whose gradients are taken there is none
    let on_line = entity.dim == 1 && !matches!(kind, PlaceKind::Edges | PlaceKind::InnerEdges);
    let of = |view: View| Leaves { fields, on_line, entity, view }.estimate(graph, root);
    let affine = of(View::Affine);
    let arity = graph.arity(root);
    let flat = affine.affine(arity, entity);
    let on_cells = kind == PlaceKind::Cells;
    let (mut rule, mut quotient) = (flat, false);
    if entity.order > 0 {
        let measure = int(entity.measure_degree());
        let alone = !(on_cells || arity.test || arity.trial);
        let measure = if alone { measure.max(ROOT) } else { measure };
        // a gradient on a face divides by the determinant of the cell, which its measure does not have
        let cancelled = usize::from(on_cells);
        let mapped = of(View::Mapped);
        let exact = mapped.exact(cancelled).max(of(View::ConstantState).exact(cancelled));
        rule = (exact + measure).max(if on_cells { flat } else { flat + measure });
        // without the normal the measure of a face is a polynomial on plane faces only
        quotient = !on_cells || mapped.parts[cancelled + 1..].iter().any(Option::is_some);
    }
    let limited = |rule: i32| usize::try_from(rule).map_or(0, |rule| rule.min(LARGEST));
    Degree {
        rule: limited(rule),
        kinked: affine.kinked,
        rough: affine.rough,
        raised: rule > flat,
        quotient,
        piecewise: affine.piecewise,
    }
}

/// What leaves are polynomials of: the fields, and where they are seen.
struct Leaves<'a> {
    fields: &'a [FieldSig],
    /// On entities that are lines, but for edges in space.
    on_line: bool,
    entity: EntityGeometry,
    view: View,
}

impl Leaves<'_> {
    /// What is known of an expression.
    fn estimate(&self, graph: &Graph, root: ExprId) -> Estimate {
        let mut known: Vec<Estimate> = Vec::with_capacity(root.index() + 1);
        for k in 0..=root.index() {
            let of = |x: ExprId| known[x.index()];
            let e = match graph.node(ExprId::new(k)) {
                Node::Const(_) => CONSTANT,
                Node::Leaf(leaf) => {
                    let e = self.leaf(*leaf);
                    let at_image = is_image(*leaf);
                    // an image that moves is no polynomial of anything
                    let e = if at_image && graph.moves.is_some() { e.composed() } else { e };
                    Estimate { piecewise: graph.mapping.is_some() && at_image, ..e }
                }
                Node::Add(a, b) | Node::Sub(a, b) | Node::And(a, b) | Node::Or(a, b) => of(*a).sum(of(*b)),
                Node::InBall(a, b) | Node::Compare(_, a, b) => of(*a).sum(of(*b)),
                Node::Neg(a) | Node::Trace(a, ..) | Node::Permute(a, _) | Node::Reshape(a) => of(*a),
                Node::Pick(a, _) | Node::Not(a) | Node::Print(a) => of(*a),
                Node::Scale(a, b) | Node::MulComponents(a, b) | Node::Contract(a, b, _) => of(*a).product(of(*b)),
                Node::Divide(a, b) | Node::DivComponents(a, b) => of(*a).product(of(*b).composed()),
                Node::Stack(parts) => parts.iter().fold(CONSTANT, |sum, p| sum.sum(of(*p))),
                Node::Map(_, a) | Node::Matrix(_, a) | Node::Inverse(a) | Node::Norm(a) | Node::Unit(a) => {
                    of(*a).composed()
                }
                Node::Lookup(.., a) => of(*a).composed(),
                Node::Map2(_, a, b) => of(*a).sum(of(*b)).composed(),
                Node::Select(mask, a, b) => of(*a).sum(of(*b)).with_kink(graph.depends(*mask).unknown),
                Node::Ball(v, r) | Node::BallRatio(v, r) => {
                    of(*v).sum(of(*r)).with_kink(graph.depends(*v).unknown || graph.depends(*r).unknown)
                }
                Node::Det(a) => (1..graph.shape(*a).size(0)).fold(of(*a), |power, _| power.product(of(*a))),
            };
            known.push(e);
        }
        known[root.index()]
    }

    fn leaf(&self, leaf: Leaf) -> Estimate {
        let Self { fields, on_line, entity, view } = *self;
        let mapped = view != View::Affine;
        let order = int(entity.order);
        let of = |degree: i32, quotients: usize| {
            let mut parts = [None; 3];
            parts[quotients.min(2)] = Some(degree);
            Estimate { parts, whole: degree, ..CONSTANT }
        };
        match leaf {
            Leaf::Field { field, op, role, .. } => {
                let k = int(fields[field.index()].degree);
                // along a line the derivative of a field of that line has one degree less, also beside tensor cells
                let along_line = fields[field.index()].on_faces && on_line;
                let tested = matches!(role, Role::Test | Role::Trial);
                if view == View::ConstantState && !tested {
                    return Estimate { fields: true, ..CONSTANT };
                }
                let e = match op {
                    FieldOp::Value => of(k, 0),
                    FieldOp::Grad if mapped => of(k - order, 1),
                    FieldOp::Hess if mapped => of(k, 2),
                    _ if entity.tensor && !along_line => of(k, 0),
                    FieldOp::Grad => of((k - 1).max(0), 0),
                    FieldOp::Hess => of((k - 2).max(0), 0),
                };
                let (leaf, test) = if tested { (0, e.whole) } else { (e.whole, 0) };
                Estimate { leaf, test, fields: true, ..e }
            }
            Leaf::X | Leaf::ImageX => {
                let degree = if mapped { order.max(1) } else { 1 };
                Estimate { leaf: degree, ..of(degree, 0) }
            }
            Leaf::ElementK(_) if mapped => of(order, 0),
            Leaf::ElementB(_) if mapped => of(1 - order, 1),
            _ => CONSTANT,
        }
    }
}

/// True for what is read at the images of points: it may be in several cells.
fn is_image(leaf: Leaf) -> bool {
    matches!(leaf, Leaf::ImageX | Leaf::Field { side: Side::There, .. })
}

fn int(n: usize) -> i32 {
    i32::try_from(n).expect("degrees are small")
}
