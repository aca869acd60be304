//! Units as products of named units and of the units a scene leaves open, with rational powers.
//!
//! A unit keeps the names it was made of, so that a message says `MPa*mm` where the scene does; two units are the
//! same if their dimensions are and their scales differ by rounding only. Nothing here knows a scene.

use std::cmp::Ordering;

use super::table::{DIMENSIONS, NamedUnit};

/// A fraction in lowest terms with a positive denominator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Ratio {
    num: i64,
    den: i64,
}

impl Ratio {
    pub(super) const ZERO: Ratio = Ratio { num: 0, den: 1 };
    pub(super) const ONE: Ratio = Ratio { num: 1, den: 1 };
    pub(super) const HALF: Ratio = Ratio { num: 1, den: 2 };

    pub(super) const fn whole(num: i64) -> Ratio {
        Ratio { num, den: 1 }
    }

    /// `num/den`; `None` for a zero denominator or numbers that no sensible unit has.
    pub(super) fn new(num: i64, den: i64) -> Option<Ratio> {
        const LARGEST: i64 = 1 << 24;
        let (mut a, mut b) = (num.checked_abs()?, den.checked_abs()?);
        while b != 0 {
            (a, b) = (b, a % b);
        }
        if den == 0 {
            return None;
        }
        let sign = if den < 0 { -1 } else { 1 };
        let (num, den) = (sign * num / a, sign * den / a);
        (num.abs() <= LARGEST && den <= LARGEST).then_some(Ratio { num, den })
    }

    /// The fraction with a small denominator that `x` is, up to rounding.
    pub(super) fn near(x: f64) -> Option<Ratio> {
        (1..=1000_i64).find_map(|den| {
            let scaled = x * den as f64;
            let close = (scaled - scaled.round()).abs() <= 1e-12 * (1.0 + scaled.abs());
            (close && scaled.abs() < 1e6).then(|| Ratio::new(scaled.round() as i64, den)).flatten()
        })
    }

    pub(super) fn plus(self, other: Ratio) -> Option<Ratio> {
        Ratio::new(self.num * other.den + other.num * self.den, self.den * other.den)
    }

    pub(super) fn times(self, other: Ratio) -> Option<Ratio> {
        Ratio::new(self.num * other.num, self.den * other.den)
    }

    pub(super) fn inverse(self) -> Option<Ratio> {
        Ratio::new(self.den, self.num)
    }

    pub(super) fn is_zero(self) -> bool {
        self.num == 0
    }

    pub(super) fn value(self) -> f64 {
        self.num as f64 / self.den as f64
    }

    /// The number, if it is whole.
    pub(super) fn as_whole(self) -> Option<i64> {
        (self.den == 1).then_some(self.num)
    }
}

/// What a unit is made of: a named unit, or one that the scene does not say.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Symbol {
    /// `MPa`
    Named(NamedUnit),
    /// The unit of coordinates.
    Length,
    /// The unit of the variable of `steps`.
    Time,
    /// The size of a cell, where the space dimension is not known.
    Volume,
    /// The factor by which the unit of one name may be wrong.
    Sought,
}

/// A product of powers, sorted by symbol, without zero powers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Unit {
    factors: Vec<(Symbol, Ratio)>,
}

/// A unit as powers of the base units and a scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Size {
    /// Decimal logarithm of the scale against SI.
    pub(super) log_scale: f64,
    /// Powers of the base units.
    pub(super) powers: [Ratio; DIMENSIONS],
}

impl Size {
    pub(super) fn has_dimension(&self) -> bool {
        self.powers.iter().any(|p| !p.is_zero())
    }

    /// True for 1: scales are logarithms, so this is a relative tolerance.
    pub(super) fn is_one(&self) -> bool {
        !self.has_dimension() && self.log_scale.abs() < 1e-9
    }
}

impl Unit {
    /// The unit of a pure number.
    pub(super) fn pure() -> Unit {
        Unit { factors: Vec::new() }
    }

