//! Transforms of real blocks in fixed memory: N samples as N/2 complex ones.
//!
//! Radix 4, of blocks of 1024 radix 8, decimation in time, after a first pass of radix 8 or 4 that reads the
//! samples where they lie; none checks a bound in its inner loop. On the chip the last pass over blocks of 256
//! makes the lines, too. It is our own, since the blocks of twelve
//! channels are most of what the chip does: microfft 0.6 takes three times as many instructions for the same
//! lines.

use super::Complex32;
use super::lane::{Complex, Lane, minus, plus, times, turned};
use core::f64::consts::PI;

/// Longest block. Beyond 1024 samples the tables need the feature `long-blocks`.
pub(crate) const MAX_BLOCK_LENGTH: usize = if cfg!(feature = "long-blocks") {
    32768
} else {
    1024
};

/// Shortest block.
pub(super) const SHORTEST: usize = 16;

/// `true` if a block of `length` samples can be transformed.
pub(super) const fn supported(length: usize) -> bool {
    length.is_power_of_two() && length >= SHORTEST && length <= MAX_BLOCK_LENGTH
}

/// Butterflies of the largest last pass, which combines four transforms of as many lines.
const BUTTERFLIES: usize = MAX_BLOCK_LENGTH / 8;

/// exp(-2πj mk/N) for the transform of N/2 = 4 · `BUTTERFLIES` lines: m = 1 to 3 of each k. A smaller
/// transform takes every fourth, sixteenth, … of them.
static TWIDDLES: [[Complex32; 3]; BUTTERFLIES] = {
    let mut table = [[Complex32::new(0.0, 0.0); 3]; BUTTERFLIES];
    let mut k = 0;
    while k < BUTTERFLIES {
        let mut m = 0;
        while m < 3 {
            table[k][m] = unit((m + 1) * k, 4 * BUTTERFLIES);
            m += 1;
        }
        k += 1;
    }
    table
};

/// Pairs of the blocks that are transformed by passes of radix 8 alone, 8 · 8 · 8: blocks of 1024, which are
/// most of what a chip does without decimation. Workstations have too few registers for eight channels by
/// eights, and take a few hundredths longer so; longer blocks are none of the chip's.
const BY_EIGHTS: usize = 512;

/// exp(-2πj mk/N) for the last pass of those, and every eighth for the one before: m = 1 to 7 of each k.
static TWIDDLES_OF_EIGHT: [[Complex32; 7]; BY_EIGHTS / 8] = {
    let mut table = [[Complex32::new(0.0, 0.0); 7]; BY_EIGHTS / 8];
    let mut k = 0;
    while k < table.len() {
        let mut m = 0;
        while m < 7 {
            table[k][m] = unit((m + 1) * k, BY_EIGHTS);
            m += 1;
        }
        k += 1;
    }
    table
};

/// Pairs of the blocks of which the lines of one channel are made in the last pass: blocks of 256, to which 1024
/// samples are decimated.
const LINES_AT_ONCE: usize = 128;

/// exp(-2πjk/n) of the first n/2 lines of the longest block, then of one half as long, and so on: a
/// block reads its own one after the other.
static HALF_CIRCLES: [Complex32; MAX_BLOCK_LENGTH] = {
    let mut table = [Complex32::new(0.0, 0.0); MAX_BLOCK_LENGTH];
    let (mut begin, mut n) = (0, MAX_BLOCK_LENGTH);
    while n >= SHORTEST {
        let mut k = 0;
        while k < n / 2 {
            table[begin + k] = unit(k, n);
            k += 1;
        }
        begin += k;
        n /= 2;
    }
    table
};

/// exp(-2πjk/n), `n` a multiple of eight.
const fn unit(k: usize, n: usize) -> Complex32 {
    let (c, s) = circle(k, n);
    Complex32::new(c as f32, -s as f32)
}

