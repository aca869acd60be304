//! Expressions of a scene with the places on which they stand: what is under the cursor, and what a macro is where it is
//! used.

use wfl::{
    DataValue, FieldKind, ResolvedScript, Span, StartKind,
    ast::{Argument, Cond, ExpansionId, Expr, ExprKind, RegionExpr},
    cond_children,
};
use wfl_compiler::types::PlaceSig;
use wfl_problem::Sketch;

/// An expression of a statement, macros expanded.
pub(crate) struct Context<'s> {
    pub(crate) expr: &'s Expr,
    pub(crate) place: On<'s>,
}

/// Where an expression stands.
#[derive(Clone, Copy)]
pub(crate) enum On<'s> {
    /// On a region.
    Region(&'s str),
    /// At points of which only the position is known.
    Position,
}

impl On<'_> {
    pub(crate) fn sig(self, sketch: &Sketch<'_>) -> Option<PlaceSig> {
        match self {
            On::Region(name) => sketch.place(name),
            On::Position => Some(sketch.position()),
        }
    }
}

/// All expressions of a scene.
pub(crate) fn contexts(script: &ResolvedScript) -> Vec<Context<'_>> {
    let mut list = Vec::new();
    for term in &script.terms {
        let place = On::Region(term.places.first().map_or("all", |p| p.name.as_str()));
        list.push(Context { expr: &term.expr, place });
    }
    for measure in &script.measures {
        // a value at a point is that of the body that has the point
        let place = On::Region(measure.places.first().map_or("", |p| p.name.as_str()));
        list.push(Context { expr: &measure.expr, place });
    }
    for load in &script.loads {
        let place = On::Region(load.places.first().map_or("all", |p| p.name.as_str()));
        list.push(Context { expr: &load.value, place });
    }
    for item in script.outputs.iter().flat_map(|o| &o.items) {
        list.push(Context { expr: &item.expr, place: On::Region("") });
    }
    for field in &script.fields {
        match &field.kind {
            FieldKind::State { update } => list.push(Context { expr: update, place: On::Region("") }),
            FieldKind::Data { value: DataValue::Formula(e) } => list.push(Context { expr: e, place: On::Position }),
            _ => {}
        }
    }
    let at_points = |expr| Context { expr, place: On::Position };
    list.extend(script.fixes.iter().map(|f| at_points(&f.value)));
    list.extend(script.params.iter().map(|p| at_points(&p.value)));
    list.extend(script.mesh.iter().filter_map(|m| m.map.as_ref()).map(at_points));
    list.extend(script.steps.iter().flat_map(|s| [&s.from, &s.to]).map(at_points));
    list.extend(script.steps.iter().filter(|s| !s.is_auto()).map(|s| at_points(&s.by)));
    list.extend(script.starts.iter().filter_map(|s| match &s.kind {
        StartKind::Field { value, .. } | StartKind::Rate { value, .. } => Some(at_points(value)),
        StartKind::File { .. } => None,
    }));
    let mut conditions: Vec<&Cond> = script.refinements.iter().filter_map(|r| r.what.condition.as_ref()).collect();
    script.regions.iter().for_each(|r| conditions_of(&r.region, &mut conditions));
    for condition in conditions {
        cond_children(condition, &mut |e| list.push(at_points(e)));
    }
    list
}

fn conditions_of<'s>(region: &'s RegionExpr, list: &mut Vec<&'s Cond>) {
    match region {
        RegionExpr::Picked { condition, .. } => list.extend(condition),
        RegionExpr::Combine(first, rest) => {
            conditions_of(first, list);
            rest.iter().for_each(|part| conditions_of(&part.1, list));
        }
        _ => {}
    }
}

/// Calls `f` with every part of an expression and each place of a text that has its value: its own, and those of the
/// uses of macros that it is the value of, with the use.
pub(crate) fn each_place<'e>(
    script: &ResolvedScript,
    e: &'e Expr,
    f: &mut dyn FnMut(Span, &'e Expr, Option<ExpansionId>),
) {
    walk(script, e, None, f);
}

fn walk<'e>(
    script: &ResolvedScript,
    e: &'e Expr,
    outer: Option<ExpansionId>,
    f: &mut dyn FnMut(Span, &'e Expr, Option<ExpansionId>),
) {
    f(e.span, e, None);
    let mut entered = e.expansion;
    // an argument stands in the text around the use, so nothing is entered there
    while let Some(id) = entered.filter(|id| !is_within(script, outer, *id)) {
        let Some(expansion) = script.expansions.list.get(id.index()) else { break };
        f(expansion.call, e, Some(id));
        entered = expansion.parent;
    }
    each_child(e, &mut |child| walk(script, child, e.expansion, f));
}

/// True if a use is `id` or stands in the body of its macro.
fn is_within(script: &ResolvedScript, used: Option<ExpansionId>, id: ExpansionId) -> bool {
    let mut at = used;
    while let Some(here) = at {
        if here == id {
            return true;
        }
        at = script.expansions.list.get(here.index()).and_then(|e| e.parent);
    }
    false
}

fn each_child<'e>(e: &'e Expr, f: &mut dyn FnMut(&'e Expr)) {
    match &e.kind {
        ExprKind::Number(_) | ExprKind::Name(_) => {}
        ExprKind::Sum(parts) => parts.iter().for_each(|part| f(&part.1)),
        ExprKind::Product(first, rest) => {
            f(first);
            rest.iter().for_each(|part| f(&part.2));
        }
        ExprKind::Negate(a) | ExprKind::Transpose(a) => f(a),
        ExprKind::Power(a, b) => [a, b].into_iter().for_each(|e| f(e)),
        ExprKind::Call(callee, arguments) => {
            // the name of a function is no value
            if !matches!(&callee.kind, ExprKind::Name(name) if wfl::is_function(name)) {
                f(callee);
            }
            arguments.iter().for_each(|a| {
                if let Argument::Expr(e) = a {
                    f(e);
                }
            });
        }
        ExprKind::Tensor(rows) => rows.iter().flatten().for_each(f),
        ExprKind::If(condition, a, b) => {
            cond_children(condition, f);
            f(a);
            f(b);
        }
    }
}
