//! The only file that names the FFT crate.

use microfft::{Complex32, complex};

/// Longest block. Beyond 1024 samples the tables need the feature `long-blocks`.
pub(crate) const MAX_BLOCK_LENGTH: usize = if cfg!(feature = "long-blocks") {
    32768
} else {
    1024
};

/// `true` if a block of `length` samples can be transformed.
pub(super) const fn supported(length: usize) -> bool {
    length.is_power_of_two() && length >= 16 && length <= MAX_BLOCK_LENGTH
}

macro_rules! dispatch {
    ($buffer:ident; $($(#[$gate:meta])? $n:literal => $f:ident),*) => {
        match $buffer.len() {
            $($(#[$gate])? $n => {
                if let Ok(fixed) = <&mut [Complex32; $n]>::try_from(&mut *$buffer) {
                    let _ = complex::$f(fixed);
                }
                true
            })*
            _ => false,
        }
    };
}

/// In-place transform `X(k) = Σ x(n) exp(-2πj kn/N)`. `false` if the length has none.
pub(super) fn transform(buffer: &mut [Complex32]) -> bool {
    dispatch!(buffer;
        16 => cfft_16, 32 => cfft_32, 64 => cfft_64, 128 => cfft_128,
        256 => cfft_256, 512 => cfft_512, 1024 => cfft_1024,
        #[cfg(feature = "long-blocks")] 2048 => cfft_2048,
        #[cfg(feature = "long-blocks")] 4096 => cfft_4096,
        #[cfg(feature = "long-blocks")] 8192 => cfft_8192,
        #[cfg(feature = "long-blocks")] 16384 => cfft_16384,
        #[cfg(feature = "long-blocks")] 32768 => cfft_32768
    )
}
