//! Tangents against differences of residuals: the test behind `wfl verify`.
//!
//! States are drawn at random, then pairs of them in different branches are bisected, so that states close to each
//! kink on both of its sides are tested too. The residual is differenced in double-double arithmetic with four
//! points: truncation stays below 1e-14 of a block, and what rounding does to a difference is bounded by a running
//! error analysis and not counted. Promises: every pair of test
//! slot and unknown input is looked at, also those that the tangent says are zero; nothing is tested across a kink.
//! It does not know meshes, basis functions or how entries are assembled.

mod bounded;
mod chain;

use std::collections::{BTreeMap, BTreeSet};

use crate::{
    backend::{BackendError, KernelBackend},
    dd::Dd,
    graph::{ExprId, Leaf, Node, Role},
    interp::interpret,
    ir::{LANES, VerifiedKernel},
    law::{TermLaw, run_prologue},
    real::Real,
    symmetry::unit_normals,
    types::{BasisSlot, FieldId, FieldOp, InputSlot, RateFactor, Side, UniformSlot},
};
use bounded::Bounded;
use chain::Chain;

/// Step of the differences over the size of the field values it moves.
const STEP: f64 = 1e-9;
/// How far states beside a kink are from it, over the distance of the two states that it separates.
const KINK_DISTANCES: [f64; 2] = [1e-3, 1e-6];
/// States drawn to find one in other branches than the first.
const PARTNERS: usize = 8;
/// Halvings that bring the place of a kink to the last bit.
const HALVINGS: usize = 60;

/// What is drawn.
#[derive(Clone, Debug)]
pub struct TangentSampling {
    /// Pairs of random states.
    pub samples: usize,
    /// Start of the random numbers.
    pub seed: u64,
    /// Smallest coordinates of a point.
    pub low: [f64; 3],
    /// Largest coordinates of a point.
    pub high: [f64; 3],
    /// Values of the step variable and its increment, used in turn.
    pub times: Vec<(f64, f64)>,
}

impl Default for TangentSampling {
    fn default() -> Self {
        Self { samples: 64, seed: 1, low: [-1.0; 3], high: [1.0; 3], times: vec![(1.0, 1.0)] }
    }
}

/// What test or trial slots are gathered by: a field, its side, value or derivative.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct SlotGroup {
    /// The field.
    pub field: FieldId,
    /// Its side.
    pub side: Side,
    /// Value, gradient or Hessian.
    pub op: FieldOp,
}

impl From<BasisSlot> for SlotGroup {
    fn from(s: BasisSlot) -> Self {
        Self { field: s.field, side: s.side, op: s.op }
    }
}

/// An entry of the tangent at a state.
#[derive(Clone, Debug)]
pub struct EntryPlace {
    /// The row.
    pub test: BasisSlot,
    /// The column.
    pub trial: BasisSlot,
    /// The difference of the residual.
    pub difference: f64,
    /// What the tangent says.
    pub tangent: f64,
    /// The branch codes there, one a kink.
    pub codes: Vec<u8>,
    /// The state was sought beside a kink.
    pub near_kink: bool,
}

/// A block of the tangent: all pairs of two groups of slots.
#[derive(Clone, Debug)]
pub struct BlockCheck {
    /// Rows.
    pub test: SlotGroup,
    /// Columns.
    pub trial: SlotGroup,
    /// Entries that are not zero everywhere.
    pub n_entries: usize,
    /// Largest deviation of the tangent (in double-double) from the difference, over the largest entry of the block.
    pub error: f64,
    /// Largest deviation of the tangent in f64 from itself in double-double, over the same.
    pub rounding: f64,
    /// Where the error is.
    pub worst: Option<EntryPlace>,
}

