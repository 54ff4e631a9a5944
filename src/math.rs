//! Small tensors over [`Lane`]: vectors `[T; 3]` and row-major matrices `[[T; 3]; 3]`.
//!
//! Imports nothing of ours but the lane. Set-up code that needs decompositions uses nalgebra.

use crate::lane::Lane;

/// A vector.
pub type Vec3<T> = [T; 3];
/// A second-order tensor, row-major.
pub type Mat3<T> = [[T; 3]; 3];

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
}
