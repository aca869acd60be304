//! What a case needs before its expression: mesh, region, integration points, fields with their values.

use std::{collections::BTreeMap, sync::Arc};

use wfl_compiler::{
    Constant,
    ir::LANES,
    types::{FieldKind, FieldSig, PlaceKind, PlaceSig, Shape},
};
use wfl_discrete::{
    assemble::{Binding, Bound, Domain, FieldValues, LawSlots, Workspace, entity_geometries},
    field::{Field, FieldSpace},
    point_space::PointSpace,
    space::Space,
};
use wfl_mesh::{
    element::Family,
    mesh::{CellId, CellKind, FacetRef, InterfaceFacet, Mesh, RawMesh, RegionSet, Topology},
    quadrature::Rule,
};

use super::{
    format::{Case, Corpus, DataText, FieldText, MeshText, PointDataText, QuadratureText, RegionText, Role},
    ties::frozen_name,
};

/// Positions of a file and of a mesh are the same point within this part of the mesh size: the file has rounded ones.
const SAME_POINT: f64 = 1e-9;

/// A case ready to be compiled. Fields stand in the order of their names, so that positions are `FieldId`s.
pub(super) struct Setup {
    pub(super) mesh: Mesh,
    pub(super) domain: Arc<Domain>,
    pub(super) fields: Vec<Field>,
    pub(super) sigs: Vec<FieldSig>,
    /// Values of each field, node after node.
    pub(super) values: Vec<Vec<f64>>,
    pub(super) params: BTreeMap<String, Constant>,
    pub(super) place: PlaceSig,
}

pub(super) fn setup(corpus: &Corpus, case: &Case) -> Result<Setup, String> {
    let text = corpus.meshes.get(&case.mesh).ok_or_else(|| format!("no mesh `{}`", case.mesh))?;
    let mesh = mesh(text)?;
    let topology = Topology::new(&mesh).map_err(|e| e.to_string())?;
    let region = region(&mesh, &topology, &case.region)?;
    let rules = rules(corpus, case, &mesh)?;
    let rule = |kind: CellKind| rules.get(&kind).cloned().unwrap_or_else(|| wfl_mesh::quadrature::vertex(kind));
    let domain = Arc::new(Domain::new(&mesh, &region, &rule).map_err(|e| e.to_string())?);
    let mut setup = Setup {
        place: place(&mesh, &region),
        domain,
        fields: Vec::new(),
        sigs: Vec::new(),
        values: Vec::new(),
        params: case.data.iter().map(|(name, d)| Ok((name.clone(), constant(d)?))).collect::<Result<_, String>>()?,
        mesh,
    };
    for (name, text) in &case.fields {
        setup.add_field(&topology, name, text)?;
    }
    for (name, text) in &case.im_data {
        setup.add_point_data(name, text)?;
    }
    setup.add_frozen(&topology, case)?;
    setup.find_homes(&region);
    Ok(setup)
}

fn cell_kind(name: &str) -> Result<CellKind, String> {
    Ok(match name {
        "line" => CellKind::Segment,
        "tri" => CellKind::Triangle,
        "quad" => CellKind::Quadrilateral,
        "tet" => CellKind::Tetrahedron,
        "hex" => CellKind::Hexahedron,
        _ => return Err(format!("no cell kind `{name}`")),
    })
}

fn point(x: &[f64]) -> [f64; 3] {
    std::array::from_fn(|d| x.get(d).copied().unwrap_or(0.0))
}

fn mesh(text: &MeshText) -> Result<Mesh, String> {
    let kinds = text.cells.iter().map(|(kind, _)| cell_kind(kind)).collect::<Result<_, _>>()?;
    let raw = RawMesh {
        dim: text.dim,
        order: 1,
        nodes: text.nodes.iter().map(|x| point(x)).collect(),
        kinds,
        connectivity: text.cells.iter().flat_map(|(_, nodes)| nodes.iter().copied()).collect(),
        ..RawMesh::default()
    };
    Mesh::from_raw(raw).map_err(|e| e.to_string())
}

fn cell_ids(mesh: &Mesh, cells: &[u32]) -> Result<Vec<CellId>, String> {
    let check = |c: &u32| {
        let inside = (*c as usize) < mesh.n_cells();
        if inside { Ok(CellId::new(*c as usize)) } else { Err(format!("no cell {c}")) }
    };
    cells.iter().map(check).collect()
}

/// Faces that all have a neighbour make an interface, as its neighbours may be asked for.
fn region(mesh: &Mesh, topology: &Topology, text: &RegionText) -> Result<RegionSet, String> {
    let faces = match text {
        RegionText::Cells { cells } => return Ok(RegionSet::Cells(cell_ids(mesh, cells)?)),
        RegionText::Faces { faces } => faces,
    };
    let mut facets = Vec::new();
    for (cell, nodes) in faces {
        let cell = cell_ids(mesh, &[*cell])?[0];
        let wanted: std::collections::BTreeSet<usize> = nodes.iter().map(|n| *n as usize).collect();
        let found = (0..mesh.kind(cell).facets().len()).map(|f| FacetRef::new(cell, f)).find(|f| {
            let has: std::collections::BTreeSet<usize> =
                mesh.facet_vertices(*f).vertices().iter().map(|n| n.index()).collect();
            has == wanted
        });
        facets.push(found.ok_or_else(|| format!("cell {} has no face {nodes:?}", cell.index()))?);
    }
    let pairs: Option<Vec<InterfaceFacet>> =
        facets.iter().map(|here| Some(InterfaceFacet { here: *here, there: topology.opposite(*here)? })).collect();
    Ok(match pairs {
        Some(pairs) if !pairs.is_empty() => RegionSet::Interface(pairs),
        _ => RegionSet::Facets(facets),
    })
}

