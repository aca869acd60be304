//! Operators on fields and places: other sides, symbolic derivatives, sizes, printing.

use wfl::{
    Code, Diagnostic,
    ast::{Expr, ExprKind},
};

use crate::{
    build::{Builder, Call},
    derive::derive,
    graph::{ExprId, Leaf, Node, Role},
    types::{FieldId, FieldOp, PlaceKind, Side},
};

/// `Hess(e)`.
pub(super) fn hessian(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (text, value) = b.argument(c, 0)?;
    let first = b.gradient(text, value)?;
    b.gradient(text, first)
}

/// `Div(e)`.
pub(super) fn divergence(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (text, value) = b.argument(c, 0)?;
    let shape = b.graph.shape(value);
    if shape.rank() == 0 || shape.size(shape.rank() - 1) != b.env.dim {
        return b.bad_argument(c, 0, text, "as many components as space has dimensions", shape);
    }
    let grad = b.gradient(text, value)?;
    Some(b.graph.trace(grad, shape.rank() - 1, shape.rank()))
}

/// `Rate(e)`: the argument is built again with the values at the end of the previous step. What does not change is left out of
/// the difference, and with it its rounding.
pub(super) fn rate(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    if b.env.step_variable.is_none() {
        let d = Diagnostic::new(Code::E206, "`Rate` needs a `steps` statement: without steps there is no past");
        return b.report(d.about("steps").missing("steps t = 0 to 1 by 0.1"), c.expr, "");
    }
    if b.in_the_past {
        return b.not_in_the_past(c.expr, "Rate");
    }
    let (text, now) = b.argument(c, 0)?;
    b.no_tests(text, now, "Rate")?;
    b.in_the_past = true;
    let before = b.argument(c, 0);
    b.in_the_past = false;
    let (_, before) = before?;
    let change = b.graph.difference(now, before);
    let step = b.graph.leaf(Leaf::TimeStep);
    Some(b.graph.divide(change, step))
}

/// `qdim(u)`.
pub(super) fn number_of_components(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let field = field_argument(b, c, 0)?;
    #[expect(clippy::cast_precision_loss, reason = "field sizes are small")]
    let n = b.env.fields[field.index()].shape.len() as f64;
    Some(b.graph.number(n))
}

/// `qdims(u)`.
pub(super) fn sizes(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let field = field_argument(b, c, 0)?;
    let sizes = b.env.fields[field.index()].shape.sizes();
    #[expect(clippy::cast_precision_loss, reason = "field sizes are small")]
    let values: Vec<f64> = if sizes.is_empty() { vec![1.0] } else { sizes.iter().map(|s| *s as f64).collect() };
    Some(b.graph.constant(crate::types::Shape::vector(values.len()), &values))
}

fn field_argument(b: &mut Builder<'_>, c: &Call<'_>, k: usize) -> Option<FieldId> {
    let text = b.argument_text(c, k)?;
    let found = match &text.kind {
        ExprKind::Name(n) => b.field_id(n.strip_prefix("Test_").unwrap_or(n)),
        _ => None,
    };
    if found.is_some() {
        return found;
    }
    let d = Diagnostic::new(Code::E106, format!("`{}` needs a field name here", c.name));
    b.report(d, text, "not a field")
}

