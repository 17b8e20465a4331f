//! RINEX observation and navigation files.