/// Cosine and sine of 2πk/n, `n` a multiple of eight.
pub(super) const fn circle(k: usize, n: usize) -> (f64, f64) {
    // Within an eighth of the circle, for which the series were made, then mirrored.
    let (octant, rest) = (k * 8 / n % 8, k * 8 % n);
    let share = if octant % 2 == 0 { rest } else { n - rest };
    let x = PI / 4.0 * (share as f64 / n as f64);
    // The terms beyond are below 1e-17.
    let y = x * x;
    let sine = x
        * (1.0
            - y / 6.0
                * (1.0
                    - y / 20.0
                        * (1.0
                            - y / 42.0
                                * (1.0 - y / 72.0 * (1.0 - y / 110.0 * (1.0 - y / 156.0))))));
    let cosine = 1.0
        - y / 2.0
            * (1.0
                - y / 12.0
                    * (1.0
                        - y / 30.0
                            * (1.0
                                - y / 56.0
                                    * (1.0 - y / 90.0 * (1.0 - y / 132.0 * (1.0 - y / 182.0))))));
    match octant {
        0 => (cosine, sine),
        1 => (sine, cosine),
        2 => (-sine, cosine),
        3 => (-cosine, sine),
        4 => (-cosine, -sine),
        5 => (-sine, -cosine),
        6 => (sine, -cosine),
        _ => (cosine, -sine),
    }
}

/// A transformed block.
#[derive(Clone, Copy)]
pub(super) enum Transformed<'z, L> {
    /// Transformed pairs, of which [`lines`] makes lines.
    Pairs(&'z [Complex<L>]),
    /// The lines from 1 on, each twice as large.
    Lines(&'z [Complex<L>]),
}

impl<L: Lane> Transformed<'_, L> {
    /// Line `k` of the block, neither the line 0 nor the last one, twice as large; zero beyond.
    #[inline(always)]
    pub(super) fn line(self, k: usize) -> Complex<L> {
        match self {
            Self::Pairs(z) => lines(z, k).next(),
            Self::Lines(z) => z.get(k).copied(),
        }
        .unwrap_or_default()
    }
}

/// The transform of a block of samples of one channel or of several side by side. `ring` holds them, the oldest
/// one at `head`; `work` is of half its length. Only the first `wanted` lines of the block are sure to be right.
#[cfg_attr(not(target_os = "none"), inline(always))] // Its caller says for which processor.
pub(super) fn transform<'w, L: Lane>(
    ring: &[L],
    head: usize,
    work: &'w mut [Complex<L>],
    wanted: usize,
) -> Transformed<'w, L> {
    // One channel at a time has registers for the last pass and the lines together.
    let at_once = L::WIDTH == 1 && work.len() == LINES_AT_ONCE && wanted <= LINES_AT_ONCE / 2 + 2;
    transform_pairs(ring, head, work, wanted, at_once);
    if at_once {
        combine_to_lines(work);
        Transformed::Lines(work)
    } else {
        Transformed::Pairs(work)
    }
}

/// The transform of pairs of samples, each a complex number. Only the first `wanted` of its lines are sure to be
/// right, and as many of the last ones. The last pass is left out, if it is to be `unfinished`.
#[cfg_attr(not(target_os = "none"), inline(always))]
fn transform_pairs<L: Lane>(
    ring: &[L],
    head: usize,
    work: &mut [Complex<L>],
    wanted: usize,
    unfinished: bool,
) {
    let half = work.len();
    let is_odd = half.trailing_zeros() % 2 == 1;
    let radix = if is_odd { 8 } else { 4 };
    let groups = half / radix;
    // Four channels at once, elsewhere than on the chip, are faster with lengths that are not known.
    let alone = L::WIDTH == 1;
    let in_halves = alone && radix == 8 && head.is_multiple_of(half);
    match groups {
        16 if in_halves => first_pass::<L, 16>(ring, head, work),
        64 if in_halves => first_pass::<L, 64>(ring, head, work),
        _ if radix == 8 && head.is_multiple_of(2 * groups) => in_pieces(ring, head, work),
        _ => one_by_one(ring, head, work, radix),
    }
    if half == BY_EIGHTS {
        combine_by_eights(work);
        combine_last_eight(work, wanted);
        return;
    }
    let mut length = radix;
    while length < half {
        match length {
            _ if 4 * length == half && unfinished => return,
            _ if 4 * length == half && wanted <= length => combine_ends(work, wanted),
            8 if alone => combine_eights(work),
            32 if alone => combine::<L, 32>(work),
            128 if alone => combine::<L, 128>(work),
            _ => combine_any(work, length),
        }
        length *= 4;
    }
}

