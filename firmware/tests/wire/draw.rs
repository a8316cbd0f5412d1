//! Messages out of arbitrary bytes: what the generator gives decides every field.
//!
//! A [`Draw`] is a deserializer, so that every field and every variant of a message is drawn without
//! a line here, those that are added later included. Their names decide what they get, and not their
//! places, so that two fields that change places have other bytes.

use massline_firmware::wire::{Count24, FaultySamples, Line, Lines, NAME_MAX, PANIC_MAX, Word};
use proptest::prelude::*;
use serde::de::value::Error;
use serde::de::{
    Deserialize, DeserializeSeed, Deserializer, EnumAccess, IntoDeserializer, SeqAccess,
    VariantAccess, Visitor,
};

/// Longest list of readings: 12 channels, 20 samples.
const READINGS: usize = 240;
/// Sensors and channels of the largest set-up.
const SENSORS: usize = 64;
/// Variants that take more bytes than the last one of their type.
const LARGEST: [&str; 5] = ["Readings", "Given", "Iterative", "Range", "Register"];

/// Material that messages are made of.
#[derive(Clone, Debug)]
pub struct Material {
    /// Numbers and choices.
    entropy: Vec<u8>,
    /// Texts are its beginnings.
    text: String,
    /// Lists are its beginnings.
    list: Vec<u8>,
    /// Every number at its largest, every option given, every list full.
    full: bool,
}

impl Material {
    /// Made of the given bytes.
    pub fn new(entropy: Vec<u8>, text: String) -> Self {
        let mut words = entropy.iter().cycle().enumerate();
        let mut word = |_| {
            let mut w = 0_u64;
            for _ in 0..8 {
                if let Some((i, b)) = words.next() {
                    w = (w ^ u64::from(*b) ^ i as u64).wrapping_mul(0x0000_0100_0000_01B3);
                }
            }
            (w ^ (w >> 29)).to_le_bytes()
        };
        Self {
            list: (0..READINGS).flat_map(&mut word).collect(),
            entropy,
            text,
            full: false,
        }
    }

    /// The largest message of every kind.
    pub fn largest() -> Self {
        Self {
            full: true,
            ..Self::new(vec![0xFF; 64], "é".repeat(300))
        }
    }

    /// Starts to draw.
    pub fn draw(&self) -> Draw<'_> {
        Draw {
            material: self,
            at: 0,
            place: ("", ""),
            is_faulty: false,
        }
    }
}

/// Arbitrary material.
pub fn material() -> impl Strategy<Value = Material> {
    let entropy = proptest::collection::vec(any::<u8>(), 0..600);
    (entropy, ".{0,40}").prop_map(|(entropy, text)| Material::new(entropy, text))
}

/// Takes one thing after the other out of some material, again and again; zeros if there is none.
pub struct Draw<'a> {
    material: &'a Material,
    at: usize,
    /// The type and its field or variant that is drawn: they bound texts and lists.
    place: (&'static str, &'static str),
    /// `true` within faulty samples, of which fewer fit.
    is_faulty: bool,
}

impl<'a> Draw<'a> {
    /// A value of any type.
    pub fn any<T: Deserialize<'a>>(&mut self) -> T {
        T::deserialize(self).expect("everything can be drawn")
    }

    fn byte(&mut self) -> u8 {
        let entropy = &self.material.entropy;
        let at = self.at.checked_rem(entropy.len());
        self.at = self.at.wrapping_add(1);
        at.map_or(0, |at| entropy[at])
    }

    /// Any number, but the ends of the range more often than chance has it.
    fn number(&mut self) -> u64 {
        if self.material.full {
            return u64::MAX;
        }
        match self.byte() {
            0..=19 => 0,
            20..=39 => u64::MAX,
            40..=99 => u64::from(self.byte()),
            _ => u64::from_le_bytes([0; 8].map(|_: u8| self.byte())),
        }
    }

    fn length(&mut self, most: usize) -> usize {
        if self.material.full {
            most
        } else {
            usize::from(self.number() as u16) % (most + 1)
        }
    }

    fn text(&mut self) -> &'a str {
        let text = &self.material.text;
        let most = match self.place {
            (_, "panic") => PANIC_MAX,
            _ => NAME_MAX,
        };
        let mut end = self.length(most).min(text.len());
        while !text.is_char_boundary(end) {
            end -= 1;
        }
        &text[..end]
    }

    /// A list of whole values.
    fn list(&mut self) -> &'a [u8] {
        let readings = match self.is_faulty {
            true => FaultySamples::FIT / 4,
            false => READINGS,
        };
        let (size, most) = match self.place {
            ("Values", "Counts24") => (Count24::SIZE, readings),
            ("Values", _) => (f32::SIZE, readings),
            ("Weights" | "Peaks", _) => (f64::SIZE, SENSORS),
            ("Levels", _) => (f32::SIZE, SENSORS),
            ("Lines", _) => (Line::SIZE, Lines::FIT),
            ("ChannelHealth" | "FaultySamples", _) => (u16::SIZE, SENSORS),
            ("Run", "channels") => (1, SENSORS),
            other => panic!("no list is known in {other:?}"),
        };
        &self.material.list[..size * self.length(most)]
    }
}

