//! Words of expressions: params, fields with their prefixes, coordinates and geometry, each checked against the place.
//!
//! What lives on the other side of an interface, and what has no gradient or test function, is told here. Functions
//! are in `parts.rs` and `ops/`.

use wfl::{Code, Diagnostic, Span, ast::Expr, nearest};

use crate::{
    build::Builder,
    graph::{ExprId, Leaf, Role},
    ops,
    types::{FieldId, FieldKind, FieldOp, PlaceKind, RateFactor, RateForm, RateOrder, Shape, Side},
};

impl Builder<'_> {
    pub(super) fn name(&mut self, e: &Expr, name: &str) -> Option<ExprId> {
        if let Some(c) = self.env.params.get(name) {
            return Some(self.graph.constant(c.shape, &c.values));
        }
        if self.field_id(name).is_some() {
            return self.field_word(e, name, Side::Here);
        }
        let component = |this: &mut Self, k: usize| {
            if k < this.env.dim {
                let x = this.graph.leaf(Leaf::X);
                Some(this.graph.pick(x, &[Some(k)]))
            } else {
                let d = Diagnostic::new(Code::E205, format!("`{name}` does not exist in {} dimensions", this.env.dim));
                this.report(d, e, "")
            }
        };
        match name {
            "pi" => return Some(self.graph.number(std::f64::consts::PI)),
            "meshdim" => {
                #[expect(clippy::cast_precision_loss, reason = "the dimension is 1 to 3")]
                return Some(self.graph.number(self.env.dim as f64));
            }
            "X" => return Some(self.graph.leaf(Leaf::X)),
            "x" => return component(self, 0),
            "y" => return component(self, 1),
            "z" => return component(self, 2),
            "Normal" | "Conormal" | "element_size" | "element_K" | "element_B" => {
                return self.geometry(e, name, Side::Here);
            }
            "timestep" => {
                if self.env.step_variable.is_none() {
                    let d = Diagnostic::new(Code::E206, "`timestep` needs a `steps` statement").about("steps");
                    return self.report(d.missing(STEPS), e, "");
                }
                if self.in_the_past {
                    return self.not_in_the_past(e, name);
                }
                return Some(self.graph.leaf(Leaf::TimeStep));
            }
            _ if Some(name) == self.env.step_variable => return Some(self.time()),
            "t" => {
                let d = Diagnostic::new(Code::E206, "`t` exists only if the scene says `steps t = ...`");
                let d = d.about("steps").missing(STEPS);
                return self.report(d, e, "");
            }
            _ => {}
        }
        if let Some(word) = FieldWord::split(name)
            && word.has_prefix()
        {
            return self.field_word(e, name, Side::Here);
        }
        if ops::find(name).is_some() {
            let d = Diagnostic::new(Code::E105, format!("`{name}` is a function and needs its arguments"))
                .help(format!("{name}(...)"));
            return self.report(d, e, "");
        }
        self.unknown_name(e, name)
    }

    pub(super) fn unknown_name<T>(&mut self, e: &Expr, name: &str) -> Option<T> {
        if wfl::UNSUPPORTED.contains(&name) {
            let d = Diagnostic::new(Code::E801, format!("`{name}` is GWFL this program does not have"))
                .help(in_place_of(name));
            return self.report(d, e, "");
        }
        let env = self.env;
        let fixed = ["pi", "meshdim", "X", "x", "y", "z", "Normal", "Conormal", "element_size", "timestep"];
        let known = env.params.keys().map(String::as_str);
        let known = known.chain(env.fields.iter().map(|f| f.name.as_str()));
        let known = known.chain(fixed).chain(env.step_variable).chain(ops::names().map(|n| -> &str { n }));
        let fields: Vec<String> = env.fields.iter().map(|f| format!("`{}`", f.name)).collect();
        let prefixed = FieldWord::split(name).is_some_and(|w| w.has_prefix()) && !fields.is_empty();
        let d = Diagnostic::new(Code::E201, format!("unknown name `{name}`")).about(root(name));
        // a word that a macro has put together stands nowhere
        let is_written = (e.span.end - e.span.start) as usize == name.len();
        let d = if is_written { d.word(Span { start: e.span.end - root(name).len() as u32, ..e.span }) } else { d };
        let mut offered = None;
        let text = match nearest(name, known) {
            _ if prefixed => format!("there is no field `{}`; the fields are {}", root(name), fields.join(", ")),
            Some(k) => {
                offered = Some(k.to_owned()).filter(|_| is_written);
                format!("did you mean `{k}`?")
            }
            None => "not a parameter, field, macro or built-in name".to_owned(),
        };
        self.report(offered.into_iter().fold(d, |d, near| d.replace(e.span, near)), e, text)
    }

    /// The field of that name.
    pub(crate) fn field_id(&self, name: &str) -> Option<FieldId> {
        self.env.fields.iter().position(|f| f.name == name).map(FieldId::new)
    }

    /// `Normal`, `element_size`, ... on a side.
    pub(crate) fn geometry(&mut self, e: &Expr, name: &str, side: Side) -> Option<ExprId> {
        let is_there = match name {
            "Conormal" => matches!(self.place.kind, PlaceKind::Edges | PlaceKind::InnerEdges),
            "Normal" => !matches!(self.place.kind, PlaceKind::Cells | PlaceKind::Global),
            _ => self.place.kind != PlaceKind::Global,
        };
        if !is_there {
            let text = match name {
                "Conormal" => "exists where faces end or meet: on `rim of` and `interior of` a surface",
                "Normal" => "exists on faces only",
                _ => "needs a cell",
            };
            let d = Diagnostic::new(Code::E204, format!("`{name}` {text}"));
            let d = d.note(format!("`{}` is {}", self.place.name, self.place.description));
            return self.report(d, e, "");
        }
        Some(self.graph.leaf(match name {
            "Normal" => Leaf::Normal(side),
            "Conormal" => Leaf::Conormal(side),
            "element_size" => Leaf::ElementSize(side),
            "element_K" => Leaf::ElementK(side),
            _ => Leaf::ElementB(side),
        }))
    }

    /// `u`, `Grad_u`, `Div_Test_u`, `Previous_u`, `Dot_u`, ... on a side.
    pub(crate) fn field_word(&mut self, e: &Expr, name: &str, side: Side) -> Option<ExprId> {
        let word = FieldWord::split(name)?;
        let Some(field) = self.field_id(word.field) else { return self.no_field(e, name, &word) };
        let sig = &self.env.fields[field.index()];
        if word.is_test() && !sig.is_unknown() {
            let kind = if sig.kind == FieldKind::State { "state" } else { "data" };
            let d = Diagnostic::new(Code::E304, format!("`{}` is {kind}, it has no test function", sig.name));
            return self.report(d, e, "only unknowns and multipliers have one");
        }
        self.has_derivative(e, field, word.op)?;
        self.lives_here(e, field, side)?;
        let role = match word.role {
            WordRole::Previous | WordRole::Dot | WordRole::Dot2 if self.in_the_past => {
                return self.not_in_the_past(e, name);
            }
            WordRole::Plain if self.in_the_past => Role::Previous,
            WordRole::Plain | WordRole::Dot | WordRole::Dot2 => Role::Current,
            WordRole::Test => Role::Test,
            WordRole::Test2 => {
                self.order2 = true;
                Role::Trial
            }
            WordRole::Previous => Role::Previous,
        };
        if matches!(word.role, WordRole::Previous | WordRole::Dot | WordRole::Dot2) && self.env.step_variable.is_none()
        {
            let d = Diagnostic::new(
                Code::E206,
                format!("`{name}` needs a `steps` statement: without steps there is no past"),
            );
            return self.report(d.about("steps").missing(STEPS), e, "");
        }
        let op = match word.op {
            WordOp::Value => FieldOp::Value,
            WordOp::Grad | WordOp::Div => FieldOp::Grad,
            WordOp::Hess => FieldOp::Hess,
        };
        let shape = sig.shape;
        let mut leaf = self.graph.leaf(Leaf::Field { field, side, op, role });
        if matches!(word.role, WordRole::Dot | WordRole::Dot2) {
            let order = if word.role == WordRole::Dot { RateOrder::First } else { RateOrder::Second };
            let of = RateOf { field, side, op, current: leaf };
            let Some(rate) = self.rate(of, order) else { return self.no_acceleration(e, name, field) };
            leaf = rate;
        }
        if word.op == WordOp::Div {
            let Some(divergence) = self.divergence(leaf, shape) else {
                let d =
                    Diagnostic::new(Code::E108, format!("`{name}` needs as many components as space has dimensions"));
                let text = format!("`{}` is a {shape}, space has {} dimensions", word.field, self.env.dim);
                return self.report(d, e, text);
            };
            return Some(divergence);
        }
        Some(leaf)
    }

    /// The step variable, or what it was at the end of the previous step.
    fn time(&mut self) -> ExprId {
        let time = self.graph.leaf(Leaf::Time);
        if !self.in_the_past {
            return time;
        }
        let step = self.graph.leaf(Leaf::TimeStep);
        self.graph.sub(time, step)
    }

    /// E461 for what has no value at the end of the previous step.
    pub(crate) fn not_in_the_past<T>(&mut self, e: &Expr, name: &str) -> Option<T> {
        let d = Diagnostic::new(Code::E461, format!("`Rate` cannot take `{name}`: it has no value one step earlier"));
        self.report(d, e, "of a state before the last one nothing is kept")
    }

    /// E208 for a derivative that the field does not have.
    fn has_derivative(&mut self, e: &Expr, field: FieldId, op: WordOp) -> Option<()> {
        let sig = &self.env.fields[field.index()];
        if op == WordOp::Hess && sig.on_faces {
            return self.no_second_gradient(e, field);
        }
        let why = match sig.kind {
            _ if op == WordOp::Value => return Some(()),
            _ if sig.global => "is one number for the whole scene",
            FieldKind::State => "lives at integration points",
            _ => return Some(()),
        };
        let d = Diagnostic::new(Code::E208, format!("`{}` {why}: it has no gradient", sig.name));
        self.report(d, e, "")
    }

    /// A rate of a field: its change over the step times a scalar of the step, and what the past gives. `None` for a
    /// second rate that the field does not have.
    ///
    /// A second rate that nothing but a zero factor multiplies is zero, so that `inertia*rho*Dot2_u` goes with
    /// `param inertia = 0`.
    ///
    /// Backward Euler has no history and its scalar is the inverse of the increment: it needs neither a scalar nor a
    /// history of its own, so a scene with it keeps and computes nothing else than the past.
    fn rate(&mut self, of: RateOf, order: RateOrder) -> Option<ExprId> {
        let RateOf { field, side, op, current } = of;
        let form = self.env.rates.get(field.index()).copied().unwrap_or_default();
        let factor = match (order, form) {
            (RateOrder::First, RateForm::Difference) => None,
            (RateOrder::First, RateForm::First) => Some(RateFactor::Rate),
            (RateOrder::First, RateForm::Second) => Some(RateFactor::Velocity),
            (RateOrder::Second, RateForm::Second) => Some(RateFactor::Acceleration),
            (RateOrder::Second, _) if self.without_effect => {
                let shape = self.graph.shape(current);
                return Some(self.graph.zero(shape));
            }
            (RateOrder::Second, _) => return None,
        };
        let past = self.graph.leaf(Leaf::Field { field, side, op, role: Role::Previous });
        let change = self.graph.sub(current, past);
        let Some(factor) = factor else {
            let step = self.graph.leaf(Leaf::TimeStep);
            return Some(self.graph.divide(change, step));
        };
        let factor = self.graph.leaf(Leaf::RateFactor(factor));
        let change = self.graph.scale(factor, change);
        let history = self.graph.leaf(Leaf::Field { field, side, op, role: Role::History(order) });
        Some(self.graph.add(change, history))
    }

    /// A second rate of a field that has none.
    fn no_acceleration<T>(&mut self, e: &Expr, name: &str, field: FieldId) -> Option<T> {
        let sig = &self.env.fields[field.index()];
        let d = Diagnostic::new(Code::E451, format!("`{name}` has no value: the equations do not determine it"));
        let text = if sig.is_unknown() {
            format!("no term has `Dot2_{}`", sig.name)
        } else {
            format!("`{}` is not solved for; only unknowns and multipliers have a second rate", sig.name)
        };
        self.report(d, e, text)
    }

    /// The trace of the gradient of a field of this shape, if it has one.
    fn divergence(&mut self, gradient: ExprId, shape: Shape) -> Option<ExprId> {
        let rank = shape.rank();
        if rank == 0 {
            // on a line a scalar is a vector of one component
            return (self.env.dim == 1).then(|| self.graph.entry(gradient, 0));
        }
        (shape.size(rank - 1) == self.env.dim).then(|| self.graph.trace(gradient, rank - 1, rank))
    }

    /// A word that needs a field where there is none of that name.
    fn no_field(&mut self, e: &Expr, name: &str, word: &FieldWord<'_>) -> Option<ExprId> {
        let Some(number) = self.env.params.get(word.field).filter(|_| word.has_prefix()) else {
            return self.unknown_name(e, name);
        };
        let of_scene = number.declared.is_some();
        let kind = if of_scene { "a param" } else { "a number of the run" };
        if word.is_test() {
            let d = Diagnostic::new(Code::E304, format!("`{}` is {kind}, it has no test function", word.field));
            return self.report(d, e, "only unknowns and multipliers have one");
        }
        let what = name.strip_suffix(word.field).unwrap_or(name).trim_end_matches('_');
        let d = Diagnostic::new(Code::E106, format!("`{what}_` needs a field name, but `{}` is {kind}", word.field));
        let d = if of_scene { d } else { d.help("a measure of the fields has it: mean(u - Previous_u) on all") };
        self.report(d, e, if of_scene { "" } else { "measures have one value at the end of each step" })
    }

    fn lives_here(&mut self, e: &Expr, field: FieldId, side: Side) -> Option<()> {
        let sig = &self.env.fields[field.index()];
        if sig.global {
            return Some(());
        }
        let image = self.graph.mapping.filter(|_| side == Side::There).map(|m| &self.env.mappings[m]);
        let lives = match (side, image) {
            (Side::Here, _) => self.place.here[field.index()],
            (Side::There, Some(mapping)) => mapping.there[field.index()],
            (Side::There, None) => self.place.there[field.index()],
        };
        if lives {
            return Some(());
        }
        let name = &sig.name;
        if let Some(mapping) = image {
            let d = Diagnostic::new(Code::E202, format!("`{name}` does not live at the images of `{}`", mapping.name));
            return self.report(d, e, mapping.description.clone());
        }
        let place = &self.place.name;
        if self.place.kind == PlaceKind::Global {
            let d = Diagnostic::new(Code::E202, format!("`{name}` varies in space, but this term is on `global`"))
                .about(name);
            return self.report(d, e, "only numbers and global unknowns have one value");
        }
        let other = match side {
            Side::Here => self.place.there[field.index()],
            Side::There => self.place.here[field.index()],
        };
        let d = if self.place.kind.has_two_sides() && other {
            let d =
                Diagnostic::new(Code::E202, format!("`{name}` does not live on this side of `{place}`")).about(name);
            match side {
                Side::Here => d.help(format!("Interpolate({name}, neighbor_element) is the trace from the other side")),
                Side::There => d.help(format!("`{name}` alone is the trace from this side")),
            }
        } else {
            Diagnostic::new(Code::E202, format!("`{name}` does not live on `{place}`")).about(name)
        };
        let text = match (&self.place.here_name, other) {
            (Some(here), true) => format!("`{place}` is integrated from `{here}`"),
            _ => format!("`{place}` is {}", self.place.description),
        };
        self.report(d, e, text)
    }
}

