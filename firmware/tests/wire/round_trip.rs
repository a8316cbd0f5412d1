//! Every message comes back as it went, bit by bit, and fits.

use crate::draw::{Material, material};
use crate::messages::{event, reply, request};
use massline_firmware::models::setup;
use massline_firmware::wire::*;
use proptest::prelude::*;

/// A message in either direction.
#[derive(Debug)]
#[allow(clippy::large_enum_variant, reason = "one at a time")]
pub enum Sent<'a> {
    Request(Request<'a>),
    Reply(Reply<'a>),
    Event(Event<'a>),
}

/// All messages of the protocol, made of one material.
pub fn all(material: &Material) -> impl Iterator<Item = Sent<'_>> {
    let requests = Request::TABLE.iter().map(|(n, _)| *n);
    let replies = Reply::TABLE.iter().map(|(n, _)| *n);
    let events = Event::TABLE.iter().map(|(n, _)| *n);
    requests
        .map(|n| Sent::Request(request(n, &mut material.draw())))
        .chain(replies.map(|n| Sent::Reply(reply(n, &mut material.draw()))))
        .chain(events.map(|n| Sent::Event(event(n, &mut material.draw()))))
}

impl Sent<'_> {
    /// Its number and its name.
    pub fn name(&self) -> (u8, &'static str) {
        let (number, name) = match self {
            Self::Request(m) => (m.number(), Request::name(m.number())),
            Self::Reply(m) => (m.number(), Reply::name(m.number())),
            Self::Event(m) => (m.number(), Event::name(m.number())),
        };
        (number, name.expect("a name for every number"))
    }

    /// The first frame of session 1, with request id 7 where there is one.
    pub fn frame(&self) -> Result<Vec<u8>, EncodeError> {
        let mut out = [0; FRAME_MAX];
        let mut sender = Sender::new(1);
        match self {
            Self::Request(m) => sender.request(7, m, &mut out),
            Self::Reply(m) => sender.reply(7, m, &mut out),
            Self::Event(m) => sender.event(m, &mut out),
        }
        .map(<[u8]>::to_vec)
    }

    fn check(&self) {
        let frame = self.frame().expect("it fits");
        let mut rest = &frame[..];
        let mut buffer = [0; BODY_MAX];
        // Whatever `NaN`s there are, the text and the bytes are equal if all fields are.
        let (header, text, again) = if matches!(self, Self::Request(_)) {
            let mut receiver = Receiver::<ToBox>::new(&mut buffer);
            match receiver.next(&mut rest) {
                Some(Received::Message(header, m)) => {
                    let m = Sent::Request(m);
                    (header, format!("{m:?}"), m.frame())
                }
                other => panic!("{self:?} became {other:?}"),
            }
        } else {
            let mut receiver = Receiver::<ToHost>::new(&mut buffer);
            match receiver.next(&mut rest) {
                Some(Received::Message(header, m)) => {
                    let m = match m {
                        FromBox::Reply(m) => Sent::Reply(m),
                        FromBox::Event(m) => Sent::Event(m),
                    };
                    (header, format!("{m:?}"), m.frame())
                }
                other => panic!("{self:?} became {other:?}"),
            }
        };
        assert!(rest.is_empty());
        assert_eq!(text, format!("{self:?}"));
        assert_eq!(again.as_ref(), Ok(&frame));
        let expected = Header {
            version: PROTOCOL_VERSION,
            number: self.name().0,
            session: 1,
            sequence: 0,
            request: if matches!(self, Self::Event(_)) { 0 } else { 7 },
        };
        assert_eq!(header, expected);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn every_message_comes_back(material in material()) {
        for message in all(&material) {
            message.check();
        }
    }

    #[test]
    fn frames_are_what_the_description_says(material in material()) {
        for message in all(&material) {
            let frame = message.frame().expect("it fits");
            let body = crate::reference::unstuffed(&frame[1..frame.len() - 1]).expect("whole");
            let (header, payload) = body[..body.len() - 4].split_at(HEADER);
            let header = header.try_into().expect("a header");
            prop_assert_eq!(crate::reference::frame(header, payload), frame);
        }
    }
}

#[test]
fn every_message_fits_a_frame_at_its_stated_bounds() {
    let largest = Material::largest();
    for message in all(&largest) {
        let (number, name) = message.name();
        match message.frame() {
            Ok(frame) => println!("{number:#04x} {name}: {} bytes", frame.len()),
            Err(e) => panic!("{number:#04x} {name}: {e}"),
        }
        message.check();
    }
}

#[test]
fn the_stated_number_of_samples_fits_and_one_more_does_not_always() {
    let readings = [f32::NAN; 512];
    let counts = [Count24::MIN; 512];
    let mut out = [0; FRAME_MAX];
    for channels in 1..=SENSORS_AND_DRIVE {
        let mut write = |bytes: usize, samples: usize| {
            let values = samples * usize::from(channels);
            let values = if bytes == 3 {
                Values::Counts24(Packed::new(&counts[..values]))
            } else {
                Values::Readings(Packed::new(&readings[..values]))
            };
            let samples = Samples {
                first: u64::MAX,
                channels,
                values,
            };
            Sender::new(1)
                .request(1, &Request::Samples(samples), &mut out)
                .map(<[u8]>::len)
        };
        for bytes in [3, 4] {
            let fit = Samples::fit(channels, bytes);
            assert!(fit > 0, "{channels} channels");
            assert!(write(bytes, fit).is_ok(), "{fit} of {channels} channels");
            assert_eq!(write(bytes, fit + 1), Err(EncodeError::MessageTooLong));
        }
    }
    assert_eq!((Samples::fit(0, 4), Lines::FIT), (0, 9));
}

const SENSORS_AND_DRIVE: u8 = 65;

#[test]
fn numbers_are_unique_and_tell_the_direction() {
    let tables = [
        (Request::TABLE, 0x01..0x80),
        (Reply::TABLE, 0x80..0xC0),
        (Event::TABLE, 0xC0..0x100),
    ];
    for (table, range) in tables {
        assert!(table.is_sorted_by_key(|(n, _)| *n));
        assert!(table.windows(2).all(|w| w[0].0 < w[1].0));
        assert!(table.iter().all(|(n, _)| range.contains(&i32::from(*n))));
    }
}

#[test]
fn a_list_of_samples_knows_whether_it_is_whole() {
    let readings = [0.0; 12];
    let samples = |channels, n: usize| Samples {
        first: 0,
        channels,
        values: Values::Readings(Packed::new(&readings[..n])),
    };
    assert_eq!(samples(4, 12).count(), Some(3));
    assert_eq!(samples(5, 12).count(), None);
    assert_eq!(samples(0, 12).count(), None);
    assert_eq!(samples(4, 0).count(), Some(0));
}

#[test]
fn the_role_of_a_channel_is_one_byte() {
    for code in 0..=255 {
        assert_eq!(ChannelRole::from_code(code).code(), code);
    }
    let channels = [0, 3, ChannelRole::Unused.code(), ChannelRole::Drive.code()];
    let run = Run {
        channels: &channels,
        ..setup::run(0)
    };
    assert_eq!(run.drive(), Some(3));
    assert_eq!(run.channel_roles().nth(1), Some(ChannelRole::Sensor(3)));
}