    pub(super) fn of(symbol: Symbol) -> Unit {
        Unit { factors: vec![(symbol, Ratio::ONE)] }
    }

    pub(super) fn factors(&self) -> &[(Symbol, Ratio)] {
        &self.factors
    }

    /// The product; `None` if a power leaves all bounds.
    pub(super) fn times(&self, other: &Unit) -> Option<Unit> {
        let (mut a, mut b) = (self.factors.iter().peekable(), other.factors.iter().peekable());
        let mut factors = Vec::with_capacity(self.factors.len() + other.factors.len());
        loop {
            let order = match (a.peek(), b.peek()) {
                (None, None) => return Some(Unit { factors }),
                (Some(_), None) => Ordering::Less,
                (None, Some(_)) => Ordering::Greater,
                (Some(x), Some(y)) => x.0.cmp(&y.0),
            };
            match order {
                Ordering::Less => factors.extend(a.next()),
                Ordering::Greater => factors.extend(b.next()),
                Ordering::Equal => {
                    if let (Some(x), Some(y)) = (a.next(), b.next()) {
                        let power = x.1.plus(y.1)?;
                        if !power.is_zero() {
                            factors.push((x.0, power));
                        }
                    }
                }
            }
        }
    }

    pub(super) fn to_power(&self, power: Ratio) -> Option<Unit> {
        if power.is_zero() {
            return Some(Unit::pure());
        }
        let factors = self.factors.iter().map(|(s, p)| Some((*s, p.times(power)?))).collect::<Option<_>>()?;
        Some(Unit { factors })
    }

    pub(super) fn over(&self, other: &Unit) -> Option<Unit> {
        self.times(&other.to_power(Ratio::whole(-1))?)
    }

    /// The power of a symbol.
    pub(super) fn power_of(&self, symbol: Symbol) -> Ratio {
        self.factors.iter().find(|(s, _)| *s == symbol).map_or(Ratio::ZERO, |(_, p)| *p)
    }

    /// True if some factor is not a named unit.
    pub(super) fn is_open(&self) -> bool {
        self.factors.iter().any(|(s, _)| !matches!(s, Symbol::Named(_)))
    }

    /// The unit without one of its symbols.
    pub(super) fn without(&self, symbol: Symbol) -> Unit {
        Unit { factors: self.factors.iter().copied().filter(|(s, _)| *s != symbol).collect() }
    }

    /// Powers and scale of the named units in it.
    pub(super) fn size(&self) -> Option<Size> {
        let mut size = Size { log_scale: 0.0, powers: [Ratio::ZERO; DIMENSIONS] };
        for (symbol, power) in &self.factors {
            let Symbol::Named(unit) = symbol else { continue };
            size.log_scale += power.value() * unit.log_scale();
            for (sum, one) in size.powers.iter_mut().zip(unit.powers()) {
                *sum = sum.plus(power.times(Ratio::whole(one))?)?;
            }
        }
        Some(size)
    }

    /// True if both are the same unit, without open symbols.
    pub(super) fn same(&self, other: &Unit) -> bool {
        self.over(other).is_some_and(|r| !r.is_open() && r.size().is_some_and(|s| s.is_one()))
    }

    /// The unit as a scene would write it, or `pure number`.
    pub(super) fn show(&self) -> String {
        if !self.is_open() && self.size().is_some_and(|s| s.is_one()) {
            return "pure number".to_owned();
        }
        let short = if self.weight() <= 2.0 || self.is_open() { None } else { self.shorter() };
        let shown = short.as_ref().unwrap_or(self);
        match self.size().filter(|s| !self.is_open() && !s.has_dimension() && shown.weight() > 3.0) {
            Some(size) => format!("pure number times {}", factor_text(size.log_scale)),
            None => shown.spelled(),
        }
    }

    /// How much there is to read; broken powers count as much.
    fn weight(&self) -> f64 {
        self.factors.iter().map(|(_, p)| if p.as_whole().is_some() { p.value().abs() } else { 10.0 }).sum()
    }

