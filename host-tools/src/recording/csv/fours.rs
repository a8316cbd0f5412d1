//! Numbers of the common form by instructions that look at sixteen characters at once, one field or four fields together.

use super::decimal::{Field, GROUP, LAST, POWERS, WIDTH, Way};
use core::arch::x86_64::{__m128i, __m256d, __m256i};
use pulp::cast;
use pulp::x86::V3;

/// Room for every number of characters, and every place of a decimal sign, with one bit for its absence.
const PLACES: usize = 32;

/// Moves of sixteen characters that leave the last `count` of them, without the one at `place` and with those before it
/// in its place; at `count` times [`PLACES`], and `place`, 16 where there is none.
static MOVES: [[u8; WIDTH]; PLACES * PLACES] = {
    // An index from 128 on makes a zero.
    let mut moves = [[128; WIDTH]; PLACES * PLACES];
    let mut count = 0;
    while count <= WIDTH {
        let mut place = 0;
        while place <= WIDTH {
            let mut at = 0;
            while at < WIDTH {
                let from = if place == WIDTH || at > place {
                    at
                } else {
                    // Below zero, which no field reaches.
                    at.wrapping_sub(1)
                };
                if from < WIDTH && from + count >= WIDTH {
                    moves[count * PLACES + place][at] = from as u8;
                }
                at += 1;
            }
            place += 1;
        }
        count += 1;
    }
    moves
};

/// What the digits as a whole number are divided by, at the place of the decimal sign, and [`PLACES`] behind that
/// where the number is negative. Rounding is alike on both sides of zero.
static DIVISORS: [f64; 2 * PLACES] = {
    let mut divisors = [1.0; 2 * PLACES];
    let mut place = 0;
    while place < PLACES {
        let power = if place < WIDTH {
            POWERS[WIDTH - 1 - place]
        } else {
            1.0
        };
        divisors[place] = power;
        divisors[PLACES + place] = -power;
        place += 1;
    }
    divisors
};

/// Factors of digits in pairs, of pairs in fours, of fours in eights, of eights in the whole.
const TENS: [i8; 32] = {
    let mut tens = [1; 32];
    let mut at = 0;
    while at < 32 {
        tens[at] = 10;
        at += 2;
    }
    tens
};
const HUNDREDS: [i16; 16] = [
    100, 1, 100, 1, 100, 1, 100, 1, 100, 1, 100, 1, 100, 1, 100, 1,
];
const MYRIADS: [i16; 16] = {
    let mut myriads = [1; 16];
    let mut at = 0;
    while at < 16 {
        myriads[at] = 10_000;
        at += 2;
    }
    myriads
};
const EIGHTS: [f64; 4] = [1e8, 1.0, 1e8, 1.0];
/// From here on not all whole numbers are exact.
const EXACT: [f64; 4] = [9_007_199_254_740_992.0; 4];

/// What is known of a field before its digits are looked at.
#[derive(Clone, Copy)]
struct Shape {
    /// [`PLACES`] of a negative number, else 0.
    sign: usize,
    /// Characters behind the sign, and their bits among sixteen.
    count: usize,
    bits: u32,
}

#[inline(always)]
fn shape(field: Field<'_>) -> Option<Shape> {
    let first = *field.window.get(WIDTH.wrapping_sub(field.length))?;
    let negative = first == b'-';
    let count = field.length - usize::from(negative | (first == b'+'));
    Some(Shape {
        sign: PLACES * usize::from(negative),
        count,
        bits: (0xffff_0000_u32 >> count) & 0xffff,
    })
}

