//! Tables about the formulation of contact: what each interface is, and what states of constant stress leave.

use wfl_checks::consistency::{ContactForm, Verdict};
use wfl_problem::Scene;
use wfl_tasks::{
    Loaded,
    advice::contact::{place, words},
};

use crate::table::Table;

/// The line of `wfl check` for each interface that can be judged.
pub(crate) fn table(loaded: &Loaded, scene: &Scene, forms: &[ContactForm]) -> Table {
    let mut table = Table::new("contact", &["terms", "on", "what it is"]);
    for form in forms.iter().filter(|f| !matches!(f.verdict, Verdict::NotJudged(_))) {
        table.push(vec![form.terms.clone().into(), place(scene, form).into(), words(loaded, scene, form).into()]);
    }
    table
}

/// The rows of `wfl verify`: what each state leaves.
pub(crate) fn states(loaded: &Loaded, scene: &Scene, forms: &[ContactForm]) -> [Table; 2] {
    let columns = ["terms", "state", "first body", "second body", "tested stress", "law"];
    let mut states = Table::new("contact at constant stress (relative residual)", &columns);
    let mut verdicts = Table::new("contact", &["terms", "on", "what it is"]);
    let short = |x: f64| if x == 0.0 { "0".to_owned() } else { format!("{x:.1e}") };
    for form in forms {
        for state in &form.states {
            let l = &state.left;
            let numbers = [l.balance[0], l.balance[1], l.stress, l.law].map(|x| short(x).into());
            let mut row = vec![form.terms.clone().into(), state.name.into()];
            row.extend(numbers);
            states.push(row);
        }
        let what = match (&form.verdict, &form.unsaid) {
            (Verdict::NotJudged(why), _) => format!("not judged: {why}"),
            (_, Some(unsaid)) => format!("{}; {unsaid}", words(loaded, scene, form)),
            _ => words(loaded, scene, form),
        };
        verdicts.push(vec![form.terms.clone().into(), place(scene, form).into(), what.into()]);
    }
    [states, verdicts]
}