macro_rules! numbers {
    ($($method:ident $visit:ident $type:ty),* $(,)?) => {$(
        fn $method<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
            visitor.$visit(self.number() as $type)
        }
    )*};
}

impl<'a> Deserializer<'a> for &mut Draw<'a> {
    type Error = Error;

    numbers! {
        deserialize_u8 visit_u8 u8,
        deserialize_u16 visit_u16 u16,
        deserialize_u32 visit_u32 u32,
        deserialize_i32 visit_i32 i32,
    }

    fn deserialize_u64<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
        let number = self.number();
        visitor.visit_u64(match self.place {
            // Counts of the chip's own width.
            ("LineGrid" | "MasslineError", _) => number & u64::from(u32::MAX),
            _ => number,
        })
    }

    fn deserialize_bool<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_bool(self.number() & 1 == 1)
    }

    /// Any bits.
    fn deserialize_f32<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_f32(f32::from_bits(self.number() as u32))
    }

    /// Any bits.
    fn deserialize_f64<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_f64(f64::from_bits(self.number()))
    }

    fn deserialize_option<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
        match self.number() & 1 {
            1 => visitor.visit_some(self),
            _ => visitor.visit_none(),
        }
    }

    fn deserialize_str<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_borrowed_str(self.text())
    }

    fn deserialize_bytes<V: Visitor<'a>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_borrowed_bytes(self.list())
    }

    fn deserialize_newtype_struct<V: Visitor<'a>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(self)
    }

    fn deserialize_tuple<V: Visitor<'a>>(
        self,
        count: usize,
        visitor: V,
    ) -> Result<V::Value, Error> {
        visitor.visit_seq(Parts {
            begin: None,
            places: vec![self.place; count].into_iter(),
            draw: self,
        })
    }

    fn deserialize_struct<V: Visitor<'a>>(
        self,
        name: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        self.is_faulty = name == "FaultySamples" || self.is_faulty;
        visitor.visit_seq(Parts {
            begin: Some(self.at),
            places: fields.iter().map(|field| (name, *field)),
            draw: self,
        })
    }

    fn deserialize_enum<V: Visitor<'a>>(
        self,
        name: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let largest = variants.iter().position(|name| LARGEST.contains(name));
        let mut by_name: Vec<usize> = (0..variants.len()).collect();
        by_name.sort_by_key(|&index| variants[index]);
        let index = match self.material.full {
            true => largest.unwrap_or(variants.len() - 1),
            false => by_name[usize::from(self.byte()) % variants.len()],
        };
        self.place = (name, variants[index]);
        visitor.visit_enum(Chosen { draw: self, index })
    }

    fn deserialize_any<V: Visitor<'a>>(self, _: V) -> Result<V::Value, Error> {
        panic!("no message has had anything like {:?}", self.place)
    }

    serde::forward_to_deserialize_any! {
        <V: Visitor<'a>>
        i8 i16 i64 char string byte_buf unit unit_struct seq tuple_struct map identifier ignored_any
    }
}

/// Parts of a value, each with its place.
struct Parts<'d, 'a, P> {
    draw: &'d mut Draw<'a>,
    /// Begin of the material of a type with fields.
    begin: Option<usize>,
    places: P,
}

impl<'a, P: Iterator<Item = (&'static str, &'static str)>> SeqAccess<'a> for Parts<'_, 'a, P> {
    type Error = Error;

    fn next_element_seed<T: DeserializeSeed<'a>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Error> {
        let Some(place) = self.places.next() else {
            return Ok(None);
        };
        self.draw.place = place;
        if let Some(begin) = self.begin {
            let hash = |hash: usize, byte: u8| hash.wrapping_mul(31).wrapping_add(byte.into());
            self.draw.at = place.1.bytes().fold(begin, hash);
        }
        seed.deserialize(&mut *self.draw).map(Some)
    }
}

/// A variant and what it holds.
struct Chosen<'d, 'a> {
    draw: &'d mut Draw<'a>,
    index: usize,
}

impl<'a> EnumAccess<'a> for Chosen<'_, 'a> {
    type Error = Error;
    type Variant = Self;

    fn variant_seed<T: DeserializeSeed<'a>>(self, seed: T) -> Result<(T::Value, Self), Error> {
        let index = self.index as u32;
        Ok((seed.deserialize(index.into_deserializer())?, self))
    }
}

impl<'a> VariantAccess<'a> for Chosen<'_, 'a> {
    type Error = Error;

    fn unit_variant(self) -> Result<(), Error> {
        Ok(())
    }

    fn newtype_variant_seed<T: DeserializeSeed<'a>>(self, seed: T) -> Result<T::Value, Error> {
        seed.deserialize(self.draw)
    }

    fn tuple_variant<V: Visitor<'a>>(self, count: usize, visitor: V) -> Result<V::Value, Error> {
        self.draw.deserialize_tuple(count, visitor)
    }

    fn struct_variant<V: Visitor<'a>>(
        self,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        let name = self.draw.place.1;
        self.draw.deserialize_struct(name, fields, visitor)
    }
}
