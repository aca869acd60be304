//! Tensor graphs as text, in the notation of the language.
//!
//! Nodes used more than once and large enough get a name (`e1 = ...`), so the text stays as small as the graph.

use std::{collections::BTreeMap, fmt::Write as _};

use crate::{
    compare::Compare,
    graph::{ExprId, Function1, Graph, Leaf, Node, Role},
    math::MatrixFn,
    types::{FieldOp, FieldSig, RateFactor, RateOrder, Side},
};

/// One expression with its shared parts named: `e1 = ...` lines, then the expression itself.
#[must_use]
pub fn expression_text(graph: &Graph, root: ExprId, fields: &[FieldSig]) -> String {
    let mut uses: BTreeMap<ExprId, usize> = BTreeMap::new();
    let mut seen = vec![false; graph.len()];
    seen[root.index()] = true;
    for k in (0..=root.index()).rev() {
        if seen[k] {
            graph.node(ExprId::new(k)).for_each_operand(|o| {
                seen[o.index()] = true;
                *uses.entry(o).or_default() += 1;
            });
        }
    }
    let mut printer = Printer { graph, fields, names: BTreeMap::new() };
    let mut out = String::new();
    for (k, seen) in seen.iter().enumerate().take(root.index()) {
        let e = ExprId::new(k);
        if *seen && uses.get(&e).is_some_and(|n| *n > 1) && !is_small(graph, e) {
            let text = printer.text(e, 0);
            let name = format!("e{}", printer.names.len() + 1);
            let kind = if graph.is_mask(e) { "condition".to_owned() } else { graph.shape(e).to_string() };
            let _ = writeln!(out, "  {name} = {text}    # {kind}");
            printer.names.insert(e, name);
        }
    }
    let _ = writeln!(out, "  {}", printer.text(root, 0));
    out
}

/// Every node, one a line, with shape, what it changes with and the test functions in it.
#[must_use]
pub fn graph_text(graph: &Graph, fields: &[FieldSig]) -> String {
    let mut out = String::new();
    for k in 0..graph.len() {
        let e = ExprId::new(k);
        let printer = Printer { graph, fields, names: (0..k).map(|i| (ExprId::new(i), format!("%{i}"))).collect() };
        let shape = if graph.is_mask(e) { "condition".to_owned() } else { graph.shape(e).to_string() };
        let d = graph.depends(e);
        let mut notes = Vec::new();
        for (yes, word) in
            [(graph.arity(e).test, "test"), (graph.arity(e).trial, "trial"), (d.unknown, "unknown"), (d.step, "step")]
        {
            if yes {
                notes.push(word);
            }
        }
        let _ = writeln!(out, "  %{k}: {shape} = {}    # {}", printer.text(e, 0), notes.join(" "));
    }
    out
}

fn is_small(graph: &Graph, e: ExprId) -> bool {
    match graph.node(e) {
        Node::Const(_) | Node::Leaf(_) => true,
        Node::Neg(a) | Node::Reshape(a) => is_small(graph, *a),
        Node::Pick(a, _) => matches!(graph.node(*a), Node::Leaf(_)),
        _ => false,
    }
}

struct Printer<'a> {
    graph: &'a Graph,
    fields: &'a [FieldSig],
    names: BTreeMap<ExprId, String>,
}

