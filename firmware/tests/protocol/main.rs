//! The protocol as a whole: a model of the box's states held against the instrument by random
//! walks, and a host that means harm.

// What is borrowed from other test programs is used in part.
#[allow(dead_code)]
#[path = "../instrument/bench.rs"]
mod bench;
#[allow(dead_code)]
#[path = "../wire/draw.rs"]
mod draw;
mod frames;
mod hostile;
#[allow(dead_code)]
#[path = "../wire/messages.rs"]
mod messages;
mod model;
#[allow(dead_code)]
#[path = "../instrument/plan.rs"]
mod plan;
mod random;
#[allow(dead_code)]
#[path = "../wire/reference.rs"]
mod reference;
mod walk;
