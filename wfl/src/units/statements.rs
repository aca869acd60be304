//! The statements of a scene, each with the units its values need.

use crate::{
    ast::{Expr, Ident, OptionValue, Place, Rank, Reduction},
    codes::Code,
    diag::Diagnostic,
    script::{Condition, DataValue, Field, FieldKind, Measure, StartKind, Term},
    source::Span,
    walk::each_name,
    words::split_prefixes,
};

use super::{
    eval::{Pass, Strength, scale_note},
    unit::{Ratio, Unit},
    value::Value,
};

/// The unit of the first term with a test function, with the place of the term.
struct Total {
    test: String,
    unit: Unit,
    at: Span,
    /// Of a part whose own unit is not all known.
    soft: bool,
    /// Terms do not fit, which was told.
    told: bool,
}

impl<'s> Pass<'s> {
    /// Walks over the whole scene.
    pub(super) fn statements(&mut self) {
        let script = self.scene.script;
        self.plain = true;
        self.params();
        self.fields();
        for start in &script.starts {
            match &start.kind {
                StartKind::Field { field, value } => self.given(field, value),
                StartKind::Rate { field, value } => self.given_rate(field, value),
                StartKind::File { .. } => {}
            }
        }
        for fix in &script.fixes {
            for target in &fix.targets {
                self.given(&target.field, &fix.value);
            }
        }
        self.range_of_steps();
        self.places();
        self.plain = false;
        self.watched();
        self.states();
        self.sum_of_terms();
        self.measures();
        for expect in &script.expects {
            let owner = first_expr(&expect.condition);
            self.cond(&expect.condition, owner);
        }
        for output in &script.outputs {
            for item in &output.items {
                let value = self.expr(&item.expr);
                // a name that something else has already keeps the unit of that
                self.units.entry(&item.name).or_insert(value);
            }
        }
    }

    /// Ends and increments of the steps have the unit of their variable.
    fn range_of_steps(&mut self) {
        let Some(steps) = &self.scene.script.steps else { return };
        let increments = steps.options.iter().filter(|o| ["first", "least", "most"].contains(&o.name.name.as_str()));
        let increments = increments.filter(|_| steps.is_auto()).filter_map(|o| match &o.value {
            Some(OptionValue::Expr(e)) => Some(e),
            _ => None,
        });
        let by = (!steps.is_auto()).then_some(&steps.by);
        for e in [&steps.from, &steps.to].into_iter().chain(by).chain(increments) {
            self.has_unit_of_steps(e);
        }
    }

    fn has_unit_of_steps(&mut self, e: &Expr) {
        let Some(steps) = &self.scene.script.steps else { return };
        let (value, needed) = (self.expr(e), Value::of(Some(self.time())));
        self.takes(&steps.variable.name, steps.variable.span, &needed, &value, e);
    }

    /// The limit of an increment, and the sides of events, are made of reductions that have units of their own.
    fn watched(&mut self) {
        let script = self.scene.script;
        let Some(steps) = &script.steps else { return };
        for measure in &steps.watched {
            let value = match measure.reduction {
                Reduction::Integral | Reduction::Reaction | Reduction::Balance(_) => Value::lost(),
                _ => self.expr(&measure.expr),
            };
            self.units.entry(&measure.name.name).or_insert(value);
        }
        let limits = steps.options.iter().filter(|o| o.name.name == "limit");
        for option in limits {
            if let Some(OptionValue::Expr(e)) = &option.value {
                self.has_unit_of_steps(e);
            }
        }
    }

    /// A param without a unit has that of its formula, if the formula names something.
    fn params(&mut self) {
        let script = self.scene.script;
        for param in &script.params {
            let declared = &self.scene.declared[param.name.name.as_str()];
            let mut named = false;
            each_name(&param.value, &mut |_| named = true);
            if declared.written || !named {
                self.units.insert(&param.name.name, of_declared(declared.unit.as_ref()));
            }
        }
        for param in &script.params {
            let name = param.name.name.as_str();
            let value = self.expr(&param.value);
            match self.units.get(name).cloned() {
                Some(needed) => self.takes(name, self.scene.declared[name].span, &needed, &value, &param.value),
                None => {
                    let value = if value.named { value } else { Value::of(Some(Unit::pure())) };
                    self.units.insert(name, value);
                }
            }
        }
    }

