//! Which references the scenes of a sweep are compared with, one a problem: kept from an earlier sweep, or made now.

use std::{collections::BTreeMap, path::Path, time::Instant};

use wfl_adapt::knobs::{self, KnobError, Setting, number};

use super::{
    Against, Method, Sweep,
    lists::{self, Knob},
    problem,
    reference::{self, Reference},
};
use crate::{
    bench::{self, Bench},
    exact, setting_text,
};

/// The name of the file of a reference, counted from 1.
pub(super) fn reference_file(number: usize) -> String {
    format!("reference_{number}.json")
}

impl Method {
    /// What the errors of a setting are taken against, if anything.
    pub(super) fn against(&self, setting: &Setting) -> Option<&Result<usize, String>> {
        let like = |a: &&Against| a.problem.iter().all(|knob| setting.contains(knob));
        self.references.iter().find(like).map(|a| &a.found)
    }
}

/// A finer run of one of the scenes that is needed for a problem.
struct Wanted {
    /// Whose errors are taken against it, and what it is made of: positions of scenes.
    of: usize,
    with: usize,
    problem: Vec<(String, String)>,
    setting: Vec<(String, String)>,
    what: String,
}

impl Sweep<'_> {
    /// Makes or reads what the errors are taken against, for each of the problems.
    pub(super) fn references(
        &mut self,
        methods: &mut [Method],
        problems: &[Vec<(String, String)>],
    ) -> Result<(), String> {
        let of_all = || vec![Against { problem: Vec::new(), found: Ok(0) }];
        match self.job.reference.as_str() {
            "none" => {}
            "exact" => {
                for method in &mut *methods {
                    let help = "write `def exact = ...` (or def exact_u, def exact_slip for an output `slip`)";
                    method.more = exact::statements(&method.known).ok_or_else(|| {
                        format!("{} defines no exact solution\n  = help: {help}", method.path.display())
                    })?;
                    method.references = of_all();
                }
                let what = "exact solution".to_owned();
                self.references.push(Reference { what, exact: true, ..Reference::default() });
            }
            "auto" => self.finer_runs(methods, problems)?,
            file => {
                let mut read = reference::from_file(Path::new(file))?;
                // what one of the scenes calls numerics is numerics in all
                read.problem.retain(|(name, _)| problem::is_of_all(methods, name));
                self.references.push(read);
                if problems.len() > 1 {
                    let names: Vec<&str> = problems[0].iter().map(|k| k.0.as_str()).collect();
                    self.job.listener.progress(&format!(
                        "reference: {file} is one problem, and {} makes several: errors hold for the rows of that one",
                        names.join(", ")
                    ));
                }
                methods.iter_mut().for_each(|m| m.references = of_all());
            }
        }
        Ok(())
    }

    /// A finer run for each problem and scene. One that fails leaves its problem without errors, not the sweep.
    fn finer_runs(&mut self, methods: &mut [Method], problems: &[Vec<(String, String)>]) -> Result<(), String> {
        let wanted = self.wanted(methods, problems)?;
        let mut kept = self.kept_references(methods, &wanted);
        let mut made: BTreeMap<&str, Result<usize, String>> = BTreeMap::new();
        for one in &wanted {
            if !made.contains_key(one.what.as_str()) {
                let reference = match kept.iter().position(|(_, r)| r.what == one.what) {
                    Some(at) => Ok(kept[at].1.clone()),
                    None => {
                        let number = (1..).find(|n| kept.iter().all(|k| k.0 != *n)).unwrap_or(1);
                        let made = self.finer(&methods[one.with], &one.setting, &reference_file(number))?;
                        kept.extend(made.iter().map(|r| (number, r.clone())));
                        made
                    }
                };
                let found = reference.map(|reference| {
                    // its rows are those of its problem
                    self.references.push(Reference { problem: Vec::new(), ..reference });
                    self.references.len() - 1
                });
                made.insert(&one.what, found);
            }
            let found = made[one.what.as_str()].clone();
            methods[one.of].references.push(Against { problem: one.problem.clone(), found });
        }
        for problem in problems {
            let of = |w: &&Wanted| w.problem == *problem;
            let mut found: Vec<usize> =
                wanted.iter().filter(of).filter_map(|w| made[w.what.as_str()].clone().ok()).collect();
            found.sort_unstable();
            found.dedup();
            if let [a, b] = found[..]
                && let Ok([one, other]) = self.references.get_disjoint_mut([a, b])
            {
                reference::compare(one, other);
            }
        }
        Ok(())
    }

    fn wanted(&self, methods: &[Method], problems: &[Vec<(String, String)>]) -> Result<Vec<Wanted>, String> {
        let last = methods.len() - 1;
        // never the same method, where there is a choice
        let others: Vec<usize> = (0..methods.len()).map(|k| if k == last { 0 } else { last }).collect();
        let mut out = Vec::new();
        for problem in problems {
            for (of, with) in others.iter().copied().enumerate() {
                let method = &methods[with];
                let setting = self.finer_setting(method, problem)?;
                let what = format!("{} {}", method.path.display(), setting_text(&setting));
                out.push(Wanted { of, with, problem: problem.clone(), setting, what });
            }
        }
        Ok(out)
    }

    /// The setting of the finer run: the parameters of the problem, the finest mesh and the smallest steps of the sweep
    /// with one degree more, cells of half the size where the degree is 2 already or the scene is plane, the smallest
    /// tolerance; everything else as the scene says.
    fn finer_setting(&self, method: &Method, problem: &Setting) -> Result<Vec<(String, String)>, String> {
        let known = &method.known;
        let words = problem::resolution(known);
        let mut setting: Vec<(String, String)> = problem.to_vec();
        let pick = |knob: &Knob, largest: bool| {
            let value = |v: &&String| number(v).unwrap_or(0.0);
            let sorted = |a: &&String, b: &&String| value(a).total_cmp(&value(b));
            if largest { knob.values.iter().max_by(sorted) } else { knob.values.iter().min_by(sorted) }.cloned()
        };
        let mut degree = reference::largest_degree(known);
        let mut refine = 1.0;
        for knob in self.knobs.iter().filter(|k| problem.iter().all(|p| p.0 != k.name)) {
            match knob.name.as_str() {
                name if known.params.iter().any(|p| p == name) => {
                    let value = words.contains(name).then(|| finest(method, knob)).flatten();
                    setting.extend(value.map(|v| (knob.name.clone(), v)));
                }
                "degree" => degree = pick(knob, true).and_then(|d| d.parse().ok()).unwrap_or(degree),
                "refine" => refine = pick(knob, true).and_then(|r| number(&r)).unwrap_or(1.0),
                "h" | "tol" => setting.extend(pick(knob, false).map(|v| (knob.name.clone(), v))),
                _ => {}
            }
        }
        if degree > 1 || known.scene.system.mesh.dim() < 3 {
            refine *= 2.0;
        }
        setting.push(("degree".to_owned(), degree.max(2).to_string()));
        setting.push(("refine".to_owned(), refine.to_string()));
        for given in lists::knobs(&self.job.reference_knob).map_err(|e| e.to_string())? {
            // of two that divide the mesh that of the reference counts
            let divides = |name: &str| knobs::DIVIDING.contains(&name);
            setting.retain(|k| k.0 != given.name && !(divides(&k.0) && divides(&given.name)));
            setting.extend(given.values.first().map(|v| (given.name.clone(), v.clone())));
        }
        // the value of a parameter that divided the mesh has no place left
        while let Err(KnobError::Replaced { param, .. }) =
            knobs::together(&known.loaded.script, &setting, &known.params)
            && problem.iter().all(|k| k.0 != param)
        {
            setting.retain(|k| k.0 != param);
        }
        known.apply(&mut known.loaded.script.clone(), &setting)?;
        setting.retain(|(name, value)| name != "refine" || value != "1");
        Ok(setting)
    }

    /// Makes a finer run of a scene and keeps it in a file; inside, why it has no solution.
    ///
    /// # Errors
    /// Those of the file.
    fn finer(&self, method: &Method, setting: &Setting, name: &str) -> Result<Result<Reference, String>, String> {
        let begin = Instant::now();
        let bench = Bench { last: true, only: None, ..self.bench };
        let made = reference::finer(&bench, &method.path, &method.known, setting);
        match &made {
            Ok(made) => {
                reference::to_file(made, self.dir, name)?;
                let file = self.dir.path().join(name);
                let seconds = begin.elapsed().as_secs_f64();
                self.job.listener.progress(&format!("reference: {seconds:.1} s; kept in {}", file.display()));
            }
            Err(why) => self.job.listener.progress(&format!("{why}\nits rows are made without errors")),
        }
        Ok(made)
    }

    /// The references that an earlier sweep made of the same, with the numbers of their files, if a file is what was
    /// written.
    fn kept_references(&self, methods: &[Method], wanted: &[Wanted]) -> Vec<(usize, Reference)> {
        let mut kept = Vec::new();
        // one file each: their numbers have no gaps
        for number in 1..=self.dir.own_files().len() {
            let read = match self.dir.verify(&reference_file(number)) {
                Ok(None) => continue,
                Ok(Some(file)) => reference::from_file(&file),
                Err(error) => Err(error.to_string()),
            };
            match read {
                Ok(read) => {
                    let same =
                        |w: &Wanted| w.what == read.what && read.identity == methods[w.with].known.identity.hash();
                    if wanted.iter().any(same) {
                        kept.push((number, read));
                    }
                }
                Err(why) => self.job.listener.progress(&format!("reference: {why}: made anew")),
            }
        }
        kept
    }
}

/// The value of a parameter with the most unknowns and steps; the first of several.
fn finest(method: &Method, knob: &Knob) -> Option<String> {
    let work = |value: &String| {
        let size = bench::size(&method.path, &method.known, &[(knob.name.clone(), value.clone())]).ok()?;
        Some((size.dofs * size.steps, value.clone()))
    };
    let first = knob.values.first();
    if knob.values.len() < 2 {
        return first.cloned();
    }
    let all = knob.values.iter().filter_map(work).reduce(|best, one| if one.0 > best.0 { one } else { best });
    all.map(|best| best.1).or_else(|| first.cloned())
}
