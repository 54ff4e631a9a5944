//! Lanes: a law or a pair term is written once over [`Lane`] and runs on one particle (`f64`) or on
//! eight neighbouring slots at a time ([`F64x8`]), with the same bits.
//!
//! The instruction set is chosen at run time ([`vectorised`]); every operation here is exactly
//! rounded, fused multiply-adds included, so the choice does not change a result.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// Slots in a slice.
pub const WIDTH: usize = 8;

/// One value, or one value per slot of a slice.
pub trait Lane:
    Copy
    + Send
    + Sync
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Particles per value.
    const WIDTH: usize;
    /// The same in every lane.
    fn splat(value: f64) -> Self;
    /// `self * a + b`, rounded once.
    fn mul_add(self, a: Self, b: Self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// The smaller; `other` where either is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; `other` where either is NaN.
    fn max(self, other: Self) -> Self;
    /// `yes` where `self > 0`, else `no`.
    fn if_positive(self, yes: Self, no: Self) -> Self;
    /// First guess of `self^(-1/3)` for positive values, within 4 %.
    fn inverse_cbrt_guess(self) -> Self;
    /// Reads from `from[at..]`.
    fn load(from: &[f64], at: usize) -> Self;
    /// Writes to `to[at..]`.
    fn store(self, to: &mut [f64], at: usize);
    /// The lanes, padded with the first.
    fn lanes(self) -> [f64; WIDTH];

    /// `self^(-1/3)` for positive values: Newton's iteration for y^-3 = x.
    #[inline(always)]
    fn inverse_cbrt(self) -> Self {
        let mut y = self.inverse_cbrt_guess();
        for _ in 0..4 {
            let residual = Self::splat(1.0) - self * y * (y * y);
            y = (y * Self::splat(1.0 / 3.0)).mul_add(residual, y);
        }
        y
    }
}

/// Guess by a third of the exponent; the constant balances the error over one octave of three.
#[inline(always)]
fn inverse_cbrt_guess(x: f64) -> f64 {
    let high = x.to_bits() >> 32;
    let third = (high.wrapping_mul(0x5555_5556)) >> 32;
    f64::from_bits(0x553E_F0FF_u64.wrapping_sub(third) << 32)
}

impl Lane for f64 {
    const WIDTH: usize = 1;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        f64::mul_add(self, a, b)
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    #[inline(always)]
    fn if_positive(self, yes: Self, no: Self) -> Self {
        if self > 0.0 { yes } else { no }
    }
    #[inline(always)]
    fn inverse_cbrt_guess(self) -> Self {
        inverse_cbrt_guess(self)
    }
    #[inline(always)]
    fn load(from: &[f64], at: usize) -> Self {
        from[at]
    }
    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        to[at] = self;
    }
    #[inline(always)]
    fn lanes(self) -> [f64; WIDTH] {
        [self; WIDTH]
    }
}

/// Eight slots.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub struct F64x8(pub [f64; WIDTH]);

// Plain loops over the eight lanes: the compiler turns each into one or two vector instructions in
// the context of `vectorised`, and never leaves that context as a closure might.
macro_rules! lanewise {
    (|$i:ident| $value:expr) => {{
        let mut out = [0.0; WIDTH];
        for $i in 0..WIDTH {
            out[$i] = $value;
        }
        F64x8(out)
    }};
}

macro_rules! operator {
    ($trait:ident $method:ident $op:tt) => {
        impl $trait for F64x8 {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                lanewise!(|i| self.0[i] $op other.0[i])
            }
        }
    };
}
operator!(Add add +);
operator!(Sub sub -);
operator!(Mul mul *);
operator!(Div div /);

impl Neg for F64x8 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        lanewise!(|i| -self.0[i])
    }
}

impl Lane for F64x8 {
    const WIDTH: usize = WIDTH;
    #[inline(always)]
    fn splat(value: f64) -> Self {
        F64x8([value; WIDTH])
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        lanewise!(|i| f64::mul_add(self.0[i], a.0[i], b.0[i]))
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        lanewise!(|i| self.0[i].sqrt())
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        lanewise!(|i| if self.0[i] < other.0[i] {
            self.0[i]
        } else {
            other.0[i]
        })
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        lanewise!(|i| if self.0[i] > other.0[i] {
            self.0[i]
        } else {
            other.0[i]
        })
    }
    #[inline(always)]
    fn if_positive(self, yes: Self, no: Self) -> Self {
        lanewise!(|i| if self.0[i] > 0.0 { yes.0[i] } else { no.0[i] })
    }
    #[inline(always)]
    fn inverse_cbrt_guess(self) -> Self {
        lanewise!(|i| inverse_cbrt_guess(self.0[i]))
    }
    #[inline(always)]
    fn load(from: &[f64], at: usize) -> Self {
        let from: &[f64; WIDTH] = from[at..at + WIDTH].try_into().expect("eight values");
        F64x8(*from)
    }
    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        to[at..at + WIDTH].copy_from_slice(&self.0);
    }
    #[inline(always)]
    fn lanes(self) -> [f64; WIDTH] {
        self.0
    }
}

/// Runs `work` compiled for the widest vectors that this processor has. Everything that `work`
/// calls must be `#[inline(always)]` down to the operations of [`Lane`].
#[inline(always)]
pub fn vectorised<R>(work: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(work)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inverse_cube_root_is_accurate_and_the_same_in_both_widths() {
        let mut worst: f64 = 0.0;
        for i in 0..4000 {
            let x = 10f64.powf(-6.0 + i as f64 * 0.003);
            let y = Lane::inverse_cbrt(x);
            worst = worst.max((y * x.cbrt() - 1.0).abs());
            let wide = vectorised(
                #[inline(always)]
                || Lane::inverse_cbrt(F64x8([x; WIDTH])),
            );
            assert_eq!(wide.0[3].to_bits(), y.to_bits());
        }
        println!("relative error {worst:e} (tolerance 1e-15)");
        assert!(worst < 1e-15);
    }
}
