//! Linear terms that are applied cell by cell against their matrix: products, diagonals, sizes, the level of degree 1, and
//! whole scenes against a factor.

use std::{path::Path, sync::Arc};

use wfl::{NoFiles, SourceMap, resolve};
use wfl_discrete::{
    system::{Branches, System},
    window::Window,
};
use wfl_jit::JitBackend;
use wfl_problem::{Scene, prepare};
use wfl_sparse::{
    csr::Csr,
    solve::{CheckedMultigrid, NodeLayout, Operator, OperatorLevels, SolverOptions},
};

/// A scene before its first step.
fn scene(text: &str) -> Scene {
    let mut sources = SourceMap::new();
    let main = sources.add("scene.wfl", format!("wfl 1\n{text}"));
    let script = resolve(&mut sources, main, &mut NoFiles, &[]);
    assert!(script.diagnostics.is_empty(), "{:?}", script.diagnostics);
    let backend = JitBackend::new().expect("machine code");
    let made = prepare(&script.value.expect("a script"), Path::new("."), &backend);
    made.scene.unwrap_or_else(|| panic!("{:?}", made.diagnostics))
}

/// A scene whose linear terms have an operator.
fn prepared(text: &str) -> Scene {
    let mut scene = scene(text);
    assert_eq!(scene.system.obstacle_to_operator(), None, "{text}");
    scene.system.leave_matrix().expect("a pattern");
    scene.system.begin_step(Window::new(1.0, 1.0)).expect("a step");
    scene
}

/// Numbers in -0.5..0.5 without a pattern.
fn numbers(n: usize) -> Vec<f64> {
    (1..=n).map(|i| (i as f64 * 0.618_033_988_749_894_9).fract() - 0.5).collect()
}

fn largest(values: impl IntoIterator<Item = f64>) -> f64 {
    values.into_iter().fold(0.0, |largest, value| value.abs().max(largest))
}

/// On so many threads.
fn on<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads").install(work)
}

/// `y = A x`, and the same in single precision by row.
fn products(both: &Both, x: &[f64]) -> (Vec<f64>, Vec<f32>) {
    let Both { operator, levels, layout, .. } = both;
    let mut y = vec![0.0; x.len()];
    operator.apply(x, &mut y);
    let mut by_place = vec![0.0f32; layout.points.len() * layout.components];
    layout.places.iter().zip(x).for_each(|(place, x)| by_place[*place as usize] = *x as f32);
    let mut single = vec![0.0f32; by_place.len()];
    levels.finest.apply(&by_place, &mut single);
    (y, layout.places.iter().map(|place| single[*place as usize]).collect())
}

/// The operator of a system and its matrix.
struct Both {
    operator: Arc<dyn Operator>,
    levels: OperatorLevels,
    matrix: Arc<Csr>,
    layout: NodeLayout,
}

impl Both {
    fn of(system: &System) -> Self {
        let operator = system.operator().expect("an operator");
        assert_eq!(system.bulk().values().len(), 0, "no matrix");
        let matrix = system.matrix().expect("a matrix");
        Self::new(operator, matrix, system)
    }

    fn new(operator: Arc<dyn Operator>, matrix: Arc<Csr>, system: &System) -> Self {
        let levels = operator.levels().expect("levels");
        Self { operator, levels, matrix, layout: system.node_layout().expect("a layout") }
    }

    /// The tangent of a scene at a state, which has no matrix.
    fn of_tangent(system: &System, u: &[f64]) -> Self {
        let mut tangent = system.new_tangent();
        system.tangent(u, Branches::AsWritten, &mut tangent).expect("finite");
        assert_eq!((tangent.changing.values().len(), system.bulk().values().len()), (0, 0), "no matrix");
        let matrix = Arc::new(system.whole_matrix(&tangent).expect("a matrix"));
        Self::new(tangent.operator().expect("an operator"), matrix, system)
    }

    /// The product with numbers without a pattern is that of the matrix; the size of the product, it in single precision and exact.
    fn product_agrees(&self) -> (f64, Vec<f32>, Vec<f64>) {
        let n = self.matrix.n_rows();
        let x = numbers(n);
        let mut exact = vec![0.0; n];
        self.matrix.multiply(&x, &mut exact, 1);
        let size = largest(exact.iter().copied());
        let (double, single) = on(1, || products(self, &x));
        for threads in [2, 3, 7] {
            let others = on(threads, || products(self, &x));
            assert!((&double, &single) == (&others.0, &others.1), "the same bits on {threads} threads");
        }
        let wrong = largest(double.iter().zip(&exact).map(|(a, b)| a - b)) / size;
        assert!(wrong < 1e-12, "double precision: {wrong:e}");
        (size, single, exact)
    }

