//! Lanes: a law or a pair term is written once over [`Lane`] and runs on one particle (`f64`) or on
//! as many neighbouring slots as a vector register holds ([`Wide`]), with the same bits.
//!
//! The instruction set is chosen at run time ([`vectorised`]); every operation here is exactly
//! rounded, fused multiply-adds included, so the choice does not change a result.
//!
//! Sums over pairs ([`PairWork`]) need arithmetic alone and may run on twice as many lanes of half the
//! precision (`f32`, [`Long`]); what belongs to one particle ([`Work`]) is in double precision always. Lanes
//! of either precision read and write arrays of both.

use std::ops::{Add, Div, Mul, Neg, Sub};

use pulp::Simd;

/// Slots in a slice of numbers in double precision: a multiple of every vector width.
pub const SLICE: usize = 8;
/// The same of numbers in single precision; whole slices of the other ones, too.
pub const LONG_SLICE: usize = 16;

/// Storage of one component of a slice.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub struct Slots(pub [f64; SLICE]);

/// The same in single precision.
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C, align(64))]
pub struct LongSlots(pub [f32; LONG_SLICE]);

/// A number that arrays hold and that lanes calculate with.
pub trait Real: bytemuck::Pod + Send + Sync + PartialEq + std::fmt::Debug {
    /// Slots in a slice.
    const SLICE: usize;
    /// Storage of one component of a slice.
    type Slots: bytemuck::Pod + Send + Sync + PartialEq + std::fmt::Debug;
    /// A slice of the number nearest to a value.
    fn slots(value: f64) -> Self::Slots;
    /// The number nearest to a value.
    fn nearest(value: f64) -> Self;
    /// Its value.
    fn value(self) -> f64;
    /// Reads a vector of double precision.
    fn load_wide<S: Simd>(simd: S, from: &[Self]) -> S::f64s;
    /// Reads a vector of single precision.
    fn load_long<S: Simd>(simd: S, from: &[Self]) -> S::f32s;
    /// Writes a vector of double precision.
    fn store_wide<S: Simd>(value: S::f64s, to: &mut [Self]);
    /// Writes a vector of single precision.
    fn store_long<S: Simd>(value: S::f32s, to: &mut [Self]);
    /// Runs `work` on the widest vectors of such numbers that this processor has.
    fn vectorised<W: PairWork>(work: W) -> W::Output;
    /// Runs `work` on one particle at a time.
    #[cfg(test)]
    fn one_by_one<W: PairWork>(work: W) -> W::Output;
    /// Runs `work` on the AVX2 instructions; `None` where the processor has none.
    #[cfg(all(test, target_arch = "x86_64"))]
    fn on_avx2<W: PairWork>(work: W) -> Option<W::Output>;
}

impl Real for f64 {
    const SLICE: usize = SLICE;
    type Slots = Slots;
    fn slots(value: f64) -> Slots {
        Slots([value; SLICE])
    }
    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value
    }
    #[inline(always)]
    fn value(self) -> f64 {
        self
    }
    #[inline(always)]
    fn load_wide<S: Simd>(_: S, from: &[Self]) -> S::f64s {
        S::as_simd_f64s(from).0[0]
    }
    #[inline(always)]
    fn load_long<S: Simd>(simd: S, from: &[Self]) -> S::f32s {
        let mut value = simd.splat_f32s(0.0);
        let lanes: &mut [f32] = bytemuck::cast_slice_mut(std::slice::from_mut(&mut value));
        lanes.iter_mut().zip(from).for_each(|(l, v)| *l = *v as f32);
        value
    }
    #[inline(always)]
    fn store_wide<S: Simd>(value: S::f64s, to: &mut [Self]) {
        S::as_mut_simd_f64s(to).0[0] = value;
    }
    #[inline(always)]
    fn store_long<S: Simd>(value: S::f32s, to: &mut [Self]) {
        let lanes: &[f32] = bytemuck::cast_slice(std::slice::from_ref(&value));
        to.iter_mut()
            .zip(lanes)
            .for_each(|(t, l)| *t = f64::from(*l));
    }
    fn vectorised<W: PairWork>(work: W) -> W::Output {
        dispatch(OnDoubles(work))
    }
    #[cfg(test)]
    fn one_by_one<W: PairWork>(work: W) -> W::Output {
        work.run::<f64>(())
    }
    #[cfg(all(test, target_arch = "x86_64"))]
    fn on_avx2<W: PairWork>(work: W) -> Option<W::Output> {
        narrow(OnDoubles(work))
    }
}