    fn fields(&mut self) {
        for field in &self.scene.script.fields {
            let declared = &self.scene.declared[field.name.name.as_str()];
            let value = match self.displacement(field) {
                true => Value::soft(self.length()),
                false => of_declared(declared.unit.as_ref()),
            };
            self.units.insert(&field.name.name, value);
        }
        for field in &self.scene.script.fields {
            if let FieldKind::Data { value: DataValue::Formula(e) } = &field.kind {
                self.data(field, e);
            }
        }
    }

    /// Where no field has a unit, the unit of a displacement is as open as that of coordinates, and the same: only a
    /// factor is then wrong.
    fn displacement(&self, field: &Field) -> bool {
        let is_one = match field.space.rank {
            Rank::Vector(_) => true,
            Rank::Scalar => self.scene.dimension == Some(1),
            Rank::Matrix(_) => false,
        };
        let in_space = !matches!(field.space.place, Place::Global(_));
        self.scene.no_field && is_one && in_space && matches!(field.kind, FieldKind::Unknown)
    }

    fn data(&mut self, field: &'s Field, e: &Expr) {
        let value = self.expr(e);
        let written = self.scene.declared[field.name.name.as_str()].written;
        if value.soft && !written {
            return;
        }
        if value.named && !written {
            self.units.insert(&field.name.name, value);
        } else {
            self.given_value(&field.name, &value, e);
        }
    }

    fn states(&mut self) {
        for field in &self.scene.script.fields {
            if let FieldKind::State { update } = &field.kind {
                self.given(&field.name, update);
            }
        }
    }

    fn given(&mut self, field: &Ident, e: &Expr) {
        let value = self.expr(e);
        self.given_value(field, &value, e);
    }

    /// The first rate of a field.
    fn given_rate(&mut self, field: &Ident, e: &Expr) {
        let value = self.expr(e);
        let name = field.name.as_str();
        if let (Some(needed), Some(declared)) = (self.units.get(name).cloned(), self.scene.declared.get(name)) {
            let needed = needed.scaled(&self.time(), -1);
            self.takes(name, declared.span, &needed, &value, e);
        }
    }

    fn given_value(&mut self, field: &Ident, value: &Value, e: &Expr) {
        let name = field.name.as_str();
        if let (Some(needed), Some(declared)) = (self.units.get(name).cloned(), self.scene.declared.get(name)) {
            self.takes(name, declared.span, &needed, value, e);
        }
    }

    /// The size of a region as a unit.
    fn size_of(&self, place: &Ident) -> Option<Unit> {
        self.scene.size_of(&place.name, &self.length(), self.solved.volume.as_ref())
    }

    fn sum_of_terms(&mut self) {
        let script = self.scene.script;
        let mut totals = Vec::new();
        for term in &script.terms {
            let value = self.expr(&term.expr);
            for place in &term.places {
                let size = self.size_of(place);
                let at = self.scene.outer(&term.expr);
                for (test, unit) in self.residuals(term, &value) {
                    if let Some(unit) = size.as_ref().and_then(|s| s.times(&unit)) {
                        self.add_to(&mut totals, Total { test, unit, at, soft: value.soft, told: false }, &term.expr);
                    }
                }
            }
        }
        self.plain = true;
        for load in &script.loads {
            self.load(load, &mut totals);
        }
        self.plain = false;
        let known = totals.into_iter().filter(|total| !total.soft && !total.told && !total.unit.is_open());
        self.forces.extend(known.map(|total| (total.test, total.unit)));
    }

    fn load(&mut self, load: &Condition, totals: &mut Vec<Total>) {
        let value = self.expr(&load.value);
        let Some(unit) = value.unit().filter(|_| value.named).cloned() else { return };
        let at = self.scene.outer(&load.value);
        for place in &load.places {
            for target in &load.targets {
                let at_nodes = self.scene.is_crossing(&place.name).then(Unit::pure);
                if let Some(unit) = at_nodes.or_else(|| self.size_of(place)).and_then(|s| s.times(&unit)) {
                    let test = target.field.name.clone();
                    self.add_to(totals, Total { test, unit, at, soft: value.soft, told: false }, &load.value);
                }
            }
        }
    }

