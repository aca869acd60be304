//! Derivatives to one side in parameters: what results do where a parameter grows, and where it falls.

use wfl::Diagnostic;

use super::{Derivative, Differentiated, Direction, Gradients, Request, Side, forward, parameters};

/// Derivatives of a result to both sides of a parameter, by entry of the parameter, as slopes: both are what the derivative is
/// where there is no kink.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ToSides {
    /// The parameter.
    pub parameter: String,
    /// For larger values; empty if nobody asked.
    pub larger: Vec<f64>,
    /// For smaller values; empty if nobody asked.
    pub smaller: Vec<f64>,
}

/// Adds what a request wants to one side.
pub(super) fn add(of: Differentiated<'_>, request: &Request, made: &mut Gradients) -> Result<(), Box<Diagnostic>> {
    let mut measures: Vec<String> = request.results.iter().map(|r| r.measure.clone()).collect();
    measures.sort_unstable();
    measures.dedup();
    let (mut directions, mut places) = (Vec::new(), Vec::new());
    for (k, side) in request.sides.iter().enumerate() {
        let n = of.scene.params.iter().find(|p| p.0 == side.parameter).map_or(0, |p| p.1.values.len());
        for (sign, _) in [(1.0, side.larger), (-1.0, side.smaller)].into_iter().filter(|(_, wanted)| *wanted) {
            for entry in 0..n {
                let unit = (0..n).map(|e| if e == entry { sign } else { 0.0 }).collect();
                directions.push(Direction { parameters: vec![(side.parameter.clone(), unit)], fields: Vec::new() });
                places.push((k, sign));
            }
        }
    }
    let wanted = forward::request(&measures, &directions);
    let live = parameters::live(of.script, of.scene, &wanted)?;
    let found = forward::solve(of, &wanted, &live, &directions, Derivative::OneSided)?;
    for (number, wanted) in request.results.iter().enumerate() {
        let into = if request.together { 0 } else { number };
        let weights = wanted.weights(&found.times).unwrap_or_default();
        let Some(measure) = measures.iter().position(|m| *m == wanted.measure) else { continue };
        let Some(result) = made.results.get_mut(into) else { continue };
        if result.sides.is_empty() {
            let empty = |side: &Side| ToSides { parameter: side.parameter.clone(), ..ToSides::default() };
            result.sides = request.sides.iter().map(empty).collect();
        }
        let mut seen = vec![[0usize; 2]; request.sides.len()];
        for ((k, sign), moved) in places.iter().zip(&found.moved) {
            let along: f64 =
                moved[measure].iter().zip(&weights).map(|(x, w)| if *w == 0.0 { 0.0 } else { w * x }).sum();
            let to = &mut result.sides[*k];
            let (list, which) = if *sign > 0.0 { (&mut to.larger, 0) } else { (&mut to.smaller, 1) };
            let entry = seen[*k][which];
            seen[*k][which] += 1;
            if list.len() <= entry {
                list.push(0.0);
            }
            // a slope: what the result does for less, over less
            list[entry] += sign * along;
        }
    }
    made.notes.extend(found.notes);
    made.solutions += found.solutions;
    made.factorisations += found.factorisations;
    made.steps_again += found.steps_again;
    Ok(())
}
