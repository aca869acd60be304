//! What one step leaves to the next beside the unknowns: kept over a step that failed and over a run that was killed.

use wfl_compiler::types::FieldKind;

use super::System;
use crate::newton::{Passed, TermPieces};

/// What a step inherits from the one before, beside the unknowns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Memory {
    /// Values of the last tangent of the nonlinear terms.
    pub changing: Vec<f64>,
    /// Whether the held pieces belong to a converged state.
    pub settled: bool,
    /// By term with pieces: its guides.
    pub guides: Vec<Vec<f64>>,
    /// By term with pieces: the numbers by which they are chosen.
    pub pieces: Vec<Vec<f64>>,
    /// The last two converged states of the projections, one after the other ([`Passed::numbers`]).
    pub passed: Vec<Vec<f64>>,
    /// By state in the order of the fields: its values.
    pub states: Vec<Vec<f64>>,
}

impl System {
    /// What later steps depend on beside the unknowns.
    #[must_use]
    pub fn memory(&self) -> Memory {
        Memory {
            changing: self.changing.values().to_vec(),
            settled: self.settled,
            guides: self.guides.clone(),
            pieces: self.pieces.iter().map(TermPieces::memory).collect(),
            passed: self.passed.iter().flat_map(Passed::numbers).collect(),
            states: self.states().map(|k| self.known.data[k].clone()).collect(),
        }
    }

    /// The fields that are states.
    fn states(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.fields.len()).filter(|k| self.fields[*k].kind == FieldKind::State)
    }

    /// Goes back to what was remembered. False, and nothing is changed, if that belongs to another scene.
    #[must_use]
    pub fn recall(&mut self, memory: &Memory) -> bool {
        let sizes = |guides: &[Vec<f64>]| guides.iter().map(Vec::len).collect::<Vec<_>>();
        let passed: Option<Vec<Passed>> = memory
            .passed
            .chunks(1 + 2 * self.pieces.len())
            .map(|numbers| Passed::from_numbers(numbers, &self.pieces))
            .collect();
        let fits = passed.is_some()
            && memory.changing.len() == self.changing.values().len()
            && sizes(&memory.guides) == sizes(&self.guides)
            && memory.pieces.len() == self.pieces.len()
            && self.pieces.iter().zip(&memory.pieces).all(|(p, m)| p.memory().len() == m.len())
            && self.states().map(|k| self.known.data[k].len()).eq(memory.states.iter().map(Vec::len));
        if fits {
            self.changing.values_mut().copy_from_slice(&memory.changing);
            self.settled = memory.settled;
            self.passed = passed.unwrap_or_default();
            self.guides.clone_from(&memory.guides);
            self.pieces.iter_mut().zip(&memory.pieces).for_each(|(p, m)| p.recall(m));
            let states: Vec<usize> = self.states().collect();
            states.iter().zip(&memory.states).for_each(|(k, s)| self.known.data[*k].clone_from(s));
        }
        fits
    }
}