/// The first pass of `GROUPS` groups, where each half of the samples lies in one piece.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn first_pass<L: Lane, const GROUPS: usize>(ring: &[L], head: usize, work: &mut [Complex<L>]) {
    let (pairs, _) = ring.as_chunks::<2>();
    let (start, end) = pairs.split_at(pairs.len() / 2);
    let (older, newer) = if head == 0 {
        (start, end)
    } else {
        (end, start)
    };
    let ([a, b, c, d], [e, f, g, h]) =
        (older.as_chunks::<GROUPS>().0, newer.as_chunks::<GROUPS>().0)
    else {
        return;
    };
    let [work] = work.as_chunks_mut::<8>().0.as_chunks_mut::<GROUPS>().0 else {
        return;
    };
    let reversed = Reversed::of(GROUPS, 8);
    for (k, place) in (0..GROUPS).zip(reversed.places()) {
        let z = |pairs: &[[L; 2]; GROUPS]| Complex::new(pairs[k][0], pairs[k][1]);
        // Never beyond, which needs no check then.
        work[place % GROUPS] = eight([z(a), z(b), z(c), z(d), z(e), z(f), z(g), z(h)]);
    }
}

/// The first pass, where each input of all groups lies in one piece.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn in_pieces<L: Lane>(ring: &[L], head: usize, work: &mut [Complex<L>]) {
    let (pairs, _) = ring.as_chunks::<2>();
    let groups = pairs.len() / 8;
    let (newer, older) = pairs.split_at((head / 2).min(pairs.len()));
    let pieces = [older, newer].map(|part| part.chunks_exact(groups.max(1)));
    let mut pieces = pieces.into_iter().flatten();
    let mut piece = || pieces.next().unwrap_or_default().iter();
    let (a, b, c, d) = (piece(), piece(), piece(), piece());
    let (e, f, g, h) = (piece(), piece(), piece(), piece());
    let inputs = a.zip(e).zip(c.zip(g)).zip(b.zip(f).zip(d.zip(h)));
    let (work, _) = work.as_chunks_mut::<8>();
    let reversed = Reversed::of(groups, 8);
    for ((((a, e), (c, g)), ((b, f), (d, h))), place) in inputs.zip(reversed.places()) {
        if let Some(work) = work.get_mut(place) {
            let z = |pair: &[L; 2]| Complex::new(pair[0], pair[1]);
            *work = eight([z(a), z(b), z(c), z(d), z(e), z(f), z(g), z(h)]);
        }
    }
}

/// The first pass, wherever the inputs lie.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn one_by_one<L: Lane>(ring: &[L], head: usize, work: &mut [Complex<L>], radix: usize) {
    let groups = work.len() / radix;
    let reversed = Reversed::of(groups, radix);
    let last = ring.len().wrapping_sub(1);
    let sample = |n: usize| ring.get((head + n) & last).copied().unwrap_or_default();
    let input = |place: usize, r: usize| {
        let n = 2 * (place + r * groups);
        Complex::new(sample(n), sample(n + 1))
    };
    if radix == 8 {
        for (work, place) in work.as_chunks_mut().0.iter_mut().zip(reversed.places()) {
            *work = eight(core::array::from_fn(|r| input(place, r)));
        }
    } else {
        for (work, place) in work.as_chunks_mut().0.iter_mut().zip(reversed.places()) {
            let [a, b, c, d] = core::array::from_fn(|r| input(place, r));
            *work = butterfly(a, b, c, d);
        }
    }
}

/// Most groups of a first pass: a power of four.
const GROUPS: usize = if (MAX_BLOCK_LENGTH / 8).trailing_zeros().is_multiple_of(2) {
    MAX_BLOCK_LENGTH / 8
} else {
    MAX_BLOCK_LENGTH / 16
};

/// The numbers of groups with the digits to base four reversed.
static REVERSED: [u16; GROUPS] = reversed(4);

/// The same to base eight, for passes of radix 8 alone.
static REVERSED_BY_EIGHTS: [u16; BY_EIGHTS / 8] = reversed(8);

/// The numbers of `N` groups, a power of `base`, with the digits to that base reversed.
const fn reversed<const N: usize>(base: usize) -> [u16; N] {
    let mut table = [0; N];
    let mut k = 1;
    while k < N {
        table[k] = (k % base * (N / base)) as u16 + table[k / base] / base as u16;
        k += 1;
    }
    table
}

