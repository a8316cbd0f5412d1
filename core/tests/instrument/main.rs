//! The box as a state machine, promise by promise.

mod sizes;
