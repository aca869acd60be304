//! The units of `table("history.csv", t)`: those of the first line of its file. A column without one holds pure numbers,
//! as a param without one does.

use super::{
    eval::{Pass, Strength, scale_note},
    scene::read,
    unit::Unit,
    value::Value,
};
use crate::{
    ast::{Argument, Expr},
    codes::Code,
    diag::Diagnostic,
    tables::Head,
};

impl Pass<'_> {
    /// The unit of an argument. In a statement where formulas of coordinates and the step variable take the unit that is
    /// needed they keep their own here, unless plain numbers stand beside them: `min(t, 30)`.
    fn over(&mut self, argument: &Expr) -> Value {
        if !self.plain {
            return self.expr(argument);
        }
        let (told, related) = (self.diagnostics.len(), self.equations.len());
        self.plain = false;
        let value = self.expr(argument);
        self.plain = true;
        if self.diagnostics.len() == told {
            return value;
        }
        self.diagnostics.truncate(told);
        self.equations.truncate(related);
        self.expr(argument)
    }

    /// The unit of the column; the argument has that of the first column.
    pub(super) fn table(&mut self, e: &Expr, arguments: &[Argument]) -> Value {
        let [Argument::Text(file, _), Argument::Expr(argument), rest @ ..] = arguments else { return Value::lost() };
        let column = if let [Argument::Text(column, _)] = rest { Some(column.as_str()) } else { None };
        let value = self.over(argument);
        let Some(table) = self.scene.script.tables.iter().find(|t| t.name == *file) else { return Value::lost() };
        let Ok(curve) = table.curve(column) else { return Value::lost() };
        let first = unit_of(&table.heads[0]);
        // an unknown name in the file is reported once, and then fits everything
        if let (Some(needed), Some(found)) = (first, value.unit().cloned())
            && value.named
            && !self.fits(argument.span, &needed, &found, Strength::Strong)
        {
            let d = Diagnostic::new(Code::E501, format!("\"{file}\" has rows over another unit"));
            let d = d
                .at(self.scene.local(argument, e), format!("{}; the first column has {}", found.show(), needed.show()));
            let d = scale_note(d, &needed, &found);
            let told = table.heads[0].unit.is_none();
            let help = "a file names its units in the first line: t [s],q [MPa]";
            self.report(if told { d.help(help) } else { d }, e);
        }
        match table.head(curve) {
            Some(Head { unit: None, .. }) | None => Value::number(),
            Some(head) => Value::of(unit_of(head)),
        }
    }
}

fn unit_of(head: &Head) -> Option<Unit> {
    head.unit.as_ref().map_or_else(|| Some(Unit::pure()), |written| read(written, &mut Vec::new()))
}
