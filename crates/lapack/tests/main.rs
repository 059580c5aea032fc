//! Each routine is checked by the residual of its own equation, on matrices past the sizes that the
//! solver treats in closed form.

#![expect(clippy::unwrap_used, reason = "a test may")]
#![expect(clippy::undocumented_unsafe_blocks, reason = "every call passes whole matrices with their own sizes")]

use lapack_nalgebra::{dgemm_, dgemv_, dgesdd_, dgesv_, dpotrf_, dpotrs_, dsyevr_, dsymv_, dsyr2k_, dsyrk_};
use nalgebra::DMatrix;

const N: i32 = 5;
const ORDER: usize = 5;

fn letter(option: u8) -> *const i8 {
    Box::leak(Box::new(option as i8))
}

/// A matrix with entries in (-1, 1) that look random and are not.
fn matrix(rows: usize, columns: usize, seed: u64) -> DMatrix<f64> {
    let mut x = seed;
    DMatrix::from_fn(rows, columns, |_, _| {
        x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        f64::from(u32::try_from(x >> 33).unwrap()) / f64::from(1u32 << 30) - 1.0
    })
}

fn positive_definite(seed: u64) -> DMatrix<f64> {
    let a = matrix(ORDER, ORDER, seed);
    &a * a.transpose() + DMatrix::identity(ORDER, ORDER)
}

fn assert_small(residual: &DMatrix<f64>) {
    assert!(residual.amax() < 1e-12, "{residual}");
}

#[test]
fn gemm_multiplies_with_either_side_transposed() {
    let (a, b, c) = (matrix(3, 5, 1), matrix(4, 3, 2), matrix(5, 4, 3));
    let mut result = c.clone();
    unsafe {
        dgemm_(
            letter(b'T'),
            letter(b'T'),
            &5,
            &4,
            &3,
            &2.0,
            a.as_ptr(),
            &3,
            b.as_ptr(),
            &4,
            &0.5,
            result.as_mut_ptr(),
            &5,
        );
    }
    assert_small(&(result - (a.transpose() * b.transpose() * 2.0 + c * 0.5)));
}

#[test]
fn a_zero_beta_ignores_what_was_there() {
    let (a, b) = (matrix(2, 2, 1), matrix(2, 2, 2));
    let mut result = DMatrix::from_element(2, 2, f64::NAN);
    unsafe {
        dgemm_(
            letter(b'N'),
            letter(b'N'),
            &2,
            &2,
            &2,
            &1.0,
            a.as_ptr(),
            &2,
            b.as_ptr(),
            &2,
            &0.0,
            result.as_mut_ptr(),
            &2,
        );
    }
    assert_small(&(result - a * b));
}

#[test]
fn gemv_and_symv_multiply_vectors() {
    let (a, x) = (positive_definite(4), matrix(ORDER, 1, 5));
    let (mut general, mut symmetric) = (x.clone(), x.clone());
    let mut upper = a.clone();
    upper.fill_lower_triangle(f64::NAN, 1);
    unsafe {
        dgemv_(letter(b'N'), &N, &N, &1.0, a.as_ptr(), &N, x.as_ptr(), &1, &-1.0, general.as_mut_ptr(), &1);
        dsymv_(letter(b'U'), &N, &1.0, upper.as_ptr(), &N, x.as_ptr(), &1, &-1.0, symmetric.as_mut_ptr(), &1);
    }
    assert_small(&(&general - (&a * &x - &x)));
    assert_small(&(general - symmetric));
}

#[test]
fn rank_updates_touch_one_triangle_only() {
    let (a, b) = (matrix(ORDER, 3, 6), matrix(ORDER, 3, 7));
    let (mut one, mut two) = (DMatrix::from_element(ORDER, ORDER, 7.0), DMatrix::from_element(ORDER, ORDER, 7.0));
    unsafe {
        dsyrk_(letter(b'U'), letter(b'N'), &N, &3, &1.0, a.as_ptr(), &N, &0.0, one.as_mut_ptr(), &N);
        dsyr2k_(letter(b'U'), letter(b'N'), &N, &3, &1.0, a.as_ptr(), &N, b.as_ptr(), &N, &0.0, two.as_mut_ptr(), &N);
    }
    let (product, cross) = (&a * a.transpose(), &a * b.transpose() + &b * a.transpose());
    for (i, j) in (0..ORDER).flat_map(|i| (0..ORDER).map(move |j| (i, j))) {
        let expected = |m: &DMatrix<f64>| if i <= j { m[(i, j)] } else { 7.0 };
        assert!((one[(i, j)] - expected(&product)).abs() < 1e-12);
        assert!((two[(i, j)] - expected(&cross)).abs() < 1e-12);
    }
}

