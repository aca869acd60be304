//! The fields of a scene, and behind them what a derivative is made with: companions, parameters, weights of points.
//!
//! A companion has the space of its field: its values are weights, its dofs those of the field at the end of the previous
//! step ([`wfl_compiler::Companions`]). A parameter that changes is one number, or several, for the whole scene. One vector
//! has the derivatives in all of them: fields, companions, parameters, each by dof. Along a direction the values of a
//! companion are what its field moves by. Where there are rates, behind the parameters each field of the scene stands twice
//! more: for what its equations read of its first and second rates in the past.

use std::{collections::BTreeMap, ops::Range, sync::Arc};

use wfl::ResolvedScript;
use wfl_compiler::{
    Companions, Constant, Env,
    types::{FieldId, FieldKind, FieldSig, InputSlot, PlaceKind, PlaceSig, Shape},
};

use crate::{
    Measure, Scene,
    assemble::Domain,
    field::{Field, FieldSpace},
    point_space::PointSpace,
};

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
}

impl<'a> Extended<'a> {
    pub(super) fn new(scene: &'a Scene, script: &'a ResolvedScript, live: Vec<Live>) -> Self {
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
        Self { scene, n: own.len(), fields, sigs, live, measures, params, starts, n_entries }
    }

    pub(super) fn companions(&self) -> Companions {
        Companions { n_fields: self.n, n_parameters: self.live.len() }
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

    /// The place of a domain, where a law was compiled before: every field lives there.
    pub(super) fn place(&self, domain: &Arc<Domain>, through_mapping: bool) -> PlaceSig {
        let n = self.fields.len();
        let two_sides = domain.groups.iter().any(|g| g.there.is_some()) && !through_mapping;
        let kind = match domain.over {
            crate::assemble::Over::Facets if two_sides => PlaceKind::Interface,
            crate::assemble::Over::Facets => PlaceKind::Facets,
            crate::assemble::Over::Edges if two_sides => PlaceKind::InnerEdges,
            crate::assemble::Over::Edges => PlaceKind::Edges,
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
        values.resize(self.fields.len(), &[]);
        values
    }

    /// The entries of a parameter that changes among those of all.
    pub(super) fn entries_of(&self, live: usize) -> Range<usize> {
        let start: usize = self.live[..live].iter().map(|l| l.values.len()).sum();
        start..start + self.live[live].values.len()
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
