//! What is seen over the steps of a run and told at its end: strains beyond the law, contact that never closes, pressures that
//! alternate, rates that do so in time, unknowns that grow without end, bending that the elements lock.
//!
//! Each is told once, of the first step that shows it; what a step has shown stands in its result, also that of a step that another
//! process did. Promises: changes nothing of a run; that contact never closed, or never found an image, is told where all steps
//! were looked at.

use wfl::{Code, Diagnostic};
use wfl_checks::{Alternating, DistantContact, LargeStrain, PorePressure, SmallStrainBody};
use wfl_compiler::types::ImageBy;
use wfl_contact::{Images, images};
use wfl_discrete::finite::position;
use wfl_problem::{Scene, Solving};

use super::{
    StepResult,
    ended::Ended,
    growth::{self, Growth, Sizes},
    ringing::{self, Ringing},
};

/// What was seen so far.
#[derive(Clone, Debug, Default)]
pub(super) struct Watched {
    /// Steps that were looked at.
    n: usize,
    /// What there is to look at; `None` before the first step.
    kept: Option<Kept>,
    growth: Growth,
    ringing: Ringing,
    images: WatchedImages,
}

/// What was seen in a step; a later step need not show again what an earlier one has shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    /// Bodies beyond their law.
    pub(crate) strained: Vec<LargeStrain>,
    /// Pressures that alternate.
    pub(crate) alternating: Vec<Alternating>,
    /// Fields whose rates change their sign in every step.
    pub(crate) ringing: Vec<usize>,
    /// Terms of which points lost their images under pressure.
    pub(crate) lost: Vec<PointsOf>,
    /// Terms of which points were inside the other body without an image.
    pub(crate) inside: Vec<PointsOf>,
    /// How large the fields were, of a scene with several steps.
    pub(crate) sizes: Option<Sizes>,
}

/// So many points of a term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PointsOf {
    pub(crate) term: usize,
    pub(crate) points: usize,
    pub(crate) of: usize,
}

