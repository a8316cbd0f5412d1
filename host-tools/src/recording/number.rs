//! Numbers of fixed size as files hold them.

/// Kind of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

/// A number of a kind, in an order of bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Coding {
    pub(super) kind: Kind,
    /// `true` if the most significant byte comes first.
    pub(super) big: bool,
}

impl Kind {
    /// Bytes of a number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

impl Coding {
    /// The number in these bytes; NaN if they are too few.
    pub(super) fn value(self, bytes: &[u8]) -> f64 {
        let size = self.kind.size();
        let Some(bytes) = bytes.get(..size) else {
            return f64::NAN;
        };
        // Least significant byte first.
        let mut raw = [0; 8];
        for (k, byte) in bytes.iter().enumerate() {
            let place = if self.big { size - 1 - k } else { k };
            if let Some(slot) = raw.get_mut(place) {
                *slot = *byte;
            }
        }
        let whole = u64::from_le_bytes(raw);
        match self.kind {
            Kind::U8 | Kind::U16 | Kind::U32 | Kind::U64 => whole as f64,
            Kind::I8 => f64::from(whole as i8),
            Kind::I16 => f64::from(whole as i16),
            Kind::I32 => f64::from(whole as i32),
            Kind::I64 => whole as i64 as f64,
            Kind::F32 => f64::from(f32::from_bits(whole as u32)),
            Kind::F64 => f64::from_bits(whole),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_both_orders() {
        let value = |kind, big, bytes: &[u8]| Coding { kind, big }.value(bytes);
        for big in [false, true] {
            let bytes = |little: &[u8]| -> Vec<u8> {
                let mut bytes = little.to_vec();
                if big {
                    bytes.reverse();
                }
                bytes
            };
            let of = |kind, little: &[u8]| value(kind, big, &bytes(little));
            assert_eq!(of(Kind::I8, &(-3_i8).to_le_bytes()), -3.0);
            assert_eq!(of(Kind::U8, &[253]), 253.0);
            assert_eq!(of(Kind::I16, &(-300_i16).to_le_bytes()), -300.0);
            assert_eq!(of(Kind::U16, &65_000_u16.to_le_bytes()), 65_000.0);
            assert_eq!(of(Kind::I32, &(-70_000_i32).to_le_bytes()), -70_000.0);
            assert_eq!(of(Kind::U32, &u32::MAX.to_le_bytes()), 4_294_967_295.0);
            assert_eq!(
                of(Kind::I64, &(-(1_i64 << 40)).to_le_bytes()),
                -1.099_511_627_776e12
            );
            assert_eq!(of(Kind::U64, &(1_u64 << 63).to_le_bytes()), 2_f64.powi(63));
            assert_eq!(of(Kind::F32, &0.1_f32.to_le_bytes()), f64::from(0.1_f32));
            assert_eq!(of(Kind::F64, &0.1_f64.to_le_bytes()), 0.1);
        }
        assert!(value(Kind::F64, false, &[0; 7]).is_nan());
    }
}
