//! Numbers of the common form, a sign, digits and a decimal sign, read sixteen characters at a time.
//!
//! A number of at most 2^53 in its digits, over or times a power of ten of at most 22, is one operation on two
//! exact numbers: rounded once, it is the nearest number to the text, as that of the standard library.

/// Characters that are looked at together.
pub(super) const WIDTH: usize = 16;
/// Characters that are searched together.
pub(super) const GROUP: usize = 64;

/// Largest whole number up to which all are exact in double precision.
const EXACT: u64 = 1 << 53;
const ONES: u64 = 0x0101_0101_0101_0101;
const HIGH: u64 = 0x80 * ONES;

/// Powers of ten, each exact.
pub(super) const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16,
    1e17, 1e18, 1e19, 1e20, 1e21, 1e22,
];

/// Masks of the last `i` of sixteen characters, in two words, the first character lowest.
pub(super) const LAST: [[u64; 2]; WIDTH + 1] = {
    let mut masks = [[0; 2]; WIDTH + 1];
    let mut count = 1;
    while count <= WIDTH {
        masks[count] = if count <= 8 {
            [0, !0 << (8 * (8 - count))]
        } else {
            [!0 << (8 * (16 - count)), !0]
        };
        count += 1;
    }
    masks
};

/// A field, at the end of sixteen characters.
#[derive(Clone, Copy)]
pub(super) struct Field<'a> {
    pub(super) window: &'a [u8; WIDTH],
    /// Characters of the field; beyond 16, those before the window are others.
    pub(super) length: usize,
}

/// A way to read numbers: of any processor, or of one that looks at sixteen characters at once.
pub(super) trait Way: Copy {
    /// The digits of the last `count` characters of `window` as one whole number, and the place of the decimal sign
    /// in the window, 16 without any. `None` where there is no digit, or another character.
    fn digits(self, window: &[u8; WIDTH], count: usize, decimal: u8) -> Option<(u64, usize)>;

