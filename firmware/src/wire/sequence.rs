//! Which frames are new, which were seen, and how many are missing.
//!
//! A sender numbers every frame it *produces*, whether or not the frame ever reaches the
//! link, and tags them with the number of its session: one run of its program. So the
//! receiver of a later frame knows to the frame what it did not get, and sees a restart
//! of its peer in the first frame that arrives, even if the frames before it are gone.

/// Frame numbers behind the newest one of which the tracker remembers if they came.
const REMEMBERED: u32 = u64::BITS;

/// Half of the numbers. A frame that is less than this ahead closes a gap, one that is
/// less than or as much behind is old.
const HALF: u32 = 1 << 31;

/// What a frame is to its receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrival {
    /// Not seen before and not overtaken: to be taken.
    New {
        /// Frames of the sender between the last taken one and this: lost.
        lost: u32,
        /// The sender has restarted since the last frame.
        restarted: bool,
    },
    /// Was taken already.
    Duplicate,
    /// Overtaken by a later frame and counted as lost, or of a session that has ended.
    OutOfOrder,
}

#[derive(Clone, Copy, Debug)]
struct Session {
    number: u16,
    previous: Option<u16>,
    /// Sequence number of the next frame if none is lost.
    next: u32,
    /// Bit i: the frame numbered `next - 1 - i` was taken.
    taken: u64,
}

/// Follows the frames of one sender.
///
/// * The first frame ever heard is taken, whatever its number. What the sender produced
///   before is not lost, as nobody listened: see [`Tracker::before`].
/// * A frame ahead of the expected one is taken; the numbers in between are lost. This is
///   exact for gaps below 2³¹ frames, and numbers may wrap around.
/// * A frame behind is refused: as a duplicate if it is among the last 64 and was
///   taken, else as out of order.
/// * A frame of another session means that the peer restarted. Sessions number their
///   frames from zero, so all numbers before it are lost frames of the new session. What
///   the old one produced after its last frame that arrived, nobody can know.
/// * A frame of the session before the present one is out of order.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tracker {
    session: Option<Session>,
    before: u32,
}

impl Tracker {
    /// Has heard nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self {
            session: None,
            before: 0,
        }
    }

    /// Frames the sender had produced in its session before the first one that was heard.
    #[must_use]
    pub const fn before(&self) -> u32 {
        self.before
    }

    /// The session of the peer, once heard.
    #[must_use]
    pub fn session(&self) -> Option<u16> {
        self.session.map(|s| s.number)
    }

    /// Judges the frame `sequence` of `session` and remembers it.
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
            taken: 1,
        }
    }

    fn arrive(&mut self, sequence: u32) -> Arrival {
        let lost = sequence.wrapping_sub(self.next);
        if lost < HALF {
            self.next = sequence.wrapping_add(1);
            // A shift by all of the bits or more forgets them all.
            let older = self.taken.checked_shl(lost + 1).unwrap_or(0);
            self.taken = older | 1;
            return Arrival::New {
                lost,
                restarted: false,
            };
        }
        // One for the newest frame; `lost` is at least HALF, so this does not wrap.
        let behind = self.next.wrapping_sub(sequence);
        let seen = behind <= REMEMBERED && (self.taken >> (behind - 1)) & 1 == 1;
        if seen {
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
    fn who_joins_late_has_lost_nothing() {
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
    fn an_old_frame_is_a_duplicate_only_if_it_was_taken() {
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