#[test]
fn cholesky_factors_solve_and_refuse_indefinite_matrices() {
    for triangle in [b'L', b'U'] {
        let (a, b) = (positive_definite(8), matrix(ORDER, 2, 9));
        let (mut factor, mut x, mut info) = (a.clone(), b.clone(), -1);
        unsafe {
            dpotrf_(letter(triangle), &N, factor.as_mut_ptr(), &N, &mut info);
            dpotrs_(letter(triangle), &N, &2, factor.as_ptr(), &N, x.as_mut_ptr(), &N, &mut info);
        }
        assert_eq!(info, 0);
        assert_small(&(&a * x - b));
        let mut indefinite = -a;
        unsafe { dpotrf_(letter(triangle), &N, indefinite.as_mut_ptr(), &N, &mut info) };
        assert!(info > 0);
    }
}

#[test]
fn gesv_solves_and_refuses_singular_matrices() {
    let (mut a, b) = (matrix(ORDER, ORDER, 10), matrix(ORDER, 2, 11));
    let (mut x, mut info, mut pivots) = (b.clone(), -1, [0; ORDER]);
    unsafe { dgesv_(&N, &2, a.as_mut_ptr(), &N, pivots.as_mut_ptr(), x.as_mut_ptr(), &N, &mut info) };
    assert_eq!(info, 0);
    assert_small(&(&a * x - b));
    let (mut singular, mut x) = (DMatrix::<f64>::zeros(ORDER, ORDER), matrix(ORDER, 2, 12));
    unsafe { dgesv_(&N, &2, singular.as_mut_ptr(), &N, pivots.as_mut_ptr(), x.as_mut_ptr(), &N, &mut info) };
    assert!(info > 0);
}

#[test]
fn eigenvalues_rise_and_vectors_satisfy_their_equation() {
    let a = matrix(ORDER, ORDER, 13);
    let a = &a + a.transpose();
    let (mut values, mut vectors) = (DMatrix::zeros(ORDER, 1), DMatrix::zeros(ORDER, ORDER));
    let (mut copy, mut found, mut support, mut info) = (a.clone(), 0, [0; 2 * ORDER], -1);
    let (mut work, mut integers) = ([0.0], [0]);
    for lwork in [-1, 1] {
        unsafe {
            dsyevr_(
                letter(b'V'),
                letter(b'A'),
                letter(b'U'),
                &N,
                copy.as_mut_ptr(),
                &N,
                &0.0,
                &0.0,
                &0,
                &0,
                &-1.0,
                &mut found,
                values.as_mut_ptr(),
                vectors.as_mut_ptr(),
                &N,
                support.as_mut_ptr(),
                work.as_mut_ptr(),
                &lwork,
                integers.as_mut_ptr(),
                &lwork,
                &mut info,
            );
        }
    }
    assert_eq!((found, info), (N, 0));
    assert!(values.as_slice().windows(2).all(|pair| pair[0] <= pair[1]));
    assert_small(&(&a * &vectors - &vectors * DMatrix::from_diagonal(&values.column(0).into_owned())));
}

#[test]
fn singular_values_rebuild_the_matrix() {
    let mut a = matrix(4, ORDER, 14);
    let original = a.clone();
    let (mut s, mut u, mut vt) = (DMatrix::zeros(4, 1), DMatrix::zeros(4, 4), DMatrix::zeros(4, ORDER));
    let (mut work, mut integers, mut info) = ([0.0], [0; 64], -1);
    for lwork in [-1, 1] {
        unsafe {
            dgesdd_(
                letter(b'S'),
                &4,
                &N,
                a.as_mut_ptr(),
                &4,
                s.as_mut_ptr(),
                u.as_mut_ptr(),
                &4,
                vt.as_mut_ptr(),
                &4,
                work.as_mut_ptr(),
                &lwork,
                integers.as_mut_ptr(),
                &mut info,
            );
        }
    }
    assert_eq!(info, 0);
    assert!(s.as_slice().windows(2).all(|pair| pair[0] >= pair[1]));
    assert_small(&(u * DMatrix::from_diagonal(&s.column(0).into_owned()) * vt - original));
}
