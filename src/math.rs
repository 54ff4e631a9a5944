//! Small tensors over [`Lane`]: vectors `[T; 3]` and row-major matrices `[[T; 3]; 3]`.
//!
//! Imports nothing of ours but the lane. Set-up code that needs decompositions uses nalgebra.

use std::ops::Deref;

use crate::lane::{INVERSE_FACTORIALS, Lane, Precise, Real};

/// A vector.
pub type Vec3<T> = [T; 3];
/// A second-order tensor, row-major.
pub type Mat3<T> = [[T; 3]; 3];
/// A symmetric second-order tensor: xx, yy, zz, xy, xz, yz.
pub type Sym3<T> = [T; 6];

/// Identity of set-up code.
pub const IDENTITY: Mat3<f64> = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

/// Identity on lanes.
#[inline(always)]
pub fn identity<T: Lane>(token: T::Token) -> Mat3<T> {
    let (o, i) = (T::splat(token, 0.0), T::splat(token, 1.0));
    [[i, o, o], [o, i, o], [o, o, i]]
}

/// Zero vector on lanes.
#[inline(always)]
pub fn zero3<T: Lane>(token: T::Token) -> Vec3<T> {
    [T::splat(token, 0.0); 3]
}

/// Row-major components.
pub fn flat(m: &Mat3<f64>) -> [f64; 9] {
    let [[a, b, c], [d, e, f], [g, h, i]] = *m;
    [a, b, c, d, e, f, g, h, i]
}

/// The matrix of row-major components.
pub fn matrix(m: &[f64; 9]) -> Mat3<f64> {
    let [a, b, c, d, e, f, g, h, i] = *m;
    [[a, b, c], [d, e, f], [g, h, i]]
}

/// a + b.
#[inline(always)]
pub fn add3<T: Lane>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

/// a - b.
#[inline(always)]
pub fn sub3<T: Lane>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

/// s a.
#[inline(always)]
pub fn scale3<T: Lane>(s: T, a: Vec3<T>) -> Vec3<T> {
    [s * a[0], s * a[1], s * a[2]]
}

/// a + s b.
#[inline(always)]
pub fn axpy3<T: Lane>(a: Vec3<T>, s: T, b: Vec3<T>) -> Vec3<T> {
    [
        s.mul_add(b[0], a[0]),
        s.mul_add(b[1], a[1]),
        s.mul_add(b[2], a[2]),
    ]
}

/// a . b.
#[inline(always)]
pub fn dot<T: Lane>(a: Vec3<T>, b: Vec3<T>) -> T {
    a[2].mul_add(b[2], a[1].mul_add(b[1], a[0] * b[0]))
}

