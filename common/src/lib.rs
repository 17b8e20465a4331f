//! Cooperative smartphone positioning: from the bytes of recordings to one position of a group, without any I/O.
//!
//! The processing steps and their modules:
//!
//! | step | module |
//! |:--|:--|
//! | bytes → observations, ephemerides, products, truth | [`formats`] |
//! | vocabulary: satellites, signals, instants, positions | [`gnss`], [`time`], [`frames`] |
//! | satellite positions, clocks, group delays | [`orbit`] |
//! | delays in ionosphere and troposphere | [`atmosphere`] |
//! | observations → corrected observations with standard deviations | [`measurement`] |
//! | position and velocity of one epoch | [`solve`] |
//! | reliability of the epoch (RAIM) | [`integrity`] |
//! | one phone: all of the above and a local filter | [`pipeline`] |
//! | messages between phones and hub | [`wire`] |
//! | epochs of several phones → one common time → fused states | [`fusion`] |
//! | the joint Kalman filter | [`filter`] |
//! | constraints on phones: distances, speeds, vertical velocity, heading | [`constraint`] |
//! | distributions with precise far tails | [`statistics`] |
//! | errors against truth | [`accuracy`] |
//! | seeded scenarios with truth | [`simulation`] |
//!
//! Parsers take bytes and return records; unreadable data is counted in [`skips`]. The estimators are plain structs. Internal units are SI
//! units and radians; degrees appear only in files and on the command line. The crate uses no sockets, no asynchronous runtime, no Zenoh and no
//! Rerun.
//!
//! # From files to a fused position
//!
//! ```
//! use cofix_common::constraint::{Constraint, Distance};
//! use cofix_common::formats::decode::{Decoder, Record};
//! use cofix_common::formats::{packing::decompress, stream::StreamDecoder};
//! use cofix_common::fusion::engine::{Engine, EngineOptions, ScheduledConstraint};
//! use cofix_common::orbit::{NavigationFile, Products};
//! use cofix_common::pipeline::{PhonePipeline, PipelineOptions};
//! use cofix_common::time::GpsTime;
//! use std::sync::Arc;
//!
//! let read = |name: &str| std::fs::read(format!("examples/two-phones/{name}.rnx.gz"));
//! let products = Arc::new(Products::new(Vec::new(), vec![NavigationFile::parse(&read("navigation")?)?]));
//! let names = ["SIM1", "SIM2"].map(str::to_owned);
//! let mut messages = Vec::new();
//! for name in &names {
//!     let mut decoder = StreamDecoder::new(GpsTime::default());
//!     decoder.feed(&decompress(&read(name)?)?)?;
//!     decoder.finish()?;
//!     let mut pipeline = PhonePipeline::new(name, Arc::clone(&products), PipelineOptions::default());
//!     let records = std::iter::from_fn(|| decoder.next_record());
//!     let epochs = records.filter_map(|record| if let Record::Epoch(epoch) = record { Some(epoch) } else { None });
//!     messages.push(epochs.map(|epoch| Some(pipeline.process(&epoch))).collect::<Vec<_>>());
//! }
//! let constraint = Constraint::Distance(Distance { phones: [0, 1], minimum_m: 0.0, maximum_m: 1.5 });
//! let always = ScheduledConstraint { constraint, from_gps: None, to_gps: None };
//! let mut engine = Engine::new(&names, vec![always], EngineOptions::default());
//! // Both phones have an epoch at every second; `fusion::align` aligns other epochs.
//! for (a, b) in messages.remove(0).into_iter().zip(messages.remove(0)) {
//!     let fused = engine.step(vec![a, b]);
//!     if let Some(state) = &fused.phones[0].state {
//!         println!("{} {:?}", fused.time_gps, state.position().ecef_to_geodetic());
//! #       let packed = std::fs::read("examples/two-phones/SIM1.truth.csv.gz")?;
//! #       let (truth, _) = cofix_common::accuracy::Truth::parse_csv(&decompress(&packed)?)?;
//! #       let true_position = truth.at(fused.time_gps, &[1]).ok_or("no truth")?.position;
//! #       assert!(state.position().distance_m(true_position) < 15.0);
//!     }
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod accuracy;
pub mod atmosphere;
pub mod constants;
pub mod constraint;
pub mod filter;
pub mod formats;
pub mod frames;
pub mod fusion;
pub mod gnss;
pub mod integrity;
pub mod measurement;
pub mod orbit;
pub(crate) mod phase;
pub mod pipeline;
pub mod recording;
pub mod settings;
pub mod simulation;
pub mod skips;
pub mod solve;
pub mod statistics;
pub mod time;
pub mod wire;
