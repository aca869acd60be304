//! What is asked for: results with the steps they are taken at, and what they are differentiated in.

use wfl::nearest;

/// At which steps a measure counts.
#[derive(Clone, Debug, PartialEq)]
pub enum When {
    /// At the last step.
    Last,
    /// The sum over all steps.
    Sum,
    /// The mean over all steps.
    Mean,
    /// At the step that ends at this value of the step variable.
    At(f64),
    /// The sum over all steps, each times its number.
    Steps(Vec<f64>),
}

/// A result: a measure at some steps.
#[derive(Clone, Debug, PartialEq)]
pub struct Result {
    /// As it was written.
    pub name: String,
    /// The measure.
    pub measure: String,
    /// At which steps.
    pub when: When,
}

/// Results, and what they are differentiated in.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Request {
    /// The results.
    pub results: Vec<Result>,
    /// Parameters by name.
    pub parameters: Vec<String>,
    /// Data fields by name.
    pub fields: Vec<String>,
    /// The results are summands of one.
    pub together: bool,
    /// Parameters in which derivatives to one side are wanted, too.
    pub sides: Vec<Side>,
}

/// A parameter in which derivatives to one side are wanted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Side {
    /// The parameter.
    pub parameter: String,
    /// To larger values.
    pub larger: bool,
    /// To smaller values.
    pub smaller: bool,
}

impl Side {
    /// Of a word: `+F`, `-F`, or `F` for both sides.
    fn read(word: &str) -> Self {
        let (name, larger, smaller) = match (word.strip_prefix('+'), word.strip_prefix('-')) {
            (Some(name), _) => (name, true, false),
            (_, Some(name)) => (name, false, true),
            _ => (word, true, true),
        };
        Self { parameter: name.trim().to_owned(), larger, smaller }
    }
}

/// Values of the step variable within this part of the range are one.
const SAME_TIME: f64 = 1e-9;

impl Request {
    /// Reads lists as they are written: `Fn, sum(misfit), slip at t=4.5` and `E, fric, field k`.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn read(results: &str, with: &str) -> std::result::Result<Self, String> {
        let mut made = Self::default();
        for word in results.split(',') {
            made.results.push(result(word.trim())?);
        }
        for word in with.split(',').map(str::trim) {
            let (list, name) = match word.strip_prefix("field ") {
                Some(name) => (&mut made.fields, name.trim()),
                None => (&mut made.parameters, word),
            };
            if name.is_empty() || name.contains(char::is_whitespace) || name.contains('=') {
                return Err(format!(
                    "`{word}` is no parameter\n  = help: names with commas between, and `field k` for the data k; values of \
                     parameters, NAME=VALUE, stand before --gradient"
                ));
            }
            if !list.iter().any(|known| known == name) {
                list.push(name.to_owned());
            }
        }
        Ok(made)
    }

    /// Adds derivatives to one side, as they are written: `+F` for larger values, `-F` for smaller ones, `F` for both.
    ///
    /// # Errors
    /// What is wrong, in words.
    pub fn read_sides(&mut self, list: &str) -> std::result::Result<(), String> {
        for word in list.split(',').map(str::trim) {
            let side = Side::read(word);
            if !self.parameters.contains(&side.parameter) {
                let names: Vec<&str> = self.parameters.iter().map(String::as_str).collect();
                let help = known(&side.parameter, &names, "number after --with");
                return Err(format!(
                    "`{word}` is no side of a parameter of the derivatives\n  = help: +F to larger values, -F to smaller ones, F \
                     to both; {help}"
                ));
            }
            self.sides.push(side);
        }
        Ok(())
    }
}

impl Request {
    /// The names of the derivatives: a result each, or the sum of all.
    pub(super) fn names(&self) -> Vec<String> {
        let names: Vec<String> = self.results.iter().map(|r| r.name.clone()).collect();
        if self.together { vec![names.join(" + ")] } else { names }
    }
}