/// a x b.
#[inline(always)]
pub fn cross<T: Lane>(a: Vec3<T>, b: Vec3<T>) -> Vec3<T> {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// A a.
#[inline(always)]
pub fn mat_vec<T: Lane>(m: &Mat3<T>, a: Vec3<T>) -> Vec3<T> {
    [dot(m[0], a), dot(m[1], a), dot(m[2], a)]
}

/// A + B.
#[inline(always)]
pub fn add9<T: Lane>(a: &Mat3<T>, b: &Mat3<T>) -> Mat3<T> {
    [add3(a[0], b[0]), add3(a[1], b[1]), add3(a[2], b[2])]
}

/// s A.
#[inline(always)]
pub fn scale9<T: Lane>(s: T, a: &Mat3<T>) -> Mat3<T> {
    [scale3(s, a[0]), scale3(s, a[1]), scale3(s, a[2])]
}

/// s a, of any number of components.
///
/// A loop, as in [`load_all`]: closures given to the arrays' own functions are compiled without the vector
/// instructions of the caller, and each of their operations is then a call.
#[inline(always)]
pub fn scale_all<T: Lane, const N: usize>(s: T, a: &[T; N]) -> [T; N] {
    let mut scaled = *a;
    let mut c = 0;
    while c < N {
        scaled[c] = s * a[c];
        c += 1;
    }
    scaled
}

/// All components of the particles in the slots from `at`.
#[inline(always)]
pub fn load_all<T: Lane, const N: usize>(
    token: T::Token,
    from: &[impl Deref<Target = [impl Real]>; N],
    at: usize,
) -> [T; N] {
    let mut all = [T::splat(token, 0.0); N];
    let mut c = 0;
    while c < N {
        all[c] = T::load(token, &from[c], at);
        c += 1;
    }
    all
}

/// A + s B.
#[inline(always)]
pub fn axpy9<T: Lane>(a: &Mat3<T>, s: T, b: &Mat3<T>) -> Mat3<T> {
    [
        axpy3(a[0], s, b[0]),
        axpy3(a[1], s, b[1]),
        axpy3(a[2], s, b[2]),
    ]
}

/// A + a b^T.
#[inline(always)]
pub fn add_outer<T: Lane>(m: &Mat3<T>, a: Vec3<T>, b: Vec3<T>) -> Mat3<T> {
    [
        axpy3(m[0], a[0], b),
        axpy3(m[1], a[1], b),
        axpy3(m[2], a[2], b),
    ]
}

/// A^T.
#[inline(always)]
pub fn transpose<T: Lane>(m: &Mat3<T>) -> Mat3<T> {
    [
        [m[0][0], m[1][0], m[2][0]],
        [m[0][1], m[1][1], m[2][1]],
        [m[0][2], m[1][2], m[2][2]],
    ]
}

/// a^T B.
#[inline(always)]
pub fn vec_mat<T: Lane>(a: Vec3<T>, b: &Mat3<T>) -> Vec3<T> {
    axpy3(axpy3(scale3(a[0], b[0]), a[1], b[1]), a[2], b[2])
}

/// A B.
#[inline(always)]
pub fn mat_mul<T: Lane>(a: &Mat3<T>, b: &Mat3<T>) -> Mat3<T> {
    [vec_mat(a[0], b), vec_mat(a[1], b), vec_mat(a[2], b)]
}

/// A B^T.
#[inline(always)]
pub fn mat_mul_t<T: Lane>(a: &Mat3<T>, b: &Mat3<T>) -> Mat3<T> {
    [mat_vec(b, a[0]), mat_vec(b, a[1]), mat_vec(b, a[2])]
}

/// A : B.
#[inline(always)]
pub fn double_dot<T: Lane>(a: &Mat3<T>, b: &Mat3<T>) -> T {
    dot(a[0], b[0]) + dot(a[1], b[1]) + dot(a[2], b[2])
}

/// Cofactor: rows are cross products of rows, so that cof(A) = det(A) A^-T.
#[inline(always)]
pub fn cofactor<T: Lane>(m: &Mat3<T>) -> Mat3<T> {
    [cross(m[1], m[2]), cross(m[2], m[0]), cross(m[0], m[1])]
}

/// Tensor cross product A x B ([URL22] and de Boer): (A x B)_iI = e_ijk e_IJK A_jJ B_kK.
#[inline(always)]
pub fn tensor_cross<T: Lane>(a: &Mat3<T>, b: &Mat3<T>) -> Mat3<T> {
    [
        add3(cross(a[1], b[2]), cross(b[1], a[2])),
        add3(cross(a[2], b[0]), cross(b[2], a[0])),
        add3(cross(a[0], b[1]), cross(b[0], a[1])),
    ]
}

/// Largest eigenvalue of a symmetric positive semi-definite matrix, in closed form without branches:
/// m + 2 p cos(phi) with 4 c^3 - 3 c = cos(3 phi), c = cos(phi) in [1/2, 1].
#[inline(always)]
pub fn largest_eigenvalue<T: Lane>(a: &Mat3<T>) -> T {
    let token = a[0][0].token();
    let (one, half, three) = (
        T::splat(token, 1.0),
        T::splat(token, 0.5),
        T::splat(token, 3.0),
    );
    let m = (a[0][0] + a[1][1] + a[2][2]) * T::splat(token, 1.0 / 3.0);
    let d = [a[0][0] - m, a[1][1] - m, a[2][2] - m];
    let off = a[0][1] * a[0][1] + a[0][2] * a[0][2] + a[1][2] * a[1][2];
    let p2 = (dot(d, d) + off + off) * T::splat(token, 1.0 / 6.0);
    let p = p2.sqrt();
    let det = d[0] * (d[1] * d[2] - a[1][2] * a[1][2])
        - a[0][1] * (a[0][1] * d[2] - a[1][2] * a[0][2])
        + a[0][2] * (a[0][1] * a[1][2] - d[1] * a[0][2]);
    // p = 0 is the undeformed state: any c serves there, so the guard only has to avoid 0/0.
    let r = (det * half) / (p2 * p + T::splat(token, f64::MIN_POSITIVE));
    let r = r.min(one).max(-one);
    let mut c = (((r + one) * half).sqrt() + one) * half;
    for _ in 0..3 {
        let c2 = T::splat(token, 4.0) * c * c;
        let value = (c2 - three) * c - r;
        let slope = three * (c2 - one);
        c = c - value / (slope + T::splat(token, 1e-30));
    }
    (p + p).mul_add(c.min(one).max(half), m)
}

/// All components.
#[inline(always)]
pub fn full<T: Copy>(s: &Sym3<T>) -> Mat3<T> {
    [[s[0], s[3], s[4]], [s[3], s[1], s[5]], [s[4], s[5], s[2]]]
}

/// S + s I.
#[inline(always)]
fn add_identity<T: Lane>(a: &Sym3<T>, s: T) -> Sym3<T> {
    [a[0] + s, a[1] + s, a[2] + s, a[3], a[4], a[5]]
}

/// S - tr(S)/3 I.
#[inline(always)]
pub fn deviator<T: Lane>(a: &Sym3<T>) -> Sym3<T> {
    let mean = (a[0] + a[1] + a[2]) * a[0].of(1.0 / 3.0);
    add_identity(a, -mean)
}

/// S : S.
#[inline(always)]
pub fn square<T: Lane>(a: &Sym3<T>) -> T {
    let off = dot([a[3], a[4], a[5]], [a[3], a[4], a[5]]);
    off + dot([a[0], a[1], a[2]], [a[0], a[1], a[2]]) + off
}

/// A S A^T.
#[inline(always)]
pub fn congruence<T: Lane>(a: &Mat3<T>, s: &Sym3<T>) -> Sym3<T> {
    let m = mat_mul(a, &full(s));
    [
        dot(m[0], a[0]),
        dot(m[1], a[1]),
        dot(m[2], a[2]),
        dot(m[0], a[1]),
        dot(m[0], a[2]),
        dot(m[1], a[2]),
    ]
}

/// A B where both are functions of one tensor, so that the product is symmetric too.
#[inline(always)]
fn commuting_product<T: Lane>(a: &Sym3<T>, b: &Sym3<T>) -> Sym3<T> {
    let (a, b) = (full(a), full(b));
    [
        dot(a[0], b[0]),
        dot(a[1], b[1]),
        dot(a[2], b[2]),
        dot(a[0], b[1]),
        dot(a[0], b[2]),
        dot(a[1], b[2]),
    ]
}

/// Polynomial of a tensor whose square is known: Horner's scheme on the coefficients of A^2, A and I,
/// to which Cayley and Hamilton's theorem, A^3 = I1 A^2 - I2 A + I3 I, reduces every power.
#[inline(always)]
fn polynomial<T: Lane>(
    a: &Sym3<T>,
    a2: &Sym3<T>,
    coefficients: impl Iterator<Item = f64>,
) -> Sym3<T> {
    let zero = a[0].of(0.0);
    let minors = cofactor(&full(a));
    let i1 = a[0] + a[1] + a[2];
    let i2 = minors[0][0] + minors[1][1] + minors[2][2];
    let i3 = dot([a[0], a[3], a[4]], minors[0]);
    let (mut p2, mut p1, mut p0) = (zero, zero, zero);
    for c in coefficients {
        (p2, p1, p0) = (
            p2.mul_add(i1, p1),
            (-p2).mul_add(i2, p0),
            p2.mul_add(i3, zero.of(c)),
        );
    }
    let mut sum = [zero; 6];
    for k in 0..6 {
        sum[k] = p2.mul_add(a2[k], p1 * a[k]);
    }
    add_identity(&sum, p0)
}

/// The logarithm of a symmetric positive definite tensor. Near the identity, where the elastic
/// strains of metals are, it is 2 artanh(Z), Z = (B - I)(B + I)^-1; the eigenvalues serve elsewhere.
#[inline(always)]
pub fn ln_symmetric<T: Precise>(b: &Sym3<T>) -> Sym3<T> {
    // artanh(Z)/Z to Z^14: the remainder is below 4e-17 for |B - I| <= 0.2.
    const TERMS: u32 = 8;
    let one = b[0].of(1.0);
    let difference = add_identity(b, -one);
    let outside = square(&difference) - one.of(0.04);
    let sum = add_identity(b, one);
    let adjugate = cofactor(&full(&sum));
    let factor = one.of(2.0) / dot([sum[0], sum[3], sum[4]], adjugate[0]);
    let inverse = [
        adjugate[0][0],
        adjugate[1][1],
        adjugate[2][2],
        adjugate[0][1],
        adjugate[0][2],
        adjugate[1][2],
    ];
    let z2 = scale_all(factor, &commuting_product(&difference, &inverse)); // 2 Z
    let y = scale_all(one.of(0.25), &commuting_product(&z2, &z2)); // Z^2
    let series = polynomial(
        &y,
        &commuting_product(&y, &y),
        (0..TERMS).rev().map(|k| 1.0 / f64::from(2 * k + 1)),
    );
    let near = commuting_product(&z2, &series);
    if !outside.any_positive() {
        return near;
    }
    let (values, vectors) = eigen(b);
    let far = spectral([values[0].ln(), values[1].ln(), values[2].ln()], &vectors);
    select(outside, &far, &near)
}

/// The exponential of a symmetric tensor: its series where it is small, by its eigenvalues elsewhere.
#[inline(always)]
pub fn exp_symmetric<T: Precise>(a: &Sym3<T>) -> Sym3<T> {
    // To A^12: the remainder is below 3e-17 for |A| <= 0.3.
    let outside = square(a) - a[0].of(0.09);
    let near = polynomial(
        a,
        &commuting_product(a, a),
        INVERSE_FACTORIALS[..13].iter().rev().copied(),
    );
    if !outside.any_positive() {
        return near;
    }
    let (values, vectors) = eigen(a);
    let far = spectral(
        [values[0].exp(), values[1].exp(), values[2].exp()],
        &vectors,
    );
    select(outside, &far, &near)
}

/// `yes` where `choice > 0`, else `no`.
#[inline(always)]
pub fn select<T: Lane, const N: usize>(choice: T, yes: &[T; N], no: &[T; N]) -> [T; N] {
    let mut chosen = *no;
    let mut c = 0;
    while c < N {
        chosen[c] = choice.if_positive(yes[c], no[c]);
        c += 1;
    }
    chosen
}

/// Sum of values[k] v_k (x) v_k over the rows v_k.
#[inline(always)]
fn spectral<T: Lane>(values: Vec3<T>, vectors: &Mat3<T>) -> Sym3<T> {
    let zero = values[0].of(0.0);
    let diagonal = [values[0], values[1], values[2], zero, zero, zero];
    congruence(&transpose(vectors), &diagonal)
}

/// Eigenvalues of a symmetric tensor, and its unit eigenvectors as rows, in no particular order: cyclic
/// Jacobi rotations, whose number does not depend on the values. For components whose squares neither
/// overflow nor underflow.
#[inline(always)]
pub fn eigen<T: Lane>(a: &Sym3<T>) -> (Vec3<T>, Mat3<T>) {
    // Convergence is quadratic from about the third sweep on.
    const SWEEPS: usize = 6;
    let one = a[0].of(1.0);
    let (mut m, mut v) = (full(a), identity(a[0].token()));
    // Not unrolled: it is seldom needed, and six copies would take long to compile.
    for _ in 0..std::hint::black_box(SWEEPS) {
        for (p, q) in [(0, 1), (0, 2), (1, 2)] {
            let r = 3 - p - q;
            // The smaller root of t^2 + 2 t cot(2 phi) - 1; t = 0 where there is nothing to rotate.
            let (gap, twice) = (m[q][q] - m[p][p], m[p][q] + m[p][q]);
            let size = gap.max(-gap) + gap.mul_add(gap, twice * twice).sqrt();
            let t = (-gap).if_positive(-twice, twice) / (size + one.of(f64::MIN_POSITIVE));
            let c = one / t.mul_add(t, one).sqrt();
            let s = t * c;
            let off = m[p][q];
            m[p][p] = (-t).mul_add(off, m[p][p]);
            m[q][q] = t.mul_add(off, m[q][q]);
            m[p][q] = one.of(0.0);
            let (rp, rq) = (m[r.min(p)][r.max(p)], m[r.min(q)][r.max(q)]);
            m[r.min(p)][r.max(p)] = c * rp - s * rq;
            m[r.min(q)][r.max(q)] = s * rp + c * rq;
            (v[p], v[q]) = (
                axpy3(scale3(c, v[p]), -s, v[q]),
                axpy3(scale3(c, v[q]), s, v[p]),
            );
        }
    }
    ([m[0][0], m[1][1], m[2][2]], v)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn sample(i: usize) -> Mat3<f64> {
        let f = |k: usize| ((i * 37 + k * 101) as f64 * 0.618_033_988_75).fract() * 2.0 - 1.0;
        [[f(0), f(1), f(2)], [f(3), f(4), f(5)], [f(6), f(7), f(8)]]
    }

    #[test]
    fn cofactor_and_tensor_cross_agree_with_their_definitions() {
        for i in 0..50 {
            let (a, b) = (sample(i), sample(i + 1000));
            let na = Matrix3::from_fn(|r, c| a[r][c]);
            let cof = na.try_inverse().expect("regular").transpose() * na.determinant();
            let ours = cofactor(&a);
            let half = tensor_cross(&a, &a);
            for r in 0..3 {
                for c in 0..3 {
                    assert!((ours[r][c] - cof[(r, c)]).abs() < 1e-12);
                    // cof A = (A x A) / 2
                    assert!((half[r][c] - 2.0 * ours[r][c]).abs() < 1e-12);
                }
            }
            // d(cof A)/dA : B = A x B
            let eps = 1e-6;
            let plus = cofactor(&axpy9(&a, eps, &b));
            let minus = cofactor(&axpy9(&a, -eps, &b));
            let exact = tensor_cross(&a, &b);
            for r in 0..3 {
                for c in 0..3 {
                    let difference = (plus[r][c] - minus[r][c]) / (2.0 * eps);
                    assert!((difference - exact[r][c]).abs() < 1e-8);
                }
            }
        }
    }

    #[test]
    fn largest_eigenvalue_matches_nalgebra() {
        let mut worst: f64 = 0.0;
        let mut check = |m: Mat3<f64>| {
            let n = Matrix3::from_fn(|r, c| m[r][c]);
            let exact = n.symmetric_eigenvalues().max();
            worst = worst.max((largest_eigenvalue(&m) - exact).abs() / exact);
        };
        for i in 0..500 {
            let a = sample(i);
            check(mat_mul_t(&a, &a));
            // Nearly isotropic, and two nearly equal largest values.
            check(axpy9(&IDENTITY, 1e-7, &mat_mul_t(&a, &a)));
            let t = 1e-9 * i as f64;
            check([[2.0 + t, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 0.1]]);
        }
        check(IDENTITY);
        println!("relative error {worst:e} (tolerance 1e-7)");
        assert!(worst < 1e-7);
    }

    fn symmetric(values: [f64; 3], turn: usize) -> Sym3<f64> {
        let q = Matrix3::from_fn(|r, c| sample(turn)[r][c]).qr().q();
        let a = q * Matrix3::from_diagonal(&values.into()) * q.transpose();
        [
            a[(0, 0)],
            a[(1, 1)],
            a[(2, 2)],
            a[(0, 1)],
            a[(0, 2)],
            a[(1, 2)],
        ]
    }

    /// Distinct, equal and nearly equal values, condition numbers up to 1e8, next to the identity.
    fn symmetric_samples() -> Vec<Sym3<f64>> {
        let mut samples = vec![
            [1.0, 1.0, 1.0, 0.0, 0.0, 0.0],
            [1.0, 1.0, 1.0, 1e-9, 0.0, 0.0],
        ];
        for i in 0..200 {
            let t = (i as f64 * 0.618_033_988_75).fract();
            for values in [
                [1.0 + t, 0.3 + t, 0.1],
                [2.0, 2.0, 0.5 + t],
                [1.0, 1.0 + 1e-9 * t, 1.0 - 1e-9],
                [1.0, 1.0 + 1e-15, 1.0 + 1e-14 * t],
                [1e4, t + 0.5, 1e-4],
                [1e4, 1e4 * (1.0 + 1e-12), 1e-4],
                [1.0 + 0.11 * t, 1.0 - 0.11 * t, 1.0],
                [1.0 + 0.19 * t, 1.0, 1.0],
                [1.0 + 1e-3 * t, 1.0 - 2e-3 * t, 1.0 + 1e-3],
            ] {
                samples.push(symmetric(values, i));
            }
        }
        samples
    }

    fn distance(a: &Sym3<f64>, b: &Sym3<f64>) -> f64 {
        square(&std::array::from_fn::<_, 6, _>(|k| a[k] - b[k])).sqrt()
    }

    #[test]
    fn eigenvalues_and_vectors_rebuild_the_tensor() {
        let (mut worst, mut against): ([f64; 2], f64) = ([0.0; 2], 0.0);
        for a in symmetric_samples() {
            let (values, v) = eigen(&a);
            let size = square(&a).sqrt();
            worst[0] = worst[0].max(distance(&spectral(values, &v), &a) / size);
            let unit = mat_mul_t(&v, &v);
            let off = axpy9(&unit, -1.0, &IDENTITY);
            worst[1] = worst[1].max(double_dot(&off, &off).sqrt());
            let m = full(&a);
            let mut exact: Vec<f64> = Matrix3::from_fn(|r, c| m[r][c])
                .symmetric_eigenvalues()
                .iter()
                .copied()
                .collect();
            let mut ours = values;
            exact.sort_by(f64::total_cmp);
            ours.sort_by(f64::total_cmp);
            for k in 0..3 {
                against = against.max((ours[k] - exact[k]).abs() / size);
            }
        }
        println!(
            "rebuilt {:e}, orthogonal {:e}, eigenvalues {against:e} (tolerance 4e-15)",
            worst[0], worst[1]
        );
        assert!(worst[0] < 4e-15 && worst[1] < 4e-15 && against < 4e-15);
    }

    #[test]
    fn logarithm_and_exponential_are_each_others_inverse_and_match_nalgebra() {
        let (mut round_trip, mut against): (f64, f64) = (0.0, 0.0);
        for a in symmetric_samples() {
            let log = ln_symmetric(&a);
            round_trip = round_trip.max(distance(&exp_symmetric(&log), &a) / square(&a).sqrt());
            let m = full(&a);
            let e = Matrix3::from_fn(|r, c| m[r][c]).symmetric_eigen();
            // The smallest eigenvalue is known to the round-off of the largest.
            let condition = e.eigenvalues.max() / e.eigenvalues.min();
            let exact = e.eigenvectors
                * Matrix3::from_diagonal(&e.eigenvalues.map(f64::ln))
                * e.eigenvectors.transpose();
            let exact = [0, 1, 2, 3, 4, 5].map(|k| {
                let (r, c) = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)][k];
                exact[(r, c)]
            });
            against = against.max(distance(&log, &exact) / condition);
        }
        println!("round trip {round_trip:e} (tolerance 2e-14), ln {against:e} (tolerance 4e-15)");
        assert!(round_trip < 2e-14 && against < 4e-15);
    }

    #[test]
    fn logarithm_does_not_jump_where_its_series_ends() {
        let mut worst: f64 = 0.0;
        for i in 0..400 {
            let direction = sample(i);
            let s = [0, 1, 2].map(|k| direction[0][k]);
            let size = 0.2 / dot(s, s).sqrt();
            let inside = symmetric(s.map(|s| 1.0 + s * size * (1.0 - 1e-12)), i);
            let outside = symmetric(s.map(|s| 1.0 + s * size * (1.0 + 1e-12)), i);
            worst = worst.max(distance(&ln_symmetric(&inside), &ln_symmetric(&outside)));
        }
        println!("jump {worst:e} (tolerance 2e-12, of which 4e-13 is the distance)");
        assert!(worst < 2e-12);
    }
}
