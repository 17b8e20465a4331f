//! Receiver clocks in use at one epoch.

use crate::gnss::ClockGroup;
use crate::measurement::CorrectedObservation;

/// Clock groups in order of first appearance.
#[derive(Clone, Debug, Default)]
pub(crate) struct ClockGroups {
    groups: Vec<ClockGroup>,
    clocks_m: Vec<f64>,
}

impl ClockGroups {
    pub fn of<'a>(observations: impl Iterator<Item = &'a CorrectedObservation>) -> Self {
        let mut groups = Vec::with_capacity(8);
        for observation in observations {
            let group = observation.clock_group();
            if !groups.contains(&group) {
                groups.push(group);
            }
        }
        Self { groups, clocks_m: Vec::new() }
    }

    pub fn with_clocks(self, clocks_m: Vec<f64>) -> Self {
        Self { clocks_m, ..self }
    }

    pub const fn len(&self) -> usize {
        self.groups.len()
    }

    /// The groups.
    pub fn list(&self) -> &[ClockGroup] {
        &self.groups
    }

    /// Index of a group; every observation from which the groups were made has one.
    pub fn index(&self, group: ClockGroup) -> usize {
        self.groups.iter().position(|g| *g == group).unwrap_or_default()
    }

    pub fn clock_m(&self, group: ClockGroup) -> Option<f64> {
        self.iter().find(|(g, _)| *g == group).map(|(_, clock_m)| clock_m)
    }

    pub fn iter(&self) -> impl Iterator<Item = (ClockGroup, f64)> + '_ {
        self.groups.iter().copied().zip(self.clocks_m.iter().copied())
    }
}
