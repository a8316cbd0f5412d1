//! Places of delimiters and line ends in text, 64 bytes at a time.

use super::decimal::{GROUP, Way};

/// Places that there is room for at first, and more room at a time.
const CHUNK: usize = 16 << 10;

/// Places of delimiters and line ends.
#[derive(Default)]
pub(super) struct Marks {
    /// As many as [`Self::count`] says, and room for more.
    places: Vec<u32>,
    count: usize,
    /// Numbers of those places that are control characters from backspace to 15, among which are the line ends.
    controls: Vec<u32>,
}

impl Marks {
    /// All places.
    #[inline(always)]
    pub(super) fn places(&self) -> &[u32] {
        self.places.get(..self.count).unwrap_or(&[])
    }

    /// Numbers of the places of control characters.
    #[inline(always)]
    pub(super) fn controls(&self) -> &[u32] {
        &self.controls
    }

    /// Looks through the part of a text from `from` to `to`, which has [`GROUP`] bytes more; nothing that was found
    /// before is kept but the place `from - 1`, as if a line ended there.
    #[inline(always)]
    pub(super) fn find(
        &mut self,
        way: impl Way,
        text: &[u8],
        from: usize,
        to: usize,
        delimiter: u8,
    ) {
        self.controls.clear();
        self.controls.push(0);
        if self.places.is_empty() {
            self.places.resize(CHUNK, 0);
        }
        if let Some(first) = self.places.first_mut() {
            *first = from.wrapping_sub(1) as u32;
        }
        self.count = 1;
        let (groups, _) = text.get(from..).unwrap_or(&[]).as_chunks::<GROUP>();
        for (at, group) in (from..to).step_by(GROUP).zip(groups) {
            let [mut delimiters, mut controls] = way.marked(group, delimiter);
            if to - at < GROUP {
                let within = !(u64::MAX << (to - at));
                delimiters &= within;
                controls &= within;
            }
            self.push(delimiters | controls, controls & !delimiters, at as u32);
        }
    }

    /// Adds the places of the bits, of which some are control characters.
    #[inline(always)]
    fn push(&mut self, bits: u64, mut controls: u64, at: u32) {
        /// Places that are written without looking whether there are as many.
        const ALWAYS: usize = 8;
        let before = self.count;
        if self.places.len() < before + GROUP {
            self.places.resize(before + CHUNK, 0);
        }
        self.count += bits.count_ones() as usize;
        while controls != 0 {
            let others = bits & (controls & controls.wrapping_neg()).wrapping_sub(1);
            self.controls.push((before as u32) + others.count_ones());
            controls &= controls - 1;
        }
        let mut left = bits;
        let room = self.places.get_mut(before..).unwrap_or(&mut []);
        if let Some(places) = room.first_chunk_mut::<ALWAYS>() {
            for place in places {
                *place = at + left.trailing_zeros();
                left &= left.wrapping_sub(1);
            }
        }
        for place in room.iter_mut().skip(ALWAYS) {
            if left == 0 {
                break;
            }
            *place = at + left.trailing_zeros();
            left &= left - 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::decimal::Words;
    use super::*;

    #[track_caller]
    fn check(way: impl Way, text: &[u8], from: usize, to: usize, delimiter: u8) {
        let mut marks = Marks::default();
        // What was there before is forgotten.
        marks.find(way, text, 0, to, b'8');
        marks.find(way, text, from, to, delimiter);
        let is_mark =
            |i: &u32| matches!(text[*i as usize], 8..=15) || text[*i as usize] == delimiter;
        let expected: Vec<u32> = [(from as u32).wrapping_sub(1)]
            .into_iter()
            .chain((from as u32..to as u32).filter(is_mark))
            .collect();
        assert_eq!(marks.places(), expected, "{to}");
        let control =
            |number: &usize| *number == 0 || text[expected[*number] as usize] != delimiter;
        let controls: Vec<u32> = (0..expected.len())
            .filter(control)
            .map(|number| number as u32)
            .collect();
        assert_eq!(marks.controls(), controls, "{to}");
    }

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
                for delimiter in *b",\t" {
                    check(Words, &text, from, length, delimiter);
                    #[cfg(target_arch = "x86_64")]
                    if let Some(simd) = pulp::x86::V3::try_new() {
                        check(simd, &text, from, length, delimiter);
                    }
                }
            }
        }
    }
}
