//! Functions compiled for processors that calculate with eight numbers at once.

/// Runs `f`.
#[inline(always)]
pub(super) fn plainly<T>(f: impl FnOnce() -> T) -> T {
    f()
}

/// Runs `f`, with all that is compiled into it, by AVX2 where the processor has it. Neither multiplies and
/// adds at once, so that bits are the same.
#[cfg(all(feature = "avx2", target_arch = "x86_64"))]
#[inline(always)]
pub(super) fn widely<T>(f: impl FnOnce() -> T) -> T {
    match pulp::x86::V3::try_new() {
        Some(simd) => simd.vectorize(f),
        None => f(),
    }
}

#[cfg(not(all(feature = "avx2", target_arch = "x86_64")))]
pub(super) use plainly as widely;