    fn products_agree(&self) {
        let (size, single, exact) = self.product_agrees();
        let scale = self.levels.scale;
        let wrong = largest(single.iter().zip(&exact).map(|(a, b)| f64::from(*a) / scale - b)) / size;
        assert!(wrong < 1e-5, "single precision: {wrong:e}");
    }

    /// Blocks of the diagonal are those of the matrix; sums of rows are no smaller.
    fn diagonals_agree(&self) {
        let b = self.layout.components;
        let most = self.matrix.max_abs();
        for (row, place) in self.layout.places.iter().enumerate() {
            let node = *place as usize / b;
            for (column, other) in self.layout.places.iter().enumerate().skip(row).take(b) {
                if *other as usize / b == node {
                    let at = node * b * b + (*place as usize % b) * b + *other as usize % b;
                    let (own, exact) = (self.levels.blocks[at], self.matrix.get(row, column));
                    assert!((own - exact).abs() < 1e-12 * most, "{row} {column}: {own:e} {exact:e}");
                }
            }
            assert!((self.operator.diagonal()[row] - self.matrix.get(row, row)).abs() < 1e-12 * most, "{row}");
            let sum: f64 = self.matrix.row(row).1.iter().map(|value| value.abs()).sum();
            let bound = self.operator.row_sums()[row];
            assert!(bound > (1.0 - 1e-12) * sum && bound < 8.0 * sum, "{bound:e} for {sum:e}");
        }
        let x = numbers(self.matrix.n_rows());
        let mut sizes = vec![0.0; x.len()];
        self.operator.sizes(&x, &mut sizes);
        for (row, size) in sizes.iter().enumerate() {
            let (columns, values) = self.matrix.row(row);
            let exact: f64 = columns.iter().zip(values).map(|(c, v)| (v * x[*c as usize]).abs()).sum();
            assert!(*size > (1.0 - 1e-12) * exact, "{row}: {size:e} {exact:e}");
        }
    }

    /// The matrix of the level of degree 1 is what interpolation makes of the matrix.
    fn coarser_is_that_of_galerkin(&self) {
        let (b, given) = (self.layout.components, self.layout.interpolation.as_ref().expect("degree 1"));
        assert!(self.layout.frames.is_empty(), "in the axes of the scene");
        let list = |node: usize| &given.weights[given.starts[node]..given.starts[node + 1]];
        let coarse: Vec<usize> = (0..self.layout.points.len())
            .filter(|node| matches!(list(*node), [(own, _)] if *own as usize == *node))
            .collect();
        let coarser = &self.levels.coarser;
        assert_eq!(coarser.n_nodes, coarse.len());
        let x = numbers(coarser.places.len());
        let mut by_place = vec![0.0; self.layout.points.len() * b];
        coarser.places.iter().zip(&x).for_each(|(place, x)| {
            by_place[coarse[*place as usize / b] * b + *place as usize % b] = *x;
        });
        // fine = P x at the rows that are solved for, then Pᵀ A P x
        let weights = |place: u32| {
            list(place as usize / b).iter().map(move |(node, w)| (*node as usize * b + place as usize % b, *w))
        };
        let fine: Vec<f64> =
            self.layout.places.iter().map(|p| weights(*p).map(|(at, w)| w * by_place[at]).sum()).collect();
        let mut product = vec![0.0; fine.len()];
        self.matrix.multiply(&fine, &mut product, 1);
        let mut back = vec![0.0; by_place.len()];
        for (place, value) in self.layout.places.iter().zip(&product) {
            weights(*place).for_each(|(at, w)| back[at] += w * value);
        }
        let mut own = vec![0.0; x.len()];
        coarser.matrix.multiply(&x, &mut own, 1);
        let size = largest(own.iter().copied());
        for (place, own) in coarser.places.iter().zip(&own) {
            let exact = back[coarse[*place as usize / b] * b + *place as usize % b];
            assert!((own - exact).abs() < 1e-12 * size, "{own:e} {exact:e}");
        }
    }

