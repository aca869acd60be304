//! Which reference each scene of a sweep is compared with: kept from an earlier sweep, or made now.

use std::{path::Path, time::Instant};

use wfl_runtime::knobs::{self, Setting, number};

use super::{
    Method, Sweep,
    lists::{self, Knob},
    reference::{self, Reference},
};
use crate::{
    bench::{Bench, Known},
    setting_text,
};

/// The name of the file of a reference, counted from 1.
pub(super) fn reference_file(number: usize) -> String {
    format!("reference_{number}.json")
}

impl Sweep<'_> {
    /// Makes or reads what the errors are taken against.
    pub(super) fn references(&mut self, methods: &mut [Method]) -> Result<(), String> {
        match self.job.reference.as_str() {
            "none" => {}
            "exact" => {
                for method in &mut *methods {
                    let help = "write `def exact = ...` (or def exact_u, def exact_slip for an output `slip`)";
                    method.more = reference::exact_statements(&method.known).ok_or_else(|| {
                        format!("{} defines no exact solution\n  = help: {help}", method.path.display())
                    })?;
                    method.reference = Some(0);
                }
                let what = "exact solution".to_owned();
                self.references.push(Reference { what, exact: true, ..Reference::default() });
            }
            "auto" => {
                let last = methods.len() - 1;
                for k in 0..methods.len() {
                    // never the same method, where there is a choice
                    let of = if k == last { 0 } else { last };
                    let setting = self.finer_setting(&methods[of].known)?;
                    let found = self.finer(&methods[of], &setting)?;
                    methods[k].reference = Some(found);
                }
                reference::compare(&mut self.references);
            }
            file => {
                self.references.push(reference::from_file(Path::new(file))?);
                methods.iter_mut().for_each(|m| m.reference = Some(0));
            }
        }
        Ok(())
    }

    /// The setting of the finer run: the finest mesh of the sweep with one degree more, cells of half the size where the
    /// degree is 2 already or the scene is plane, the smallest tolerance; everything else as the scene says.
    fn finer_setting(&self, known: &Known) -> Result<Vec<(String, String)>, String> {
        let sizes = knobs::mesh_words(&known.loaded.script);
        let mut setting: Vec<(String, String)> = Vec::new();
        let pick = |knob: &Knob, largest: bool| {
            let value = |v: &&String| number(v).unwrap_or(0.0);
            let sorted = |a: &&String, b: &&String| value(a).total_cmp(&value(b));
            if largest { knob.values.iter().max_by(sorted) } else { knob.values.iter().min_by(sorted) }.cloned()
        };
        let mut degree = reference::largest_degree(known);
        let mut refine = 1.0;
        for knob in self.knobs {
            match knob.name.as_str() {
                "degree" => degree = pick(knob, true).and_then(|d| d.parse().ok()).unwrap_or(degree),
                "refine" => refine = pick(knob, true).and_then(|r| number(&r)).unwrap_or(1.0),
                "h" | "tol" => setting.extend(pick(knob, false).map(|v| (knob.name.clone(), v))),
                name if sizes.iter().any(|s| s == name) => {
                    setting.extend(pick(knob, true).map(|v| (knob.name.clone(), v)));
                }
                _ => {}
            }
        }
        if degree > 1 || known.scene.system.mesh.dim() < 3 {
            refine *= 2.0;
        }
        setting.push(("degree".to_owned(), degree.max(2).to_string()));
        setting.push(("refine".to_owned(), refine.to_string()));
        for given in lists::knobs(&self.job.reference_knob).map_err(|e| e.to_string())? {
            setting.retain(|k| k.0 != given.name);
            setting.extend(given.values.first().map(|v| (given.name.clone(), v.clone())));
        }
        setting.retain(|(name, value)| name != "refine" || value != "1");
        Ok(setting)
    }

    /// The position of a finer run of a method among the references: kept from before, or made now.
    fn finer(&mut self, method: &Method, setting: &Setting) -> Result<usize, String> {
        let what = format!("{} {}", method.path.display(), setting_text(setting));
        if let Some(k) = self.references.iter().position(|r| r.what == what) {
            return Ok(k);
        }
        let k = self.references.len();
        let name = reference_file(k + 1);
        let made = match self.kept_reference(&name, &what, method) {
            Some(kept) => kept,
            None => {
                let begin = Instant::now();
                let bench = Bench { last: true, only: None, ..self.bench };
                let made = reference::finer(&bench, &method.path, &method.known, setting)?;
                reference::to_file(&made, self.dir, &name)?;
                let file = self.dir.path().join(&name);
                self.job.listener.progress(&format!(
                    "reference: {:.1} s; kept in {}",
                    begin.elapsed().as_secs_f64(),
                    file.display()
                ));
                made
            }
        };
        self.references.push(made);
        Ok(k)
    }

    /// The reference that an earlier sweep made of the same, if its file is what was written.
    fn kept_reference(&self, name: &str, what: &str, method: &Method) -> Option<Reference> {
        let read = match self.dir.verify(name) {
            Ok(file) => reference::from_file(&file?),
            Err(error) => Err(error.to_string()),
        };
        if let Err(why) = &read {
            self.job.listener.progress(&format!("reference: {why}: made anew"));
        }
        read.ok().filter(|r| r.what == what && r.identity == method.known.identity.hash())
    }
}