/// The outcome for one term.
#[derive(Clone, Debug, Default)]
pub struct TangentCheck {
    /// Blocks that have entries, or differences where they should have.
    pub blocks: Vec<BlockCheck>,
    /// Tested states by branch code, one a kink.
    pub kinks: Vec<[usize; 3]>,
    /// States tested, those beside kinks included.
    pub states: usize,
    /// States beside kinks.
    pub near_kinks: usize,
    /// States at which the residual is no finite number: not tested.
    pub not_finite: usize,
    /// Single derivatives not tested because a kink lies within the step.
    pub across: usize,
    /// Fluxes that the residual and the tangent kernel give differently.
    pub flux_differences: usize,
    /// Outputs in which compiled kernels and interpreter differ in a bit.
    pub machine_differences: usize,
}

impl TangentCheck {
    /// The largest error of a block; infinite when an error is no number.
    #[must_use]
    pub fn error(&self) -> f64 {
        self.blocks.iter().map(|b| b.error).fold(0.0, |m, e| if e.is_nan() { f64::INFINITY } else { m.max(e) })
    }

    /// At least one state was tested and nothing deviates by more than `tolerance`.
    #[must_use]
    pub fn passes(&self, tolerance: f64) -> bool {
        self.states > 0 && self.error() <= tolerance && self.flux_differences == 0 && self.machine_differences == 0
    }
}

/// Checks the tangent of a term; `None` if it has no residual (a bare tangent). The kernels are also compiled by
/// `backend` and run at all tested states.
///
/// # Errors
/// [`BackendError`] when the backend refuses a kernel.
pub fn check_tangent(
    law: &TermLaw,
    sampling: &TangentSampling,
    backend: &dyn KernelBackend,
) -> Result<Option<TangentCheck>, BackendError> {
    if law.listing.residual.is_none() {
        return Ok(None);
    }
    let mut check = Checker::new(law);
    let mut random = Random(sampling.seed);
    for sample in 0..sampling.samples {
        let (time, increment) = sampling.times.get(sample % sampling.times.len().max(1)).copied().unwrap_or((1.0, 1.0));
        let slot = |s: &UniformSlot| match s {
            UniformSlot::Time => time,
            UniformSlot::TimeStep => increment,
            // any numbers of that size: a tangent is right for all
            UniformSlot::Rate(RateFactor::Rate | RateFactor::Velocity) => 2.0 / increment,
            UniformSlot::Rate(RateFactor::Acceleration) => 4.0 / (increment * increment),
        };
        let slots: Vec<f64> = law.prologue.slots.iter().map(slot).collect();
        let uniforms = run_prologue(&law.prologue, &slots);
        let place = check.place(sampling, &mut random);
        let a = check.draw(&place, &mut random);
        check.state(&uniforms, &a, Drawn::Anywhere);
        let others: Vec<Vec<f64>> = (0..PARTNERS).map(|_| check.draw(&place, &mut random)).collect();
        let here = check.branches(&uniforms, &a);
        if let Some(b) = others.iter().find(|b| check.branches(&uniforms, b) != here) {
            check.beside_kink(&uniforms, &a, b);
        }
    }
    check.machine(backend)?;
    Ok(Some(check.finish()))
}

/// A small deterministic generator (splitmix64).
struct Random(u64);

impl Random {
    /// Between 0 and 1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        #[expect(clippy::cast_precision_loss, reason = "53 random bits")]
        let bits = ((z ^ (z >> 31)) >> 11) as f64;
        bits / (1u64 << 53) as f64
    }

    /// Between -1 and 1.
    fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// Between 10^low and 10^high, each magnitude as often.
    fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10f64.powf(low + (high - low) * self.unit())
    }
}

#[derive(Clone, Debug, Default)]
struct Block {
    entries: BTreeSet<(BasisSlot, BasisSlot)>,
    error: f64,
    rounding: f64,
    worst: Option<EntryPlace>,
}

/// Largest entry of each block at one state.
type Sizes = BTreeMap<(SlotGroup, SlotGroup), f64>;

/// Differences of all fluxes by one unknown input.
struct Column {
    step: f64,
    differences: Vec<Dd>,
}

/// Where a state was drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Drawn {
    Anywhere,
    NearKink,
}

/// Outputs of the tangent kernel at one state in both precisions.
struct Outputs {
    wide: Vec<Dd>,
    narrow: Vec<f64>,
}

