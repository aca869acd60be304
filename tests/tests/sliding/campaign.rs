//! Random scenes of bodies that slide, along rays and at closest points: every step is found, images are those of a search that
//! tries all faces, forces add up to nothing, and a rotation of everything turns them.

use std::path::Path;

use wfl_discrete::{
    assemble::{AssembledTerm, FieldValues},
    domain::{Follows, MovingPoints},
    space::Space,
    system::System,
};
use wfl_mesh::{
    element::Table,
    mesh::{FacetRef, Mesh},
};
use wfl_tests::{Sequence, Solved, attempt};

/// Scenes; `WFL_SLIDING_SCENES` is another number of them.
const SCENES: u64 = if cfg!(debug_assertions) { 20 } else { 200 };

/// How images are found, and the macros of a penalty with friction that go with it.
#[derive(Clone, Copy)]
struct Way {
    word: &'static str,
    macros: &'static str,
    /// How far faces may be out of line (length): over an edge between them the normal at a closest point jumps, and between
    /// both there may be no state.
    bump: f64,
}

const RAYS: Way = Way { word: "raytrace", macros: "sliding", bump: 0.03 };
const CLOSEST: Way = Way { word: "project", macros: "closest", bump: 0.0 };

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn random_scenes_slide_without_a_wrong_image() {
    slide(RAYS);
}

#[test]
#[cfg_attr(debug_assertions, ignore = "slow: release suite")]
fn random_scenes_slide_at_closest_points() {
    slide(CLOSEST);
}

fn slide(way: Way) {
    let n = std::env::var("WFL_SLIDING_SCENES").ok().and_then(|n| n.parse().ok()).unwrap_or(SCENES);
    let first = std::env::var("WFL_SLIDING_FIRST").ok().and_then(|n| n.parse().ok()).unwrap_or(0);
    let mut failed = Vec::new();
    for seed in first..first + n {
        let text = scene(seed, way);
        let made = attempt(Path::new("."), text.clone(), &[], &[]);
        let found = made.solved.unwrap_or_else(|| panic!("scene {seed}: {}\n{text}", made.messages));
        if !found.outcome.converged() {
            failed.push(seed);
            continue;
        }
        examine(&found, way, &format!("scene {seed}:\n{text}"));
    }
    eprintln!("{} of {n} scenes by `{}` not solved: {failed:?}", failed.len(), way.word);
    // deformed faces meet at angles, and rays come off faces that are bent: a point then has an image or none, and no state
    // may lie between. Smaller steps solve these scenes; the parts of a step that the schedule tries may not
    let most = if way.word == CLOSEST.word { n / 40 } else { n / 100 };
    assert!(failed.len() as u64 <= most, "not solved: scenes {failed:?}");
}

/// Two blocks, of which the upper one is pressed down and pushed over the lower one.
fn scene(seed: u64, way: Way) -> String {
    let mut random = Sequence(0x9e37_79b9 + 7919 * seed);
    (0..8).for_each(|_| {
        random.number();
    });
    // from 0 to 1
    let mut part = || 0.5 + 0.5 * random.number();
    let in_space = seed % 5 == 4;
    let of = |list: &[&str], x: f64| -> String {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "an index")]
        let k = (x * list.len() as f64) as usize;
        list[k.min(list.len() - 1)].to_owned()
    };
    let (shape, element) = if in_space {
        (of(&["hex", "tet"], part()), "1".to_owned())
    } else {
        (of(&["quad", "tri"], part()), of(&["1", "2"], part()))
    };
    let letter = if shape == "hex" || shape == "quad" { "Q" } else { "P" };
    let (fric, gamma, slide) = (part(), 10f64.powf(0.5 + 2.5 * part()), 0.05 + 0.45 * part());
    let (bump, press) = (way.bump * part(), 0.01 + 0.02 * part());
    let (mesh, dim, zero) = if in_space {
        let map = format!("[x, y, z + {bump}*sin(3*x + 2*y)*(z - 1)*(2 - z)]");
        (format!("mesh box [0,0,0] to [3,1,2] cells [5,1,4] {shape} map {map} with idle_cells=allowed"), 3, "0, 0, 0")
    } else {
        let map = format!("[x + {bump}*sin(4*y), y + {bump}*sin(5*x)*(2 - y)*y]");
        (format!("mesh box [0,0] to [4,2] cells [6,4] {shape} map {map} with idle_cells=allowed"), 2, "0, 0")
    };
    let up = if in_space { "z" } else { "y" };
    let motion = if in_space {
        format!("[{slide}*max(0, s - 1), 0.02*max(0, s - 1), -{press}*min(s, 1)]")
    } else {
        format!("[{slide}*max(0, s - 1), -{press}*min(s, 1)]")
    };
    let Way { word, macros, .. } = way;
    format!(
        "wfl 1
use \"sliding\"
{mesh}
region lower = cells where {up} < 1
region upper = cells where {up} > 1 and x < 1.6
region sole  = interface from upper to lower
region floor = faces of lower where {up} > 0.9
region lid   = faces of upper where {up} > 1.9
region base  = faces of lower where {up} < 0.1
unknown a : vector {letter}{element} on upper
unknown b : vector {letter}{element} on lower
def P(g) = 0.4*((Id({dim}) + g) - Inv(Id({dim}) + g)') + 0.5*log(Det(Id({dim}) + g))*Inv(Id({dim}) + g)'
term upper on upper : P(Grad_a):Grad_Test_a
term lower on lower : P(Grad_b):Grad_Test_b
mapping m = {word} from sole onto floor moving with a, b within 0.3
state elastic : vector on sole := {macros}_elastic(a, b, m, elastic, {gamma}, {fric})
term contact on sole : {macros}_friction(a, b, m, elastic, {gamma}, {fric})
quadrature on sole degree 3
steps s = 0 to 2 by 1
fix a = {motion} on lid
fix b = [{zero}] on base
"
    )
}

