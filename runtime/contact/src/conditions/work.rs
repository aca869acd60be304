//! Whether the force of a term works along a motion, or resists it.
//!
//! Promises: work that is rounding of what cancels has no sign. Does not know where points slide.

/// Work below this part of what it is if every component of a force resists has no sign: work of what rounding leaves
/// of a force, which cancels.
const SIGNLESS: f64 = 1e-6;
/// A motion below this part of the largest displacement has no direction, and an overlap that the law resists is none:
/// above the roundoff of displacements of which a difference is made, and below any that is seen.
pub(super) const STILL: f64 = 1e-9;

/// A displacement that the argument of a projection depends on.
pub(super) struct Motion {
    /// The slot of its test function.
    pub(super) test: usize,
    /// The derivatives of the argument with respect to it: the position of the value, and the entry of the argument.
    pub(super) slopes: Vec<(usize, usize)>,
}

/// True if a force works as an argument moves along `direction`, in place of resisting. Of an argument that follows the pressure, too, what
/// counts is the motion that leaves the `gaps`. But where the gap follows the slip (a joint that opens as it is sheared) the
/// pressure works along that motion, whatever friction does: where the two motions do not agree nothing is known.
pub(super) fn works_along(
    flux: &[f64],
    motions: &[Motion],
    direction: &[f64],
    slopes: &[f64],
    gaps: &[&[Motion]],
) -> Option<bool> {
    let way_of = |motions: &[Motion], direction: &[f64]| {
        let mut way = vec![0.0; flux.len()];
        for Motion { test, slopes: places } in motions {
            way[*test] = places.iter().map(|(at, entry)| direction[*entry] * slopes[*at]).sum();
        }
        way
    };
    let mut along = way_of(motions, direction);
    let as_it_moves = works(flux, &along);
    for gap in gaps {
        leave(&mut along, &way_of(gap, &[1.0]));
    }
    let beside_gaps = works(flux, &along);
    (as_it_moves == beside_gaps).then_some(beside_gaps)
}

/// Takes the part along another motion out of a motion.
fn leave(along: &mut [f64], other: &[f64]) {
    let dot = |a: &[f64]| a.iter().zip(other).map(|(a, b)| a * b).sum::<f64>();
    let (shared, size) = (dot(along), dot(other));
    if size > 0.0 && shared != 0.0 {
        for (a, o) in along.iter_mut().zip(other) {
            let taken = shared / size * o;
            // rounding of what was taken is no motion, and a pressure would work on it
            *a = if (*a - taken).abs() <= STILL * taken.abs() { 0.0 } else { *a - taken };
        }
    }
}

/// True if a force works along a motion.
fn works(flux: &[f64], along: &[f64]) -> bool {
    let (mut resisted, mut size) = (0.0f64, 0.0f64);
    for work in flux.iter().zip(along).map(|(f, a)| f * a) {
        resisted += work;
        size += work.abs();
    }
    resisted < -SIGNLESS * size
}
