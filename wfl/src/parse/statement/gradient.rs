//! Derivatives of measures: `gradient Fn, sum(misfit), slip at t = 4 with E, field k`.

use super::{Pair, Parsed, Parts, Reader, Rule};
use crate::ast::{AtSteps, Differentiated, Gradients};

impl Reader<'_> {
    pub(super) fn gradient(&self, mut p: Parts<'_>) -> Parsed<Gradients> {
        let results = p.take_all(Rule::result);
        let results = results.into_iter().map(|result| self.result(result)).collect::<Parsed<_>>()?;
        let (mut parameters, mut fields) = (Vec::new(), Vec::new());
        for varied in p.take_all(Rule::varied) {
            let name = self.only(varied);
            match name.as_rule() {
                Rule::varied_field => fields.push(self.ident(&self.only(name))),
                _ => parameters.push(self.ident(&name)),
            }
        }
        Ok(Gradients { results, parameters, fields })
    }

    /// `m`, `sum(m)`, `mean(m)` or `m at t = 4`.
    fn result(&self, pair: Pair<'_>) -> Parsed<Differentiated> {
        let span = self.span(&pair);
        let mut p = self.open(pair);
        let over =
            p.take(Rule::over_steps).map(|word| if word.as_str() == "sum" { AtSteps::Sum } else { AtSteps::Mean });
        let measure = self.ident(&p.next());
        let at = match (over, p.take(Rule::result_at)) {
            (Some(over), _) => over,
            (None, None) => AtSteps::Last,
            (None, Some(at)) => {
                let mut at = self.open(at);
                let variable = at.take(Rule::step_value).map(|word| self.ident(&self.only(word)));
                AtSteps::At(variable, self.value(at.next())?)
            }
        };
        Ok(Differentiated { measure, at, span })
    }
}