/// Part of the extent by which nodes are moved to see how much forces change.
const NUDGE: f64 = 1e-7;

/// Images, momentum and invariance at the last state.
fn examine(found: &Solved, way: Way, name: &str) {
    let system: &System = &found.outcome.equations.system;
    let u = &found.outcome.steps.last().expect("states are kept").state;
    let term = system.terms.iter().find(|t| t.law.name == "contact").expect("the term");
    let points = term.integrator.domain.moving.clone().expect("a map that moves");
    if system.mesh.dim() == 2 {
        match way.word {
            "project" => closest_of_all_faces(system, u, &points, name),
            _ => images_by_all_faces(system, u, &points, name),
        }
    }
    let values = system.values(u);
    let forces = residual(term, system, values.view());
    let dim = system.mesh.dim();
    let size = forces.iter().fold(0.0f64, |m, f| m.max(f.abs()));
    assert!(size > 0.0, "nothing presses in {name}");
    for c in 0..dim {
        let sum: f64 = forces.iter().skip(c).step_by(dim).sum();
        assert!(sum.abs() < 1e-12 * size, "forces add up to {sum} of {size} in {name}");
    }
    // everything turned, at the end of the last step and now: from the reference placement, by a finite angle
    let now = turned(system, u);
    let past = turned(system, &system.past().expect("the past").unknowns);
    let mut values = system.values(&now);
    for field in 0..system.fields.len() {
        if let Some(range) = system.range(field) {
            values.previous[field] = &past[range];
        }
    }
    let again = residual(term, system, values.view());
    // what rounding of turned positions makes of forces: a law of contact multiplies it by its parameter
    let (low, high) = system.mesh.bounds();
    let extent = (0..dim).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
    let beside: Vec<f64> = now.iter().zip(0u32..).map(|(v, k)| v + NUDGE * extent * f64::from(k).sin()).collect();
    let mut moved = system.values(&beside);
    moved.previous.clone_from(&values.previous);
    let moved = residual(term, system, moved.view());
    let change = moved.iter().zip(&again).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    let rounding = 4.0 * f64::EPSILON / NUDGE * change;
    for (node, force) in again.chunks(dim).zip(forces.chunks(dim)) {
        let expected = rotate(force);
        for c in 0..dim {
            let difference = (node[c] - expected[c]).abs();
            assert!(
                difference < 1e-12 * size + rounding,
                "a rotation changes forces by {difference} of {size} in {name}"
            );
        }
    }
}

fn residual(term: &AssembledTerm, system: &System, values: FieldValues<'_>) -> Vec<f64> {
    let mut forces = vec![0.0; system.numbering.n_dofs];
    term.add_residual(&system.mesh, values, &mut forces).expect("finite forces");
    forces
}

/// By an angle of 0.7 about the third axis.
fn rotate(v: &[f64]) -> [f64; 3] {
    let (s, c) = 0.7f64.sin_cos();
    [c * v[0] - s * v[1], s * v[0] + c * v[1], v.get(2).copied().unwrap_or(0.0)]
}

