//! The link: bytes between the port and two queues, frames and messages behind them.
//!
//! [`Port`] is the interrupt's half. It moves bytes and looks into none of them, but for the
//! zeros that end frames. [`Inbox`] and [`Post`] are the half of whoever attends to requests.
//!
//! | queue | bytes | why |
//! | --- | --- | --- |
//! | from the host | 3 KiB | holds [`WINDOW`] requests of any length: a host that keeps to it loses nothing, however long the box is busy |
//! | to the host | 2 KiB | the longest reply finds room while the one before it is on its way |
//!
//! A reply is never given up: no request is taken before there is [`Post::has_room`] for its
//! reply, and while one waits, events leave that room alone. Events are given up where there is
//! none, and leave a gap in the frames' numbers.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer, Queue};
use massline_firmware::instrument::Transmit;
use massline_firmware::link_rate::LinkRate;
use massline_firmware::wire::{
    BODY_MAX, EncodeError, Event, FRAME_MAX, LinkCounters, Received, Receiver, Reply, Request,
    Sender, ToBox,
};
use stm32f4xx_hal::nb;
use stm32f4xx_hal::pac::USART2;
use stm32f4xx_hal::prelude::*;
use stm32f4xx_hal::serial::{Rx, Tx};
use stm32f4xx_hal::time::Hertz;

/// Slots of the queue from the host, one of which stays free.
const FROM_HOST: usize = WINDOW as usize * FRAME_MAX + 1;
/// Slots of the queue to the host, one of which stays free.
const TO_HOST: usize = 4096;

/// Frames of any length that the queue from the host holds.
pub const WINDOW: u8 = 3;

const _: () = assert!(FRAME_MAX < TO_HOST);

/// Bytes each way that one interrupt moves at most. A real port has one or two; one that has as
/// many as it likes, as the emulator's, waits for what has a lower priority before it goes on.
const AT_ONCE: usize = 8;

/// Whether the port has more to move than one interrupt does.
static MORE: AtomicBool = AtomicBool::new(false);

/// Bytes from the host that found no room or came garbled by the port.
static OVERRUN: AtomicU32 = AtomicU32::new(0);

/// The memory of the link.
pub struct Queues {
    from_host: Queue<u8, FROM_HOST>,
    to_host: Queue<u8, TO_HOST>,
    body: [u8; BODY_MAX],
}

impl Queues {
    /// Empty queues.
    pub const fn new() -> Self {
        Self {
            from_host: Queue::new(),
            to_host: Queue::new(),
            body: [0; BODY_MAX],
        }
    }
}

/// The parts of a link over a port, in the session of this number.
pub fn open(
    rx: Rx<USART2>,
    tx: Tx<USART2>,
    session: u16,
    queues: &'static mut Queues,
) -> (Port, Inbox, Post) {
    let (from_port, to_inbox) = queues.from_host.split();
    let (from_post, to_port) = queues.to_host.split();
    let port = Port {
        rx,
        tx,
        from_host: from_port,
        to_host: to_port,
    };
    let inbox = Inbox {
        queue: to_inbox,
        bytes: 0,
        receiver: Receiver::new(&mut queues.body),
    };
    let post = Post {
        sender: Sender::new(session),
        queue: from_post,
        frame: [0; FRAME_MAX],
        is_reserved: false,
        dropped: 0,
    };
    (port, inbox, post)
}

/// The port's interrupt.
pub struct Port {
    rx: Rx<USART2>,
    tx: Tx<USART2>,
    from_host: Producer<'static, u8>,
    to_host: Consumer<'static, u8>,
}

impl Port {
    /// Listens for bytes.
    pub fn start(&mut self) {
        self.rx.listen();
    }

    /// Moves what can be moved without waiting, [`AT_ONCE`] bytes each way at the most. Whether
    /// there is something to do about it: a frame has ended, the way to the host is clear again,
    /// or there is more to move, which is left to the caller.
    ///
    /// To be called at the port's interrupt and whenever there are bytes to send. It asks the
    /// port for an interrupt as soon as that can take more.
    pub fn serve(&mut self) -> bool {
        let (ended, is_more_in) = self.receive();
        let (sent, is_more_out) = self.send();
        let is_more = is_more_in || is_more_out;
        MORE.store(is_more, Ordering::Relaxed);
        ended || sent || is_more
    }

    /// Whether a frame has ended, and whether there is more.
    fn receive(&mut self) -> (bool, bool) {
        let mut ended = false;
        for _ in 0..AT_ONCE {
            match self.rx.read() {
                Ok(byte) => {
                    ended |= byte == 0;
                    if self.from_host.enqueue(byte).is_err() {
                        count_overrun();
                        // Whoever should take bytes out has not been told of a full queue.
                        ended = true;
                    }
                }
                Err(nb::Error::WouldBlock) => {
                    self.rx.listen();
                    return (ended, false);
                }
                // The frame that the byte was in does not pass its checksum.
                Err(nb::Error::Other(_)) => count_overrun(),
            }
        }
        // It would call again at once, before anything else has its turn.
        self.rx.unlisten();
        (ended, true)
    }

