//! The smallest scene with contact, for tests of this crate, of `linear` and of `newton`: a row of squares above a floor.
//!
//! Bilinear squares of edge 1 in 2-D, moved by `u`, held at the top (y = 1) where values are prescribed. Terms are texts,
//! those of `floor` on the faces at y = 0, whose normal is (0, -1).

#![allow(dead_code, reason = "each crate uses a part of it")]

use std::collections::BTreeMap;
use std::sync::Arc;

use wfl::{SourceMap, ast::Expansions, parse_expr};
use wfl_compiler::{
    Env, FrozenLaw, InterpreterBackend, TermLaw, TermSource,
    backend::KernelBackend as _,
    compile_frozen, compile_term,
    ir::VerifiedKernel,
    types::{FieldId, FieldKind, FieldSig, PlaceKind, PlaceSig, Shape},
};
use wfl_contact::{Contact, ContactParts, ContactTerm};
use wfl_discrete::{
    assemble::{AssembledTerm, Binding, Domain, Integrator, LawSlots, tangent_kernel},
    domain::entity_geometries,
    field::{Field, FieldSpace},
    point_space::PointSpace,
    space::Space,
    system::{FrozenTerm, Known, Numbering, System},
    value::Value,
    window::Window,
};
use wfl_mesh::{
    element::Family,
    mesh::{BoxShape, Mesh, RegionSet, Topology, generate_box, outer_boundary, pick_facets},
    quadrature::gauss,
};

/// A linear body: `stress = grad u`, so that each component obeys Laplace's equation.
pub(crate) const LAPLACE: &str = "Grad_u:Grad_Test_u";
/// A body that is stiffer the more it is strained: |grad u|^2 grad u.
pub(crate) const CUBIC: &str = "Norm_sqr(Grad_u)*(Grad_u:Grad_Test_u)";
/// A penalty of stiffness 10 against the floor, and Coulomb friction with the coefficient 1/2.
pub(crate) const PENALTY_WITH_FRICTION: &str = "(pos_part(10*u.Normal)*Normal
    + Ball_projection(10*(u - (u.Normal)*Normal), 0.5*pos_part(10*u.Normal))).Test_u";
/// The same without friction.
pub(crate) const PENALTY: &str = "pos_part(10*u.Normal)*(Test_u.Normal)";

/// A system with its laws of contact.
pub(crate) struct Block {
    pub(crate) system: System,
    pub(crate) contact: Contact,
}

impl Block {
    /// `n` squares with terms on cells and on the floor.
    pub(crate) fn new(n: usize, cells: &[&str], floor: &[&str]) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "few squares")]
        let mesh = generate_box([0.0; 3], [n as f64, 1.0, 0.0], [n, 1, 1], 2, BoxShape::Quadrilateral).unwrap();
        let topology = Topology::new(&mesh).unwrap();
        let all: Vec<_> = mesh.cells().collect();
        let space = Space::on_cells(&mesh, &topology, &all, 1, Family::Continuous).unwrap();
        let field = Field {
            name: "u".to_owned(),
            kind: FieldKind::Unknown,
            n_components: 2,
            space: FieldSpace::Nodal(space.into()),
        };
        let fields = vec![field];
        let mut numbering = Numbering::new(&fields, |_| true);
        numbering
            .fix((0..mesh.n_nodes()).filter(|k| fields[0].node_position(*k)[1] > 0.5).flat_map(|k| [2 * k, 2 * k + 1]));
        let down: Result<RegionSet, ()> = pick_facets(&mesh, &outer_boundary(&topology), |x| Ok(x[1] == 0.0));
        let mut made = Made { mesh, fields, numbering, terms: Vec::new(), frozen: Vec::new(), contact: Vec::new() };
        made.add_all(cells, PlaceKind::Cells, &RegionSet::Cells(all));
        made.add_all(floor, PlaceKind::Facets, &down.unwrap());
        made.finish()
    }

    /// A penalty with friction under linear squares.
    pub(crate) fn with_friction(n: usize) -> Self {
        Self::new(n, &[LAPLACE], &[PENALTY_WITH_FRICTION])
    }

    /// The unknowns with the floor moved by `floor` and the top by `top`, between them linear.
    pub(crate) fn moved(&self, floor: [f64; 2], top: [f64; 2]) -> Vec<f64> {
        let field = &self.system.fields[0];
        let at = |k: usize| field.node_position(k)[1];
        (0..field.n_nodes()).flat_map(|k| [0, 1].map(|c| floor[c] + at(k) * (top[c] - floor[c]))).collect()
    }
}

/// What a block is made of so far.
struct Made {
    mesh: Mesh,
    fields: Vec<Field>,
    numbering: Numbering,
    terms: Vec<AssembledTerm>,
    frozen: Vec<FrozenTerm>,
    contact: Vec<ContactTerm>,
}