/// The displacements `R (X + u) - X`.
fn turned(system: &System, u: &[f64]) -> Vec<f64> {
    let (dim, mut out) = (system.mesh.dim(), u.to_vec());
    for (field, of) in system.fields.iter().enumerate() {
        let Some(range) = system.range(field) else { continue };
        for (node, own) in out[range].chunks_mut(dim).enumerate() {
            let x = of.node_position(node);
            let place: Vec<f64> = own.iter().zip(x).map(|(u, x)| u + x).collect();
            own.iter_mut().zip(rotate(&place)).zip(x).for_each(|((u, y), x)| *u = y - x);
        }
    }
    out
}

/// The sum over nodes of a cell: `[i]` is the value, `[1 + j][i]` its derivative along reference direction j.
fn at(mesh: &Mesh, space: &Space, cell: wfl_mesh::mesh::CellId, r: [f64; 3], u: &[f64]) -> [[f64; 2]; 3] {
    let mut sum = [[0.0; 2]; 3];
    let mut add = |table: &Table, k: usize, value: [f64; 2]| {
        for (i, v) in value.into_iter().enumerate() {
            sum[0][i] += v * table.values[k];
            for j in 0..2 {
                sum[1 + j][i] += v * table.gradients[2 * k + j];
            }
        }
    };
    let geometry = mesh.geometry_element(mesh.kind(cell)).tabulate(&[r], 1);
    for (k, node) in mesh.cell_nodes(cell)[..geometry.n_dofs].iter().enumerate() {
        let [x, y, _] = mesh.node(*node);
        add(&geometry, k, [x, y]);
    }
    let position = space.position_of_cell(cell).expect("the displacement lives here");
    let table = space.element_at(position).tabulate(&[r], 1);
    for (k, node) in space.entity_nodes(position).iter().enumerate() {
        let own = u.get(2 * *node as usize..2 * *node as usize + 2).unwrap_or(&[0.0, 0.0]);
        add(&table, k, [own[0], own[1]]);
    }
    sum
}

/// Position and outward normal of a face, in the current placement.
fn on_face(mesh: &Mesh, space: &Space, facet: FacetRef, r: [f64; 3], u: &[f64]) -> [[f64; 2]; 2] {
    let [y, d1, d2] = at(mesh, space, facet.cell, r, u);
    let kind = mesh.kind(facet.cell);
    let [n1, n2, _] = kind.facet_normal(usize::from(facet.local));
    // the cofactors of the derivatives carry normals along
    let sign = (d1[0] * d2[1] - d1[1] * d2[0]).signum();
    let n = [sign * (d2[1] * n1 - d1[1] * n2), sign * (-d2[0] * n1 + d1[0] * n2)];
    let size = n[0].hypot(n[1]);
    [y, [n[0] / size, n[1] / size]]
}

/// Each image is the one that is found by cutting all faces into small pieces and halving those that the ray meets.
fn images_by_all_faces(system: &System, u: &[f64], points: &std::sync::Arc<MovingPoints>, name: &str) {
    let (mesh, reach) = (&system.mesh, 0.3);
    let values = system.slices(u);
    let domain = points.at(mesh, &values);
    let [here, there]: [&Follows; 2] = points.follows();
    let targets: Vec<FacetRef> = points.targets().collect();
    let mut found_some = 0;
    for (group, k) in domain.entities() {
        let (cell, facet) = (group.here.cells[k], group.here.facets[k]);
        let r = group.here.points[group.here.row(k, 0)];
        let [x, n] = on_face(mesh, &here.space, facet, r, values[here.field]);
        let mut best: Option<(f64, FacetRef)> = None;
        let mut close_to_an_end = false;
        for target in targets.iter().filter(|t| t.cell != cell) {
            let kind = mesh.kind(target.cell);
            let place = |p: f64| {
                let r = kind.facet_map(usize::from(target.local)).apply([p, 0.0, 0.0]);
                let [y, normal] = on_face(mesh, &there.space, *target, r, values[there.field]);
                let d = [y[0] - x[0], y[1] - x[1]];
                // beside the ray, along it, and how the face looks at it
                [d[0] * n[1] - d[1] * n[0], d[0] * n[0] + d[1] * n[1], normal[0] * n[0] + normal[1] * n[1]]
            };
            for end in [0.0, 1.0] {
                close_to_an_end |= place(end)[0].abs() < 2e-3 && place(end)[1].abs() < reach;
            }
            let step = 1.0 / 32.0;
            for k in 0..32 {
                let (mut low, mut high) = (f64::from(k) * step, f64::from(k + 1) * step);
                if place(low)[0] * place(high)[0] > 0.0 {
                    continue;
                }
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if place(low)[0] * place(middle)[0] <= 0.0 { high = middle } else { low = middle }
                }
                let [_, g, looks] = place(0.5 * (low + high));
                if looks < 0.0 && g.abs() <= reach && best.is_none_or(|(b, _)| g.abs() < b.abs()) {
                    best = Some((g, *target));
                }
            }
        }
        if close_to_an_end {
            // at an edge two faces have the image, at a border the first part of a face beyond it
            continue;
        }
        let motion = group.motion(k).expect("images move");
        let image = if motion.stand_in.is_none() { Some(motion.gap) } else { None };
        let same = match (image, best) {
            (Some(gap), Some((g, facet))) => {
                (gap - g).abs() < 1e-10 && group.there.as_ref().is_some_and(|side| side.facets[k] == facet)
            }
            (None, None) => true,
            _ => false,
        };
        found_some += usize::from(image.is_some());
        assert!(same, "{image:?} in place of {best:?} at {x:?} in {name}");
    }
    assert!(found_some > 0, "no image away from edges in {name}");
}

