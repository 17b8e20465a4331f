//! Outputs on the command line: the checks before, and the text at the end of a run.

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::bail;
use cofix_agent::files::{Named, OutputFile, check_absent, check_outputs};
use cofix_hub::outputs::{OutputFiles, Written};
use cofix_hub::replay::Outcome;
use cofix_hub::report::InputFile;
use cofix_hub::report::attention;

/// The report's file, and its content beside the session's outcome.
#[derive(Debug)]
pub struct ReportPlan {
    file: Option<OutputFile>,
    inputs: Vec<Named>,
    /// Inputs in this folder are named relative to it.
    folder: PathBuf,
}

impl ReportPlan {
    /// Checks that the outputs are files of their own and can be written; `inputs` must not be among them, of which those in
    /// `read` go into the report, named from `folder` on.
    pub fn new(
        files: &OutputFiles,
        inputs: &[Named],
        read: Vec<Named>,
        folder: &Path,
    ) -> anyhow::Result<Self> {
        let outputs = files.named();
        check_outputs(&outputs, inputs)?;
        if !files.overwrite {
            outputs.iter().try_for_each(check_absent)?;
        }
        let file =
            files.named_report().map(|report| OutputFile::create(report, files.overwrite)).transpose()?;
        Ok(Self { file, inputs: read, folder: folder.to_owned() })
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
    for Written { title, path, figures, .. } in &outcome.written {
        let figures = if figures.is_empty() { String::new() } else { format!(" ({figures})") };
        writeln!(out, "{title}: {}{figures}", path.display())?;
    }
    Ok(())
}
