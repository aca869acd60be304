//! How long the rest of a sweep takes: from the runs that were made, and from how time grows with the unknowns for sizes
//! that were not. Says a time, decides nothing.

use std::collections::BTreeMap;

use wfl_adapt::{
    accuracy::work,
    knobs::{Setting, mesh_words},
};

use super::Method;
use crate::bench;

/// Knobs that change the number of unknowns, beside the parameters of the mesh.
const SIZES: [&str; 4] = ["h", "refine", "cells", "degree"];

/// What decides the size of a run: its scene, and the knobs of its mesh and degree.
pub(super) fn size(method: &Method, setting: &Setting) -> String {
    let words = mesh_words(&method.known.loaded.script);
    let sized = |k: &&(String, String)| SIZES.contains(&k.0.as_str()) || words.contains(&k.0);
    let knobs: String = setting.iter().filter(sized).map(|(n, v)| format!(" {n}={v}")).collect();
    format!("{}{knobs}", method.path.display())
}

/// Seconds and work of runs by their size.
#[derive(Default)]
pub(super) struct Clock {
    /// Work by size, where it is known.
    works: BTreeMap<String, f64>,
    runs: Vec<(String, f64)>,
}

impl Clock {
    /// Looks at one run of each size. A size that cannot be prepared has no work.
    pub(super) fn new<'a>(plan: impl Iterator<Item = (&'a Method, &'a Setting)>) -> Self {
        let mut first: BTreeMap<String, (&Method, &Setting)> = BTreeMap::new();
        for (method, setting) in plan {
            first.entry(size(method, setting)).or_insert((method, setting));
        }
        if first.len() < 2 {
            return Self::default();
        }
        let of = |(method, setting): (&Method, &Setting)| {
            let seen = bench::size(&method.path, &method.known, setting).ok()?;
            Some(seen.steps as f64 * work(seen.dim, seen.degree, seen.dofs as f64))
        };
        let works = first.into_iter().filter_map(|(size, one)| Some((size, of(one)?))).collect();
        Self { works, runs: Vec::new() }
    }

    /// The position of the run with the least work.
    pub(super) fn smallest<'s>(&self, sizes: impl Iterator<Item = &'s str>) -> usize {
        let work = |size: &str| self.works.get(size).copied().unwrap_or(f64::INFINITY);
        sizes.enumerate().min_by(|a, b| work(a.1).total_cmp(&work(b.1))).map_or(0, |s| s.0)
    }

    pub(super) fn add(&mut self, size: &str, seconds: f64) {
        self.runs.push((size.to_owned(), seconds));
    }

    /// Seconds of runs of these sizes.
    pub(super) fn left<'s>(&self, rest: impl Iterator<Item = &'s str>) -> f64 {
        rest.map(|size| self.one(size)).fold(0.0, |a, b| a + b)
    }

    /// The mean of runs of a size; else the run nearest in work, scaled with it; else the slowest one.
    fn one(&self, size: &str) -> f64 {
        let like: Vec<f64> = self.runs.iter().filter(|r| r.0 == size).map(|r| r.1).collect();
        if !like.is_empty() {
            return like.iter().sum::<f64>() / like.len() as f64;
        }
        let ratio = |other: &str| Some(self.works.get(size)? / self.works.get(other)?);
        let scaled = self.runs.iter().filter_map(|(other, seconds)| Some((ratio(other)?, *seconds)));
        let nearest = scaled.min_by(|a, b| a.0.ln().abs().total_cmp(&b.0.ln().abs()));
        let slowest = || self.runs.iter().map(|r| r.1).fold(0.0, f64::max);
        nearest.map_or_else(slowest, |(ratio, seconds)| ratio * seconds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_size_that_was_not_run_is_scaled_from_the_nearest() {
        let works = [("a", 1.0), ("b", 8.0), ("c", 64.0)].map(|(n, w)| (n.to_owned(), w)).into();
        let mut clock = Clock { works, runs: Vec::new() };
        assert_eq!(clock.smallest(["c", "a", "b"].into_iter()), 1);
        clock.add("a", 0.5);
        assert_eq!(clock.left(["b", "c"].into_iter()), 0.5 * (8.0 + 64.0));
        clock.add("b", 3.0);
        clock.add("b", 5.0);
        assert_eq!(clock.left(["b", "c"].into_iter()), 4.0 + 3.0 * 8.0);
        assert_eq!(clock.left(["unknown"].into_iter()), 5.0);
    }
}
