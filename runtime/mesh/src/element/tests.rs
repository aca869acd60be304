use super::*;
use crate::cell::Basis;
use crate::quadrature;

fn all() -> impl Iterator<Item = Element> {
    Element::registry().into_iter().map(|(kind, degree)| Element::lagrange(kind, degree, Family::Continuous).unwrap())
}

/// Points inside and around the reference cell, none special.
fn points(kind: CellKind) -> Vec<[f64; 3]> {
    // the last one stays away from the plane of the apex of a pyramid, where functions that are rational grow
    let beyond = if kind.basis() == Basis::Pyramid { [1.3, -0.4, 0.2] } else { [1.3, -0.4, 0.9] };
    let raw = [[0.21, 0.13, 0.37], [0.05, 0.61, 0.02], [0.83, 0.07, 0.55], beyond];
    let keep = |x: [f64; 3]| std::array::from_fn(|d| if d < kind.dim() { x[d] } else { 0.0 });
    raw.map(keep).to_vec()
}

#[test]
fn every_element_is_nodal_and_sums_to_one() {
    for element in all() {
        let n = element.n_dofs();
        let table = element.tabulate(element.points(), 0);
        for point in 0..n {
            for dof in 0..n {
                let expected = if point == dof { 1.0 } else { 0.0 };
                let value = table.values[point * n + dof];
                assert!((value - expected).abs() < 1e-14, "{} {dof} at {point}: {value}", element.kind());
            }
        }
        let table = element.tabulate(&points(element.kind()), 2);
        let dim = table.dim;
        for point in 0..table.n_points {
            let rows = point * n..(point + 1) * n;
            assert!((table.values[rows.clone()].iter().sum::<f64>() - 1.0).abs() < 1e-13);
            for d in 0..dim {
                let slope: f64 = rows.clone().map(|r| table.gradients[r * dim + d]).sum();
                assert!(slope.abs() < 1e-12);
            }
            for de in 0..dim * dim {
                let bend: f64 = rows.clone().map(|r| table.hessians[r * dim * dim + de]).sum();
                assert!(bend.abs() < 1e-11);
            }
        }
    }
}

#[test]
fn dof_counts_are_those_of_the_polynomial_spaces() {
    for element in all() {
        let (dim, k) = (element.kind().dim(), element.degree());
        let expected = match element.kind().basis() {
            Basis::Simplex => (1..=dim).map(|i| (k + i) as f64 / i as f64).product::<f64>().round() as usize,
            Basis::Tensor => (k + 1).pow(dim as u32),
            Basis::Wedge => (k + 1) * (k + 1) * (k + 2) / 2,
            Basis::Pyramid if k == 0 => 1,
            Basis::Pyramid => (k + 1) * (k + 2) * (2 * k + 3) / 6,
        };
        assert_eq!(element.n_dofs(), expected);
        assert_eq!(element.entities().len(), expected);
    }
}

#[test]
fn gradients_and_hessians_agree_with_differences() {
    // differences of fourth order are exact for polynomials of degree 4: the step is large against rounding, and small where
    // functions of pyramids are no polynomials
    let step = 3e-4;
    for element in all() {
        let (n, dim) = (element.n_dofs(), element.kind().dim());
        for x in points(element.kind()) {
            let table = element.tabulate(&[x], 2);
            for d in 0..dim {
                let places = [1.0, -1.0, 2.0, -2.0].map(|k| {
                    let mut place = x;
                    place[d] += k * step;
                    place
                });
                let shifted = element.tabulate(&places, 1);
                let slope_of = |at: &dyn Fn(usize) -> f64| (8.0 * (at(0) - at(1)) - (at(2) - at(3))) / (12.0 * step);
                for dof in 0..n {
                    let slope = slope_of(&|p| shifted.values[p * n + dof]);
                    assert!((slope - table.gradients[dof * dim + d]).abs() < 2e-7);
                    for e in 0..dim {
                        let bend = slope_of(&|p| shifted.gradients[(p * n + dof) * dim + e]);
                        let found = table.hessians[(dof * dim + e) * dim + d];
                        assert!((bend - found).abs() < 2e-7, "{} {bend} {found}", element.kind());
                    }
                }
            }
        }
    }
}

