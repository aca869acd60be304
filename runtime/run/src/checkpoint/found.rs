//! What gives cause to doubt a step as bytes of the log: a run that goes on tells what the one before it saw.

use wfl_checks::{Alternating, LargeStrain, NarrowZone, Unstable, Zigzag};
use wfl_contact::{Alternation, PressedFaces};
use wfl_output::bytes::{Reader, Unreadable, Writer};

use crate::{
    StepResult,
    growth::Sizes,
    watched::{PointsOf, Seen},
};

/// What gives cause to doubt a step, beside its checks.
pub(super) fn found(w: &mut Writer, s: &StepResult) {
    w.count(match s.unstable {
        None => 0,
        Some(Unstable::Odd) => 1,
        Some(Unstable::Directions(n)) => 2 * n,
        Some(Unstable::Beside(n)) => 2 * n + 1,
    });
    w.count(s.narrow.len());
    for NarrowZone { term, faces } in &s.narrow {
        w.text(term);
        [faces.some, faces.whole, faces.of].into_iter().for_each(|n| w.count(n));
    }
    w.count(s.zigzags.len());
    for Zigzag { term, size } in &s.zigzags {
        w.text(term);
        w.numbers(&[size.amplitude, size.area]);
    }
    let Seen { strained, alternating, ringing, lost, inside, sizes } = &s.seen;
    w.count(strained.len());
    for LargeStrain { field, strain, moved, position: [x, y, z], has_memory } in strained {
        w.text(field);
        w.numbers(&[*strain, *moved, *x, *y, *z]);
        w.flag(*has_memory);
    }
    w.count(alternating.len());
    for Alternating { field, displacement, share, position: [x, y, z], too_short, is_equal_order } in alternating {
        w.text(field);
        w.text(displacement);
        w.numbers(&[*share, *x, *y, *z, *too_short]);
        w.flag(*is_equal_order);
    }
    w.count(ringing.len());
    ringing.iter().for_each(|field| w.count(*field));
    for points in [lost, inside] {
        w.count(points.len());
        points.iter().for_each(|p| [p.term, p.points, p.of].into_iter().for_each(|n| w.count(n)));
    }
    w.flag(sizes.is_some());
    if let Some(Sizes { fields, given }) = sizes {
        w.numbers(fields);
        w.numbers(given);
    }
}

/// Takes it from the bytes.
pub(super) fn read_found(r: &mut Reader<'_>, step: &mut StepResult) -> Result<(), Unreadable> {
    step.unstable = match r.count()? {
        0 => None,
        1 => Some(Unstable::Odd),
        n if n % 2 == 0 => Some(Unstable::Directions(n / 2)),
        n => Some(Unstable::Beside(n / 2)),
    };
    step.narrow = r.list(|r| {
        let term = r.text()?;
        let faces = PressedFaces { some: r.count()?, whole: r.count()?, of: r.count()? };
        Ok(NarrowZone { term, faces })
    })?;
    step.zigzags = r.list(|r| {
        let term = r.text()?;
        let [amplitude, area] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(Zigzag { term, size: Alternation { amplitude, area } })
    })?;
    let strained = r.list(|r| {
        let field = r.text()?;
        let [strain, moved, x, y, z] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(LargeStrain { field, strain, moved, position: [x, y, z], has_memory: r.flag()? })
    })?;
    let alternating = r.list(|r| {
        let (field, displacement) = (r.text()?, r.text()?);
        let [share, x, y, z, too_short] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
        Ok(Alternating { field, displacement, share, position: [x, y, z], too_short, is_equal_order: r.flag()? })
    })?;
    let ringing = r.list(Reader::count)?;
    let points = |r: &mut Reader<'_>| r.list(|r| Ok(PointsOf { term: r.count()?, points: r.count()?, of: r.count()? }));
    let (lost, inside) = (points(r)?, points(r)?);
    let sizes = match r.flag()? {
        false => None,
        true => {
            let fields = r.numbers()?;
            let [load, prescribed] = *r.numbers()?.as_slice() else { return Err(Unreadable) };
            Some(Sizes { fields, given: [load, prescribed] })
        }
    };
    step.seen = Seen { strained, alternating, ringing, lost, inside, sizes };
    Ok(())
}
