//! The branch of a projection at a point, its regularisation, and where their numbers stand.
//!
//! A projection `t = P(x)` on a half-line or a ball is affine on each of its branches. In the frozen form of a term
//! (`frozen.rs`) the branch is data: a few numbers at each integration point, inputs of its kernels, which the runtime
//! chooses (`runtime/contact`). How the law differs from what is written stands once for all points of a term.
//! [`BranchLayout`] alone knows which number is which, for the compiler that reads them as slots and for the runtime that
//! writes them.
//!
//! With `x' = (1 - d) x` and `p` the value on the branch:
//! - half-line, entry by entry: open `p = 0`, closed `p = x'`;
//! - ball: stick `p = x'`, slip `p = f r e + k (x' - e (e.x'))` with the radius r, the direction of slip e and the factor
//!   k across it.
//!
//! The factor `f` on the radius is 1 but for continuation in the friction; the compliance `d` is 0 but while contact is
//! soft: with `x = t + d/(1-d) t` the law holds for an argument less a part of the traction, as if a layer lay between the
//! sides. The value is `t = p + w (x' - p)`: the overstress `w` is 0 but while traction may exceed its bound, as in a
//! viscoplastic law (Duvaut and Lions 1976) with `x' - t` in place of a velocity. The radius of a ball is made of `p`.
//!
//! Promises: numbers of one projection do not overlap those of another; all zero is the branch that is open.

/// The convex set of a projection.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProjectionKind {
    /// Numbers that are not negative, for each entry (`pos_part`).
    HalfLine,
    /// A ball (`Ball_projection`).
    Ball,
}

/// The affine function that a projection is replaced by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Branch<'a> {
    /// Zero: an entry of a half-line that is open.
    Open,
    /// The argument: an entry of a half-line that is closed, or a point that sticks.
    Stick,
    /// A point that slips on its ball; one whose ball has no radius is open.
    Slip {
        /// The direction of slip, of length 1 unless there is none yet.
        along: &'a [f64],
        /// The part of the argument across that direction which the value keeps.
        across: f64,
    },
}

/// How many numbers some projections have.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BranchSizes {
    /// At each point: branches.
    pub point: usize,
    /// Once a term: regularisation.
    pub term: usize,
}

/// The numbers of a ball that slips, to be written.
#[derive(Debug)]
pub struct SlipMut<'a> {
    /// The direction of slip.
    pub along: &'a mut [f64],
    /// The part of the argument across it that the value keeps.
    pub across: &'a mut f64,
}

/// How the law of a projection differs from what is written, the same at all points.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BranchRegularisation {
    /// The part of the argument that a compliant layer takes.
    pub compliance: f64,
    /// The part of the argument beyond its bound that the value keeps.
    pub overstress: f64,
}

/// Numbers of a ball at a point before the direction of slip: stick, factor across the direction.
const BALL_NUMBERS: usize = 2;

/// Where the branch of one projection stands among the numbers of a point, and its regularisation among those of the term.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BranchLayout {
    kind: ProjectionKind,
    /// Entries of the argument.
    n: usize,
    /// Its first numbers.
    first: BranchSizes,
}

impl BranchLayout {
    /// The branch of a projection of `n` entries behind `first` numbers of others.
    #[must_use]
    pub fn new(kind: ProjectionKind, n: usize, first: BranchSizes) -> Self {
        Self { kind, n, first }
    }

    /// The first numbers behind its own: how many there are, if this is the last projection.
    #[must_use]
    pub fn end(&self) -> BranchSizes {
        let (point, term) = match self.kind {
            ProjectionKind::HalfLine => (self.n, 2),
            ProjectionKind::Ball => (BALL_NUMBERS + self.n, 3),
        };
        BranchSizes { point: self.first.point + point, term: self.first.term + term }
    }

    /// At a point: the mask of an entry of a half-line, which is closed, or of a ball, which sticks (entry 0).
    pub(crate) fn mask(&self, entry: usize) -> usize {
        self.first.point + entry
    }

    /// At a point: the factor across the direction of slip of a ball.
    pub(crate) fn across(&self) -> usize {
        self.first.point + 1
    }

    /// At a point: an entry of the direction of slip of a ball.
    pub(crate) fn along(&self, entry: usize) -> usize {
        self.first.point + BALL_NUMBERS + entry
    }

    /// Of the term: the compliance.
    pub(crate) fn compliance(&self) -> usize {
        self.first.term
    }

    /// Of the term: the overstress.
    pub(crate) fn overstress(&self) -> usize {
        self.first.term + 1
    }

    /// Of the term: the factor on the radius of a ball.
    pub(crate) fn friction(&self) -> usize {
        self.first.term + 2
    }

    /// The masks: one for each entry of a half-line, one for a ball.
    fn masks(&self) -> std::ops::Range<usize> {
        let n = match self.kind {
            ProjectionKind::HalfLine => self.n,
            ProjectionKind::Ball => 1,
        };
        self.first.point..self.first.point + n
    }