    /// The unit a term has for each test function; an energy is differentiated by each unknown in it.
    fn residuals(&self, term: &Term, value: &Value) -> Vec<(String, Unit)> {
        if !term.energy {
            let parts = value.parts.iter().filter(|p| !p.test.is_empty());
            return parts.filter_map(|p| Some((p.test.clone(), p.unit.clone()?))).collect();
        }
        let Some(energy) = value.unit() else { return Vec::new() };
        let mut words = Vec::new();
        each_name(&term.expr, &mut |word| words.push(split_prefixes(word).1));
        let solved_for = |f: &&Field| matches!(f.kind, FieldKind::Unknown | FieldKind::Multiplier { .. });
        let fields = self.scene.script.fields.iter().filter(solved_for);
        let used = fields.filter(|f| words.contains(&f.name.name.as_str()));
        let by = |f: &Field| energy.over(self.units.get(f.name.name.as_str())?.unit()?);
        used.filter_map(|f| Some((f.name.name.clone(), by(f)?))).collect()
    }

    /// The sum of all terms is zero for each test function, so they have one unit (W505). Of a part whose own unit is not
    /// all known (`soft`), only the same quantity with a factor is wrong.
    fn add_to(&mut self, totals: &mut Vec<Total>, part: Total, owner: &Expr) {
        let Some(first) = totals.iter_mut().find(|t| t.test == part.test) else {
            totals.push(part);
            return;
        };
        let fits = match part.soft || first.soft {
            true => self.may_fit(part.at, &part.unit, &first.unit),
            false => self.fits(part.at, &part.unit, &first.unit, Strength::Weak),
        };
        if !fits {
            first.told = true;
            self.differ(first, &part.unit, part.at, owner);
        } else if first.soft && !part.soft || first.unit.is_open() && !part.unit.is_open() {
            *first = Total { at: first.at, told: first.told, ..part };
        }
    }

    fn differ(&mut self, first: &Total, unit: &Unit, at: Span, owner: &Expr) {
        let text = format!("the terms with `Test_{}` have different units once they are integrated", first.test);
        let d = Diagnostic::new(Code::W505, text).at(at, unit.show()).at(first.at, first.unit.show());
        self.report(scale_note(d, &first.unit, unit), owner);
    }

    fn of_measure(&mut self, measure: &'s Measure) {
        let value = self.expr(&measure.expr);
        let size = match measure.reduction {
            Reduction::Integral => measure.places.first().and_then(|p| self.size_of(p)),
            Reduction::Mean | Reduction::Max | Reduction::Min | Reduction::Value => Some(Unit::pure()),
            // a balance adds up the equations of its first unknown, as a reaction does
            Reduction::Reaction | Reduction::Balance(_) => self.per_unknown(&measure.expr),
        };
        let value = match measure.reduction {
            Reduction::Reaction | Reduction::Balance(_) if size.is_none() => Value::lost(),
            _ => value.map(|u| size.as_ref().and_then(|s| s.times(u))),
        };
        self.units.entry(&measure.name.name).or_insert(value);
    }

    /// The unit of the equations of the unknown in a reaction, over that of the unknown: `reaction(u(1))` is a force,
    /// `reaction(x*u(2))` a moment.
    fn per_unknown(&self, e: &Expr) -> Option<Unit> {
        let mut roots = Vec::new();
        each_name(e, &mut |word| roots.push(split_prefixes(word).1.to_owned()));
        let (name, force) = roots.iter().find_map(|root| Some((root, self.forces.get(root)?)))?;
        force.over(self.units.get(name.as_str())?.unit()?)
    }

    fn measures(&mut self) {
        self.scene.script.measures.iter().for_each(|measure| self.of_measure(measure));
        for computed in &self.scene.script.computed {
            computed.watched.iter().for_each(|measure| self.of_measure(measure));
            let value = self.expr(&computed.expr);
            self.units.entry(&computed.name.name).or_insert(value);
        }
        for gradient in &self.scene.script.gradients {
            for derivative in &gradient.derivatives {
                let words = [&derivative.measure, &derivative.parameter];
                let [of, by] = words.map(|word| self.units.get(word.name.as_str()).cloned());
                let quotient = of.zip(by).map_or_else(Value::lost, |(of, by)| of.times(&by.raised(Ratio::whole(-1))));
                self.units.entry(&derivative.name).or_insert(quotient);
            }
        }
    }
}

/// A unit that could not be read is not known.
fn of_declared(unit: Option<&Unit>) -> Value {
    unit.map_or_else(Value::lost, |u| Value::of(Some(u.clone())))
}

/// The first expression of a condition: every condition compares something.
pub(super) fn first_expr(c: &crate::ast::Cond) -> &Expr {
    use crate::ast::CondKind;
    match &c.kind {
        CondKind::Compare(first, _) => first,
        CondKind::And(parts) | CondKind::Or(parts) => first_expr(&parts[0]),
        CondKind::Not(a) => first_expr(a),
    }
}
