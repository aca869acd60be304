//! Shapes and the signatures by which the compiler knows fields and places.
//!
//! The compiler never sees a mesh: a field is its shape and degree, a place says which fields live on its two sides.

use std::fmt;

use crate::ir::Origin;

wfl::define_index! {
    /// A field of the scene (unknown, multiplier, data or state), in order of declaration.
    FieldId,
}

/// Most indices a tensor may have, test functions not counted.
pub const MAX_RANK: usize = 6;

/// Entries of a tensor at most: every entry is a formula of its own. Six indices in 4-D are 4096.
pub const MAX_ENTRIES: usize = 10_000;

/// The sizes of a tensor's indices. Entries are stored with the first index fastest.
#[derive(Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Shape {
    rank: u8,
    sizes: [u16; MAX_RANK],
}

impl Shape {
    /// No index.
    pub const SCALAR: Shape = Shape { rank: 0, sizes: [0; MAX_RANK] };

    /// A shape of the given sizes; `None` if there are more than [`MAX_RANK`], one is 0, or the tensor would have more
    /// than [`MAX_ENTRIES`] entries.
    #[must_use]
    pub fn new(sizes: &[usize]) -> Option<Self> {
        if sizes.len() > MAX_RANK {
            return None;
        }
        let mut shape = Shape { rank: u8::try_from(sizes.len()).ok()?, sizes: [0; MAX_RANK] };
        for (slot, &n) in shape.sizes.iter_mut().zip(sizes) {
            *slot = u16::try_from(n).ok().filter(|&n| n > 0)?;
        }
        let entries = sizes.iter().try_fold(1usize, |product, n| product.checked_mul(*n))?;
        if entries > MAX_ENTRIES {
            return None;
        }
        Some(shape)
    }

    /// A vector.
    #[must_use]
    pub fn vector(n: usize) -> Self {
        Self::new(&[n]).expect("vector sizes are small")
    }

    /// A matrix.
    #[must_use]
    pub fn matrix(m: usize, n: usize) -> Self {
        Self::new(&[m, n]).expect("matrix sizes are small")
    }

    /// Number of indices.
    #[must_use]
    pub fn rank(&self) -> usize {
        usize::from(self.rank)
    }

    /// Size of index `i`.
    #[must_use]
    pub fn size(&self, i: usize) -> usize {
        usize::from(self.sizes[i])
    }

    /// All sizes.
    #[must_use]
    pub fn sizes(&self) -> Vec<usize> {
        (0..self.rank()).map(|i| self.size(i)).collect()
    }

    /// Number of entries.
    #[must_use]
    pub fn len(&self) -> usize {
        (0..self.rank()).map(|i| self.size(i)).product()
    }

    /// Never true: every tensor has an entry.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        false
    }

    /// True for one entry, whatever the rank: such tensors stand for scalars.
    #[must_use]
    pub fn is_scalar_like(&self) -> bool {
        self.len() == 1
    }

    /// This shape with one more index at the end; `None` past [`MAX_RANK`].
    #[must_use]
    pub fn with_last(&self, n: usize) -> Option<Self> {
        let mut sizes = self.sizes();
        sizes.push(n);
        Self::new(&sizes)
    }

    /// Step in the entries for a step in index `i`.
    #[must_use]
    pub fn stride(&self, i: usize) -> usize {
        (0..i).map(|k| self.size(k)).product()
    }

    /// The position of the entry with these indices (from 0).
    #[must_use]
    pub fn position(&self, indices: &[usize]) -> usize {
        indices.iter().enumerate().map(|(k, &i)| i * self.stride(k)).sum()
    }

    /// The indices (from 0) of the entry at `position`.
    #[must_use]
    pub fn indices(&self, mut position: usize) -> Vec<usize> {
        (0..self.rank())
            .map(|k| {
                let i = position % self.size(k);
                position /= self.size(k);
                i
            })
            .collect()
    }
}

impl fmt::Display for Shape {
    /// `scalar`, `vector(3)`, `matrix(3,3)`, `tensor(2,2,2)`: the words of every message.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = self.sizes().iter().map(usize::to_string).collect::<Vec<_>>().join(",");
        match self.rank() {
            0 => write!(f, "scalar"),
            1 => write!(f, "vector({list})"),
            2 => write!(f, "matrix({list})"),
            _ => write!(f, "tensor({list})"),
        }
    }
}

