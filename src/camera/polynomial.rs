//! Positive real roots of small polynomials, by isolation between the roots of the derivative.
//!
//! Between two neighbouring roots of its derivative a polynomial is monotone, so one comparison of signs tells whether
//! it has a root there, and bisection finds it; the derivative's roots come the same way, down to degree 0. No root
//! with a change of sign is missed, whatever its distance from the others, which a scan with steps cannot say.
//! Bisection runs over the *bit patterns* of positive f64 values, at most 64 steps for the whole range (0, `f64::MAX`].

/// A polynomial `c[0] + c[1] s + c[2] s² + …`; the coefficients finite.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Polynomial(Vec<f64>);

impl Polynomial {
    /// The polynomial with these coefficients, constant first; trailing zeros are dropped.
    pub(super) fn new(mut coefficients: Vec<f64>) -> Self {
        while coefficients.last() == Some(&0.0) {
            coefficients.pop();
        }
        Self(coefficients)
    }

    /// The value at `s`.
    pub(super) fn at(&self, s: f64) -> f64 {
        self.0.iter().rev().fold(0.0, |sum, c| sum * s + c)
    }

    /// The derivative.
    pub(super) fn derivative(&self) -> Self {
        Self::new(self.0.iter().enumerate().skip(1).map(|(i, c)| i as f64 * c).collect())
    }

    /// The product.
    pub(super) fn times(&self, other: &Self) -> Self {
        let mut product = vec![0.0; self.0.len() + other.0.len()];
        for (i, a) in self.0.iter().enumerate() {
            for (j, b) in other.0.iter().enumerate() {
                product[i + j] += a * b;
            }
        }
        Self::new(product)
    }

    /// `self + factor · other`.
    pub(super) fn plus(&self, factor: f64, other: &Self) -> Self {
        let get = |p: &Self, i: usize| p.0.get(i).copied().unwrap_or(0.0);
        let len = self.0.len().max(other.0.len());
        Self::new((0..len).map(|i| get(self, i) + factor * get(other, i)).collect())
    }

    /// `s^n · self`.
    pub(super) fn shifted(&self, n: usize) -> Self {
        let mut c = vec![0.0; n];
        c.extend_from_slice(&self.0);
        Self::new(c)
    }

    /// The polynomial `q` with `q(r) = self(r²)`.
    pub(super) fn of_square(&self) -> Self {
        Self::new(self.0.iter().flat_map(|&c| [c, 0.0]).collect())
    }

    /// The sign at `s > 0`: −1, 0 or 1, also where the value itself would overflow; 0 within the rounding error
    /// of the evaluation (Higham 2002, §5.1: at most 2n u Σ |cᵢ| sⁱ for Horner's scheme).
    pub(super) fn sign(&self, s: f64) -> i32 {
        // Beyond 1 the polynomial in 1/s has the same sign and stays finite.
        let horner = |x: f64, c: &mut dyn Iterator<Item = &f64>| {
            c.fold((0.0, 0.0), |(sum, size): (f64, f64), c| (sum * x + c, size * x + c.abs()))
        };
        let (value, size) = if s <= 1.0 {
            horner(s, &mut self.0.iter().rev())
        } else {
            horner(1.0 / s, &mut self.0.iter())
        };
        let noise = 2.0 * (self.0.len() as f64) * f64::EPSILON * size;
        i32::from(value > noise) - i32::from(value < -noise)
    }

    /// Points `0 < s₁ ≤ s₂ ≤ …` between which the polynomial has no change of sign; each root of odd
    /// multiplicity is among them, to the last bit or two.
    pub(super) fn sign_changes(&self) -> Vec<f64> {
        // A root at 0 is not positive: divide it out.
        let low = self.0.iter().take_while(|&&c| c == 0.0).count();
        let p = Self(self.0[low..].to_vec());
        if p.0.len() < 2 {
            return Vec::new();
        }
        let mut found = Vec::new();
        let (mut from, mut sign) = (0.0, p.sign(f64::MIN_POSITIVE));
        for to in p.derivative().sign_changes().into_iter().chain([f64::MAX]) {
            let next = p.sign(to);
            if next == 0 {
                found.push(to);
            } else if sign * next < 0 {
                found.push(bisect(from, to, |s| p.sign(s) == sign));
            }
            (from, sign) = (to, next);
        }
        found
    }

    /// The first `s > 0` at which the polynomial, positive near 0, is not positive any more, touching included;
    /// infinity if there is none.
    pub(super) fn first_positive_root(&self) -> f64 {
        let mut from = 0.0;
        for to in self.derivative().sign_changes().into_iter().chain([f64::MAX]) {
            if self.sign(to) <= 0 {
                return bisect(from, to, |s| self.sign(s) > 0);
            }
            from = to;
        }
        f64::INFINITY
    }
}

/// The least f64 of `(from, to]` for which `before` no longer holds, given that it holds near `from`, not at `to`,
/// and changes once; `0 ≤ from ≤ to`.
fn bisect(from: f64, to: f64, before: impl Fn(f64) -> bool) -> f64 {
    let (mut lo, mut hi) = (from.to_bits(), to.to_bits());
    while hi - lo > 1 {
        let mid = lo + (hi - lo) / 2;
        if before(f64::from_bits(mid)) { lo = mid } else { hi = mid }
    }
    f64::from_bits(hi)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_that_lie_closer_than_any_scan_would_step_are_told_apart() {
        let (a, b, c) = (1.0, 1.000_001, 5e7);
        let root = |r: f64| Polynomial::new(vec![-r, 1.0]);
        let p = root(a).times(&root(b)).times(&root(c));
        let found = p.sign_changes();
        assert_eq!(found.len(), 3, "{found:?}");
        for (f, r) in found.into_iter().zip([a, b, c]) {
            assert!((f - r).abs() < 1e-8 * r, "{f} {r}");
        }
    }

    #[test]
    fn a_root_that_only_touches_counts_as_the_first() {
        // (s − 2)² (10 − s)
        let square = Polynomial::new(vec![4.0, -4.0, 1.0]);
        let first = square.times(&Polynomial::new(vec![10.0, -1.0])).first_positive_root();
        assert!((first - 2.0).abs() < 1e-6, "{first}");
    }

    #[test]
    fn a_polynomial_without_positive_roots_has_none() {
        assert!(Polynomial::new(vec![1.0, 3.0, 0.5]).first_positive_root().is_infinite());
        assert!(Polynomial::new(vec![1.0]).first_positive_root().is_infinite());
        assert!(Polynomial::new(vec![0.0, 0.0, 1.0]).sign_changes().is_empty());
    }

    #[test]
    fn a_root_at_the_far_end_of_the_range_is_found() {
        let first = Polynomial::new(vec![1.0, -1e-200]).first_positive_root();
        assert!((first / 1e200 - 1.0).abs() < 1e-12);
    }
}
