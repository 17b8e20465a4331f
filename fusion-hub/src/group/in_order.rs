//! A whole trial after the fact: every epoch that came, in order of its time, as if all had come in time.

use super::Group;
use crate::journal::Entry;
use crate::network::Event;
use crate::network::intake::Intake;

impl Group {
    /// Takes in what journals of one trial tell, whenever it came, and ends; what stands in several counts once. The aligner must be one that
    /// waits for every phone. All epochs are in memory at once.
    ///
    /// # Errors
    /// As [`Group::work`].
    pub fn take_in_order(&mut self, entries: impl Iterator<Item = Entry>) -> anyhow::Result<()> {
        self.intake = Intake::of_a_whole_trial(&self.parts.phones);
        for entry in entries {
            match entry {
                // As if it had been asked for: that it comes again is no fault.
                Entry::Event(Event::Epoch(arrival) | Event::History(arrival)) => {
                    self.intake.history(&arrival);
                }
                Entry::Event(Event::Status(arrival)) => {
                    self.intake.status(&arrival);
                }
                Entry::Event(Event::Refused { phone, skips }) => self.intake.refuse(phone.as_deref(), &skips),
                _ => {}
            }
        }
        self.intake.release_all();
        for phone in 0..self.parts.phones.len() {
            let ready = std::iter::from_fn(|| self.intake.next_ready(phone));
            let mut messages: Vec<_> = ready.collect();
            messages.sort_by_key(|message| message.time_gps);
            for message in messages {
                self.parts.aligner.push(phone, message, self.now);
            }
        }
        self.end(Vec::new())
    }
}