impl fmt::Debug for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self}")
    }
}

/// The two sides of an interface; places without a second side know `Here` only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Side {
    /// The side that owns the place; `Normal` points out of it.
    Here,
    /// The neighbour.
    There,
}

/// What is taken of a field at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum FieldOp {
    /// The value.
    Value,
    /// The gradient: one more index, the direction.
    Grad,
    /// Second derivatives: two more indices.
    Hess,
}

impl FieldOp {
    /// Number of direction indices.
    #[must_use]
    pub fn order(self) -> usize {
        match self {
            FieldOp::Value => 0,
            FieldOp::Grad => 1,
            FieldOp::Hess => 2,
        }
    }
}

/// What a field is to the solver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum FieldKind {
    /// Solved for.
    Unknown,
    /// Solved for; degrees of freedom that cannot act are dropped.
    Multiplier,
    /// Known.
    Data,
    /// Known at integration points, renewed after each step.
    State,
}

/// A field as the compiler knows it.
#[derive(Clone, Debug)]
pub struct FieldSig {
    /// Its name.
    pub name: String,
    /// Its shape; the mesh-dependent parts (`vector`) already filled in.
    pub shape: Shape,
    /// Polynomial degree; 0 for global fields.
    pub degree: usize,
    /// Unknown, multiplier, data or state.
    pub kind: FieldKind,
    /// One value for the whole scene.
    pub global: bool,
    /// Its nodes are on faces alone: its gradient is the one along the face.
    pub on_faces: bool,
}

impl FieldSig {
    /// True if the solver looks for it, so that it has test functions.
    #[must_use]
    pub fn is_unknown(&self) -> bool {
        matches!(self.kind, FieldKind::Unknown | FieldKind::Multiplier)
    }
}

/// What a place is made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PlaceKind {
    /// Cells.
    Cells,
    /// Facets with one side.
    Facets,
    /// Facets with two sides.
    Interface,
    /// Edges of facets: lines in space, points in the plane.
    Edges,
    /// The same between two facets, with two sides.
    InnerEdges,
    /// No place: global unknowns and numbers only.
    Global,
}

impl PlaceKind {
    /// True where fields have values on two sides.
    #[must_use]
    pub fn has_two_sides(self) -> bool {
        matches!(self, Self::Interface | Self::InnerEdges)
    }
}

/// The shape of the cells or faces that integrals are taken over.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct EntityGeometry {
    /// The cells are tensor products of lines, whose gradients keep the full degree, or wedges or pyramids, of which each
    /// direction of the reference cell has at most the degrees of such a product; else simplices.
    pub tensor: bool,
    /// Dimension of the cells or faces themselves.
    pub dim: usize,
    /// Degree of the map from the reference entity, in each variable on tensor products; 0 if it is affine.
    pub order: usize,
}

impl EntityGeometry {
    /// Degree of the determinant of the map on cells, of the normal times the measure on faces; `degree.rs` has the
    /// derivation.
    #[must_use]
    pub fn measure_degree(self) -> usize {
        match (self.order, self.tensor) {
            (0, _) => 0,
            (order, true) => (order * self.dim).saturating_sub(1),
            (order, false) => (order - 1) * self.dim,
        }
    }
}

/// A place as the compiler knows it.
#[derive(Clone, Debug)]
pub struct PlaceSig {
    /// Its name in the scene.
    pub name: String,
    /// Cells, facets, interface or global.
    pub kind: PlaceKind,
    /// One entry per field: it lives on the side `Here`.
    pub here: Vec<bool>,
    /// One entry per field: it lives on the side `There`.
    pub there: Vec<bool>,
    /// The shapes of its cells or faces, each once, for the degree of quadrature rules.
    pub entities: Vec<EntityGeometry>,
    /// What it is in words, for messages: `32 facets of the outer boundary`.
    pub description: String,
    /// Name of the cell region on the side `Here` of an interface, for messages.
    pub here_name: Option<String>,
    /// Faces with one side that have cells on both, for messages: an interface along them exists.
    pub inside: bool,
}

