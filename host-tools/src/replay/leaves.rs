//! The leaves of a serialisable value: its numbers and words, each by its path in the value.
//!
//! Two answers of the same core are compared by these, so that no field is left out and each
//! difference has a name, such as `inertia_cg[2].std`.

use super::Leaf;
use serde::ser::{self, Serialize, Serializer};
use std::fmt;

/// The leaves of a value in their order, each with its path.
///
/// # Errors
/// The type of `value` refuses to be serialised.
pub(super) fn leaves(value: &impl Serialize) -> Result<Vec<(String, Leaf)>, fmt::Error> {
    let mut walk = Walk::default();
    value.serialize(&mut walk)?;
    Ok(walk.leaves)
}

#[derive(Default)]
struct Walk {
    path: String,
    leaves: Vec<(String, Leaf)>,
}

impl Walk {
    fn leaf(&mut self, leaf: Leaf) -> fmt::Result {
        self.leaves.push((self.path.clone(), leaf));
        Ok(())
    }

    /// Walks through a part of the present value.
    fn part(&mut self, step: &str, value: &(impl Serialize + ?Sized)) -> fmt::Result {
        let length = self.path.len();
        if length > 0 && !step.starts_with('[') {
            self.path.push('.');
        }
        self.path.push_str(step);
        value.serialize(&mut *self)?;
        self.path.truncate(length);
        Ok(())
    }
}

/// A list that the walk goes through.
struct List<'w> {
    walk: &'w mut Walk,
    next: usize,
}

impl List<'_> {
    fn item(&mut self, value: &(impl Serialize + ?Sized)) -> fmt::Result {
        let step = format!("[{}]", self.next);
        self.next += 1;
        self.walk.part(&step, value)
    }
}

/// Leaves that are not floating-point numbers.
macro_rules! text {
    ($($name:ident $type:ty;)*) => {$(
        fn $name(self, value: $type) -> fmt::Result {
            self.leaf(Leaf::Text(value.to_string()))
        }
    )*};
}

impl<'w> Serializer for &'w mut Walk {
    type Ok = ();
    type Error = fmt::Error;
    type SerializeSeq = List<'w>;
    type SerializeTuple = List<'w>;
    type SerializeTupleStruct = List<'w>;
    type SerializeTupleVariant = List<'w>;
    type SerializeMap = List<'w>;
    type SerializeStruct = Self;
    type SerializeStructVariant = Self;

    text! {
        serialize_bool bool;
        serialize_i8 i8;
        serialize_i16 i16;
        serialize_i32 i32;
        serialize_i64 i64;
        serialize_u8 u8;
        serialize_u16 u16;
        serialize_u32 u32;
        serialize_u64 u64;
        serialize_char char;
        serialize_str &str;
    }

    fn serialize_f32(self, value: f32) -> fmt::Result {
        self.leaf(Leaf::Single(value))
    }

    fn serialize_f64(self, value: f64) -> fmt::Result {
        self.leaf(Leaf::Double(value))
    }

    fn serialize_bytes(self, value: &[u8]) -> fmt::Result {
        self.leaf(Leaf::Text(format!("{value:02x?}")))
    }

    fn serialize_none(self) -> fmt::Result {
        self.leaf(Leaf::Nothing)
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> fmt::Result {
        value.serialize(self)
    }

    fn serialize_unit(self) -> fmt::Result {
        self.leaf(Leaf::Nothing)
    }

    fn serialize_unit_struct(self, _: &'static str) -> fmt::Result {
        self.leaf(Leaf::Nothing)
    }

    fn serialize_unit_variant(self, _: &'static str, _: u32, variant: &'static str) -> fmt::Result {
        self.serialize_str(variant)
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        value: &T,
    ) -> fmt::Result {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        value: &T,
    ) -> fmt::Result {
        self.part(variant, value)
    }

    fn serialize_seq(self, _: Option<usize>) -> Result<List<'w>, fmt::Error> {
        Ok(List {
            walk: self,
            next: 0,
        })
    }