    fn agree(&self) {
        self.products_agree();
        self.diagonals_agree();
        if self.layout.frames.is_empty() {
            self.coarser_is_that_of_galerkin();
        }
    }
}

const ELASTIC: &str = "term elastic on all : (300*Div_u*Id(DIM) + 800*Sym(Grad_u)):Grad_Test_u\n";

#[test]
fn every_kind_of_cell_and_degree_straight_and_distorted() {
    // straight edges of cells that are no parallelepipeds, and bent ones
    let straight = ["", " map [x + 0.2*x*y, y]", " map [x + 0.1*x*y, y, z + 0.1*y*z]"];
    let bent = ["", " map [x + 0.1*sin(3*y), y + 0.15*x*x]", " map [x + 0.1*sin(3*y*z), y + 0.15*x*z, z - 0.1*x*y]"];
    for (dim, cells, spaces) in [
        (2, "[5,4] tri", &["P2", "P3", "P4"][..]),
        (2, "[5,4] quad", &["Q2", "Q3", "Q4"]),
        (3, "[3,2,3] tet", &["P2", "P3", "P4"]),
        (3, "[3,2,3] hex", &["Q2"]),
        (3, "[2,2,1] hex", &["Q3", "Q4"]),
    ] {
        let (low, high, zero) = if dim == 2 { ("[0,0]", "[1,1]", "[0,0]") } else { ("[0,0,0]", "[1,1,1]", "[0,0,0]") };
        for map in ["", straight[dim - 1], bent[dim - 1]] {
            for space in spaces {
                let body = format!(
                    "mesh box {low} to {high} cells {cells}{map}\nregion left = faces where x < 0.2\n\
                     unknown u : vector {space}\n{}fix u = {zero} on left\nload u(1) = 1 on all\n",
                    ELASTIC.replace("DIM", &dim.to_string())
                );
                Both::of(&prepared(&body).system).agree();
                let heat = format!(
                    "mesh box {low} to {high} cells {cells}{map}\nregion left = faces where x < 0.2\n\
                     unknown T : scalar {space}\nterm flow on all : Grad_T.Grad_Test_T + 3*T*Test_T\n\
                     fix T = 0 on left\nload T = 1 on all\n"
                );
                Both::of(&prepared(&heat).system).agree();
            }
        }
    }
}

/// Entries that change from point to point, two materials, a foundation on the body and springs on a face.
#[test]
fn coefficients_materials_and_springs() {
    let scene = "mesh box [0,0,0] to [2,1,1] cells [6,3,3] tet\nregion near = cells where x < 1\nregion far = all - near\n\
        region left = faces where x == 0\nregion right = faces where x == 2\nunknown u : vector P2\n\
        def stiff = 100*(1 + x*y)\nterm here on near : (stiff*Div_u*Id(3) + 2*stiff*Sym(Grad_u)):Grad_Test_u\n\
        term there on far : (3e4*Div_u*Id(3) + 5e4*(1 + z)*Sym(Grad_u)):Grad_Test_u\nterm bed on all : 7*(1 + y)*u.Test_u\n\
        term springs on right : 50*(1 + z)*u.Test_u\nfix u(1) = 0 on left\nload u = [0,1,0] on right\n";
    Both::of(&prepared(scene).system).agree();
}