    /// The branch at a point with these numbers: of an entry of a half-line, or of a ball (entry 0).
    #[must_use]
    pub fn branch<'a>(&self, point: &'a [f64], entry: usize) -> Branch<'a> {
        let is_on = point[self.mask(entry)] > 0.5;
        match self.kind {
            _ if is_on => Branch::Stick,
            ProjectionKind::HalfLine => Branch::Open,
            ProjectionKind::Ball => {
                Branch::Slip { along: &point[self.along(0)..self.along(self.n)], across: point[self.across()] }
            }
        }
    }

    /// True where an entry of a half-line is closed, or a ball sticks (entry 0).
    #[must_use]
    pub fn sticks(&self, point: &[f64], entry: usize) -> bool {
        self.branch(point, entry) == Branch::Stick
    }

    /// Closes an entry of a half-line whose argument is not negative, opens it otherwise. Other numbers stay.
    pub fn close_by(&self, point: &mut [f64], entry: usize, argument: f64) {
        point[self.mask(entry)] = f64::from(u8::from(argument >= 0.0));
    }

    /// Lets a ball slip. Other numbers stay.
    pub fn slip(&self, point: &mut [f64]) {
        point[self.mask(0)] = 0.0;
    }

    /// Closes all entries of a half-line; lets a ball stick. Other numbers stay.
    pub fn stick(&self, point: &mut [f64]) {
        point[self.masks()].fill(1.0);
    }

    /// Changes to the other branch: of an entry of a half-line, or of a ball (entry 0). Other numbers stay.
    pub fn cross(&self, point: &mut [f64], entry: usize) {
        let mask = &mut point[self.mask(entry)];
        *mask = 1.0 - *mask;
    }

    /// The numbers that a ball slips by. They are kept while it sticks.
    pub fn slip_mut<'a>(&self, point: &'a mut [f64]) -> SlipMut<'a> {
        let (numbers, along) = point[..self.along(self.n)].split_at_mut(self.along(0));
        SlipMut { along, across: &mut numbers[self.across()] }
    }

    /// Sets the factor on the radius among the numbers of a term; that of a half-line has no radius.
    pub fn set_friction(&self, term: &mut [f64], factor: f64) {
        if self.kind == ProjectionKind::Ball {
            term[self.friction()] = factor;
        }
    }

    /// How the law differs from what is written, from the numbers of a term.
    #[must_use]
    pub fn regularisation(&self, term: &[f64]) -> BranchRegularisation {
        BranchRegularisation { compliance: term[self.compliance()], overstress: term[self.overstress()] }
    }

    /// Sets among the numbers of a term how the law differs from what is written.
    pub fn set_regularisation(&self, term: &mut [f64], regularisation: BranchRegularisation) {
        term[self.compliance()] = regularisation.compliance;
        term[self.overstress()] = regularisation.overstress;
    }

    /// True if the branches of two points differ: open or closed, stick or slip, slip against itself.
    #[must_use]
    pub fn differs(&self, a: &[f64], b: &[f64]) -> bool {
        if a[self.masks()] != b[self.masks()] {
            return true;
        }
        match (self.kind, self.branch(a, 0), self.branch(b, 0)) {
            (ProjectionKind::Ball, Branch::Slip { along: a, .. }, Branch::Slip { along: b, .. }) => {
                a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() < 0.0
            }
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pressure, and a friction of two entries behind it.
    fn layouts() -> (BranchLayout, BranchLayout) {
        let half_line = BranchLayout::new(ProjectionKind::HalfLine, 1, BranchSizes::default());
        (half_line, BranchLayout::new(ProjectionKind::Ball, 2, half_line.end()))
    }

    #[test]
    fn what_is_written_for_one_projection_leaves_the_other_alone() {
        let (half_line, ball) = layouts();
        let (mut point, mut term) = (vec![0.0; ball.end().point], vec![0.0; ball.end().term]);
        half_line.stick(&mut point);
        half_line.set_regularisation(&mut term, BranchRegularisation { compliance: 0.25, overstress: 0.5 });
        assert_eq!(ball.branch(&point, 0), Branch::Slip { along: &[0.0, 0.0], across: 0.0 });
        assert_eq!(ball.regularisation(&term), BranchRegularisation::default());
        let SlipMut { along, across } = ball.slip_mut(&mut point);
        along.copy_from_slice(&[0.6, -0.8]);
        *across = 0.125;
        half_line.set_friction(&mut term, 9.0);
        ball.set_friction(&mut term, 3.0);
        ball.set_regularisation(&mut term, BranchRegularisation { compliance: 0.75, overstress: 0.1 });
        assert_eq!(half_line.branch(&point, 0), Branch::Stick);
        assert_eq!(half_line.regularisation(&term), BranchRegularisation { compliance: 0.25, overstress: 0.5 });
        assert_eq!(ball.branch(&point, 0), Branch::Slip { along: &[0.6, -0.8], across: 0.125 });
        assert_eq!(term, [0.25, 0.5, 0.75, 0.1, 3.0]);
    }

    #[test]
    fn a_point_that_sticks_keeps_the_direction_in_which_it_slipped() {
        let (_, ball) = layouts();
        let mut point = vec![0.0; ball.end().point];
        ball.slip_mut(&mut point).along.copy_from_slice(&[1.0, 0.0]);
        ball.cross(&mut point, 0);
        assert_eq!(ball.branch(&point, 0), Branch::Stick);
        ball.cross(&mut point, 0);
        assert_eq!(ball.branch(&point, 0), Branch::Slip { along: &[1.0, 0.0], across: 0.0 });
    }

    #[test]
    fn slip_differs_from_slip_only_where_it_goes_back() {
        let (_, ball) = layouts();
        let slipping = |along: [f64; 2]| {
            let mut point = vec![0.0; ball.end().point];
            ball.slip_mut(&mut point).along.copy_from_slice(&along);
            point
        };
        let (east, north_east, west) = (slipping([1.0, 0.0]), slipping([0.6, 0.8]), slipping([-1.0, 0.0]));
        assert!(!ball.differs(&east, &north_east));
        assert!(ball.differs(&east, &west));
        let mut sticking = west.clone();
        ball.stick(&mut sticking);
        assert!(ball.differs(&east, &sticking) && ball.differs(&sticking, &east));
        assert!(!ball.differs(&sticking, &sticking));
    }
}