pub(super) fn interpolate(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let word = b.argument_text(c, 0)?;
    let target = b.argument_text(c, 1)?;
    let image = reach(b, c, target, "second")?;
    match (&word.kind, image) {
        (ExprKind::Name(n), None) if n == "X" => Some(b.graph.leaf(Leaf::X)),
        (ExprKind::Name(n), Some(_)) if n == "X" => Some(b.graph.leaf(Leaf::ImageX)),
        (ExprKind::Name(n), Some(m)) if n == "Normal" => {
            let mapping = &b.env.mappings[m];
            if mapping.has_normal {
                return Some(b.graph.leaf(Leaf::Normal(Side::There)));
            }
            let d = Diagnostic::new(Code::E204, format!("the images of `{}` have no `Normal`", mapping.name));
            let text = mapping.description.clone();
            b.report(d.help("project and raytrace give points of faces"), word, text)
        }
        (ExprKind::Name(n), Some(m))
            if b.env.mappings[m].moves.is_some()
                && matches!(n.as_str(), "element_size" | "element_K" | "element_B") =>
        {
            let d = Diagnostic::new(Code::E111, format!("`{n}` at an image that moves has no derivative"));
            b.report(d.help("write a `param`, or the size of the cells of this side"), word, "it jumps between cells")
        }
        (ExprKind::Name(n), _)
            if matches!(n.as_str(), "Normal" | "Conormal" | "element_size" | "element_K" | "element_B") =>
        {
            b.geometry(word, n, Side::There)
        }
        (ExprKind::Name(n), _) => b.field_word(word, n, Side::There),
        _ => {
            let d = Diagnostic::new(Code::E106, "`Interpolate` takes a field, its gradient or its test function");
            b.report(d, word, "an expression cannot be moved: apply `Interpolate` to the fields in it")
        }
    }
}

/// The other place that a mapping names: `None` for the neighbour, else the mapping. All calls of a term reach one.
fn reach(b: &mut Builder<'_>, c: &Call<'_>, target: &Expr, which: &str) -> Option<Option<usize>> {
    let ExprKind::Name(name) = &target.kind else {
        let d = Diagnostic::new(Code::E106, format!("the {which} argument of `{}` is the name of a mapping", c.name));
        return b.report(d, target, "");
    };
    let found = if matches!(name.as_str(), "neighbor_element" | "neighbour_elt") {
        on_interface(b, c)?;
        None
    } else if let Some(m) = b.env.mappings.iter().position(|m| m.name == *name) {
        if b.place.kind == PlaceKind::Global {
            let d = Diagnostic::new(Code::E203, format!("`{name}` has nothing to map here"));
            return b.report(d, c.expr, format!("needs points; `{}` is {}", b.place.name, b.place.description));
        }
        Some(m)
    } else {
        let d = Diagnostic::new(Code::E201, format!("unknown mapping `{name}`")).about(name);
        return b.report(d, target, "a `mapping` of the scene, or `neighbor_element`, the other side of an interface");
    };
    if *b.reached.get_or_insert(found) != found {
        let d = Diagnostic::new(Code::E215, "one term has two mappings")
            .help("write one term for each mapping: the terms of a scene are added");
        return b.report(d, target, "the others in this term have another mapping");
    }
    b.graph.mapping = found;
    b.graph.moves = found.and_then(|m| b.env.mappings[m].moves);
    Some(found)
}

/// `neighbor_element` needs two sides.
fn on_interface(b: &mut Builder<'_>, c: &Call<'_>) -> Option<()> {
    if !b.place.kind.has_two_sides() {
        let d = Diagnostic::new(Code::E203, "`neighbor_element` has no neighbour here");
        let d = d.help(match b.place.inside {
            _ if b.place.kind == PlaceKind::Edges => {
                "edges between two faces of a surface have two sides: region inner = interior of fault".to_owned()
            }
            true => format!("an interface has two sides: region two_sided = interface along {}", b.place.name),
            false => "an interface region has two sides: region fault = interface from left to right".to_owned(),
        });
        let d = d.note(format!("`{}` is {}", b.place.name, b.place.description));
        return b.report(d, c.expr, "needs a region of inner faces");
    }
    Some(())
}

pub(super) fn interpolate_filter(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let target = b.argument_text(c, 0)?;
    reach(b, c, target, "first")?;
    let (_, value) = b.argument(c, 1)?;
    let code = match c.args.get(2) {
        None => 1,
        Some(_) => {
            let text = b.argument_text(c, 2)?;
            b.whole_number(text, "the code of a filter")?
        }
    };
    if code != 1 && b.graph.moves.is_some() {
        let d = Diagnostic::new(Code::E106, "of a mapping that moves `Interpolate_filter` knows the code 1 alone");
        let d = d.help("what acts everywhere is a term of its own that does not read the mapping");
        return b.report(d, c.expr, "1 is: where there is an image");
    }
    let shape = b.graph.shape(value);
    Some(if code == 1 { value } else { b.graph.zero(shape) })
}