impl Real for f32 {
    const SLICE: usize = LONG_SLICE;
    type Slots = LongSlots;
    fn slots(value: f64) -> LongSlots {
        LongSlots([value as f32; LONG_SLICE])
    }
    #[inline(always)]
    fn nearest(value: f64) -> Self {
        value as f32
    }
    #[inline(always)]
    fn value(self) -> f64 {
        f64::from(self)
    }
    #[inline(always)]
    fn load_wide<S: Simd>(simd: S, from: &[Self]) -> S::f64s {
        let mut value = simd.splat_f64s(0.0);
        let lanes: &mut [f64] = bytemuck::cast_slice_mut(std::slice::from_mut(&mut value));
        lanes
            .iter_mut()
            .zip(from)
            .for_each(|(l, v)| *l = f64::from(*v));
        value
    }
    #[inline(always)]
    fn load_long<S: Simd>(_: S, from: &[Self]) -> S::f32s {
        S::as_simd_f32s(from).0[0]
    }
    #[inline(always)]
    fn store_wide<S: Simd>(value: S::f64s, to: &mut [Self]) {
        let lanes: &[f64] = bytemuck::cast_slice(std::slice::from_ref(&value));
        to.iter_mut().zip(lanes).for_each(|(t, l)| *t = *l as f32);
    }
    #[inline(always)]
    fn store_long<S: Simd>(value: S::f32s, to: &mut [Self]) {
        S::as_mut_simd_f32s(to).0[0] = value;
    }
    fn vectorised<W: PairWork>(work: W) -> W::Output {
        dispatch(OnSingles(work))
    }
    #[cfg(test)]
    fn one_by_one<W: PairWork>(work: W) -> W::Output {
        work.run::<f32>(())
    }
    #[cfg(all(test, target_arch = "x86_64"))]
    fn on_avx2<W: PairWork>(work: W) -> Option<W::Output> {
        narrow(OnSingles(work))
    }
}

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
    /// Precision.
    type Real: Real;
    /// Particles per value.
    const WIDTH: usize;
    /// What makes a denominator positive and is nothing beside any other.
    const TINY: f64;
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
    fn load<E: Real>(token: Self::Token, from: &[E], at: usize) -> Self;
    /// Writes to `to[at..]`.
    fn store<E: Real>(self, to: &mut [E], at: usize);
    /// Calls `each(lane, value)` in the order of the lanes.
    fn for_lanes(self, each: impl FnMut(usize, f64));
    /// Whether `self > 0` in any lane: to leave out work that no lane needs, never to choose how a
    /// lane's own value comes about.
    fn any_positive(self) -> bool;

    /// The same in every lane, in the company of this value.
    #[inline(always)]
    fn of(self, value: f64) -> Self {
        Self::splat(self.token(), value)
    }
}

/// Lanes of double precision, for which there are more functions than arithmetic alone.
pub trait Precise: Lane<Real = f64> {
    /// The values whose bit patterns are `each(bits)`.
    fn map_bits(self, each: impl Fn(u64) -> u64) -> Self;

    /// `self^(-1/3)` for positive values: Newton's iteration for y^-3 = x.
    #[inline(always)]
    fn inverse_cbrt(self) -> Self {
        let mut y = self.map_bits(inverse_cbrt_guess);
        for _ in 0..4 {
            let residual = self.of(1.0) - self * y * (y * y);
            y = (y * self.of(1.0 / 3.0)).mul_add(residual, y);
        }
        y
    }

