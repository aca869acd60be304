//! Sums over directions against the same sums over all functions at once, which a rule with its points in another order takes.

use wfl_compiler::types::{FieldId, FieldOp, Side};
use wfl_mesh::{
    cell::CellKind,
    element::{Element, Family},
    quadrature,
};

use super::*;
use crate::assemble::{
    Basis, SlotPlace,
    basis::Starts,
    binding::GroupBinding,
    entries::{Coefficient, Entries},
};

/// Two batches in single and three in double precision, the last one in part.
const N_CELLS: usize = 19;
const N_OUTPUTS: usize = 2;

/// A field: its degree, its components, and what slots read.
#[derive(Clone, Copy, Debug)]
struct Of {
    degree: usize,
    n_components: usize,
    ops: &'static [FieldOp],
}

/// Fields on cells of a kind with a Gauss rule.
#[derive(Clone, Debug)]
struct Case {
    kind: CellKind,
    n_on_line: usize,
    is_affine: bool,
    fields: Vec<Of>,
}

/// Numbers in -0.5..0.5 without a pattern.
fn number(k: usize) -> f64 {
    ((k + 1) as f64 * 0.618_033_988_749_894_9).fract() - 0.5
}

impl Case {
    /// The bases at points, the dofs where fields start, and how many there are.
    fn bases(&self, points: &[[f64; 3]]) -> (Vec<Basis>, Vec<Option<usize>>, usize) {
        let (mut bases, mut starts, mut offset, mut n_dofs) = (Vec::new(), Vec::new(), 0, 0);
        for (k, of) in self.fields.iter().enumerate() {
            let element = Element::lagrange(self.kind, of.degree, Family::Continuous).expect("an element");
            let n = element.n_dofs();
            let nodes = (0..N_CELLS).flat_map(|cell| (0..n).map(move |k| ((cell * 7 + k) % (n + 40)) as u32)).collect();
            let basis = Basis {
                field: FieldId::new(k),
                side: Side::Here,
                n_components: of.n_components,
                n_nodes: n,
                table: element.tabulate(points, 1),
                tangents: None,
                rows: Arc::default(),
                counts: Vec::new(),
                own_tangents: Vec::new(),
                order: 1,
                nodes,
                offset,
                support: Vec::new(),
                starts: Starts::default(),
            };
            offset += basis.n_dofs();
            starts.push(Some(n_dofs));
            n_dofs += (n + 40) * of.n_components;
            bases.push(basis);
        }
        (bases, starts, n_dofs)
    }

    fn slots(&self) -> Vec<SlotPlace> {
        let mut slots = Vec::new();
        for (basis, of) in self.fields.iter().enumerate() {
            for component in 0..of.n_components {
                for op in of.ops {
                    let n = if *op == FieldOp::Grad { self.kind.dim() } else { 1 };
                    slots.extend((0..n).map(|direction| SlotPlace { basis, component, op: *op, direction }));
                }
            }
        }
        slots
    }

    /// All fluxes depend on all numbers, by entries of every sort.
    fn entries(n_slots: usize) -> Entries {
        use Coefficient::{Constant, Output, Uniform};
        let coefficients = vec![Constant(0.7), Output(0), Constant(-0.3), Output(1), Uniform(0)];
        let n = coefficients.len();
        let pairs = (0..n_slots).flat_map(|t| (0..n_slots).map(move |s| (t, s, (t.min(s) * 3 + t.max(s)) % n)));
        Entries { coefficients, list: pairs.collect(), symmetric: true, n_outputs: N_OUTPUTS, outputs: Vec::new() }
    }

