//! The link's bit rate, and the way back from a rate at which no host is understood.
//!
//! A box listens at the rate of its settings. A rate that the adapter, the cable or the host does
//! not support would lock every host out, and no host could set another one. The bytes of such a
//! host make no frame. So the box changes to the rate that it was delivered with at the first byte
//! that comes [`PATIENCE_S`] or more after the first one that made no frame, and from there back
//! again by the same rule. One valid frame settles the rate until the next start. A box that
//! receives no bytes changes nothing, so that its rate is that of its settings when a host is
//! plugged in.

/// Seconds from the first byte that makes no frame to the change of the rate.
pub const PATIENCE_S: u32 = 60;

/// The choice between two bit rates.
#[derive(Clone, Copy, Debug)]
pub struct LinkRate {
    /// Rates in baud: the one in use, and the other one.
    rates: [u32; 2],
    /// Ticks that are [`PATIENCE_S`].
    patience: u64,
    /// Ticks at the first byte since the rate was changed last.
    heard: Option<u64>,
    /// Bytes that had come at the last look.
    bytes: u32,
    is_settled: bool,
}

impl LinkRate {
    /// Listens at `set` baud, with `delivered` baud to fall back to; `tick_hz` is the rate of
    /// all ticks.
    #[must_use]
    pub const fn new(set: u32, delivered: u32, tick_hz: u32) -> Self {
        Self {
            rates: [set, delivered],
            patience: PATIENCE_S as u64 * tick_hz as u64,
            heard: None,
            bytes: 0,
            is_settled: set == delivered,
        }
    }

    /// Takes a look at the link: ticks since the start, valid frames and bytes that have come
    /// since then. Gives the rate in baud that is to be used from now on, if it changes.
    pub fn look(&mut self, ticks: u64, frames: u32, bytes: u32) -> Option<u32> {
        self.is_settled |= frames > 0;
        if self.is_settled || bytes == self.bytes {
            return None;
        }
        self.bytes = bytes;
        let heard = *self.heard.get_or_insert(ticks);
        if ticks.saturating_sub(heard) < self.patience {
            return None;
        }
        self.heard = None;
        self.rates.swap(0, 1);
        Some(self.rates[0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: u64 = 1000;

    fn link() -> LinkRate {
        LinkRate::new(115_200, 921_600, SECOND as u32)
    }

    #[test]
    fn falls_back_a_minute_after_the_first_byte_that_made_no_frame() {
        let mut link = link();
        // Nobody is there for an hour.
        for second in 0..3600 {
            assert_eq!(link.look(second * SECOND, 0, 0), None);
        }
        let from = 3600 * SECOND;
        // A host tries at another rate, again and again.
        for second in 0..60 {
            assert_eq!(
                link.look(from + second * SECOND, 0, 1 + second as u32),
                None
            );
        }
        let at = from + u64::from(PATIENCE_S) * SECOND;
        assert_eq!(link.look(at, 0, 61), Some(921_600));
        // One valid frame, and it stays.
        assert_eq!(link.look(at + 1, 1, 90), None);
        for minute in 1..100 {
            let bytes = 90 + minute as u32;
            assert_eq!(link.look(at + minute * 60 * SECOND, 1, bytes), None);
        }
    }

    #[test]
    fn goes_to_and_fro_while_nothing_makes_a_frame() {
        let mut link = link();
        let mut rates = Vec::new();
        for second in 0..600_u64 {
            rates.extend(link.look(second * SECOND, 0, 1 + second as u32));
        }
        // The byte that changes the rate came at the old one: the next one begins the minute.
        assert_eq!(rates, [921_600, 115_200].repeat(5)[..9]);
    }

    #[test]
    fn a_byte_now_and_then_waits_for_the_next_one() {
        let mut link = link();
        // The noise of a plug, and nothing for a day.
        assert_eq!(link.look(5 * SECOND, 0, 1), None);
        assert_eq!(link.look(86_400 * SECOND, 0, 1), None);
        // The host that comes then is heard at the rate that was set.
        assert_eq!(link.look(86_400 * SECOND, 1, 60), None);
    }

    #[test]
    fn the_rate_of_the_delivery_has_none_to_fall_back_to() {
        let mut link = LinkRate::new(921_600, 921_600, SECOND as u32);
        for second in 0..600_u64 {
            assert_eq!(link.look(second * SECOND, 0, 1 + second as u32), None);
        }
    }
}