/// Two fields on two bodies that are glued, and two fields on one body that a law couples.
#[test]
fn several_fields() {
    let glued = "mesh box [0,0,0] to [2,1,1] cells [4,3,3] hex\nregion near = cells where x < 1\n\
        region far = cells where x > 1\nregion glue = interface from near to far\nregion left = faces where x == 0\n\
        region right = faces where x == 2\nunknown u : vector Q2 on near\nunknown v : vector Q2 on far\n\
        def sigma(w) = 300*Div_w*Id(3) + 800*Sym(Grad_w)\nterm here on near : sigma(u):Grad_Test_u\n\
        term there on far : sigma(v):Grad_Test_v\n\
        term tie on glue : 1e4*(u - Interpolate(v, neighbor_element)).(Test_u - Interpolate(Test_v, neighbor_element))\n\
        fix u = [0,0,0] on left\nload v = [1,1,0] on right\n";
    Both::of(&prepared(glued).system).agree();
    let on_hexahedra = "mesh box [0,0,0] to [1,1,1] cells [3,2,3] hex map [x + 0.1*x*y, y, z + 0.1*y*z]\n\
        region left = faces where x == 0\nunknown u : vector Q3\nunknown v : vector Q2\n\
        def sigma(w) = 300*Div_w*Id(3) + 800*Sym(Grad_w)\n\
        term both on all : sigma(u):Grad_Test_u + 2*sigma(v):Grad_Test_v + 90*(u - v).(Test_u - Test_v)\n\
        fix u = [0,0,0] on left\nload v = [1,1,0] on all\n";
    Both::of(&prepared(on_hexahedra).system).agree();
    let coupled = "mesh box [0,0] to [1,1] cells [6,6] tri\nregion left = faces where x == 0\nunknown a : scalar P2\n\
        unknown b : scalar P1\nterm both on all : Grad_a.Grad_Test_a + 2*Grad_b.Grad_Test_b + (a - b)*(Test_a - Test_b)\n\
        fix a = 0 on left\nload b = 1 on all\n";
    Both::of(&prepared(coupled).system).agree();
}

/// Rollers on faces that are not along axes: equations in frames of their own.
#[test]
fn nodes_with_frames() {
    let scene = "param a = 0.4\nmesh box [0,0,0] to [2,1,1] cells [4,2,2] tet map [x*cos(a) - y*sin(a), x*sin(a) + y*cos(a), z]\n\
        region foot = faces where x*cos(a) + y*sin(a) == 0\nregion side = faces where y*cos(a) - x*sin(a) == 0\n\
        region floor = faces where z == 0\nunknown u : vector P2\n\
        term elastic on all : (300*Div_u*Id(3) + 800*Sym(Grad_u)):Grad_Test_u\nfix u.Normal = 0 on foot, side, floor\n\
        load u = [1,0.3,0] on all\n";
    let both = Both::of(&prepared(scene).system);
    assert!(!both.layout.frames.is_empty());
    both.agree();
}

/// The residual of all dofs, prescribed ones included, is that with a matrix.
#[test]
fn residuals_and_reactions() {
    use wfl_discrete::system::Form;
    let text = "mesh box [0,0,0] to [1,1,1] cells [3,3,3] tet\nregion left = faces where x == 0\nunknown u : vector P2\n\
        term elastic on all : (300*Div_u*Id(3) + 800*Sym(Grad_u)):Grad_Test_u\nfix u = [0,0,0.1] on left\n\
        load u = [0,0,-1] on all\n";
    let (with_operator, mut with_matrix) = (prepared(text), scene(text));
    let u = numbers(with_operator.system.numbering.n_dofs);
    let applied = with_operator.system.residual(&u, &Form::AS_WRITTEN).expect("a residual");
    with_matrix.system.begin_step(Window::new(1.0, 1.0)).expect("a step");
    assert!(with_matrix.system.operator().is_none());
    let stored = with_matrix.system.residual(&u, &Form::AS_WRITTEN).expect("a residual");
    let size = largest(stored.values.iter().copied());
    assert!(applied.values.iter().zip(&stored.values).all(|(a, b)| (a - b).abs() < 1e-12 * size));
    for (bound, exact) in applied.linear_sizes.iter().zip(&stored.linear_sizes) {
        assert!(*bound > (1.0 - 1e-12) * exact, "{bound:e} {exact:e}");
    }
}

/// Conjugate gradients take as many iterations as with the matrix, within one, and give its solution.
#[test]
fn iterations_are_those_with_the_matrix() {
    for (cells, space) in [("[8,4,4] tet", "P2"), ("[6,3,3] tet", "P3"), ("[6,4,4] hex", "Q2")] {
        let scene = prepared(&format!(
            "mesh box [0,0,0] to [2,1,1] cells {cells}\nregion left = faces where x == 0\nunknown u : vector {space}\n\
             term elastic on all : (300*Div_u*Id(3) + 800*Sym(Grad_u)):Grad_Test_u\nfix u = [0,0,0] on left\n\
             load u = [0,0,-1] on all\n"
        ));
        let Both { operator, matrix, layout, .. } = Both::of(&scene.system);
        let n = matrix.n_rows();
        let (mut applied, mut stored) = (vec![0.0; n], vec![0.0; n]);
        let mut solver = CheckedMultigrid::new(layout.clone(), SolverOptions::default());
        assert!(solver.take_operator(operator).expect("levels"));
        let with_operator = solver.solve_to(&numbers(n), &mut applied, 0.0).expect("a solution").krylov_iterations;
        let mut solver = CheckedMultigrid::new(layout, SolverOptions::default());
        solver.take(matrix).expect("levels");
        let with_matrix = solver.solve_to(&numbers(n), &mut stored, 0.0).expect("a solution").krylov_iterations;
        assert!(with_operator.abs_diff(with_matrix) <= 1, "{space}: {with_operator} and {with_matrix}");
        let size = largest(stored.iter().copied());
        assert!(applied.iter().zip(&stored).all(|(a, b)| (a - b).abs() < 1e-9 * size), "{space}");
    }
}

