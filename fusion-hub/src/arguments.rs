//! Outputs on the command line: where they go, and what is said at the end.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::bail;
use cofix_agent::files::{Named, OutputFile, check_absent, check_outputs};
use cofix_hub::attention;
use cofix_hub::replay::Outcome;
use cofix_hub::report::InputFile;

/// Where outputs go.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Outputs")]
pub struct OutputArguments {
    /// Where to record to (.rrd)
    #[arg(long, value_name = "FILE")]
    pub recording: Option<PathBuf>,
    /// Where to write the JSON report (docs/report.md)
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Where to write the fused positions (CSV)
    #[arg(long, value_name = "FILE")]
    pub positions: Option<PathBuf>,
    /// Replace files that are there
    #[arg(long)]
    pub overwrite: bool,
}

/// The report's file, and what goes into it beside the session's outcome.
#[derive(Debug)]
pub struct ReportPlan {
    file: Option<OutputFile>,
    inputs: Vec<Named>,
    /// Inputs in here are named from here.
    folder: PathBuf,
}

impl OutputArguments {
    /// Checks that the outputs are files of their own and can be written; `inputs` must not be among them, of which those in
    /// `read` go into the report, named from `folder` on.
    pub fn prepare(&self, inputs: &[Named], read: Vec<Named>, folder: &Path) -> anyhow::Result<ReportPlan> {
        let named = |what, path: &Option<PathBuf>| path.as_deref().map(|path| Named::new(what, path));
        let report = named("the report", &self.report);
        let outputs = [
            named("the recording", &self.recording),
            report.clone(),
            named("the positions", &self.positions),
        ];
        let outputs: Vec<Named> = outputs.into_iter().flatten().collect();
        check_outputs(&outputs, inputs)?;
        if !self.overwrite {
            outputs.iter().try_for_each(check_absent)?;
        }
        let file = report.map(|report| OutputFile::create(report, self.overwrite)).transpose()?;
        Ok(ReportPlan { file, inputs: read, folder: folder.to_owned() })
    }
}

/// Prints the table and what needs attention, then writes the report.
pub fn conclude(mut outcome: Outcome, plan: ReportPlan) -> anyhow::Result<()> {
    let printed = print(&outcome);
    if let Some(file) = plan.file {
        let inputs = plan.inputs.iter().map(|input| InputFile::read(input, &plan.folder));
        outcome.report.inputs = inputs.collect::<anyhow::Result<_>>()?;
        file.write_whole(&outcome.report.json()?)?;
    }
    printed?;
    if let Some(failure) = &outcome.failure {
        bail!("{failure}");
    }
    Ok(())
}

fn print(outcome: &Outcome) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{}\n", outcome.table.trim_end())?;
    let constraints = outcome.report.constraint_table();
    if !constraints.is_empty() {
        writeln!(out, "{constraints}")?;
    }
    let skipped = outcome.report.skipped();
    if !skipped.is_empty() {
        writeln!(out, "Skipped (the report names the first of each):\n{skipped}\n")?;
    }
    writeln!(out, "{}\n", attention::render(&outcome.report.attention))?;
    if let Some((path, recorded)) = &outcome.recording {
        let megabytes = recorded.bytes as f64 * 1e-6;
        writeln!(out, "Recording: {} ({megabytes:.1} MB, {} epochs)", path.display(), recorded.epochs)?;
    }
    if let Some(path) = &outcome.positions {
        writeln!(out, "Positions: {}", path.display())?;
    }
    Ok(())
}
