//! From source to wire.

use std::sync::Arc;

use cofix_common::measurement::DifferentialCounts;
use cofix_common::orbit::Products;
use cofix_common::pipeline::PhonePipeline;
use cofix_common::skips::{Reason, Skips};
use cofix_common::time::GpsTime;
use cofix_common::wire::{EpochMessage, PhoneStatus, check_name};

use crate::clock;
use crate::corrections::{Feed, News};
use crate::input::ntrip::RoverPosition;
use crate::publication::link::{self, LinkError};
use crate::publication::pace::Pace;
use crate::publication::{Publication, PublicationError};
use crate::source::products::{Loaded, OwnNavigation, note_shortcomings};
use crate::source::{self, Opened, Reading, SourceError};
use crate::{AgentConfig, Source, Speed, Stop};

/// Why an agent's run failed.
#[derive(Debug, thiserror::Error)]
pub enum AgentError {
    /// A file cannot be used.
    #[error(transparent)]
    Source(#[from] SourceError),
    /// The hub cannot be reached.
    #[error(transparent)]
    Link(#[from] LinkError),
    /// Two kinds of corrections that do not go together.
    #[error(
        "recorded corrections and a base station do not go together: the base's are right only for the models that the agent uses; \
         choose one of them"
    )]
    TwoCorrections,
    /// Publishing failed.
    #[error(transparent)]
    Publication(#[from] PublicationError),
    /// The hub did not get everything.
    #[error(
        "the hub has confirmed {confirmed} of {published} epochs: it stopped, or missed more than the agent keeps"
    )]
    NotConfirmed {
        /// Epochs that the hub has.
        confirmed: u64,
        /// Epochs published.
        published: u64,
    },
    /// The hub never answered how many epochs it has.
    #[error(
        "{published} epochs were published and none is confirmed: the hub did not answer how many of them it has; it ended, the connection is \
         lost, or the link is too slow for what waits on it (the hub's report tells)"
    )]
    Unanswered {
        /// Epochs published.
        published: u64,
    },
}

/// The result of an agent's run.
#[derive(Clone, Debug)]
pub struct AgentReport {
    /// Epochs published.
    pub epochs_published: u64,
    /// Epochs with a position of their own.
    pub solutions: u64,
    /// Whether it was asked to stop before the end.
    pub stopped: bool,
    /// Counts of observations by how base stations corrected them.
    pub corrections: DifferentialCounts,
    /// Everything skipped, from the file to the solution.
    pub skips: Skips,
}

/// Runs an agent to the end of its source, or until asked to stop. Blocks.
///
/// # Errors
/// When a name or the source cannot be used, the hub cannot be reached, does not listen or does not know the phone, or did
/// not confirm all epochs.
pub fn run(config: &AgentConfig, stop: &Stop) -> Result<AgentReport, AgentError> {
    run_watched(config, stop, &mut |_| {})
}

