//! Nodes with prescribed values along directions that are no axes of the scene.

use wfl_discrete::frames::Frame;

use super::{Along, Condition, Number, contradictions::Overruled};

/// Sine of the smallest angle at which a direction is new.
pub(super) const INDEPENDENT: f64 = 1e-6;
/// A node with a prescribed displacement along directions that are no axes.
pub(super) struct Tilted {
    pub(super) frame: Frame,
    /// The sums of numbers behind the first axes of the frame; with the triangle they give the displacement along those.
    pub(super) numbers: Vec<Vec<Number>>,
    /// `sum of numbers[i] = sum over j <= i of triangle[i][j] * (displacement along axis j)`
    pub(super) triangle: Vec<Vec<f64>>,
}

/// The frame of a node and the numbers along its first axes. Of conditions that depend on each other the later wins, as
/// it does among components; the others are listed. Of a statement of the whole vector that is left which is normal to the later
/// directions, however the axes of the scene lie.
pub(super) fn tilted(conditions: &[Condition]) -> (Tilted, Vec<Overruled>) {
    let mut overruled = Vec::new();
    let n = conditions[0].n_components;
    let unit = |k: usize| (0..n).map(|i| f64::from(u8::from(i == k))).collect::<Vec<f64>>();
    // the most independent ones of the axes of the scene
    let enough = 0.5 / (n as f64).sqrt();
    let (mut axes, mut triangle) = (Vec::<Vec<f64>>::new(), Vec::<Vec<f64>>::new());
    let mut numbers = Vec::<Vec<Number>>::new();
    for statement in conditions.chunk_by(|a, b| a.number.fix == b.number.fix).rev() {
        let is_component = |c: &Condition| matches!(c.along, Along::Component(_));
        if statement.len() == n && statement.iter().all(is_component) && !axes.is_empty() {
            let mut left: Vec<&Condition> = statement.iter().collect();
            for (axis, by) in axes.iter().zip(&numbers) {
                let says = |c: &Condition| dot(axis, &wanted(c)).abs();
                let most = (0..left.len()).max_by(|a, b| says(left[*a]).total_cmp(&says(left[*b])));
                overruled.extend(most.map(|k| left.remove(k).overruled(by[0].fix)));
            }
            for k in 0..n {
                if let Some((_, axis)) = apart(&axes, &unit(k), enough).filter(|_| axes.len() < n) {
                    let share = |c: &Condition| Number { factor: c.number.factor * dot(&axis, &wanted(c)), ..c.number };
                    numbers.push(statement.iter().map(share).filter(|number| number.factor != 0.0).collect());
                    triangle.push([vec![0.0; axes.len()], vec![1.0]].concat());
                    axes.push(axis);
                }
            }
            continue;
        }
        for condition in statement.iter().rev() {
            let wanted = wanted(condition);
            if let Some((mut row, axis)) = apart(&axes, &wanted, INDEPENDENT) {
                row.push(dot(&axis, &wanted));
                triangle.push(row);
                axes.push(axis);
                numbers.push(vec![condition.number]);
            } else {
                // the axis that says most of this direction
                let says = |k: &usize| dot(&axes[*k], &wanted).abs();
                let most = (0..axes.len()).max_by(|a, b| says(a).total_cmp(&says(b)));
                overruled.push(condition.overruled(most.map_or(condition.number.fix, |k| numbers[k][0].fix)));
            }
        }
    }
    // the frame is completed with what is left of the axes of the scene
    for k in 0..n {
        if axes.len() < n
            && let Some((_, axis)) = apart(&axes, &unit(k), enough)
        {
            axes.push(axis);
        }
    }
    (Tilted { frame: Frame { first: conditions[0].first, axes }, numbers, triangle }, overruled)
}

/// The direction of a condition.
fn wanted(condition: &Condition) -> Vec<f64> {
    let n = condition.n_components;
    match condition.along {
        Along::Component(k) => (0..n).map(|i| f64::from(u8::from(i == k))).collect(),
        Along::Direction(d) => d[..n].to_vec(),
    }
}

/// What of a unit vector is left beside orthonormal axes, normalised, with its parts along them; `None` below `least`.
pub(super) fn apart(axes: &[Vec<f64>], wanted: &[f64], least: f64) -> Option<(Vec<f64>, Vec<f64>)> {
    let mut left = wanted.to_vec();
    let mut parts = vec![0.0; axes.len()];
    // twice, so that the result is orthogonal to rounding
    for _ in 0..2 {
        for (axis, part) in axes.iter().zip(&mut parts) {
            let along = dot(axis, &left);
            *part += along;
            left.iter_mut().zip(axis).for_each(|(x, a)| *x -= along * a);
        }
    }
    let size = dot(&left, &left).sqrt();
    (size >= least).then(|| (parts, left.iter().map(|x| x / size).collect()))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}
