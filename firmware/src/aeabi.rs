//! The functions that the compiler calls for double precision, under the names of Arm's run-time ABI.
//!
//! Those of [`massline_firmware::double`] come first. The compiler's own remain for what these leave.

use massline_firmware::double;

// SAFETY: compiler_builtins has these functions, of two numbers in double precision and one as their
// result, which the ABI passes as whole numbers of 64 bits.
unsafe extern "aapcs" {
    safe fn __muldf3(a: u64, b: u64) -> u64;
    safe fn __adddf3(a: u64, b: u64) -> u64;
}

// SAFETY, of all names below: they are those of Arm's run-time ABI for these very functions, and
// compiler_builtins' own of these names are weak, so that each is there once.

/// `a · b`.
#[unsafe(no_mangle)]
extern "aapcs" fn __aeabi_dmul(a: u64, b: u64) -> u64 {
    double::product(a, b).unwrap_or_else(|| __muldf3(a, b))
}

/// `a + b`.
#[unsafe(no_mangle)]
extern "aapcs" fn __aeabi_dadd(a: u64, b: u64) -> u64 {
    double::sum(a, b).unwrap_or_else(|| __adddf3(a, b))
}

/// `a - b`.
#[unsafe(no_mangle)]
extern "aapcs" fn __aeabi_dsub(a: u64, b: u64) -> u64 {
    __aeabi_dadd(a, b ^ 1 << 63)
}

/// `a == b`.
#[unsafe(no_mangle)]
extern "aapcs" fn __aeabi_dcmpeq(a: u64, b: u64) -> u32 {
    double::equal(a, b).into()
}