/// Like [`run`]; `watch` is shown every message that was published.
///
/// # Errors
/// As of [`run`].
pub fn run_watched(
    config: &AgentConfig,
    stop: &Stop,
    watch: &mut dyn FnMut(&EpochMessage),
) -> Result<AgentReport, AgentError> {
    for name in [&config.group, &config.phone] {
        check_name(name).map_err(PublicationError::from)?;
    }
    let Prepared { products, expected, mut opened, feed, rover, mut skips } = Prepared::new(config, stop)?;
    let Some(session) = link::connect(config, stop)? else {
        let corrections = DifferentialCounts::default();
        return Ok(AgentReport { epochs_published: 0, solutions: 0, stopped: true, corrections, skips });
    };
    let publication = Publication::declare(session, config)?;
    let mut pipeline = PhonePipeline::new(&config.phone, Arc::clone(&products), config.pipeline.clone());
    if feed.is_some() {
        pipeline.use_bases(config.corrections.options);
    }
    let mut work = Work {
        config,
        stop,
        products,
        pipeline,
        publication,
        feed,
        rover,
        solutions: 0,
        terms_known: false,
        channels_known: 0,
        shortcomings: Skips::default(),
        watch,
    };
    let outcome = work.publish(&mut opened, expected);
    skips.merge(&work.shortcomings);
    skips.merge(&work.pipeline.skips());
    if let Some(feed) = work.feed.take() {
        skips.merge(&feed.finish());
    }
    if let (None, Some(records)) = (expected, opened.records()) {
        // The survey of a recorded source has counted the same already.
        skips.merge(&records.skips());
    }
    let outcome = outcome.and_then(|()| some_epoch(config, work.publication.published(), &skips, stop));
    let finished = finish(config, &work.publication, &outcome, &skips, stop);
    let report = AgentReport {
        epochs_published: work.publication.published(),
        solutions: work.solutions,
        stopped: stop.is_requested(),
        corrections: work.pipeline.differential_counts(),
        skips,
    };
    if report.solutions == 0 && report.epochs_published > 0 {
        let skipped = report.skips.get(Reason::EpochWithoutSolution);
        let first = skipped.map_or(String::new(), |skip| format!(": {}", skip.first));
        let (phone, epochs) = (&config.phone, report.epochs_published);
        tracing::warn!("{phone}: none of {epochs} epochs has a position{first}");
    }
    let closed = work.publication.close();
    outcome?;
    finished?;
    closed?;
    Ok(report)
}

/// Everything that is prepared before the first epoch.
struct Prepared<'a> {
    products: Arc<Products>,
    /// Epochs of a recorded source.
    expected: Option<u64>,
    opened: Opened<'a>,
    feed: Option<Feed>,
    rover: RoverPosition,
    skips: Skips,
}

impl<'a> Prepared<'a> {
    fn new(config: &'a AgentConfig, stop: &Stop) -> Result<Self, AgentError> {
        if config.pipeline.recorded_corrections && !config.corrections.sources.is_empty() {
            return Err(AgentError::TwoCorrections);
        }
        let loaded = Loaded::read(&config.products)?;
        let Loaded { mut products, mut skips, near } = loaded;
        let mut reading = Reading { near, log: config.log.clone(), dates: None, raw: config.raw_files() };
        let has_orbits = products.has_orbits();
        let mut expected = None;
        let rover = RoverPosition::default();
        rover.suppose(config.approximate_position);
        if matches!(config.source, Source::Live { .. }) {
            if !has_orbits {
                tracing::info!("no orbits are named: positions begin when the source has sent its own");
            }
        } else {
            let survey = source::survey(&config.source, &reading, stop)?;
            let states_its_own = survey.has_corrections && config.pipeline.recorded_corrections;
            let others = states_its_own || survey.has_phone_states || !config.corrections.sources.is_empty();
            if !has_orbits && survey.navigation.is_empty() && !others && !stop.is_requested() {
                return Err(SourceError::NoProducts.into());
            }
            survey.navigation.add_to(&mut products);
            skips.merge(&survey.skips);
            rover.suppose(survey.station);
            expected = Some(survey.epochs);
            reading.dates = survey.dates;
        }
        let feed = if config.corrections.sources.is_empty() {
            None
        } else {
            rover.suppose(config.corrections.base_position);
            let near = config.source.near().unwrap_or_else(clock::now);
            Some(Feed::open(&config.corrections, near, &rover)?)
        };
        let opened = Opened::open(&config.source, &reading, &rover)?;
        Ok(Self { products, expected, opened, feed, rover, skips })
    }
}

/// An agent at work.
struct Work<'a> {
    config: &'a AgentConfig,
    stop: &'a Stop,
    products: Arc<Products>,
    pipeline: PhonePipeline,
    publication: Publication,
    /// Sources of corrections beside the products.
    feed: Option<Feed>,
    /// Where the phone is, for casters.
    rover: RoverPosition,
    /// Epochs that have a position by themselves.
    solutions: u64,
    /// Whether the ionosphere terms of a live source went into the products.
    terms_known: bool,
    /// GLONASS channels of a live source that went into the products.
    channels_known: usize,
    shortcomings: Skips,
    watch: &'a mut dyn FnMut(&EpochMessage),
}