    /// Values of four fields; `None` where one of them may be of another form.
    #[inline(always)]
    fn four(self, fields: [Field<'_>; 4], decimal: u8) -> Option<[f64; 4]> {
        let value = |field: Field<'_>| number(self, field.window, field.length, decimal);
        let [a, b, c, d] = fields;
        Some([value(a)?, value(b)?, value(c)?, value(d)?])
    }

    /// Bits of those of [`GROUP`] characters that are the delimiter, and of those that are control characters from
    /// backspace to 15, the first character lowest.
    fn marked(self, group: &[u8; GROUP], delimiter: u8) -> [u64; 2];
}

/// The way of any processor: two words of eight characters.
#[derive(Clone, Copy)]
pub(super) struct Words;

/// Value of the last `length` characters of `window`; `None` if they are no number or one of another
/// form, such as one with an exponent.
#[inline(always)]
pub(super) fn number(
    way: impl Way,
    window: &[u8; WIDTH],
    length: usize,
    decimal: u8,
) -> Option<f64> {
    let first = *window.get(WIDTH.wrapping_sub(length))?;
    let negative = first == b'-';
    let count = length - usize::from(negative | (first == b'+'));
    let (whole, place) = way.digits(window, count, decimal)?;
    if whole > EXACT {
        return None;
    }
    // Up to 2^53, a signed number converts faster. Without a decimal sign the place is 16.
    let after = (WIDTH - 1).wrapping_sub(place) % (WIDTH + 1) % WIDTH;
    let value = whole as i64 as f64 / POWERS[after];
    // The sign cannot be foreseen: no branch depends on it.
    Some(f64::from_bits(value.to_bits() | u64::from(negative) << 63))
}

/// The same of a number with an exponent, whose last `length` characters before it end the window.
pub(super) fn scaled(
    window: &[u8; WIDTH],
    length: usize,
    decimal: u8,
    exponent: i32,
) -> Option<f64> {
    let first = *window.get(WIDTH.wrapping_sub(length))?;
    let negative = first == b'-';
    let count = length - usize::from(negative | (first == b'+'));
    let (whole, place) = Words.digits(window, count, decimal)?;
    let after = if place < WIDTH { WIDTH - 1 - place } else { 0 };
    let power = exponent - after as i32;
    let scale = *POWERS.get(power.unsigned_abs() as usize)?;
    let whole = Some(whole).filter(|whole| *whole <= EXACT)? as f64;
    let value = if power < 0 {
        whole / scale
    } else {
        whole * scale
    };
    Some(if negative { -value } else { value })
}

/// The exponent of a number, of at most two digits, and the text before it; Fortran writes a `D`.
pub(super) fn split_exponent(text: &[u8]) -> Option<(&[u8], i32)> {
    let at = text
        .iter()
        .rposition(|byte| matches!(byte, b'e' | b'E' | b'd' | b'D'))?;
    let (before, exponent) = (text.get(..at)?, text.get(at + 1..)?);
    let (negative, digits) = match exponent {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    let value = match digits {
        [a @ b'0'..=b'9'] => i32::from(a - b'0'),
        [a @ b'0'..=b'9', b @ b'0'..=b'9'] => 10 * i32::from(a - b'0') + i32::from(b - b'0'),
        _ => return None,
    };
    Some((before, if negative { -value } else { value }))
}

impl Way for Words {
    #[inline(always)]
    fn digits(self, window: &[u8; WIDTH], count: usize, decimal: u8) -> Option<(u64, usize)> {
        let mask = LAST.get(count)?;
        let words = u128::from_le_bytes(*window);
        let (low, high) = (words as u64 & mask[0], (words >> 64) as u64 & mask[1]);
        let signs = ONES * u64::from(decimal);
        // Nor can the place of the decimal sign.
        let found = u128::from(zeros(low ^ signs)) | u128::from(zeros(high ^ signs)) << 64;
        let place = (found.trailing_zeros() / 8) as usize;
        // Characters before the decimal sign move into its place.
        let digits = match WIDTH.checked_sub(1 + place) {
            Some(after) => {
                let keep = LAST[after & (WIDTH - 1)];
                let moved = [low << 8, high << 8 | low >> 56];
                let joined = |i: usize, own: u64| own & keep[i] | moved[i] & !keep[i];
                [joined(0, low), joined(1, high)]
            }
            None => [low, high],
        };
        let active = count.checked_sub(usize::from(place < WIDTH))?;
        let mask = LAST.get(active).filter(|_| active > 0)?;
        let low = digits[0] ^ mask[0] & (0x30 * ONES);
        let high = digits[1] ^ mask[1] & (0x30 * ONES);
        let beyond = |word: u64| (word.wrapping_add(0x76 * ONES) | word) & HIGH;
        let whole = eight(low) * 100_000_000 + eight(high);
        ((beyond(low) | beyond(high)) == 0).then_some((whole, place))
    }

    #[inline(always)]
    fn marked(self, group: &[u8; GROUP], delimiter: u8) -> [u64; 2] {
        let delimiters = ONES * u64::from(delimiter);
        let mut found = [0; 2];
        for (i, word) in group.chunks_exact(8).enumerate() {
            let word = word.try_into().map_or(0, u64::from_le_bytes);
            let others = [word ^ delimiters, word & (0xf8 * ONES) ^ (0x08 * ONES)];
            for (found, others) in found.iter_mut().zip(others) {
                *found |= gathered(!nonzero(others) & HIGH) << (8 * i);
            }
        }
        found
    }
}

/// The highest bit of each byte that is not zero; the others are of no meaning.
fn nonzero(word: u64) -> u64 {
    ((word & !HIGH) + !HIGH) | word
}

/// The highest bit of each of eight bytes as a byte.
fn gathered(bits: u64) -> u64 {
    (bits >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

/// The highest bit of each byte that is zero, exact up to the first of them.
fn zeros(word: u64) -> u64 {
    word.wrapping_sub(ONES) & !word & HIGH
}

/// Value of eight digits, the first of them lowest.
fn eight(digits: u64) -> u64 {
    let pairs = digits.wrapping_mul(2561) >> 8 & 0x00ff_00ff_00ff_00ff;
    let fours = pairs.wrapping_mul(6_553_601) >> 16 & 0x0000_ffff_0000_ffff;
    fours.wrapping_mul(42_949_672_960_001) >> 32
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    /// The value of a text as it stands in a file, behind and before other characters.
    fn read(text: &str, decimal: u8) -> Option<f64> {
        let mut window = *b"7,-3.25,1e5\n42.,";
        let start = WIDTH.checked_sub(text.len())?;
        window[start..].copy_from_slice(text.as_bytes());
        both(&window, text.len(), decimal)
    }

    /// The value that all ways of this processor agree on.
    fn both(window: &[u8; WIDTH], length: usize, decimal: u8) -> Option<f64> {
        let found = number(Words, window, length, decimal);
        #[cfg(target_arch = "x86_64")]
        if let Some(simd) = pulp::x86::V3::try_new() {
            let other = number(simd, window, length, decimal);
            assert_eq!(
                other.map(f64::to_bits),
                found.map(f64::to_bits),
                "{window:?}"
            );
        }
        found
    }

    /// The value of a text with an exponent.
    fn read_scaled(text: &str) -> Option<f64> {
        let (before, exponent) = split_exponent(text.as_bytes())?;
        let mut window = *b"7,-3.25,1e5\n42.,";
        let start = WIDTH.checked_sub(before.len())?;
        window[start..].copy_from_slice(before);
        scaled(&window, before.len(), b'.', exponent)
    }

    #[test]
    fn numbers_with_exponents_are_the_standard_librarys_to_the_last_bit() {
        let mut random = ChaCha8Rng::seed_from_u64(2);
        let mut taken = 0;
        for _ in 0..400_000 {
            let bits = random.next_u64();
            let places = (bits % 12) as usize;
            let near = f64::from(bits as u32) * 10f64.powi((bits >> 40) as i32 % 40 - 25);
            for text in [
                format!("{:e}", f32::from_bits(bits as u32)),
                format!("{near:.places$e}"),
                format!("{:+.places$E}", -near),
                format!(
                    "{}.{}e{}",
                    bits >> 50,
                    bits % 1_000_000,
                    (bits % 60) as i32 - 30
                ),
            ] {
                let found = read_scaled(&text).map(f64::to_bits);
                let expected = text.parse::<f64>().ok().map(f64::to_bits);
                assert!(found.is_none() || found == expected, "{text}");
                taken += u32::from(found.is_some());
            }
        }
        assert!(taken > 800_000, "{taken}");
        for text in [
            "e5", "1e", "1e+", "1e-", "1e1.0", "1e1e1", "1ee1", ".e1", "-e1", "1e 1", "xe1",
        ] {
            assert_eq!(text.parse::<f64>().ok(), None);
            assert_eq!(read_scaled(text), None, "{text}");
        }
        for text in [
            "1e5",
            "-0e0",
            "-0.0e-5",
            "1.e1",
            ".5e-2",
            "9007199254740992e22",
            "1e22",
            "1e-22",
        ] {
            let expected = text.parse().ok().map(f64::to_bits);
            for sign in ["e", "E", "d", "D"] {
                let found = read_scaled(&text.replace('e', sign)).map(f64::to_bits);
                assert_eq!(found, expected, "{text}");
            }
        }
    }

    /// Asserts the standard library's bits, where there is a value.
    #[track_caller]
    fn agrees(text: &str) -> bool {
        let found = read(text, b'.').map(f64::to_bits);
        let expected = text.parse::<f64>().ok().map(f64::to_bits);
        assert!(
            found.is_none() || found == expected,
            "{text}: {found:?} {expected:?}"
        );
        let comma = read(&text.replace('.', ","), b',').map(f64::to_bits);
        assert_eq!(comma, found, "{text}");
        found.is_some()
    }

    #[test]
    fn numbers_are_the_standard_librarys_to_the_last_bit() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut taken = 0;
        for _ in 0..400_000 {
            let bits = random.next_u64();
            let single = f32::from_bits(bits as u32);
            let scaled = (bits >> 11) as f64 / 10f64.powi((bits % 24) as i32);
            let places = (bits % 14) as usize;
            for text in [
                format!("{single}"),
                format!("{scaled}"),
                format!("{:.places$}", scaled),
                format!("{:+.places$}", -scaled),
                format!("{:.9}", single.abs().fract() * 10.0),
                // Digits as they come, which no number was printed to.
                format!("{}.{}", bits >> 44, bits % 100_000_000),
                format!("-{}.", bits >> 20),
                format!(".{:08}", bits % 100_000_000),
            ] {
                taken += u32::from(agrees(&text));
            }
        }
        // Long texts go another way, which is no loss: few files have them.
        assert!(taken > 1_200_000, "{taken}");
    }

    #[test]
    fn halfway_and_other_hard_texts_agree() {
        for text in [
            "9007199254740993",
            "9007199254740992",
            "9007199254740991",
            "9007199254740.993",
            "900719925474.0993",
            "0.30000000000000",
            "0.1",
            "-0",
            "-0.0",
            "+0",
            "0.",
            "-.5",
            "5.",
            "123456789012345",
            "1234567890123456",
            "9999999999999999",
            "99999999.9999999",
            "0.00000000000001",
            "00000000000001.5",
            "8.5",
            "4503599627370.49",
            "1.1754943",
        ] {
            agrees(text);
        }
        assert_eq!(
            read("-0.0", b'.').map(f64::to_bits),
            Some((-0.0_f64).to_bits())
        );
    }

    #[test]
    fn other_texts_have_no_value_here() {
        for text in [
            "", ".", "-", "+", "-.", "--1", "+-1", "1-", "1.2.3", "1e5", "1 2", " 1", "1 ", "nan",
            "inf", "1/2", "1:2", "1,5", "0x1", "1.\u{7f}", "é1", "1.é", "/", ":", "\u{0}1",
            "1\u{0}", "-1.+2",
        ] {
            assert_eq!(read(text, b'.'), None, "{text:?}");
        }
        // Every character in every place of a number.
        for place in 0..8 {
            for other in 0..=255_u8 {
                let mut window = *b"########-123.456";
                window[8 + place] = other;
                let text = std::str::from_utf8(&window[8..]).ok();
                let expected = text.and_then(|text| text.parse::<f64>().ok());
                let found = both(&window, 8, b'.');
                assert!(found.is_none() || found == expected, "{place} {other}");
            }
        }
    }
}
