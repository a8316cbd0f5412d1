//! Bytes as a list of steps, so that a mutation changes one of them and leaves the others.
//!
//! A step is its number, two bytes of length, and so many bytes. Missing bytes are zero, so that
//! any bytes are a script.

/// Reads numbers from the beginning of bytes; zeros behind their end.
#[derive(Clone, Copy, Debug)]
pub struct Bytes<'a>(pub &'a [u8]);

impl<'a> Bytes<'a> {
    /// The next `N` bytes.
    pub fn array<const N: usize>(&mut self) -> [u8; N] {
        let mut all = [0; N];
        let taken = self.slice(N);
        all[..taken.len()].copy_from_slice(taken);
        all
    }

    /// At most so many bytes.
    pub fn slice(&mut self, most: usize) -> &'a [u8] {
        let (taken, rest) = self.0.split_at(most.min(self.0.len()));
        self.0 = rest;
        taken
    }

    /// A byte.
    pub fn u8(&mut self) -> u8 {
        u8::from_le_bytes(self.array())
    }

    /// Two bytes.
    pub fn u16(&mut self) -> u16 {
        u16::from_le_bytes(self.array())
    }

    /// Four bytes.
    pub fn u32(&mut self) -> u32 {
        u32::from_le_bytes(self.array())
    }

    /// Eight bytes.
    pub fn u64(&mut self) -> u64 {
        u64::from_le_bytes(self.array())
    }

    /// `true` if no bytes are left.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

/// The steps of a script, each with its number and its bytes.
pub fn steps(script: &[u8]) -> impl Iterator<Item = (u8, Bytes<'_>)> {
    let mut rest = Bytes(script);
    std::iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let number = rest.u8();
        let length = rest.u16();
        Some((number, Bytes(rest.slice(length.into()))))
    })
}

/// Appends a step.
pub fn push(script: &mut Vec<u8>, number: u8, bytes: &[u8]) {
    let length = u16::try_from(bytes.len()).unwrap_or(u16::MAX);
    script.push(number);
    script.extend(length.to_le_bytes());
    script.extend(&bytes[..usize::from(length)]);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_come_back_and_what_is_missing_is_zero() {
        let mut script = Vec::new();
        push(&mut script, 7, &[1, 2, 3]);
        push(&mut script, 9, &[]);
        script.extend([1, 200, 0, 5]);
        let all: Vec<_> = steps(&script).map(|(n, bytes)| (n, bytes.0)).collect();
        assert_eq!(all, [(7, &[1_u8, 2, 3][..]), (9, &[]), (1, &[5])]);
        let mut bytes = Bytes(&[1]);
        assert_eq!((bytes.u32(), bytes.u64()), (1, 0));
    }
}