/// What a rate is taken of.
#[derive(Clone, Copy)]
struct RateOf {
    field: FieldId,
    side: Side,
    op: FieldOp,
    /// The leaf of the current state.
    current: ExprId,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum WordOp {
    Value,
    Grad,
    Hess,
    Div,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum WordRole {
    Plain,
    Test,
    Test2,
    Previous,
    Dot,
    Dot2,
}

/// `Grad_Test_u` in its parts.
pub(super) struct FieldWord<'n> {
    op: WordOp,
    role: WordRole,
    field: &'n str,
}

impl<'n> FieldWord<'n> {
    pub(super) fn split(name: &'n str) -> Option<Self> {
        let (op, rest) = [("Grad_", WordOp::Grad), ("Hess_", WordOp::Hess), ("Div_", WordOp::Div)]
            .iter()
            .find_map(|(p, op)| name.strip_prefix(p).map(|r| (*op, r)))
            .unwrap_or((WordOp::Value, name));
        let (role, field) = [
            ("Test_", WordRole::Test),
            ("Test2_", WordRole::Test2),
            ("Previous_", WordRole::Previous),
            ("Dot_", WordRole::Dot),
            ("Dot2_", WordRole::Dot2),
        ]
        .iter()
        .find_map(|(p, role)| rest.strip_prefix(p).map(|r| (*role, r)))
        .unwrap_or((WordRole::Plain, rest));
        (!field.is_empty()).then_some(Self { op, role, field })
    }

    pub(super) fn has_prefix(&self) -> bool {
        self.op != WordOp::Value || self.role != WordRole::Plain
    }

    fn is_test(&self) -> bool {
        matches!(self.role, WordRole::Test | WordRole::Test2)
    }
}

/// What makes a step variable.
const STEPS: &str = "steps t = 0 to 1 by 0.1";

/// The name behind prefixes.
fn root(name: &str) -> &str {
    FieldWord::split(name).map_or(name, |w| w.field)
}

/// What to write in place of a word of GWFL that is left out.
fn in_place_of(name: &str) -> &'static str {
    if name.starts_with("Xfem") {
        return "a crack that follows faces: region crack = interface along s, and: split u across crack";
    }
    "`wfl explain E801` lists what is left out and what to write in its place"
}