/// The order of the groups of the first pass: their numbers with the digits to base four or eight reversed.
struct Reversed {
    table: &'static [u16],
    shift: u32,
}

impl Reversed {
    /// Those of a first pass of `radix`.
    fn of(groups: usize, radix: usize) -> Self {
        let table: &[_] = if groups * radix == BY_EIGHTS {
            &REVERSED_BY_EIGHTS
        } else {
            &REVERSED
        };
        Self {
            table,
            shift: (table.len() / groups.max(1)).trailing_zeros(),
        }
    }

    /// Those of all groups, one after the other.
    #[inline(always)]
    fn places(&self) -> impl Iterator<Item = usize> {
        let shift = self.shift;
        self.table
            .iter()
            .map(move |place| usize::from(*place) >> (shift % u16::BITS))
    }
}

/// The transform of four numbers.
#[inline(always)]
fn butterfly<L: Lane>(
    a: Complex<L>,
    b: Complex<L>,
    c: Complex<L>,
    d: Complex<L>,
) -> [Complex<L>; 4] {
    let (ac, bd) = (plus(a, c), plus(b, d));
    let (a_c, b_d) = (minus(a, c), turned(minus(b, d)));
    [plus(ac, bd), plus(a_c, b_d), minus(ac, bd), minus(a_c, b_d)]
}

/// The transform of eight numbers.
#[inline(always)]
fn eight<L: Lane>([a, b, c, d, e, f, g, h]: [Complex<L>; 8]) -> [Complex<L>; 8] {
    const S: f32 = core::f32::consts::FRAC_1_SQRT_2;
    let [e0, e1, e2, e3] = butterfly(a, c, e, g);
    let [o0, o1, o2, o3] = butterfly(b, d, f, h);
    let o1 = Complex::new(o1.re.plus(o1.im).times(S), o1.im.minus(o1.re).times(S));
    let o2 = turned(o2);
    let [e3_o3, e3_less_o3] = with_last(e3, o3);
    [
        plus(e0, o0),
        plus(e1, o1),
        plus(e2, o2),
        e3_o3,
        minus(e0, o0),
        minus(e1, o1),
        minus(e2, o2),
        e3_less_o3,
    ]
}

/// Sum and difference of the last line of the even numbers, and of that of the odd ones, which is turned by
/// three eighths of a circle.
#[inline(always)]
fn with_last<L: Lane>(even: Complex<L>, odd: Complex<L>) -> [Complex<L>; 2] {
    const S: f32 = core::f32::consts::FRAC_1_SQRT_2;
    // Its imaginary part is the negative one of this number.
    let (re, im) = (odd.im.minus(odd.re).times(S), odd.re.plus(odd.im).times(S));
    [
        Complex::new(even.re.plus(re), even.im.minus(im)),
        Complex::new(even.re.minus(re), even.im.plus(im)),
    ]
}

/// Combines transforms of eight lines by eights.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn combine_by_eights<L: Lane>(work: &mut [Complex<L>]) {
    let factors = TWIDDLES_OF_EIGHT.as_chunks::<8>().0;
    for parts in work.as_chunks_mut::<8>().0.as_chunks_mut::<8>().0 {
        let [a, b, c, d, e, f, g, h] = parts;
        for (k, [w, ..]) in (0..8).zip(factors) {
            let x = [a[k], b[k], c[k], d[k], e[k], f[k], g[k], h[k]];
            // The factors of the first line are one. Two ways have the compiler keep all in registers, too.
            let x = if k == 0 { x } else { turned_by(x, w) };
            [a[k], b[k], c[k], d[k], e[k], f[k], g[k], h[k]] = eight(x);
        }
    }
}

