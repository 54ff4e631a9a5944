//! Lanes: a law or a pair term is written once over [`Lane`] and runs on one particle (`f64`) or on
//! as many neighbouring slots as a vector register holds ([`Wide`]), with the same bits.
//!
//! The instruction set is chosen at run time ([`vectorised`]); every operation here is exactly
//! rounded, fused multiply-adds included, so the choice does not change a result.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

/// Slots in a slice: a multiple of every vector width.
pub const SLICE: usize = 8;

/// Storage of one component of a slice.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub struct Slots(pub [f64; SLICE]);

/// One value, or one value per slot of (a part of) a slice.
pub trait Lane:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    /// Proof that the processor has the instructions; needed to make a value.
    type Token: Copy + Send + Sync;
    /// Particles per value.
    const WIDTH: usize;
    /// The proof that came with this value.
    fn token(self) -> Self::Token;
    /// The same in every lane.
    fn splat(token: Self::Token, value: f64) -> Self;
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
    /// Reads from `from[at..]`.
    fn load(token: Self::Token, from: &[f64], at: usize) -> Self;
    /// Writes to `to[at..]`.
    fn store(self, to: &mut [f64], at: usize);
    /// Calls `each(lane, value)` in the order of the lanes.
    fn for_lanes(self, each: impl FnMut(usize, f64));
    /// First guess of `self^(-1/3)` for positive values, within 4 %.
    fn inverse_cbrt_guess(self) -> Self;

    /// The same in every lane, in the company of this value.
    #[inline(always)]
    fn of(self, value: f64) -> Self {
        Self::splat(self.token(), value)
    }

    /// `self^(-1/3)` for positive values: Newton's iteration for y^-3 = x.
    #[inline(always)]
    fn inverse_cbrt(self) -> Self {
        let mut y = self.inverse_cbrt_guess();
        for _ in 0..4 {
            let residual = self.of(1.0) - self * y * (y * y);
            y = (y * self.of(1.0 / 3.0)).mul_add(residual, y);
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
    type Token = ();
    const WIDTH: usize = 1;
    #[inline(always)]
    fn token(self) {}
    #[inline(always)]
    fn splat((): (), value: f64) -> Self {
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
    fn load((): (), from: &[f64], at: usize) -> Self {
        from[at]
    }
    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        to[at] = self;
    }
    #[inline(always)]
    fn for_lanes(self, mut each: impl FnMut(usize, f64)) {
        each(0, self);
    }
    #[inline(always)]
    fn inverse_cbrt_guess(self) -> Self {
        inverse_cbrt_guess(self)
    }
}

/// A vector register.
#[derive(Clone, Copy)]
pub struct Wide<S: Simd> {
    simd: S,
    value: S::f64s,
}

macro_rules! operator {
    ($trait:ident $method:ident $call:ident) => {
        impl<S: Simd> $trait for Wide<S> {
            type Output = Self;
            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self {
                    value: self.simd.$call(self.value, other.value),
                    ..self
                }
            }
        }
    };
}
operator!(Add add add_f64s);
operator!(Sub sub sub_f64s);
operator!(Mul mul mul_f64s);
operator!(Div div div_f64s);

impl<S: Simd> Neg for Wide<S> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            value: self.simd.neg_f64s(self.value),
            ..self
        }
    }
}

impl<S: Simd> Wide<S> {
    /// `self` where `self > other`, else `other`: the order of the operands decides for NaN, alike
    /// on every instruction set.
    #[inline(always)]
    fn select_greater(self, other: Self, yes: Self, no: Self) -> Self {
        let mask = self.simd.greater_than_f64s(self.value, other.value);
        Self {
            value: self.simd.select_f64s(mask, yes.value, no.value),
            ..self
        }
    }
}

impl<S: Simd> Lane for Wide<S> {
    type Token = S;
    const WIDTH: usize = S::F64_LANES;
    #[inline(always)]
    fn token(self) -> S {
        self.simd
    }
    #[inline(always)]
    fn splat(simd: S, value: f64) -> Self {
        Self {
            simd,
            value: simd.splat_f64s(value),
        }
    }
    #[inline(always)]
    fn mul_add(self, a: Self, b: Self) -> Self {
        Self {
            value: self.simd.mul_add_f64s(self.value, a.value, b.value),
            ..self
        }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self {
            value: self.simd.sqrt_f64s(self.value),
            ..self
        }
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        other.select_greater(self, self, other)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.select_greater(other, self, other)
    }
    #[inline(always)]
    fn if_positive(self, yes: Self, no: Self) -> Self {
        self.select_greater(self.of(0.0), yes, no)
    }
    #[inline(always)]
    fn load(simd: S, from: &[f64], at: usize) -> Self {
        let (whole, _) = S::as_simd_f64s(&from[at..at + Self::WIDTH]);
        Self {
            simd,
            value: whole[0],
        }
    }
    #[inline(always)]
    fn store(self, to: &mut [f64], at: usize) {
        let (whole, _) = S::as_mut_simd_f64s(&mut to[at..at + Self::WIDTH]);
        whole[0] = self.value;
    }
    #[inline(always)]
    fn for_lanes(self, mut each: impl FnMut(usize, f64)) {
        let values: &[f64] = bytemuck::cast_slice(std::slice::from_ref(&self.value));
        for (lane, value) in values.iter().enumerate() {
            each(lane, *value);
        }
    }
    #[inline(always)]
    fn inverse_cbrt_guess(self) -> Self {
        let mut guess = self;
        let values: &mut [f64] = bytemuck::cast_slice_mut(std::slice::from_mut(&mut guess.value));
        for value in values {
            *value = inverse_cbrt_guess(*value);
        }
        guess
    }
}