impl Work<'_> {
    /// Publishes every epoch; `expected` is their number, of a recorded source.
    fn publish(&mut self, opened: &mut Opened<'_>, expected: Option<u64>) -> Result<(), AgentError> {
        if !self.publication.wait_for_listener(self.config.patience, self.stop)? {
            return Ok(());
        }
        self.publication.introduce()?;
        let summary = summary(self.config);
        self.publication.status(PhoneStatus::Started { summary, epochs_expected: expected })?;
        let is_live = expected.is_none();
        if let Some(feed) = self.feed.as_ref().filter(|_| !is_live) {
            feed.wait_for_first(self.config.patience, self.stop);
        }
        let mut pace = Pace::new(if is_live { Speed::Maximum } else { self.config.speed });
        while let Some(record) = opened.next(self.stop)? {
            let mut own = OwnNavigation::default();
            let epoch = own.take(record);
            if is_live {
                self.take_navigation(own, opened);
            }
            let Some(epoch) = epoch else { continue };
            self.rover.suppose(opened.records().and_then(|records| records.decoder().station()));
            if let Some(times) = pace.unset_times() {
                pace.set(epoch.time_gps, self.publication.first_due_in_s(epoch.time_gps, times));
            }
            // Of a live source everything is published that has come until the request to stop.
            if pace.wait(epoch.time_gps, self.stop) && !is_live {
                break;
            }
            self.take_corrections(epoch.time_gps)?;
            let is_first = self.publication.published() == 0;
            note_shortcomings(epoch.time_gps, is_first, &self.products, &mut self.shortcomings);
            let message = match opened.records() {
                Some(records) => self.pipeline.process_last(&epoch, records.decoder()),
                None => self.pipeline.process(&epoch),
            };
            self.solutions += u64::from(message.wls.is_some());
            if let Some(position) = self.pipeline.position() {
                self.rover.set(position);
            }
            self.publication.epoch(&message)?;
            (self.watch)(&message);
        }
        Ok(())
    }

    /// Takes the corrections that are there for an epoch.
    fn take_corrections(&mut self, time_gps: GpsTime) -> Result<(), AgentError> {
        let Some(feed) = &mut self.feed else { return Ok(()) };
        let News { navigation, bases } = feed.until(time_gps, self.stop)?;
        if !navigation.is_empty() {
            self.add_navigation(navigation);
        }
        for (base, epoch, position) in bases {
            self.pipeline.add_base_epoch(base, epoch, position);
        }
        Ok(())
    }

    /// Takes the navigation messages that a live source has sent: they serve from now on.
    fn take_navigation(&mut self, mut own: OwnNavigation, opened: &Opened<'_>) {
        if !self.terms_known
            && let Some(records) = opened.records()
        {
            own.take_terms(records.decoder());
            self.terms_known = own.file.ionosphere.gps.is_some();
        }
        let channels =
            opened.records().map(|records| records.decoder().glonass_channels()).unwrap_or_default();
        let has_channels = channels.len() > self.channels_known;
        if own.is_empty() && own.file.ionosphere.gps.is_none() && !has_channels {
            return;
        }
        self.channels_known = channels.len();
        Arc::make_mut(&mut self.products).set_glonass_channels(&channels);
        self.add_navigation(own);
    }

    fn add_navigation(&mut self, navigation: OwnNavigation) {
        Arc::make_mut(&mut self.products).add_navigation(navigation.file);
        self.pipeline.set_products(Arc::clone(&self.products));
    }
}