    fn serialize_tuple(self, _: usize) -> Result<List<'w>, fmt::Error> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_struct(self, _: &'static str, _: usize) -> Result<List<'w>, fmt::Error> {
        self.serialize_seq(None)
    }

    fn serialize_tuple_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<List<'w>, fmt::Error> {
        self.serialize_str(variant)?;
        self.serialize_seq(None)
    }

    fn serialize_map(self, _: Option<usize>) -> Result<List<'w>, fmt::Error> {
        self.serialize_seq(None)
    }

    fn serialize_struct(self, _: &'static str, _: usize) -> Result<Self, fmt::Error> {
        Ok(self)
    }

    fn serialize_struct_variant(
        self,
        _: &'static str,
        _: u32,
        variant: &'static str,
        _: usize,
    ) -> Result<Self, fmt::Error> {
        self.serialize_str(variant)?;
        Ok(self)
    }
}

/// Lists of all kinds: their items by number.
macro_rules! lists {
    ($($kind:ident $item:ident;)*) => {$(
        impl ser::$kind for List<'_> {
            type Ok = ();
            type Error = fmt::Error;

            fn $item<T: Serialize + ?Sized>(&mut self, value: &T) -> fmt::Result {
                self.item(value)
            }

            fn end(self) -> fmt::Result {
                Ok(())
            }
        }
    )*};
}

lists! {
    SerializeSeq serialize_element;
    SerializeTuple serialize_element;
    SerializeTupleStruct serialize_field;
    SerializeTupleVariant serialize_field;
}

impl ser::SerializeMap for List<'_> {
    type Ok = ();
    type Error = fmt::Error;

    fn serialize_key<T: Serialize + ?Sized>(&mut self, key: &T) -> fmt::Result {
        self.item(key)
    }

    fn serialize_value<T: Serialize + ?Sized>(&mut self, value: &T) -> fmt::Result {
        self.item(value)
    }

    fn end(self) -> fmt::Result {
        Ok(())
    }
}

/// Structures: their fields by name.
macro_rules! structures {
    ($($kind:ident)*) => {$(
        impl ser::$kind for &mut Walk {
            type Ok = ();
            type Error = fmt::Error;

            fn serialize_field<T: Serialize + ?Sized>(
                &mut self,
                name: &'static str,
                value: &T,
            ) -> fmt::Result {
                self.part(name, value)
            }

            fn end(self) -> fmt::Result {
                Ok(())
            }
        }
    )*};
}

structures!(SerializeStruct SerializeStructVariant);

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Serialize)]
    enum Kind {
        Plain,
        Of(u8),
        With { limit: u32 },
        Pair(u8, u8),
    }

    #[derive(serde::Serialize)]
    struct Value {
        single: f32,
        list: Vec<Option<f64>>,
        kinds: [Kind; 4],
        pair: (bool, &'static str),
    }

    #[test]
    fn every_leaf_has_its_path() {
        let value = Value {
            single: -0.0,
            list: vec![Some(1.5), None],
            kinds: [
                Kind::Plain,
                Kind::Of(3),
                Kind::With { limit: 4 },
                Kind::Pair(5, 6),
            ],
            pair: (true, "x"),
        };
        let found: Vec<String> = leaves(&value)
            .unwrap()
            .into_iter()
            .map(|(path, leaf)| format!("{path}: {leaf}"))
            .collect();
        let expected = [
            "single: 0x80000000 (-0e0)",
            "list[0]: 0x3ff8000000000000 (1.5e0)",
            "list[1]: nothing",
            "kinds[0]: Plain",
            "kinds[1].Of: 3",
            "kinds[2]: With",
            "kinds[2].limit: 4",
            "kinds[3]: Pair",
            "kinds[3][0]: 5",
            "kinds[3][1]: 6",
            "pair[0]: true",
            "pair[1]: x",
        ];
        assert_eq!(found, expected);
    }
}