/// Combines the last eight transforms, of which no line but the first `wanted` and the last as many is
/// used.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn combine_last_eight<L: Lane>(work: &mut [Complex<L>], wanted: usize) {
    // Not told the length, the compiler keeps eight addresses, of which each is within reach of two numbers.
    let length = core::hint::black_box(BY_EIGHTS / 8).max(1);
    let mut parts = work.chunks_exact_mut(length);
    let mut part = || parts.next().unwrap_or_default();
    let (a, b, c, d) = (part(), part(), part(), part());
    let (e, f, g, h) = (part(), part(), part(), part());
    let inputs = a.iter_mut().zip(b).zip(c.iter_mut().zip(d));
    let inputs = inputs.zip(e.iter_mut().zip(f).zip(g.iter_mut().zip(h)));
    // The second eighth and the last but one begin and end with lines that are used.
    let full = wanted.saturating_sub(length);
    let ends = length.saturating_sub(2 * full);
    for (k, ((((a, b), (c, d)), ((e, f), (g, h))), w)) in inputs.zip(&TWIDDLES_OF_EIGHT).enumerate()
    {
        let x = turned_by([*a, *b, *c, *d, *e, *f, *g, *h], w);
        // One comparison for both ends.
        if k.wrapping_sub(full) < ends {
            [*a, *h] = ends_of_eight(x);
        } else {
            [*a, *b, *c, *d, *e, *f, *g, *h] = eight(x);
        }
    }
}

/// Eight numbers of which all but the first are turned by factors.
#[inline(always)]
fn turned_by<L: Lane>(
    [a, b, c, d, e, f, g, h]: [Complex<L>; 8],
    w: &[Complex32; 7],
) -> [Complex<L>; 8] {
    [
        a,
        times(b, w[0]),
        times(c, w[1]),
        times(d, w[2]),
        times(e, w[3]),
        times(f, w[4]),
        times(g, w[5]),
        times(h, w[6]),
    ]
}

/// The first and the last line of the transform of eight numbers.
#[inline(always)]
fn ends_of_eight<L: Lane>([a, b, c, d, e, f, g, h]: [Complex<L>; 8]) -> [Complex<L>; 2] {
    // As in a butterfly, and in the transform of all lines.
    let ends = |a, c, e, g| {
        let first = plus(plus(a, e), plus(c, g));
        (first, minus(minus(a, e), turned(minus(c, g))))
    };
    let ((e0, e3), (o0, o3)) = (ends(a, c, e, g), ends(b, d, f, h));
    let [_, last] = with_last(e3, o3);
    [plus(e0, o0), last]
}

/// Combines transforms of eight lines by fours: line after line, since its factors are those of all.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn combine_eights<L: Lane>(work: &mut [Complex<L>]) {
    let factors = TWIDDLES.as_chunks::<{ BUTTERFLIES / 8 }>().0;
    let (fours, _) = work.as_chunks_mut::<32>();
    for (k, w) in factors.iter().enumerate().take(8) {
        let k = k % 8;
        for four in fours.iter_mut() {
            [four[k], four[k + 8], four[k + 16], four[k + 24]] =
                twiddled([four[k], four[k + 8], four[k + 16], four[k + 24]], &w[0]);
        }
    }
}

/// Combines transforms of `N` lines by fours.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn combine<L: Lane, const N: usize>(work: &mut [Complex<L>]) {
    let step = (BUTTERFLIES / N).max(1);
    let mut rest = work;
    while let Some((a, others)) = rest.split_first_chunk_mut::<N>()
        && let Some((b, others)) = others.split_first_chunk_mut::<N>()
        && let Some((c, others)) = others.split_first_chunk_mut::<N>()
        && let Some((d, others)) = others.split_first_chunk_mut::<N>()
    {
        for (k, w) in (0..N).zip(TWIDDLES.chunks_exact(step)) {
            if let [w, ..] = w {
                [a[k], b[k], c[k], d[k]] = twiddled([a[k], b[k], c[k], d[k]], w);
            }
        }
        rest = others;
    }
}

/// Combines the last four transforms, of which no line but the first `wanted` and the last as many is
/// used.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn combine_ends<L: Lane>(work: &mut [Complex<L>], wanted: usize) {
    let length = work.len() / 4;
    let step = (BUTTERFLIES / length.max(1)).max(1);
    let mut quarters = work.chunks_exact_mut(length.max(1));
    let mut quarter = || quarters.next().unwrap_or_default();
    let (a, b, c, d) = (quarter(), quarter(), quarter(), quarter());
    let inputs = a.iter_mut().zip(b).zip(c.iter().zip(d));
    for (k, (((a, b), (c, d)), w)) in inputs.zip(TWIDDLES.chunks_exact(step)).enumerate() {
        let [w, ..] = w else {
            return;
        };
        let (is_first, is_last) = (k < wanted, k + wanted >= length);
        if !is_first && !is_last {
            continue;
        }
        let (b1, c1, d1) = (times(*b, w[0]), times(*c, w[1]), times(*d, w[2]));
        let (ac, a_c) = (plus(*a, c1), minus(*a, c1));
        // As in a butterfly.
        if is_first {
            *a = plus(ac, plus(b1, d1));
        }
        if is_last {
            *d = minus(a_c, turned(minus(b1, d1)));
        }
    }
}