    /// Whether anything was sent, and whether the port would take more.
    fn send(&mut self) -> (bool, bool) {
        for moved in 0..AT_ONCE {
            let Some(&byte) = self.to_host.peek() else {
                self.tx.unlisten();
                return (moved > 0, false);
            };
            if self.tx.write(byte).is_err() {
                self.tx.listen();
                // There will be a call when all of it is gone.
                return (false, false);
            }
            self.to_host.dequeue();
        }
        self.tx.unlisten();
        (true, true)
    }
}

/// Whether the port waits to be called again.
pub fn has_more() -> bool {
    MORE.load(Ordering::Relaxed)
}

fn count_overrun() {
    OVERRUN.store(
        OVERRUN.load(Ordering::Relaxed).saturating_add(1),
        Ordering::Relaxed,
    );
}

/// The bit rate of the port.
pub struct Rate {
    /// Which one.
    choice: LinkRate,
    /// What the port divides for it.
    clock: Hertz,
}

impl Rate {
    /// The rate that the port was set to, and what it is made of.
    pub const fn new(choice: LinkRate, clock: Hertz) -> Self {
        Self { choice, clock }
    }

    /// Changes it where nobody can be heard.
    pub fn tend(&mut self, ticks: u64, inbox: &Inbox) {
        let (frames, bytes) = (inbox.counters().frames, inbox.bytes());
        if let Some(baud) = self.choice.look(ticks, frames, bytes) {
            let clock = self.clock.raw();
            let divisor = (clock + baud / 2) / baud.max(1);
            // SAFETY: one write of a register that nothing else in the program touches after the
            // start. The HAL has set the port up for 16 clocks a bit, which both rates have.
            unsafe {
                (*USART2::ptr())
                    .brr()
                    .write(|w| w.bits(divisor as u16 as _));
            }
            defmt::warn!("no host was heard, the link is at {} baud now", baud);
        }
    }
}

/// Bytes from the host that found no room.
pub fn overrun() -> u32 {
    OVERRUN.load(Ordering::Relaxed)
}

/// Messages from the host.
pub struct Inbox {
    queue: Consumer<'static, u8>,
    /// Bytes that have been looked at.
    bytes: u32,
    receiver: Receiver<'static, ToBox>,
}

impl Inbox {
    /// Hands the next message over, if one is complete.
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

    /// Whether bytes have come that nobody has looked at.
    pub fn is_waiting(&self) -> bool {
        !self.queue.is_empty()
    }

    /// Bytes that have come, whatever became of them. Counts on from zero after 2^32.
    pub fn bytes(&self) -> u32 {
        self.bytes.wrapping_add(overrun())
    }

    /// What was seen of the host's frames.
    pub fn counters(&self) -> &LinkCounters {
        self.receiver.counters()
    }
}

/// Messages to the host.
pub struct Post {
    sender: Sender,
    queue: Producer<'static, u8>,
    frame: [u8; FRAME_MAX],
    /// Room for a reply is not for events.
    is_reserved: bool,
    dropped: u32,
}

impl Post {
    /// Whether any reply finds room.
    pub fn has_room(&self) -> bool {
        self.room() >= FRAME_MAX
    }

    /// Keeps room for a reply from now on, or no longer.
    pub const fn reserve(&mut self, is_reserved: bool) {
        self.is_reserved = is_reserved;
    }

    /// Whether nothing is on its way from here to the port.
    pub fn is_empty(&self) -> bool {
        self.queue.len() == 0
    }

    /// Frames that were given up.
    pub fn dropped(&self) -> u32 {
        self.dropped
    }

    fn room(&self) -> usize {
        self.queue.capacity() - self.queue.len()
    }

    /// Queues the frame that was written, if that leaves `spare` bytes free.
    fn send(&mut self, length: usize, spare: usize) {
        let room = self.room();
        let Some(frame) = self
            .frame
            .get(..length)
            .filter(|frame| frame.len() + spare <= room)
        else {
            self.dropped = self.dropped.saturating_add(1);
            return;
        };
        for &byte in frame {
            // There is room: this is the only end that bytes come in by.
            let _ = self.queue.enqueue(byte);
        }
        crate::board::pend_link();
    }

    fn not_written(&mut self, error: EncodeError) {
        self.dropped = self.dropped.saturating_add(1);
        defmt::error!(
            "a message did not become a frame: {}",
            defmt::Display2Format(&error)
        );
    }
}

impl Transmit for Post {
    fn reply(&mut self, request: u16, reply: &Reply<'_>) {
        match self.sender.reply(request, reply, &mut self.frame) {
            Ok(frame) => {
                let length = frame.len();
                self.send(length, 0);
            }
            Err(error) => self.not_written(error),
        }
    }

    fn event(&mut self, event: &Event<'_>) {
        match self.sender.event(event, &mut self.frame) {
            Ok(frame) => {
                let length = frame.len();
                self.send(length, if self.is_reserved { FRAME_MAX } else { 0 });
            }
            Err(error) => self.not_written(error),
        }
    }
}
