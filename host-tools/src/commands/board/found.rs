//! The box's answer, on a terminal or as a document.

use super::columns::{self, Wanted};
use crate::box_runs::{BoxTest, Found};
use crate::commands::procedure::{Procedure, parse_method};
use crate::commands::{Failure, Verbosity, print_json, print_numbers, refuse, warn};
use crate::device::{Client, Port};
use crate::identification::{notice_numbers, recommended};
use crate::inputs::InputEntry;
use crate::result::{DeviceEntry, ResultDocument};
use crate::rig::Shaker;
use crate::setup::Setup;
use anstyle::Style;
use massline_core::masslines::Method;
use std::io::Write;

/// Question to the box.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Asked {
    /// Method that finds the masslines; the recommended one if absent
    #[arg(long, value_parser = |name: &str| parse_method(name, ""), value_name = "NAME")]
    method: Option<Method>,
    #[command(flatten)]
    procedure: Procedure,
    /// Input of each channel: drive=1,a1=2, or a file of inputs; by the sensors'
    /// serial numbers if absent
    #[arg(long, value_name = "LIST|FILE", value_parser = columns::parse)]
    inputs: Option<Wanted>,
    /// One JSON document on stdout and nothing else
    #[arg(long)]
    json: bool,
    /// Print numbers that are refused, too
    #[arg(long)]
    anyway: bool,
}

impl Asked {
    /// The test that is meant.
    pub(super) fn plan<'s, P: Port>(
        &self,
        client: &mut Client<'_, P>,
        setup: &'s Setup,
        shaker: Option<&Shaker>,
    ) -> Result<BoxTest<'s>, Failure> {
        let mut wired = columns::choose(client, self.inputs.as_ref())?;
        if let (Some(shaker), None) = (shaker, &self.inputs) {
            name(&mut wired, shaker);
        }
        let method = self.method.unwrap_or_else(|| recommended(setup).0);
        let weighted = self.procedure.weighted();
        Ok(BoxTest::new(client, setup, &wired, method, weighted)?)
    }

    /// Has the box identify, and shows what it has found.
    pub(super) fn answer<P: Port>(
        &self,
        client: &mut Client<'_, P>,
        test: &BoxTest<'_>,
        setup: &Setup,
        verbosity: Verbosity,
    ) -> Result<(), Failure> {
        let found = test.identify(client, self.procedure.iterative)?;
        let why = self.method.is_none().then(|| recommended(setup).1);
        let result = ResultDocument {
            warnings: warnings(&found),
            device: Some(DeviceEntry::from(test.device())),
            ..found.document(&setup.title, why, setup.frame.as_ref())
        };
        if self.json {
            print_json(&result)?;
        } else {
            warn(&result.warnings, verbosity);
            if result.refused.is_none() || self.anyway {
                print(&result, found.seconds).map_err(|e| Failure::stdout(&e))?;
            }
        }
        refuse(result.refused.as_deref())
    }
}

/// Calls the inputs of the box in this program as the fork's channels are called.
fn name(wired: &mut [InputEntry], shaker: &Shaker) {
    for entry in wired {
        entry.channel = shaker.channels().get(usize::from(entry.input)).cloned();
    }
}

/// Warnings about an answer.
fn warnings(found: &Found) -> Vec<String> {
    let mut warnings = Vec::new();
    if !found.unmeasured.is_empty() {
        warnings.push(format!(
            "not measured yet: {}; `massline board measure --run NAME` adds a run to those that the box has",
            found.unmeasured.join(", ")
        ));
    }
    let total = &found.answer.quality;
    let all = total.blocks + total.rejected;
    if total.rejected * 2 > all {
        warnings.push(format!(
            "{} of {all} blocks held a faulty sample; `massline board monitor` shows which channel",
            total.rejected
        ));
    }
    notice_numbers(&found.judged(), &mut warnings);
    warnings
}

fn print(result: &ResultDocument, seconds: f64) -> std::io::Result<()> {
    let mut out = anstream::stdout();
    print_numbers(&mut out, result, None)?;
    if let Some(device) = &result.device {
        let dim = Style::new().dimmed();
        writeln!(
            out,
            "{dim}identified by the box ({} {}) in {seconds:.2} s{dim:#}",
            device.firmware, device.version
        )?;
    }
    Ok(())
}
