//! Sums and products in double precision for a processor that has single precision alone.
//!
//! Numbers come as the bits of IEEE 754's binary64, and results are rounded to the nearest one, ties
//! to even: they are the same bits as on any other machine. What the compiler brings takes nearly
//! twice the instructions. Here are zeros and the numbers of a measurement: from 1e-153 to 1e153 in a
//! product, from 1e-288 to 1e307 in a sum. The rest, such as what is not finite or so small that it
//! loses digits, is `None`, and left to the compiler's own functions.
//!
//! A fraction is that of a number between one and two, in units of its last digit: 53 bits, the
//! first of which is one.

/// Sign of a number, in its upper word.
const SIGN: u32 = 1 << 31;
/// First bit of a fraction, in its upper word.
const FIRST: u32 = 1 << 20;
/// Field of the exponent of what is not finite.
const NOT_FINITE: u32 = 0x7ff;
/// Field of the exponent of numbers from one to two.
const BIAS: u32 = 1023;

#[inline(always)]
fn upper(x: u64) -> u32 {
    (x >> 32) as u32
}

#[inline(always)]
fn lower(x: u64) -> u32 {
    x as u32
}

#[inline(always)]
fn joined(upper: u32, lower: u32) -> u64 {
    u64::from(upper) << 32 | u64::from(lower)
}

/// Field of the exponent of a number, from its upper word.
#[inline(always)]
fn exponent(upper: u32) -> u32 {
    upper >> 20 & NOT_FINITE
}

/// Upper word of the fraction of a number, from its own.
#[inline(always)]
fn fraction(upper: u32) -> u32 {
    upper & (FIRST - 1) | FIRST
}

/// The number of this sign, exponent and fraction, to which `rest` is added, in units of 2^-32 of
/// the fraction's last digit. The last digit of the rest may stand for what is below it.
#[inline(always)]
fn rounded(sign: u32, exponent: u32, fraction: u64, rest: u32) -> u64 {
    // The first bit of the fraction adds one to the exponent, and so does a carry.
    let above = sign | exponent.wrapping_sub(1) << 20;
    let bits = joined(above, 0).wrapping_add(fraction);
    let bits = bits.wrapping_add(u64::from(rest >> 31));
    if rest == 1 << 31 { bits & !1 } else { bits }
}

/// The product of two numbers. `None` if it has to be found in another way.
#[inline(always)]
pub fn product(a: u64, b: u64) -> Option<u64> {
    /// Exponents whose sum is that of a normal number, whatever the fractions are.
    const LEAST: u32 = 512;
    const COUNT: u32 = 1020;
    let (e, f) = (exponent(upper(a)), exponent(upper(b)));
    let sign = (upper(a) ^ upper(b)) & SIGN;
    if e.wrapping_sub(LEAST) >= COUNT || f.wrapping_sub(LEAST) >= COUNT {
        let zero = a << 1 == 0 || b << 1 == 0;
        let finite = e != NOT_FINITE && f != NOT_FINITE;
        return (zero && finite).then_some(joined(sign, 0));
    }
    // Of 64 and of 53 bits: above the lower 64 there are 52 or 53 bits.
    let x = a << 11 | 1 << 63;
    let y = joined(fraction(upper(b)), lower(b));
    let product = u128::from(x) * u128::from(y);
    let (mut above, mut below) = ((product >> 64) as u64, product as u64);
    let mut exponent = e.wrapping_add(f).wrapping_sub(BIAS - 1);
    if upper(above) < FIRST {
        above = above << 1 | below >> 63;
        below <<= 1;
        exponent = exponent.wrapping_sub(1);
    }
    let rest = upper(below) | u32::from(lower(below) != 0);
    Some(rounded(sign, exponent, above, rest))
}

/// The sum of two numbers. `None` if it has to be found in another way.
#[inline(always)]
pub fn sum(a: u64, b: u64) -> Option<u64> {
    /// A difference that loses all digits but the last is normal still.
    const LEAST: u32 = 64;
    // The larger one first, up to the lower word.
    let (a, b) = if upper(a) << 1 < upper(b) << 1 {
        (b, a)
    } else {
        (a, b)
    };
    let (sign, e, f) = (upper(a) & SIGN, exponent(upper(a)), exponent(upper(b)));
    // A sum may have the next exponent, too.
    if e.wrapping_sub(LEAST) >= NOT_FINITE - 1 - LEAST || f == 0 {
        if b << 1 != 0 || e == NOT_FINITE {
            return None;
        }
        if a << 1 == 0 {
            // Two zeros are negative if both are.
            return Some(a & b);
        }
        return (e != 0).then_some(a);
    }
    let (high, low) = (fraction(upper(b)), lower(b));
    // The smaller one in units of the larger one's last digit, and what is below that.
    let shift = e.wrapping_sub(f);
    let (y, rest) = if shift < 32 {
        let left = 31 - shift;
        let y = joined(high >> shift, low >> shift | high << 1 << left);
        (y, low << 1 << left)
    } else if shift < 55 {
        let (shift, left) = (shift - 32, 63 - shift);
        let lost = u32::from(low << 1 << left != 0);
        let rest = low >> shift | high << 1 << left | lost;
        (joined(0, high >> shift), rest)
    } else {
        // It is less than a quarter of that digit.
        return Some(a);
    };
    let x = joined(fraction(upper(a)), lower(a));
    if upper(a ^ b) & SIGN == 0 {
        let sum = x.wrapping_add(y);
        if upper(sum) < 2 * FIRST {
            return Some(rounded(sign, e, sum, rest));
        }
        let rest = lower(sum) << 31 | rest >> 1 | rest & 1;
        return Some(rounded(sign, e.wrapping_add(1), sum >> 1, rest));
    }
    let (x, y) = (u128::from(x) << 32, u128::from(y) << 32 | u128::from(rest));
    let difference = x.wrapping_sub(y);
    let (left, rest) = ((difference >> 32) as u64, difference as u32);
    if upper(left).wrapping_sub(FIRST) < FIRST {
        return Some(rounded(sign, e, left, rest));
    }
    // The first digit is lost. Where more are, the numbers are so much alike that no more than one is
    // below the last.
    let (sign, left) = if left >> 63 == 1 {
        (sign ^ SIGN, left.wrapping_neg())
    } else {
        (sign, left)
    };
    let (left, rest) = (left << 1 | u64::from(rest >> 31), rest << 1);
    if upper(left) >= FIRST {
        return Some(rounded(sign, e.wrapping_sub(1), left, rest));
    }
    if left == 0 {
        return Some(0);
    }
    let lost = left.leading_zeros().wrapping_sub(11) & 63;
    Some(rounded(sign, e.wrapping_sub(1 + lost), left << lost, 0))
}

/// `true` for equal numbers.
#[inline(always)]
pub fn equal(a: u64, b: u64) -> bool {
    if a == b {
        // What is no number equals nothing, not even itself.
        return a << 1 <= u64::from(NOT_FINITE) << 53;
    }
    (a | b) << 1 == 0
}
