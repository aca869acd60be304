//! What is kept of a step that was done: its files go to the thread that writes them, now and then with a checkpoint. Solves
//! nothing and writes nothing.

use std::{
    sync::mpsc::{SyncSender, sync_channel},
    time::{Duration, Instant},
};

use wfl_output::Piece;
use wfl_problem::Solving;

use super::{
    Run, checkpoint,
    files::{self, CheckpointCost, OfOthers, StepFiles},
    others,
};

/// A checkpoint is made after the first step that ends so long after the last one: what a kill costs at most, but for
/// the step it meets. On a slow disc it is [`CHECKPOINT_SHARE`] times what the last checkpoint took.
const CHECKPOINT_EVERY: Duration = Duration::from_millis(100);
/// Of the time of a run checkpoints take at most one part in so many.
const CHECKPOINT_SHARE: u32 = 20;
/// Where what is kept of steps goes, and when the last checkpoint was made.
pub(super) struct Keeper<'a> {
    writer: Option<(&'a SyncSender<StepFiles>, &'a CheckpointCost)>,
    /// Of ranks with parts of the mesh each makes its own of a file, and the first one gets them.
    has_part: bool,
    checkpoint_before: Option<Instant>,
    /// What it took to gather the state for it.
    gathering: Duration,
}

impl<'a> Keeper<'a> {
    /// Of a rank that writes or not; made by all ranks together.
    pub(super) fn new(writer: Option<(&'a SyncSender<StepFiles>, &'a CheckpointCost)>, scene: &Solving<'_>) -> Self {
        let holders = scene.system.mesh.holders();
        let has_part = !holders.is_alone() && holders.any(writer.is_some());
        Self { writer, has_part, checkpoint_before: None, gathering: Duration::ZERO }
    }

    /// Whether a checkpoint is to be made of a step that others follow. After the last one everything is written at once, and a process
    /// that went on from there would have solved nothing: it could not say how the systems were solved.
    fn is_due(&self, scene: &Solving<'_>) -> bool {
        self.writer.is_some_and(|(_, cost)| {
            let pause = CHECKPOINT_EVERY.max(CHECKPOINT_SHARE * (cost.get() + self.gathering));
            scene.steps.several() && self.checkpoint_before.is_none_or(|before| before.elapsed() >= pause)
        })
    }
}

impl Run {
    /// Sends what is to be written of the last step; false where the writer has ended.
    pub(super) fn keep(&mut self, scene: &mut Solving<'_>, keeper: &mut Keeper<'_>) -> bool {
        self.leave_mark(scene);
        let due = self.next_request(scene).is_some() && keeper.is_due(scene);
        let begin = Instant::now();
        // what a checkpoint keeps is made by all ranks together, when the one that writes wants it
        let kept = scene.system.team().any(due).then(|| self.state(scene));
        if kept.is_some() {
            keeper.gathering = begin.elapsed();
        }
        if keeper.writer.is_none() && !keeper.has_part {
            return true;
        }
        let number = self.steps.len() - 1;
        let (last, lasting) = (&self.steps[number], self.steps[number].lasting());
        let (mut step, bad) = files::collect(scene, last, self.place_of(last, &lasting, number));
        bad.into_iter().for_each(|bad| self.add_bad(bad));
        if let Some(kept) = kept {
            keeper.checkpoint_before = Some(begin);
            let mut log = std::mem::take(&mut self.log);
            step.checkpoint = Some(checkpoint::pack(self, &mut log, scene, &kept));
            self.log = log;
        }
        let taken = self.hand_over(scene, step, keeper.writer.map(|(writer, _)| writer));
        self.clock.write += begin.elapsed().as_secs_f64();
        taken
    }

    /// Gives a step to the thread that writes; false where that has ended. Of ranks that have parts of the mesh each gives
    /// its pieces to the first one.
    fn hand_over(&self, scene: &Solving<'_>, mut step: StepFiles, writer: Option<&SyncSender<StepFiles>>) -> bool {
        let team = scene.system.mesh.holders();
        if team.is_alone() {
            return writer.is_none_or(|writer| step.is_empty() || writer.send(step).is_ok());
        }
        let grids = step.grids.iter().flatten().count();
        let Some(writer) = writer else {
            let own: Vec<&[Piece]> = step.grids.iter().flatten().map(Vec::as_slice).collect();
            return others::pass_on(&own, team, None).is_some() || team.rank() > 0;
        };
        let (sender, pieces) = sync_channel(0);
        step.others = Some(OfOthers { ranks: team.size(), pieces });
        let is_sent = step.is_empty() || writer.send(step).is_ok();
        // the others send, whether or not somebody writes
        others::pass_on(&vec![[].as_slice(); grids], team, Some(&sender)).is_some() && is_sent
    }
}
