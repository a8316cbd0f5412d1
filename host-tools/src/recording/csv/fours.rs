//! Numbers of the common form by instructions that look at sixteen characters at once, one field or four fields together.

use super::decimal::{Field, GROUP, LAST, POWERS, WIDTH, Way};
use core::arch::x86_64::{__m128i, __m256d, __m256i};
use pulp::cast;
use pulp::x86::V3;

/// Places of a decimal sign, counted down from 31 as zero bits before it are, with 0 for its absence.
const PLACES: usize = 32;
/// Plans of numbers of one sign.
const OF_A_SIGN: usize = (WIDTH + 1) * PLACES;

/// How the digits of a field become a number, which its characters behind the sign and the place of the last decimal
/// sign among sixteen tell.
#[repr(align(32))]
struct Plan {
    /// Moves of sixteen characters that leave those of the field, without the decimal sign and with those before it in
    /// its place. Where no digit is among them, they leave the last character, which is none.
    moves: [u8; WIDTH],
    /// Divisor of the digits as a whole number, negative for a negative number: rounding is alike on both
    /// sides of zero.
    divisor: f64,
}

/// Plans by the number of characters behind the sign times [`PLACES`], and the place of the decimal sign; those of
/// negative numbers behind the others.
static PLANS: [Plan; 2 * OF_A_SIGN] = {
    const NONE: Plan = Plan {
        // An index from 128 on makes a zero.
        moves: [128; WIDTH],
        divisor: 1.0,
    };
    let mut plans = [NONE; 2 * OF_A_SIGN];
    let mut count = 0;
    while count <= WIDTH {
        let mut zeros = 0;
        while zeros < PLACES {
            let plan = &mut plans[count * PLACES + zeros];
            // One before the field is another field's.
            let within = zeros >= WIDTH && PLACES - 1 - zeros + count >= WIDTH;
            let place = if within { PLACES - 1 - zeros } else { WIDTH };
            let mut at = 0;
            while at < WIDTH {
                let from = if !within || at > place {
                    at
                } else {
                    // Below zero, which no field reaches.
                    at.wrapping_sub(1)
                };
                if from < WIDTH && from + count >= WIDTH {
                    plan.moves[at] = from as u8;
                }
                at += 1;
            }
            if count == within as usize {
                plan.moves[WIDTH - 1] = WIDTH as u8 - 1;
            }
            if within {
                plan.divisor = POWERS[WIDTH - 1 - place];
            }
            let (moves, divisor) = (plan.moves, -plan.divisor);
            plans[OF_A_SIGN + count * PLACES + zeros] = Plan { moves, divisor };
            zeros += 1;
        }
        count += 1;
    }
    plans
};

/// By how much the first character of a field moves its plan from that of as many characters.
static SHIFTS: [i16; 256] = {
    let mut shifts = [0; 256];
    shifts[b'+' as usize] = -(PLACES as i16);
    shifts[b'-' as usize] = (OF_A_SIGN - PLACES) as i16;
    shifts
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

/// The plan of a field, in whose sixteen characters decimal signs are at these bits.
#[inline(always)]
fn plan(field: Field<'_>, signs: u32) -> Option<&'static Plan> {
    let first = *field.window.get(WIDTH.wrapping_sub(field.length))?;
    let zeros = signs.leading_zeros() as usize % PLACES;
    let at = field.length * PLACES + zeros;
    PLANS.get(at.wrapping_add_signed(SHIFTS[usize::from(first)].into()))
}

/// Two fields: their digits, one in sixteen, of which one is above nine where a field is of another form, and what they
/// are divided by.
#[inline(always)]
fn two(simd: V3, [low, high]: [Field<'_>; 2], decimal: u8) -> Option<(__m256i, [f64; 2])> {
    let text = simd
        .avx
        ._mm256_set_m128i(cast(*high.window), cast(*low.window));
    let is_sign = simd
        .avx2
        ._mm256_cmpeq_epi8(text, simd.avx._mm256_set1_epi8(decimal as i8));
    let is_sign = simd.avx2._mm256_movemask_epi8(is_sign) as u32;
    let (low, high) = (plan(low, is_sign & 0xffff)?, plan(high, is_sign >> 16)?);
    let digits = simd.avx2._mm256_sub_epi8(text, cast([b'0'; 32]));
    let moves = simd.avx._mm256_set_m128i(cast(high.moves), cast(low.moves));
    let digits = simd.avx2._mm256_shuffle_epi8(digits, moves);
    Some((digits, [low.divisor, high.divisor]))
}

/// Digits by fours.
#[inline(always)]
fn by_fours(simd: V3, digits: __m256i) -> __m256i {
    let pairs = simd.avx2._mm256_maddubs_epi16(digits, cast(TENS));
    simd.avx2._mm256_madd_epi16(pairs, cast(HUNDREDS))
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
    let largest = simd.avx2._mm256_max_epu8(low, high);
    let beyond = simd.avx2._mm256_subs_epu8(largest, cast([9_u8; 32]));
    if simd.avx._mm256_testz_si256(beyond, beyond) == 0 {
        return None;
    }
    // The eights of the first field and the third, then of the second and the fourth.
    let (low, high) = (by_fours(simd, low), by_fours(simd, high));
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
