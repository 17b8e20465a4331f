//! An inspection as text.

use std::fmt;

use super::{ConstellationReport, EventReport, Inspection, SignalReport};

impl fmt::Display for Inspection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let format = self.format.map_or("unknown format".to_owned(), |format| format.to_string());
        writeln!(f, "{}: {format}", self.file)?;
        let (first, last) = (self.first_gps.as_deref(), self.last_gps.as_deref());
        match (first, last) {
            (Some(first), Some(last)) => {
                writeln!(f, "  span        {first} to {last} GPST, {:.3} s", self.span_s)?;
            }
            _ => writeln!(f, "  span        none: there is no epoch")?,
        }
        let interval = self.interval_s.map_or("unknown interval".to_owned(), |s| format!("every {s} s"));
        writeln!(
            f,
            "  epochs      {}, {interval}; {} after a power failure",
            self.epochs, self.power_failures
        )?;
        self.gaps(f)?;
        self.events(f)?;
        if let Some(spread) = self.satellites_per_epoch {
            let (low, mean, high) = (spread.minimum, spread.mean, spread.maximum);
            writeln!(f, "  satellites  {low:.0} to {high:.0} per epoch, {mean:.1} in the mean")?;
        }
        self.signals(f)?;
        self.clock(f)?;
        let cycled =
            if self.duty_cycled.is_empty() { "none".to_owned() } else { self.duty_cycled.join(", ") };
        writeln!(f, "  duty cycled {cycled}")?;
        let ionosphere = if self.ionosphere { ", with Klobuchar coefficients" } else { "" };
        writeln!(f, "  navigation  {} ephemerides in the recording itself{ionosphere}", self.ephemerides)?;
        self.phone.iter().try_for_each(|phone| write!(f, "{phone}"))?;
        for mask in &self.masks {
            let idle = if mask.names_nothing { ", it names nothing that occurs" } else { "" };
            writeln!(f, "  mask        {}: {} observations{idle}", mask.name, mask.count)?;
        }
        for (reason, skip) in self.skips.iter() {
            writeln!(f, "  skipped     {} × {reason}, first: {}", skip.count, skip.first)?;
        }
        self.trial.iter().try_for_each(|trial| write!(f, "{trial}"))
    }
}

impl Inspection {
    fn gaps(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.gaps.count == 0 {
            return writeln!(f, "  gaps        none");
        }
        let (count, missing, longest) = (self.gaps.count, self.gaps.missing_epochs, self.gaps.longest_s);
        writeln!(f, "  gaps        {count}, {missing} epochs missing, longest {longest:.3} s")?;
        for gap in self.gaps.first.iter().take(3) {
            writeln!(f, "              {:.3} s after {}", gap.duration_s, gap.after_gps)?;
        }
        Ok(())
    }

    fn events(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.events.count == 0 {
            return Ok(());
        }
        let kinds: Vec<_> =
            self.events.by_kind.iter().map(|(kind, count)| format!("{count} × {kind}")).collect();
        writeln!(f, "  events      {}", kinds.join(", "))?;
        self.events
            .first
            .iter()
            .take(3)
            .try_for_each(|event| writeln!(f, "              {}", described(event)))
    }

    fn signals(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "  signal    sats observations  no code no phase  no rate no C/N0   C/N0 min mean  max  slips half"
        )?;
        for constellation in &self.constellations {
            for signal in &constellation.signals {
                line(f, constellation, signal)?;
            }
            if !constellation.without_channel.is_empty() {
                writeln!(f, "    no frequency channel: {}", constellation.without_channel.join(", "))?;
            }
        }
        Ok(())
    }

    fn clock(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(drift_mps) = self.clock_jumps.drift_mps {
            writeln!(f, "  clock drift {drift_mps:.1} m/s of pseudoranges against Doppler, in the median")?;
        }
        writeln!(f, "  clock jumps {}", self.clock_jumps)?;
        for jump in self.clock_jumps.first.iter().take(3) {
            writeln!(f, "              {:.1} m at {} ({} signals)", jump.jump_m, jump.at_gps, jump.signals)?;
        }
        Ok(())
    }
}

fn described(event: &EventReport) -> String {
    let when = match (&event.at_gps, &event.after_gps) {
        (Some(at), _) => format!("at {at}"),
        (None, Some(after)) => format!("after {after}"),
        (None, None) => "before the first epoch".to_owned(),
    };
    let what = match (&event.first_line, event.slips) {
        (Some(line), _) => format!(": '{line}'"),
        (None, 0) => String::new(),
        (None, slips) => format!(": {slips} phases"),
    };
    format!("{} {when}{what}", event.kind)
}

fn line(f: &mut fmt::Formatter<'_>, system: &ConstellationReport, signal: &SignalReport) -> fmt::Result {
    let cn0 = signal.cn0_dbhz.map_or(format!("{:>8} {:>4} {:>4}", "-", "-", "-"), |spread| {
        format!("{:8.1} {:4.1} {:4.1}", spread.minimum, spread.mean, spread.maximum)
    });
    writeln!(
        f,
        "    {} {:<5} {:4} {:12} {:8} {:8} {:8} {:7}   {cn0} {:6} {:4}",
        system.system,
        signal.signal,
        signal.satellites,
        signal.observations,
        signal.missing_pseudorange,
        signal.missing_phase,
        signal.missing_doppler,
        signal.missing_cn0,
        signal.slips,
        signal.half_cycles
    )
}