impl Result {
    /// The weight of a step in the result: steps are those that end at these values.
    ///
    /// # Errors
    /// No step ends where the result is taken, in words.
    pub fn weights(&self, times: &[f64]) -> std::result::Result<Vec<f64>, String> {
        let n = times.len();
        let mut weights = vec![0.0; n];
        match &self.when {
            When::Last => weights.iter_mut().rev().take(1).for_each(|w| *w = 1.0),
            When::Sum => weights.fill(1.0),
            #[expect(clippy::cast_precision_loss, reason = "as many steps as memory holds")]
            When::Mean => weights.fill(1.0 / n as f64),
            When::Steps(given) if given.len() == n => weights.copy_from_slice(given),
            When::Steps(given) => return Err(format!("{} numbers for {n} steps", given.len())),
            When::At(time) => {
                let span = times.iter().fold(0.0f64, |m, t| m.max((t - times[0]).abs())).max(time.abs() * f64::EPSILON);
                let met = times.iter().position(|t| (t - time).abs() <= SAME_TIME * span);
                let Some(met) = met else {
                    let shown: Vec<String> = times.iter().map(f64::to_string).collect();
                    let by_nearness = |a: &&String, b: &&String| {
                        let far = |s: &str| (s.parse::<f64>().unwrap_or(f64::INFINITY) - time).abs();
                        far(a).total_cmp(&far(b))
                    };
                    let near = shown.iter().min_by(by_nearness).cloned().unwrap_or_default();
                    return Err(format!("no step ends at {time}; the nearest one ends at {near}"));
                };
                weights[met] = 1.0;
            }
        }
        Ok(weights)
    }
}

/// `Fn`, `sum(Fn)`, `mean(Fn)`, `Fn at t=4.5`.
fn result(text: &str) -> std::result::Result<Result, String> {
    let wrong = || {
        format!(
            "`{text}` is no result\n  = help: a measure of the scene: Fn, sum(Fn), mean(Fn) over the steps, or Fn at t=4.5"
        )
    };
    let name = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let is_name = |s: &str| !s.is_empty() && s.chars().all(|c| c.is_alphanumeric() || c == '_');
    if let Some((measure, at)) = name.split_once(" at ") {
        let value = at.split_once('=').map_or(at, |(_, value)| value).trim();
        let time = value.parse::<f64>().ok().filter(|t| t.is_finite()).ok_or_else(wrong)?;
        if !is_name(measure) {
            return Err(wrong());
        }
        return Ok(Result { measure: measure.to_owned(), when: When::At(time), name });
    }
    for (word, when) in [("sum", When::Sum), ("mean", When::Mean)] {
        let inner = name.strip_prefix(word).and_then(|s| s.trim().strip_prefix('(')?.strip_suffix(')'));
        if let Some(measure) = inner.map(str::trim) {
            if !is_name(measure) {
                return Err(wrong());
            }
            return Ok(Result { measure: measure.to_owned(), when, name: format!("{word}({measure})") });
        }
    }
    if is_name(&name) { Ok(Result { measure: name.clone(), when: When::Last, name }) } else { Err(wrong()) }
}

/// `did you mean ...`, or the names there are.
pub(super) fn known(word: &str, names: &[&str], what: &str) -> String {
    match nearest(word, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None if names.is_empty() => format!("the scene has no {what}"),
        None => format!("the scene has {}", names.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_are_read_as_they_are_written() {
        let read = Request::read("Fn, sum( misfit ),mean(a), slip at t = 4.5", "E, fric,E, field k").unwrap();
        let whens: Vec<(&str, &str, When)> =
            read.results.iter().map(|r| (r.name.as_str(), r.measure.as_str(), r.when.clone())).collect();
        assert_eq!(
            whens,
            [
                ("Fn", "Fn", When::Last),
                ("sum(misfit)", "misfit", When::Sum),
                ("mean(a)", "a", When::Mean),
                ("slip at t = 4.5", "slip", When::At(4.5)),
            ]
        );
        assert_eq!((read.parameters, read.fields), (vec!["E".into(), "fric".into()], vec!["k".into()]));
        for (results, with) in
            [("Fn+1", "E"), ("", "E"), ("Fn", ""), ("Fn", "E fric"), ("Fn at noon", "E"), ("Fn", "E=3")]
        {
            assert!(Request::read(results, with).is_err(), "{results} {with}");
        }
    }

    #[test]
    fn steps_have_the_weights_of_their_result() {
        let of = |text: &str, times: &[f64]| result(text).unwrap().weights(times);
        assert_eq!(of("a", &[0.0, 1.0, 2.0]), Ok(vec![0.0, 0.0, 1.0]));
        assert_eq!(of("sum(a)", &[0.0, 1.0]), Ok(vec![1.0, 1.0]));
        assert_eq!(of("mean(a)", &[0.0, 1.0]), Ok(vec![0.5, 0.5]));
        assert_eq!(of("a at t=0.3", &[0.0, 0.1 + 0.2, 1.0]), Ok(vec![0.0, 1.0, 0.0]));
        assert!(of("a at t=0.4", &[0.0, 0.3, 1.0]).unwrap_err().contains("nearest one ends at 0.3"));
    }
}