    /// Natural logarithm within 1 ulp: fdlibm's e_log.c. Minus infinity at 0, NaN below it.
    #[inline(always)]
    fn ln(self) -> Self {
        let (zero, infinity) = (self.of(0.0), self.of(f64::INFINITY));
        // Subnormal numbers have no exponent of their own: lend them 2^54.
        let subnormal = self.of(f64::MIN_POSITIVE) - self;
        let x = subnormal.if_positive(self * self.of(TWO_54), self);
        let lent = subnormal.if_positive(self.of(54.0), zero);
        // x = 2^k m, m in [sqrt(1/2), sqrt(2)).
        let m = x.map_bits(mantissa_around_one);
        let k = x.map_bits(exponent_around_one) - self.of(EXPONENT_OFFSET) - lent;
        // ln(1 + f) = f - f^2/2 + s (f^2/2 + R(s^2)), s = f/(2 + f).
        let f = m - self.of(1.0);
        let s = f / (self.of(2.0) + f);
        let (z, half_f2) = (s * s, self.of(0.5) * f * f);
        let mut r = self.of(LN[6]);
        for c in LN[..6].iter().rev() {
            r = r.mul_add(z, self.of(*c));
        }
        let small = s.mul_add(r.mul_add(z, half_f2), k * self.of(LN_2_LOW)) - half_f2 + f;
        let finite = k.mul_add(self.of(LN_2_HIGH), small);
        // self - infinity: minus infinity at 0, NaN at NaN.
        self.if_positive(
            (infinity - self).if_positive(finite, self),
            (-self).if_positive(self.of(f64::NAN), self - infinity),
        )
    }

    /// Exponential function within 1 ulp; 0 and infinity where it under- and overflows.
    #[inline(always)]
    fn exp(self) -> Self {
        // This order of the operands keeps NaN.
        let x = self.of(-746.0).max(self.of(710.0).min(self));
        let n = (x * self.of(std::f64::consts::LOG2_E)).round();
        let r = (-n).mul_add(self.of(LN_2_LOW), (-n).mul_add(self.of(LN_2_HIGH), x));
        // |r| <= ln(2)/2: the remainder of the Taylor series is 4e-18.
        let mut p = self.of(INVERSE_FACTORIALS[13]);
        for c in INVERSE_FACTORIALS[2..13].iter().rev() {
            p = p.mul_add(r, self.of(*c));
        }
        let e = (r * r).mul_add(p, r) + self.of(1.0);
        // In two steps, because 2^n alone may be out of range.
        let half = (n * self.of(0.5)).round();
        e * half.power_of_two() * (n - half).power_of_two()
    }

    /// `self^y` for `self >= 0` and `y > 0`, with a relative error of `|y ln(self)|` units more than
    /// those of [`exp`](Self::exp): 0 at 0 and exactly 1 at 1.
    #[inline(always)]
    fn powf(self, y: f64) -> Self {
        (self.ln() * self.of(y)).exp()
    }

    /// Nearest integer, for magnitudes below 2^51.
    #[inline(always)]
    fn round(self) -> Self {
        (self + self.of(INTEGER_BITS)) - self.of(INTEGER_BITS)
    }

    /// 2^self for integers from -1022 to 1023.
    #[inline(always)]
    fn power_of_two(self) -> Self {
        (self + self.of(INTEGER_BITS)).map_bits(exponent_from_integer)
    }
}