/// Where digits go and what they are divided by; `None` but for digits with at most one decimal sign among them, which
/// these bits of sixteen tell.
#[inline(always)]
fn settled(shape: Shape, digits: u32, signs: u32) -> Option<(&'static [u8; WIDTH], f64)> {
    let (digits, signs) = (digits & shape.bits, signs & shape.bits);
    let is_single = signs & signs.wrapping_sub(1) == 0;
    let good = (digits | signs == shape.bits) & (digits != 0) & is_single;
    let place = (signs | 1 << WIDTH).trailing_zeros() as usize;
    let moves = &MOVES[(shape.count * PLACES + place) & (PLACES * PLACES - 1)];
    let divisor = DIVISORS[(shape.sign + place) & (2 * PLACES - 1)];
    good.then_some((moves, divisor))
}

/// Two fields: their digits by fours, and what they are divided by; `None` if one of them is of another form.
#[inline(always)]
fn two(simd: V3, [low, high]: [Field<'_>; 2], decimal: u8) -> Option<(__m256i, [f64; 2])> {
    let shapes = [shape(low)?, shape(high)?];
    let text = simd
        .avx
        ._mm256_set_m128i(cast(*high.window), cast(*low.window));
    let digits = simd.avx2._mm256_sub_epi8(text, cast([b'0'; 32]));
    let least = simd.avx2._mm256_min_epu8(digits, cast([9_u8; 32]));
    let is_digit = simd.avx2._mm256_cmpeq_epi8(least, digits);
    let is_digit = simd.avx2._mm256_movemask_epi8(is_digit) as u32;
    let is_sign = simd.avx2._mm256_cmpeq_epi8(text, cast([decimal; 32]));
    let is_sign = simd.avx2._mm256_movemask_epi8(is_sign) as u32;
    // One after the other: calculated side by side, they would be moved to and fro between registers.
    let (low, first) = settled(shapes[0], is_digit, is_sign)?;
    let (high, second) = settled(shapes[1], is_digit >> 16, is_sign >> 16)?;
    let moves = simd.avx._mm256_set_m128i(cast(*high), cast(*low));
    let digits = simd.avx2._mm256_shuffle_epi8(digits, moves);
    let pairs = simd.avx2._mm256_maddubs_epi16(digits, cast(TENS));
    let fours = simd.avx2._mm256_madd_epi16(pairs, cast(HUNDREDS));
    Some((fours, [first, second]))
}

/// Eights in turn with eights of a hundred million.
#[inline(always)]
fn scaled(simd: V3, eights: __m128i) -> __m256d {
    let eights = simd.avx._mm256_cvtepi32_pd(eights);
    simd.avx._mm256_mul_pd(eights, cast(EIGHTS))
}

/// Values of four fields; `None` where one of them is of another form.
#[inline(always)]
fn four(simd: V3, fields: [Field<'_>; 4], decimal: u8) -> Option<[f64; 4]> {
    /// Greater or equal, false for what is no number.
    const AT_LEAST: i32 = 29;
    let [a, b, c, d] = fields;
    let (low, first) = two(simd, [a, b], decimal)?;
    let (high, second) = two(simd, [c, d], decimal)?;
    // The eights of the first field and the third, then of the second and the fourth.
    let packed = simd.avx2._mm256_packus_epi32(low, high);
    let eights = simd.avx2._mm256_madd_epi16(packed, cast(MYRIADS));
    let odd = simd.avx._mm256_castsi256_si128(eights);
    let even = simd.avx2._mm256_extracti128_si256::<1>(eights);
    // Both summands are exact, and their sum is where it is below the bound.
    let whole = simd
        .avx
        ._mm256_hadd_pd(scaled(simd, odd), scaled(simd, even));
    let inexact = simd.avx._mm256_cmp_pd::<AT_LEAST>(whole, cast(EXACT));
    let inexact = simd.avx._mm256_movemask_pd(inexact);
    let divisors = [first[0], first[1], second[0], second[1]];
    let values: [f64; 4] = cast(simd.avx._mm256_div_pd(whole, cast(divisors)));
    (inexact == 0).then_some(values)
}

/// Moves of sixteen characters that close the gap at place `i`; none at 16.
const CLOSED: [[u8; WIDTH]; WIDTH + 1] = {
    let mut moves = [[0; WIDTH]; WIDTH + 1];
    let mut place = 0;
    while place <= WIDTH {
        let mut at = 0;
        while at < WIDTH {
            moves[place][at] = match at as u8 {
                at if place == WIDTH || at > place as u8 => at,
                // An index from 128 on makes a zero.
                0 => 128,
                at => at - 1,
            };
            at += 1;
        }
        place += 1;
    }
    moves
};

/// Factors of digits in pairs, of pairs in fours, of fours in eights.
const TENS_OF_ONE: [i8; WIDTH] = [10, 1, 10, 1, 10, 1, 10, 1, 10, 1, 10, 1, 10, 1, 10, 1];
const HUNDREDS_OF_ONE: [i16; 8] = [100, 1, 100, 1, 100, 1, 100, 1];
const MYRIADS_OF_ONE: [i16; 8] = [10_000, 1, 10_000, 1, 10_000, 1, 10_000, 1];

impl Way for V3 {
    #[inline(always)]
    fn digits(self, window: &[u8; WIDTH], count: usize, decimal: u8) -> Option<(u64, usize)> {
        let mask: __m128i = cast(*LAST.get(count)?);
        let text = self.sse2._mm_and_si128(cast(*window), mask);
        let signs = self.sse2._mm_cmpeq_epi8(text, cast([decimal; WIDTH]));
        let found = self.sse2._mm_movemask_epi8(signs) as u32 | 1 << WIDTH;
        let place = found.trailing_zeros() as usize;
        let active = count.checked_sub(usize::from(place < WIDTH))?;
        let mask: __m128i = cast(*LAST.get(active).filter(|_| active > 0)?);
        let digits = self.ssse3._mm_shuffle_epi8(text, cast(*CLOSED.get(place)?));
        let base = self.sse2._mm_and_si128(mask, cast([b'0'; WIDTH]));
        let digits = self.sse2._mm_sub_epi8(digits, base);
        let least = self.sse2._mm_min_epu8(digits, cast([9_u8; WIDTH]));
        let good = self.sse2._mm_cmpeq_epi8(least, digits);
        let pairs = self.ssse3._mm_maddubs_epi16(digits, cast(TENS_OF_ONE));
        let fours = self.sse2._mm_madd_epi16(pairs, cast(HUNDREDS_OF_ONE));
        let fours = self.sse4_1._mm_packus_epi32(fours, fours);
        let eights: [u32; 4] = cast(self.sse2._mm_madd_epi16(fours, cast(MYRIADS_OF_ONE)));
        let whole = u64::from(eights[0]) * 100_000_000 + u64::from(eights[1]);
        (self.sse2._mm_movemask_epi8(good) == 0xffff).then_some((whole, place))
    }

    #[inline(always)]
    fn four(self, fields: [Field<'_>; 4], decimal: u8) -> Option<[f64; 4]> {
        four(self, fields, decimal)
    }

    #[inline(always)]
    fn marked(self, group: &[u8; GROUP], delimiter: u8) -> [u64; 2] {
        let mut found = [0; 2];
        for (i, half) in group.chunks_exact(32).enumerate() {
            let half = half.try_into().unwrap_or([0_u8; 32]);
            let text: __m256i = cast(half);
            let delimiters = self.avx2._mm256_cmpeq_epi8(text, cast([delimiter; 32]));
            let high = self.avx2._mm256_and_si256(text, cast([0xf8_u8; 32]));
            let controls = self.avx2._mm256_cmpeq_epi8(high, cast([0x08_u8; 32]));
            for (found, marks) in found.iter_mut().zip([delimiters, controls]) {
                let marks = self.avx2._mm256_movemask_epi8(marks) as u32;
                *found |= u64::from(marks) << (32 * i);
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::csv::decimal::{Words, number};
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    /// Asserts that four texts are read as each by itself, or that one of them is not.
    #[track_caller]
    fn agree(simd: V3, texts: [&[u8]; 4], decimal: u8) -> bool {
        let mut windows = [*b"7,-3.25,1e5\n42.,"; 4];
        for (window, text) in windows.iter_mut().zip(texts) {
            window[WIDTH - text.len()..].copy_from_slice(text);
        }
        let fields: [Field<'_>; 4] = core::array::from_fn(|i| Field {
            window: &windows[i],
            length: texts[i].len(),
        });
        let each = fields.map(|field| number(Words, field.window, field.length, decimal));
        let shown = texts.map(String::from_utf8_lossy);
        match four(simd, fields, decimal) {
            Some(found) => {
                let (found, each) = (
                    found.map(|x| Some(x.to_bits())),
                    each.map(|x| x.map(f64::to_bits)),
                );
                assert_eq!(found, each, "{shown:?}");
                true
            }
            None => {
                // The bound itself is exact, and read by itself.
                let beyond = |x: &Option<f64>| {
                    x.is_none_or(|x| texts.iter().any(|t| t.len() > 15) && x != 0.0)
                };
                assert!(each.iter().any(beyond), "{shown:?}");
                false
            }
        }
    }

    #[test]
    fn four_numbers_have_the_bits_of_each_by_itself() {
        let Some(simd) = V3::try_new() else { return };
        let mut random = ChaCha8Rng::seed_from_u64(3);
        let mut taken = 0;
        for _ in 0..200_000 {
            let texts: [String; 4] = core::array::from_fn(|_| {
                let bits = random.next_u64();
                let places = (bits % 12) as usize;
                let text = match bits >> 61 {
                    0 => format!("{}", f32::from_bits(bits as u32)),
                    1 => format!("{:+.places$}", f64::from(bits as i32) * 1e-6),
                    2 => format!("{}", bits >> (bits % 60)),
                    3 => format!("-{}.", bits >> 20),
                    4 => format!(".{:08}", bits % 100_000_000),
                    5 => format!("-{}.{}", bits >> 50 & 0xfff, bits % 100_000_000),
                    _ => format!("{:.9}", f32::from_bits(bits as u32 >> 2)),
                };
                text[..text.len().min(WIDTH)].to_owned()
            });
            let texts = texts.each_ref().map(|text| text.as_bytes());
            taken += u32::from(agree(simd, texts, b'.'));
            let commas = texts.map(|text| text.to_ascii_lowercase());
            let commas = commas.map(|mut text| {
                text.iter_mut()
                    .filter(|b| **b == b'.')
                    .for_each(|b| *b = b',');
                text
            });
            agree(simd, commas.each_ref().map(Vec::as_slice), b',');
        }
        assert!(taken > 50_000, "{taken}");
    }

    #[test]
    fn a_text_of_another_form_is_told_in_every_place() {
        let Some(simd) = V3::try_new() else { return };
        for other in [
            "",
            ".",
            "-",
            "+",
            "-.",
            "--1",
            "+-1",
            "1-",
            "1.2.3",
            "1e5",
            "1 2",
            " 1",
            "1 ",
            "nan",
            "1/2",
            "1:2",
            "1,5",
            "é1",
            "1.é",
            "\u{0}1",
            "1\u{0}",
            "-1.+2",
            "9007199254740993",
            "9999999999999999",
        ] {
            for place in 0..4 {
                let mut texts = ["1.5", "-2", "+.25", "0.000000000001"].map(str::as_bytes);
                assert!(agree(simd, texts, b'.'));
                texts[place] = other.as_bytes();
                assert!(!agree(simd, texts, b'.'), "{other:?}");
            }
        }
        // Every character in every place of a number.
        for place in 0..16 {
            for other in 0..=255_u8 {
                let mut text = *b"-123456789.12345";
                text[place] = other;
                agree(simd, [b"1", &text, b"-0", b"0.1"], b'.');
            }
        }
    }
}
