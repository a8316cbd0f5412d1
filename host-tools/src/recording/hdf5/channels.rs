//! Channels of all tables of a file, each with a name of its own.

use super::tables::Table;
use crate::printable::printable;
use crate::recording::names::with_units;
use crate::recording::source::Channel;
use std::collections::HashMap;

/// The channels of tables. Names are those that the file has for them, else the name of the
/// dataset, with a number for each of several; groups stand before names that several have.
pub(super) fn channels(tables: &[Table]) -> Vec<Channel> {
    let mut own = Vec::new();
    let mut count: HashMap<String, usize> = HashMap::new();
    for table in tables {
        let across = table.across as usize;
        let named = table.labels.names.len() == across;
        for n in 0..across {
            let numbered = match across {
                1 => table.name.clone(),
                _ => format!("{}:{}", table.name, n + 1),
            };
            let name = table
                .labels
                .names
                .get(n)
                .filter(|name| named && !name.is_empty());
            let name = name
                .filter(|_| across > 1 || table.labels.of_controller)
                .cloned();
            let numbered = printable(&numbered).into_owned();
            let short = name.unwrap_or_else(|| numbered.clone());
            *count.entry(short.clone()).or_default() += 1;
            let units = &table.labels.units;
            let unit = if units.len() == across {
                units.get(n)
            } else {
                units.first()
            };
            let channel = Channel {
                name: short,
                unit: unit.filter(|unit| !unit.is_empty()).cloned(),
                direction: table.labels.directions.get(n).copied().flatten(),
            };
            own.push((channel, format!("{}{numbered}", printable(&table.group))));
        }
    }
    let name = |(channel, long): (Channel, String)| {
        let alone = count.get(&channel.name) == Some(&1);
        Channel {
            name: if alone { channel.name } else { long },
            ..channel
        }
    };
    with_units(own.into_iter().map(name).collect())
}