/// The rules of the case by entity kind: of the cells, and of their faces.
fn rules(corpus: &Corpus, case: &Case, mesh: &Mesh) -> Result<BTreeMap<CellKind, Rule>, String> {
    let mut out = BTreeMap::new();
    for (cell, name) in &case.quadrature {
        let text = corpus.quadratures.get(name).ok_or_else(|| format!("no quadrature `{name}`"))?;
        let kind = cell_kind(cell)?;
        if cell_kind(&text.cell)? != kind {
            return Err(format!("quadrature `{name}` is for {}, not for {cell}", text.cell));
        }
        out.insert(kind, rule(kind, &text.points, &text.weights));
        for facet in kind.facets() {
            out.insert(facet.kind, face_rule(facet.kind, text));
        }
    }
    match mesh.kinds().iter().find(|k| !out.contains_key(k)) {
        Some(kind) => Err(format!("no quadrature for {kind}")),
        None => Ok(out),
    }
}

fn rule(kind: CellKind, points: &[Vec<f64>], weights: &[f64]) -> Rule {
    Rule { kind, degree: 0, points: points.iter().map(|x| point(x)).collect(), weights: weights.to_vec() }
}

/// Parameters of a face run from its first node along the others, as facet parameters do here.
fn face_rule(kind: CellKind, text: &QuadratureText) -> Rule {
    if kind == CellKind::Point {
        wfl_mesh::quadrature::vertex(kind)
    } else {
        rule(kind, &text.face_points, &text.face_weights)
    }
}

fn place(mesh: &Mesh, region: &RegionSet) -> PlaceSig {
    let (kind, description) = match region {
        RegionSet::Cells(c) => (PlaceKind::Cells, format!("a region of {} cells", c.len())),
        RegionSet::Interface(i) => (PlaceKind::Interface, format!("an interface of {} faces", i.len())),
        other => (PlaceKind::Facets, format!("{} faces with one side", other.len())),
    };
    PlaceSig {
        name: "region".to_owned(),
        kind,
        here: Vec::new(),
        there: Vec::new(),
        entities: entity_geometries(mesh, region),
        description,
        here_name: None,
        inside: false,
    }
}

fn shape(sizes: &[usize]) -> Result<Shape, String> {
    Shape::new(sizes).ok_or_else(|| format!("no shape {sizes:?}"))
}

fn constant(data: &DataText) -> Result<Constant, String> {
    let shape = shape(&data.shape)?;
    if shape.len() != data.values.len() {
        return Err(format!("{} values for shape {:?}", data.values.len(), data.shape));
    }
    Ok(Constant { shape, values: data.values.clone(), declared: None })
}

/// `n` numbers as scalar or vector.
fn vector_or_scalar(n: usize) -> Shape {
    if n == 1 { Shape::SCALAR } else { Shape::vector(n) }
}

impl Setup {
    fn push(&mut self, field: Field, sig: FieldSig, values: Vec<f64>) {
        self.fields.push(field);
        self.sigs.push(sig);
        self.values.push(values);
    }

    fn add_field(&mut self, topology: &Topology, name: &str, text: &FieldText) -> Result<(), String> {
        let role = match text {
            FieldText::Fem { role, .. } | FieldText::Global { role, .. } => *role,
        };
        let kind = if role == Role::Variable { FieldKind::Unknown } else { FieldKind::Data };
        self.add_field_of_kind(topology, name.to_owned(), kind, text)
    }

    /// For each unknown of a case with a kink, a copy of its values whose derivative is 0.
    fn add_frozen(&mut self, topology: &Topology, case: &Case) -> Result<(), String> {
        let unknowns = self.unknowns().iter().map(|name| (*name).to_owned()).collect::<Vec<String>>();
        for name in unknowns.iter().filter(|_| case.kink) {
            self.add_field_of_kind(topology, frozen_name(name), FieldKind::Data, &case.fields[name])?;
        }
        Ok(())
    }

    /// The names of what is solved for.
    pub(super) fn unknowns(&self) -> Vec<&str> {
        self.sigs.iter().filter(|s| s.kind == FieldKind::Unknown).map(|s| s.name.as_str()).collect()
    }