/// What the image of a point is, where images move.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageBy {
    /// Where the ray along the current normal of the point meets the faces: `raytrace`.
    Ray,
    /// The closest point of the faces, also on their edges and corners: `project`.
    Closest,
}

/// The displacements that the images of a mapping follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moves {
    /// How images are found.
    pub by: ImageBy,
    /// Of the body whose points are mapped.
    pub here: FieldId,
    /// Of the body that the images belong to.
    pub there: FieldId,
}

/// A mapping as the compiler knows it: to each point of a place another point, where fields can be read.
#[derive(Clone, Debug)]
pub struct MappingSig {
    /// Its name in the scene.
    pub name: String,
    /// One entry per field: it lives at the images.
    pub there: Vec<bool>,
    /// The images lie on faces, which have normals.
    pub has_normal: bool,
    /// The displacements that the images follow; `None` where they are found once.
    pub moves: Option<Moves>,
    /// What it is in words, for messages.
    pub description: String,
}

/// One number that a point law reads, or whose test or trial function it multiplies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BasisSlot {
    /// The field.
    pub field: FieldId,
    /// Its side.
    pub side: Side,
    /// Value, gradient or Hessian.
    pub op: FieldOp,
    /// Entry of the tensor `shape x direction indices`, first index fastest.
    pub entry: u16,
}

/// One number that a point law reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum InputSlot {
    /// A field at the current state.
    Field(BasisSlot),
    /// A field at the end of the previous step.
    Previous(BasisSlot),
    /// The part of a rate of a field that the past alone gives.
    History(RateOrder, BasisSlot),
    /// A coordinate of the point.
    X(u8),
    /// A coordinate of its image under the mapping of the law.
    ImageX(u8),
    /// An entry of the symmetric matrix that gives the shift of the image under a mapping that moves, see `image.rs`: of
    /// row i and column j >= i that is entry `j (j + 1)/2 + i`.
    ImageShift(u8),
    /// An entry of the derivative of the outward unit normal at the image along its face, first index fastest.
    ImageSlope(u8),
    /// A component of the outward unit normal of a side.
    Normal(Side, u8),
    /// A component of the unit vector in a face of a side that points out of it at its edge.
    Conormal(Side, u8),
    /// The size of the cell: smallest singular value of the gradient of the map (largest over its nodes) times the root
    /// of the space dimension, as GetFEM's `element_size`.
    ElementSize(Side),
    /// An entry of the gradient of the geometric map, N by P, first index fastest.
    ElementK(Side, u8),
    /// An entry of its transposed inverse.
    ElementB(Side, u8),
}

/// One number that is the same everywhere and may change from step to step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum UniformSlot {
    /// The variable of `steps`.
    Time,
    /// Its increment from the previous step.
    TimeStep,
    /// What multiplies the change of a field over the step in one of its rates.
    Rate(RateFactor),
}

/// A rate of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RateOrder {
    /// `Dot_u`.
    First,
    /// `Dot2_u`.
    Second,
}

/// The scalars of a step that rates are made with. Schemes treat a field whose second rate is in the equations otherwise
/// than one with a first rate only, so each has its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RateFactor {
    /// Of `Dot_u` where the equations have no `Dot2_u`; 1/time.
    Rate,
    /// Of `Dot_u` where they have; 1/time.
    Velocity,
    /// Of `Dot2_u`; 1/time^2.
    Acceleration,
}

/// What `Dot_u` and `Dot2_u` of a field are compiled to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RateForm {
    /// `Dot_u = (u - Previous_u)/timestep`, nothing else is kept; there is no `Dot2_u`.
    #[default]
    Difference,
    /// `Dot_u = c*(u - Previous_u) + history` with [`RateFactor::Rate`]; there is no `Dot2_u`.
    First,
    /// The same with [`RateFactor::Velocity`], and `Dot2_u` with [`RateFactor::Acceleration`].
    Second,
}

/// A value with the place of the text it came from.
#[derive(Clone, Copy, Debug)]
pub struct Located<T> {
    /// The value.
    pub value: T,
    /// Its place, where there is one.
    pub origin: Option<Origin>,
}