    /// The same unit with fewer factors: one or two of its own names or of common ones.
    fn shorter(&self) -> Option<Unit> {
        let mut names: Vec<Symbol> = self.factors.iter().map(|f| f.0).collect();
        names.extend(
            ["N", "kN", "MPa", "Pa", "mm", "m", "kg", "s", "J", "W"]
                .iter()
                .filter_map(|n| NamedUnit::find(n))
                .map(Symbol::Named),
        );
        let mut best: Option<Unit> = None;
        let powers = || (-3..=3_i64).flat_map(|i| (-3..=3_i64).map(move |j| (i, j)));
        for (at, a) in names.iter().enumerate() {
            for b in &names[at..] {
                for (i, j) in powers() {
                    if (i.abs() + j.abs()) as f64 >= best.as_ref().map_or(self.weight(), Unit::weight) {
                        continue;
                    }
                    let part = |s: Symbol, p: i64| Unit::of(s).to_power(Ratio::whole(p));
                    let unit = part(*a, i).zip(part(*b, j)).and_then(|(x, y)| x.times(&y));
                    best = unit.filter(|u| u.same(self)).or(best);
                }
            }
        }
        best
    }

    fn spelled(&self) -> String {
        let part = |(symbol, power): &(Symbol, Ratio)| {
            let name = symbol.name();
            let magnitude = Ratio { num: power.num.abs(), den: power.den };
            match magnitude.as_whole() {
                Some(1) => name,
                Some(p) => format!("{name}^{p}"),
                None => format!("{name}^({}/{})", magnitude.num, magnitude.den),
            }
        };
        let (above, below): (Vec<_>, Vec<_>) = self.factors.iter().partition(|(_, p)| p.num > 0);
        let mut text = above.into_iter().map(part).collect::<Vec<_>>().join("*");
        if text.is_empty() {
            text.push('1');
        }
        for factor in below {
            text.push('/');
            text.push_str(&part(factor));
        }
        text
    }

    /// What a quantity with these dimensions is called in mechanics.
    pub(super) fn quantity(&self) -> Option<&'static str> {
        let size = self.size().filter(|_| !self.is_open())?;
        let mut powers = [0; DIMENSIONS];
        for (p, ratio) in powers.iter_mut().zip(size.powers) {
            *p = ratio.as_whole()?;
        }
        QUANTITIES.iter().find(|(q, _)| *q == powers).map(|(_, words)| *words)
    }
}

impl Symbol {
    fn name(self) -> String {
        match self {
            Symbol::Named(unit) => unit.name(),
            Symbol::Length => "(unit of X)".to_owned(),
            Symbol::Time => "(unit of t)".to_owned(),
            Symbol::Volume => "(size of a cell)".to_owned(),
            Symbol::Sought => "?".to_owned(),
        }
    }
}

/// Powers of kg, m, s, K, A, mol, cd and the words for them.
const QUANTITIES: &[([i64; DIMENSIONS], &str)] = &[
    ([0, 1, 0, 0, 0, 0, 0], "a length"),
    ([0, 2, 0, 0, 0, 0, 0], "an area"),
    ([0, 3, 0, 0, 0, 0, 0], "a volume"),
    ([0, -1, 0, 0, 0, 0, 0], "one over a length"),
    ([0, 0, 1, 0, 0, 0, 0], "a time"),
    ([0, 0, -1, 0, 0, 0, 0], "a rate"),
    ([0, 1, -1, 0, 0, 0, 0], "a velocity"),
    ([0, 1, -2, 0, 0, 0, 0], "an acceleration"),
    ([0, 2, -1, 0, 0, 0, 0], "a diffusivity"),
    ([1, 0, 0, 0, 0, 0, 0], "a mass"),
    ([1, -3, 0, 0, 0, 0, 0], "a density"),
    ([1, 1, -2, 0, 0, 0, 0], "a force"),
    ([1, 0, -2, 0, 0, 0, 0], "a force per length"),
    ([1, -1, -2, 0, 0, 0, 0], "a stress"),
    ([1, -2, -2, 0, 0, 0, 0], "a stiffness per area"),
    ([-1, 1, 2, 0, 0, 0, 0], "one over a stress"),
    ([-1, 2, 2, 0, 0, 0, 0], "a compliance per area"),
    ([1, -1, -1, 0, 0, 0, 0], "a viscosity"),
    ([1, -2, -1, 0, 0, 0, 0], "a viscosity per length"),
    ([1, 2, -2, 0, 0, 0, 0], "an energy"),
    ([1, 2, -3, 0, 0, 0, 0], "a power"),
    ([0, 0, 0, 1, 0, 0, 0], "a temperature difference"),
    ([0, 0, 0, -1, 0, 0, 0], "a thermal expansion"),
    ([1, 1, -3, -1, 0, 0, 0], "a heat conductivity"),
];

