//! Explicit tensors, calls and components `e(i, :)`. Formulas of functions are in `ops/`.

use wfl::{
    Code, Diagnostic, Span,
    ast::{Argument, Expr, ExprKind},
};

use crate::{
    build::{Builder, Call, names::FieldWord},
    graph::{Arity, ExprId},
    ops,
    types::Shape,
};

impl Builder<'_> {
    pub(super) fn tensor(&mut self, e: &Expr, rows: &[Vec<Expr>]) -> Option<ExprId> {
        let mut parts: Vec<Vec<ExprId>> = Vec::new();
        let mut good = true;
        for row in rows {
            let built: Vec<Option<ExprId>> = row.iter().map(|p| self.expr(p)).collect();
            good &= built.iter().all(Option::is_some);
            parts.push(built.into_iter().flatten().collect());
        }
        if !good {
            return None;
        }
        if parts.iter().any(|r| r.len() != parts[0].len()) {
            let d = Diagnostic::new(Code::E108, "the rows of a matrix must be of one length");
            return self.report(d, e, "");
        }
        self.one_shape(&parts, rows)?;
        let inner = self.graph.shape(parts[0][0]);
        let (m, n) = (parts.len(), parts[0].len());
        // written by rows, stored with the first index fastest; one row and one column are both vectors
        let ordered: Vec<ExprId> = (0..n).flat_map(|j| (0..m).map(move |i| (i, j))).map(|(i, j)| parts[i][j]).collect();
        if inner.is_scalar_like() {
            let shape = if m == 1 || n == 1 { Shape::new(&[m * n]) } else { Shape::new(&[m, n]) };
            let Some(shape) = shape else {
                let d = Diagnostic::new(Code::E110, "this tensor is too large");
                return self.report(d, e, "");
            };
            let scalars: Vec<ExprId> = ordered.iter().map(|p| self.graph.to_scalar(*p)).collect();
            self.one_arity(e, &scalars)?;
            return Some(self.graph.stack(shape, &scalars));
        }
        if m > 1 && n > 1 {
            let d = Diagnostic::new(Code::E108, "nested lists hold one row or one column of tensors");
            return self.report(d, e, "");
        }
        let Some(shape) = inner.with_last(m * n) else {
            let d = Diagnostic::new(Code::E110, format!("a tensor has {} indices at most", crate::types::MAX_RANK));
            return self.report(d, e, "");
        };
        self.one_arity(e, &ordered)?;
        let mut entries = Vec::with_capacity(shape.len());
        for p in &ordered {
            for k in 0..inner.len() {
                entries.push(self.graph.entry(*p, k));
            }
        }
        Some(self.graph.stack(shape, &entries))
    }

    /// The parts of an explicit tensor are of one shape.
    fn one_shape(&mut self, parts: &[Vec<ExprId>], rows: &[Vec<Expr>]) -> Option<()> {
        let inner = self.graph.shape(parts[0][0]);
        for (row, texts) in parts.iter().zip(rows) {
            for (p, text) in row.iter().zip(texts) {
                let s = self.graph.shape(*p);
                // a list beside a number is no entry, whatever its length; so it is in GetFEM
                let is_list = |e: &Expr| matches!(e.kind, ExprKind::Tensor(_));
                if is_list(text) != is_list(&rows[0][0]) && (s.is_scalar_like() || inner.is_scalar_like()) {
                    let d = Diagnostic::new(Code::E108, "the parts of an explicit tensor must be of one shape");
                    return self.report(
                        d,
                        text,
                        if is_list(text) { "a list beside numbers" } else { "a number beside lists" },
                    );
                }
                if s != inner && !(s.is_scalar_like() && inner.is_scalar_like()) {
                    let d = Diagnostic::new(Code::E108, "the parts of an explicit tensor must be of one shape");
                    return self.report(d, text, s.to_string());
                }
            }
        }
        Some(())
    }

    fn one_arity(&mut self, e: &Expr, parts: &[ExprId]) -> Option<()> {
        let arities: Vec<Arity> =
            parts.iter().filter(|p| !self.graph.is_zero(**p)).map(|p| self.graph.arity(*p)).collect();
        if arities.windows(2).all(|w| w[0] == w[1]) {
            return Some(());
        }
        let d = Diagnostic::new(Code::E302, "some parts of this tensor have a test function and some have none");
        self.report(d, e, "")
    }

    pub(super) fn call(&mut self, e: &Expr, callee: &Expr, args: &[Argument]) -> Option<ExprId> {
        if let ExprKind::Name(name) = &callee.kind
            && !self.env.params.contains_key(name)
            && self.field_id(name).is_none()
        {
            if let Some(op) = ops::find(name) {
                let n = args.len();
                if n < op.least || n > op.most {
                    let expected =
                        if op.least == op.most { op.least.to_string() } else { format!("{} to {}", op.least, op.most) };
                    let plural = if expected == "1" { "" } else { "s" };
                    let d =
                        Diagnostic::new(Code::E105, format!("`{name}` takes {expected} argument{plural}, {n} given"));
                    return self.report(d, e, op.usage);
                }
                return (op.build)(self, &Call { name, expr: e, args });
            }
            if name.starts_with("Derivative_") {
                return ops::derivative_of(self, &Call { name, expr: e, args });
            }
            let is_value = FieldWord::split(name).is_some_and(|w| w.has_prefix())
                || matches!(name.as_str(), "X" | "Normal" | "Conormal" | "element_K" | "element_B");
            if !is_value {
                return self.unknown_name(callee, name);
            }
        }
        let value = self.expr(callee)?;
        self.component(e, value, args)
    }

    fn component(&mut self, e: &Expr, value: ExprId, args: &[Argument]) -> Option<ExprId> {
        let shape = self.graph.shape(value);
        let rank = shape.rank();
        if shape.is_scalar_like() && args.len() == 1 && rank == 0 {
            if let Argument::Expr(arg) = &args[0]
                && !matches!(arg.kind, ExprKind::Number(_))
            {
                let d = Diagnostic::new(Code::E104, "a number is followed by parentheses, and has no components");
                let behind = match &e.kind {
                    ExprKind::Call(name, _) if matches!(name.kind, ExprKind::Name(_)) => {
                        Some(Span { start: name.span.end, ..name.span })
                    }
                    _ => None,
                };
                let d = d.help("a product is written with `*`: a*(b)");
                return self.report(behind.into_iter().fold(d, |d, at| d.replace(at, "*")), e, "");
            }
            let index = self.index(&args[0])?;
            if index == Some(1) {
                return Some(value);
            }
        }
        if args.len() != rank {
            let d = Diagnostic::new(
                Code::E104,
                format!("{} ind{} given for a {shape}", args.len(), if args.len() == 1 { "ex" } else { "ices" }),
            );
            let text = if rank == 0 { "a scalar has no components".to_owned() } else { format!("needs {rank}") };
            return self.report(d, e, text);
        }
        let mut fixed = Vec::with_capacity(rank);
        for (k, arg) in args.iter().enumerate() {
            let size = shape.size(k);
            match self.index(arg)? {
                None => fixed.push(None),
                Some(i) if i >= 1 && i <= size => fixed.push(Some(i - 1)),
                Some(i) => {
                    let Argument::Expr(text) = arg else { return None };
                    let list: Vec<String> = (1..=size.min(6)).map(|k| k.to_string()).collect();
                    let d = Diagnostic::new(Code::E104, format!("index {i} is out of range"))
                        .note("indices start at 1, as in GWFL");
                    return self.report(d, text, format!("{shape} has the components {}", list.join(", ")));
                }
            }
        }
        Some(self.graph.pick(value, &fixed))
    }

    /// A literal index: `Some(None)` for `:`, `Some(Some(i))` for a whole number.
    fn index(&mut self, arg: &Argument) -> Option<Option<usize>> {
        match arg {
            Argument::Slice(_) => Some(None),
            Argument::Text(_, span) => {
                let d = Diagnostic::new(Code::E104, "a text is no index");
                self.diagnostics.push(d.at(*span, ""));
                None
            }
            Argument::Expr(a) => self.whole_number(a, "an index").map(Some),
        }
    }

    /// A whole number known when compiling.
    pub(crate) fn whole_number(&mut self, a: &Expr, what: &str) -> Option<usize> {
        let value = self.expr(a)?;
        let number = self.graph.scalar_constant(value);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked to be small and whole")]
        match number {
            Some(x) if (0.0..=65_535.0).contains(&x) && x.fract() == 0.0 => Some(x as usize),
            _ => {
                let d = Diagnostic::new(Code::E104, format!("{what} must be a whole number known before the run"));
                self.report(d, a, number.map_or("not constant".to_owned(), |x| format!("{x}")))
            }
        }
    }
}