/// 2^54.
const TWO_54: f64 = (1_u64 << 54) as f64;
/// 1.5 * 2^52: what is added to it is rounded to an integer, which its lowest bits then hold.
const INTEGER_BITS: f64 = 6_755_399_441_055_744.0;
/// 2^52 + 1023: see [`exponent_around_one`].
const EXPONENT_OFFSET: f64 = 4_503_599_627_371_519.0;
/// ln(2) in two parts; the first has 21 trailing zero bits, so its product with an exponent is exact.
const LN_2_HIGH: f64 = 6.931_471_803_691_238e-1;
const LN_2_LOW: f64 = 1.908_214_929_270_587_7e-10;
/// Coefficients of R(s^2)/s^2 in fdlibm's e_log.c.
const LN: [f64; 7] = [
    6.666_666_666_666_735e-1,
    3.999_999_999_940_942e-1,
    2.857_142_874_366_239e-1,
    2.222_219_843_214_978_4e-1,
    1.818_357_216_161_805e-1,
    1.531_383_769_920_937_3e-1,
    1.479_819_860_511_658_6e-1,
];
/// 1/k!.
pub const INVERSE_FACTORIALS: [f64; 14] = {
    let mut table = [1.0; 14];
    let (mut k, mut factorial) = (1, 1.0);
    while k < 14 {
        factorial *= k as f64;
        table[k] = 1.0 / factorial;
        k += 1;
    }
    table
};

/// High word of sqrt(1/2), where the mantissas of [`Lane::ln`] begin.
const ROOT_HALF: u64 = 0x3FE6_A09E << 32;
const ONE: u64 = 0x3FF0_0000 << 32;
const MANTISSA: u64 = (1 << 52) - 1;

/// m of x = 2^k m.
#[inline(always)]
fn mantissa_around_one(bits: u64) -> u64 {
    (bits.wrapping_add(ONE - ROOT_HALF) & MANTISSA) + ROOT_HALF
}

/// 2^52 + 1023 + k of x = 2^k m.
#[inline(always)]
fn exponent_around_one(bits: u64) -> u64 {
    (bits.wrapping_add(ONE - ROOT_HALF) >> 52) | (0x433 << 52)
}

/// 2^n from 1.5 * 2^52 + n.
#[inline(always)]
fn exponent_from_integer(bits: u64) -> u64 {
    bits.wrapping_add(1023) << 52
}

/// Guess within 4 % by a third of the exponent; the constant balances the error over one octave of three.
#[inline(always)]
fn inverse_cbrt_guess(bits: u64) -> u64 {
    let third = (bits >> 32).wrapping_mul(0x5555_5556) >> 32;
    0x553E_F0FF_u64.wrapping_sub(third) << 32
}

