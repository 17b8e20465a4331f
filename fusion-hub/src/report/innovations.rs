//! What the filter made of a phone's measurements.

use cofix_common::filter::UpdateReport;
use cofix_common::integrity::Verdict;
use serde::Serialize;

/// Counts and mean normalised innovations of a phone's filter without constraints.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct FilterReport {
    /// Updates of the filter.
    pub updates: u64,
    /// Pseudoranges offered.
    pub codes: u64,
    /// Pseudoranges whose weight was zero, for their innovation.
    pub codes_rejected: u64,
    /// Range rates offered.
    pub rates: u64,
    /// Range rates whose weight was zero.
    pub rates_rejected: u64,
    /// Updates at which the phone stood still.
    pub standing: u64,
    /// Changes of range by carrier phase offered.
    pub changes: u64,
    /// Changes of range that could not be used, for the position to which they refer was not there.
    pub changes_unused: u64,
    /// Mean normalised innovation squared of the code per independent row: 1 if the filter's model is right, below for a cautious one.
    pub code_nis_per_row: Option<f64>,
    /// The same of the Doppler.
    pub rate_nis_per_row: Option<f64>,
    /// The same of the changes of range.
    pub change_nis_per_row: Option<f64>,
    /// Updates at which all pseudoranges were tested against the prediction.
    pub tested: u64,
    /// Those at which they do not agree, after exclusions either.
    pub tests_failed: u64,
    /// Pseudoranges that these tests excluded.
    pub codes_excluded: u64,
    #[serde(skip)]
    code_rows: u64,
    #[serde(skip)]
    rate_rows: u64,
    #[serde(skip)]
    change_rows: u64,
}

impl FilterReport {
    /// Adds an update.
    pub(super) fn push(&mut self, update: &UpdateReport) {
        self.updates += 1;
        self.codes += update.codes.offered as u64;
        self.codes_rejected += (update.codes.offered - update.codes.kept) as u64;
        self.rates += update.rates.offered as u64;
        self.rates_rejected += (update.rates.offered - update.rates.kept) as u64;
        self.standing += u64::from(update.stands);
        self.changes += update.changes.offered as u64;
        self.changes_unused += (update.changes.offered - update.changes.kept) as u64;
        if let Some(test) = update.test {
            self.tested += 1;
            self.tests_failed += u64::from(test.verdict != Verdict::Reliable);
            self.codes_excluded += u64::from(test.excluded);
        }
        self.code_rows += update.code_rows as u64;
        self.change_rows += update.change_rows as u64;
        self.rate_rows += update.rate_rows as u64;
        let add = |mean: &mut Option<f64>, nis: f64, rows: usize, all: u64| {
            let before = mean.unwrap_or_default();
            if all > 0 {
                *mean = Some(before + (nis - before * rows as f64) / all as f64);
            }
        };
        add(&mut self.code_nis_per_row, update.code_nis, update.code_rows, self.code_rows);
        add(&mut self.rate_nis_per_row, update.rate_nis, update.rate_rows, self.rate_rows);
        add(&mut self.change_nis_per_row, update.change_nis, update.change_rows, self.change_rows);
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::filter::Kept;
    use cofix_common::integrity::{Cause, TestReport};

    use super::*;

    #[test]
    fn means_are_over_rows_and_rejections_are_counted() {
        let update = |kept, code_nis, code_rows| UpdateReport {
            codes: Kept { kept, offered: 10 },
            code_nis,
            code_rows,
            ..UpdateReport::default()
        };
        let mut report = FilterReport::default();
        report.push(&update(9, 3.0, 3));
        report.push(&update(6, 10.0, 2));
        let test = |verdict, excluded| {
            let test = Some(TestReport { verdict, global_test: None, excluded });
            UpdateReport { test, ..UpdateReport::default() }
        };
        report.push(&test(Verdict::Reliable, 1));
        report.push(&test(Verdict::Unreliable(Cause::TestsFailed), 3));
        assert_eq!((report.tested, report.tests_failed, report.codes_excluded), (2, 1, 4));
        assert_eq!((report.updates - report.tested, report.codes, report.codes_rejected), (2, 20, 5));
        assert_eq!((report.code_nis_per_row, report.rate_nis_per_row), (Some(13.0 / 5.0), None));
    }
}