/// One pair of test slot and unknown input at one state.
struct Pair {
    key: (SlotGroup, SlotGroup),
    test: BasisSlot,
    trial: BasisSlot,
    difference: Dd,
    wide: Dd,
    plain: f64,
    /// What rounding may do to the difference.
    noise: f64,
}

/// A tested state with what the interpreter gives there.
struct Tested {
    uniforms: Vec<f64>,
    inputs: Vec<f64>,
    residual: Vec<f64>,
    tangent: Vec<f64>,
}

/// Where the random states of a sample are.
struct Place {
    /// All inputs; those of unknowns are replaced by [`Checker::draw`].
    inputs: Vec<f64>,
    /// The size of unknowns, of the past and of a part of the data.
    size: f64,
}

struct Checker<'l> {
    law: &'l TermLaw,
    /// Input positions of unknowns at the current state, with their slots.
    unknowns: Vec<(usize, BasisSlot)>,
    blocks: BTreeMap<(SlotGroup, SlotGroup), Block>,
    tested: Vec<Tested>,
    /// Where images follow the unknowns.
    chain: Option<Chain<'l>>,
    out: TangentCheck,
}

impl<'l> Checker<'l> {
    fn new(law: &'l TermLaw) -> Self {
        let graph = &law.listing.graph;
        let moving: BTreeSet<FieldId> = (0..graph.len())
            .filter_map(|k| match graph.node(ExprId::new(k)) {
                Node::Leaf(Leaf::Field { field, role: Role::Current, .. }) if graph.is_unknown(*field) => Some(*field),
                _ => None,
            })
            .collect();
        let unknowns = law.inputs.iter().enumerate().filter_map(|(k, slot)| match slot {
            InputSlot::Field(b) if moving.contains(&b.field) => Some((k, *b)),
            _ => None,
        });
        let out = TangentCheck { kinks: vec![[0; 3]; law.kinks.len()], ..TangentCheck::default() };
        Self {
            law,
            unknowns: unknowns.collect(),
            blocks: BTreeMap::new(),
            tested: Vec::new(),
            chain: Chain::new(law),
            out,
        }
    }

    /// Everything but the unknowns: position, normal, sizes, data, the past.
    fn place(&self, sampling: &TangentSampling, random: &mut Random) -> Place {
        // every third normal along an axis, as on a box
        let axis = (random.unit() < 0.35).then(|| (random.unit() * 3.0).floor());
        let size = random.magnitude(-4.5, 0.5);
        let data = if random.unit() < 0.5 { size } else { 1.0 };
        let mut inputs: Vec<f64> = Vec::with_capacity(self.law.inputs.len());
        for slot in &self.law.inputs {
            inputs.push(match slot {
                InputSlot::X(k) | InputSlot::ImageX(k) => {
                    let k = usize::from(*k);
                    sampling.low[k] + (sampling.high[k] - sampling.low[k]) * random.unit()
                }
                InputSlot::Normal(_, k) => match axis {
                    Some(a) => f64::from(u8::from(f64::from(*k) == a)),
                    None => random.signed(),
                },
                InputSlot::Conormal(..) => random.signed(),
                // data are mostly positive: stiffnesses, coefficients
                InputSlot::Field(_) => data * (0.5 + random.unit()).copysign(random.unit() - 0.25),
                InputSlot::Previous(_) | InputSlot::History(..) => size * random.signed(),
                InputSlot::ElementSize(_) | InputSlot::ElementK(..) | InputSlot::ElementB(..) => random.signed(),
                InputSlot::ImageShift(_) | InputSlot::ImageSlope(_) => random.signed(),
            });
        }
        unit_normals(&self.law.inputs, &mut inputs);
        if let Some(chain) = &self.chain {
            chain.turn_normals(&mut inputs, || random.signed());
        }
        Place { inputs, size }
    }

