//! Groups of a mesh file as regions: their names in the scene, and undefined names.
//!
//! Promises: every group has a name in the scene, no group hides another one or a built-in region, and a renamed or
//! hidden group gives a message (W407). Does not look at the members of a group.

use wfl::{Code, Diagnostic, REGIONS, ResolvedScript, Span, is_keyword, nearest};
use wfl_mesh::mesh::Group;

/// Names shown in a message before it says how many more there are.
const SHOWN: usize = 12;

/// The names of the groups as regions of a scene, in the order of `groups`. A character that no name has becomes `_`; a
/// name that is taken gets the kind of the group behind it.
pub(super) fn names(
    groups: &[Group],
    script: &ResolvedScript,
    file: Span,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<String> {
    let mut out: Vec<String> = Vec::with_capacity(groups.len());
    for group in groups {
        let wanted = region_name(&group.name);
        let built_in = REGIONS.contains(&wanted.as_str());
        let taken = |name: &String, out: &[String]| REGIONS.contains(&name.as_str()) || out.contains(name);
        let mut name = wanted.clone();
        if taken(&name, &out) {
            let kind = ["point", "curve", "surface", "volume"][group.dim.min(3)];
            name = format!("{wanted}_{kind}");
            while taken(&name, &out) {
                name.push('_');
            }
            let why = if built_in {
                format!("`{wanted}` is built in: the {kind} `{}` of the mesh file is called `{name}` here", group.name)
            } else {
                format!("two groups of the mesh file are called `{wanted}`: here the {kind} is called `{name}`")
            };
            diagnostics.push(Diagnostic::new(Code::W407, why).at(file, ""));
        }
        if let Some(region) = script.regions.iter().find(|r| r.name.name == name) {
            let message = format!("the region `{name}` hides the group of that name of the mesh file");
            diagnostics.push(Diagnostic::new(Code::W407, message).at(region.name.span, ""));
        }
        out.push(name);
    }
    out
}

/// The name that a scene has for a group of a mesh file, if no other group has it.
#[must_use]
pub fn region_name(name: &str) -> String {
    let mut word: String =
        name.trim().chars().map(|c| if c.is_ascii_alphanumeric() || c == '_' { c } else { '_' }).collect();
    if word.is_empty() || word.starts_with(|c: char| c.is_ascii_digit()) || is_keyword(&word) {
        word.insert(0, '_');
    }
    word
}

/// E201 for names of the scene that are neither declared nor groups.
pub(super) fn unknown(
    script: &ResolvedScript,
    groups: &[String],
    is_region: &dyn Fn(&str) -> bool,
    diagnostics: &mut Vec<Diagnostic>,
) {
    for name in script.groups.iter().filter(|g| !is_region(&g.name)) {
        let declared = script.regions.iter().map(|r| &r.name.name);
        let known = groups.iter().chain(declared).map(String::as_str).chain(["all", "boundary"]);
        let mut list: Vec<&str> = groups.iter().map(String::as_str).collect();
        list.sort_unstable();
        let note = match list.len() {
            0 => "the mesh file has no groups".to_owned(),
            n if n > SHOWN => {
                format!("the mesh file has the groups {} and {} more", list[..SHOWN].join(", "), n - SHOWN)
            }
            _ => format!("the mesh file has the groups {}", list.join(", ")),
        };
        let d = Diagnostic::new(Code::E201, format!("unknown region `{}`", name.name));
        let d = d.did_you_mean(name.span, nearest(&name.name, known));
        diagnostics.push(d.note(note));
    }
}
