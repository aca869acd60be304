//! Expressions along a line: points are found in the cells, or on the faces, and values taken there.
//!
//! A point on a face between two bodies belongs to each of them: an expression is taken in the first cell, in the
//! order of the mesh, that holds the point and where the expression lives. One that lives in several places has one
//! column; a point of two of them has the value of the first.

use wfl_discrete::{
    assemble::FieldValues,
    field::{Field, FieldError},
    value::{Sampled, Value},
    window::Window,
};
use wfl_host::team::Team;
use wfl_mesh::mesh::Mesh;

use crate::Located;

struct LineItem {
    name: String,
    value: Value,
    sampled: Sampled,
    /// The sample of each point of each group of its domain; `None` for one that has the value of an earlier place.
    samples: Vec<Vec<Option<usize>>>,
}

/// Samples on a line from one point to another.
pub struct LineSample {
    points: Vec<[f64; 3]>,
    length: f64,
    dim: usize,
    items: Vec<LineItem>,
    /// By point: a place of the last expression has it, on whichever rank.
    taken: Vec<bool>,
}

impl LineSample {
    /// `n` equally spaced points with both ends.
    #[must_use]
    pub fn new(mesh: &Mesh, from: [f64; 3], to: [f64; 3], n: usize) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "few points")]
        let at = |k: usize| if n < 2 { 0.0 } else { k as f64 / (n - 1) as f64 };
        let point = |k: usize| [0, 1, 2].map(|d| from[d] + at(k) * (to[d] - from[d]));
        let length = [0, 1, 2].map(|d| to[d] - from[d]).iter().map(|x| x * x).sum::<f64>().sqrt();
        Self { length, ..Self::at(mesh, (0..n).map(point).collect()) }
    }

    /// Single points.
    #[must_use]
    pub fn at(mesh: &Mesh, points: Vec<[f64; 3]>) -> Self {
        let taken = vec![false; points.len()];
        Self { points, length: 0.0, dim: mesh.dim(), items: Vec::new(), taken }
    }

    /// Adds an expression that lives where the points of the line were found. Places of one expression follow each other.
    ///
    /// # Errors
    /// [`FieldError`] where a field it reads has no dofs.
    pub fn add(
        &mut self,
        mesh: &Mesh,
        fields: &[Field],
        name: String,
        value: Value,
        located: Located,
    ) -> Result<(), FieldError> {
        let sampled = value.bind(mesh, located.domain, fields)?;
        if self.items.last().is_none_or(|last| last.name != name) {
            self.taken.fill(false);
        }
        let free = |k: usize| (!self.taken[k]).then_some(k);
        let samples = located.points.into_iter().map(|group| group.into_iter().map(free).collect()).collect();
        self.taken.iter_mut().zip(located.found).for_each(|(taken, found)| *taken |= found);
        self.items.push(LineItem { name, value, sampled, samples });
        Ok(())
    }

    /// True if an expression on it reads the end of the previous step.
    #[must_use]
    pub fn reads_past(&self) -> bool {
        self.items.iter().any(|i| i.value.reads_past())
    }

    /// About as many bytes as it takes in a file.
    #[must_use]
    pub fn bytes(&self) -> usize {
        /// Bytes of a number with sixteen digits, sign, exponent and comma.
        const NUMBER: usize = 22;
        let columns = 1 + self.dim + self.quantities().map(|i| i.value.n_components()).sum::<usize>();
        NUMBER * columns * self.points.len()
    }

    /// The first place of each expression.
    fn quantities(&self) -> impl Iterator<Item = &LineItem> {
        let is_first = |k: &usize| *k == 0 || self.items[k - 1].name != self.items[*k].name;
        (0..self.items.len()).filter(is_first).map(|k| &self.items[k])
    }

    /// How many points there are.
    #[must_use]
    pub fn n_points(&self) -> usize {
        self.points.len()
    }

    /// The points, in order.
    #[must_use]
    pub fn points(&self) -> &[[f64; 3]] {
        &self.points
    }

    /// True if nothing is sampled.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// Of each point whether some expression lives there.
    #[must_use]
    pub fn found(&self) -> Vec<bool> {
        let mut found = vec![false; self.points.len()];
        self.items.iter().flat_map(|i| &i.samples).flatten().flatten().for_each(|k| found[*k] = true);
        found
    }

    /// Names of the expressions that live on no point, each once.
    #[must_use]
    pub fn nowhere(&self) -> Vec<&str> {
        let somewhere =
            |name: &str| self.items.iter().any(|i| i.name == name && i.samples.iter().any(|s| !s.is_empty()));
        let mut names: Vec<&str> = self.items.iter().map(|i| i.name.as_str()).filter(|n| !somewhere(n)).collect();
        names.dedup();
        names
    }

    /// Names of the columns: arc length, coordinates, entries of each expression.
    #[must_use]
    pub fn columns(&self) -> Vec<String> {
        let mut names: Vec<String> = ["s", "x", "y", "z"][..=self.dim].iter().map(|s| (*s).to_owned()).collect();
        for item in self.quantities() {
            let shape = item.value.law.shape;
            for e in 0..shape.len() {
                let index: Vec<String> = shape.indices(e).iter().map(|i| (i + 1).to_string()).collect();
                names.push(if index.is_empty() {
                    item.name.clone()
                } else {
                    format!("{}_{}", item.name, index.join(""))
                });
            }
        }
        names
    }

    /// One row a point; not a number where an expression does not live.
    /// `bad(name, value, position)` receives expressions that are defined there and not finite.
    pub fn rows(
        &self,
        mesh: &Mesh,
        window: Window,
        values: FieldValues<'_>,
        bad: impl FnMut(&str, f64, [f64; 3]),
    ) -> Vec<Vec<f64>> {
        let n = self.points.len();
        #[expect(clippy::cast_precision_loss, reason = "few points")]
        let arc = |k: usize| if n < 2 { 0.0 } else { self.length * k as f64 / (n - 1) as f64 };
        let mut rows: Vec<Vec<f64>> = (0..n)
            .map(|k| {
                let mut row = vec![arc(k)];
                row.extend_from_slice(&self.points[k][..self.dim]);
                row
            })
            .collect();
        let mut before: Option<&str> = None;
        let mut start = 0;
        let first = rows.first().map_or(0, Vec::len);
        for item in &self.items {
            let value = item.value.at_step(values.with_present_rates(window));
            if before != Some(item.name.as_str()) {
                let nc = item.value.n_components();
                start = rows.first().map_or(0, Vec::len);
                rows.iter_mut().for_each(|r| r.resize(start + nc, f64::NAN));
            }
            before = Some(&item.name);
            let samples = &item.samples;
            value.for_each_point(mesh, &item.sampled, values, |g, _, q, _, value| {
                if let Some(k) = samples[g][q] {
                    rows[k][start..].copy_from_slice(value);
                }
            });
        }
        let mut is_taken = self.own_columns(&rows, first);
        of_all(mesh.holders(), first, &mut rows, &mut is_taken);
        self.tell_not_finite(&rows, first, &is_taken, bad);
        rows
    }

    /// Tells the first number that is not finite of each expression at each point where it lives.
    fn tell_not_finite(
        &self,
        rows: &[Vec<f64>],
        first: usize,
        is_taken: &[bool],
        mut bad: impl FnMut(&str, f64, [f64; 3]),
    ) {
        let mut start = first;
        for item in self.quantities() {
            let columns = start..start + item.value.n_components();
            start = columns.end;
            for (k, row) in rows.iter().enumerate() {
                let is_here = is_taken[k * (row.len() - first) + columns.start - first];
                if let Some(v) = row[columns.clone()].iter().find(|v| is_here && !v.is_finite()) {
                    bad(&item.name, *v, self.points[k]);
                }
            }
        }
    }

    /// By point and column whether this rank takes the sample.
    fn own_columns(&self, rows: &[Vec<f64>], first: usize) -> Vec<bool> {
        let width = rows.first().map_or(0, |row| row.len() - first);
        let mut own = vec![false; width * rows.len()];
        let (mut start, mut end, mut before) = (0, 0, None);
        for item in &self.items {
            if before != Some(item.name.as_str()) {
                (start, end) = (end, end + item.value.n_components());
            }
            before = Some(&item.name);
            for k in item.samples.iter().flatten().flatten() {
                own[k * width..][start..end].fill(true);
            }
        }
        own
    }
}

/// From the samples that this rank has taken to those of all ranks, behind the first columns: each was taken by one.
fn of_all(team: &dyn Team, first: usize, rows: &mut [Vec<f64>], is_taken: &mut [bool]) {
    if team.is_alone() {
        return;
    }
    let all = rows.iter().flat_map(|row| &row[first..]);
    let mut values: Vec<f64> = all.zip(&*is_taken).map(|(x, own)| if *own { *x } else { 0.0 }).collect();
    let mut words: Vec<u64> = is_taken.iter().map(|own| u64::from(*own)).collect();
    team.sum(&mut values);
    team.sum_words(&mut words);
    let slots = rows.iter_mut().flat_map(|row| &mut row[first..]);
    for (((slot, value), taken), word) in slots.zip(values).zip(is_taken).zip(words) {
        *taken = word > 0;
        *slot = if *taken { value } else { f64::NAN };
    }
}
