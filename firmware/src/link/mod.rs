//! The link to the host: two byte queues between a port's interrupt and the frames.
//!
//! [`PortEnds`] are for the port's interrupt, which moves bytes and looks into none of them, but
//! for the zeros that end frames. [`Rx`] and [`Tx`] are for the task that serves
//! requests.
//!
//! | queue | bytes | reason |
//! | --- | --- | --- |
//! | from the host | 3 KiB | room for [`WINDOW`] requests of any length: a host that keeps to this window loses none, however long the box is busy |
//! | to the host | 4 KiB | the longest reply has room while the one before it is being sent |
//!
//! A reply is never dropped: no request is taken before [`Tx::has_room`] for its reply, and
//! while a request waits, events leave that room free. An event without room is dropped, and
//! leaves a gap in the frames' numbers.

pub mod rate;

use crate::instrument::Transmit;
use crate::wire::{
    BODY_MAX, EncodeError, Event, FRAME_MAX, LinkCounters, Received, Receiver, Reply, Request,
    Sender, ToBox,
};
use core::sync::atomic::{AtomicU32, Ordering};
use heapless::spsc::{Consumer, Producer, Queue};

/// Slots of the queue from the host, one of which stays free.
const FROM_HOST: usize = WINDOW as usize * FRAME_MAX + 1;
/// Slots of the queue to the host, one of which stays free.
const TO_HOST: usize = 4096;

/// Requests of any length that the queue from the host holds.
pub const WINDOW: u8 = 3;

const _: () = assert!(FRAME_MAX < TO_HOST);

/// Memory of the link.
pub struct Queues {
    from_host: Queue<u8, FROM_HOST>,
    to_host: Queue<u8, TO_HOST>,
    body: [u8; BODY_MAX],
    overruns: AtomicU32,
}

impl Queues {
    /// Empty queues.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            from_host: Queue::new(),
            to_host: Queue::new(),
            body: [0; BODY_MAX],
            overruns: AtomicU32::new(0),
        }
    }

    /// The ends of the queues. `session` numbers the box's start; `wake` makes the port look
    /// for bytes to send.
    pub fn split(&mut self, session: u16, wake: fn()) -> (PortEnds<'_>, Rx<'_>, Tx<'_>) {
        let (from_port, received) = self.from_host.split();
        let (to_send, to_port) = self.to_host.split();
        let overruns = &self.overruns;
        let port = PortEnds {
            from_host: from_port,
            to_host: to_port,
            overruns,
        };
        let receive = Rx {
            queue: received,
            bytes: 0,
            overruns,
            receiver: Receiver::new(&mut self.body),
        };
        let transmit = Tx {
            sender: Sender::new(session),
            queue: to_send,
            wake,
            frame: [0; FRAME_MAX],
            is_reserved: false,
            dropped: 0,
        };
        (port, receive, transmit)
    }
}

impl Default for Queues {
    fn default() -> Self {
        Self::new()
    }
}

/// The port's ends of the queues.
pub struct PortEnds<'q> {
    from_host: Producer<'q, u8>,
    to_host: Consumer<'q, u8>,
    overruns: &'q AtomicU32,
}

impl PortEnds<'_> {
    /// Takes a byte that the port has received. `true` if the receiving task has to run: a frame
    /// has ended, or the queue is full.
    pub fn received(&mut self, byte: u8) -> bool {
        let is_lost = self.from_host.enqueue(byte).is_err();
        if is_lost {
            self.lost();
        }
        is_lost || byte == 0
    }

    /// Counts a byte that the port has lost; the frame around it fails its checksum.
    pub fn lost(&mut self) {
        let count = self.overruns.load(Ordering::Relaxed);
        self.overruns
            .store(count.saturating_add(1), Ordering::Relaxed);
    }

    /// The next byte to send, which stays in the queue.
    pub fn to_send(&mut self) -> Option<u8> {
        self.to_host.peek().copied()
    }

    /// Takes that byte out of the queue: the port has it.
    pub fn sent(&mut self) {
        let _ = self.to_host.dequeue();
    }
}

/// Messages from the host.
pub struct Rx<'q> {
    queue: Consumer<'q, u8>,
    /// Bytes taken out of the queue.
    bytes: u32,
    overruns: &'q AtomicU32,
    receiver: Receiver<'q, ToBox>,
}

impl Rx<'_> {
    /// Passes the next complete message to `handle`; `true` if there was one.
    pub fn take(&mut self, handle: impl FnOnce(Received<Request<'_>>)) -> bool {
        while let Some(byte) = self.queue.dequeue() {
            self.bytes = self.bytes.wrapping_add(1);
            if let Some(received) = self.receiver.next(&mut &[byte][..]) {
                handle(received);
                return true;
            }
        }
        false
    }

    /// `true` if the queue holds bytes.
    #[must_use]
    pub fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Bytes that have come, the lost ones among them; modulo 2^32.
    #[must_use]
    pub fn bytes(&self) -> u32 {
        self.bytes.wrapping_add(self.overruns())
    }

    /// Bytes lost for want of room or by the port.
    #[must_use]
    pub fn overruns(&self) -> u32 {
        self.overruns.load(Ordering::Relaxed)
    }

    /// Counters of the host's frames.
    #[must_use]
    pub fn counters(&self) -> &LinkCounters {
        self.receiver.counters()
    }
}

