//! Where a path leads.