    /// The same place with other unknowns: of any size, in a part of the draws with few large entries, so that
    /// narrow branches (a small ball, a tie) come up too.
    fn draw(&self, place: &Place, random: &mut Random) -> Vec<f64> {
        let mut inputs = place.inputs.clone();
        let size = place.size * random.magnitude(-0.5, 0.5);
        let apart = random.unit() < 0.5;
        let small = (random.unit() < 0.4).then(|| random.magnitude(-5.0, -1.0));
        let mut sizes: BTreeMap<(FieldId, FieldOp), f64> = BTreeMap::new();
        // the two sides of a field move together in a part of the draws: small jumps beside large values
        let joined = (random.unit() < 0.3).then(|| random.magnitude(-3.0, -1.0));
        let mut here: BTreeMap<BasisSlot, f64> = BTreeMap::new();
        for (k, slot) in &self.unknowns {
            let own = *sizes
                .entry((slot.field, slot.op))
                .or_insert_with(|| if apart { size * random.magnitude(-2.0, 2.0) } else { size });
            let part = small.filter(|_| random.unit() < 0.6).unwrap_or(1.0);
            let mut value = own * part * random.signed();
            let twin = BasisSlot { field: FieldId::new(0), side: Side::Here, ..*slot };
            match (joined, slot.side) {
                (Some(_), Side::Here) => {
                    here.entry(twin).or_insert(value);
                }
                (Some(gap), Side::There) => value = here.get(&twin).map_or(value, |h| h + gap * value),
                _ => {}
            }
            inputs[*k] = value;
        }
        inputs
    }

    /// Fluxes, entries and codes of a kernel.
    fn run<T: Real>(kernel: &VerifiedKernel, uniforms: &[f64], inputs: &[T]) -> Vec<T> {
        let uniforms: Vec<T> = uniforms.iter().map(|u| T::from_f64(*u)).collect();
        let mut out = vec![T::from_f64(0.0); kernel.kernel().outputs.len()];
        interpret(kernel, &uniforms, inputs, &mut Vec::new(), &mut out);
        out
    }

