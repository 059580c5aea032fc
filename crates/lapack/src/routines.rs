//! The exported routines, in double and single precision.

#![expect(
    clippy::missing_safety_doc,
    reason = "each routine has the argument list and the demands of the BLAS or LAPACK routine of its name"
)]

use std::ffi::{c_char, c_int};

use crate::dense::{
    cholesky, combine, eigen, in_triangle, is, read, read_vector, singular, size, symmetric, transposed, write,
};

/// Answers a workspace query or reports success.
macro_rules! answer_query {
    ($lwork:expr, $work:expr, $info:expr) => {
        // SAFETY: LAPACK's callers pass writable `info`, and `work` of at least one element.
        unsafe {
            *$info = 0;
            if *$lwork == -1 {
                *$work = 1.0;
                return;
            }
        }
    };
}

macro_rules! routines {
    ($real:ty: $gemm:ident $gemv:ident $symv:ident $syrk:ident $syr2k:ident $potrf:ident $potrs:ident $gesv:ident
     $syevr:ident $gesdd:ident $gesvd:ident) => {
        /// General matrix product, `C = alpha op(A) op(B) + beta C`.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemm(
            transa: *const c_char,
            transb: *const c_char,
            m: *const c_int,
            n: *const c_int,
            k: *const c_int,
            alpha: *const $real,
            a: *const $real,
            lda: *const c_int,
            b: *const $real,
            ldb: *const c_int,
            beta: *const $real,
            c: *mut $real,
            ldc: *const c_int,
        ) {
            // SAFETY: the arguments describe matrices as the routine's definition demands.
            unsafe {
                let (m, n, k) = (size(*m), size(*n), size(*k));
                let stored =
                    |option: c_char, rows, columns| if is(option, b'N') { (rows, columns) } else { (columns, rows) };
                let ((ar, ac), (br, bc)) = (stored(*transa, m, k), stored(*transb, k, n));
                let a = transposed(*transa, read(a, ar, ac, size(*lda)));
                let b = transposed(*transb, read(b, br, bc, size(*ldb)));
                let old = read(c, m, n, size(*ldc));
                write(c, size(*ldc), &combine(*alpha, &(a * b), *beta, &old));
            }
        }

        /// General matrix times vector, `y = alpha op(A) x + beta y`.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gemv(
            trans: *const c_char,
            m: *const c_int,
            n: *const c_int,
            alpha: *const $real,
            a: *const $real,
            lda: *const c_int,
            x: *const $real,
            incx: *const c_int,
            beta: *const $real,
            y: *mut $real,
            incy: *const c_int,
        ) {
            // SAFETY: the arguments describe a matrix and vectors as the routine's definition demands.
            unsafe {
                let a = transposed(*trans, read(a, size(*m), size(*n), size(*lda)));
                let x = read_vector(x, a.ncols(), *incx);
                let old = read_vector(y, a.nrows(), *incy);
                for (i, value) in combine(*alpha, &(a * x), *beta, &old).iter().enumerate() {
                    *y.add(i * size(*incy)) = *value;
                }
            }
        }

        /// Symmetric matrix times vector, `y = alpha A x + beta y`.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $symv(
            uplo: *const c_char,
            n: *const c_int,
            alpha: *const $real,
            a: *const $real,
            lda: *const c_int,
            x: *const $real,
            incx: *const c_int,
            beta: *const $real,
            y: *mut $real,
            incy: *const c_int,
        ) {
            // SAFETY: the arguments describe a matrix and vectors as the routine's definition demands.
            unsafe {
                let n = size(*n);
                let a = symmetric(*uplo, &read(a, n, n, size(*lda)));
                let (x, old) = (read_vector(x, n, *incx), read_vector(y, n, *incy));
                for (i, value) in combine(*alpha, &(a * x), *beta, &old).iter().enumerate() {
                    *y.add(i * size(*incy)) = *value;
                }
            }
        }

        /// Symmetric rank-k update of one triangle, `C = alpha A A' + beta C` or `alpha A' A + beta C`.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syrk(
            uplo: *const c_char,
            trans: *const c_char,
            n: *const c_int,
            k: *const c_int,
            alpha: *const $real,
            a: *const $real,
            lda: *const c_int,
            beta: *const $real,
            c: *mut $real,
            ldc: *const c_int,
        ) {
            // SAFETY: the arguments describe matrices as the routine's definition demands.
            unsafe {
                let (n, k) = (size(*n), size(*k));
                let (rows, columns) = if is(*trans, b'N') { (n, k) } else { (k, n) };
                let a = transposed(*trans, read(a, rows, columns, size(*lda)));
                let old = read(c, n, n, size(*ldc));
                let update = combine(*alpha, &(&a * a.transpose()), *beta, &old);
                write(c, size(*ldc), &in_triangle(*uplo, &update, &old));
            }
        }

        /// Symmetric rank-2k update of one triangle, `C = alpha (A B' + B A') + beta C`.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syr2k(
            uplo: *const c_char,
            trans: *const c_char,
            n: *const c_int,
            k: *const c_int,
            alpha: *const $real,
            a: *const $real,
            lda: *const c_int,
            b: *const $real,
            ldb: *const c_int,
            beta: *const $real,
            c: *mut $real,
            ldc: *const c_int,
        ) {
            // SAFETY: the arguments describe matrices as the routine's definition demands.
            unsafe {
                let (n, k) = (size(*n), size(*k));
                let (rows, columns) = if is(*trans, b'N') { (n, k) } else { (k, n) };
                let a = transposed(*trans, read(a, rows, columns, size(*lda)));
                let b = transposed(*trans, read(b, rows, columns, size(*ldb)));
                let old = read(c, n, n, size(*ldc));
                let product = &a * b.transpose();
                let update = combine(*alpha, &(&product + product.transpose()), *beta, &old);
                write(c, size(*ldc), &in_triangle(*uplo, &update, &old));
            }
        }

        /// Cholesky factor of a symmetric positive definite matrix, in the given triangle.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrf(
            uplo: *const c_char,
            n: *const c_int,
            a: *mut $real,
            lda: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: the arguments describe a matrix as the routine's definition demands.
            unsafe {
                let n = size(*n);
                let given = read(a, n, n, size(*lda));
                let Some(lower) = cholesky(symmetric(*uplo, &given)) else {
                    *info = 1;
                    return;
                };
                let factor = if is(*uplo, b'U') { lower.transpose() } else { lower };
                write(a, size(*lda), &in_triangle(*uplo, &factor, &given));
                *info = 0;
            }
        }

        /// Solution of `A X = B` from the Cholesky factor of `A`.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $potrs(
            uplo: *const c_char,
            n: *const c_int,
            nrhs: *const c_int,
            a: *const $real,
            lda: *const c_int,
            b: *mut $real,
            ldb: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: the arguments describe matrices as the routine's definition demands.
            unsafe {
                let n = size(*n);
                let stored = read(a, n, n, size(*lda));
                let lower = if is(*uplo, b'U') { stored.transpose() } else { stored };
                let right = read(b, n, size(*nrhs), size(*ldb));
                let solution = lower.solve_lower_triangular(&right).and_then(|y| lower.tr_solve_lower_triangular(&y));
                if let Some(solution) = &solution {
                    write(b, size(*ldb), solution);
                }
                *info = c_int::from(solution.is_none());
            }
        }

        /// Solution of `A X = B` for a general square matrix.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesv(
            n: *const c_int,
            nrhs: *const c_int,
            a: *mut $real,
            lda: *const c_int,
            _ipiv: *mut c_int,
            b: *mut $real,
            ldb: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: the arguments describe matrices as the routine's definition demands.
            unsafe {
                let n = size(*n);
                let right = read(b, n, size(*nrhs), size(*ldb));
                let solution = read(a, n, n, size(*lda)).lu().solve(&right);
                if let Some(solution) = &solution {
                    write(b, size(*ldb), solution);
                }
                *info = c_int::from(solution.is_none());
            }
        }

        /// All eigenvalues, and on demand the vectors, of a symmetric matrix.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $syevr(
            jobz: *const c_char,
            _range: *const c_char,
            uplo: *const c_char,
            n: *const c_int,
            a: *mut $real,
            lda: *const c_int,
            _vl: *const $real,
            _vu: *const $real,
            _il: *const c_int,
            _iu: *const c_int,
            _abstol: *const $real,
            m: *mut c_int,
            w: *mut $real,
            z: *mut $real,
            ldz: *const c_int,
            _isuppz: *mut c_int,
            work: *mut $real,
            lwork: *const c_int,
            iwork: *mut c_int,
            _liwork: *const c_int,
            info: *mut c_int,
        ) {
            // SAFETY: LAPACK's callers pass `iwork` of at least one element.
            unsafe { *iwork = 1 };
            answer_query!(lwork, work, info);
            // SAFETY: the arguments describe matrices as the routine's definition demands.
            unsafe {
                let order = size(*n);
                let matrix = symmetric(*uplo, &read(a, order, order, size(*lda)));
                let Some((values, vectors)) = eigen(matrix) else {
                    *info = 1;
                    return;
                };
                *m = *n;
                write(w, order, &values);
                if is(*jobz, b'V') {
                    write(z, size(*ldz), &vectors);
                }
            }
        }

        /// Compact singular value decomposition.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesvd(
            _jobu: *const c_char,
            _jobvt: *const c_char,
            m: *const c_int,
            n: *const c_int,
            a: *mut $real,
            lda: *const c_int,
            s: *mut $real,
            u: *mut $real,
            ldu: *const c_int,
            vt: *mut $real,
            ldvt: *const c_int,
            work: *mut $real,
            lwork: *const c_int,
            info: *mut c_int,
        ) {
            answer_query!(lwork, work, info);
            // SAFETY: the arguments describe matrices as the routine's definition demands.
            unsafe {
                let Some((left, values, right)) = singular(read(a, size(*m), size(*n), size(*lda))) else {
                    *info = 1;
                    return;
                };
                write(s, values.nrows(), &values);
                write(u, size(*ldu), &left);
                write(vt, size(*ldvt), &right);
            }
        }

        /// Compact singular value decomposition, under LAPACK's other name for it.
        #[unsafe(no_mangle)]
        pub unsafe extern "C" fn $gesdd(
            jobz: *const c_char,
            m: *const c_int,
            n: *const c_int,
            a: *mut $real,
            lda: *const c_int,
            s: *mut $real,
            u: *mut $real,
            ldu: *const c_int,
            vt: *mut $real,
            ldvt: *const c_int,
            work: *mut $real,
            lwork: *const c_int,
            _iwork: *mut c_int,
            info: *mut c_int,
        ) {
            // SAFETY: the two routines make the same demands.
            unsafe { $gesvd(jobz, jobz, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info) };
        }
    };
}

routines!(f64: dgemm_ dgemv_ dsymv_ dsyrk_ dsyr2k_ dpotrf_ dpotrs_ dgesv_ dsyevr_ dgesdd_ dgesvd_);
routines!(f32: sgemm_ sgemv_ ssymv_ ssyrk_ ssyr2k_ spotrf_ spotrs_ sgesv_ ssyevr_ sgesdd_ sgesvd_);
