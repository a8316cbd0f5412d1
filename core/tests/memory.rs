//! The sizes that the README states are those of the types.

use massline_core::geometry::{MAX_CHANNELS, ResultantMap};
use massline_core::identify;
use massline_core::masslines::{Masslines, Workspace};

const README: &str = include_str!("../README.md");

#[test]
fn workspaces_are_as_large_as_the_readme_says() {
    let sizes = [
        ("masslines::Workspace", size_of::<Workspace>()),
        ("identify::Workspace", size_of::<identify::Workspace>()),
    ];
    for (name, bytes) in sizes {
        let stated = format!("[`{name}`], {},{:03} bytes", bytes / 1000, bytes % 1000);
        assert!(README.contains(&stated), "not in the README: {stated}");
    }
}

#[test]
fn each_pair_of_a_set_takes_144_bytes() {
    assert_eq!(
        size_of::<Masslines<24>>() - size_of::<Masslines<4>>(),
        20 * 144
    );
    assert_eq!(size_of::<Masslines>(), size_of::<Masslines<24>>());
}

#[test]
fn each_sensor_of_a_map_takes_28_bytes() {
    // Beside the columns there are two counters.
    assert_eq!(size_of::<ResultantMap>(), MAX_CHANNELS * 28 + 8);
}
