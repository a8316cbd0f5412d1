//! Lists of numbers in a frame, without a copy on either side.
//!
//! A sender lends a slice of values. A receiver gets a view of the frame's own bytes and reads the
//! values out of it one by one. Every value has a fixed width, so the number of values that fit a
//! frame is known beforehand.

use core::marker::PhantomData;
use serde::de::{Deserialize, Deserializer, Error};
use serde::ser::{Serialize, SerializeSeq, Serializer};

/// A number of fixed width, little-endian; floating-point numbers are sent as their bits.
pub trait Word: Copy {
    /// Length of one value in bytes.
    const SIZE: usize;
    /// Array of the bytes of one value.
    type Bytes: AsRef<[u8]>;

    /// Encodes the value.
    fn to_bytes(self) -> Self::Bytes;
    /// Decodes the value in the first [`Self::SIZE`] bytes; `None` if there are fewer.
    fn from_bytes(bytes: &[u8]) -> Option<Self>;
}

macro_rules! words {
    ($($type:ty)*) => {$(
        impl Word for $type {
            const SIZE: usize = size_of::<Self>();
            type Bytes = [u8; size_of::<Self>()];

            fn to_bytes(self) -> Self::Bytes {
                self.to_le_bytes()
            }

            fn from_bytes(bytes: &[u8]) -> Option<Self> {
                bytes.first_chunk().map(|b| Self::from_le_bytes(*b))
            }
        }
    )*};
}

words!(u16 i32 f32 f64);

/// A converter's count of 24 bits, sent as three bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct Count24(i32);

impl Count24 {
    /// The lowest count.
    pub const MIN: Self = Self(-(1 << 23));
    /// The highest count.
    pub const MAX: Self = Self((1 << 23) - 1);

    /// Makes a count; `None` if `count` needs more than 24 bits.
    #[must_use]
    pub const fn new(count: i32) -> Option<Self> {
        if count < Self::MIN.0 || count > Self::MAX.0 {
            None
        } else {
            Some(Self(count))
        }
    }

    /// The count of 24 bits that is nearest to `count`.
    #[must_use]
    pub const fn nearest(count: i32) -> Self {
        match Self::new(count) {
            Some(count) => count,
            None if count < 0 => Self::MIN,
            None => Self::MAX,
        }
    }

    /// The count as a number.
    #[must_use]
    pub const fn get(self) -> i32 {
        self.0
    }
}

impl Word for Count24 {
    const SIZE: usize = 3;
    type Bytes = [u8; 3];

    fn to_bytes(self) -> [u8; 3] {
        let [low, middle, high, _] = self.0.to_le_bytes();
        [low, middle, high]
    }

    fn from_bytes(bytes: &[u8]) -> Option<Self> {
        let [low, middle, high] = *bytes.first_chunk()?;
        // Shifted down again from the top, so that the sign comes along.
        Some(Self(i32::from_le_bytes([0, low, middle, high]) >> 8))
    }
}

/// A list of numbers, either lent by a sender or part of a received frame.
///
/// Two lists are equal if their bytes are, so `NaN` equals itself and `0.0` is not `-0.0`.
#[derive(Clone, Copy)]
pub struct Packed<'a, T>(Place<'a, T>);

#[derive(Clone, Copy)]
enum Place<'a, T> {
    Lent(&'a [T]),
    Frame(&'a [u8], PhantomData<T>),
}

impl<'a, T: Word> Packed<'a, T> {
    /// Makes a list to be sent.
    #[must_use]
    pub const fn new(values: &'a [T]) -> Self {
        Self(Place::Lent(values))
    }

    /// Makes a list to be sent from values that were encoded by [`Word::to_bytes`]. An incomplete
    /// last value is left out.
    #[must_use]
    pub fn of_bytes(bytes: &'a [u8]) -> Self {
        let rest = bytes.len().checked_rem(T::SIZE).unwrap_or(0);
        let whole = bytes.len().saturating_sub(rest);
        Self(Place::Frame(bytes.get(..whole).unwrap_or(&[]), PhantomData))
    }

    /// Number of values.
    #[must_use]
    pub const fn len(&self) -> usize {
        match self.0 {
            Place::Lent(values) => values.len(),
            Place::Frame(bytes, _) => match bytes.len().checked_div(T::SIZE) {
                Some(values) => values,
                None => 0,
            },
        }
    }

    /// `true` if the list has no values.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Value `i`; `None` beyond the last one.
    #[must_use]
    pub fn get(&self, i: usize) -> Option<T> {
        match self.0 {
            Place::Lent(values) => values.get(i).copied(),
            Place::Frame(bytes, _) => T::from_bytes(bytes.get(i.checked_mul(T::SIZE)?..)?),
        }
    }

    /// All values in their order.
    pub fn iter(&self) -> impl Iterator<Item = T> + use<'a, T> {
        let list = *self;
        (0..list.len()).map_while(move |i| list.get(i))
    }
}

