//! Channels of a recording that look like load cells and have no entry in the setup: the force that they carry would be
//! missing, and where one axis is shaken the others balance like a lighter body.

use crate::recording::Recording;
use crate::setup::{Excitation, Measured, Run, Setup, measured_in};

/// A name with `#` in the place of its numbers, in lower case.
fn pattern(name: &str) -> String {
    let mut pattern = String::with_capacity(name.len());
    for c in name.chars().flat_map(char::to_lowercase) {
        match (c.is_ascii_digit(), pattern.ends_with('#')) {
            (true, true) => {}
            (true, false) => pattern.push('#'),
            (false, _) => pattern.push(c),
        }
    }
    pattern
}

/// Channels that nothing names, and that are called as load cells but for their numbers. Where accelerometers are called
/// like that, too, the unit has to be one of force or moment.
pub(super) fn unlisted(setup: &Setup, run: &Run, recording: &Recording) -> Vec<String> {
    let cells: Vec<String> = setup
        .load_cells
        .iter()
        .map(|c| pattern(&c.channel))
        .collect();
    let accelerometers = setup.accelerometers.iter().map(|a| pattern(&a.channel));
    let others: Vec<String> = accelerometers.collect();
    let part = match run.excitation {
        Excitation::Sine => ".re",
        _ => "",
    };
    let is_cell = |name: &&str| {
        let pattern = pattern(name);
        // Units are searched by name, which takes long among many channels.
        cells.contains(&pattern) && {
            let unit = recording.unit(&format!("{name}{part}"));
            match unit.map(measured_in) {
                Some(Some(measured)) => matches!(measured, Measured::Force | Measured::Moment),
                _ => !others.contains(&pattern),
            }
        }
    };
    let ignored = recording.ignored().iter();
    let names = ignored.filter_map(|column| column.strip_suffix(part));
    names.filter(is_cell).map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Channels of a recording with this header that look like load cells.
    fn found(header: &str) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let columns = header.split(',').count();
        let row = vec!["0.5"; columns].join(",") + "\n";
        std::fs::write(
            folder.path().join("z.csv"),
            format!("{header}\n{}", row.repeat(20)),
        )
        .unwrap();
        let text = "[processing]\nsample_rate = 512.0\naveraging_band = [2, 40]\n\
            [[accelerometer]]\nchannel = \"T1:Z\"\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\nmount = \"interface\"\n\
            [[load_cell]]\nchannel = \"Cell 1.z\"\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\n\
            [[load_cell]]\nchannel = \"T12:Z\"\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\n\
            [[run]]\nname = \"z\"\nrecording = \"z.csv\"\n";
        let setup = Setup::from_str(text, &folder.path().join("setup.toml")).unwrap();
        let names: Vec<&str> = setup.sensor_channels().collect();
        let recording = setup.open_recording(&setup.runs[0], &names).unwrap();
        unlisted(&setup, &setup.runs[0], &recording)
    }

    #[test]
    fn load_cells_without_an_entry_are_found() {
        let listed = "T1:Z,Cell 1.z,T12:Z";
        assert!(found(listed).is_empty());
        // Other axes are not measured, other names are other sensors.
        assert!(found(&format!("{listed},Cell 1.x,cell,drive,time")).is_empty());
        assert_eq!(
            found(&format!("{listed},cell 02.z,Cell 3.z [N]")),
            ["cell 02.z", "Cell 3.z"]
        );
        // Accelerometers are called like that, too.
        assert!(
            found(&format!("{listed},T3:Z,T4:Z [g],Cell 4.z [V],Cell 5.z [g]")) == ["Cell 4.z"]
        );
        assert_eq!(found(&format!("{listed},T3:Z [kN],T4:Z [g]")), ["T3:Z"]);
    }
}