/// Binding strength of the place an expression is printed in: 0 any, 1 summand, 2 factor, 3 operand of a call or sign.
impl Printer<'_> {
    fn text(&self, e: ExprId, strength: u8) -> String {
        if let Some(name) = self.names.get(&e) {
            return name.clone();
        }
        let (own, text) = self.bare(e);
        if own < strength { format!("({text})") } else { text }
    }

    fn two(&self, a: ExprId, op: &str, b: ExprId, own: u8) -> (u8, String) {
        (own, format!("{}{op}{}", self.text(a, own), self.text(b, own + 1)))
    }

    fn call(&self, name: &str, args: &[ExprId]) -> (u8, String) {
        let list: Vec<String> = args.iter().map(|a| self.text(*a, 0)).collect();
        (3, format!("{name}({})", list.join(", ")))
    }

    fn bare(&self, e: ExprId) -> (u8, String) {
        let g = self.graph;
        match g.node(e) {
            Node::Const(_) => (3, self.constant(e)),
            Node::Leaf(leaf) => (3, self.leaf(*leaf)),
            Node::Add(a, b) => self.two(*a, " + ", *b, 1),
            Node::Sub(a, b) => self.two(*a, " - ", *b, 1),
            Node::Neg(a) => (2, format!("-{}", self.text(*a, 3))),
            Node::Scale(a, b) => self.two(*a, "*", *b, 2),
            Node::Divide(a, b) => self.two(*a, "/", *b, 2),
            Node::MulComponents(a, b) => self.two(*a, ".*", *b, 2),
            Node::DivComponents(a, b) => self.two(*a, "./", *b, 2),
            Node::Contract(a, b, axes) => self.contract(*a, *b, axes),
            Node::Trace(a, 0, 1) if g.shape(*a).rank() == 2 => self.call("Trace", &[*a]),
            Node::Reshape(a) if g.shape(e).rank() == 0 => self.bare(*a),
            Node::Trace(..) | Node::Permute(..) | Node::Reshape(_) | Node::Pick(..) | Node::Stack(_) => {
                (3, self.rearranged(e))
            }
            Node::Map(Function1::Sqrt, a) => self.call("sqrt", &[*a]),
            Node::Map(Function1::Math(f), a) => self.call(f.name(), &[*a]),
            Node::Lookup(curve, reading, a) => (3, format!("{}({}, {})", reading.name(), curve.name, self.text(*a, 0))),
            Node::Map2(f, a, b) => self.call(f.name(), &[*a, *b]),
            Node::Compare(op, a, b) => {
                let op = match op {
                    Compare::Less => " < ",
                    Compare::LessEqual => " <= ",
                    Compare::Equal => " == ",
                    Compare::NotEqual => " != ",
                };
                (0, format!("{}{op}{}", self.text(*a, 1), self.text(*b, 1)))
            }
            Node::And(a, b) => self.two(*a, " and ", *b, 0),
            Node::Or(a, b) => self.two(*a, " or ", *b, 0),
            Node::Not(a) => (0, format!("not {}", self.text(*a, 3))),
            Node::Select(m, a, b) => self.select(*m, *a, *b),
            Node::Norm(a) => self.call("Norm", &[*a]),
            Node::Unit(a) => self.call("Normalized", &[*a]),
            Node::Ball(v, r) => self.call("Ball_projection", &[*v, *r]),
            Node::InBall(v, r) => (0, format!("Norm({}) <= {}", self.text(*v, 0), self.text(*r, 1))),
            Node::BallRatio(v, r) => (3, format!("min({}/Norm({}), 1)", self.text(*r, 2), self.text(*v, 0))),
            Node::Det(a) => self.call("Det", &[*a]),
            Node::Inverse(a) => self.call("Inv", &[*a]),
            Node::Matrix(f, a) => {
                let name = match f {
                    MatrixFn::Expm => "Expm",
                    MatrixFn::Logm => "Logm",
                    MatrixFn::ExpmDerivative => "Derivative_Expm",
                    MatrixFn::LogmDerivative => "Derivative_Logm",
                };
                self.call(name, &[*a])
            }
            Node::Print(a) => self.call("Print", &[*a]),
        }
    }

    /// Entries of a tensor in another arrangement.
    fn rearranged(&self, e: ExprId) -> String {
        let g = self.graph;
        let sizes: Vec<String> = g.shape(e).sizes().iter().map(usize::to_string).collect();
        match g.node(e) {
            Node::Trace(a, i, j) => format!("Contract({}, {}, {})", self.text(*a, 0), i + 1, j + 1),
            Node::Permute(a, perm) if perm == &[1, 0] => format!("{}'", self.text(*a, 3)),
            Node::Permute(a, perm) => {
                let list: Vec<String> = perm.iter().map(|p| (p + 1).to_string()).collect();
                format!("Permute({}, {})", self.text(*a, 0), list.join(", "))
            }
            Node::Pick(a, fixed) => {
                let list: Vec<String> =
                    fixed.iter().map(|f| f.map_or(":".to_owned(), |i| (i + 1).to_string())).collect();
                format!("{}({})", self.text(*a, 3), list.join(","))
            }
            Node::Stack(parts) => {
                let list: Vec<String> = parts.iter().map(|p| self.text(*p, 0)).collect();
                let flat = format!("[{}]", list.join("; "));
                if sizes.len() == 1 { flat } else { format!("Reshape({flat}, {})", sizes.join(", ")) }
            }
            Node::Reshape(a) => format!("Reshape({}, {})", self.text(*a, 0), sizes.join(", ")),
            _ => self.text(e, 0),
        }
    }

    fn contract(&self, a: ExprId, b: ExprId, axes: &[(u8, u8)]) -> (u8, String) {
        let (m, n) = (self.graph.shape(a).rank(), self.graph.shape(b).rank());
        let axes: Vec<(usize, usize)> = axes.iter().map(|(i, j)| (usize::from(*i), usize::from(*j))).collect();
        match axes.as_slice() {
            [] => self.two(a, "@", b, 2),
            [(i, 0)] if *i + 1 == m => self.two(a, if m == 2 && n <= 2 { "*" } else { "." }, b, 2),
            [(i, 0), (j, 1)] if m >= 2 && *i + 2 == m && *j + 1 == m => self.two(a, ":", b, 2),
            _ => {
                let list: Vec<String> = axes.iter().map(|(i, j)| format!("{}~{}", i + 1, j + 1)).collect();
                (3, format!("Contract({}, {}, {})", self.text(a, 0), self.text(b, 0), list.join(", ")))
            }
        }
    }

    fn select(&self, m: ExprId, a: ExprId, b: ExprId) -> (u8, String) {
        if let Node::Compare(Compare::LessEqual, zero, t) = self.graph.node(m)
            && self.graph.is_zero(*zero)
            && *t == a
            && self.graph.is_zero(b)
        {
            return self.call("pos_part", &[a]);
        }
        (0, format!("if {} then {} else {}", self.text(m, 0), self.text(a, 1), self.text(b, 1)))
    }

    fn constant(&self, e: ExprId) -> String {
        let values = self.graph.constant_value(e).expect("called on constants");
        let shape = self.graph.shape(e);
        let one = |v: f64| if v.fract() == 0.0 && v.abs() < 1e9 { format!("{v}") } else { format!("{v:?}") };
        if shape.rank() == 0 {
            return one(values[0]);
        }
        if values.iter().all(|v| *v == 0.0) {
            return format!("0[{shape}]");
        }
        if shape.rank() == 2 && shape.size(0) == shape.size(1) {
            let n = shape.size(0);
            let d = values[0];
            if values.iter().enumerate().all(|(k, v)| *v == if k % (n + 1) == 0 { d } else { 0.0 }) {
                return if d == 1.0 { format!("Id({n})") } else { format!("({}*Id({n}))", one(d)) };
            }
        }
        let list: Vec<String> = values.iter().map(|v| one(*v)).collect();
        format!("[{}]", list.join("; "))
    }

    fn leaf(&self, leaf: Leaf) -> String {
        let on = |text: String, side: Side| {
            if side == Side::There { format!("Interpolate({text}, neighbor_element)") } else { text }
        };
        match leaf {
            Leaf::Field { field, side, op, role } => {
                let prefix = match op {
                    FieldOp::Value => "",
                    FieldOp::Grad => "Grad_",
                    FieldOp::Hess => "Hess_",
                };
                let role = match role {
                    Role::Current => "",
                    Role::Previous => "Previous_",
                    Role::History(RateOrder::First) => "Past_Dot_",
                    Role::History(RateOrder::Second) => "Past_Dot2_",
                    Role::Test => "Test_",
                    Role::Trial => "Test2_",
                };
                on(format!("{prefix}{role}{}", self.fields[field.index()].name), side)
            }
            Leaf::X => "X".to_owned(),
            Leaf::ImageX => on("X".to_owned(), Side::There),
            Leaf::ImageShift => "image_shift".to_owned(),
            Leaf::ImageSlope => "image_slope".to_owned(),
            Leaf::Normal(side) => on("Normal".to_owned(), side),
            Leaf::Conormal(side) => on("Conormal".to_owned(), side),
            Leaf::ElementSize(side) => on("element_size".to_owned(), side),
            Leaf::ElementK(side) => on("element_K".to_owned(), side),
            Leaf::ElementB(side) => on("element_B".to_owned(), side),
            Leaf::Time => "t".to_owned(),
            Leaf::TimeStep => "timestep".to_owned(),
            Leaf::RateFactor(RateFactor::Rate) => "rate_factor".to_owned(),
            Leaf::RateFactor(RateFactor::Velocity) => "velocity_factor".to_owned(),
            Leaf::RateFactor(RateFactor::Acceleration) => "acceleration_factor".to_owned(),
        }
    }
}