/// Of the steps so far the first one that shows each.
fn first<'s, T: 's, K: PartialEq>(
    steps: &'s [StepResult],
    shown: impl Fn(&'s Seen) -> &'s [T],
    key: impl Fn(&'s T) -> K,
) -> Vec<(f64, &'s T)> {
    let mut found: Vec<(f64, &T)> = Vec::new();
    for (time, one) in steps.iter().flat_map(|s| shown(&s.seen).iter().map(|one| (s.window.end, one))) {
        if found.iter().all(|(_, before)| key(before) != key(one)) {
            found.push((time, one));
        }
    }
    found
}

/// Images that follow the bodies.
#[derive(Clone, Debug, Default)]
struct WatchedImages {
    /// Of the last state that was looked at.
    last: Vec<Images>,
    /// Terms that had an image at some step.
    found: Vec<usize>,
}

impl WatchedImages {
    fn look(&mut self, scene: &Solving<'_>, u: &[f64], seen: &mut Seen) {
        let now = images(scene.system, scene.contact, u);
        for (now, before) in now.iter().zip(&self.last) {
            let points = now.lost(before);
            if points > 0 {
                seen.lost.push(PointsOf { term: now.term, points, of: now.found.len() });
            }
        }
        for now in &now {
            let points = now.inside.iter().filter(|inside| **inside).count();
            if points > 0 {
                seen.inside.push(PointsOf { term: now.term, points, of: now.inside.len() });
            }
        }
        let have = now.iter().filter(|images| images.found.contains(&true)).map(|images| images.term);
        let new: Vec<usize> = have.filter(|term| !self.found.contains(term)).collect();
        self.found.extend(new);
        self.last = now;
    }

    /// What there is to say at the end; that there never was an image where all steps were looked at.
    fn told(&self, run: &Ended<'_>) -> Vec<Diagnostic> {
        let (scene, has_seen_all) = (run.scene, run.has_seen_all());
        let name = |term: usize| &scene.system.terms[term].law.name;
        let has_rays = |term: usize| {
            let points = scene.system.terms[term].integrator.domain.moving.as_ref();
            points.is_none_or(|points| points.by() == ImageBy::Ray)
        };
        let steps = &run.run.steps;
        let lost = first(steps, |seen| &seen.lost, |lost| lost.term).into_iter().map(|(time, lost)| {
            let PointsOf { term, points, of } = *lost;
            let name = name(term);
            let text = format!("at t = {time} {points} of {of} points of `{name}` lost their image while they pressed");
            let why = match has_rays(term) {
                true => "their rays no longer meet the other body, at its edge or beyond `within`",
                false => "no face that opposes them is within the distance of `within`",
            };
            let d = Diagnostic::new(Code::W632, text)
                .at_or_note(scene.place_of_term(name), why)
                .note("their force is gone from one step to the next")
                .help("smaller steps, a larger `within`, or faces of the other body that reach further");
            if has_rays(term) {
                d.help("`project` in place of `raytrace` keeps images at edges: the closest point")
            } else {
                d
            }
        });
        let never = self.last.iter().filter(|images| has_seen_all && !self.found.contains(&images.term)).map(|images| {
            let name = name(images.term);
            let text = match has_rays(images.term) {
                true => {
                    "its rays, along the normal of the current faces, never met the other body from the front and within the \
                     distance of `within`"
                }
                false => "no face whose normal opposes theirs was ever within the distance of `within`",
            };
            Diagnostic::new(Code::W632, format!("no point of `{name}` had an image in any step"))
                .at_or_note(scene.place_of_term(name), text)
        });
        let inside = first(steps, |seen| &seen.inside, |inside| inside.term).into_iter().map(|(time, inside)| {
            let PointsOf { term, points, of } = *inside;
            let name = name(term);
            let text = format!("at t = {time} {points} of {of} points of `{name}` are inside the other body without a force");
            Diagnostic::new(Code::W670, text)
                .at_or_note(
                    scene.place_of_term(name),
                    "its surface is behind them, further than `within`, and the result is no state of contact",
                )
                .help("smaller steps, and a `within` larger than any overlap; at the first step the bodies must not overlap by more")
        });
        lost.chain(never).chain(inside).collect()
    }
}

#[derive(Clone, Debug)]
struct Kept {
    bodies: Vec<SmallStrainBody>,
    pressures: Vec<PorePressure>,
    distant: Vec<DistantContact>,
}

impl Watched {
    /// Looks at a state that was solved for.
    pub(super) fn look(&mut self, scene: &Solving<'_>, u: &[f64]) -> Seen {
        let Solving { system, contact, .. } = scene;
        let mut seen = Seen::default();
        self.n += 1;
        let kept = self.kept.get_or_insert_with(|| Kept {
            bodies: wfl_checks::small_strain_bodies(system),
            pressures: wfl_checks::pore_pressures(system),
            distant: wfl_checks::distant_contacts(system, contact),
        });
        kept.distant.retain_mut(|distant| !wfl_checks::has_closed(system, contact, u, distant));
        for found in wfl_checks::large_strains(system, u, &kept.bodies) {
            kept.bodies.retain(|body| system.fields[body.field].name != found.field);
            seen.strained.push(found);
        }
        for found in wfl_checks::alternating(system, u, &mut kept.pressures) {
            kept.pressures.retain(|p| !p.is_of(system, &found));
            seen.alternating.push(found);
        }
        self.images.look(scene, u, &mut seen);
        if scene.steps.several() {
            seen.sizes = Some(self.growth.sizes(scene, u));
            seen.ringing = self.ringing.look(system, u);
        }
        seen
    }

    /// Looks at a state that steps with a mass in place of a tangent have led to: at its sizes, which cost as little as they do.
    pub(super) fn look_at_sizes(&mut self, scene: &Solving<'_>, u: &[f64]) -> Seen {
        let sizes = scene.steps.several().then(|| self.growth.sizes(scene, u));
        Seen { sizes, ..Seen::default() }
    }

    /// Steps that were looked at.
    pub(super) fn n(&self) -> usize {
        self.n
    }
}

/// W645 for bodies beyond their law.
pub(super) fn large_strains(run: &Ended<'_>) -> Vec<Diagnostic> {
    // where lengths have no unit a linear body may be in any; a velocity is no displacement
    let unit = |s: &LargeStrain| run.scene.declared_field(&s.field).and_then(|field| field.is_length);
    let found = first(&run.run.steps, |seen| &seen.strained, |s| &s.field).into_iter();
    let sized = found.filter(|(_, s)| unit(s).unwrap_or(s.has_memory));
    sized.map(|(time, s)| strained(run.scene, time, s)).collect()
}

/// W652 for rates that change their sign in every step.
pub(super) fn ringing(run: &Ended<'_>) -> Vec<Diagnostic> {
    let found = first(&run.run.steps, |seen| &seen.ringing, |field| *field).into_iter();
    let fields: Vec<Diagnostic> = found.map(|(time, field)| ringing::told(run.scene, *field, time)).collect();
    if fields.is_empty() { ringing::measures_told(run) } else { fields }
}

/// W646 for contact that never closes.
pub(super) fn distant_contacts(run: &Ended<'_>) -> Vec<Diagnostic> {
    let watched = run.run.watched.kept.as_ref().filter(|_| run.has_seen_all());
    watched.iter().flat_map(|kept| &kept.distant).map(|distant| far_apart(run.scene, distant)).collect()
}

/// W647 for unknowns that grow without end.
pub(super) fn growth(run: &Ended<'_>) -> Vec<Diagnostic> {
    growth::told(run.scene, &run.run.steps).into_iter().collect()
}

/// W648 for elements that do not bend, in the last state.
pub(super) fn locked_bending(run: &Ended<'_>) -> Vec<Diagnostic> {
    if run.run.watched.n == 0 {
        return Vec::new();
    }
    let locked = wfl_checks::locked_bending(run.scene.system, &run.scene.topology, &run.run.u);
    locked.iter().map(|locked| bends(run.scene, locked)).collect()
}

/// W649 for pressures that alternate from node to node.
pub(super) fn alternating(run: &Ended<'_>) -> Vec<Diagnostic> {
    let found = first(&run.run.steps, |seen| &seen.alternating, |a| (&a.field, &a.displacement)).into_iter();
    found.map(|(time, found)| alternates(run.scene, time, found)).collect()
}

/// W632 and W670 for images that were lost, or never found.
pub(super) fn lost_images(run: &Ended<'_>) -> Vec<Diagnostic> {
    run.run.watched.images.told(run)
}

/// W645.
fn strained(scene: &Scene, time: f64, found: &LargeStrain) -> Diagnostic {
    let LargeStrain { field, strain, moved, position: at, .. } = found;
    let moved = if *moved > 1.0 {
        format!(", and it has moved by {moved:.3e} times the extent of the mesh")
    } else {
        String::new()
    };
    let text = format!("at t = {time} `{field}` has a strain of {strain:.3e} at {}{moved}", position(*at));
    Diagnostic::new(Code::W645, text)
        .at_or_note(scene.place_of_field(field), "its law is one of small strains, and says nothing there")
        .note("a load beyond what the body bears, or a unit or power of ten in a load or a modulus")
        .help("bodies that are meant to deform so much need a law of finite strain")
}

/// W646.
fn far_apart(scene: &Scene, found: &DistantContact) -> Diagnostic {
    let DistantContact { name, from, nearest, .. } = found;
    let text = format!("its sides are {from:.3e} apart without displacement, and were never nearer than {nearest:.3e}");
    Diagnostic::new(Code::W646, format!("the contact `{name}` never closes"))
        .at_or_note(scene.place_of_term(name), text)
        .note("a distance or a direction of the load with the wrong sign, or a contact that this scene does not need")
}

/// W648.
fn bends(scene: &Scene, found: &wfl_checks::LockedBending) -> Diagnostic {
    let text = format!(
        "{:.0} % of its energy of deformation are in the shear and the jumps of strain of single cells, and displacements are \
         too small by about that part",
        100.0 * found.share
    );
    Diagnostic::new(Code::W648, format!("`{}` bends on elements of degree 1 that do not bend", found.field))
        .at_or_note(scene.place_of_field(&found.field), text)
        .help("elements of degree 2 (vector Q2 or P2), or cells that are no longer than a quarter of the thickness")
}

/// W649.
fn alternates(scene: &Scene, time: f64, found: &Alternating) -> Diagnostic {
    let Alternating { field, displacement, share, position: at, too_short, is_equal_order } = found;
    let cure = match (is_equal_order, too_short.is_finite()) {
        (true, true) => format!(
            "`{displacement}` needs a degree more than `{field}`; then steps of {too_short:.2e} times this one or longer, \
             h^2/(6 c), or smaller cells there"
        ),
        (true, false) => format!("`{displacement}` needs a degree more than `{field}`"),
        (false, true) => {
            format!(
                "the step is too short for the cells: {too_short:.2e} times this one is the least, h^2/(6 c); or smaller cells there"
            )
        }
        (false, false) => "nothing spreads a jump of it: smaller cells there".to_owned(),
    };
    let text = format!("around {}, by {:.0} % of its range", position(*at), 100.0 * share);
    Diagnostic::new(Code::W649, format!("at t = {time} `{field}` alternates from node to node"))
        .at_or_note(scene.place_of_field(field), text)
        .help(cure)
}
