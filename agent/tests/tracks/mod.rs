//! The solutions of one phone over a recording, as they are scored.

use cofix_common::accuracy::{Accuracy, Solution, Truth, score};
use cofix_common::time::GpsTime;
use cofix_common::wire::EpochMessage;

#[derive(Default)]
pub struct Tracks {
    pub times: Vec<GpsTime>,
    pub wls: Vec<Solution>,
    pub local: Vec<Solution>,
}

impl Tracks {
    pub fn push(&mut self, message: EpochMessage) {
        let time_gps = message.time_gps;
        self.times.push(time_gps);
        self.wls.extend(message.wls.map(|solution| Solution {
            time_gps,
            position: solution.position,
            covariance: solution.position_covariance,
        }));
        self.local.extend(message.local.map(|state| Solution {
            time_gps,
            position: state.position(),
            covariance: state.covariance.fixed_view::<3, 3>(0, 0).into_owned(),
        }));
    }

    /// The accuracy of the epoch-wise solution and of the local filter.
    pub fn scores(&self, truth: &Truth) -> [Option<Accuracy>; 2] {
        let span = (self.times[0], self.times[self.times.len() - 1]);
        [&self.wls, &self.local].map(|solutions| score(truth, &[1], span, solutions))
    }
}
