//! A box in the emulator, and a host whose every message is set by a test.
//!
//! The host tool's own client recovers from errors of the link, which are the subject here.

use std::time::Duration;

use massline::device::{Emulator, firmware};
use massline_firmware::wire::{
    BODY_MAX, Event, FRAME_MAX, FromBox, Info, Received, Receiver, Reply, Request, Sender, Started,
    ToHost,
};

/// Longest time for anything in a test. The emulator needs milliseconds for most of it, but may
/// share two cores with a compiler.
pub const PATIENCE: Duration = Duration::from_secs(120);

/// A box, and the host's side of its link.
pub struct Talk {
    emulator: Emulator,
    sender: Sender,
    receiver: Receiver<'static, ToHost>,
    input: Vec<u8>,
    id: u16,
}

impl Talk {
    /// Boots the firmware.
    pub fn boot() -> Self {
        Self::boot_with(&[])
    }

    /// Boots the firmware with more arguments for QEMU, and waits for its report of the start:
    /// bytes sent to a port that is not set up yet are lost.
    pub fn boot_with(arguments: &[&str]) -> Self {
        let elf = firmware::find(None).unwrap_or_else(|error| panic!("{error}"));
        let emulator =
            Emulator::start_with(&elf, arguments).unwrap_or_else(|error| panic!("{error}"));
        // Leaked: a few of them in a process that ends.
        let body = Box::leak(Box::new([0; BODY_MAX]));
        let mut talk = Self {
            emulator,
            sender: Sender::new(1),
            receiver: Receiver::new(body),
            input: Vec::new(),
            id: 0,
        };
        talk.started();
        talk
    }

    /// Waits until the box has started.
    pub fn started(&mut self) -> Started {
        self.event(|event| match event {
            Event::Started(started) => Some(*started),
            _ => None,
        })
    }

    /// The frame of a request, and its id.
    pub fn frame(&mut self, request: &Request<'_>) -> (u16, Vec<u8>) {
        self.id = self.id % 60_000 + 1;
        let mut out = [0; FRAME_MAX];
        let frame = self.sender.request(self.id, request, &mut out);
        (self.id, frame.expect("the request fits a frame").to_vec())
    }

    /// Sends bytes unchanged.
    pub fn send(&mut self, bytes: &[u8]) {
        self.emulator
            .send(bytes)
            .unwrap_or_else(|error| panic!("{error}"));
    }

    /// Sends a request, and returns its id.
    pub fn request(&mut self, request: &Request<'_>) -> u16 {
        let (id, frame) = self.frame(request);
        self.send(&frame);
        id
    }

    /// Passes messages to `pick` until it returns a value.
    pub fn wait<T>(&mut self, mut pick: impl FnMut(u16, &FromBox<'_>) -> Option<T>) -> T {
        loop {
            let mut input = &self.input[..];
            let mut picked = None;
            while picked.is_none() {
                match self.receiver.next(&mut input) {
                    Some(Received::Message(header, message)) => {
                        picked = pick(header.request, &message);
                    }
                    Some(Received::Refused(header, refusal)) => {
                        panic!("the box sent {:#04x}: {refusal}", header.number)
                    }
                    None => break,
                }
            }
            let taken = self.input.len() - input.len();
            self.input.drain(..taken);
            if let Some(picked) = picked {
                return picked;
            }
            let came = self.emulator.receive(&mut self.input, PATIENCE);
            let came = came.unwrap_or_else(|error| panic!("{error}"));
            assert!(came > 0, "nothing came for {} s", PATIENCE.as_secs());
        }
    }

    /// Waits for the reply to a request.
    pub fn reply<T>(&mut self, id: u16, pick: impl Fn(&Reply<'_>) -> T) -> T {
        self.wait(|request, message| match message {
            FromBox::Reply(reply) if request == id => Some(pick(reply)),
            _ => None,
        })
    }

    /// Sends a request and waits for its reply.
    pub fn exchange<T>(&mut self, request: &Request<'_>, pick: impl Fn(&Reply<'_>) -> T) -> T {
        let id = self.request(request);
        self.reply(id, pick)
    }

    /// Sends a request and waits for [`Reply::Done`].
    pub fn done(&mut self, request: &Request<'_>) {
        self.exchange(request, |reply| {
            assert_eq!(*reply, Reply::Done, "{request:?}")
        });
    }

    /// Sends a hello and reads its answer.
    pub fn hello<T>(&mut self, look: impl Fn(&Info<'_>) -> T) -> T {
        self.exchange(&Request::Hello, |reply| match reply {
            Reply::Info(info) => look(info),
            other => panic!("{other:?}"),
        })
    }

    /// Waits for an event.
    pub fn event<T>(&mut self, mut pick: impl FnMut(&Event<'_>) -> Option<T>) -> T {
        self.wait(|_, message| match message {
            FromBox::Event(event) => pick(event),
            FromBox::Reply(_) => None,
        })
    }
}
