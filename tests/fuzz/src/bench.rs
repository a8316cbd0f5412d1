//! A test bench: the instrument on the model of a board, whose clock and converters are controlled
//! by a script.

use crate::link::{self, Piece};
use massline_firmware::instrument::{
    Identity, Instrument, Memory, Persistent, RunStorage, Transmit, WorkingStorage,
};
use massline_firmware::model_board::{IDENTITY, ModelBoard};
use massline_firmware::settings::Settings;
use massline_firmware::wire::{
    BODY_MAX, Event, FRAME_MAX, FromBox, Received, Receiver, Reply, Request, Sender, ToHost,
};

/// A message from the box.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Number of its type on the wire.
    pub number: u8,
    /// Id of the request that it answers; zero for events.
    pub id: u16,
    /// Payload of the message.
    pub payload: Vec<u8>,
}

impl Sent {
    /// Decodes the message as a reply.
    ///
    /// # Panics
    /// If it is no reply.
    pub fn read(&self, see: impl FnOnce(&Reply<'_>)) {
        let wire = link::frame(&link::header(self.number, 1, 0, self.id), &self.payload);
        let mut buffer = [0; BODY_MAX];
        let mut receiver = Receiver::<ToHost>::new(&mut buffer);
        match receiver.next(&mut &wire[..]) {
            Some(Received::Message(_, FromBox::Reply(reply))) => see(&reply),
            other => panic!("{self:?} is no reply: {other:?}"),
        }
    }
}

/// Messages from the box, each of which was encoded as a frame and decoded again.
#[derive(Debug, Default)]
pub struct Out {
    /// Messages in order.
    pub sent: Vec<Sent>,
}

impl Out {
    fn keep(&mut self, frame: &[u8]) {
        let Piece::Sound(header, payload) = link::classify(&frame[1..frame.len() - 1]) else {
            panic!("this is no frame: {frame:?}");
        };
        self.sent.push(Sent {
            number: header[1],
            id: u16::from_le_bytes([header[8], header[9]]),
            payload,
        });
    }
}

impl Transmit for Out {
    fn reply(&mut self, id: u16, reply: &Reply<'_>) {
        let mut out = [0; FRAME_MAX];
        match Sender::new(1).reply(id, reply, &mut out) {
            Ok(frame) => self.keep(frame),
            Err(error) => panic!("{error}: {reply:?}"),
        }
    }

    fn event(&mut self, event: &Event<'_>) {
        let mut out = [0; FRAME_MAX];
        match Sender::new(1).event(event, &mut out) {
            Ok(frame) => self.keep(frame),
            Err(error) => panic!("{error}: {event:?}"),
        }
    }
}

/// Memory for an instrument.
#[derive(Debug, Default)]
pub struct Shelf {
    working: Box<WorkingStorage>,
    runs: Box<RunStorage>,
    persistent: Box<Persistent>,
}

/// The box on the test bench.
#[derive(Debug)]
pub struct Bench<'m> {
    /// The instrument.
    pub instrument: Instrument<'m>,
    /// The board of the instrument.
    pub hardware: ModelBoard,
    /// The messages that it sends.
    pub out: Out,
}

impl<'m> Bench<'m> {
    /// A box that has just been switched on, as delivered.
    #[must_use]
    pub fn new(shelf: &'m mut Shelf) -> Self {
        let memory = Memory {
            working: &mut shelf.working,
            runs: &mut shelf.runs,
            persistent: &mut shelf.persistent,
        };
        // A few requests of samples at a time, so that a client comes to wait.
        let identity = Identity {
            window: 3,
            ..IDENTITY
        };
        Self {
            instrument: Instrument::new(memory, identity),
            hardware: ModelBoard::new(Settings::DELIVERED),
            out: Out::default(),
        }
    }

    /// Sends a request.
    pub fn send(&mut self, id: u16, request: &Request<'_>) {
        self.instrument
            .request(id, request, &mut self.hardware, &mut self.out);
    }

    /// Sends a request and removes its reply, which must come at once.
    ///
    /// # Panics
    /// If there is no reply, or more than one.
    pub fn request(&mut self, request: &Request<'_>) -> Sent {
        let before = self.out.sent.len();
        self.send(OWN_ID, request);
        let mut replies = self.out.sent.split_off(before);
        replies.retain(|sent| sent.id == OWN_ID);
        assert_eq!(replies.len(), 1, "{request:?}: {replies:?}");
        replies.remove(0)
    }

    /// One call of the box's idle task.
    pub fn poll(&mut self) -> bool {
        self.instrument.poll(&mut self.hardware, &mut self.out)
    }
}

/// Id of the bench's own requests.
pub const OWN_ID: u16 = u16::MAX;