/// The law of a neo-Hookean body.
const NEO_HOOKEAN: &str = "def F = Id(3) + Grad_u\ndef P = 400*(F - Inv(F)') + 300*log(Det(F))*Inv(F)'\n";

/// By dof of the first field what a map of positions gives.
fn state(system: &System, at: impl Fn([f64; 3], usize) -> f64) -> Vec<f64> {
    let mut u = vec![0.0; system.numbering.n_dofs];
    for (dof, u) in u.iter_mut().enumerate() {
        let (field, node, component) = system.numbering.describe(&system.fields, dof);
        *u = at(system.fields[field].node_position(node), component);
    }
    u
}

/// Of a state whose slopes are the same everywhere entries are their means: then levels are those of the tangent, too.
#[test]
fn tangents_at_even_states() {
    let even = |x: [f64; 3], c: usize| 0.1 * x[(c + 1) % 3] - 0.05 * x[c] + 0.02 * x[(c + 2) % 3];
    let more = "term bed on all : 7*u.Test_u\nterm springs on left : 50*u.Test_u\n";
    for (cells, space, map) in [
        ("[3,2,3] tet", "P2", ""),
        ("[2,2,2] tet", "P3", ""),
        ("[3,2,2] hex", "Q2", ""),
        ("[3,2,2] hex", "Q2", " map [x + 0.1*sin(3*y*z), y + 0.15*x*z, z - 0.1*x*y]"),
    ] {
        for more in ["", more] {
            let text = format!(
                "mesh box [0,0,0] to [1,1,1] cells {cells}{map}\nregion left = faces where x < 0.2\n\
                 unknown u : vector {space}\n{NEO_HOOKEAN}\
                 term elastic on all : P:Grad_Test_u\n{more}fix u(1) = 0 on left\nload u(2) = 1 on all\n"
            );
            let scene = prepared(&text);
            Both::of_tangent(&scene.system, &state(&scene.system, even)).agree();
        }
    }
}

/// Entries that change from point to point: a law of two bodies, with a term on a face that is not linear, in several groups of
/// cells, with numbers of the step before, and with kinks.
#[test]
fn tangents_at_any_state() {
    let bent = |x: [f64; 3], c: usize| 0.05 * (x[c] * x[(c + 1) % 3] + (2.0 * x[(c + 2) % 3]).sin());
    let near = "region near = cells where x < 1\nregion far = all - near\n";
    let right = "region near = cells where x < 1\nregion far = all - near\nregion right = faces where x == 2\n";
    for (regions, laws) in [
        (
            near,
            "term here on near : P:Grad_Test_u\nterm there on far : 3*P:Grad_Test_u\nterm bed on all : (1 + u.u)*u.Test_u\n",
        ),
        (
            right,
            "term here on near : P:Grad_Test_u\nterm there on far : (300*Div_u*Id(3) + 800*Sym(Grad_u)):Grad_Test_u\n\
         term wall on right : 1000*u(1)^3*Test_u(1)\nterm springs on left : 20*u.Test_u\n",
        ),
        (
            "",
            "term law on all : 300*Div_u*Div_Test_u + 800*(1 + Norm(Sym(Grad_u)))*Sym(Grad_u):Sym(Grad_Test_u)\n\
             term elastic on all : P:Grad_Test_u\n",
        ),
    ] {
        let text = format!(
            "mesh box [0,0,0] to [2,1,1] cells [4,2,2] tet\nregion left = faces where x == 0\n{regions}unknown u : vector P2\n{NEO_HOOKEAN}{laws}fix u(1) = 0 on left\nload u(2) = 1 on all\n"
        );
        let scene = prepared(&text);
        let both = Both::of_tangent(&scene.system, &state(&scene.system, bent));
        both.product_agrees();
        for (row, bound) in both.operator.row_sums().iter().enumerate() {
            let sum: f64 = both.matrix.row(row).1.iter().map(|value| value.abs()).sum();
            assert!(*bound > 0.8 * sum && *bound < 10.0 * sum, "{row}: {bound:e} for {sum:e}");
        }
    }
}

