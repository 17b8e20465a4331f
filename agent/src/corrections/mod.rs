//! Corrections beside the products: ephemerides, and the observations of base stations.
//!
//! - A **recorded** source is read along with the rover's time, so that an epoch is corrected only by records from before it.
//! - A **live** source is read on a thread of its own into an inbox that never makes either side wait: when it is full, the oldest
//!   epoch is dropped. A failure is logged and counted, and the rover goes on without the source.
//!
//! A base's position is given by the user, or else by its stream: messages 1005 and 1006 of RTCM 3, or the
//! approximate position of a RINEX header. The rover's position is only as good as that; see `--base-position`.

mod inbox;
mod recorded;

use std::collections::BTreeSet;
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use cofix_common::formats::decode::Record;
use cofix_common::frames::{Ecef, Geodetic};
use cofix_common::gnss::ObservationEpoch;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;

use crate::Stop;
use crate::config::{CorrectionSource, Corrections};
use crate::input::LOOK;
use crate::input::ntrip::RoverPosition;
use crate::source::SourceError;
use crate::source::products::OwnNavigation;

use self::inbox::Inbox;
use self::recorded::Recorded;

/// Heights above the ellipsoid at which a receiver can be, m.
const HEIGHTS_M: std::ops::RangeInclusive<f64> = -1_000.0..=10_000.0;
/// Longest wait for the end of a thread.
const THREAD_END: Duration = Duration::from_secs(1);

/// Corrections that have arrived.
#[derive(Debug, Default)]
pub(crate) struct News {
    /// Ephemerides.
    pub(crate) navigation: OwnNavigation,
    /// Epochs of bases: number, epoch, position.
    pub(crate) bases: Vec<(usize, ObservationEpoch, Ecef)>,
}

/// All sources of an agent, at work.
pub(crate) struct Feed {
    inputs: Vec<Input>,
    base_position: Option<Ecef>,
    stop: Stop,
    /// Bases whose position has been logged.
    introduced: BTreeSet<usize>,
    skips: Skips,
}

enum Input {
    Recorded(Box<Recorded>),
    Live(Live),
}

/// A live source's thread.
struct Live {
    name: String,
    inbox: Arc<Inbox>,
    thread: JoinHandle<()>,
}

impl Feed {
    /// Opens files and starts threads. `near` is an instant near the beginning of live sources; casters are sent the position of the `rover`.
    pub(crate) fn open(
        corrections: &Corrections,
        near: GpsTime,
        rover: &RoverPosition,
    ) -> Result<Self, SourceError> {
        let stop = Stop::default();
        let mut inputs = Vec::with_capacity(corrections.sources.len());
        for source in &corrections.sources {
            inputs.push(match source {
                CorrectionSource::File(path) => Input::Recorded(Box::new(Recorded::open(path)?)),
                CorrectionSource::Live(source) => {
                    let inbox = Arc::new(Inbox::default());
                    let thread = inbox::start(source, rover, &inbox, &stop, near);
                    let thread =
                        thread.map_err(|cause| SourceError::Live { name: source.to_string(), cause })?;
                    Input::Live(Live { name: source.to_string(), inbox, thread })
                }
            });
        }
        let base_position = corrections.base_position;
        Ok(Self { inputs, base_position, stop, introduced: BTreeSet::new(), skips: Skips::default() })
    }

    /// Waits until every live source has brought a base's epoch or ended, but not longer than `patience`: a recording does
    /// not wait for them later.
    pub(crate) fn wait_for_first(&self, patience: Duration, stop: &Stop) {
        let start = Instant::now();
        for input in &self.inputs {
            let Input::Live(live) = input else { continue };
            while !live.inbox.has_begun() && start.elapsed() < patience && !stop.sleep(LOOK / 4) {}
        }
    }

    /// The corrections that have arrived since the last call, up to an instant.
    ///
    /// # Errors
    /// When a recorded source cannot be used.
    pub(crate) fn until(&mut self, time_gps: GpsTime, stop: &Stop) -> Result<News, SourceError> {
        let mut news = News::default();
        for (base, input) in self.inputs.iter_mut().enumerate() {
            let arrived = match input {
                Input::Recorded(recorded) => recorded.until(time_gps, stop)?,
                Input::Live(live) => live.inbox.take().into(),
            };
            for Arrived { record, station } in arrived {
                let Some(epoch) = news.navigation.take(record) else { continue };
                match self.base_position.or(station) {
                    Some(position) => {
                        if self.introduced.insert(base) {
                            introduce(base, position, self.base_position.is_some());
                        }
                        news.bases.push((base, epoch, position));
                    }
                    None => self.skips.add(Reason::BaseWithoutPosition, || epoch.time_gps.to_string()),
                }
            }
        }
        Ok(news)
    }