/// A live source that ends by itself must have brought something. (Recorded ones were surveyed.)
fn some_epoch(config: &AgentConfig, published: u64, skips: &Skips, stop: &Stop) -> Result<(), AgentError> {
    match &config.source {
        Source::Live { from, .. } if published == 0 && !stop.is_requested() => {
            let cause = format!("it ended without one epoch{}", source::error::and_skipped(skips));
            Err(SourceError::Live { name: from.to_string(), cause: std::io::Error::other(cause) }.into())
        }
        _ => Ok(()),
    }
}

/// Publishes the last status and waits until the hub has every epoch.
fn finish(
    config: &AgentConfig,
    publication: &Publication,
    outcome: &Result<(), AgentError>,
    skips: &Skips,
    stop: &Stop,
) -> Result<(), AgentError> {
    if matches!(outcome, Err(AgentError::Publication(PublicationError::UnknownPhone { .. }))) {
        return Ok(());
    }
    // A live source has no other end than a request to stop.
    let is_live = matches!(config.source, Source::Live { .. });
    let cut = stop.is_requested() && !is_live;
    let stopped = cut.then(|| "stopped before the end of the source".to_owned());
    let error = outcome.as_ref().err().map(ToString::to_string).or(stopped);
    let published = publication.published();
    publication.status(PhoneStatus::Finished { epochs_published: published, skips: skips.clone(), error })?;
    if outcome.is_err() || published == 0 {
        return Ok(());
    }
    let last_wait = if is_live { &Stop::default() } else { stop };
    match publication.wait_for_receipt(config.patience, last_wait) {
        Some(confirmed) if confirmed >= published => Ok(()),
        Some(confirmed) => Err(AgentError::NotConfirmed { confirmed, published }),
        None => Err(AgentError::Unanswered { published }),
    }
}

fn summary(config: &AgentConfig) -> String {
    let source = match &config.source {
        Source::File { path, .. } => path.display().to_string(),
        Source::Live { from, .. } => return format!("{from}, live"),
        Source::Epochs(_) => "epochs in memory".to_owned(),
    };
    match config.speed {
        Speed::Maximum => format!("{source}, as fast as it goes"),
        Speed::Times(times) => format!("{source}, {times} times real time"),
    }
}

#[cfg(test)]
mod tests {
    use cofix_common::orbit::Sp3;

    use super::*;
    use crate::ProductSource;

    const OBSERVATIONS: &str =
        "     3.04           OBSERVATION DATA    M                   RINEX VERSION / TYPE
R    2 C1C S1C                                              SYS / # / OBS TYPES
  2 R01  1 R05 -4                                           GLONASS SLOT / FRQ #
                                                            END OF HEADER
> 2020 08 13 14 19  2.0000000  0  1
R05  22100000.000          45.000
";
    const ORBITS: &str = "#dP2020  8 13 14  0  0.00000000       1 d+D   IGS14 FIT  TST
## 2118 396000.00000000   900.00000000 59074 0.5833333333333
%c M  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc
*  2020  8 13 14  0  0.00000000
PR05  14220.122558 -20433.516601   5539.755371     24.583190
EOF
";

    #[test]
    fn glonass_channels_of_the_header_go_into_the_products() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("phone.rnx");
        std::fs::write(&path, OBSERVATIONS).unwrap();
        let products = Products::new(vec![Sp3::parse(ORBITS.as_bytes()).unwrap()], Vec::new());
        let products = ProductSource::Loaded(Arc::new(products));
        let config =
            AgentConfig { products, ..AgentConfig::new("g", "p", Source::File { path, near: None }) };
        let prepared = Prepared::new(&config, &Stop::default()).unwrap();
        let channel = |satellite: &str| {
            let time = "2020-08-13T14:19:02".parse().unwrap();
            prepared.products.glonass_channel(satellite.parse().unwrap(), time)
        };
        assert_eq!((channel("R01"), channel("R05"), channel("R06")), (Some(1), Some(-4), None));
    }
}