impl<T: Word> PartialEq for Packed<'_, T> {
    fn eq(&self, other: &Self) -> bool {
        let bytes = |(a, b): (T, T)| a.to_bytes().as_ref() == b.to_bytes().as_ref();
        self.len() == other.len() && self.iter().zip(other.iter()).all(bytes)
    }
}

impl<T: Word + core::fmt::Debug> core::fmt::Debug for Packed<'_, T> {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}

impl<T: Word> Serialize for Packed<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            Place::Frame(bytes, _) => serializer.serialize_bytes(bytes),
            // A byte string and a sequence of bytes are the same on the wire: their
            // length, then the bytes.
            Place::Lent(values) => {
                let length = values.len().saturating_mul(T::SIZE);
                let mut bytes = serializer.serialize_seq(Some(length))?;
                for value in values {
                    for byte in value.to_bytes().as_ref() {
                        bytes.serialize_element(byte)?;
                    }
                }
                bytes.end()
            }
        }
    }
}

impl<'de: 'a, 'a, T: Word> Deserialize<'de> for Packed<'a, T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let bytes = <&'de [u8]>::deserialize(deserializer)?;
        if bytes.len() % T::SIZE == 0 {
            Ok(Self(Place::Frame(bytes, PhantomData)))
        } else {
            Err(D::Error::custom("a list that ends within a value"))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_of_24_bits_keep_their_sign() {
        for count in [
            0, 1, -1, 0x7F, -0x80, 0x1234, -0x1234, 0x7F_FFFF, -0x80_0000,
        ] {
            let packed = Count24::new(count).unwrap();
            assert_eq!(Count24::from_bytes(&packed.to_bytes()), Some(packed));
            assert_eq!(packed.get(), count);
        }
        assert_eq!(Count24::new(1 << 23), None);
        for (count, nearest) in [(5, 5), (i32::MAX, 0x7F_FFFF), (i32::MIN, -0x80_0000)] {
            assert_eq!(Count24::nearest(count).get(), nearest);
        }
        assert_eq!(Count24::new(-(1 << 23) - 1), None);
    }

    #[test]
    fn lent_and_received_lists_are_the_same() {
        let values = [1.0_f32, -0.0, f32::NAN, f32::MIN_POSITIVE];
        let lent = Packed::new(&values);
        let mut bytes = [0; 32];
        let bytes = postcard::to_slice(&lent, &mut bytes).unwrap();
        assert_eq!((bytes.len(), bytes[0]), (17, 16));
        let received: Packed<'_, f32> = postcard::from_bytes(bytes).unwrap();
        assert_eq!(received, lent);
        assert_ne!(
            received,
            Packed::new(&[1.0, 0.0, f32::NAN, f32::MIN_POSITIVE])
        );
        assert_eq!(received.iter().count(), 4);
        assert_eq!(
            (received.get(3), received.get(4)),
            (Some(f32::MIN_POSITIVE), None)
        );
        let mut again = [0; 32];
        assert_eq!(postcard::to_slice(&received, &mut again).unwrap(), bytes);
        let whole = Packed::<'_, f32>::of_bytes(&bytes[1..]);
        assert_eq!(whole, lent);
        assert_eq!(Packed::<'_, f32>::of_bytes(&bytes[1..16]).len(), 3);
        bytes[0] = 15;
        assert!(postcard::from_bytes::<Packed<'_, f32>>(bytes).is_err());
    }
}