/// Each closest point is the one that is found by cutting all faces into small pieces and narrowing the nearest of them.
fn closest_of_all_faces(system: &System, u: &[f64], points: &std::sync::Arc<MovingPoints>, name: &str) {
    let (mesh, reach) = (&system.mesh, 0.3);
    let values = system.slices(u);
    let domain = points.at(mesh, &values);
    let [here, there]: [&Follows; 2] = points.follows();
    let targets: Vec<FacetRef> = points.targets().collect();
    let mut found_some = 0;
    for (group, k) in domain.entities() {
        let r = group.here.points[group.here.row(k, 0)];
        let [x, n] = on_face(mesh, &here.space, group.here.facets[k], r, values[here.field]);
        let away = |y: [f64; 2]| (y[0] - x[0]).hypot(y[1] - x[1]);
        // the distance, and how the face looks at the point
        let mut best: Option<[f64; 2]> = None;
        let mut is_doubtful = false;
        for target in targets.iter().filter(|t| t.cell != group.here.cells[k]) {
            let map = mesh.kind(target.cell).facet_map(usize::from(target.local));
            let place = |p: f64| {
                let r = map.apply([p, 0.0, 0.0]);
                let [y, normal] = on_face(mesh, &there.space, *target, r, values[there.field]);
                [away(y), normal[0] * n[0] + normal[1] * n[1]]
            };
            let [distance, looks] = nearest(&place);
            is_doubtful |= distance < reach + 1e-6 && (looks + 0.5).abs() < 1e-3 || (distance - reach).abs() < 1e-6;
            if looks < -0.5 && distance <= reach && best.is_none_or(|[b, _]| distance < b) {
                best = Some([distance, looks]);
            }
        }
        if is_doubtful {
            continue;
        }
        let is_there = group.motion(k).expect("images move").stand_in.is_none();
        let image = group.there.as_ref().filter(|_| is_there).map(|side| {
            let [y, _] = on_face(mesh, &there.space, side.facets[k], side.points[side.row(k, 0)], values[there.field]);
            away(y)
        });
        found_some += usize::from(image.is_some());
        let is_same = match (image, best) {
            // a distance is known to the root of what a sum of squares is rounded to
            (Some(image), Some([distance, _])) => (image - distance).abs() < 1e-8,
            (None, None) => true,
            _ => false,
        };
        assert!(is_same, "{image:?} in place of {best:?} at {x:?} in {name}");
    }
    assert!(found_some > 0, "no image in {name}");
}

/// The point of a face where the first number of `place`, which has one valley in a small piece, is least.
fn nearest(place: &impl Fn(f64) -> [f64; 2]) -> [f64; 2] {
    let pieces = 32;
    let at = |k: i32| f64::from(k.clamp(0, pieces)) / f64::from(pieces);
    let least = (0..=pieces).min_by(|a, b| place(at(*a))[0].total_cmp(&place(at(*b))[0])).expect("some");
    let (mut low, mut high) = (at(least - 1), at(least + 1));
    for _ in 0..80 {
        let third = (high - low) / 3.0;
        if place(low + third)[0] <= place(high - third)[0] { high -= third } else { low += third }
    }
    let ends = [low, 0.5 * (low + high), high].map(place);
    ends.into_iter().min_by(|a, b| a[0].total_cmp(&b[0])).expect("some")
}