    /// The product with numbers without a pattern, of a rule that begins with its point `turn`; by field whether sums are taken
    /// direction by direction.
    fn product<T: Number + Into<f64>>(&self, turn: usize) -> (Vec<f64>, Vec<bool>) {
        let (rule, dim) = (quadrature::gauss(self.kind, self.n_on_line).expect("a rule"), self.kind.dim());
        let order: Vec<usize> = (0..rule.n_points()).map(|q| (q + turn) % rule.n_points()).collect();
        let points: Vec<[f64; 3]> = order.iter().map(|q| rule.points[*q]).collect();
        let weights: Vec<f64> = order.iter().map(|q| rule.weights[*q]).collect();
        let (bases, starts, n_dofs) = self.bases(&points);
        let (slots, binding) = (self.slots(), GroupBinding { bases, values: Vec::new(), n_derivatives: 0, bent: None });
        let entries = Self::entries(slots.len());
        let group = Group {
            dim,
            n_cells: N_CELLS,
            weights: &weights,
            points: &points,
            is_affine: self.is_affine,
            binding: &binding,
            starts: &starts,
            tests: &slots,
            trials: &slots,
            entries: &entries,
        };
        let mut skeleton = Skeleton::<T>::new(&[group], n_dofs, 1.0);
        let of_points = if self.is_affine { &order[..1] } else { &order[..] };
        let lanes = |batch: usize, of: &dyn Fn(usize) -> f64| {
            Lanes(std::array::from_fn(|lane| of((batch * LANES + lane).min(N_CELLS - 1))))
        };
        for batch in 0..N_CELLS.div_ceil(LANES) {
            let n = dim * dim + 1;
            let maps = of_points.iter().flat_map(|q| {
                let q = if self.is_affine { 0 } else { *q };
                (0..n).map(move |k| {
                    lanes(batch, &|cell| number((cell * 1000 + q) * n + k) + if k % (dim + 1) == 0 { 1.0 } else { 0.0 })
                })
            });
            skeleton.take_maps(0, batch, &maps.collect::<Vec<_>>());
        }
        let keeping = Keeping { entries: &entries, uniforms: &[1.3], factor: 1.0, are_means: false };
        let outputs = |(): &mut (), _: usize, batch: usize, out: &mut Vec<f64>| {
            out.clear();
            for q in &order {
                (0..N_OUTPUTS).for_each(|k| out.extend(lanes(batch, &|cell| number((cell * 500 + q) * 3 + k)).0));
            }
        };
        let on_lines = skeleton.groups[0].functions.iter().map(|of| of.lines.is_some()).collect();
        let term = Arc::new(skeleton).with_law(keeping, outputs).expect("finite");
        let u: Vec<T> = (0..n_dofs).map(|k| T::of(number(k))).collect();
        let on = |threads: usize| -> Vec<f64> {
            let mut out = vec![T::default(); n_dofs];
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
            pool.install(|| term.add(&u, &mut out));
            out.into_iter().map(Into::into).collect()
        };
        let product = on(1);
        for threads in [2, 3, 7] {
            assert!(product == on(threads), "{self:?}: the same bits on {threads} threads");
        }
        (product, on_lines)
    }

    /// In one precision, where sums of such numbers are rounded to this part of the largest.
    fn agrees_in<T: Number + Into<f64>>(&self, rounding: f64) -> Vec<bool> {
        let ((own, on_lines), (other, others_on_lines)) = (self.product::<T>(0), self.product::<T>(1));
        assert!(!others_on_lines.contains(&true), "points in another order are no grid");
        let size = other.iter().fold(0.0, |size: f64, x| size.max(x.abs()));
        let wrong = own.iter().zip(&other).fold(0.0, |wrong: f64, (a, b)| wrong.max((a - b).abs())) / size;
        assert!(size > 0.0 && wrong < rounding, "{self:?}: {wrong:e}");
        on_lines
    }

    fn agrees(&self) -> Vec<bool> {
        let single = self.agrees_in::<f32>(2e-6);
        assert_eq!(single, self.agrees_in::<f64>(4e-15), "{self:?}: the same way in both precisions");
        single
    }
}

const VALUE: &[FieldOp] = &[FieldOp::Value];
const SLOPE: &[FieldOp] = &[FieldOp::Grad];
const BOTH: &[FieldOp] = &[FieldOp::Value, FieldOp::Grad];

#[test]
fn sums_over_directions_are_those_over_all_functions() {
    for kind in [CellKind::Quadrilateral, CellKind::Hexahedron] {
        for degree in 1..=4 {
            for (is_affine, n_on_line, n_components, ops) in [
                (true, degree + 1, kind.dim(), SLOPE),
                (false, degree + 1, kind.dim(), BOTH),
                (false, degree + 2, 1, SLOPE),
                (true, degree + 1, 1, VALUE),
            ] {
                let fields = vec![Of { degree, n_components, ops }];
                let on_lines = Case { kind, n_on_line, is_affine, fields }.agrees();
                let fastest = if kind == CellKind::Hexahedron { 2 } else { 4 };
                assert!(on_lines[0] || degree < fastest, "{kind} of degree {degree}");
            }
        }
    }
}

#[test]
fn fields_of_several_degrees_are_summed_each_in_its_way() {
    let dim = CellKind::Hexahedron.dim();
    let of = |degree, n_components, ops| Of { degree, n_components, ops };
    for (fields, on_lines) in [
        (vec![of(2, dim, BOTH), of(1, 1, VALUE)], [true, false]),
        (vec![of(4, dim, SLOPE), of(3, 2, BOTH)], [true, true]),
        (vec![of(0, 1, VALUE), of(2, dim, SLOPE)], [false, true]),
        (vec![of(3, dim, BOTH), of(2, dim, BOTH)], [true, true]),
    ] {
        let n_on_line = fields.iter().map(|of| of.degree).max().unwrap_or(0) + 1;
        for is_affine in [true, false] {
            let case = Case { kind: CellKind::Hexahedron, n_on_line, is_affine, fields: fields.clone() };
            assert_eq!(case.agrees(), on_lines, "{case:?}");
        }
    }
}

#[test]
fn fewer_points_than_functions_and_other_cells_are_summed_at_once() {
    let fields = vec![Of { degree: 3, n_components: 2, ops: SLOPE }];
    for (kind, n_on_line) in [(CellKind::Hexahedron, 3), (CellKind::Tetrahedron, 4), (CellKind::Wedge, 4)] {
        let case = Case { kind, n_on_line, is_affine: true, fields: fields.clone() };
        assert_eq!(case.agrees(), [false], "{case:?}");
    }
}