/// Combines the last four transforms of 32 pairs, and makes the lines of the block of them, from 1 to 65: each in its
/// place, twice as large. The bits are those of lines made afterwards.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn combine_to_lines<L: Lane>(work: &mut [Complex<L>]) {
    const QUARTER: usize = LINES_AT_ONCE / 4;
    let factors_of_fours = TWIDDLES.as_chunks::<{ BUTTERFLIES / QUARTER }>().0;
    let ([work], [factors, ..], [factors_of_fours]) = (
        work.as_chunks_mut::<LINES_AT_ONCE>().0,
        factors_of_lines(LINES_AT_ONCE)
            .as_chunks::<{ 2 * QUARTER + 2 }>()
            .0,
        factors_of_fours.as_chunks::<QUARTER>().0,
    ) else {
        return;
    };
    let four = |work: &[Complex<L>; LINES_AT_ONCE], k: usize, w: &[Complex32; 3]| {
        let k = k % QUARTER;
        let a = work[k];
        let (b, c, d) = (
            work[QUARTER + k],
            work[2 * QUARTER + k],
            work[3 * QUARTER + k],
        );
        twiddled([a, b, c, d], w)
    };
    // Of the pairs k, 32 + k, 64 + k and 96 + k, and of the same with 32 - k in place of k, whose factors are those
    // of k in the mirror.
    let [_, a, b, c] = four(work, 0, &factors_of_fours[0][0]);
    work[QUARTER] = line(a, c, factors[QUARTER]);
    work[2 * QUARTER] = line(b, b, factors[2 * QUARTER]);
    for k in 1..QUARTER / 2 {
        let l = QUARTER - k;
        let [w @ [u, v, x], ..] = &factors_of_fours[k];
        let mirrored = [
            Complex32::new(-u.im, -u.re),
            Complex32::new(-v.re, v.im),
            Complex32::new(x.im, x.re),
        ];
        let [a, b, c, d] = four(work, k, w);
        let [e, f, g, h] = four(work, l, &mirrored);
        let (near, far) = (factors[k], factors[QUARTER + k]);
        work[k] = line(a, h, near);
        work[QUARTER + l] = line(f, c, Complex32::new(-near.im, -near.re));
        work[QUARTER + k] = line(b, g, far);
        work[l] = line(e, d, Complex32::new(-far.im, -far.re));
        if k == 1 {
            work[2 * QUARTER + 1] = line(c, f, factors[2 * QUARTER + 1]);
        }
    }
    let [a, b, c, d] = four(work, QUARTER / 2, &factors_of_fours[QUARTER / 2][0]);
    work[QUARTER / 2] = line(a, d, factors[QUARTER / 2]);
    work[QUARTER + QUARTER / 2] = line(b, c, factors[QUARTER + QUARTER / 2]);
}

/// Combines transforms of `length` lines by fours.
#[cfg_attr(target_os = "none", inline(never))]
#[cfg_attr(not(target_os = "none"), inline(always))]
fn combine_any<L: Lane>(work: &mut [Complex<L>], length: usize) {
    let step = (BUTTERFLIES / length.max(1)).max(1);
    for four in work.chunks_exact_mut((4 * length).max(1)) {
        let (ab, cd) = four.split_at_mut(2 * length);
        let ((a, b), (c, d)) = (ab.split_at_mut(length), cd.split_at_mut(length));
        let inputs = a.iter_mut().zip(b).zip(c.iter_mut().zip(d));
        // Chunks rather than steps, whose ends would be computed anew for each.
        for (((a, b), (c, d)), w) in inputs.zip(TWIDDLES.chunks_exact(step)) {
            if let [w, ..] = w {
                [*a, *b, *c, *d] = twiddled([*a, *b, *c, *d], w);
            }
        }
    }
}