#[test]
fn monomials_of_the_degree_are_reproduced_and_the_next_is_not() {
    let power = |x: f64, n: usize| (0..n).map(|_| x).product::<f64>();
    for element in all().filter(|e| e.kind().dim() > 0) {
        let (dim, k) = (element.kind().dim(), element.degree());
        let exact = |i: [usize; 3]| {
            let f = |x: &[f64; 3]| (0..3).map(|d| power(x[d], i[d])).product::<f64>();
            let nodal: Vec<f64> = element.points().iter().map(f).collect();
            let test_points = points(element.kind());
            let table = element.tabulate(&test_points, 0);
            test_points.iter().zip(table.values.chunks_exact(nodal.len())).all(|(x, row)| {
                let value: f64 = row.iter().zip(&nodal).map(|(a, b)| a * b).sum();
                (value - f(x)).abs() < 1e-12
            })
        };
        let reach = |d: usize| if d < dim { k } else { 0 };
        for i in 0..=reach(0) {
            for j in 0..=reach(1) {
                for l in 0..=reach(2) {
                    let is_in = match element.kind().basis() {
                        Basis::Simplex | Basis::Pyramid => i + j + l <= k,
                        Basis::Tensor => true,
                        Basis::Wedge => i + j <= k,
                    };
                    if is_in {
                        assert!(exact([i, j, l]), "{} {k}: {i} {j} {l}", element.kind());
                    }
                }
            }
        }
        assert!(!exact([k + 1, 0, 0]));
    }
}

#[test]
fn only_dofs_of_the_closure_have_a_trace_and_it_is_the_facet_element() {
    for element in all().filter(|e| e.degree() > 0) {
        for (local, facet) in element.kind().facets().iter().enumerate() {
            let on_facet = Element::lagrange(facet.kind, element.degree(), Family::Continuous).unwrap();
            let rule = quadrature::rule(facet.kind, 3).unwrap();
            let points = quadrature::facet_points(element.kind(), local, &rule);
            let (inner, outer) = (on_facet.tabulate(&rule.points, 0), element.tabulate(&points, 0));
            let closure = element.facet_closure(local);
            assert_eq!(closure.len(), on_facet.n_dofs());
            for p in 0..rule.n_points() {
                for dof in 0..element.n_dofs() {
                    let expected =
                        closure.iter().position(|c| *c == dof).map_or(0.0, |i| inner.values[p * inner.n_dofs + i]);
                    assert!((outer.values[p * outer.n_dofs + dof] - expected).abs() < 1e-13);
                }
            }
        }
    }
}

#[test]
fn entities_agree_with_the_points() {
    for element in all().filter(|e| e.degree() > 0) {
        let kind = element.kind();
        let vertex = |v: &usize| kind.vertices()[*v];
        for (point, entity) in element.points().iter().zip(element.entities()) {
            let expected = match *entity {
                DofEntity::Vertex(v) => vertex(&v),
                DofEntity::Edge { edge, index } => {
                    let [a, b] = kind.edges()[edge].map(|v| vertex(&v));
                    let t = (index + 1) as f64 / element.degree() as f64;
                    std::array::from_fn(|d| a[d] + t * (b[d] - a[d]))
                }
                DofEntity::Facet { facet, index } => {
                    let (degree, of) = (element.degree(), kind.facets()[facet].kind);
                    let places = (1..degree).flat_map(|r| (1..degree).map(move |s| [s, r]));
                    let mut inside = places.filter(|[s, r]| of == CellKind::Quadrilateral || s + r < degree);
                    let [s, r] = inside.nth(index).expect("a place inside the facet").map(|k| k as f64 / degree as f64);
                    kind.facet_map(facet).apply([s, r, 0.0])
                }
                DofEntity::Interior(_) => {
                    let hats = kind.hat_values(*point);
                    assert!(hats[..kind.n_vertices()].iter().all(|h| *h > 0.0));
                    continue;
                }
            };
            assert!((0..3).all(|d| (point[d] - expected[d]).abs() < 1e-15), "{kind} {entity:?}");
        }
    }
}

#[test]
fn too_high_a_degree_is_an_error() {
    let error = Element::lagrange(CellKind::Hexahedron, 5, Family::Continuous).unwrap_err();
    assert_eq!(error.to_string(), "no Lagrange element of degree 5 on a hexahedron, the highest is 4");
}