    fn add_field_of_kind(
        &mut self,
        topology: &Topology,
        name: String,
        kind: FieldKind,
        text: &FieldText,
    ) -> Result<(), String> {
        match text {
            FieldText::Global { values, .. } => {
                let shape = vector_or_scalar(values.len());
                let field = Field { name: name.clone(), kind, n_components: shape.len(), space: FieldSpace::Global };
                self.push(
                    field,
                    FieldSig { name, shape, degree: 0, kind, global: true, on_faces: false },
                    values.clone(),
                );
            }
            FieldText::Fem { space, components, cells, values, .. } => {
                let cells = cell_ids(&self.mesh, cells)?;
                let degree = degree(space)?;
                let space = Space::on_cells(&self.mesh, topology, &cells, degree, Family::Continuous)
                    .map_err(|e| e.to_string())?;
                let shape = vector_or_scalar(*components);
                let field = Field {
                    name: name.clone(),
                    kind,
                    n_components: *components,
                    space: FieldSpace::Nodal(space.into()),
                };
                let values = self.nodal(&field, values)?;
                self.push(field, FieldSig { name, shape, degree, kind, global: false, on_faces: false }, values);
            }
        }
        Ok(())
    }

    fn add_point_data(&mut self, name: &str, text: &PointDataText) -> Result<(), String> {
        let shape = shape(&text.shape)?;
        let space = FieldSpace::Points(PointSpace::new(&self.mesh, &self.domain));
        let kind = FieldKind::State;
        let field = Field { name: name.to_owned(), kind, n_components: shape.len(), space };
        let values = self.nodal(&field, &text.values)?;
        self.push(
            field,
            FieldSig { name: name.to_owned(), shape, degree: 0, kind, global: false, on_faces: false },
            values,
        );
        Ok(())
    }

    /// Values given with the positions of their nodes, in the order of the nodes of the field.
    fn nodal(&self, field: &Field, values: &[(Vec<f64>, Vec<f64>)]) -> Result<Vec<f64>, String> {
        let mut out = Vec::with_capacity(field.n_dofs());
        for node in 0..field.n_nodes() {
            let x = field.node_position(node);
            let found = values.iter().find(|(at, _)| self.same_point(x, point(at)));
            let (_, v) = found.ok_or_else(|| format!("no value of `{}` at {x:?}", field.name))?;
            if v.len() != field.n_components {
                return Err(format!("{} numbers for `{}` at {x:?}", v.len(), field.name));
            }
            out.extend_from_slice(v);
        }
        if values.len() == field.n_nodes() {
            return Ok(out);
        }
        Err(format!("{} values for the {} nodes of `{}`", values.len(), field.n_nodes(), field.name))
    }

    /// Length, area or volume of the region.
    pub(super) fn measure(&self) -> f64 {
        let slots = LawSlots { inputs: &[], tests: &[], trials: &[] };
        let Ok(binding) = Binding::new(&self.mesh, &self.domain, &self.fields, slots) else { return 0.0 };
        let bound = Bound { mesh: &self.mesh, domain: &self.domain, binding: &binding };
        let values = FieldValues { current: &[], previous: &[], rates: None };
        let mut workspace = Workspace::default();
        let mut sum = 0.0;
        for (g, group) in self.domain.groups.iter().enumerate() {
            for batch in 0..group.n_batches() {
                workspace.prepare(bound, g, batch, values);
                for lane in 0..LANES.min(group.entities.len() - batch * LANES) {
                    sum += (0..group.n_points()).map(|q| workspace.weight(q)[lane]).sum::<f64>();
                }
            }
        }
        sum
    }

    pub(super) fn same_point(&self, a: [f64; 3], b: [f64; 3]) -> bool {
        let (low, high) = self.mesh.bounds();
        let size = (0..3).fold(0.0f64, |m, d| m.max(high[d] - low[d]));
        (0..3).all(|d| (a[d] - b[d]).abs() <= SAME_POINT * size)
    }

    /// Which fields live on the two sides of the region.
    fn find_homes(&mut self, region: &RegionSet) {
        let lives = |field: &Field| match region {
            RegionSet::Cells(c) => (c.iter().all(|c| field.lives_in_cell(*c)), false),
            RegionSet::Interface(i) => {
                (i.iter().all(|p| field.lives_on_facet(p.here)), i.iter().all(|p| field.lives_on_facet(p.there)))
            }
            RegionSet::Facets(f) => (f.iter().all(|f| field.lives_on_facet(*f)), false),
            RegionSet::Edges(_) | RegionSet::Nodes(_) => (false, false),
        };
        (self.place.here, self.place.there) = self.fields.iter().map(lives).unzip();
    }

    /// The position of a node of the file in the numbering of a field.
    pub(super) fn node_at(&self, field: usize, at: Option<&[f64]>) -> Option<usize> {
        match at {
            None => Some(0),
            Some(x) => (0..self.fields[field].n_nodes())
                .find(|n| self.same_point(self.fields[field].node_position(*n), point(x))),
        }
    }
}

/// `P2`, `Q1`; `C1` is degree 1 on whatever the cells are.
fn degree(space: &str) -> Result<usize, String> {
    let digits = space.strip_prefix(['P', 'Q', 'C']).and_then(|d| d.parse().ok());
    digits.ok_or_else(|| format!("no space `{space}`"))
}