pub(super) fn diff(b: &mut Builder<'_>, c: &Call<'_>) -> Option<ExprId> {
    let (text, value) = b.argument(c, 0)?;
    let variable = b.argument_text(c, 1)?;
    let ExprKind::Name(name) = &variable.kind else {
        let d = Diagnostic::new(Code::E106, "the second argument of `Diff` is the name of a field");
        return b.report(d, variable, "");
    };
    let field = field_argument(b, c, 1)?;
    if b.reads_moving_image(value) {
        let d = Diagnostic::new(Code::E111, "`Diff` does not reach through a mapping that moves")
            .help("write the derivative: of a gap it is the jump of the test functions along the normal");
        return b.report(d, text, "the tangent would need second variations of the image");
    }
    let direction = if c.args.len() == 3 { Some(b.argument(c, 2)?) } else { None };
    if let Some((dt, d)) = direction {
        let (found, needed) = (b.graph.shape(d), b.env.fields[field.index()].shape);
        if found != needed {
            return b.bad_argument(c, 2, dt, &format!("a {needed} like `{name}`"), found);
        }
    } else if !b.env.fields[field.index()].is_unknown() {
        let d = Diagnostic::new(Code::E304, format!("`{name}` has no test function: give a direction"))
            .help(format!("Diff(e, {name}, direction)"));
        return b.report(d, variable, "");
    }
    let grads = direction_gradients(b, value, field, direction)?;
    let role = if b.graph.arity(value).test { Role::Trial } else { Role::Test };
    let mut other_side = false;
    let result = derive(&mut b.graph, value, &mut |g, leaf| match leaf {
        Leaf::Field { field: f, side, op, role: Role::Current } if f == field => match direction {
            None => Some(g.leaf(Leaf::Field { field, side, op, role })),
            Some(_) if side == Side::There => {
                other_side = true;
                None
            }
            Some(_) => grads[op.order()],
        },
        _ => None,
    });
    if other_side {
        let d = Diagnostic::new(Code::E111, "`Diff` in a direction does not reach through `Interpolate`")
            .help("use the field alone as direction, Diff(e, u), or write the derivative");
        return b.report(d, text, "");
    }
    match result {
        Ok(d) => Some(d),
        Err(no) => b.no_derivative(text, no.what),
    }
}

/// The direction, its gradient and its Hessian, as far as the expression uses them.
fn direction_gradients(
    b: &mut Builder<'_>,
    value: ExprId,
    field: FieldId,
    direction: Option<(&Expr, ExprId)>,
) -> Option<[Option<ExprId>; 3]> {
    let mut out = [None; 3];
    let Some((text, d)) = direction else {
        return Some(out);
    };
    out[0] = Some(d);
    let mut order = 0;
    for k in 0..b.graph.len() {
        if let Node::Leaf(Leaf::Field { field: f, op, role: Role::Current, .. }) = *b.graph.node(ExprId::new(k))
            && f == field
        {
            order = order.max(op.order());
        }
    }
    let used = order.min(highest_order(b, value, field));
    for k in 1..=used {
        let previous = out[k - 1]?;
        out[k] = Some(b.gradient(text, previous)?);
    }
    Some(out)
}

/// The highest derivative of `field` that `value` depends on.
fn highest_order(b: &mut Builder<'_>, value: ExprId, field: FieldId) -> usize {
    let mut order = 0;
    for (k, op) in [FieldOp::Value, FieldOp::Grad, FieldOp::Hess].into_iter().enumerate() {
        let moved = derive(&mut b.graph, value, &mut |g, leaf| match leaf {
            Leaf::Field { field: f, op: o, role: Role::Current, .. } if f == field && o == op => Some(g.leaf(leaf)),
            _ => None,
        });
        if moved.is_ok_and(|d| !b.graph.is_zero(d)) {
            order = k;
        }
    }
    order
}