/// A tangent at another state, in the same cells; what was made of the first stays.
#[test]
fn a_tangent_stays_when_another_one_is_made() {
    let text = format!(
        "mesh box [0,0,0] to [1,1,1] cells [2,2,2] tet\nregion left = faces where x == 0\nunknown u : vector P2\n\
         {NEO_HOOKEAN}term elastic on all : P:Grad_Test_u\nfix u = [0,0,0] on left\nload u(2) = 1 on all\n"
    );
    let scene = prepared(&text);
    let system = &scene.system;
    let mut tangent = system.new_tangent();
    let product = |operator: &dyn Operator| {
        let mut y = vec![0.0; operator.n_rows()];
        operator.apply(&numbers(operator.n_rows()), &mut y);
        y
    };
    let moved = |size: f64| state(system, |x, c| size * x[(c + 1) % 3] * x[c]);
    system.tangent(&moved(0.1), Branches::AsWritten, &mut tangent).expect("finite");
    let first = tangent.operator().expect("an operator");
    let before = product(&*first);
    let memory = tangent.memory();
    system.tangent(&moved(0.2), Branches::AsWritten, &mut tangent).expect("finite");
    assert_eq!(product(&*first), before);
    let second = product(&*tangent.operator().expect("an operator"));
    assert!(second != before);
    let residual = system.residual(&moved(0.1), &wfl_discrete::system::Form::AS_WRITTEN).expect("finite");
    let sizes = |tangent: &wfl_discrete::system::Tangent| system.sizes(&moved(0.1), &residual, tangent);
    let of_second = sizes(&tangent);
    assert!(tangent.recall(&memory) && tangent.operator().is_none());
    assert!(sizes(&tangent) != of_second);
    system.tangent(&moved(0.1), Branches::AsWritten, &mut tangent).expect("finite");
    assert_eq!(product(&*tangent.operator().expect("an operator")), before);
    let of_first = sizes(&tangent);
    assert!(tangent.recall(&memory));
    assert_eq!(sizes(&tangent), of_first);
}

/// Levels that have means of the entries take about as many iterations as those of the matrix.
#[test]
fn iterations_with_tangents_are_those_with_their_matrix() {
    for (cells, space) in [("[8,4,4] tet", "P2"), ("[6,4,4] hex", "Q2")] {
        let scene = prepared(&format!(
            "mesh box [0,0,0] to [2,1,1] cells {cells}\nregion left = faces where x == 0\nunknown u : vector {space}\n\
             {NEO_HOOKEAN}term elastic on all : P:Grad_Test_u\nfix u = [0,0,0] on left\nload u = [0,0,-1] on all\n"
        ));
        let u = state(&scene.system, |x, c| 0.03 * x[0] * x[(c + 2) % 3]);
        let Both { operator, matrix, layout, .. } = Both::of_tangent(&scene.system, &u);
        let n = matrix.n_rows();
        let (mut applied, mut stored) = (vec![0.0; n], vec![0.0; n]);
        let mut solver = CheckedMultigrid::new(layout.clone(), SolverOptions::default());
        assert!(solver.take_operator(operator).expect("levels"));
        let with_operator = solver.solve_to(&numbers(n), &mut applied, 0.0).expect("a solution").krylov_iterations;
        let mut solver = CheckedMultigrid::new(layout, SolverOptions::default());
        solver.take(matrix).expect("levels");
        let with_matrix = solver.solve_to(&numbers(n), &mut stored, 0.0).expect("a solution").krylov_iterations;
        assert!(with_operator <= with_matrix + 3, "{space}: {with_operator} and {with_matrix}");
        let size = largest(stored.iter().copied());
        assert!(applied.iter().zip(&stored).all(|(a, b)| (a - b).abs() < 1e-9 * size), "{space}");
    }
}
