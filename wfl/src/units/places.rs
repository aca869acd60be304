//! What says where something is: ends of a box, conditions of regions and refinements, points and lines of outputs. They
//! say what unit coordinates have, where a param with a unit stands in them.

use crate::{
    ast::{BoxDivision, Expr, MeasureAt, MeshSource, Placing, RegionExpr},
    codes::Code,
    diag::Diagnostic,
    source::Span,
};

use super::{
    eval::{Pass, Strength, scale_note},
    statements::first_expr,
    unit::Unit,
};

impl Pass<'_> {
    /// All places of the scene, in a statement where plain numbers take the unit that is needed.
    pub(super) fn places(&mut self) {
        let script = self.scene.script;
        self.located = true;
        if let Some(mesh) = script.mesh.as_ref().filter(|m| m.map.is_none())
            && let MeshSource::Box { from, to, division, .. } = &mesh.source
        {
            [from, to].into_iter().for_each(|e| self.place(e));
            if let BoxDivision::Size(e) = division {
                self.place(e);
            }
        }
        let moved = script.mesh.iter().filter_map(|m| match &m.source {
            MeshSource::Files(files) => Some(files.iter().flat_map(|f| &f.placed)),
            MeshSource::Box { .. } => None,
        });
        for step in moved.flatten() {
            if let Placing::Moved(e) = step {
                self.place(e);
            }
        }
        for region in &script.regions {
            self.conditions_of(&region.region);
        }
        for condition in script.refinements.iter().filter_map(|r| r.what.condition.as_ref()) {
            self.cond(condition, first_expr(condition));
        }
        for measure in script.reductions() {
            if let MeasureAt::Point(x) = &measure.at {
                self.place(x);
            }
        }
        for output in &script.outputs {
            let ends = output.along.iter().flat_map(|(from, to)| [from, to]);
            ends.chain(&output.at).for_each(|e| self.place(e));
        }
        self.located = false;
    }

    fn conditions_of(&mut self, region: &RegionExpr) {
        match region {
            RegionExpr::Picked { condition: Some(c), .. } => self.cond(c, first_expr(c)),
            RegionExpr::Combine(first, rest) => {
                self.conditions_of(first);
                rest.iter().for_each(|(_, r)| self.conditions_of(r));
            }
            _ => {}
        }
    }

    /// A position, or a length.
    fn place(&mut self, e: &Expr) {
        let value = self.expr(e);
        let Some(unit) = value.unit().filter(|_| value.named && !value.soft).cloned() else { return };
        // a param without a unit says nothing of coordinates
        if unit.same(&Unit::pure()) {
            return;
        }
        let length = self.length();
        if self.fits(e.span, &length, &unit, Strength::Strong) {
            return;
        }
        let text = format!("a place in {}, and coordinates are in {}", unit.show(), length.show());
        let d = Diagnostic::new(Code::E501, text).at(self.scene.outer(e), unit.show());
        let from: Option<Span> = self.solved.length_from.map(|f| f.0);
        let d = match from {
            Some(span) => d.at(span, format!("coordinates in {}", length.show())),
            None => d,
        };
        self.report(scale_note(d, &length, &unit), e);
    }
}
