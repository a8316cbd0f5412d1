//! Shapes and kinds of the elements of datasets and attributes.

use super::file::Cursor;
use crate::recording::number::{Coding, Kind};

/// Kind of an element.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Element {
    Number(Coding),
    /// A text of fixed size.
    Text,
    /// A text in a heap.
    TextElsewhere,
    /// Another kind, by name.
    Other(&'static str),
}

/// Kind of elements, with their size in bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Datatype {
    pub(super) element: Element,
    pub(super) size: usize,
}

impl Datatype {
    pub(super) fn read(mut cursor: Cursor<'_>) -> Option<Self> {
        let class = cursor.byte()? & 15;
        let bits = cursor.uint(3)?;
        let size = cursor.uint(4)? as usize;
        let big = bits & 1 != 0;
        let number = |kind: Option<Kind>, name| match kind {
            Some(kind) => Element::Number(Coding { kind, big }),
            None => Element::Other(name),
        };
        let element = match class {
            0 => {
                let whole = cursor.uint(2)? == 0 && cursor.uint(2)? == 8 * size as u64;
                let kind = match (size, bits & 8 != 0) {
                    (1, true) => Some(Kind::I8),
                    (1, false) => Some(Kind::U8),
                    (2, true) => Some(Kind::I16),
                    (2, false) => Some(Kind::U16),
                    (4, true) => Some(Kind::I32),
                    (4, false) => Some(Kind::U32),
                    (8, true) => Some(Kind::I64),
                    (8, false) => Some(Kind::U64),
                    _ => None,
                };
                number(kind.filter(|_| whole), "whole numbers of odd size")
            }
            1 => {
                // Exponent and mantissa with their places and sizes, and the exponent's bias.
                cursor.take(4)?;
                let layout = (cursor.uint(4)?, cursor.uint(4)?, bits & 0x40 != 0);
                let kind = match (size, layout) {
                    (4, (0x1700_0817, 127, false)) => Some(Kind::F32),
                    (8, (0x3400_0b34, 1023, false)) => Some(Kind::F64),
                    _ => None,
                };
                number(
                    kind,
                    "floating point other than single and double precision",
                )
            }
            3 => Element::Text,
            9 if bits & 15 == 1 => Element::TextElsewhere,
            6 => Element::Other("compounds, as complex numbers are"),
            7 => Element::Other("references, as cells are"),
            8 => Element::Other("values of an enumeration, as logical ones are"),
            9 => Element::Other("lists"),
            _ => Element::Other("elements of another kind"),
        };
        Some(Self { element, size })
    }
}

/// Numbers of elements along each dimension, and the most that they may become.
#[derive(Clone, Debug, Default)]
pub(super) struct Space {
    pub(super) shape: Vec<u64>,
    /// `None`: without a limit.
    pub(super) most: Vec<Option<u64>>,
}

impl Space {
    pub(super) fn read(mut cursor: Cursor<'_>, length: usize) -> Option<Self> {
        let version = cursor.byte()?;
        let rank = usize::from(cursor.byte()?);
        let flags = cursor.byte()?;
        let kind = cursor.byte()?;
        if version == 1 {
            cursor.take(4)?;
        } else if kind == 2 {
            // Without elements.
            let (shape, most) = (vec![0], vec![Some(0)]);
            return Some(Self { shape, most });
        }
        let mut list = || {
            (0..rank)
                .map(|_| cursor.uint(length))
                .collect::<Option<Vec<_>>>()
        };
        let shape = list()?;
        let most = if flags & 1 != 0 {
            list()?
        } else {
            shape.clone()
        };
        let unlimited = u64::MAX >> (64 - 8 * length);
        let most = most.into_iter().map(|n| (n != unlimited).then_some(n));
        let most = most.collect();
        Some(Self { shape, most })
    }

    /// Number of elements.
    pub(super) fn count(&self) -> Option<u64> {
        self.shape
            .iter()
            .try_fold(1_u64, |all, n| all.checked_mul(*n))
    }
}
