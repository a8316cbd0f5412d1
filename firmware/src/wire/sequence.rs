//! Sequence numbers: new frames, repeated frames, and the exact number of lost ones.
//!
//! A sender numbers every frame that it *produces*, even if the frame never reaches the link,
//! and tags it with the number of its session, which is one run of its program. So the receiver
//! of a later frame knows exactly how many frames it did not get, and notices a restart of its
//! peer by the first frame that arrives, even if the frames before it are lost.

/// Half of the sequence numbers. A frame that is less than this ahead is new, any other is old.
const HALF: u32 = 1 << 31;

/// Relation of a frame to those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// The frame was not seen before and is not overtaken.
    New {
        /// Number of frames lost between the last accepted one and this one.
        lost: u32,
        /// The sender has restarted since the last frame.
        restarted: bool,
    },
    /// The frame was accepted before.
    Duplicate,
    /// The frame was overtaken by a later one and counted as lost, or its session has ended.
    OutOfOrder,
}

#[derive(Clone, Copy, Debug)]
struct Session {
    number: u16,
    previous: Option<u16>,
    /// Sequence number of the next frame if none is lost.
    next: u32,
    /// Bit i: the frame numbered `next - 1 - i` was accepted.
    accepted: u64,
}

/// Follows the frames of one sender.
///
/// * The first frame is accepted, whatever its number. Frames that the sender produced before it
///   do not count as lost: see [`Tracker::before`].
/// * A frame ahead of the expected one is accepted; the numbers in between are lost. This is
///   exact for gaps below 2³¹ frames, and numbers may wrap around.
/// * A frame behind is refused: as a duplicate if it is among the last 64 and was accepted, else
///   as out of order.
/// * A frame of another session means that the peer restarted. Sessions number their frames from
///   zero, so all numbers before it are lost frames of the new session. Frames of the old session
///   after the last one that arrived cannot be counted.
/// * A frame of the session before the present one is out of order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tracker {
    session: Option<Session>,
    before: u32,
}

impl Tracker {
    /// Creates a tracker that has received no frame.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            session: None,
            before: 0,
        }
    }

    /// Number of frames that the sender had produced in its session before the first one that was
    /// received.
    #[must_use]
    pub const fn before(&self) -> u32 {
        self.before
    }

    /// Session of the peer; `None` before its first frame.
    #[must_use]
    pub fn session(&self) -> Option<u16> {
        self.session.map(|s| s.number)
    }

    /// Classifies frame `sequence` of `session` and remembers it.
    pub fn arrive(&mut self, session: u16, sequence: u32) -> Arrival {
        let Some(present) = &mut self.session else {
            self.session = Some(Session::begun(session, None, sequence));
            self.before = sequence;
            return Arrival::New {
                lost: 0,
                restarted: false,
            };
        };
        if session == present.number {
            return present.arrive(sequence);
        }
        if present.previous == Some(session) {
            return Arrival::OutOfOrder;
        }
        *present = Session::begun(session, Some(present.number), sequence);
        Arrival::New {
            lost: sequence,
            restarted: true,
        }
    }
}

impl Session {
    const fn begun(number: u16, previous: Option<u16>, sequence: u32) -> Self {
        Self {
            number,
            previous,
            next: sequence.wrapping_add(1),
            accepted: 1,
        }
    }

    fn arrive(&mut self, sequence: u32) -> Arrival {
        let lost = sequence.wrapping_sub(self.next);
        if lost < HALF {
            self.next = sequence.wrapping_add(1);
            // A shift by all of the bits or more forgets them all.
            let older = self.accepted.checked_shl(lost.saturating_add(1));
            self.accepted = older.unwrap_or(0) | 1;
            return Arrival::New {
                lost,
                restarted: false,
            };
        }
        // Zero for the newest frame.
        let age = self.next.wrapping_sub(1).wrapping_sub(sequence);
        if self.accepted.checked_shr(age).unwrap_or(0) & 1 == 1 {
            Arrival::Duplicate
        } else {
            Arrival::OutOfOrder
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn new(lost: u32) -> Arrival {
        Arrival::New {
            lost,
            restarted: false,
        }
    }

    #[test]
    fn a_receiver_that_joins_late_has_lost_nothing() {
        let mut t = Tracker::new();
        assert_eq!(t.arrive(7, 5000), new(0));
        assert_eq!((t.before(), t.session()), (5000, Some(7)));
        assert_eq!(t.arrive(7, 5001), new(0));
    }

    #[test]
    fn gaps_are_exact_up_to_half_of_the_numbers_and_across_the_wrap() {
        for start in [0, 1, HALF - 1, HALF, u32::MAX - 1, u32::MAX] {
            for gap in [0, 1, 2, 63, 64, 65, 1000, HALF - 2, HALF - 1] {
                let mut t = Tracker::new();
                t.arrive(1, start);
                let sequence = start.wrapping_add(1).wrapping_add(gap);
                assert_eq!(t.arrive(1, sequence), new(gap), "{gap} after {start}");
                assert_eq!(t.arrive(1, sequence), Arrival::Duplicate);
            }
            let mut t = Tracker::new();
            t.arrive(1, start);
            let beyond = start.wrapping_add(1).wrapping_add(HALF);
            assert_eq!(t.arrive(1, beyond), Arrival::OutOfOrder);
        }
    }

    #[test]
    fn an_old_frame_is_a_duplicate_only_if_it_was_accepted() {
        let mut t = Tracker::new();
        for sequence in [0, 1, 3, 6] {
            t.arrive(1, sequence);
        }
        let seen = [true, true, false, true, false, false, true];
        for (sequence, seen) in seen.into_iter().enumerate() {
            let expected = if seen {
                Arrival::Duplicate
            } else {
                Arrival::OutOfOrder
            };
            assert_eq!(t.arrive(1, sequence as u32), expected, "{sequence}");
        }
        // 64 frames on, the oldest are no longer remembered.
        t.arrive(1, 66);
        assert_eq!(t.arrive(1, 3), Arrival::Duplicate);
        t.arrive(1, 67);
        assert_eq!(t.arrive(1, 3), Arrival::OutOfOrder);
    }

    #[test]
    fn a_restart_counts_what_the_new_session_lost() {
        let mut t = Tracker::new();
        t.arrive(1, 900);
        let restart = Arrival::New {
            lost: 3,
            restarted: true,
        };
        assert_eq!(t.arrive(2, 3), restart);
        assert_eq!(
            t.arrive(1, 901),
            Arrival::OutOfOrder,
            "its session has ended"
        );
        assert_eq!(t.arrive(2, 4), new(0));
        assert_eq!(t.before(), 900, "of the first session only");
    }
}
