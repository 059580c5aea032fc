//! Keeps the BLAS and LAPACK routines of the conic solver inside this library: an interpreter may have loaded others of the same names.
//!
//! The compiler exports every function with a fixed name. A symbol that one object calls hidden is hidden in the whole library.

macro_rules! hidden {
    ($($name:literal)*) => {
        #[cfg(target_os = "linux")]
        core::arch::global_asm!($(concat!(".globl ", $name), concat!(".hidden ", $name)),*);
    };
}

hidden!("dgemm_" "dgemv_" "dsymv_" "dsyrk_" "dsyr2k_" "dpotrf_" "dpotrs_" "dgesv_" "dsyevr_" "dgesdd_" "dgesvd_");
hidden!("sgemm_" "sgemv_" "ssymv_" "ssyrk_" "ssyr2k_" "spotrf_" "spotrs_" "sgesv_" "ssyevr_" "sgesdd_" "sgesvd_");
