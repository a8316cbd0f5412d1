//! Responses with noise, from closed forms, to masslines and modes: what does not fit is
//! refused by name, and what is there comes back.

mod close_modes;
mod nothing_vanishes;
mod specimen;
