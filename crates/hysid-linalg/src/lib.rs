//! Dense least squares on plain column-major `f64`: QR, Cholesky, Gram states, orthogonalisation kernels. The only crate that names faer.