impl Made {
    /// Terms at the same points.
    fn add_all(&mut self, texts: &[&str], kind: PlaceKind, set: &RegionSet) {
        let domain = Arc::new(Domain::new(&self.mesh, set, &|kind| gauss(kind, 2).unwrap()).unwrap());
        for text in texts {
            let (law, frozen) = self.compile(text, kind, set);
            if let Some(frozen) = frozen {
                self.add_contact(frozen, &domain);
            }
            let term = assembled(&self.mesh, law, &domain, &self.fields, &self.numbering.starts);
            self.terms.push(term);
        }
    }

    fn compile(&self, text: &str, kind: PlaceKind, set: &RegionSet) -> (TermLaw, Option<FrozenLaw>) {
        let sig = FieldSig {
            name: "u".to_owned(),
            shape: Shape::vector(2),
            degree: 1,
            kind: FieldKind::Unknown,
            global: false,
            on_faces: false,
        };
        let (fields, params, expansions) = ([sig], BTreeMap::new(), Expansions::default());
        let env = Env {
            dim: 2,
            fields: &fields,
            mappings: &[],
            params: &params,
            expansions: &expansions,
            step_variable: Some("t"),
            rates: &[],
            tables: &[],
            equal_within: 0.0,
        };
        let place = PlaceSig {
            name: "place".to_owned(),
            kind,
            here: vec![true],
            there: vec![false],
            entities: entity_geometries(&self.mesh, set),
            description: "a place".to_owned(),
            here_name: None,
            inside: false,
        };
        let mut sources = SourceMap::new();
        let id = sources.add("law", text);
        let parsed = parse_expr(&sources, id);
        let expr = parsed.value.unwrap_or_else(|| panic!("{:?}", parsed.diagnostics));
        let law = compile_term(&env, &place, "law", TermSource::Residual(&expr));
        let law = law.value.unwrap_or_else(|| panic!("{:?}", law.diagnostics));
        let behind = FieldId::new(1 + FrozenLaw::FIELDS * self.contact.len());
        let frozen = compile_frozen(&env, &place, "law", &law.listing, behind);
        (law, frozen)
    }

    fn add_contact(&mut self, law: FrozenLaw, domain: &Arc<Domain>) {
        let data =
            |n_components: usize, space| Field { name: String::new(), kind: FieldKind::Data, n_components, space };
        let mut fields = self.fields.clone();
        fields.resize_with(law.field.index(), || data(1, FieldSpace::Global));
        fields.push(data(law.sizes.point, FieldSpace::Points(PointSpace::new(&self.mesh, domain))));
        fields.push(data(law.sizes.term, FieldSpace::Global));
        let mut starts = self.numbering.starts.clone();
        starts.resize(fields.len(), None);
        let slopes = law.slopes();
        let watch = Value::new(law.watch, &InterpreterBackend).unwrap();
        let sampled = watch.bind(&self.mesh, domain.clone(), &fields).unwrap();
        let form = assembled(&self.mesh, law.law, domain, &fields, &starts);
        let parts = ContactParts {
            term: self.terms.len(),
            frozen: self.contact.len(),
            field: law.field.index(),
            projections: law.projections,
            law: watch,
            slopes,
            sampled,
        };
        self.contact.push(ContactTerm::new(parts, &form, &self.fields));
        self.frozen.push(FrozenTerm { term: self.terms.len(), form });
    }

    fn finish(self) -> Block {
        let Self { mesh, fields, numbering, terms, frozen, contact } = self;
        let known = Known { data: vec![Vec::new(); fields.len()], ..Known::default() };
        let mut system = System::new(mesh, fields, numbering, terms, known);
        system.add_frozen(frozen);
        system.begin_step(Window::new(1.0, 1.0)).unwrap();
        let mut contact = Contact::new(contact);
        contact.begin_step(Window::new(1.0, 1.0));
        Block { system, contact }
    }
}

fn assembled(
    mesh: &Mesh,
    law: TermLaw,
    domain: &Arc<Domain>,
    fields: &[Field],
    starts: &[Option<usize>],
) -> AssembledTerm {
    let slots = LawSlots { inputs: &law.inputs, tests: &law.tests, trials: &law.trials };
    let integrator =
        Integrator { domain: domain.clone(), binding: Arc::new(Binding::new(mesh, domain, fields, slots).unwrap()) };
    let compiled = |kernel: &VerifiedKernel| InterpreterBackend.compile(&[kernel]).unwrap().swap_remove(0);
    let tangent = tangent_kernel(&law).map(|kernel| compiled(&kernel));
    let residual = compiled(&law.residual);
    AssembledTerm::new(law, integrator, None, residual, tangent, starts)
}