/// The transform of four numbers of which all but the first are turned by factors before.
#[inline(always)]
fn twiddled<L: Lane>([a, b, c, d]: [Complex<L>; 4], w: &[Complex32; 3]) -> [Complex<L>; 4] {
    butterfly(a, times(b, w[0]), times(c, w[1]), times(d, w[2]))
}

/// Lines `first` and up of the block of which `z` are the transformed pairs, neither the line 0 nor
/// the last one among them, each twice as large.
#[inline(always)]
pub(super) fn lines<L: Lane>(z: &[Complex<L>], first: usize) -> impl Iterator<Item = Complex<L>> {
    L::each(
        pairs(z, first),
        #[inline(always)]
        |(([up], down), [w])| match down {
            [down, ..] => line(*up, *down, *w),
            _ => Complex::default(),
        },
    )
}

/// The same two at a time, as long as there are as many.
#[inline(always)]
pub(super) fn lines_by_twos<L: Lane>(
    z: &[Complex<L>],
    first: usize,
) -> impl Iterator<Item = [Complex<L>; 2]> {
    L::each(
        pairs(z, first),
        #[inline(always)]
        |(([a, b], down), [v, w])| match down {
            [d, c, ..] => [line(*a, *c, *v), line(*b, *d, *w)],
            _ => Default::default(),
        },
    )
}

/// Pairs of which some lines are made: the pairs k, the pairs N/2 - k in rising order, and the factors.
type Batch<'a, L, const BATCH: usize> = (
    (&'a [Complex<L>; BATCH], &'a [Complex<L>]),
    &'a [Complex32; BATCH],
);

/// Those of lines `first` and up, in batches.
#[inline(always)]
fn pairs<L: Lane, const BATCH: usize>(
    z: &[Complex<L>],
    first: usize,
) -> impl Iterator<Item = Batch<'_, L, BATCH>> {
    let factors = factors_of_lines(z.len()).get(first..).unwrap_or_default();
    let up = z.get(first..).unwrap_or_default();
    // Chunks rather than a reversal, whose end would be computed anew for each.
    let down = z
        .get(..(z.len() + 1).saturating_sub(first))
        .unwrap_or_default()
        .rchunks_exact(BATCH.max(1));
    up.as_chunks().0.iter().zip(down).zip(factors.as_chunks().0)
}

/// The factors of all lines that are made of so many pairs.
#[inline(always)]
fn factors_of_lines(pairs: usize) -> &'static [Complex32] {
    // There are MAX_BLOCK_LENGTH / 2 + MAX_BLOCK_LENGTH / 4 + … before.
    let begin = MAX_BLOCK_LENGTH.saturating_sub(2 * pairs);
    HALF_CIRCLES.get(begin..begin + pairs).unwrap_or_default()
}

/// The line k of the pairs `up`, k, and `down`, N/2 - k: the transforms of the even samples and of the odd
/// ones, of which those are turned.
#[inline(always)]
fn line<L: Lane>(up: Complex<L>, down: Complex<L>, w: Complex32) -> Complex<L> {
    // Twice those transforms.
    let even = Complex::new(up.re.plus(down.re), up.im.minus(down.im));
    let odd = Complex::new(up.im.plus(down.im), down.re.minus(up.re));
    plus(even, times(odd, w))
}

#[cfg(test)]
mod tests {
    extern crate std;

    use super::*;
    use std::vec;
    use std::vec::Vec;

