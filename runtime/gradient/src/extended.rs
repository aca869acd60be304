//! The fields of a scene, and behind them what a derivative is made with: companions, parameters, weights of points.
//!
//! A companion has the space of its field: its values are weights, its dofs those of the field at the end of the previous
//! step ([`wfl_compiler::Companions`]). A parameter that changes is one number, or several, for the whole scene. One vector
//! has the derivatives in all of them: fields, companions, parameters, each by dof. Along a direction the values of a
//! companion are what its field moves by. Where there are rates, behind the parameters each field of the scene stands twice
//! more: for what its equations read of its first and second rates in the past. Where parameters move the mesh, last stand the
//! velocity of its nodes, what the sizes of its cells move by, and what a point moves by that keeps its place in space.

use std::{collections::BTreeMap, ops::Range, sync::Arc};

use wfl::{ResolvedScript, each_word};
use wfl_compiler::{
    Companions, Constant, Env, Extent, Velocity,
    types::{FieldId, FieldKind, FieldSig, InputSlot, PlaceKind, PlaceSig, Shape},
};
use wfl_discrete::{
    assemble::{Domain, Over},
    field::{Field, FieldSpace},
    point_space::PointSpace,
    space::Space,
};
use wfl_mesh::{
    element::{ElementError, Family},
    mesh::CellId,
};
use wfl_problem::{Measure, Scene};

use super::velocities::{Velocities, each_moving_place};

/// A parameter that changes.
#[derive(Clone, Debug)]
pub(super) struct Live {
    pub(super) name: String,
    pub(super) shape: Shape,
    pub(super) values: Vec<f64>,
    /// Its position among the parameters of the script.
    pub(super) declared: usize,
    /// Of a parameter that nobody asked for: one that was asked for and that its value is made of.
    pub(super) made_of: Option<String>,
}

/// Fields of a scene and what stands behind them.
pub(super) struct Extended<'a> {
    pub(super) scene: &'a Scene,
    pub(super) fields: Vec<Field>,
    pub(super) sigs: Vec<FieldSig>,
    /// How many fields the scene has.
    pub(super) n: usize,
    pub(super) live: Vec<Live>,
    /// The measures of the scene, behind them those that only numbers made of measures read; each as it is declared.
    pub(super) measures: Vec<(&'a Measure, &'a wfl::Measure)>,
    /// The parameters that do not change.
    params: BTreeMap<String, Constant>,
    /// By field where its derivatives start; `None` for weights of points.
    pub(super) starts: Vec<Option<usize>>,
    /// Length of the vector of all derivatives.
    pub(super) n_entries: usize,
    /// The first of the three fields of the motion of the mesh; `None` where no parameter moves it.
    motion: Option<usize>,
    /// What the parameters move, once it is known.
    pub(super) velocities: Option<Velocities>,
}

/// Whether a parameter that changes moves the mesh or the point of a measure.
fn is_moved(script: &ResolvedScript, live: &[Live]) -> bool {
    let mut found = false;
    each_moving_place(script, &mut |e| {
        each_word(e, &mut |_, word| found |= live.iter().any(|l| l.name == word));
    });
    found
}

/// The fields of the motion of the mesh.
fn of_motion(scene: &Scene) -> Result<[(Field, FieldSig); 3], ElementError> {
    let (mesh, kind) = (&scene.system.mesh, FieldKind::Data);
    let (dim, cells) = (mesh.dim(), mesh.cells().collect::<Vec<CellId>>());
    let on_cells = |degree, family| Space::on_cells(mesh, &scene.topology, &cells, degree, family);
    let space = |degree, family| on_cells(degree, family).map(|space| FieldSpace::Nodal(space.into()));
    let of = |name: &str, shape: Shape, degree: usize, space: FieldSpace| {
        let (name, global) = (name.to_owned(), matches!(space, FieldSpace::Global));
        let field = Field { name: name.clone(), kind, n_components: shape.len(), space };
        (field, FieldSig { name, shape, degree, kind, global, on_faces: false })
    };
    Ok([
        of("velocity'", Shape::vector(dim), mesh.order(), space(mesh.order(), Family::Continuous)?),
        of("size'", Shape::SCALAR, 0, space(0, Family::Discontinuous)?),
        of("place'", Shape::vector(dim), 0, FieldSpace::Global),
    ])
}