/// A running sum or minimum by the place in a slice, so that its order, and with it the bits, do not
/// depend on the width of the vectors.
#[derive(Clone, Copy)]
pub struct PerSlot([f64; SLICE]);

impl PerSlot {
    /// Starts everywhere with `value`.
    pub fn new(value: f64) -> Self {
        Self([value; SLICE])
    }
    /// Adds the value for the slots from `at`.
    #[inline(always)]
    pub fn add<T: Lane>(&mut self, at: usize, value: T) {
        let sum = T::load(value.token(), &self.0, at % SLICE) + value;
        sum.store(&mut self.0, at % SLICE);
    }
    /// Takes the minimum with the value for the slots from `at`; a value that is NaN is ignored.
    #[inline(always)]
    pub fn min<T: Lane>(&mut self, at: usize, value: T) {
        let least = value.min(T::load(value.token(), &self.0, at % SLICE));
        least.store(&mut self.0, at % SLICE);
    }
    /// Sum over the slice.
    pub fn sum(&self) -> f64 {
        self.0.iter().sum()
    }
    /// Minimum over the slice.
    pub fn least(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Work on the slices of a slab, written once over lanes.
pub trait Work {
    /// What it returns.
    type Output;
    /// Does the work. Implementations and all they call are `#[inline(always)]`, closures included,
    /// down to the operations of [`Lane`]: only then do they get the caller's instruction set.
    fn run<T: Lane>(self, token: T::Token) -> Self::Output;
}

struct Dispatch<W>(W);

impl<W: Work> pulp::WithSimd for Dispatch<W> {
    type Output = W::Output;
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> W::Output {
        self.0.run::<Wide<S>>(simd)
    }
}

/// Runs `work` on the widest vectors that this processor has.
pub fn vectorised<W: Work>(work: W) -> W::Output {
    pulp::Arch::new().dispatch(Dispatch(work))
}

/// Runs `work` on the AVX2 instructions, for the tests; `None` where the processor has none.
#[cfg(all(test, target_arch = "x86_64"))]
pub fn on_avx2<W: Work>(work: W) -> Option<W::Output> {
    use pulp::WithSimd;
    struct Inside<W>(W, pulp::x86::V3);
    impl<W: Work> pulp::NullaryFnOnce for Inside<W> {
        type Output = W::Output;
        #[inline(always)]
        fn call(self) -> W::Output {
            Dispatch(self.0).with_simd(self.1)
        }
    }
    let avx2 = pulp::x86::V3::try_new()?;
    Some(avx2.vectorize(Inside(work, avx2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    struct CubeRoots<'a>(&'a [f64], &'a mut [f64]);
    impl Work for CubeRoots<'_> {
        type Output = ();
        #[inline(always)]
        fn run<T: Lane>(self, token: T::Token) {
            for at in (0..self.0.len()).step_by(T::WIDTH) {
                T::load(token, self.0, at).inverse_cbrt().store(self.1, at);
            }
        }
    }

    #[test]
    fn inverse_cube_root_is_accurate_and_the_same_in_every_width() {
        let x: Vec<f64> = (0..4000)
            .map(|i| 10f64.powf(-6.0 + f64::from(i) * 0.003))
            .collect();
        let (mut wide, mut single) = (vec![0.0; x.len()], vec![0.0; x.len()]);
        vectorised(CubeRoots(&x, &mut wide));
        CubeRoots(&x, &mut single).run::<f64>(());
        let mut worst: f64 = 0.0;
        for (i, x) in x.iter().enumerate() {
            worst = worst.max((wide[i] * x.cbrt() - 1.0).abs());
            assert_eq!(wide[i].to_bits(), single[i].to_bits());
        }
        println!("relative error {worst:e} (tolerance 1e-15)");
        assert!(worst < 1e-15);
    }
}
