//! Functions of a footprint's parameters, affine up to a bounded rest: their ranges over it, and their zeros.
//!
//! The rest bounds the part of second order, `sum |h_ij| / 2`; it is 0 where the expansion stops at the first order.

use dualux_dual::Expansion;

/// An affine function of the parameters, but for `rest`.
#[derive(Clone, Copy, Debug)]
pub struct Linear<const N: usize> {
    /// At the centre.
    pub value: f64,
    /// By each parameter.
    pub gradient: [f64; N],
    /// By how much it may differ from that anywhere in the footprint.
    pub rest: f64,
}

impl<const N: usize> From<Expansion<f64, N>> for Linear<N> {
    fn from(e: Expansion<f64, N>) -> Self {
        let rest = e.hessian.iter().flatten().fold(0.0, |s: f64, h| s + h.abs());
        Linear { value: e.value, gradient: e.gradient, rest: 0.5 * rest }
    }
}

impl<const N: usize> Linear<N> {
    /// At p, without the rest.
    pub fn at(&self, p: &[f64; N]) -> f64 {
        self.gradient.iter().zip(p).fold(self.value, |s, (g, p)| s + g * p)
    }

    /// How far it gets from its value; `round`: with the last two parameters in the unit disk.
    #[inline(always)]
    pub fn reach(&self, round: bool) -> f64 {
        let [square, disk] = if round { [N - 2, N] } else { [N, N] };
        let sum: f64 = self.gradient[..square].iter().map(|g| g.abs()).sum();
        sum + self.gradient[square..disk].iter().map(|g| g * g).sum::<f64>().sqrt() + self.rest
    }

    /// Whether it can vanish, or is not finite.
    #[inline(always)]
    pub fn vanishes(&self, round: bool) -> bool {
        !(self.value.abs() > self.reach(round))
    }

    /// Its sign where it cannot vanish, else 0.
    #[inline(always)]
    pub fn side(&self, round: bool) -> i8 {
        let [square, disk] = if round { [N - 2, N] } else { [N, N] };
        let sum: f64 = self.gradient[..square].iter().map(|g| g.abs()).sum();
        let (left, disk) =
            (self.value.abs() - sum - self.rest, self.gradient[square..disk].iter().map(|g| g * g).sum::<f64>());
        match (left > 0.0 && left * left > disk, self.value > 0.0) {
            (true, true) => 1,
            (true, false) => -1,
            (false, _) => 0,
        }
    }

    /// Distance of its zeros from the centre.
    pub fn distance(&self) -> f64 {
        let g2: f64 = self.gradient.iter().map(|g| g * g).sum();
        if g2 > 0.0 { self.value.abs() / g2.sqrt() } else { f64::INFINITY }
    }

    /// Parameters at which its affine part vanishes, with those of `fixed` given; the others no larger than need be, `None` if larger
    /// than 1, or where even the rest cannot make up for it.
    pub fn root(&self, fixed: &[Option<f64>; N]) -> Option<[f64; N]> {
        let (mut rest, mut reach) = (self.value, 0.0);
        for k in 0..N {
            match fixed[k] {
                Some(p) => rest += self.gradient[k] * p,
                None => reach += self.gradient[k].abs(),
            }
        }
        let s = -rest / reach;
        let near = s.abs() <= 1.0 || rest.abs() <= reach + self.rest;
        near.then(|| std::array::from_fn(|k| fixed[k].unwrap_or(s.clamp(-1.0, 1.0) * self.gradient[k].signum())))
    }
}