    fn codes<T: Real>(&self, residual: &[T]) -> Vec<u8> {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "codes are 0, 1 or 2")]
        residual[self.law.tests.len()..].iter().map(|c| c.to_f64() as u8).collect()
    }

    fn branches(&self, uniforms: &[f64], inputs: &[f64]) -> Vec<u8> {
        self.codes(&Self::run::<f64>(&self.law.residual, uniforms, inputs))
    }

    /// Finds a kink between two states of different branches and tests beside it, on both sides.
    fn beside_kink(&mut self, uniforms: &[f64], a: &[f64], b: &[f64]) {
        let between = |s: f64| -> Vec<f64> { a.iter().zip(b).map(|(x, y)| x + s * (y - x)).collect() };
        let first = self.branches(uniforms, a);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.branches(uniforms, &between(middle)) == first {
                low = middle;
            } else {
                high = middle;
            }
        }
        for distance in KINK_DISTANCES {
            for s in [low - distance, high + distance] {
                self.state(uniforms, &between(s), Drawn::NearKink);
            }
        }
    }

    /// Tests one state.
    fn state(&mut self, uniforms: &[f64], inputs: &[f64], drawn: Drawn) {
        let wide: Vec<Dd> = inputs.iter().map(|x| Dd::from_f64(*x)).collect();
        let residual = Self::run(&self.law.residual, uniforms, &wide);
        let tangent = Self::run(&self.law.tangent, uniforms, &wide);
        let narrow = Self::run(&self.law.tangent, uniforms, inputs);
        let plain = Self::run(&self.law.residual, uniforms, inputs);
        if !(residual.iter().chain(&tangent).all(|v| v.is_finite()) && narrow.iter().all(|v| v.is_finite())) {
            self.out.not_finite += 1;
            return;
        }
        let n_tests = self.law.tests.len();
        self.out.states += 1;
        self.out.near_kinks += usize::from(drawn == Drawn::NearKink);
        self.out.flux_differences +=
            plain[..n_tests].iter().zip(&narrow[..n_tests]).filter(|(a, b)| a.to_bits() != b.to_bits()).count();
        let codes = self.codes(&residual);
        for (count, code) in self.out.kinks.iter_mut().zip(&codes) {
            count[usize::from(*code).min(2)] += 1;
        }
        let columns: Vec<Option<Column>> =
            (0..self.unknowns.len()).map(|u| self.column(uniforms, &wide, u, &codes)).collect();
        self.out.across += columns.iter().filter(|c| c.is_none()).count();
        let bounded: Vec<Bounded> = inputs.iter().map(|x| Bounded::from_f64(*x)).collect();
        let errors: Vec<f64> = Self::run(&self.law.residual, uniforms, &bounded).iter().map(|b| b.error).collect();
        let outputs = Outputs { wide: tangent, narrow };
        self.compare(&columns, &errors, &outputs, &codes, drawn);
        let narrow = outputs.narrow;
        self.tested.push(Tested {
            uniforms: uniforms.to_vec(),
            inputs: inputs.to_vec(),
            residual: plain,
            tangent: narrow,
        });
    }

    /// Derivatives of all fluxes with respect to one unknown input; `None` if a kink is within the step.
    fn column(&self, uniforms: &[f64], inputs: &[Dd], unknown: usize, codes: &[u8]) -> Option<Column> {
        let (position, slot) = self.unknowns[unknown];
        let group = SlotGroup::from(slot);
        let own = self.unknowns.iter().filter(|(_, s)| SlotGroup::from(*s) == group);
        let size = own.map(|(k, _)| inputs[*k].hi().abs()).fold(0.0, f64::max);
        // a power of two: adding it loses nothing
        let h = (STEP * if size > 0.0 { size } else { 1.0 }).log2().round().exp2();
        let shift = self.chain.as_ref().map(|chain| chain.shift(inputs, slot));
        let rates = self.chain.as_ref().zip(shift.as_ref()).map(|(chain, shift)| chain.rates(inputs, shift));
        let at = |steps: f64| {
            let mut moved = inputs.to_vec();
            for (moved, rate) in moved.iter_mut().zip(rates.iter().flatten()) {
                *moved = *moved + Dd::from_f64(steps * h) * *rate;
            }
            moved[position] = moved[position] + Dd::from_f64(steps * h);
            let out = Self::run(&self.law.residual, uniforms, &moved);
            let same = self.codes(&out) == codes && out.iter().all(|v| v.is_finite());
            same.then_some(out)
        };
        let (a, b, c, d) = (at(1.0)?, at(-1.0)?, at(2.0)?, at(-2.0)?);
        let (eight, all) = (Dd::from_f64(8.0), Dd::from_f64(12.0 * h));
        let tests = &self.law.tests;
        let mut differences: Vec<Dd> =
            (0..tests.len()).map(|t| (eight * (a[t] - b[t]) - (c[t] - d[t])) / all).collect();
        if let (Some(chain), Some(shift)) = (&self.chain, &shift) {
            let fluxes = Self::run(&self.law.residual, uniforms, inputs);
            let moved = chain.moved_tests(tests, &fluxes[..tests.len()], shift);
            differences.iter_mut().zip(moved).for_each(|(sum, moved)| *sum = *sum + moved);
        }
        Some(Column { step: h, differences })
    }

    /// All pairs of test slot and unknown input that say something, with the size of each block.
    fn pairs(&self, columns: &[Option<Column>], errors: &[f64], outputs: &Outputs) -> (Vec<Pair>, Sizes) {
        let law = self.law;
        let n_tests = law.tests.len();
        let (mut sizes, mut found) = (Sizes::new(), Vec::new());
        for ((_, trial), column) in self.unknowns.iter().zip(columns) {
            let Some(column) = column else { continue };
            let position = law.trials.iter().position(|s| s == trial);
            for (t, test) in law.tests.iter().enumerate() {
                let entry = position.and_then(|s| law.entries.binary_search(&(narrow_index(t), narrow_index(s))).ok());
                let wide = entry.map_or(Dd::ZERO, |e| outputs.wide[n_tests + e]);
                let plain = entry.map_or(0.0, |e| outputs.narrow[n_tests + e]);
                let difference = column.differences[t];
                // the weights of the four points add up to 1.5 over the step
                let noise = Some(2.0 * errors[t] / column.step).filter(|n| n.is_finite()).unwrap_or(0.0);
                let key = (SlotGroup::from(*test), SlotGroup::from(*trial));
                let size = sizes.entry(key).or_default();
                *size = size.max(wide.hi().abs()).max(difference.hi().abs());
                if entry.is_some() || difference.hi().abs() > noise {
                    found.push(Pair { key, test: *test, trial: *trial, difference, wide, plain, noise });
                }
            }
        }
        (found, sizes)
    }

    /// Compares the columns with the entries, block by block.
    fn compare(&mut self, columns: &[Option<Column>], errors: &[f64], outputs: &Outputs, codes: &[u8], drawn: Drawn) {
        let (found, sizes) = self.pairs(columns, errors, outputs);
        for pair in found {
            let size = sizes.get(&pair.key).copied().unwrap_or(0.0);
            let over = |x: f64| if size > 0.0 { x / size } else { 0.0 };
            let off = (pair.difference - pair.wide).hi().abs();
            let error = if off <= pair.noise { 0.0 } else { over(off) };
            let block = self.blocks.entry(pair.key).or_default();
            block.entries.insert((pair.test, pair.trial));
            block.rounding = block.rounding.max(over((Dd::from_f64(pair.plain) - pair.wide).hi().abs()));
            if block.worst.is_none() || error > block.error || error.is_nan() {
                block.error = error;
                block.worst = Some(EntryPlace {
                    test: pair.test,
                    trial: pair.trial,
                    difference: pair.difference.hi(),
                    tangent: pair.plain,
                    codes: codes.to_vec(),
                    near_kink: drawn == Drawn::NearKink,
                });
            }
        }
    }

    /// Runs the kernels of a backend at all tested states, eight at a time where the uniforms are the same.
    fn machine(&mut self, backend: &dyn KernelBackend) -> Result<(), BackendError> {
        let compiled = backend.compile(&[&self.law.residual, &self.law.tangent])?;
        let n_inputs = self.law.inputs.len();
        for group in self.tested.chunk_by(|a, b| a.uniforms == b.uniforms) {
            for states in group.chunks(LANES) {
                let mut inputs = vec![0.0; n_inputs * LANES];
                for lane in 0..LANES {
                    let state = &states[lane.min(states.len() - 1)];
                    for (slot, x) in state.inputs.iter().enumerate() {
                        inputs[slot * LANES + lane] = *x;
                    }
                }
                let results: [fn(&Tested) -> &Vec<f64>; 2] = [|t| &t.residual, |t| &t.tangent];
                for (kernel, expected) in compiled.iter().zip(results) {
                    let mut outputs = vec![0.0; expected(&states[0]).len() * LANES];
                    kernel.run(&states[0].uniforms, &inputs, &mut outputs, 1);
                    for (lane, state) in states.iter().enumerate() {
                        let pairs = expected(state).iter().enumerate().map(|(k, e)| (*e, outputs[k * LANES + lane]));
                        self.out.machine_differences += pairs.filter(|(a, b)| a.to_bits() != b.to_bits()).count();
                    }
                }
            }
        }
        Ok(())
    }

    fn finish(mut self) -> TangentCheck {
        let block = |((test, trial), b): ((SlotGroup, SlotGroup), Block)| BlockCheck {
            test,
            trial,
            n_entries: b.entries.len(),
            error: b.error,
            rounding: b.rounding,
            worst: b.worst,
        };
        self.out.blocks = self.blocks.into_iter().map(block).collect();
        self.out
    }
}

fn narrow_index(k: usize) -> u16 {
    u16::try_from(k).expect("a law has few slots")
}

#[cfg(test)]
mod moving;

#[cfg(test)]
mod tests;

#[cfg(test)]
mod mutants;