macro_rules! one_lane {
    ($real:ident, $tiny:expr) => {
        impl Lane for $real {
            type Token = ();
            type Real = $real;
            const WIDTH: usize = 1;
            const TINY: f64 = $tiny;
            #[inline(always)]
            fn token(self) {}
            #[inline(always)]
            fn splat((): (), value: f64) -> Self {
                Self::nearest(value)
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                $real::mul_add(self, a, b)
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                $real::sqrt(self)
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
            fn load<E: Real>((): (), from: &[E], at: usize) -> Self {
                Self::nearest(from[at].value())
            }
            #[inline(always)]
            fn store<E: Real>(self, to: &mut [E], at: usize) {
                to[at] = E::nearest(self.value());
            }
            #[inline(always)]
            fn for_lanes(self, mut each: impl FnMut(usize, f64)) {
                each(0, self.value());
            }
            #[inline(always)]
            fn any_positive(self) -> bool {
                self > 0.0
            }
        }
    };
}
one_lane!(f64, f64::MIN_POSITIVE);
one_lane!(f32, LONG_TINY);

/// Far above the smallest number, because such a denominator's inverse is still to be one, and far below what the
/// lengths and speeds of any scene that is allowed single precision make.
const LONG_TINY: f64 = 1e-36;

impl Precise for f64 {
    #[inline(always)]
    fn map_bits(self, each: impl Fn(u64) -> u64) -> Self {
        f64::from_bits(each(self.to_bits()))
    }
}

/// A vector register of double precision.
#[derive(Clone, Copy)]
pub struct Wide<S: Simd> {
    simd: S,
    value: S::f64s,
}

/// A vector register of single precision.
#[derive(Clone, Copy)]
pub struct Long<S: Simd> {
    simd: S,
    value: S::f32s,
}

macro_rules! operator {
    ($vector:ident, $trait:ident, $method:ident, $call:ident) => {
        impl<S: Simd> $trait for $vector<S> {
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

/// The operations of a vector register, by the names of its instructions.
macro_rules! vector {
    ($vector:ident, $real:ident, $lanes:ident, $tiny:expr, $load:ident, $store:ident, $splat:ident,
     $add:ident, $sub:ident, $mul:ident, $div:ident, $neg:ident, $mul_add:ident, $sqrt:ident,
     $greater:ident, $select:ident, $first:ident) => {
        operator!($vector, Add, add, $add);
        operator!($vector, Sub, sub, $sub);
        operator!($vector, Mul, mul, $mul);
        operator!($vector, Div, div, $div);

        impl<S: Simd> Neg for $vector<S> {
            type Output = Self;
            #[inline(always)]
            fn neg(self) -> Self {
                Self {
                    value: self.simd.$neg(self.value),
                    ..self
                }
            }
        }

        impl<S: Simd> $vector<S> {
            /// `self` where `self > other`, else `other`: the order of the operands decides for NaN, alike
            /// on every instruction set.
            #[inline(always)]
            fn select_greater(self, other: Self, yes: Self, no: Self) -> Self {
                let mask = self.simd.$greater(self.value, other.value);
                Self {
                    value: self.simd.$select(mask, yes.value, no.value),
                    ..self
                }
            }
        }

        impl<S: Simd> Lane for $vector<S> {
            type Token = S;
            type Real = $real;
            const WIDTH: usize = S::$lanes;
            const TINY: f64 = $tiny;
            #[inline(always)]
            fn token(self) -> S {
                self.simd
            }
            #[inline(always)]
            fn splat(simd: S, value: f64) -> Self {
                Self {
                    simd,
                    value: simd.$splat($real::nearest(value)),
                }
            }
            #[inline(always)]
            fn mul_add(self, a: Self, b: Self) -> Self {
                Self {
                    value: self.simd.$mul_add(self.value, a.value, b.value),
                    ..self
                }
            }
            #[inline(always)]
            fn sqrt(self) -> Self {
                Self {
                    value: self.simd.$sqrt(self.value),
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
            fn load<E: Real>(simd: S, from: &[E], at: usize) -> Self {
                Self {
                    simd,
                    value: E::$load(simd, &from[at..at + Self::WIDTH]),
                }
            }
            #[inline(always)]
            fn store<E: Real>(self, to: &mut [E], at: usize) {
                E::$store::<S>(self.value, &mut to[at..at + Self::WIDTH]);
            }
            #[inline(always)]
            fn for_lanes(self, mut each: impl FnMut(usize, f64)) {
                let values: &[$real] = bytemuck::cast_slice(std::slice::from_ref(&self.value));
                for (lane, value) in values.iter().enumerate() {
                    each(lane, value.value());
                }
            }
            #[inline(always)]
            fn any_positive(self) -> bool {
                let zero = self.of(0.0);
                let mask = self.simd.$greater(self.value, zero.value);
                self.simd.$first(mask) < Self::WIDTH
            }
        }
    };
}
vector!(
    Wide,
    f64,
    F64_LANES,
    f64::MIN_POSITIVE,
    load_wide,
    store_wide,
    splat_f64s,
    add_f64s,
    sub_f64s,
    mul_f64s,
    div_f64s,
    neg_f64s,
    mul_add_f64s,
    sqrt_f64s,
    greater_than_f64s,
    select_f64s,
    first_true_m64s
);
vector!(
    Long,
    f32,
    F32_LANES,
    LONG_TINY,
    load_long,
    store_long,
    splat_f32s,
    add_f32s,
    sub_f32s,
    mul_f32s,
    div_f32s,
    neg_f32s,
    mul_add_f32s,
    sqrt_f32s,
    greater_than_f32s,
    select_f32s,
    first_true_m32s
);

impl<S: Simd> Precise for Wide<S> {
    #[inline(always)]
    fn map_bits(self, each: impl Fn(u64) -> u64) -> Self {
        let mut mapped = self;
        let all: &mut [u64] = bytemuck::cast_slice_mut(std::slice::from_mut(&mut mapped.value));
        for bits in all {
            *bits = each(*bits);
        }
        mapped
    }
}

/// A running sum or minimum by the place in a slice, so that its order, and with it the bits, do not
/// depend on the width of the vectors.
#[derive(Clone, Copy)]
pub struct PerSlot([f64; LONG_SLICE]);

impl PerSlot {
    /// Starts everywhere with `value`.
    pub fn new(value: f64) -> Self {
        Self([value; LONG_SLICE])
    }
    /// Adds the value for the slots from `at`.
    #[inline(always)]
    pub fn add<T: Lane>(&mut self, at: usize, value: T) {
        self.update(at, value, |sum, value| sum + value);
    }
    /// Takes the minimum with the value for the slots from `at`; a value that is NaN is ignored.
    #[inline(always)]
    pub fn min<T: Lane>(&mut self, at: usize, value: T) {
        self.update(
            at,
            value,
            |least, value| if value < least { value } else { least },
        );
    }
    /// Takes the maximum with the value for the slots from `at`; a value that is NaN is ignored.
    #[inline(always)]
    pub fn max<T: Lane>(&mut self, at: usize, value: T) {
        self.update(
            at,
            value,
            |most, value| if value > most { value } else { most },
        );
    }
    #[inline(always)]
    fn update<T: Lane>(&mut self, at: usize, value: T, each: impl Fn(f64, f64) -> f64) {
        let at = at % T::Real::SLICE;
        let slots = &mut self.0[at..at + T::WIDTH];
        value.for_lanes(|lane, value| slots[lane] = each(slots[lane], value));
    }
    /// Sum over the slice.
    pub fn sum(&self) -> f64 {
        self.0.iter().sum()
    }
    /// Maximum over the slice.
    pub fn most(&self) -> f64 {
        self.0.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }
    /// Minimum over the slice.
    pub fn least(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }
}

/// Work on a run of slots, written once over lanes of double precision.
pub trait Work {
    /// What it returns.
    type Output;
    /// Does the work. Implementations and all they call are `#[inline(always)]`, closures included,
    /// down to the operations of [`Lane`]: only then do they get the caller's instruction set.
    fn run<T: Precise>(self, token: T::Token) -> Self::Output;
}

/// The same over lanes of either precision.
pub trait PairWork {
    /// What it returns.
    type Output;
    /// Does the work: see [`Work::run`].
    fn run<T: Lane>(self, token: T::Token) -> Self::Output;
}

/// Work with the kind of its lanes settled, but not yet their width.
trait Settled {
    type Output;
    fn on_one(self) -> Self::Output;
    fn on<S: Simd>(self, simd: S) -> Self::Output;
}

struct Precisely<W>(W);
struct OnDoubles<W>(W);
struct OnSingles<W>(W);

macro_rules! settled {
    ($kind:ident, $work:ident, $one:ident, $vector:ident) => {
        impl<W: $work> Settled for $kind<W> {
            type Output = W::Output;
            #[inline(always)]
            fn on_one(self) -> W::Output {
                self.0.run::<$one>(())
            }
            #[inline(always)]
            fn on<S: Simd>(self, simd: S) -> W::Output {
                self.0.run::<$vector<S>>(simd)
            }
        }
    };
}
settled!(Precisely, Work, f64, Wide);
settled!(OnDoubles, PairWork, f64, Wide);
settled!(OnSingles, PairWork, f32, Long);

/// Runs `work` on the widest vectors that this processor has.
pub fn vectorised<W: Work>(work: W) -> W::Output {
    dispatch(Precisely(work))
}

#[cfg(not(target_arch = "x86_64"))]
fn dispatch<W: Settled>(work: W) -> W::Output {
    struct Dispatch<W>(W);
    impl<W: Settled> pulp::WithSimd for Dispatch<W> {
        type Output = W::Output;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> W::Output {
            self.0.on(simd)
        }
    }
    pulp::Arch::new().dispatch(Dispatch(work))
}

/// A processor without AVX2 gets one particle at a time: vectors emulated on single numbers would be most of
/// the library's code.
#[cfg(target_arch = "x86_64")]
fn dispatch<W: Settled>(work: W) -> W::Output {
    if let Some(avx512) = pulp::x86::V4::try_new() {
        avx512.vectorize(Inside(work, avx512))
    } else if let Some(avx2) = pulp::x86::V3::try_new() {
        avx2.vectorize(Inside(work, avx2))
    } else {
        work.on_one()
    }
}

/// Work with the vectors that it is to run on.
#[cfg(target_arch = "x86_64")]
struct Inside<W, S>(W, S);

#[cfg(target_arch = "x86_64")]
impl<W: Settled, S: Simd> pulp::NullaryFnOnce for Inside<W, S> {
    type Output = W::Output;
    #[inline(always)]
    fn call(self) -> W::Output {
        self.0.on(self.1)
    }
}

/// Runs `work` on the AVX2 instructions, for the tests; `None` where the processor has none.
#[cfg(all(test, target_arch = "x86_64"))]
pub fn on_avx2<W: Work>(work: W) -> Option<W::Output> {
    narrow(Precisely(work))
}

#[cfg(all(test, target_arch = "x86_64"))]
fn narrow<W: Settled>(work: W) -> Option<W::Output> {
    let avx2 = pulp::x86::V3::try_new()?;
    Some(avx2.vectorize(Inside(work, avx2)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Copy)]
    enum Function {
        InverseCubeRoot,
        Ln,
        Exp,
        Power(f64),
    }
    struct Apply<'a>(Function, &'a [f64], &'a mut [f64]);
    impl Work for Apply<'_> {
        type Output = ();
        #[inline(always)]
        fn run<T: Precise>(self, token: T::Token) {
            for at in (0..self.1.len()).step_by(T::WIDTH) {
                let x = T::load(token, self.1, at);
                let y = match self.0 {
                    Function::InverseCubeRoot => x.inverse_cbrt(),
                    Function::Ln => x.ln(),
                    Function::Exp => x.exp(),
                    Function::Power(y) => x.powf(y),
                };
                y.store(self.2, at);
            }
        }
    }

    /// The function of one lane after seeing that all widths give its bits.
    fn in_every_width(function: Function, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len() % SLICE, 0);
        let [mut single, mut wide, mut avx2] = [(); 3].map(|()| vec![0.0; x.len()]);
        Apply(function, x, &mut single).run::<f64>(());
        vectorised(Apply(function, x, &mut wide));
        let same = |a: &[f64]| {
            for (i, (a, b)) in a.iter().zip(&single).enumerate() {
                let both_nan = a.is_nan() && b.is_nan();
                assert!(both_nan || a.to_bits() == b.to_bits(), "{}: {a} {b}", x[i]);
            }
        };
        same(&wide);
        #[cfg(target_arch = "x86_64")]
        if on_avx2(Apply(function, x, &mut avx2)).is_some() {
            same(&avx2);
        }
        single
    }

    /// Largest difference in units of the last place of `exact`.
    fn ulps(ours: &[f64], exact: impl Iterator<Item = f64>) -> f64 {
        let ulp = |y: f64| f64::from_bits(y.abs().to_bits() + 1) - y.abs();
        ours.iter()
            .zip(exact)
            .map(|(y, e)| (y - e).abs() / ulp(e))
            .fold(0.0, f64::max)
    }

    #[test]
    fn inverse_cube_root_is_accurate_and_the_same_in_every_width() {
        let x: Vec<f64> = (0..4000)
            .map(|i| 10f64.powf(-6.0 + f64::from(i) * 0.003))
            .collect();
        let ours = in_every_width(Function::InverseCubeRoot, &x);
        let worst = ours
            .iter()
            .zip(&x)
            .map(|(y, x)| (y * x.cbrt() - 1.0).abs())
            .fold(0.0, f64::max);
        println!("relative error {worst:e} (tolerance 1e-15)");
        assert!(worst < 1e-15);
    }

    #[test]
    fn logarithm_is_accurate_and_the_same_in_every_width() {
        let mut x: Vec<f64> = (0..8000)
            .map(|i| 10f64.powf(-300.0 + f64::from(i) * 0.075))
            .collect();
        x.extend((-4000..4000).map(|i| 1.0 + f64::from(i) * 1e-4));
        x.extend((-4000..4000).map(|i| 1.0 + f64::from(i) * 1e-13));
        x.extend((0..8).map(|i| f64::from_bits(1 << (6 * i))));
        let worst = ulps(&in_every_width(Function::Ln, &x), x.iter().map(|x| x.ln()));
        println!("error of ln {worst} ulp (tolerance 1.5)");
        assert!(worst <= 1.5);
        let odd = [
            0.0,
            -0.0,
            1.0,
            f64::INFINITY,
            -1.0,
            f64::NEG_INFINITY,
            f64::NAN,
            f64::MAX,
        ];
        let y = in_every_width(Function::Ln, &odd);
        assert_eq!(
            y[..4],
            [f64::NEG_INFINITY, f64::NEG_INFINITY, 0.0, f64::INFINITY]
        );
        assert!(y[4..7].iter().all(|y| y.is_nan()));
        assert!((y[7] - f64::MAX.ln()).abs() < 1e-12);
    }

    #[test]
    fn exponential_is_accurate_and_the_same_in_every_width() {
        let mut x: Vec<f64> = (0..8000).map(|i| -745.0 + f64::from(i) * 0.1818).collect();
        x.extend((-4000..4000).map(|i| f64::from(i) * 5e-4));
        x.extend((-4000..4000).map(|i| f64::from(i) * 1e-13));
        let worst = ulps(
            &in_every_width(Function::Exp, &x),
            x.iter().map(|x| x.exp()),
        );
        println!("error of exp {worst} ulp (tolerance 1.5)");
        assert!(worst <= 1.5);
        let infinity = f64::INFINITY;
        let odd = [
            0.0,
            -0.0,
            infinity,
            710.0,
            -infinity,
            -746.0,
            1e300,
            f64::NAN,
        ];
        let y = in_every_width(Function::Exp, &odd);
        assert_eq!(y[..7], [1.0, 1.0, infinity, infinity, 0.0, 0.0, infinity]);
        assert!(y[7].is_nan());
    }

    #[test]
    fn powers_are_accurate_and_the_same_in_every_width() {
        for power in [0.05, 0.31, 1.0, 1.09, 2.5] {
            let mut x: Vec<f64> = (0..4000)
                .map(|i| 10f64.powf(-12.0 + f64::from(i) * 0.0035))
                .collect();
            x[..8].copy_from_slice(&[0.0, 1.0, f64::MIN_POSITIVE, 5e-324, 0.5, 2.0, 0.999, 1e-300]);
            let ours = in_every_width(Function::Power(power), &x);
            assert_eq!(ours[..2], [0.0, 1.0]);
            let mut worst: f64 = 0.0;
            for (y, x) in ours[1..].iter().zip(&x[1..]) {
                // A last unit for each of |power ln x|, and two of exp and pow.
                let units = 2.0 + (power * x.ln()).abs();
                worst =
                    worst.max((y - x.powf(power)).abs() / (x.powf(power) * units * f64::EPSILON));
            }
            println!("error of x^{power} over its bound: {worst} (tolerance 1)");
            assert!(worst < 1.0);
        }
    }
}