/// Messages to the host.
pub struct Tx<'q> {
    sender: Sender,
    queue: Producer<'q, u8>,
    wake: fn(),
    frame: [u8; FRAME_MAX],
    /// Events leave room for a reply.
    is_reserved: bool,
    dropped: u32,
}

impl Tx<'_> {
    /// `true` if a reply of any length has room.
    #[must_use]
    pub fn has_room(&self) -> bool {
        self.room() >= FRAME_MAX
    }

    /// Makes events leave room for a reply from now on, or not.
    pub const fn reserve(&mut self, is_reserved: bool) {
        self.is_reserved = is_reserved;
    }

    /// `true` if the port has taken all bytes.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.queue.len() == 0
    }

    /// Frames that were dropped.
    #[must_use]
    pub const fn dropped(&self) -> u32 {
        self.dropped
    }

    fn room(&self) -> usize {
        self.queue.capacity().saturating_sub(self.queue.len())
    }

    /// Queues the encoded frame if `spare` bytes stay free.
    fn send(&mut self, length: Result<usize, EncodeError>, spare: usize) {
        let room = self.room();
        let frame = length.ok().and_then(|length| self.frame.get(..length));
        let Some(frame) = frame.filter(|frame| frame.len().saturating_add(spare) <= room) else {
            self.dropped = self.dropped.saturating_add(1);
            return;
        };
        for &byte in frame {
            // There is room: no one else puts bytes in.
            let _ = self.queue.enqueue(byte);
        }
        (self.wake)();
    }
}

impl Transmit for Tx<'_> {
    fn reply(&mut self, request: u16, reply: &Reply<'_>) {
        let frame = self.sender.reply(request, reply, &mut self.frame);
        let length = frame.map(|frame| frame.len());
        self.send(length, 0);
    }

    fn event(&mut self, event: &Event<'_>) {
        let frame = self.sender.event(event, &mut self.frame);
        let length = frame.map(|frame| frame.len());
        self.send(length, if self.is_reserved { FRAME_MAX } else { 0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::{Fault, FaultKind, Ping, ToHost};

    const EVENT: Event<'static> = Event::Fault(Fault {
        kind: FaultKind::Converter,
        sample: 7,
        part: Some(1),
    });

    /// All bytes that wait for the port.
    fn drain(port: &mut PortEnds<'_>) -> Vec<u8> {
        let next = || {
            let byte = port.to_send();
            port.sent();
            byte
        };
        core::iter::from_fn(next).collect()
    }

    #[test]
    fn a_request_comes_out_as_it_went_in() {
        let mut queues = Queues::new();
        let (mut port, mut receive, _) = queues.split(1, || {});
        let mut frame = [0; FRAME_MAX];
        let ping = Request::Ping(Ping { stamp: 0x0100_0200 });
        let sent = Sender::new(3).request(40, &ping, &mut frame);
        let sent = sent.expect("it fits");
        let (last, others) = sent.split_last().expect("it has bytes");
        for &byte in others {
            assert_eq!(port.received(byte), byte == 0, "zeros separate frames");
        }
        assert!(!receive.take(|_| panic!("the frame has not ended")));
        assert!(port.received(*last));
        assert!(receive.take(|received| match received {
            Received::Message(_, request) => assert_eq!(request, ping),
            Received::Refused(_, refusal) => panic!("{refusal:?}"),
        }));
        assert_eq!(receive.overruns(), 0);
        assert_eq!(receive.bytes() as usize, sent.len());
    }

    #[test]
    fn bytes_without_room_are_counted_and_wake_the_receiver() {
        let mut queues = Queues::new();
        let (mut port, receive, _) = queues.split(1, || {});
        let lost = (1..FROM_HOST + 5).filter(|_| port.received(1)).count();
        assert_eq!(lost, 5);
        assert_eq!(receive.overruns(), 5);
    }

    #[test]
    fn events_leave_room_for_a_reply_while_a_request_waits() {
        let mut queues = Queues::new();
        let (mut port, _, mut transmit) = queues.split(1, || {});
        transmit.reserve(true);
        for _ in 0..TO_HOST {
            transmit.event(&EVENT);
        }
        assert!(transmit.dropped() > 0);
        assert!(transmit.has_room());
        let before = transmit.dropped();
        transmit.reply(9, &Reply::Done);
        assert_eq!(transmit.dropped(), before, "the reply is not dropped");
        transmit.reserve(false);
        for _ in 0..TO_HOST {
            transmit.event(&EVENT);
        }
        assert!(!transmit.has_room(), "without a request events may fill it");

        // The gap shows in the numbers of what comes next.
        let sent = drain(&mut port);
        assert!(transmit.is_empty());
        transmit.event(&EVENT);
        let mut body = [0; BODY_MAX];
        let mut receiver = Receiver::<ToHost>::new(&mut body);
        let all = [sent, drain(&mut port)].concat();
        let (mut frames, mut bytes) = (0, &all[..]);
        while receiver.next(&mut bytes).is_some() {
            frames += 1;
        }
        assert!(frames > 0);
        assert_eq!(receiver.counters().lost, u64::from(transmit.dropped()));
    }
}
