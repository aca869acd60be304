//! The worst of what the ranks of a run have found, on each of them.

use wfl_host::team::Team;

/// A finding as numbers and names.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Finding {
    /// How bad it is: the largest counts.
    pub(crate) size: f64,
    /// What is known of it.
    pub(crate) numbers: Vec<f64>,
    /// Which terms or fields it is about.
    pub(crate) names: Vec<String>,
}

impl Finding {
    /// The worst one of all ranks, the first of equal ones; `None` where no rank has one. Made by all of them together.
    pub(crate) fn worst(own: Option<Self>, team: &dyn Team) -> Option<Self> {
        if team.is_alone() {
            return own;
        }
        let size = own.as_ref().map_or(f64::NEG_INFINITY, |own| own.size);
        let [_, largest] = team.range(size, size);
        let rank = team.first(own.is_some() && size == largest)?;
        let own = own.unwrap_or_default();
        let numbers = team.numbers_of(rank, &own.numbers);
        let names = String::from_utf8_lossy(&team.of_rank(rank, own.names.join("\n").as_bytes())).into_owned();
        Some(Self { size: largest, numbers, names: names.lines().map(str::to_owned).collect() })
    }
}

#[cfg(test)]
mod tests {
    use wfl_host::team::in_threads;

    use super::*;

    #[test]
    fn every_rank_has_the_worst_finding_of_all() {
        let of = |rank: usize| Finding {
            size: [2.0, 5.0, 5.0][rank],
            numbers: vec![rank as f64; 2],
            names: vec![format!("term {rank}"), "other".to_owned()],
        };
        let found: Vec<_> = std::thread::scope(|scope| {
            let ranks = in_threads(3).into_iter().map(|team| {
                scope.spawn(move || {
                    let own = of(team.rank());
                    (Finding::worst(Some(own), &*team), Finding::worst(None, &*team))
                })
            });
            let ranks: Vec<_> = ranks.collect();
            ranks.into_iter().map(|rank| rank.join().expect("a rank ends")).collect()
        });
        assert!(found.iter().all(|(worst, none)| *worst == Some(of(1)) && none.is_none()), "{found:?}");
    }
}