impl<'a> Extended<'a> {
    pub(super) fn new(scene: &'a Scene, script: &'a ResolvedScript, live: Vec<Live>) -> Result<Self, ElementError> {
        let own = &scene.system.fields;
        let (mut fields, mut sigs): (Vec<Field>, Vec<FieldSig>) = (own.to_vec(), scene.sigs.clone());
        for (field, sig) in own.iter().zip(&scene.sigs) {
            // no text has such a name
            let name = format!("{}'", field.name);
            fields.push(Field { name: name.clone(), kind: FieldKind::Data, ..field.clone() });
            sigs.push(FieldSig { name, kind: FieldKind::Data, ..sig.clone() });
        }
        // parameters, and behind them what they move by
        for (l, name) in
            live.iter().map(|l| (l, l.name.clone())).chain(live.iter().map(|l| (l, format!("{}'", l.name))))
        {
            let n_components = l.shape.len();
            fields.push(Field { name: name.clone(), kind: FieldKind::Data, n_components, space: FieldSpace::Global });
            sigs.push(FieldSig {
                name,
                shape: l.shape,
                degree: 0,
                kind: FieldKind::Data,
                global: true,
                on_faces: false,
            });
        }
        if scene.system.rates().is_some() {
            for order in ["rate", "second rate"] {
                for (field, sig) in own.iter().zip(&scene.sigs) {
                    let name = format!("{order} of {}'", field.name);
                    fields.push(Field { name: name.clone(), kind: FieldKind::Data, ..field.clone() });
                    sigs.push(FieldSig { name, kind: FieldKind::Data, ..sig.clone() });
                }
            }
        }
        let motion = is_moved(script, &live).then_some(fields.len());
        if motion.is_some() {
            for (field, sig) in of_motion(scene)? {
                fields.push(field);
                sigs.push(sig);
            }
        }
        let mut n_entries = 0;
        let starts = fields
            .iter()
            .map(|field| {
                let start = n_entries;
                n_entries += field.n_dofs();
                Some(start)
            })
            .collect();
        let is_live = |name: &String| live.iter().any(|l| l.name == *name);
        let params = scene.params.iter().filter(|p| !is_live(&p.0)).cloned().collect();
        let measures = measures(scene, script);
        let n = own.len();
        Ok(Self { scene, fields, sigs, n, live, measures, params, starts, n_entries, motion, velocities: None })
    }

    /// Whether parameters move the mesh.
    pub(super) fn has_motion(&self) -> bool {
        self.motion.is_some()
    }

    /// What stands for what, of a law that is taken over this.
    pub(super) fn companions_over(&self, extent: Extent) -> Companions {
        let velocity = self.motion.map(|first| {
            let [field, size, place] = [0, 1, 2].map(|k| FieldId::new(first + k));
            Velocity { field, size, place, extent }
        });
        Companions { n_fields: self.n, n_parameters: self.live.len(), velocity }
    }

    /// The same of the law of a domain.
    pub(super) fn companions_on(&self, domain: &Domain) -> Companions {
        self.companions_over(match domain.over {
            Over::Cells => Extent::Cells,
            Over::Facets => Extent::Faces,
            Over::Edges => Extent::Edges,
            Over::Points => Extent::Points,
        })
    }

    /// The same of single points.
    pub(super) fn companions(&self) -> Companions {
        self.companions_over(Extent::Points)
    }

