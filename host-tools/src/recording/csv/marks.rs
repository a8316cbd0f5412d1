//! Places of delimiters and line ends in text, 64 bytes at a time.

const ONES: u64 = 0x0101_0101_0101_0101;
const HIGH: u64 = 0x80 * ONES;

/// Bytes that are looked at together.
pub(super) const GROUP: usize = 64;

/// Adds the places of the delimiter, and of control characters from backspace to 15, among which are the
/// line ends. `text` is looked at from `from` to `to` and has [`GROUP`] bytes more.
#[inline(always)]
pub(super) fn add(text: &[u8], from: usize, to: usize, delimiter: u8, marks: &mut Vec<u32>) {
    let delimiters = ONES * u64::from(delimiter);
    let groups = text.get(from..).unwrap_or(&[]).chunks_exact(GROUP);
    for (at, group) in (from..to).step_by(GROUP).zip(groups) {
        let mut found = 0;
        for (i, word) in group.chunks_exact(8).enumerate() {
            let word = word.try_into().map_or(0, u64::from_le_bytes);
            let others = nonzero(word ^ delimiters) & nonzero(word & (0xf8 * ONES) ^ (0x08 * ONES));
            found |= gathered(!others & HIGH) << (8 * i);
        }
        if to - at < GROUP {
            found &= !(u64::MAX << (to - at));
        }
        push(found, at as u32, marks);
    }
}

/// The highest bit of each byte that is not zero; the others are of no meaning.
#[inline(always)]
fn nonzero(word: u64) -> u64 {
    ((word & !HIGH) + !HIGH) | word
}

/// The highest bit of each of eight bytes as a byte.
#[inline(always)]
fn gathered(bits: u64) -> u64 {
    (bits >> 7).wrapping_mul(0x0102_0408_1020_4080) >> 56
}

/// Adds the places of the bits.
#[inline(always)]
fn push(mut bits: u64, at: u32, marks: &mut Vec<u32>) {
    /// Places that are written without looking whether there are as many.
    const ALWAYS: usize = 8;
    let before = marks.len();
    let count = bits.count_ones() as usize;
    let mut places = [0; ALWAYS];
    for place in &mut places {
        *place = at + bits.trailing_zeros();
        bits &= bits.wrapping_sub(1);
    }
    marks.extend_from_slice(&places);
    if count < ALWAYS {
        marks.truncate(before + count);
    }
    while bits != 0 {
        marks.push(at + bits.trailing_zeros());
        bits &= bits - 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_mark_is_found_and_nothing_else() {
        let mut state = 1_u64;
        let mut byte = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 56) as u8
        };
        for length in (0..300).chain([5000]) {
            // Few different bytes, many of them marks; then all bytes.
            for few in [true, false] {
                let pool = *b",,,\n\r\t0128.-+ \x80\xac";
                let text: Vec<u8> = (0..length + GROUP)
                    .map(|_| {
                        if few {
                            pool[usize::from(byte()) % pool.len()]
                        } else {
                            byte()
                        }
                    })
                    .collect();
                let from = length.min(7);
                let mut found = vec![3];
                add(&text, from, length, b',', &mut found);
                let is_mark = |i: &u32| matches!(text[*i as usize], b',' | 8..=15);
                let expected = [3]
                    .into_iter()
                    .chain((from as u32..length as u32).filter(is_mark));
                assert_eq!(found, expected.collect::<Vec<_>>(), "{length}");
            }
        }
    }
}