    /// Every line of a block that begins anywhere in its ring, against the sum as it is defined.
    #[test]
    fn lines_are_those_of_the_definition() {
        let short = [16, 32, 64, 128, 256, 512, 1024];
        let long = [2048, 8192];
        let lengths = short.into_iter().chain(long);
        for n in lengths.filter(|n| *n <= MAX_BLOCK_LENGTH) {
            let mut state = 1_u32;
            let mut noise = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                (state >> 8) as f32 / (1 << 24) as f32 - 0.5
            };
            let samples: Vec<f32> = (0..n).map(|_| noise()).collect();
            let rms = libm::sqrt(n as f64 / 12.0);
            for head in [0, n / 2, n / 4, 2, 3, n - 1] {
                let mut ring = samples.clone();
                ring.rotate_right(head);
                let mut work = vec![Complex32::new(0.0, 0.0); n / 2];
                let z = transform(&ring, head, &mut work, n / 2);
                for first in [1, n / 4, n / 2 - 1] {
                    let found: Vec<_> = (first..n / 2).map(|k| z.line(k)).collect();
                    // Of long ones some, since the sums take long.
                    for (k, found) in found.iter().enumerate().step_by(((n * n) >> 20) | 1) {
                        let k = first + k;
                        let (mut re, mut im) = (0.0, 0.0);
                        for (i, x) in samples.iter().enumerate() {
                            let phase = -2.0 * PI * (i * k % n) as f64 / n as f64;
                            re += f64::from(*x) * libm::cos(phase);
                            im += f64::from(*x) * libm::sin(phase);
                        }
                        let off =
                            (f64::from(found.re) / 2.0 - re).hypot(f64::from(found.im) / 2.0 - im);
                        // Ten passes round by 6e-8 each, independently: 1.9e-7. None of thousands
                        // of lines lies four times as far off.
                        assert!(off < 8e-7 * rms, "{n} {head} {k}: {off} {rms}");
                    }
                }
            }
        }
    }

    /// The first lines where the others are not wanted, to the last bit.
    #[test]
    fn lines_that_are_not_wanted_change_no_other() {
        let lengths = [16, 128, 256, 1024, 8192];
        for n in lengths.into_iter().filter(|n| *n <= MAX_BLOCK_LENGTH) {
            let samples: Vec<f32> = (0..n)
                .map(|i| ((i * i * 7 + i) % 101) as f32 - 50.0)
                .collect();
            let lines = |wanted: usize| -> Vec<_> {
                let mut work = vec![Complex32::new(0.0, 0.0); n / 2];
                let z = transform(&samples, 0, &mut work, wanted);
                (1..wanted).map(|k| z.line(k)).collect()
            };
            let all = lines(n / 2);
            let some = [2, n / 32 + 1, n / 16, n / 16 + 2, n / 8 - 1, n / 8];
            // Of 256 these are made in the last pass, but for the last one.
            let more = [n / 4 - 1, n / 4, n / 4 + 1, n / 4 + 2, n / 4 + 3];
            for wanted in some.into_iter().chain(more) {
                let wanted = wanted.max(2);
                assert_eq!(lines(wanted)[..], all[..wanted - 1], "{wanted} of {n}");
            }
        }
    }

    /// The lines of microfft, whose transforms were those of core before.
    #[test]
    fn lines_are_those_of_another_transform() {
        fn theirs(samples: &[f32]) -> Vec<[f32; 2]> {
            let lines: &[_] = match samples.len() {
                64 => microfft::real::rfft_64(samples.to_vec().leak().try_into().unwrap()),
                256 => microfft::real::rfft_256(samples.to_vec().leak().try_into().unwrap()),
                _ => microfft::real::rfft_1024(samples.to_vec().leak().try_into().unwrap()),
            };
            lines.iter().map(|line| [line.re, line.im]).collect()
        }
        for n in [64, 256, 1024] {
            let samples: Vec<f32> = (0..n)
                .map(|i| ((i * i * 7 + i) % 101) as f32 - 50.0)
                .collect();
            let expected = theirs(&samples);
            let mut work = vec![Complex32::new(0.0, 0.0); n / 2];
            let z = transform(&samples, 0, &mut work, n / 2);
            let rms = samples.iter().map(|x| x * x).sum::<f32>().sqrt();
            for (k, [re, im]) in expected.iter().enumerate().take(n / 2).skip(1) {
                let found = z.line(k);
                let off = (found.re / 2.0 - re).hypot(found.im / 2.0 - im);
                // Both round as above.
                assert!(off < 1.6e-6 * rms, "{k} of {n}: {off}");
            }
        }
    }

    #[test]
    fn factors_are_rounded_once() {
        for n in [8, 64, MAX_BLOCK_LENGTH] {
            for k in 0..n {
                let phase = -2.0 * PI * k as f64 / n as f64;
                let found = unit(k, n);
                let off = (f64::from(found.re) - libm::cos(phase))
                    .hypot(f64::from(found.im) - libm::sin(phase));
                // Half a unit in the last place of numbers below one, of each part.
                assert!(off < 4.3e-8, "{k} of {n}: {off}");
            }
        }
    }
}