    /// What expressions see: parameters that change are fields.
    pub(super) fn env(&self) -> Env<'_> {
        self.env_of(&self.sigs)
    }

    /// The same with more fields behind those.
    pub(super) fn env_of<'e>(&'e self, sigs: &'e [FieldSig]) -> Env<'e> {
        self.scene.env_with(sigs, &self.params)
    }

    /// The position of a measure.
    pub(super) fn measure(&self, name: &str) -> Option<usize> {
        self.measures.iter().position(|(measure, _)| measure.name == name)
    }

    /// Adds a number at each point of a domain; gives its position.
    pub(super) fn add_weights(&mut self, domain: &Domain) -> usize {
        let space = PointSpace::new(&self.scene.system.mesh, domain);
        let name = format!("weights {}'", self.fields.len());
        let shape = Shape::SCALAR;
        self.fields.push(Field {
            name: name.clone(),
            kind: FieldKind::Data,
            n_components: 1,
            space: FieldSpace::Points(space),
        });
        self.sigs.push(FieldSig { name, shape, degree: 0, kind: FieldKind::Data, global: false, on_faces: false });
        self.starts.push(None);
        self.fields.len() - 1
    }

    /// Adds a field of so many numbers for the whole scene: the tolerances of kinks; gives its position.
    pub(super) fn add_tolerances(&mut self, n: usize) -> usize {
        let name = format!("tolerances {}'", self.fields.len());
        let (kind, space) = (FieldKind::Data, FieldSpace::Global);
        self.fields.push(Field { name: name.clone(), kind, n_components: n, space });
        self.sigs.push(FieldSig { name, shape: Shape::vector(n), degree: 0, kind, global: true, on_faces: false });
        self.starts.push(None);
        self.fields.len() - 1
    }

    /// The place of a domain, where a law was compiled before, perhaps through a mapping: every field lives there.
    pub(super) fn place(&self, domain: &Arc<Domain>, mapping: Option<usize>) -> PlaceSig {
        let n = self.fields.len();
        let two_sides = domain.groups.iter().any(|g| g.there.is_some()) && mapping.is_none();
        let kind = match domain.over {
            wfl_discrete::assemble::Over::Facets if two_sides => PlaceKind::Interface,
            wfl_discrete::assemble::Over::Facets => PlaceKind::Facets,
            wfl_discrete::assemble::Over::Edges if two_sides => PlaceKind::InnerEdges,
            wfl_discrete::assemble::Over::Edges => PlaceKind::Edges,
            _ => PlaceKind::Cells,
        };
        PlaceSig {
            name: "here".to_owned(),
            kind,
            here: vec![true; n],
            there: vec![kind.has_two_sides(); n],
            entities: Vec::new(),
            description: "a region of the scene".to_owned(),
            here_name: None,
            inside: false,
        }
    }

    /// A place of which only positions are known.
    pub(super) fn positions(&self) -> PlaceSig {
        let n = self.fields.len();
        PlaceSig {
            name: "here".to_owned(),
            kind: PlaceKind::Cells,
            here: vec![false; n],
            there: vec![false; n],
            entities: Vec::new(),
            description: "a set of positions".to_owned(),
            here_name: None,
            inside: false,
        }
    }

    /// The field of a parameter that changes.
    fn field_of(&self, live: usize) -> FieldId {
        FieldId::new(2 * self.n + live)
    }

    /// Values of all fields along a direction, from those of the fields of the scene: `moved` are those of their companions,
    /// `live` what the parameters move by.
    pub(super) fn with_directions<'v>(
        &'v self,
        own: &[&'v [f64]],
        moved: Vec<&'v [f64]>,
        live: &'v [f64],
    ) -> Vec<&'v [f64]> {
        let mut values = own.to_vec();
        values.extend(moved);
        values.extend(self.live.iter().map(|l| l.values.as_slice()));
        values.extend((0..self.live.len()).map(|k| &live[self.entries_of(k)]));
        if let Some(first) = self.motion {
            values.resize(first, &[]);
            let mut behind = self.n_live();
            for field in &self.fields[first..first + 3] {
                values.push(&live[behind..behind + field.n_dofs()]);
                behind += field.n_dofs();
            }
        }
        values.resize(self.fields.len(), &[]);
        values
    }

    /// The entries of a parameter that changes among those of all.
    pub(super) fn entries_of(&self, live: usize) -> Range<usize> {
        let start: usize = self.live[..live].iter().map(|l| l.values.len()).sum();
        start..start + self.live[live].values.len()
    }

    /// The parameter that was asked for of which an entry is, or is made.
    pub(super) fn asked_of(&self, entry: usize) -> &str {
        let of = (0..self.live.len()).find(|k| self.entries_of(*k).contains(&entry)).map(|k| &self.live[k]);
        of.map_or("", |l| l.made_of.as_ref().unwrap_or(&l.name))
    }

    /// The entries of all parameters that change.
    pub(super) fn n_live(&self) -> usize {
        self.live.iter().map(|l| l.values.len()).sum()
    }

    /// The entries of a parameter that changes, as fields.
    pub(super) fn directions_of(&self, live: usize) -> impl Iterator<Item = (FieldId, usize)> + use<> {
        let (field, n) = (self.field_of(live), self.live[live].values.len());
        (0..n).map(move |entry| (field, entry))
    }

    /// The same of all of them, in order.
    pub(super) fn directions(&self) -> Vec<(FieldId, usize)> {
        (0..self.live.len()).flat_map(|k| self.directions_of(k)).collect()
    }

    /// What a formula reads of parameters that change.
    pub(super) fn value_of(&self, slot: &InputSlot) -> f64 {
        let InputSlot::Field(slot) = slot else { return 0.0 };
        let live = slot.field.index().checked_sub(2 * self.n).and_then(|k| self.live.get(k));
        live.and_then(|l| l.values.get(usize::from(slot.entry))).copied().unwrap_or(0.0)
    }

    /// The derivatives in a field of the scene, in what it was at the end of the previous step, and in all parameters.
    pub(super) fn range(&self, field: usize) -> Range<usize> {
        let start = self.starts[field].unwrap_or(0);
        start..start + self.fields[field].n_dofs()
    }

    /// The derivatives in the motion of the mesh; empty where it does not move.
    pub(super) fn motion_range(&self) -> Range<usize> {
        match self.motion {
            Some(first) => self.range(first).start..self.range(first + 2).end,
            None => self.n_entries..self.n_entries,
        }
    }

    /// Numbers by entry of the parameters that change, and behind them zeros for the motion of the mesh.
    pub(super) fn zeros(&self) -> Vec<f64> {
        vec![0.0; self.n_live() + self.motion_range().len()]
    }

    /// Where in such numbers is what a point moves by that keeps its place in space.
    pub(super) fn place_range(&self) -> Range<usize> {
        let all = self.n_live() + self.motion_range().len();
        let dim = if self.motion.is_some() { self.scene.system.mesh.dim() } else { 0 };
        all - dim..all
    }

    /// Moves the derivatives in the motion of the mesh, which stand behind those in the parameters, to these.
    pub(super) fn gather_motion(&self, gradient: &mut [f64]) {
        let Some(velocities) = &self.velocities else { return };
        let (live, motion) = gradient.split_at_mut(self.n_live());
        for (entry, to) in live.iter_mut().enumerate() {
            let of_nodes = velocities.nodes[entry].iter();
            let of_sizes = velocities.sizes.get(entry).into_iter().flatten();
            *to += of_nodes.chain(of_sizes).zip(motion.iter()).map(|(v, g)| v * g).sum::<f64>();
        }
    }

    /// Writes behind what the parameters move by what they move the mesh by.
    pub(super) fn spread_motion(&self, moved: &mut [f64]) {
        let Some(velocities) = &self.velocities else { return };
        let (live, motion) = moved.split_at_mut(self.n_live());
        for (entry, by) in live.iter().enumerate().filter(|(_, by)| **by != 0.0) {
            let of_nodes = velocities.nodes[entry].iter();
            let of_sizes = velocities.sizes.get(entry).into_iter().flatten();
            motion.iter_mut().zip(of_nodes.chain(of_sizes)).for_each(|(m, v)| *m += by * v);
        }
    }

    /// The first of the fields of the motion of the mesh: the velocities of its nodes.
    pub(super) fn velocity_space(&self) -> Option<&Space> {
        match &self.fields.get(self.motion?)?.space {
            FieldSpace::Nodal(space) => Some(space),
            _ => None,
        }
    }

    /// The derivatives in the parameters that change.
    pub(super) fn live_range(&self) -> Range<usize> {
        let start = self.starts.get(2 * self.n).copied().flatten().unwrap_or(self.n_entries);
        start..start + self.n_live()
    }
}

/// The measures of a scene, and behind them the reductions in numbers made of measures.
fn measures<'a>(scene: &'a Scene, script: &'a ResolvedScript) -> Vec<(&'a Measure, &'a wfl::Measure)> {
    let reductions = scene.computed.iter().flat_map(|c| &c.reductions);
    let declared = || script.measures.iter().chain(script.computed.iter().flat_map(|c| &c.watched));
    let of = |measure: &'a Measure| Some((measure, declared().find(|m| m.name.name == measure.name)?));
    scene.measures.iter().chain(reductions).filter_map(of).collect()
}
