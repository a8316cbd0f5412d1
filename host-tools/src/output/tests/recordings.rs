//! Recordings that grow.