/// Ten to a power, in six digits.
pub(super) fn factor_text(log: f64) -> String {
    let factor = 10_f64.powf(log);
    if !(1e-3..1e5).contains(&factor) {
        let text = format!("{factor:.5e}");
        let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{power}", digits.trim_end_matches('0').trim_end_matches('.'));
    }
    let text = format!("{factor:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(text: &[(&str, i64)]) -> Unit {
        text.iter().fold(Unit::pure(), |product, (name, power)| {
            let symbol = Symbol::Named(NamedUnit::find(name).unwrap_or_else(|| panic!("{name}")));
            product.times(&Unit::of(symbol).to_power(Ratio::whole(*power)).unwrap()).unwrap()
        })
    }

    #[test]
    fn the_same_quantity_has_one_size_however_it_is_written() {
        let pairs = [
            (unit(&[("MPa", 1), ("mm", 1)]), unit(&[("N", 1), ("mm", -1)])),
            (unit(&[("J", 1)]), unit(&[("N", 1), ("m", 1)])),
            (unit(&[("kW", 1), ("h", 1)]), unit(&[("MJ", 1)]).times(&unit(&[])).unwrap()),
            (unit(&[("bar", 1)]), unit(&[("kPa", 1)])),
            (unit(&[("t", 1), ("mm", 1), ("s", -2)]), unit(&[("N", 1)])),
        ];
        let same: Vec<bool> = pairs.iter().map(|(a, b)| a.same(b)).collect();
        // 1 kWh is 3.6 MJ and 1 bar is 100 kPa: the same quantity on another scale
        assert_eq!(same, [true, true, false, false, true]);
        let factor = |i: usize| 10_f64.powf(pairs[i].0.over(&pairs[i].1).unwrap().size().unwrap().log_scale);
        assert!((factor(2) - 3.6).abs() < 1e-9 && (factor(3) - 100.0).abs() < 1e-7);
    }

    #[test]
    fn units_are_shown_as_a_scene_writes_them() {
        assert_eq!(unit(&[("MPa", 1), ("mm", -1)]).show(), "MPa/mm");
        assert_eq!(unit(&[("mm", -2)]).show(), "1/mm^2");
        assert_eq!(unit(&[("MPa", 1), ("mm", 2), ("N", -1)]).show(), "pure number");
        // the root of N/MPa is mm
        let root = unit(&[("N", 1), ("MPa", -1)]).to_power(Ratio::new(1, 2).unwrap()).unwrap();
        assert_eq!(root.show(), "mm");
    }

    #[test]
    fn a_power_is_a_fraction_or_nothing() {
        assert_eq!(Ratio::near(0.5), Ratio::new(1, 2));
        assert_eq!(Ratio::near(-2.0 / 3.0), Ratio::new(-2, 3));
        assert_eq!(Ratio::near(std::f64::consts::PI), None);
        assert_eq!(Ratio::near(f64::NAN), None);
        assert_eq!(Ratio::new(1, 0), None);
        assert_eq!(Ratio::new(-4, -6), Ratio::new(2, 3));
    }
}