    /// Ends the threads. Returns everything skipped.
    pub(crate) fn finish(mut self) -> Skips {
        self.stop.request();
        let start = Instant::now();
        for input in &self.inputs {
            match input {
                Input::Recorded(recorded) => self.skips.merge(&recorded.skips().with_prefix("corrections: ")),
                Input::Live(live) => {
                    // One that hangs in a connection attempt ends with the process.
                    while !live.thread.is_finished() && start.elapsed() < THREAD_END {
                        std::thread::sleep(LOOK / 10);
                    }
                    let skips = live.inbox.skips(&live.name);
                    if skips.count(Reason::SourceBroughtNothing) > 0 {
                        tracing::warn!("no corrections: {} has sent nothing that is used", live.name);
                    }
                    self.skips.merge(&skips.with_prefix("corrections: "));
                }
            }
        }
        std::mem::take(&mut self.skips)
    }
}

impl Drop for Feed {
    /// Stops the threads of a run that fails.
    fn drop(&mut self) {
        self.stop.request();
    }
}

/// Logs the position of a base: its errors are errors of the rover.
fn introduce(base: usize, position: Ecef, is_given: bool) {
    let place = position.ecef_to_geodetic();
    let by = if is_given { "as given" } else { "as its stream states" };
    tracing::info!(
        "corrections {}: a base at {:.7}°, {:.7}°, {:.2} m above the ellipsoid, {by}",
        base + 1,
        place.latitude_deg(),
        place.longitude_deg(),
        place.height_m
    );
}

/// A record, and the station's position as its stream states it.
#[derive(Debug)]
struct Arrived {
    record: Record,
    station: Option<Ecef>,
}

/// `LATITUDE,LONGITUDE,HEIGHT` in degrees and metres above the ellipsoid.
///
/// # Errors
/// When it is not near the Earth's surface.
pub fn approximate_position(text: &str) -> Result<Ecef, String> {
    const FORM: &str = "write LATITUDE,LONGITUDE,HEIGHT in degrees and metres, for example 48.1,11.6,520";
    let numbers: Vec<f64> = text.split(',').filter_map(|field| field.trim().parse().ok()).collect();
    let [latitude_deg, longitude_deg, height_m] = numbers[..] else { return Err(FORM.to_owned()) };
    let is_place = (-90.0..=90.0).contains(&latitude_deg)
        && (-180.0..=360.0).contains(&longitude_deg)
        && HEIGHTS_M.contains(&height_m);
    if is_place {
        Ok(Geodetic::from_degrees(latitude_deg, longitude_deg, height_m).geodetic_to_ecef())
    } else {
        Err(format!("that is no place near the Earth's surface; {FORM}"))
    }
}

/// `X,Y,Z` in metres.
///
/// # Errors
/// When it is not near the Earth's surface.
pub fn base_position(text: &str) -> Result<Ecef, String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|field| field.trim().parse().ok()).collect();
    let [x, y, z] = numbers[..] else {
        return Err("write three numbers, X,Y,Z in metres (ECEF)".to_owned());
    };
    let position = Ecef::new(x, y, z);
    let height_m = position.ecef_to_geodetic().height_m;
    if !HEIGHTS_M.contains(&height_m) {
        return Err(format!("that is {height_m:.0} m above the ellipsoid; write X,Y,Z in metres (ECEF)"));
    }
    Ok(position)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_approximate_position_is_in_degrees() {
        let place = approximate_position("48.1, -11.5,520").unwrap().ecef_to_geodetic();
        assert!((place.latitude_deg() - 48.1).abs() < 1e-9 && (place.longitude_deg() + 11.5).abs() < 1e-9);
        assert!((place.height_m - 520.0).abs() < 1e-6);
        for text in ["48.1,11.6", "91,0,0", "0,361,0", "NaN,0,0", "0,0,20000", "-3817681,3562839,3650159"] {
            let error = approximate_position(text).unwrap_err();
            assert!(error.contains("LATITUDE,LONGITUDE,HEIGHT"), "{text}: {error}");
        }
    }

    #[test]
    fn a_position_is_near_the_ground() {
        let place = base_position("-3817681.1213, 3562839.4311,3650159.1593").unwrap();
        assert_eq!(place, Ecef::new(-3_817_681.121_3, 3_562_839.431_1, 3_650_159.159_3));
        for (text, said) in [
            ("35.1,136.9,104", "above the ellipsoid"),
            ("1,2", "three numbers"),
            ("1,2,x", "three"),
            ("NaN,0,0", "above"),
        ] {
            let error = base_position(text).unwrap_err();
            assert!(error.contains(said), "{text}: {error}");
        }
    }
}
